"""A written network as a fast model: against its exact solution, and derivatives against differences."""

import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from spindle_fem.definition.network_load import validate_network_machine
from spindle_fem.effects.framework.term import Term, TermParameter
from spindle_fem.errors import FaultsError, SpecError
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.recordings.align import read_recording
from spindle_fem.solvers.network_start import initial_state, magnitude_history
from tests.support.network_runs import modal_solution
from tests.support.written_texts import network_text

MACHINE = network_text(
    "small motor",
    {"winding": ("180 J/K", 0.5), "body": ("500 J/K", 0.5), "foot": ("900 J/K", 0.5)},
    {
        "winding|body": ("2.3 W/K", 0.5),
        "body|ambient": ("0.5 W/K", 0.5),
        "body|foot": ("1.5 W/K", 0.5),
        "foot|bench": ("0.8 W/K", 0.5),
    },
    [
        ("winding", "power", ("0.8 W/W", 0.1)),
        ("body", "speed", ("15 W", 0.3), {"reference": "1000 rpm", "exponent": 1.5}),
    ],
    boundaries={"ambient": "ambient", "bench": {"low": "15 degC", "high": "25 degC"}},
)

MANIFEST = """
schema = "spindle-fem/recording/1"
name = "synthetic"
data = "data.csv"
time = {column = "time_s", unit = "s"}
channel = [
{column = "T_winding", role = "temperature", probe = "winding", unit = "degC", sigma = 0.1},
{column = "T_body", role = "temperature", probe = "body", unit = "degC", sigma = 0.1},
{column = "T_room", role = "input", drives = "ambient", unit = "degC"},
{column = "P", role = "input", drives = "power", unit = "W", hold = "previous"},
{column = "n", role = "input", drives = "speed", unit = "rpm", hold = "previous"},
]
"""


def written(folder, *, times=None, manifest=MANIFEST):
    times = np.arange(0.0, 9000.0, 10.0) if times is None else times
    frame = pd.DataFrame(
        {
            "time_s": times,
            "T_winding": 24.0 + times / 1000.0,
            "T_body": 22.0 + times / 2000.0,
            "T_room": 21.0 + np.sin(times / 1500.0),
            "P": np.where(times % 2400.0 < 900.0, 90.0, 10.0),
            "n": np.where(times % 3000.0 < 1500.0, 600.0, 1500.0),
        }
    )
    frame.to_csv(folder / "data.csv", index=False)
    (folder / "recording.toml").write_text(manifest)
    return read_recording(folder)


@pytest.fixture(scope="module")
def fast():
    return fast_network(build_network(validate_network_machine(tomllib.loads(MACHINE), "test").network))


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return written(tmp_path_factory.mktemp("network"))


@pytest.fixture(scope="module")
def broken(tmp_path_factory):
    """Two gaps long enough for a new segment."""
    times = np.arange(0.0, 20000.0, 10.0)
    times = times[(times < 4000.0) | ((times > 7000.0) & (times < 11000.0)) | (times > 15000.0)]
    return written(tmp_path_factory.mktemp("gaps"), times=times)


FREE = (
    "conductance.winding|body",
    "conductance.body|ambient",
    "conductance.foot|bench",
    "capacity.body",
    "gain.winding.power",
    "gain.body.speed",
    "temperature.bench",
)


def by_modes(network, recording):
    """Every node at every stamp from the network's modes, every segment from its first readings."""
    history, found = magnitude_history(network, recording), []
    for segment, (begin, end) in enumerate(recording.segments):
        part = history.cut(begin, end)
        state, _ = initial_state(network, part, recording.first_readings(segment))
        found.append(modal_solution(network, part, state))
    return np.concatenate(found)


@pytest.mark.parametrize("which", ["recording", "broken"])
def test_equals_the_exact_solution(fast, which, request):
    recording = request.getfixturevalue(which)
    drive = fast.inputs.drive(recording)
    start = fast.inputs.start(recording, drive, derivatives=FREE)
    run = simulate_fast(fast, drive, start, derivatives=FREE)
    network, step = fast.network, 1e-4
    assert len(recording.segments) == (3 if which == "broken" else 1)
    assert np.ptp(run.temperature[:, 0]) > 15.0
    assert_allclose(run.temperature, by_modes(network, recording), atol=1e-6)
    for column, name in enumerate(FREE):
        ends = [by_modes(fast.inputs.moved({name: np.exp(s * step)}), recording) for s in (1.0, -1.0)]
        assert_allclose(run.sensitivity[:, :, column], (ends[0] - ends[1]) / (2.0 * step), atol=1e-5)


class Warming(Term):
    """Heat with a memory, a friction that falls with temperature, a link and a boundary that move."""

    name = "warming"
    parameters = (
        TermParameter("heat", 20.0, 1.0, "W"),
        TermParameter("slope", 0.01, 1.0, "1/K"),
        TermParameter("shift", 3.0, 1.0, "K", logarithmic=False),
        TermParameter("growth", 0.02, 1.0, "1/K"),
    )
    heat_places = ("foot", "fluid.body|ambient")
    coefficients = ("link.foot|bench",)
    bearings = ("body.speed",)
    reads = ("body", "winding")
    n_states = 1

    def heat(self, context):
        warm = context.parameters["heat"] * context.state[0]
        return np.stack([warm, context.parameters["shift"] + 0.0 * context.temperatures[0]])

    def factor(self, context):
        return 1.0 + context.parameters["growth"] * (context.temperatures[:1] - 293.15)

    def friction(self, context):
        return np.exp(-context.parameters["slope"] * (context.temperatures[1:2] - 293.15))

    def advance(self, context, step):
        target = (context.temperatures[1:2] - context.temperatures[:1]) / 10.0
        return target + (context.state - target) * np.exp(-step / 600.0)


