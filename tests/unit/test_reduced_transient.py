"""The fast model on a spindle of one unknown per part, where everything can be checked by hand."""

from dataclasses import replace
from pickle import loads

import numpy as np
import pytest
from joblib.externals.loky.backend.reduction import dumps

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.machine_spec import NaturalFilm
from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.effects.framework.term import Term, TermParameter
from spindle_fem.errors import ConvergenceError, SpecError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.model.reduced import dynamic_terms as nonlinear
from spindle_fem.model.reduced import term_march
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.projected_model import ReducedModel
from spindle_fem.model.reduced.reduced_transient import TransientRun, simulate_fast
from spindle_fem.model.reduced.term_layout import OneInstant
from spindle_fem.model.reduced.term_march import TermMarch
from spindle_fem.operation.coefficients import free_parameters
from spindle_fem.physics.surroundings.still_air import outside_coefficient

CELLS = 12
RPM = np.pi / 30.0


def lumped_model(spec):
    """Each part and ball row is one unknown; contacts, films and gaps have round areas."""
    assembly = build_assembly(spec)
    parts = [part.name for part in assembly.parts]
    nodes = [*parts, *(f"{bearing.name}.balls" for _, bearing in spec.bearings)]
    size = len(nodes)

    def edge(first, second, area):
        vector = np.zeros(size)
        vector[nodes.index(first)], vector[nodes.index(second)] = 1.0, -1.0
        return area * np.outer(vector, vector)

    def diagonal(name, value):
        matrix = np.zeros((size, size))
        matrix[nodes.index(name), nodes.index(name)] = value
        return matrix

    def unit(name):
        return np.eye(size)[nodes.index(name)]

    operators = {f"conductivity.{name}": np.zeros((size, size)) for name in spec.materials}
    for contact in assembly.joint_names:
        operators[f"joint.{contact}"] = edge(*contact.removesuffix(":face").split("|"), 0.01)
    films = {}
    for film in spec.film:
        for surface in film.surface:
            operators[f"film.{surface}"] = diagonal(surface.split(".")[0], 0.1)
            films[f"film.{surface}"] = operators[f"film.{surface}"] @ np.ones(size)
    for gap in spec.gap:
        operators[f"gap.{gap.name}"] = edge(gap.rotating.split(".")[0], gap.standing[0].split(".")[0], 0.1)
    for _, bearing in spec.bearings:
        for side in ("inner", "outer"):
            ring = f"{bearing.name}.{side}_ring"
            operators[f"balls.{bearing.name}.{side}"] = edge(ring, f"{bearing.name}.balls", 1.0)
    storage = {f"capacity.{name}": np.zeros((size, size)) for name in spec.materials}
    keys = {id(value): key for key, value in spec.materials.items()}
    for part in parts:
        volume = 0.01 if part in ("shaft", "housing") else 2e-4
        storage[f"capacity.{keys[id(spec.part_material(part))]}"] += diagonal(part, volume)
    for _, bearing in spec.bearings:
        storage[f"capacity.{bearing.name}.balls"] = diagonal(f"{bearing.name}.balls", 1.0)
    places = {name: unit(name) for name in nodes}
    for _, bearing in spec.bearings:
        for side in ("inner", "outer"):
            places[f"{bearing.name}.{side}_raceway"] = unit(f"{bearing.name}.{side}_ring")
    points = [probe for probe in spec.probe if probe.kind == "point"]
    rings = ("F1.outer_ring", "F2.outer_ring", "F3.outer_ring", "housing", "R1.outer_ring")
    area = 0.156 / CELLS
    return ReducedModel(
        coefficient_names=tuple(operators),
        operators=np.array(list(operators.values())),
        fluid_names=tuple(films),
        fluid_load=np.array(list(films.values())),
        cell_film=np.array([diagonal("housing", area)] * CELLS),
        cell_load=np.array([area * unit("housing")] * CELLS),
        cell_area=np.full((1, CELLS), area),
        cell_angle=np.linspace(0.0, 31.0, CELLS),
        cell_position=np.linspace(0.0, 3.5, CELLS),
        cell_is_port=np.zeros(CELLS, dtype=bool),
        storage_names=tuple(storage),
        storage=np.array(list(storage.values())),
        place_names=tuple(places),
        places=np.array(list(places.values())),
        probe_names=tuple(probe.name for probe in points),
        probes=np.array([unit(name) for name in rings]),
        one=np.ones(size),
        contacts=tuple(assembly.joint_names),
        gap_radii={gap.name: (0.065, 0.09) for gap in spec.gap},
        ranges={"film.housing.outside": (5.0, 20.0)},
        errors={"probes": 0.0},
        n_full=size,
        digest="lumped",
    )


