"""Directions in which a machine may differ from its definition: what they do to readings, and to a fit."""

import copy
import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine, write_machine
from spindle_fem.effects.framework.effect import Reported
from spindle_fem.effects.framework.filters import first_order_lag
from spindle_fem.inference import tuned
from spindle_fem.inference.belief import Coordinate
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.coordinate_names import MISDESCRIBED_PREFIX
from spindle_fem.inference.freed_priors import WIDER, Freed
from spindle_fem.inference.heat_misdescriptions import (
    Conductivity,
    Response,
    SpeedConductance,
    SpeedShape,
    clock_change,
    shape_modes,
)
from spindle_fem.inference.hypothesis import Hypothesis, Ranked
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.improved_machine import improved_machine
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.misdescription_columns import misdescriptions_of, with_misdescriptions
from spindle_fem.inference.misdescription_content import misdescription_content
from spindle_fem.inference.mounting_misdescriptions import Bridge, mounting_misdescriptions
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import EXPECTED_SLOW, calibrate
from spindle_fem.inference.uncertain_numbers import uncertain_numbers
from spindle_fem.inference.verdict import PRIOR_SIGMAS, Judgement
from spindle_fem.inference.wrong_definition import (
    is_beyond_prior,
    number_beyond_prior,
    numbers_far_off,
    suspected_direction,
    suspected_of_calibration,
    with_wrong_definition,
    wrong_definition_words,
    wrong_direction,
)
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.report.diagnosis_tables import misdescription_blocks
from spindle_fem.report.diagnosis_words import checks, verdict_sentence
from spindle_fem.units import NORMAL_90_PERCENT
from tests.support.diagnosed_spindle import TIMES, Case, written
from tests.support.lumped_spindle import lumped_model

GIVEN = SimpleNamespace(spec=None, given=None, redefined=None)  # no key of it is asked for
FRONT = ("F1", "F2", "F3")
SHAPE = "heat_shape.front.1"
ALWAYS = (0.0, 1000.0), (1.0, 1.0)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return Case(tmp_path_factory.mktemp("misdescribed"))


@pytest.fixture(scope="module")
def predictor(case):
    return Predictor(case.fast, [case.blank])


def column_of(predictor, change):
    item = Misdescription("one", "", "", 1.0, "", change)
    own = with_misdescriptions(predictor, [item])
    return own.predict(0, {}, (), [item.coordinate]).sensitivity[:, :, 0]


def test_more_heat_at_all_speeds_is_the_heat_factor(predictor):
    column = column_of(predictor, SpeedShape(FRONT, *ALWAYS))
    expected = predictor.predict(0, {}, (), ["heat.front"]).sensitivity[:, :, 0]
    np.testing.assert_allclose(column, expected, atol=2e-3 * np.abs(expected).max())


def test_balls_that_conduct_better_at_full_speed_are_another_conductance(predictor):
    better = SpeedConductance(("balls.F1.inner", "balls.F1.outer"), 100.0)

    def at_full_speed(base):
        base.start_inputs = base.end_inputs = {"speed": np.full(len(base.drive.steps), 100.0)}
        return better(base)

    column = column_of(predictor, at_full_speed)
    plain, more = (
        predictor.predict(0, {f"balls.F1.{side}": factor for side in ("inner", "outer")}).temperature
        for factor in (1.0, 1.001)
    )
    expected = (more - plain) / 0.001
    np.testing.assert_allclose(column, expected, atol=0.01 * np.abs(expected).max())


def test_a_bridge_is_a_contact_beside_the_contact(predictor):
    column = column_of(predictor, Bridge("cover", "housing"))
    (contact,) = (c for c in predictor.fast.model.coefficient_names if c.startswith("joint.cover|housing"))
    conducts = 0.01 * float(np.mean(BaseRun(predictor, 0, {}).strength(contact)))  # its area, m2
    plain, more = (predictor.predict(0, {contact: factor}).temperature for factor in (1.0, 1.001))
    expected = (more - plain) / (0.001 * conducts)
    # Heat of a bridge is linear within a step, which a stiff contact's is not at the very start.
    np.testing.assert_allclose(column[5:], expected[5:], atol=5e-3 * np.abs(expected).max())


