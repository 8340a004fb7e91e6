"""Coupled transients of the reference spindle on a small mesh (linear temperatures)."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.effects.framework.term import Term, TermParameter
from spindle_fem.errors import EnergyBalanceError, NoSteadyStateError, RecordingError, SpecError
from spindle_fem.model.mesh.thermal_state import ThermalState
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.coupled_steady import solve_coupled
from spindle_fem.solvers.coupled_transient import CoupledInputs
from spindle_fem.solvers.input_history import OperatingHistory
from spindle_fem.solvers.machine_transient import (
    MachineEnergy,
    TransientOptions,
    Watch,
    simulate_full,
    start_from,
)
from spindle_fem.solvers.mesh_terms import Physics
from spindle_fem.solvers.prepared_machine import prepare_machine
from spindle_fem.solvers.saved_state import load_state, save_state
from spindle_fem.solvers.transient_records import balanced
from spindle_fem.studies.solve_machine import solve_prepared
from spindle_fem.studies.transient_study import run_study, study_of, time_to_stay_within
from tests.support.near_rings import NEAR_RINGS

SMALL = ["mesh.preset=coarse", "mesh.order=1"]
RPM = np.pi / 30.0


def held(times, **inputs):
    values = np.column_stack(
        [np.broadcast_to(np.asarray(value, float), len(times)) for value in inputs.values()]
    )
    return InputHistory(np.asarray(times, float), tuple(inputs), values, np.ones(len(inputs), dtype=bool))


def lines(times, **inputs):
    history = held(times, **inputs)
    return replace(history, held=np.zeros(len(history.names), dtype=bool))


@pytest.fixture(scope="module")
def machine():
    """The reference spindle with catalogue friction: heat, films and coolant follow the temperatures."""
    return prepare_machine(
        load_machine("wu_tan_2016", [*SMALL, "heat.model=palmgren", "heat.thermal_preload=false"])
    )


@pytest.fixture(scope="module")
def quick():
    """The recorded spindle, its heat by table; the channel film follows the coolant's temperature."""
    return prepare_machine(load_machine("recorded_spindle", [*SMALL, "coolant.properties_at=bulk"]))


@pytest.fixture(scope="module")
def paper_machine():
    """The reference spindle as it ships, with its full friction model."""
    return prepare_machine(load_machine("wu_tan_2016", SMALL))


@pytest.fixture(scope="module")
def heat_up(paper_machine):
    return simulate_full(
        paper_machine,
        held([0.0, 14400.0], speed=3000 * RPM, thrust=1750.0),
        sample_times=np.arange(0.0, 14401.0, 60.0),
    )


@pytest.fixture(scope="module")
def steady(paper_machine):
    return solve_prepared(paper_machine)


# ------------------------------------------------------------------- balance
@pytest.mark.slow
def test_heat_in_less_out_is_stored(heat_up):
    energy = heat_up.energy
    assert energy.imbalance_relative < 1e-8
    assert energy.heat_out["coolant"] > 0.3 * energy.heat_in
    assert energy.stored > 0.05 * energy.heat_in


def test_coolant_is_booked_by_its_own_enthalpy(quick, monkeypatch):
    """An enthalpy that is wrong by one part in a million is found."""
    import spindle_fem.solvers.machine_transient as run

    true = run.coolant_heat
    monkeypatch.setattr(
        run, "coolant_heat", lambda stages, step: tuple(1.000001 * h for h in true(stages, step))
    )
    with pytest.raises(EnergyBalanceError, match="coolant included"):
        simulate_full(quick, held([0.0, 5.0], speed=3000 * RPM), options=TransientOptions(error=0.5))


def test_energies_add_up():
    one = MachineEnergy(10.0, {"air": 4.0}, 6.0)
    both = one + MachineEnergy(5.0, {"coolant": 5.0}, 0.0)
    assert both == MachineEnergy(15.0, {"air": 4.0, "coolant": 5.0}, 6.0)
    assert both.imbalance_relative == 0.0
    assert MachineEnergy(10.0, {}, 6.0).imbalance_relative == pytest.approx(0.5)


# ------------------------------------------------------------- steady state
def test_steady_state_stays(paper_machine, steady):
    """Started from the coupled steady state nothing moves, and steps grow by four each time."""
    start = start_from(solve_coupled(paper_machine, OperatingPoint.of(paper_machine.spec)))
    run = simulate_full(paper_machine, held([0.0, 7200.0], speed=3000 * RPM, thrust=1750.0), start=start)
    expected = [steady.probes[name] for name in run.probes]
    assert np.abs(run.readings - expected).max() < 1e-5
    assert run.steps.bearing_heat[-1].sum() == pytest.approx(steady.energy.heat_in, rel=1e-6)
    assert run.counts["evaluations"] < 100