@pytest.fixture(scope="module")
def spec():
    return load_machine("recorded_spindle")


@pytest.fixture(scope="module")
def fast(spec):
    return FastModel(lumped_model(spec), spec)


def drive_of(times, speed_rpm, *, ambient=293.15, inlet=290.15, thrust=1750.0, flow=20e-3 / 60):
    columns = [np.asarray(speed_rpm) * RPM, thrust, ambient, inlet, flow]
    values = np.column_stack([np.broadcast_to(np.asarray(c, dtype=float), times.shape) for c in columns])
    return make_drive(times, STANDARD, values, np.array([True, True, False, False, True]))


@pytest.fixture(scope="module")
def steps():
    times = np.arange(0.0, 7200.0, 20.0)
    speed = np.select([times < 600, times < 3000, times < 5400], [0.0, 3000.0, 1500.0], 4000.0)
    return drive_of(
        times, speed, ambient=293.0 + np.sin(times / 900.0), inlet=289.0 + 0.5 * np.cos(times / 500.0)
    )


def test_nothing_changes_where_everything_has_one_temperature(fast):
    times = np.arange(0.0, 20000.0, 50.0)
    run = simulate_fast(fast, drive_of(times, 0.0, ambient=300.0, inlet=300.0), 300.0)
    assert np.abs(run.temperature - 300.0).max() < 1e-9


def test_steady_state_carries_away_exactly_the_heat_put_in(fast, spec):
    times = np.linspace(0.0, 3.0e6, 40000)
    drive = drive_of(times, 3000.0)
    run = simulate_fast(fast, drive, 293.15)
    point = drive.points[0]
    state = run.states[-1]
    nodes = dict(zip(fast.model.place_names, fast.model.places @ state, strict=True))
    coefficients = fast.coefficients(point, {})
    out = sum(
        coefficients[name] * (load @ (state - 293.15))
        for name, load in zip(fast.model.fluid_names, fast.model.fluid_load, strict=True)
    )
    _, capacity_rate, _ = fast.channel_film(point, {})
    taken = capacity_rate * (run.temperature[-1, fast.channels.index("COOLANT_OUT")] - 290.15)
    assert out + taken == pytest.approx(2 * 155 + 140 + 2 * 85, rel=1e-7)
    assert nodes["F1.inner_ring"] > nodes["F1.outer_ring"] > nodes["housing"] > 290.15


def test_heat_scales_the_rise_in_proportion(fast):
    times = np.arange(0.0, 7200.0, 30.0)
    drive = drive_of(times, 3000.0, inlet=293.15)
    one = simulate_fast(fast, drive, 293.15).temperature - 293.15
    double = simulate_fast(fast, drive, 293.15, parameters={"heat.front": 2.0, "heat.rear": 2.0}).temperature
    assert double - 293.15 == pytest.approx(2.0 * one, abs=1e-9)


def test_factors_do_what_changed_definitions_do(fast, spec, steps):
    factors = {
        "heat.front": 1.2,
        "joint.inner_ring_seats": 0.7,
        "shaft_end_films": 1.4,
        "heat_capacity_factor": 1.1,
        "coolant.film_factor": 0.8,
        "heat.inner_share": 1.1,
        "gap.air_gap": 1.3,
        "ball_conductance": 0.6,
    }
    by_factor = simulate_fast(fast, steps, 293.15, parameters=factors).temperature
    changed = FastModel(fast.model, with_parameters(spec, factors))
    assert simulate_fast(changed, steps, 293.15).temperature == pytest.approx(by_factor, abs=1e-9)