def test_bridges_end_at_every_segment_beside_the_flange_and_on_its_sides():
    spec = load_machine("recorded_spindle")
    segments = [segment.name for part in spec.part if part.name == "housing" for segment in part.segment]
    places = [f"{side}housing.{name}" for name in segments for side in ("", "up.", "across.")]
    machine = SimpleNamespace(spec=spec, model=SimpleNamespace(place_names=tuple(places)))
    found = [
        item.change for item in mounting_misdescriptions(SimpleNamespace(is_network=False, fast=machine))
    ]
    (flange,) = {item.start for item in found}
    ends = {(item.end, item.side) for item in found}
    assert len(found) == 3 * (len(segments) - 1)
    assert (flange, "") not in ends
    assert ("housing.rear_body", "up.housing.rear_body") in ends


def test_a_clock_moves_readings_along_their_own_slope(predictor):
    column = column_of(predictor, clock_change)
    told, grid = predictor.predict(0, {}).temperature, predictor.drives[0].grid
    later = np.array([np.interp(grid - 20.0, grid, one) for one in told.T]).T
    smooth = (grid > 200.0) & (np.abs(grid - 1800.0) > 200.0) & (np.abs(grid - 8100.0) > 200.0)
    np.testing.assert_allclose(20.0 * column[smooth], (later - told)[smooth], atol=0.02)
    # At an end too, of which a watch has one every few rows.
    np.testing.assert_allclose(20.0 * column[-1], (later - told)[-1], rtol=0.1)


def test_a_slow_sensor_moves_its_own_channel_only(predictor):
    column = column_of(predictor, Response("SP02"))
    told, grid = predictor.predict(0, {}).temperature[:, 1:2], predictor.drives[0].grid
    lagged = first_order_lag(grid, told, np.array([tuned.RESPONSE_SIGMA])).real
    np.testing.assert_allclose(tuned.RESPONSE_SIGMA * column[:, 1:2], lagged - told, atol=1e-9)
    assert not np.delete(column, 1, axis=1).any()
    assert not column_of(predictor, Response("elsewhere")).any()


@pytest.mark.parametrize("effect", ["clock_shift", "sensor_gain"])
def test_what_a_probe_feels_late_passes_through_a_sensor_that_lies_once(case, predictor, effect):
    lying = case.candidates[effect, "SP02"]
    values = {lying.amplitude: 900.0 if effect == "clock_shift" else 3.0}
    late = Misdescription("late", "", "", 1.0, "", Response("SP02"))
    about = with_misdescriptions(predictor, [late], values, [lying])
    alone = with_misdescriptions(predictor, [late])
    told, expected = (
        own.predict(0, values, [lying], [late.coordinate]).sensitivity[:, :, 0] for own in (about, alone)
    )
    assert np.abs(expected[:, 1]).max() > 0.0
    np.testing.assert_allclose(told, expected, atol=1e-12)


def test_the_improved_machine_has_the_table_put_right(case):
    share = 0.1
    shape = SpeedShape(FRONT, (0.0, 1000.0), (0.0, 1.0))
    before, after = case.spec.heat.table, shape.corrected(case.spec, share).heat.table
    np.testing.assert_allclose(after.heat["R1"], before.heat["R1"])
    factor = 1.0 + share * np.array(before.speed) / 1000.0
    np.testing.assert_allclose(after.heat["F1"], factor * np.array(before.heat["F1"]))


def test_the_improved_machine_takes_up_what_its_definition_cannot_hold(case, predictor, tmp_path):
    def more_heat(base):
        """As a factor on the heat, which is a parameter, but without a key of its own."""
        return SpeedShape(FRONT, *ALWAYS)(base)

    true = predictor.predict(0, {"heat.front": 1.15}).temperature
    read = np.array([np.interp(TIMES, predictor.drives[0].grid, column) for column in true.T]).T
    noise = np.random.default_rng(3).normal(0.0, 0.05, read.shape)
    recorded = Predictor(case.fast, [written(tmp_path, read - 273.15 + noise)])
    wide = Misdescription("more_heat", "", "", 0.3, "", more_heat)
    recorded = with_misdescriptions(recorded, [wide])
    calibrated = calibrate(None, recorded)
    fit = Problem(recorded, calibrated.belief, EXPECTED_SLOW, recorded.observations).fit()
    assert fit.values["heat.front"] < 1.08  # the rest is the direction's
    diagnosis = SimpleNamespace(
        predictor=recorded,
        stated_fit=fit,
        states={},
        calibrated=calibrated,
        machine_coordinates=calibrated.belief.coordinates,
    )
    path = tmp_path / "improved.toml"
    path.write_text(improved_machine(diagnosis, SimpleNamespace(is_network=False, spec=case.spec)).text)
    spec = load_machine(path)
    again = Predictor(fast_spindle(lumped_model(spec), spec), recorded.recordings).predict(0, {}).temperature
    plain = predictor.predict(0, {}).temperature
    assert np.sqrt(np.mean((again - true) ** 2)) < 0.1 * np.sqrt(np.mean((plain - true) ** 2))