@pytest.mark.slow
def test_heat_up_ends_at_the_steady_state(paper_machine, heat_up, steady):
    """From four hours on to thirty: the end is the state that the steady solver finds."""
    run = simulate_full(
        paper_machine, held([14400.0, 108000.0], speed=3000 * RPM, thrust=1750.0), start=heat_up.state
    )
    expected = np.array([steady.probes[name] for name in run.probes])
    assert np.abs(run.readings[-1] - expected).max() < 2e-3
    hottest = steady.temperature_maximum
    assert run.steps.hottest[-1] == pytest.approx(hottest, abs=5e-3)
    assert run.energy.imbalance_relative < 1e-8


@pytest.mark.slow
def test_time_to_equilibrium_is_the_papers(heat_up, steady):
    """The slowest probe (rear seat) comes within half a kelvin after three to four hours."""
    final = np.array([steady.probes[name] for name in heat_up.probes])
    hours = time_to_stay_within(heat_up.times, heat_up.readings, final, 0.5) / 3600.0
    assert 3.0 < hours < 4.0


@pytest.mark.slow
def test_nothing_gets_colder_than_the_coolant(heat_up):
    assert heat_up.steps.coldest.min() > 288.15 - 1e-6
    assert np.all(np.diff(heat_up.steps.hottest) > 0.0)


@pytest.mark.slow
def test_friction_falls_as_the_grease_warms(machine):
    """Bearings of the size of assembly: no preload grows against it."""
    run = simulate_full(machine, held([0.0, 14400.0], speed=3000 * RPM, thrust=1750.0))
    heat, warm = run.steps.bearing_heat.sum(axis=1), run.steps.times > 600.0
    assert heat.max() > 1.1 * heat[-1]
    assert np.all(np.diff(heat[warm]) < 0.0)


@pytest.mark.slow
def test_preload_raises_friction_against_the_warming_grease(heat_up):
    heat = heat_up.steps.bearing_heat.sum(axis=1)
    assert heat[-1] > 1.1 * heat[heat_up.steps.times < 600.0].max()


# --------------------------------------------------------------------- steps
@pytest.mark.slow
def test_second_order_in_time(machine):
    """Speed and inlet on straight lines, heat, films and coolant following: error falls as the square."""
    times = [0.0, 1200.0]
    inputs = lines(times, speed=[500 * RPM, 2000 * RPM], coolant_inlet=[288.15, 293.15], thrust=1750.0)
    start = simulate_full(machine, held([-3600.0, 0.0], speed=500 * RPM, coolant_inlet=288.15)).state
    start = ThermalState(0.0, start.temperature, start.lumped_temperature)
    ends = [
        simulate_full(
            machine,
            inputs,
            start=start,
            options=TransientOptions(fixed_step=step, coefficient_tolerance=0.0),
        ).state.temperature
        for step in (400.0, 200.0, 100.0, 50.0)
    ]
    change = [np.sqrt(np.mean((one - two) ** 2)) for one, two in itertools.pairwise(ends)]
    order = np.log2(change[0] / change[1]), np.log2(change[1] / change[2])
    assert order[1] == pytest.approx(2.0, abs=0.15)


@pytest.mark.slow
def test_error_asked_for_is_kept(quick):
    """A run at a tenth of the tolerance differs by less than the tolerance at every reading."""
    inputs, samples = held([0.0, 1800.0], speed=1500 * RPM, thrust=1750.0), np.arange(0.0, 1801.0, 60.0)
    asked = simulate_full(quick, inputs, sample_times=samples)
    fine = simulate_full(quick, inputs, sample_times=samples, options=TransientOptions(error=5e-3))
    assert np.abs(fine.readings - asked.readings).max() < 0.05
    assert np.abs(fine.inner - asked.inner).max() < 0.05
    assert len(fine.steps.times) > 1.3 * len(asked.steps.times)


@pytest.mark.slow
def test_kept_coefficients_cost_little(quick):
    """Matrices that are not renewed at every stage: far below the step error, far fewer of them."""
    inputs = held([0.0, 1800.0], speed=1500 * RPM, thrust=1750.0)
    kept = simulate_full(quick, inputs)
    renewed = simulate_full(quick, inputs, options=TransientOptions(coefficient_tolerance=0.0))
    assert np.abs(kept.readings - renewed.readings).max() < 2e-3
    assert kept.counts["matrix_builds"] < 0.5 * renewed.counts["matrix_builds"]