def test_every_derivative_is_that_of_differences(fast, spec, steps):
    names = (*free_parameters(spec), "heat.F2", "joint.F1.outer_ring|housing", "film.housing.outside")
    start = {"heat.front": 1.1, "heat.inner_share": 0.95, "coolant.film_factor": 1.2}
    run = simulate_fast(fast, steps, 293.15, parameters=start, derivatives=names)
    for column, name in enumerate(names):
        ends = [
            simulate_fast(
                fast, steps, 293.15, parameters={**start, name: start.get(name, 1.0) * np.exp(sign * 1e-5)}
            ).temperature
            for sign in (1.0, -1.0)
        ]
        difference = (ends[0] - ends[1]) / 2e-5
        assert run.sensitivity[:, :, column] == pytest.approx(difference, abs=1e-6), name


def test_halving_the_steps_changes_little_and_less_each_time(fast):
    runs = []
    for step in (120.0, 60.0, 30.0):
        times = np.arange(0.0, 7200.1, step)
        drive = drive_of(times, 3000.0)
        drive = make_drive(
            times,
            STANDARD,
            np.repeat(drive.start[:1], times.size, axis=0),
            np.ones(5, dtype=bool),
            largest_step=step,
        )
        runs.append(simulate_fast(fast, drive, 293.15).temperature[-1])
    assert np.abs(runs[2] - runs[1]).max() < 0.5 * np.abs(runs[1] - runs[0]).max()
    assert np.abs(runs[2] - runs[1]).max() < 1e-3


def test_a_natural_film_carries_what_its_correlation_says(fast, spec):
    film = NaturalFilm(
        name="outside",
        kind="natural_convection_radiation",
        surface=("housing.outside",),
        orientation="horizontal_cylinder",
        characteristic_length="0.3 m",
        emissivity=0.9,
    )
    others = tuple(item for item in spec.film if item.name != "outside")
    changed = spec.model_copy(update={"film": (film, *others), "factor": spec.factor[1:]})
    keep = [i for i, name in enumerate(fast.model.coefficient_names) if name != "film.cover.outside"]
    fluids = [i for i, name in enumerate(fast.model.fluid_names) if name != "film.cover.outside"]
    natural = FastModel(
        replace(
            fast.model,
            coefficient_names=tuple(fast.model.coefficient_names[i] for i in keep),
            operators=fast.model.operators[keep],
            fluid_names=tuple(fast.model.fluid_names[i] for i in fluids),
            fluid_load=fast.model.fluid_load[fluids],
        ),
        changed,
    )
    # The lumped model has no surfaces of its own: the housing stands for its outside.
    places = (*natural.model.place_names, "housing.outside")
    rows = np.vstack((natural.model.places, natural.model.place("housing")))
    natural = FastModel(replace(natural.model, place_names=places, places=rows), changed)
    times = np.linspace(0.0, 3.0e6, 20000)
    # Not at the definition's own ambient temperature.
    drive = drive_of(times, 3000.0, ambient=296.15)
    run = simulate_fast(natural, drive, 293.15)
    wall = natural.model.place("housing") @ run.states[-1]
    coefficient = outside_coefficient(np.array([wall]), 296.15, 0.3, 0.9, shape="cylinder")[0]
    point = drive.points[0]
    values = natural.coefficients(point, {}) | {"film.housing.outside": coefficient}
    out = sum(
        values[name] * (load @ (run.states[-1] - 296.15))
        for name, load in zip(natural.model.fluid_names, natural.model.fluid_load, strict=True)
    )
    _, rate, _ = natural.channel_film(point, {})
    taken = rate * (run.temperature[-1, natural.channels.index("COOLANT_OUT")] - 290.15)
    assert out + taken == pytest.approx(2 * 155 + 140 + 2 * 85, rel=1e-6)


class Feedback(Term):
    """Heat that grows with a ring's own excess over its neighbour."""

    name = "feedback"
    parameters = (TermParameter("gain", 3.0, 0.5, "W/K"), TermParameter("shift", 1.0, 1.0, "K", False))
    heat_places = ("F1.inner_raceway", "fluid.coolant_inlet", "fluid.housing.flange_back")
    reads = ("F1.inner_ring", "F1.outer_ring")

    def heat(self, context):
        excess = context.temperatures[0] - context.temperatures[1] + context.parameters["shift"]
        own = context.parameters["gain"] * excess * context.inputs["speed"] / 300.0
        return np.array([own, 0.02 * own, 0.1 * own])