def test_a_channel_without_calibration_is_known_as_before(case, predictor):
    named = Misdescription("response.other", "", "s", 10.0, "", Response("other"))
    earlier = with_misdescriptions(predictor, misdescriptions_of(predictor)[:-3])
    whole = with_misdescriptions(predictor, (named, *misdescriptions_of(predictor)))
    belief = calibrate(earlier, whole).belief
    names = [c.name for c in belief.coordinates]
    row = names.index(named.coordinate)
    assert belief.mean[row] == 0.0
    assert np.linalg.inv(belief.root.T @ belief.root)[row, row] == pytest.approx(1.0)


def test_a_corrected_machine_can_be_written_and_read(case, tmp_path):
    changed = SpeedShape(FRONT, (0.0, 1000.0), (0.0, 1.0)).corrected(case.spec, 0.1)
    # As a fit has it: a place in an array of positions.
    share = Coordinate("conductivity.cast_iron", 0.0, 0.05, False, -3.0, 3.0).at(np.ones(1)[0])
    changed = Conductivity("cast_iron").corrected(changed, share)
    (tmp_path / "machine.toml").write_text(write_machine(changed), encoding="utf-8")
    again = load_machine(tmp_path / "machine.toml")
    np.testing.assert_allclose(again.heat.table.heat["F1"], changed.heat.table.heat["F1"])
    before = case.spec.materials["cast_iron"].thermal_conductivity
    assert again.materials["cast_iron"].thermal_conductivity == pytest.approx(1.05 * before)


def test_modes_are_apart_and_without_a_mean():
    speed = np.linspace(0.0, 500.0, 61)
    modes = shape_modes(speed, 0.3)
    sizes = [size for size, _ in modes]
    assert 2 <= len(modes) <= 5
    assert sizes == sorted(sizes, reverse=True)
    shapes = np.array([shape for _, shape in modes])
    np.testing.assert_allclose(shapes.mean(axis=1), 0.0, atol=1e-12)
    products = shapes @ shapes.T
    np.testing.assert_allclose(products, np.diag(np.diag(products)), atol=1e-9)


def test_a_machine_off_in_a_direction_is_explained_by_it_and_calibration_remembers(case, predictor):
    one = Misdescription("F1", "", "", 0.1, "", SpeedShape(("F1",), *ALWAYS))
    clock = Misdescription("clock", "", "s", 30.0, "", clock_change, 0)
    true = predictor.predict(0, {"heat.F1": 1.3}).temperature
    at_stamps = np.array([np.interp(TIMES, predictor.drives[0].grid, column) for column in true.T]).T
    noise = np.random.default_rng(1).normal(0.0, 0.1, at_stamps.shape)
    seen = Predictor(case.fast, [written(case.folder, at_stamps - 273.15 + noise)])
    misfits = []
    for directions in ((), (one, clock)):
        described = with_misdescriptions(seen, directions)
        belief = calibrate(None, described).belief
        fit = Problem(described, belief, EXPECTED_SLOW, described.observations).fit()
        misfits.append(fit.misfit_with_prior)
    assert misfits[1] < misfits[0] - 10.0
    low, high = fit.interval(one.coordinate, 2.0)
    assert low < 0.3 < high
    assert high - low < 0.3
    # Calibration narrows it: the next recording begins from there; what concerns one recording only does not.
    after = calibrate(described, described).belief
    names = [c.name for c in after.coordinates]
    assert after.mean[names.index(one.coordinate)] == pytest.approx(3.0, abs=1.0)
    assert after.root[names.index(one.coordinate), names.index(one.coordinate)] > 1.5
    assert after.mean[names.index(clock.coordinate)] == 0.0