# ------------------------------------------------------------------- restart
def test_restart_from_a_saved_state(quick, tmp_path):
    """Saved, read back and gone on: the same end as without the break."""
    names, steps = {"speed": 1500 * RPM, "thrust": 1750.0}, TransientOptions(fixed_step=60.0)
    whole = simulate_full(quick, held([0.0, 240.0], **names), watch=Watch(looks=[120.0]), options=steps)
    first = simulate_full(quick, held([0.0, 120.0], **names), options=steps)
    first.state.save(tmp_path / "state.npz")
    second = simulate_full(
        quick,
        held([120.0, 240.0], **names),
        start=ThermalState.load(tmp_path / "state.npz"),
        options=steps,
    )
    assert np.abs(second.state.temperature - whole.state.temperature).max() < 1e-3
    total = first.energy + second.energy
    assert total.heat_in == pytest.approx(whole.energy.heat_in, rel=1e-5)
    assert total.stored == pytest.approx(whole.energy.stored, rel=1e-4)


class Lagging(Term):
    """200 W into the housing, of which so much is there as the term remembers."""

    name = "lagging"
    parameters = (TermParameter("power", 200.0, unit="W"),)
    heat_places = ("housing",)
    n_states = 1

    def heat(self, context):
        return context.parameters["power"] * context.state

    def advance(self, context, step):
        kept = np.exp(-step / 1800.0)
        return kept * context.state + (1.0 - kept)


def of_phase(duration, **more):
    """A study of one phase at the definition's own operating point."""
    content = {"schema": "spindle-fem/transient/1", "name": "x", "error": "0.5 K"}
    return study_of({**content, "phase": [{"name": "x", "duration": duration}], **more})


def test_what_terms_remember_is_saved_with_the_state(quick, tmp_path):
    physics, study = Physics((Lagging(),)), of_phase("10 s")
    first = run_study(quick, study, physics=physics)
    save_state(tmp_path / "state.npz", first.state, first.memory)
    start, memory = load_state(tmp_path / "state.npz")
    second = run_study(quick, study, start=start, memory=memory, physics=physics)
    assert second.memory == pytest.approx(1.0 - np.exp(-20.0 / 1800.0), rel=1e-9)
    save_state(tmp_path / "plain.npz", first.state)
    assert load_state(tmp_path / "plain.npz")[1] is None


def test_a_steady_start_holds_what_terms_remember_then(quick):
    """Nothing moves: all of the heat has been there for long."""
    run = run_study(quick, of_phase("10 min", start="steady"), physics=Physics((Lagging(),)))
    assert run.memory == pytest.approx(1.0, abs=1e-9)
    assert np.ptp(run.joined("readings"), axis=0).max() < 1e-4


def test_state_of_another_mesh_is_refused(quick):
    small = ThermalState(0.0, np.full(10, 290.0), np.full(3, 290.0))
    with pytest.raises(SpecError, match="another mesh"):
        simulate_full(quick, held([0.0, 60.0], speed=0.0), start=small)


# -------------------------------------------------------------------- inputs
def test_jump_is_right_continuous(quick):
    """Heat before a jump of the speed is the old one's, after it the new one's."""
    times = [0.0, 5.0, 15.0]
    inputs = held(times, speed=np.array([0.0, 3000.0, 3000.0]) * RPM)
    run = simulate_full(quick, inputs, options=TransientOptions(error=0.5))
    before = run.steps.times <= 5.0
    assert 5.0 in run.steps.times
    assert np.all(run.steps.bearing_heat[before] == 0.0)
    assert np.allclose(run.steps.bearing_heat[~before].sum(axis=1), 620.0)
    sizes = run.steps.sizes[~before]
    assert sizes[0] < 1.0 < sizes[-1]


def test_a_step_begins_with_what_the_last_one_ended_with(quick, monkeypatch):
    """Loads at the start of a step are asked for only where the run starts and where inputs jump."""
    asked = []
    true = CoupledInputs._loads

    def loads(self, time, *rest):
        asked.append(time)
        return true(self, time, *rest)

    monkeypatch.setattr(CoupledInputs, "_loads", loads)
    times = [0.0, 600.0, 1200.0]
    options = TransientOptions(
        error=0.5, first_step=20.0, coupling_tolerance=1e-3, coefficient_tolerance=5e-3
    )
    inputs = held(times, speed=np.array([1500.0, 3000.0, 3000.0]) * RPM)
    run = simulate_full(quick, inputs, watch=Watch(looks=[900.0]), options=options)
    begins = {0.0, *run.steps.times.tolist()}
    assert 900.0 in begins
    assert begins & set(asked) == {0.0, 600.0}