class Closure(Term):
    """Contacts and outside film that improve with temperature."""

    name = "closure"
    parameters = (TermParameter("slope", 0.05, 0.5, "1/K"),)
    coefficients = ("joint.F1.outer_ring|housing", "film.housing.outside")
    reads = ("F1.outer_ring", "housing")

    def factor(self, context):
        slope = context.parameters["slope"]
        ring, housing = context.temperatures
        return np.array(
            [1.0 + slope * (ring - housing) ** 2, 1.0 + slope * (housing - context.inputs["ambient"])]
        )


class Fading(Term):
    """Heat that fades while the machine turns, remembered in a state."""

    name = "fading"
    parameters = (TermParameter("heat", 30.0, 0.5, "W"), TermParameter("time", 1500.0, 0.5, "s"))
    heat_places = ("R1.balls",)
    reads = ("housing",)
    n_states = 1

    def initial_state(self, parameters):
        return np.ones(1)

    def heat(self, context):
        return (context.parameters["heat"] * context.state[0])[None]

    def advance(self, context, step):
        rate = (context.inputs["speed"] / 300.0) * (context.temperatures / 300.0) / context.parameters["time"]
        return context.state * np.exp(-step * rate)


class Steady(Term):
    """Bypass, extra mass and an extra path to the air."""

    name = "steady"
    parameters = (
        TermParameter("bypass", 0.1, 0.5),
        TermParameter("mass", 800.0, 0.5, "J/K"),
        TermParameter("path", 1.5, 0.5, "W/K"),
    )

    def operating_factor(self, point, parameters):
        return {"coolant.flow": 1.0 - parameters["bypass"]}

    def place_capacity(self, parameters):
        return {"cover": parameters["mass"]}

    def place_conductance(self, parameters):
        return {"shaft": parameters["path"]}


class Friction(Term):
    """Friction that grows with what the rings differ by, after a while."""

    name = "friction"
    parameters = (
        TermParameter("gain", 0.03, 0.02, logarithmic=False),
        TermParameter("time", 600.0, 0.5, "s"),
    )
    bearings = ("F1", "R2")
    reads = ("F1.inner_raceway", "F1.outer_raceway")
    n_states = 1

    def friction(self, context):
        factor = 1.0 + context.parameters["gain"] * context.state[0] ** 2
        return np.vstack((factor, 0.5 + 0.5 * factor))

    def advance(self, context, step):
        difference = context.temperatures[0] - context.temperatures[1]
        kept = np.exp(-step / context.parameters["time"])
        return kept * context.state + (1.0 - kept) * difference


class Room(Term):
    """Air beside the housing that follows nothing but time and its own memory."""

    name = "room"
    parameters = (TermParameter("change", 3.0, 1.0, "K", False), TermParameter("time", 1200.0, 0.5, "s"))
    heat_places = ("fluid.housing.outside",)
    n_states = 1

    def heat(self, context):
        swing = 1.0 + 0.3 * np.sin(context.time / 700.0)
        return (context.parameters["change"] * swing * context.state[0])[None]

    def advance(self, context, step):
        kept = np.exp(-step / context.parameters["time"])
        return kept * context.state + (1.0 - kept)


class Plume(Term):
    """The same air, warmed by the housing itself with a lag."""

    name = "plume"
    parameters = (TermParameter("share", 0.2, 0.1), TermParameter("time", 800.0, 0.5, "s"))
    heat_places = ("fluid.housing.outside",)
    reads = ("housing",)
    n_states = 1

    def heat(self, context):
        excess = context.temperatures[0] - context.inputs["ambient"]
        return (context.parameters["share"] * (context.state[0] + 0.5 * excess))[None]

    def advance(self, context, step):
        excess = context.temperatures - context.inputs["ambient"]
        kept = np.exp(-step / context.parameters["time"])
        return kept * context.state + (1.0 - kept) * excess


class RunningIn(Term):
    """Friction that fades with time, whatever the temperatures are."""

    parameters = (TermParameter("extra", 0.4, 0.2), TermParameter("time", 2000.0, 0.5, "s"))
    bearings = ("F1", "F2")

    def __init__(self, name):
        self.name = name

    def friction(self, context):
        factor = 1.0 + context.parameters["extra"] * np.exp(-context.time / context.parameters["time"])
        return np.vstack((factor, factor))