@pytest.fixture(scope="module")
def off_at(case, predictor):
    """Problem and fit with nothing missing of a machine whose bearing F1 heats by another factor."""

    def made(factor):
        one = Misdescription("F1", "heat.table", "", 0.02, "heat of F1", SpeedShape(("F1",), *ALWAYS))
        two = Misdescription("R1", "heat.table", "", 0.02, "heat of R1", SpeedShape(("R1",), *ALWAYS))
        true = predictor.predict(0, {"heat.F1": factor}).temperature
        at_stamps = np.array([np.interp(TIMES, predictor.drives[0].grid, column) for column in true.T]).T
        noise = np.random.default_rng(2).normal(0.0, 0.1, at_stamps.shape)
        seen = Predictor(case.fast, [written(case.folder, at_stamps - 273.15 + noise)])
        seen = with_misdescriptions(seen, (two, one))
        problem = Problem(seen, calibrate(None, seen).belief, EXPECTED_SLOW, seen.observations)
        return problem, problem.fit()

    return made


def test_a_definition_far_off_in_one_direction_is_found_there(off_at):
    problem, null = off_at(1.6)
    wrong = wrong_direction(Freed.of(problem, null, problem.predictor.misdescribed), problem, null, 100)
    assert wrong.direction.name == "F1"
    assert wrong.log_gain > 0.0
    # were it a sensor that differs, the definition would be right in it
    sensors = [replace(item, of_sensor=item.name == "F1") for item in problem.predictor.misdescribed]
    assert wrong_direction(Freed.of(problem, null, sensors), problem, null, 100).direction.name == "R1"
    refitted = Problem(problem.predictor, wrong.belief, EXPECTED_SLOW, problem.observations).fit()
    low, high = refitted.interval(wrong.direction.coordinate, 2.0)
    assert low < 0.6 < high
    assert refitted.misfit_with_prior < null.misfit_with_prior - 20.0
    # What was foreseen to first order and between bounds is what the wider prior then gives.
    assert wrong.log_gain == pytest.approx(counted(problem, null, refitted, wrong), rel=0.02)
    assert wrong.value == pytest.approx(refitted.values[wrong.direction.coordinate], abs=0.02)
    assert wrong.is_beyond_chance
    assert is_beyond_prior(wrong, GIVEN, refitted)
    nothing = Judgement("consistent", 0.5, Ranked(Hypothesis(refitted, 0.0), 1.0), (), 0.0, "")
    judged = with_wrong_definition(nothing, [wrong], GIVEN)
    assert judged.verdict == "parameter"
    assert "heat.table" in judged.reason
    assert judged.p_value < 0.01
    # beside physics that is missing
    physics = replace(nothing, verdict="missing_physics")
    assert with_wrong_definition(physics, [wrong], GIVEN) is physics
    lying = replace(nothing, verdict="sensor", reason="a sensor lies")
    beside = with_wrong_definition(lying, [wrong], GIVEN)
    assert (beside.verdict, beside.reason) == ("parameter", "a sensor lies")


def test_a_direction_is_suspected_where_it_explains_more_than_any_set(case, off_at):
    problem, null = off_at(1.6)
    directions, heat = problem.predictor.misdescribed, case.candidates["heat_scale", "F1"]
    nothing, other = Hypothesis(null, 0.0), Hypothesis(problem.fit((heat,)), -10.0)

    def suspected(*hypotheses):
        return suspected_direction(problem, hypotheses, directions, 100, 1.0, None)

    assert suspected(nothing).direction.name == "F1"
    # the same heat as an effect, unless that is unlikely beforehand
    assert suspected(nothing, replace(other, log_prior=20.0)) is None
    assert suspected(nothing, replace(other, log_prior=-100.0)).direction.name == "F1"
    # no number of a definition could be tried, by a calibration or beside effects
    machine = SimpleNamespace(spec=case.fast.spec, redefined=None)
    assert suspected_of_calibration(problem, null, directions, machine) is None
    beside = Hypothesis(problem.fit((case.candidates["sensor_offset", "SP05"],)), 0.0)
    unlikely = replace(nothing, log_prior=-1000.0)
    assert suspected(unlikely, beside) is None
    numbers = [replace(i, change=Number(FRONT[:1], *ALWAYS)) if i.name == "F1" else i for i in directions]
    for found in (
        suspected_of_calibration(problem, null, numbers, machine),
        suspected_direction(problem, [unlikely, beside], numbers, 100, 1.0, None),
    ):
        assert found.direction.name == "F1"
        assert found.value == pytest.approx(0.55, abs=0.1)
        assert found.is_beyond_chance