class Switched(Term):
    """100 W into the housing from 60 s on."""

    name = "switched"
    parameters = (TermParameter("start_1", 60.0, unit="s", logarithmic=False),)
    heat_places = ("housing",)

    def heat(self, context):
        return np.full((1, 1), 100.0 if context.time >= 60.0 else 0.0, dtype=complex)


def test_a_term_is_switched_at_its_instant_though_no_input_jumps(quick):
    """All of its heat from the start of the step that begins there is in the account."""
    options = TransientOptions(fixed_step=60.0, coupling_tolerance=1e-3, coefficient_tolerance=5e-3)
    inputs = held([0.0, 120.0], speed=0.0)
    with_it, without = (
        simulate_full(quick, inputs, options=options, physics=physics)
        for physics in (Physics((Switched(),)), Physics())
    )
    added = with_it.energy.heat_in - without.energy.heat_in
    assert added == pytest.approx(100.0 * 60.0, rel=1e-6)


def test_heat_that_the_inputs_give_enters_at_its_place(quick):
    """Held, it is in the account to the joule; where the place is no part, it is refused."""
    options = TransientOptions(fixed_step=60.0, coupling_tolerance=1e-3, coefficient_tolerance=5e-3)
    times = [0.0, 60.0, 120.0]
    plain = simulate_full(quick, held(times, speed=0.0), options=options)
    heated = simulate_full(
        quick, held(times, **{"speed": 0.0, "heat.housing": np.array([100.0, 300.0, 300.0])}), options=options
    )
    added = heated.energy.heat_in - plain.energy.heat_in
    assert added == pytest.approx(60.0 * (100.0 + 300.0), rel=1e-6)
    assert heated.state.temperature.max() > plain.state.temperature.max()
    with pytest.raises(SpecError, match=r"hosing.*housing"):
        simulate_full(quick, held(times, **{"speed": 0.0, "heat.hosing": 1.0}))


def test_held_and_linear_inputs():
    spec = load_machine("wu_tan_2016", SMALL)
    history = InputHistory(
        np.array([0.0, 10.0, 20.0]),
        ("speed", "ambient"),
        np.array([[100.0, 290.0], [-200.0, 300.0], [0.0, 300.0]]),
        np.array([True, False]),
    )
    operating = OperatingHistory.of(spec, history)
    assert operating.at(9.999).speed == 100.0
    assert operating.at(10.0).speed == 200.0
    assert operating.at(5.0).ambient_temperature == pytest.approx(295.0)
    assert operating.at(-5.0).ambient_temperature == 290.0
    assert operating.at(99.0).thrust == spec.operation.thrust
    assert operating.breakpoints().tolist() == [10.0, 20.0]
    assert operating.restarts().tolist() == [10.0, 20.0]


def test_noise_makes_no_breakpoints():
    spec = load_machine("wu_tan_2016", SMALL)
    rng = np.random.default_rng(1)
    times = np.arange(0.0, 3600.0, 10.0)
    history = OperatingHistory.of(
        spec,
        InputHistory(
            times,
            ("speed", "ambient"),
            np.column_stack(
                (300.0 + rng.uniform(-0.1, 0.1, times.size), 290.0 + rng.uniform(-0.02, 0.02, times.size))
            ),
            np.array([True, False]),
        ),
    )
    assert history.breakpoints().size == 0
    assert history.restarts().size == 0
    assert history.breakpoints(temperature=0.02).size > 0


def test_unknown_input_is_refused(quick):
    with pytest.raises(RecordingError, match=r'"sped" drives nothing.*Did you mean "speed"'):
        simulate_full(quick, held([0.0, 60.0], sped=1.0))


@pytest.mark.parametrize(
    "bad",
    [
        {"error": 0.0},
        {"coupling_tolerance": -1.0},
        {"coefficient_tolerance": -1.0},
        {"input_resolution": 0.0},
    ],
)
def test_impossible_options_are_refused(bad):
    with pytest.raises(SpecError, match=next(iter(bad))):
        TransientOptions(**bad)