class LaterFriction(Friction):
    """The same bearings once more."""

    name = "later"


TERMS = (Feedback(), Closure(), Fading(), Steady(), Friction())
# Several that scale the friction of one bearing, with and without a look at temperatures.
FRICTIONS = (Friction(), RunningIn("first"), LaterFriction(), RunningIn("second"))
# Two that shift the fluid of a film, one known before the march and one not, and one that scales the film.
SHIFTED = (Closure(), Room(), Plume())


of_terms = pytest.mark.parametrize(
    "terms",
    [TERMS, SHIFTED, FRICTIONS],
    ids=["everything", "shifted fluid of a scaled film", "friction of friction"],
)


@of_terms
def test_derivatives_with_terms_are_those_of_differences(fast, spec, steps, monkeypatch, terms):
    # Derivatives are those at Newton's last but one iterate: exact to its last change.
    for module in (nonlinear, term_march):
        monkeypatch.setattr(module, "TEMPERATURE_TOLERANCE", 1e-7)
    owned = {name: item for term in terms for name, item in term.names().items()}
    names = (
        *owned,
        "film.outside",
        "joint.front_outer_ring_seats",
        "heat_capacity_factor",
        "coolant.film_factor",
        "film.flange_back",
        "heat.front",
        "heat.inner_share",
    )
    run = simulate_fast(fast, steps, 293.15, terms=terms, derivatives=names)
    for column, name in enumerate(names):
        item = owned.get(name)
        value = 1.0 if item is None else item.value
        width = 1e-5 * value
        ends = [
            simulate_fast(
                fast, steps, 293.15, terms=terms, parameters={name: value + sign * width}
            ).temperature
            for sign in (1.0, -1.0)
        ]
        difference = (ends[0] - ends[1]) / (2.0 * width)
        if item is None or item.logarithmic:
            difference = difference * value
        size = np.abs(difference).max()
        assert size > 1e-4, name
        assert np.abs(run.sensitivity[:, :, column] - difference).max() < 2e-5 * max(size, 1.0), name


def answering_run(fast, drive, terms, parameters=None):
    names = (*(name for term in terms for name in term.names()), "film.outside", "heat_capacity_factor")
    return TransientRun(fast, drive, parameters or {}, names, terms)


@of_terms
@pytest.mark.parametrize("near", [False, True], ids=["from nothing", "from another run"])
def test_the_whole_run_at_once_is_the_run_step_by_step(fast, steps, monkeypatch, terms, near):
    other = simulate_fast(fast, steps, 293.15, terms=terms, parameters={"film.outside": 2.0}).states
    run = answering_run(fast, steps, terms)
    step_by_step = []
    monkeypatch.setattr(
        TermMarch,
        "_step_by_step",
        lambda self, march=TermMarch._step_by_step: step_by_step.append(march(self)) or step_by_step[-1],
    )
    states, tracks = run.march(293.15, other if near else None)
    assert not step_by_step
    monkeypatch.setattr(term_march, "MOST_ROUNDS", 0)
    expected, stepped = run.march(293.15)
    assert len(step_by_step) == 1
    assert np.abs(states - expected).max() < 1e-5
    assert np.abs(other - expected).max() > 0.1
    assert np.abs(tracks.added() - stepped.added()).max() < 1e-4 * np.abs(stepped.added()).max()
    by = [run.tangents(run.forcing_of(states, t), t, explicit=True) for t in (tracks, stepped)]
    size = np.abs(by[1]).max(axis=(0, 1))
    assert np.all(np.abs(by[0] - by[1]).max(axis=(0, 1)) < 1e-4 * size)
    for name in ("start_by", "end_by"):
        assert getattr(tracks, name) == pytest.approx(getattr(stepped, name), rel=1e-3, abs=1e-3)


def test_a_run_that_is_known_takes_one_round(fast, steps, monkeypatch):
    rounds = []
    plain = TermMarch._told

    def told(self, *own, slopes):
        rounds.append(slopes)
        return plain(self, *own, slopes=slopes)

    monkeypatch.setattr(TermMarch, "_told", told)
    run = answering_run(fast, steps, TERMS)
    states, _ = run.march(293.15)
    assert rounds.count(False) > 1
    rounds.clear()
    again, _ = run.march(293.15, states)
    assert rounds == [True]
    assert np.abs(again - states).max() < 1e-6