def test_numbers_that_explain_a_calibration_as_well_are_told_beside_the_likeliest(case, off_at):
    problem, null = off_at(1.6)
    machine = SimpleNamespace(spec=case.fast.spec, redefined=None, given=case.fast.spec)
    one, other = problem.predictor.misdescribed
    heat = Number(FRONT[:1], *ALWAYS)
    single, common = (replace(other, change=heat), replace(other, change=heat, stands_for=3))
    first = suspected_of_calibration(problem, null, (one, single, common), machine)
    assert first.direction is single
    assert [rival.direction for rival in first.rivals] == [common]
    assert "nearly as well explained by heat.table, " in wrong_definition_words([first], machine, null)
    # what is twenty times less likely is no rival
    many = replace(common, stands_for=30)
    assert suspected_of_calibration(problem, null, (one, single, many), machine).rivals == ()


@pytest.mark.parametrize(("factor", "told"), [(2.2, True), (1.25, False)])
def test_a_value_with_a_prior_is_suspected_where_its_interval_is_beyond_it(case, predictor, factor, told):
    """Heat that is known within a tenth: a quarter more is rare, not out of what the definition says."""
    true = predictor.predict(0, {"heat.front": factor}).temperature
    at_stamps = np.array([np.interp(TIMES, predictor.drives[0].grid, column) for column in true.T]).T
    noise = np.random.default_rng(3).normal(0.0, 0.1, at_stamps.shape)
    seen = Predictor(case.fast, [written(case.folder, at_stamps - 273.15 + noise)])
    problem = Problem(seen, calibrate(None, seen).belief, EXPECTED_SLOW, seen.observations)
    numbers = tuple(uncertain_numbers(case.fast.spec))
    found = number_beyond_prior(problem, problem.fit(), numbers)
    assert (found is not None) == told
    if told:
        assert found.direction.key == "bearing_set.front.heat_factor"
        assert found.value == pytest.approx(np.log(factor), abs=0.15)
        assert found.limit > PRIOR_SIGMAS  # of one number among many
        assert found.p_value < 0.01
    assert number_beyond_prior(problem, problem.fit(), ()) is None
    machine = SimpleNamespace(spec=case.fast.spec, is_network=False)
    notes = numbers_far_off(problem.fit(), machine, ())
    assert any("bearing_set.front.heat_factor" in note for note in notes) == told
    assert not told or numbers_far_off(problem.fit(), machine, [found]) == [
        note for note in notes if "front.heat_factor" not in note
    ]


class Number(SpeedShape):
    """A change of what a definition has as one number."""

    def quantity(self, spec):
        return Reported(1.0, "")

    def redefined(self, spec, value):
        return spec


def counted(problem, null, refitted, wrong, trials=100):
    """Gain of a wider prior as it counts, with what it pays beforehand, from both fits."""
    names = [c.name for c in problem.belief.coordinates]
    row = names.index(wrong.direction.coordinate)
    precision = problem.belief.root.T @ problem.belief.root
    count = len(names)
    left = (precision - precision @ null.covariance[:count, :count] @ precision)[row, row]
    chosen = np.log(tuned.NUMBER_PRIOR[1] / tuned.NUMBER_PRIOR[0])
    chosen -= np.log(len(problem.predictor.misdescribed) + trials)
    gain = 0.5 * (null.misfit_with_prior - refitted.misfit_with_prior) / tuned.GAIN_DIVISOR
    return gain - 0.5 * np.log1p(WIDER**2 * left) + chosen


def test_a_definition_within_its_prior_is_not_wrong(off_at):
    problem, null = off_at(1.02)
    wrong = wrong_direction(Freed.of(problem, null, problem.predictor.misdescribed), problem, null, 100)
    assert wrong.log_gain < 0.0
    assert not wrong.is_beyond_chance
    assert not is_beyond_prior(wrong, GIVEN, null)


