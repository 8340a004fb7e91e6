"""A machine on its recordings: derivatives and first-order answers against differences of full runs."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.interpolate import interp1d

from spindle_fem.definition.load import load_machine
from spindle_fem.effects.registry import candidates_for, effect_of, interval_effects
from spindle_fem.inference.candidate_response import BaseRun, Variant, variants_of
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX, PROBE_PREFIX
from spindle_fem.inference.drive_steps import SETTLING, SHORT_STEP, coarse_drive
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import EXPECTED_SLOW, known_before, start_coordinates
from spindle_fem.inference.recording_gaps import about_rows_amid, hidden_in
from spindle_fem.inference.search_basis import on_smaller_bases
from spindle_fem.inference.unseen_moments import unread_changes
from spindle_fem.machine.view.build_view import view_of
from spindle_fem.model.reduced.drive import drive_of_recording
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.recordings.align import read_recording
from tests.support.lumped_spindle import lumped_model

PROBES = ("SP01", "SP02", "SP03", "SP04", "SP05", "COOLANT_OUT")
MANIFEST = """
schema = "spindle-fem/recording/1"
name = "steps"
data = "steps.csv"
time = {column = "t", unit = "s"}
channel = [
{column = "speed", role = "input", hold = "previous", drives = "speed", unit = "rpm"},
{column = "ambient", role = "input", drives = "ambient", unit = "degC"},
{column = "coolant_in", role = "input", drives = "coolant_inlet", unit = "degC"},
%s]
"""
CHANNEL = '{column = "%s", role = "temperature", probe = "%s", unit = "degC", sigma = 0.1},\n'
# The machine is not at its nominal parameters, and a feedback is in it already.
NOW = {"heat.front": 1.15, "coolant.film_factor": 0.85, "film.outside": 1.2}


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lumped")
    times = np.arange(0.0, 6001.0, 50.0)
    speed = np.select([times < 600, times < 2500, times < 3200], [0.0, 3000.0, 0.0], 4000.0)
    columns = {
        "t": times,
        "speed": speed,
        "ambient": 20.0 + np.sin(times / 900.0),
        "coolant_in": 18.0 + 0.4 * np.cos(times / 700.0),
    }
    columns |= dict.fromkeys(PROBES, np.full(times.size, 20.0))
    pd.DataFrame(columns).to_csv(folder / "steps.csv", index=False)
    channels = "".join(CHANNEL % (name, name) for name in PROBES)
    (folder / "steps.toml").write_text(MANIFEST % channels, encoding="utf-8")
    return read_recording(folder / "steps.toml")


@pytest.fixture(scope="module")
def predictor(recording):
    spec = load_machine("recorded_spindle")
    model = lumped_model(spec)
    slopes = np.random.default_rng(5).normal(0.0, 20.0, (len(model.probe_names), 2, model.size))
    # A uniform field has no gradient.
    slopes -= slopes.mean(axis=2, keepdims=True)
    fast = fast_spindle(replace(model, probe_gradients=slopes), spec)
    return Predictor(fast, [recording], [np.ones(recording.times.size, dtype=bool)], step=60.0)


@pytest.fixture(scope="module")
def view(predictor, recording):
    return view_of(predictor.fast.names, recording)


@pytest.fixture(scope="module")
def candidates(view):
    """One candidate of every effect and form."""
    found = {(c.effect, c.form): c for c in reversed(candidates_for(view))}
    for effect in interval_effects():
        for form in effect.interval_forms:
            candidate = effect.over(view, "housing", [(900.0, 2000.0), (3000.0, 4000.0)], form)
            found[candidate.effect, candidate.form] = candidate
    return found


def coordinate_names(candidate):
    factors = {item.name for item in candidate.factors}
    return [EFFECT_PREFIX + name if name in factors else name for name in candidate.free]


def values_of(candidate):
    """At the reference amplitude, from the first of its starting shapes."""
    factors = {item.name for item in candidate.factors}
    values = Variant(candidate, candidate.starts[0]).values(candidate.reference)
    return {EFFECT_PREFIX + name if name in factors else name: value for name, value in values.items()}


def require_derivatives(predictor, values, candidates, steps):
    """Compare with central differences; ``steps`` of values, or None for a logarithm."""
    names = list(steps)
    found = predictor.predict(0, values, candidates, names)
    for column, (name, step) in enumerate(steps.items()):
        value = values.get(name, 0.0 if name.startswith(PROBE_PREFIX) else 1.0)
        if step is None:
            ends, width = [value * np.exp(sign * 1e-6) for sign in (1.0, -1.0)], 2e-6
        else:
            ends, width = [value + step, value - step], 2.0 * step
        up, down = (predictor.predict(0, {**values, name: end}, candidates).temperature for end in ends)
        difference = (up - down) / width
        size = np.abs(difference).max()
        assert size > 0.0, f"{name} does nothing"
        assert np.abs(found.sensitivity[:, :, column] - difference).max() < 2e-4 * size, name
    return found


def steps_of(candidate):
    """Of every coordinate: None for a logarithm, else a small share of what its prior lets it move."""
    items = zip(coordinate_names(candidate), candidate.free.values(), strict=True)
    return {name: None if item.logarithmic else 1e-4 * item.sigma for name, item in items}


def test_machine_parameters_and_places_of_probes(predictor, candidates):
    preload = candidates["thermal_preload", ""]
    names = [prior.name for prior in predictor.uncertain()]
    places = list(predictor.displacements())
    assert len(places) == 10
    values = {**NOW, **values_of(preload)}
    shifts = dict.fromkeys(places, 1e-6)
    require_derivatives(predictor, values, [preload], dict.fromkeys(names) | shifts)
    moved = {"probe.SP02.r": 1e-3, "probe.SP03.z": -5e-4}
    require_derivatives(predictor, {**values, **moved}, [preload], shifts)


def test_a_spindle_begins_at_the_ambient_or_at_its_first_readings(predictor, recording):
    assert predictor.start(0) == pytest.approx(293.15, abs=0.01)
    warm = replace(recording, temperature=recording.temperature + np.linspace(4.0, 6.0, len(PROBES)))
    spec = load_machine("recorded_spindle", ['initial="first_reading"'])
    assert Predictor(fast_spindle(lumped_model(spec), spec), [warm]).start(0) == pytest.approx(298.15)


def test_a_displaced_probe_reads_the_gradient(predictor):
    run = predictor.transient(0, {}, ())
    states, _ = run.march(predictor.start(0))
    model = predictor.fast.model
    there = predictor.predict(0, {}).temperature
    moved = predictor.predict(0, {"probe.SP02.r": 2e-3}).temperature - there
    slope = states @ model.probe_gradients[model.probe_names.index("SP02"), 0]
    assert moved[:, 1] == pytest.approx(2e-3 * slope, abs=1e-9)
    assert np.abs(np.delete(moved, 1, axis=1)).max() == 0.0


@pytest.mark.parametrize(
    "effect",
    [
        "thermal_preload",
        "viscosity_heat",
        "grease_churning",
        "starvation",
        "drive_heat",
        "gap_closure",
        "mount_sink",
        "natural_convection",
        "radiation",
        "shaft_convection",
        "coolant_bypass",
        "heat_capacity",
        "ambient_drift",
        "chiller_cycling",
        "unrecorded_heat_source",
        "unrecorded_cooling",
    ],
)
def test_parameters_of_terms(predictor, candidates, effect):
    for candidate in (c for (name, _), c in candidates.items() if name == effect):
        values = {**NOW, **values_of(candidate)}
        require_derivatives(predictor, values, [candidate], {"heat.front": None, **steps_of(candidate)})


@pytest.mark.parametrize("effect", ["heat_scale", "heat_split", "coolant_film", "joint_conductance"])
def test_factors_of_an_effect_multiply_those_of_the_machine(predictor, candidates, effect):
    candidate = next(c for (name, _), c in candidates.items() if name == effect and c.factors)
    (own,) = (item.name for item in candidate.factors)
    values = {own: 1.2, EFFECT_PREFIX + own: 0.7}
    together = predictor.predict(0, {own: 1.2 * 0.7}).temperature
    assert predictor.predict(0, values, [candidate]).temperature == pytest.approx(together, abs=1e-9)
    found = require_derivatives(predictor, values, [candidate], {own: None, EFFECT_PREFIX + own: None})
    assert found.sensitivity[:, :, 0] == pytest.approx(found.sensitivity[:, :, 1], abs=1e-12)


@pytest.mark.parametrize(
    "effect", ["sensor_lag", "sensor_gain", "sensor_offset", "sensor_drift", "sensor_detached", "clock_shift"]
)
def test_parameters_of_readings_and_what_passes_through_them(predictor, candidates, effect):
    for candidate in (c for (name, _), c in candidates.items() if name == effect):
        values = {**NOW, **values_of(candidate)}
        if effect == "clock_shift":
            # Not a whole number of steps, where a broken line has no derivative.
            values[candidate.amplitude] = 217.0
        channel = candidate.reading.channel
        places = [] if channel == "COOLANT_OUT" else [f"probe.{channel}.r"]
        steps = {"heat.front": None, "coolant.film_factor": None, **dict.fromkeys(places, 1e-6)}
        steps |= steps_of(candidate)
        found = require_derivatives(predictor, values, [candidate], steps)
        others = [i for i, name in enumerate(PROBES) if name != channel]
        own = slice(len(steps) - len(candidate.free), None)
        assert np.abs(found.sensitivity[:, others, own]).max() == 0.0


def test_two_terms_on_the_same_friction(predictor, candidates):
    pair = [candidates["thermal_preload", ""], candidates["starvation", ""]]
    values = NOW | values_of(pair[0]) | values_of(pair[1])
    require_derivatives(
        predictor, values, pair, {"heat.front": None, **steps_of(pair[0]), **steps_of(pair[1])}
    )


def test_slopes_of_states_lead_to_runs_nearby_and_to_places(predictor, candidates):
    closing = candidates["gap_closure", "ring over start"]
    values = {**NOW, **values_of(closing)}
    names = [prior.name for prior in predictor.uncertain()] + coordinate_names(closing) + ["probe.SP01.r"]
    found = predictor.predict(0, values, [closing], names)
    logarithmic = {**dict.fromkeys(names, True), "probe.SP01.r": False}
    logarithmic |= {n: closing.free[n].logarithmic for n in coordinate_names(closing) if n in closing.free}
    move = np.array([0.02 if logarithmic[name] else -0.005 for name in names])
    there = {
        name: values.get(name, 1.0) * np.exp(step) if logarithmic[name] else values.get(name, 0.0) + step
        for name, step in zip(names, move, strict=True)
    }
    exact = predictor.predict(0, values | there, [closing]).states
    away = np.abs(exact - found.states).max()
    assert away > 0.1
    assert np.abs(exact - found.moved(move).states).max() < 0.05 * away
    model = predictor.fast.model
    rows = [model.probe_names.index(name) for name in PROBES if name in model.probe_names]
    columns = [PROBES.index(model.probe_names[row]) for row in rows]
    slopes = found.slopes_at(model.probes[rows])
    assert not slopes[:, :, -1].any()
    assert slopes[:, :, :-1] == pytest.approx(found.sensitivity[:, columns, :-1], abs=1e-9)
    # From there the run is the same, whatever it begins from.
    again = predictor.predict(0, values | there, [closing], near=found.moved(move))
    assert np.abs(again.states - exact).max() < 1e-5


def test_two_recordings_do_not_know_of_one_another(predictor, recording):
    both = Predictor(predictor.fast, [recording, recording], [predictor.use[0]] * 2, step=60.0)
    assert both.predict(1, NOW).temperature == pytest.approx(predictor.predict(0, NOW).temperature, abs=1e-12)
    assert [item.recording for item in both.observations] == [0] * 6 + [1] * 6


def test_steps_end_where_inputs_jump_and_keep_their_course(predictor, recording):
    drive = coarse_drive(predictor.fast.spec, recording, 100.0)
    fine = drive_of_recording(predictor.fast.spec, recording)
    assert drive.steps.max() <= 100.0 + 1e-9
    for name in ("speed", "ambient", "coolant_inlet"):
        column = drive.names.index(name)
        total, exact = (
            float(np.sum(0.5 * (item.start + item.end)[:, column] * item.steps)) for item in (drive, fine)
        )
        assert total == pytest.approx(exact, rel=1e-5), name
    jumps = fine.grid[1:-1][fine.start[1:, 0] != fine.end[:-1, 0]]
    assert jumps.size == 3
    assert np.isin(jumps, drive.grid).all()
    # Short where balls and films settle, and in the last step before a change.
    since = drive.grid[:-1] - np.append(0.0, jumps)[np.searchsorted(jumps, drive.grid[:-1], side="right")]
    assert drive.steps[since < SETTLING - 1e-6].max() <= SHORT_STEP + 1e-6
    assert drive.steps[np.searchsorted(drive.grid, jumps) - 1].max() <= SHORT_STEP + 1e-6
    assert drive.steps.max() > 2.0 * SHORT_STEP


def test_a_speed_that_trembles_makes_no_short_steps(predictor, recording):
    column = recording.input_names.index("speed")
    trembles = recording.inputs.copy()
    trembles[:, column] += np.where(trembles[:, column] > 0.0, np.arange(len(trembles)) % 2, 0)
    drive = coarse_drive(predictor.fast.spec, replace(recording, inputs=trembles), 100.0)
    settled = np.min([abs(drive.grid[:-1] - at) for at in (0.0, 600.0, 2500.0, 3200.0)], axis=0) > 300.0
    assert drive.steps[settled].min() > 2.0 * SHORT_STEP  # from row to row
    after = (drive.grid[:-1] >= 600.0) & (drive.grid[:-1] < 600.0 + SETTLING)
    assert drive.steps[after].max() <= SHORT_STEP + 1e-6
    trembles[:, column] = 314.0 + np.arange(len(trembles)) % 2
    drive = coarse_drive(predictor.fast.spec, replace(recording, inputs=trembles), 100.0)
    assert drive.steps[drive.grid[:-1] > 300.0].min() > 2.0 * SHORT_STEP


def test_readings_of_a_bin_are_held_against_the_mean_over_its_rows(predictor, recording):
    readings = np.abs(recording.times - 2510.0)[:, None] * np.ones(len(PROBES))
    own = Predictor(predictor.fast, [replace(recording, temperature=readings)], step=60.0)
    item = own.observations[0]
    sharp = np.abs(own.drives[0].grid - 2510.0)
    expected = item.bins.average(np.interp(recording.times, own.drives[0].grid, sharp))
    np.testing.assert_allclose(item.at(sharp), expected, rtol=1e-12)


def test_covariates_are_means_over_the_steps_and_end_none(predictor, recording):
    """What is recorded beside the inputs flickers as it likes: it costs no steps and keeps its integral."""
    flicker = np.random.default_rng(3).uniform(0.0, 80.0, recording.times.size)
    flicker[::7] = np.nan
    beside = replace(
        recording,
        covariate_names=("load", "silent"),
        covariates=np.column_stack((flicker, np.full(flicker.size, np.nan))),
        covariate_units=("", "watt"),
    )
    drive, without = (coarse_drive(predictor.fast.spec, item, 100.0) for item in (beside, recording))
    assert drive.grid == pytest.approx(without.grid)
    assert drive.names == (*without.names, "covariate.load")
    assert drive.start[:, -1] == pytest.approx(drive.end[:, -1])
    read = np.isfinite(flicker)
    exact = np.trapezoid(flicker[read], recording.times[read])
    exact += flicker[read][0] * recording.times[read][0]
    assert float(drive.start[:, -1] @ drive.steps) == pytest.approx(exact, rel=1e-9)
    quantities = {item.name: item for item in view_of(predictor.fast.names, beside).quantities}
    assert list(quantities) == ["change of speed", "load"]
    assert (quantities["load"].input, quantities["load"].beside) == ("covariate.load", True)
    assert quantities["load"].highest == np.nanmax(flicker)
    on = np.interp(beside.times, beside.times[read], flicker[read])
    assert np.mean(quantities["load"].levels) == pytest.approx(on[on > 4.0].mean(), rel=0.02)
    # 0, 3000, 0, 4000 rpm.
    turned = np.array([3000.0, 3000.0, 4000.0]) ** 2 * (np.pi / 30.0) ** 2
    assert quantities["change of speed"].levels == pytest.approx(turned)


def test_what_happens_in_a_gap_is_open_for_each_set_and_for_inputs_that_changed(predictor, recording):
    """Friction of each bearing set in every piece, the coolant where it is another afterwards; no air."""
    kept = (recording.times <= 1500.0) | (recording.times > 2000.0)
    column = recording.input_names.index("coolant_inlet")
    inputs = recording.inputs.copy()
    inputs[recording.times > 2000.0, column] += 9.0
    gap = replace(
        recording,
        times=recording.times[kept],
        temperature=recording.temperature[kept],
        flags=recording.flags[kept],
        inputs=inputs[kept],
        covariates=recording.covariates[kept],
    )
    own = Predictor(predictor.fast, [gap], [np.ones(gap.times.size, dtype=bool)], step=60.0)
    pieces = own.gap_intervals(0)
    assert pieces[0][0] == 1500.0
    assert pieces[-1][1] == 2050.0
    sets = len(predictor.fast.spec.bearing_set)
    names = [name for name, _ in own.gaps()]
    assert len(names) == (sets + 1) * len(pieces)
    still = own.predict(0, {}).temperature
    change = {name: own.predict(0, {name: 1.0}).temperature - still for name in names}
    grid = own.drives[0].grid
    for moved in change.values():
        assert np.abs(moved[grid <= 1500.0]).max() == 0.0
        assert np.abs(moved[grid > 2050.0]).max() > 1e-3
    first, last = names[0], names[-1]
    front, rear = PROBES.index("SP01"), PROBES.index("SP05")
    after = int(np.searchsorted(grid, 2100.0))
    # The first set warms its own end; coolant that is warmer all the time warms everything.
    assert change[first][after, front] > change[first][after, rear] >= 0.0
    assert (change[last][after:] > 0.0).all()


def test_when_a_held_input_changed_between_two_rows_is_open(predictor, recording):
    """A sample shows what changed since the one before it: up to a spacing earlier, never later."""
    own = predictor.jumps()
    assert [(least, most) for _, least, most in own] == [(0.0, 50.0)] * 3
    jump = start_coordinates(predictor)[-3:][1]
    assert (jump.at(jump.low), jump.at(jump.high)) == (0.0, pytest.approx(50.0))
    assert jump.at(0.0) == pytest.approx(25.0)
    # The second, the stop at 2500 s, 40 s earlier: the same run with rows ten seconds apart.
    times = np.union1d(recording.times, [2460.0])
    rows = np.searchsorted(recording.times, times, side="right") - 1
    inputs = recording.inputs[rows].copy()
    inputs[times == 2460.0, recording.input_names.index("speed")] = 0.0
    earlier = replace(
        recording,
        times=times,
        temperature=recording.temperature[rows],
        flags=recording.flags[rows],
        inputs=inputs,
        covariates=recording.covariates[rows],
    )
    exact = Predictor(predictor.fast, [earlier], [np.ones(times.size, dtype=bool)], step=60.0)
    # A machine of other heat than defined: the change is worked out about that.
    heat = {"heat.front": 1.5, "heat.rear": 1.5}
    about = predictor.misdescribed_by((), {}, (heat, ()))
    # At the very row the bearings have settled by a third already: their first rate says three times as much.
    for after in (2500.0, 2560.0, 3100.0):
        told, meant, still = (
            interp1d(item.drives[0].grid, item.predict(0, heat | values).temperature, axis=0)(after)
            for item, values in ((about, {own[1][0]: 40.0}), (exact, {}), (about, {}))
        )
        fast = [PROBES.index(name) for name in ("SP01", "SP02", "SP03")]
        assert np.abs(meant - still)[fast].min() > 0.01
        np.testing.assert_allclose((told - still)[fast], (meant - still)[fast], rtol=0.15)


def test_an_input_temperature_need_not_go_straight_between_rows_far_apart(recording):
    column = recording.input_names.index("coolant_inlet")
    inputs = recording.inputs.copy()
    inputs[recording.times > 2000.0, column] += 9.0
    (found,) = hidden_in(replace(recording, inputs=inputs), (), ())
    assert (found.begin, found.end, found.what) == (2000.0, 2050.0, "coolant_inlet")
    assert found.size == pytest.approx(9.0, abs=0.1)
    assert hidden_in(recording, (), ()) == ()


def test_changes_between_rows_that_were_held_out_are_told_by_all_readings(predictor, recording):
    """No fitted reading shows when within a held-out stretch something changed: its own readings do."""
    use = (recording.times < 2400.0) | (recording.times > 2900.0)
    blank = Predictor(predictor.fast, [recording], [use], step=60.0)
    name = blank.jumps()[1][0]
    truth = blank.predict(0, {name: 2.0}).temperature
    at_rows = interp1d(blank.drives[0].grid, truth, axis=0)(recording.times)
    own = Predictor(predictor.fast, [replace(recording, temperature=at_rows)], [use], step=60.0)
    fit = Problem(own, known_before(own), EXPECTED_SLOW, own.observations).fit()
    # Readings after the stretch told less, by the fit: they do not tell it once more.
    assert abs(unread_changes(own, fit)[name] - 2.0) < 0.4 < 6.0 < abs(fit.values[name] - 2.0)


def with_speeds(recording, after):
    """The recording with other speeds, rad/s, from some rows on."""
    inputs, column = recording.inputs.copy(), recording.input_names.index("speed")
    for row, speed in after.items():
        inputs[row:, column] = speed
    return replace(recording, inputs=inputs)


def test_rows_amid_a_change_tell_when_it_was_where_nothing_was_fitted(predictor, recording):
    """A logger that writes means shows a stop in two rows, each time alike: what one shows holds of all."""
    amid = with_speeds(recording, {0: 0.0, 10: 150.0, 11: 300.0, 24: 150.0, 25: 0.0, 40: 150.0, 41: 300.0})
    ramp = with_speeds(recording, {0: 0.0, 10: 100.0, 11: 200.0, 12: 300.0, 40: 0.0})
    use = (recording.times < 1150.0) | (recording.times > 1500.0)
    blank, other = (Predictor(predictor.fast, [item], [use], step=60.0) for item in (amid, ramp))
    found = [about_rows_amid(i.recordings[0], i.drives[0], i.unread_jumps[0]) for i in (blank, other)]
    assert found == [([0, 2, 4], [], [1, 3, 5]), ([0], [1], [2])]
    earlier = {name: (5.0, 40.0)[i % 2] for i, (name, *_) in enumerate(blank.jumps())}
    read = interp1d(blank.drives[0].grid, blank.predict(0, earlier).temperature, axis=0)(amid.times)
    own = Predictor(predictor.fast, [replace(amid, temperature=read)], [use], step=60.0)
    fit = Problem(own, known_before(own), EXPECTED_SLOW, own.observations).fit()
    assert [fit.values[name] for name in earlier][2:4] == pytest.approx([5.0, 40.0], abs=8.0)


def test_the_small_basis_reads_what_the_large_one_does(predictor, candidates):
    places = [name for name in predictor.fast.model.place_names if "raceway" in name]
    small, final = on_smaller_bases(predictor, [prior.name for prior in predictor.uncertain()], places)
    assert small.fast.model.size < final.fast.model.size < predictor.fast.model.size
    preload = candidates["thermal_preload", ""]
    values = {**NOW, **values_of(preload), "probe.SP02.r": 1e-3}
    names = ["heat.front", "probe.SP02.r", *coordinate_names(preload)]
    small_read, read = (item.predict(0, values, [preload], names) for item in (small, predictor))
    assert np.ptp(read.temperature) > 10.0
    assert small_read.temperature == pytest.approx(read.temperature, abs=0.02)
    size = np.abs(read.sensitivity).max(axis=(0, 1))
    error = np.abs(small_read.sensitivity - read.sensitivity).max(axis=(0, 1))
    assert np.all(error < 0.02 * size)


# --------------------------------------------------------------------- screening
def weak(candidate, share=1e-3):
    """The candidate with a reference amplitude close to nothing."""
    step = share * (candidate.reference - candidate.null)
    return replace(candidate, reference=candidate.null + step)


@pytest.mark.parametrize("held", [False, True], ids=["linear machine", "machine with a term"])
def test_answers_are_differences_of_full_runs_at_small_amplitude(predictor, candidates, held):
    closing = candidates["gap_closure", "ring over start"]
    present = (closing,) if held else ()
    values = NOW | (values_of(closing) if held else {})
    chosen = [weak(c) for c in candidates.values() if not (held and c.effect == "gap_closure")]
    assert len(chosen) > 35
    variants = [Variant(c, c.starts[0]) for c in chosen]
    base = BaseRun(predictor, 0, values, present)
    answers = base.responses(variants)
    nothing = predictor.predict(0, values, present).temperature
    for column, variant in enumerate(variants):
        candidate = variant.candidate
        own = values_of(candidate)
        told = predictor.predict(0, values | own, (*present, candidate)).temperature
        difference = told - nothing
        size = np.abs(difference).max()
        assert size > 1e-6, candidate.label
        # First order: what is left is of the order of the amplitude, a thousandth.
        assert np.abs(answers[:, :, column] - difference).max() < 0.01 * size, candidate.label


def test_answers_do_not_depend_on_their_company(predictor, candidates):
    variants = variants_of([candidates[key] for key in (("windage", ""), ("heat_scale", ""))])
    variants += variants_of([candidates["sensor_lag", ""], candidates["grease_churning", ""]])
    base = BaseRun(predictor, 0, NOW)
    together = base.responses(variants)
    for column, variant in enumerate(variants):
        assert base.responses([variant])[:, :, 0] == pytest.approx(together[:, :, column], abs=1e-10)


def test_every_starting_shape_is_a_variant(view):
    chosen = [effect_of("starvation").candidates(view)[0], effect_of("windage").candidates(view)[0]]
    variants = variants_of(chosen)
    assert len(variants) == len(chosen[0].starts) + 1
    onset = f"{chosen[0].terms[0].name}.onset_speed"
    assert len({v.values(0.1)[onset] for v in variants[:-1]}) == len(chosen[0].starts)
    assert variants[0].values(0.1)[chosen[0].amplitude] == 0.1