def test_terms_of_one_instant_are_marched_step_by_step(fast, steps):
    class OneByOne(OneInstant, Feedback):
        def heat(self, context):
            assert np.ndim(context.time) == 0
            return super().heat(context)

    expected = simulate_fast(fast, steps, 293.15, terms=(Feedback(),)).states
    assert np.abs(simulate_fast(fast, steps, 293.15, terms=(OneByOne(),)).states - expected).max() < 1e-5


def test_a_run_takes_from_another_what_both_have_in_common(fast, steps):
    run = TransientRun(fast, steps, {"film.outside": 1.3}, (), ())
    same = TransientRun(fast, steps, {"film.outside": 1.3, "heat.front": 2.0}, ("heat.front",), (), like=run)
    assert all(same.propagators[key] is run.propagators[key] for key in run.groups)
    for changed in ({"film.outside": 1.4}, {"film.outside": 1.3, "heat_capacity_factor": 1.01}):
        other = TransientRun(fast, steps, changed, (), (), like=run)
        alone = TransientRun(fast, steps, changed, (), ())
        for key in run.groups:
            assert np.array_equal(other.propagators[key].advance, alone.propagators[key].advance)
            assert not np.array_equal(other.propagators[key].advance, run.propagators[key].advance)


def test_operating_points_that_hardly_differ_have_the_same_operators(fast, steps):
    class Transition(Term):
        """A film that changes where the oil warms."""

        name = "transition"
        parameters = (TermParameter("excess", 0.0, 0.3, logarithmic=False),)

        def operating_factor(self, point, parameters):
            share = 1.0 / (1.0 + np.exp(-(point.coolant_inlet_temperature - 289.0) / 0.1))
            return {"channel.film": 1.0 + parameters["excess"] * share}

    times = np.arange(0.0, 7200.0, 20.0)
    drive = drive_of(times, np.where(times < 3000, 3000.0, 1500.0), inlet=289.0 + 4.0 * np.sin(times / 900.0))
    names = ("film.outside", "coolant.film_factor")
    exact = TransientRun(fast, drive, {}, names, ())
    merged = TransientRun(fast, drive, {}, names, (), same_within=5e-3)
    assert len(set(exact.step_class.tolist())) == len(drive.points) > 6
    speeds = np.round([point.speed for point in drive.points], 6)
    assert len(set(merged.step_class.tolist())) == len(set(speeds.tolist())) == 2
    assert np.array_equal(speeds[merged.built.owner], speeds)
    a, b = exact.solve(293.15), merged.solve(293.15)
    assert 0.0 < np.abs(a.temperature - b.temperature).max() < 5e-3 * np.ptp(a.temperature)
    assert np.abs(a.sensitivity - b.sensitivity).max() < 2e-2 * np.abs(a.sensitivity).max()
    # What a term would do counts even where its amplitude is nothing.
    asked = TransientRun(fast, drive, {}, ("transition.excess",), (Transition(),), same_within=5e-3)
    assert len(set(asked.step_class.tolist())) > 4
    unasked = TransientRun(fast, drive, {}, (), (Transition(),), same_within=5e-3)
    assert len(set(unasked.step_class.tolist())) == 2


def test_a_constant_factor_as_a_term_is_a_factor_of_the_machine(fast, steps):
    class Constant(Term):
        name = "constant"
        coefficients = ("joint.F1.outer_ring|housing", "film.housing.outside")

        def factor(self, context):
            return np.full((2, context.temperatures.shape[-1]), 1.8, dtype=complex)

    class Operating(Term):
        name = "operating"

        def operating_factor(self, point, parameters):
            return {"joint.F1.outer_ring|housing": 1.8, "film.housing.outside": 1.8}

    factors = {"joint.F1.outer_ring|housing": 1.8, "film.housing.outside": 1.8}
    expected = simulate_fast(fast, steps, 293.15, parameters=factors).temperature
    assert simulate_fast(fast, steps, 293.15, terms=(Operating(),)).temperature == pytest.approx(
        expected, abs=1e-9
    )
    # The first stage of a step takes the moved heat from its ends: the same to second order.
    apart = []
    for step in (20.0, 10.0, 5.0):
        drive = drive_of(np.arange(0.0, 3601.0, step), 3000.0)
        by_factor = simulate_fast(fast, drive, 293.15, parameters=factors).temperature
        by_term = simulate_fast(fast, drive, 293.15, terms=(Constant(),)).temperature
        apart.append(np.abs(by_term - by_factor)[:: round(60.0 / step)].max())
    assert apart[0] < 0.02
    assert np.log2(apart[1] / apart[2]) > 1.7