def test_what_the_energy_may_miss_goes_with_the_coupling():
    assert TransientOptions().energy_tolerance == 1.0e-8
    assert TransientOptions(coupling_tolerance=1.0e-2).energy_tolerance == pytest.approx(1.0e-3)


def test_a_run_is_coupled_more_exactly_until_it_keeps_the_balance_that_was_asked_for():
    tried = []

    def run(options):
        tried.append((options.coupling_tolerance, options.energy_tolerance))
        if 0.3 * options.coupling_tolerance > options.energy_tolerance:
            raise EnergyBalanceError("transient", "heat is lost.")
        return "done"

    assert balanced(run, TransientOptions(coupling_tolerance=1.0e-2)) == "done"
    assert tried == [(1.0e-2, 1.0e-3), (2.5e-3, 1.0e-3)]


@pytest.mark.slow
def test_preload_follows_the_temperatures():
    """Rigid preload in a machine whose parts grow: it rises, at high speed until no equilibrium is left."""
    machine = prepare_machine(load_machine("wu_tan_2016", [*SMALL, *NEAR_RINGS]))
    calm = simulate_full(machine, held([0.0, 1800.0], speed=300 * RPM))
    preload = calm.steps.preload[:, calm.bearings.index("R1")]
    assert np.isfinite(preload).all()
    assert np.ptp(preload) > 10.0
    assert calm.energy.imbalance_relative < 1e-8
    with pytest.raises(NoSteadyStateError, match=r"after \d"):
        simulate_full(machine, held([0.0, 14400.0], speed=4500 * RPM))


# --------------------------------------------------------------------- cases
@pytest.mark.slow
def test_a_study_couples_far_within_the_error_of_its_steps(quick):
    """Readings are those of a coupling to round-off, to a fiftieth of what a step may err by."""
    content = {
        "schema": "spindle-fem/transient/1",
        "name": "short",
        "phase": [{"name": "3000", "speed": "3000 rpm", "duration": "30 min"}],
    }
    study = study_of(content)
    run = run_study(quick, study).phases[0].transient
    kept = study_of({**content, "fields_every": "1 h"})
    exact = run_study(quick, kept).phases[0].transient
    assert exact.energy.imbalance_relative < 1e-8
    assert run.counts["evaluations"] < 0.7 * exact.counts["evaluations"]
    assert run.energy.imbalance_relative < study.options().energy_tolerance == pytest.approx(1e-5)
    assert np.abs(run.readings - exact.readings).max() < 0.02 * study.error


@pytest.mark.slow
def test_step_test_goes_on_when_settled(quick):
    """Each speed ends at the first look at which no probe has moved by the threshold."""
    study = study_of(
        {
            "schema": "spindle-fem/transient/1",
            "name": "short",
            "until": {"change": "2 K", "within": "10 min", "look_every": "5 min", "at_most": "2 h"},
            "phase": [{"name": "1000", "speed": "1000 rpm"}, {"name": "2000", "speed": "2000 rpm"}],
        }
    )
    result = run_study(quick, study)
    first, second = result.phases
    assert first.settled
    assert second.settled
    assert second.start == first.end
    assert first.end % 300.0 == 0.0
    times, readings = result.joined("times"), result.joined("readings")
    assert np.all(np.diff(times) > 0.0)
    for phase in result.phases:
        at = [readings[np.flatnonzero(times == phase.end - back)[0]] for back in (0.0, 600.0)]
        if phase is second:
            assert np.abs(at[0] - at[1]).max() < 2.0
        assert phase.transient.energy.imbalance_relative < study.options().energy_tolerance
    earlier = [readings[np.flatnonzero(times == second.end - back)[0]] for back in (300.0, 900.0)]
    assert second.end - second.start == 600.0 or np.abs(earlier[0] - earlier[1]).max() >= 2.0


@pytest.mark.slow
def test_cool_down_after_switch_off(paper_machine, steady):
    study = study_of(
        {
            "schema": "spindle-fem/transient/1",
            "name": "off",
            "start": "steady",
            "phase": [{"name": "standstill", "speed": "0 rpm", "thrust": "0 N", "duration": "1 h"}],
        }
    )
    run = run_study(paper_machine, study).phases[0].transient
    assert run.readings[0, 0] == pytest.approx(steady.probes["SP01"], abs=1e-6)
    assert np.all(run.steps.bearing_heat == 0.0)
    assert np.all(np.diff(run.steps.hottest) < 0.0)
    assert run.energy.stored < 0.0
    assert run.energy.imbalance_relative < 1e-5