def test_columns_go_where_the_predictor_goes(predictor):
    own = with_misdescriptions(predictor, misdescriptions_of(predictor))
    name = MISDESCRIBED_PREFIX + SHAPE
    expected = own.predict(0, {name: 0.1}).temperature
    for other in (pickle.loads(pickle.dumps(own)), own.with_model(own.fast), copy.copy(own)):
        np.testing.assert_array_equal(other.predict(0, {name: 0.1}).temperature, expected)
    assert np.abs(expected - own.predict(0, {}).temperature).max() > 0.1


def test_slopes_of_directions_are_those_of_a_prediction(off_at):
    problem, _ = off_at(0.5)
    coordinates = problem.belief.coordinates
    told = problem.straight(())
    scale = {c.name: c.sigma for c in coordinates}
    whole = problem.whitened(
        [item.sensitivity for item in problem.predict((), coordinates, problem.belief.mean)]
    )
    assert len(told) == len(problem.predictor.misdescribed) > 1
    for index, coordinate in enumerate(coordinates):
        if coordinate.name in told:
            own = scale[coordinate.name] * told[coordinate.name]
            np.testing.assert_allclose(own, whole[:, index], rtol=0.0, atol=1e-10 * np.abs(whole).max())
    # a sensor that answers late does so to directions too
    late = SimpleNamespace(reading=SimpleNamespace())
    assert problem.straight((late,)) == {}


def test_a_wrong_definition_is_told_with_key_value_and_interval(off_at):
    problem, null = off_at(1.6)
    directions = problem.predictor.misdescribed
    wrong = wrong_direction(Freed.of(problem, null, directions), problem, null, 100)
    fit = Problem(problem.predictor, wrong.belief, EXPECTED_SLOW, problem.observations).fit()
    nothing = Ranked(Hypothesis(fit, 0.0), 1.0)
    verdict = Judgement("parameter", 0.001, nothing, (), 0.0, "")
    content = misdescription_content(
        SimpleNamespace(
            predictor=problem.predictor,
            unchanged=problem.predictor,
            final=fit,
            stated_fit=fit,
            null=fit,
            judgement=verdict,
            wrong=(wrong,),
        ),
        GIVEN,
    )
    assert content["directions"] == len(directions)
    told = content["wrong"]
    assert told["key"] == content["measure"]["key"] == "heat.table"
    assert told["low"] < 0.6 < told["high"]
    # a number without a prior is where the model's other faults send it
    low, _ = fit.interval(wrong.direction.coordinate, NORMAL_90_PERCENT, fit.stated_sigmas)
    assert told["value"] - told["low"] == pytest.approx(tuned.WRONG_WIDENING * (told["value"] - low))
    assert told["largest_K"] > 1.0
    assert told["channel"] == "SP01"
    assert content["instead"] == []
    assert content["left_open"][0] == told
    whole = {
        "verdict": "parameter",
        "findings": [],
        "misdescription": content,
        "fit": {when: {"heldout_rmse_K": 0.1} for when in ("before", "after")} | {"noise_K": 0.1},
    }
    assert "Heat of F1: 0." in verdict_sentence(whole)
    whole |= {"alternatives": []}
    assert checks(whole) == ["Drawing, data sheet or machine: is heat.table as the definition has it?"]
    number = {"given": 22.0, "value": 47.5, "low": 42.0, "high": 53.9, "unit": "W/(m·K)"}
    by_key = whole | {"misdescription": content | {"wrong": told | {"defined": number}}}
    assert "off at heat.table: 47.5 W/(m·K) (42 to 53.9), where it says 22." in verdict_sentence(by_key)
    # a doubt about what is found beside it is said as well
    found = {"verdict": "sensor", "findings": [{"statement": "A sensor lies."}], "reason": "much is left"}
    sentence = verdict_sentence(by_key | found)
    assert "A sensor lies." in sentence
    assert "Much is left." in sentence
    assert "off at heat.table" in sentence
    table, text = misdescription_blocks(whole)
    assert "heat of F1" in table.rows[0]["cells"]
    assert "heat.table" in text.text