@pytest.mark.parametrize("reads", [(), ("housing",)], ids=["known before", "within the step"])
def test_heat_that_a_scaled_film_moves_counts_from_its_shifted_fluid(fast, reads):
    class Scaled(Term):
        name = "scaled"
        coefficients = ("film.housing.outside",)

        def factor(self, context):
            return np.full((1, context.temperatures.shape[-1]), 1.8, dtype=complex)

    class Shifted(Term):
        name = "shifted"
        heat_places = ("fluid.housing.outside",)

        def heat(self, context):
            return np.full((1, context.temperatures.shape[-1]), 30.0, dtype=complex)

    shift = Shifted()
    shift.reads = reads
    drive = drive_of(np.linspace(0.0, 1.0e6, 4000), 3000.0)
    factor = {"film.housing.outside": 1.8}
    expected = simulate_fast(fast, drive, 293.15, terms=(shift,), parameters=factor).temperature[-1]
    unscaled = simulate_fast(fast, drive, 293.15, terms=(shift,)).temperature[-1]
    for terms in ((Scaled(), shift), (shift, Scaled())):
        both = simulate_fast(fast, drive, 293.15, terms=terms).temperature[-1]
        assert both == pytest.approx(expected, abs=1e-7)
        assert np.abs(both - unscaled).max() > 0.1


def test_constant_heat_as_a_term_is_heat_of_the_table(fast):
    class Heat(Term):
        name = "heat"
        heat_places = ("F1.inner_raceway", "F1.outer_raceway")

        def heat(self, context):
            return np.full((2, context.temperatures.shape[-1]), 0.5 * 155.0, dtype=complex)

    drive = drive_of(np.arange(0.0, 3600.0, 20.0), 3000.0)
    doubled = simulate_fast(fast, drive, 293.15, parameters={"heat.F1": 2.0}).temperature
    assert simulate_fast(fast, drive, 293.15, terms=(Heat(),)).temperature == pytest.approx(doubled, abs=1e-8)


def scaled_by(factor, name="scaled", reads=()):
    """A term that multiplies the friction of the front bearings; dynamic where it reads something."""

    class Scaled(Term):
        bearings = ("F1", "F2", "F3")

        def friction(self, context):
            return np.full((3, context.temperatures.shape[-1]), factor, dtype=complex)

    Scaled.name, Scaled.reads = name, reads
    return Scaled()


def test_scaled_friction_is_heat_of_the_table(fast):
    drive = drive_of(np.arange(0.0, 3600.0, 20.0), 3000.0)
    heat = {"heat.R1": 1.2}
    scaled = simulate_fast(fast, drive, 293.15, parameters={"heat.front": 1.5, **heat}).temperature
    by_term = simulate_fast(fast, drive, 293.15, terms=(scaled_by(1.5),), parameters=heat).temperature
    assert by_term == pytest.approx(scaled, abs=1e-8)


@pytest.mark.parametrize("reads", [((), ()), (("housing",), ()), (("housing",), ("housing",))])
def test_what_scales_one_friction_multiplies(fast, reads):
    drive = drive_of(np.arange(0.0, 3600.0, 20.0), 3000.0)
    whole = simulate_fast(fast, drive, 293.15, parameters={"heat.front": 1.8}).temperature
    terms = tuple(scaled_by(f, str(f), own) for f, own in zip((1.5, 1.2), reads, strict=True))
    assert simulate_fast(fast, drive, 293.15, terms=terms).temperature == pytest.approx(whole, abs=1e-8)