def by_differences(fast, recording, name, terms, values, logarithmic=True):
    drive = fast.inputs.drive(recording)
    initial = fast.inputs.initial_parameters(recording)
    ends = []
    step = 1e-5
    for sign in (1.0, -1.0):
        base = values.get(name, 1.0)
        moved = base * np.exp(sign * step) if logarithmic else base + sign * step
        given = {**values, name: moved}
        start = fast.inputs.start(recording, drive, given, initial=initial)
        ends.append(simulate_fast(fast, drive, start, parameters=given, terms=terms).temperature)
    return (ends[0] - ends[1]) / (2.0 * step)


TERM_VALUES = {"warming.heat": 20.0, "warming.slope": 0.01, "warming.shift": 3.0, "warming.growth": 0.02}


@pytest.mark.parametrize("which", ["recording", "broken"])
def test_derivatives_with_a_term_follow_differences(fast, which, request):
    recording = request.getfixturevalue(which)
    names = (*FREE, "initial.winding", "initial.foot", *TERM_VALUES)
    drive = fast.inputs.drive(recording)
    values = {**TERM_VALUES, "temperature.bench": 1.01, "gain.body.speed": 1.3}
    initial = fast.inputs.initial_parameters(recording)
    start = fast.inputs.start(recording, drive, values, names, initial=initial)
    run = simulate_fast(fast, drive, start, parameters=values, derivatives=names, terms=(Warming(),))
    for column, name in enumerate(names):
        expected = by_differences(fast, recording, name, (Warming(),), values, name != "warming.shift")
        assert np.abs(expected).max() > 0.05, name
        assert_allclose(run.sensitivity[:, :, column], expected, atol=2e-5 * np.abs(expected).max() + 2e-5)


def test_a_drive_with_gaps_needs_a_state_after_each(fast, broken):
    with pytest.raises(SpecError, match="after each of 2 long gaps"):
        simulate_fast(fast, fast.inputs.drive(broken), 293.15)


def test_starting_states_are_taken_in_every_form(fast, recording):
    drive = fast.inputs.drive(recording)
    state = np.array([300.0, 296.0, 294.0])
    given = Start(np.zeros(1, dtype=np.int64), state[None, :])
    first = simulate_fast(fast, drive, state)
    assert_allclose(first.states[0], state)
    assert_allclose(first.temperature, simulate_fast(fast, drive, given).temperature)
    assert_allclose(simulate_fast(fast, drive, 295.0).states[0], 295.0)
    with pytest.raises(SpecError, match="a state of shape"):
        simulate_fast(fast, drive, state[:2])
    with pytest.raises(SpecError, match="0 first"):
        Start(np.array([3]), state[None, :])


class Constant(Term):
    """Changes that do not move in time."""

    name = "constant"

    def __init__(self, **changes):
        self.changes = changes

    def operating_factor(self, point, parameters):
        return self.changes.get("factors", {})

    def place_capacity(self, parameters):
        return self.changes.get("capacity", {})

    def place_conductance(self, parameters):
        return self.changes.get("conductance", {})


def test_steady_changes_are_those_of_the_network_itself(fast, recording):
    changes = Constant(
        factors={"link.winding|body": 1.7}, capacity={"foot": 300.0}, conductance={"body": 0.25}
    )
    drive = fast.inputs.drive(recording)
    state = np.full(3, 295.0)
    found = simulate_fast(fast, drive, state, terms=(changes,))
    # The body's own link to the surroundings is 0.5 W/K.
    changed = {"conductance.winding|body": 1.7, "capacity.foot": 4.0 / 3.0, "conductance.body|ambient": 1.5}
    expected = simulate_fast(fast, drive, state, parameters=changed)
    assert_allclose(found.temperature, expected.temperature, atol=1e-9)


def test_refusals_name_what_is_allowed(fast, recording):
    drive = fast.inputs.drive(recording)
    with pytest.raises(SpecError, match=r"no parameter of this network.*winding\|body"):
        simulate_fast(fast, drive, 295.0, parameters={"conductance.winding|bodi": 1.1})
    with pytest.raises(SpecError, match="body"):
        simulate_fast(fast, drive, 295.0, terms=(Constant(capacity={"boddy": 1.0}),))
    term = Warming()
    term.heat_places = ("foot", "fluid.coolant_inlet")
    with pytest.raises(SpecError, match=r'puts heat into "fluid\.coolant_inlet"'):
        simulate_fast(fast, drive, 295.0, parameters=TERM_VALUES, terms=(term,))
    changes = Constant(factors={"link.body|ambient": float("nan")})
    with pytest.raises(SpecError, match=r"factor of .link\.body.ambient. is nan"):
        simulate_fast(fast, drive, 295.0, terms=(changes,))
    with pytest.raises(FaultsError, match="not a node"):
        fast.inputs.drive(replace(recording, probes=("winding", "bodi")))
    pair = replace(fast.network, boundary_names=("room", "bench"), boundary_input=("ambient", None))
    two = fast_network(pair)
    driven = two.inputs.drive(recording)
    with pytest.raises(SpecError, match="no boundary stands for them"):
        simulate_fast(two, driven, 295.0, terms=(Constant(conductance={"body": 1.0}),))