def test_heat_that_a_recording_gives_enters_where_its_name_says(fast):
    times = np.arange(0.0, 3600.0, 20.0)
    plain = drive_of(times, 3000.0)
    values = np.column_stack([np.repeat(plain.start[:1], times.size, axis=0), np.full(times.size, 155.0)])
    held = np.ones(6, dtype=bool)
    drive = make_drive(times, (*STANDARD, "heat.F1.inner_raceway"), values, held)
    more = simulate_fast(fast, drive, 293.15).temperature

    class Same(Term):
        name = "same"
        heat_places = ("F1.inner_raceway",)

        def heat(self, context):
            return np.full((1, context.temperatures.shape[-1]), 155.0, dtype=complex)

    assert more == pytest.approx(simulate_fast(fast, plain, 293.15, terms=(Same(),)).temperature, abs=1e-9)
    assert more[-1, 0] > simulate_fast(fast, plain, 293.15).temperature[-1, 0] + 0.5
    lost = make_drive(times, (*STANDARD, "heat.oven"), values, held)
    with pytest.raises(SpecError, match='puts heat into "oven"'):
        simulate_fast(fast, lost, 293.15)


def test_a_term_that_runs_away_is_refused_with_its_time(fast):
    class Runaway(Term):
        name = "runaway"
        heat_places = ("F1.inner_raceway",)
        reads = ("F1.inner_ring",)

        def heat(self, context):
            return np.exp(context.temperatures - 293.0)

    drive = drive_of(np.arange(0.0, 3600.0, 20.0), 3000.0)
    with pytest.raises(ConvergenceError, match=r"t = .* terms of the fast model"):
        simulate_fast(fast, drive, 293.15, terms=(Runaway(),))


def wrong(**attributes):
    return type("Wrong", (Term,), {"name": "wrong", **attributes})()


@pytest.mark.parametrize(
    ("term", "message"),
    [
        (wrong(heat_places=("F1.inner_racewya",)), 'puts heat into "F1.inner_racewya".*inner_raceway'),
        (wrong(heat_places=("cover",), reads=("nowhere",)), 'reads "nowhere"'),
        (wrong(coefficients=("joint.none",)), 'scales "joint.none"'),
        (wrong(operating_factor=lambda self, point, values: {"film.none": 1.0}), 'scales "film.none"'),
        (wrong(place_capacity=lambda self, values: {"lathe": 1.0}), 'names "lathe"'),
    ],
)
def test_terms_that_name_what_is_not_there_are_refused(fast, steps, term, message):
    with pytest.raises(SpecError, match=message):
        simulate_fast(fast, steps, 293.15, terms=(term,))


def test_unknown_parameters_and_other_heat_models_are_refused(fast, spec, steps):
    with pytest.raises(SpecError, match=r'Did you mean "heat.front"'):
        simulate_fast(fast, steps, 293.15, parameters={"heat.frnt": 1.0})
    with pytest.raises(SpecError, match=r"the share becomes 1.5"):
        simulate_fast(fast, steps, 293.15, parameters={"heat.inner_share": 3.0})
    other = FastModel(fast.model, load_machine("recorded_spindle", ["heat.model=palmgren"]))
    with pytest.raises(SpecError, match=r"takes heat.model"):
        simulate_fast(other, steps, 293.15)


def test_a_model_goes_to_another_process_without_its_remembered_sums(fast, steps):
    point = steps.points[0]
    expected = fast.operators(point, {}, ("film.outside",))
    there = loads(dumps(fast))
    assert fast._sums
    assert not there._sums
    found = there.operators(point, {}, ("film.outside",))
    assert np.array_equal(found.conduction, expected.conduction)
    assert np.array_equal(found.conduction_by["film.outside"], expected.conduction_by["film.outside"])


def test_the_range_of_the_basis_is_watched(fast):
    assert fast.model.outside_range({"film.housing.outside": 10.0, "gap.air_gap": 1e9}) == ()
    assert fast.model.outside_range({"film.housing.outside": 30.0}) == ("film.housing.outside",)


def test_a_model_comes_back_from_disk_as_it_was(fast, tmp_path):
    path = tmp_path / "model.npz"
    fast.model.save(path)
    again = ReducedModel.load(path)
    assert again.ranges == fast.model.ranges
    assert again.coefficient_names == fast.model.coefficient_names
    assert np.array_equal(again.operators, fast.model.operators)
    path.write_bytes(path.read_bytes()[:1000])
    assert ReducedModel.load(path) is None
    assert ReducedModel.load(tmp_path / "none.npz") is None
