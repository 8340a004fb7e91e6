"""What sensors and a test would tell apart, on machines where it can be said by hand."""

import json

import numpy as np
import pandas as pd
import pytest

from spindle_fem.commands.diagnose_command import diagnose_without_report
from spindle_fem.commands.plan_command import _as_recorded, _of_recording, plan, planned_measurement
from spindle_fem.definition.load import load_machine
from spindle_fem.effects.framework.interval_effect import in_intervals
from spindle_fem.effects.registry import effect_of
from spindle_fem.errors import BadInputError, FaultsError, SpecError
from spindle_fem.inference import measurement_plan, misdescription_columns, opened_machine
from spindle_fem.inference.heat_misdescriptions import heat_misdescriptions
from spindle_fem.inference.heldout import heldout_stamps
from spindle_fem.inference.planned_test import base_name, conditions_of
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import expected_slow_error
from spindle_fem.inference.told_apart import (
    POWER,
    ChannelProducts,
    EffectForms,
    bits,
    misfit_seen,
    misfit_told,
)
from spindle_fem.machine.view.defined_point import defined_recording
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from tests.support.flawed_network import MACHINE, record
from tests.support.lumped_spindle import lumped_model
from tests.support.written_texts import network_text


def machine_text(between):
    nodes = {"a": "2000 J/K", "b": "2000 J/K"}
    links = {"a|b": between, "a|ambient": "2 W/K", "b|ambient": "2 W/K"}
    sources, rooms = [("a", "power", "1 W/W")], {"ambient": "20 degC"}
    return network_text("two bodies", nodes, links, sources, rooms, initial="ambient")


@pytest.fixture
def machine(tmp_path):
    def write(between="1 W/K"):
        path = tmp_path / "machine.toml"
        path.write_text(machine_text(between), encoding="utf-8")
        return path

    return write


def planned(path, *sensors):
    return planned_measurement(path, test="heat_up:2h", sensors=sensors, inputs=["power=40 W"])


def told_from(found, first, second):
    items = [(item.effect, item.component) for item in found.plan.hypotheticals]
    return float(found.plan.separation.told_from[items.index(first), items.index(second)])


INSTANTS = {"time", "start", "middle"}
HEAT_AT_A, HEAT_AT_B = ("unrecorded_heat_source", "a"), ("unrecorded_heat_source", "b")


def test_heat_at_two_bodies_that_are_one_is_told_apart_by_no_sensor(machine):
    found = planned(machine("1e6 W/K"), "a=0.01K", "b=0.01K")
    assert told_from(found, HEAT_AT_B, HEAT_AT_A) > 5.0


def test_heat_at_two_bodies_is_told_apart_once_each_is_read(machine):
    path = machine()
    one, both = planned(path, "a=0.05K"), planned(path, "a=0.05K", "b=0.05K")
    assert told_from(both, HEAT_AT_B, HEAT_AT_A) < 1.0 < told_from(one, HEAT_AT_B, HEAT_AT_A)
    assert one.plan.sensors_in_turn[0].name == "b"
    assert one.plan.sensors_in_turn[0].information == pytest.approx(both.plan.asked.information, rel=0.1)


def test_intervals_and_instants_lie_within_each_test_that_is_compared(machine, monkeypatch):
    sizes, begun, products = [], [], measurement_plan._products

    def kept(problem, number, variants, *further):
        found = products(problem, number, variants, *further)
        own = [(i, item.candidate) for i, item in enumerate(variants) if item.key == HEAT_AT_A]
        timed = [i for i, candidate in own if in_intervals(effect_of(candidate.effect), candidate)]
        seen = np.einsum("cii->i", found.effects)
        sizes.append(seen[timed])
        drifts = [i for i, item in enumerate(variants) if item.key[0] in ("sensor_drift", "ambient_drift")]
        laws = [i for i in drifts if INSTANTS & {name.rpartition(".")[2] for name in variants[i].shape}]
        begun.append(seen[laws])
        return found

    monkeypatch.setattr(measurement_plan, "_products", kept)
    planned_measurement(machine(), test="heat_up:24h", inputs=["power=40 W"])
    # The asked test of 24 h, then those of 8 h, in which heat after their end would move nothing.
    assert np.shape(sizes) == (5, len(measurement_plan.INTERVALS))
    assert np.min(sizes) > 100.0
    # Laws of a sensor and of the room that begin or come at an instant likewise.
    assert np.shape(begun) == (5, 2 * 4 + 17)
    assert np.min(begun) > 0.5


def test_offset_of_a_sensor_is_seen_from_the_size_that_noise_leaves(machine):
    found = planned(machine(), "a=0.05K")
    recording = found.plan.machine.recordings[0]
    used = [~heldout_stamps(item)[0] for item in found.plan.machine.recordings]
    slow = expected_slow_error(Predictor(found.plan.machine.fast, found.plan.machine.recordings, used))
    times = recording.times[used[0]]
    apart = np.abs(times[:, None] - times)
    noise = slow.sigma**2 * np.exp(-apart / slow.time) + 0.05**2 * np.eye(len(times))
    # Nothing of this machine is uncertain: an offset of 1 K against noise alone.
    misfit = float(np.linalg.solve(noise, np.ones(len(times))).sum())
    items = found.plan.hypotheticals
    index = next(i for i, item in enumerate(items) if item.effect == "sensor_offset")
    name, value, unit = items[index].size(float(found.plan.separation.seen_from[index]))
    assert (name, unit) == ("offset", "K")
    assert value == pytest.approx(np.sqrt(misfit_seen(1, len(items)) / misfit), rel=1e-3)


@pytest.fixture(scope="module")
def spindles():
    """Plans of the lumped reference spindle read by one probe: as it is, and as if it were as defined."""
    spec = load_machine("recorded_spindle")
    fast = fast_spindle(lumped_model(spec), spec)
    asked = {"test": "cool_down:1h", "sensors": ["SP01"], "compare": False}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(opened_machine, "fast_model_for", lambda *_, **__: fast)
        # Directions of the structure need the machine's mesh.
        patch.setattr(misdescription_columns, "PROVIDERS", (heat_misdescriptions,))
        found = [planned_measurement("recorded_spindle", **asked).plan]
        patch.setattr(measurement_plan, "misdescriptions_of", lambda predictor: ())
        patch.setattr(measurement_plan, "_places", lambda *_: ())
        return (*found, planned_measurement("recorded_spindle", **asked).plan)


def test_one_more_sensor_never_tells_less(spindles):
    plan, _ = spindles
    names = [item.name for item in plan.further_sensors]
    assert {"SP02", "SP03", "SP04", "SP05"} <= set(names)
    assert "SP01" not in names
    gained = [item.information for item in plan.further_sensors]
    assert min(gained) >= plan.asked.information - 1e-9
    assert gained == sorted(gained, reverse=True)
    in_turn = [item.information for item in plan.sensors_in_turn]
    assert in_turn == sorted(in_turn)


def test_directions_in_which_the_machine_may_differ_take_their_part(spindles):
    plan, as_defined = spindles
    assert plan.asked.information < as_defined.asked.information
    assert as_defined.further_sensors == ()


def test_size_of_a_swing_is_its_amplitude(spindles):
    [cycling] = [item for item in spindles[0].hypotheticals if item.effect == "chiller_cycling"]
    name, value, unit = cycling.size(0.5)
    assert (name, unit) == ("amplitude", "K")
    assert value == pytest.approx(0.5 * cycling.size(1.0)[1])


def forms(owner, one_sided=False):
    owner = np.array(owner)
    count = len(owner)
    return EffectForms(
        owner,
        owner,
        np.ones(count, dtype=int),
        np.full(count, 1e6),
        np.full(count, one_sided),
        np.ones(count),
    )


def test_what_the_machine_takes_up_counts_only_as_far_as_it_is_unknown():
    answers = np.ones((4, 1))
    products = ChannelProducts.of(np.array([[1.0]]), [answers], [answers])
    # A coordinate with a prior of 1 that answers alike: 4 - 4 / (1 + 4) * 4.
    assert products.gram([0])[0, 0] == pytest.approx(4.0 / 5.0)


def test_an_effect_stands_for_another_by_the_angle_between_them():
    angle = 0.3
    columns = 10.0 * np.array([[1.0, np.cos(angle)], [0.0, np.sin(angle)]])
    _, between = forms([0, 1]).distances(columns.T @ columns)
    assert between[0, 1] == pytest.approx((10.0 * np.sin(angle)) ** 2, rel=1e-6)
    assert between[0, 0] == pytest.approx(0.0, abs=1e-6)


def test_heat_that_cannot_be_negative_stands_for_no_loss():
    columns = 10.0 * np.array([[1.0, -1.0]])
    _, between = forms([0, 1], one_sided=True).distances(columns.T @ columns)
    assert between[0, 1] == pytest.approx(100.0)


def test_a_mixture_of_shapes_takes_up_what_no_shape_does_alone():
    early, late, whole = np.eye(2)[0], np.eye(2)[1], np.ones(2)
    columns = 10.0 * np.column_stack((whole, early, late))
    several = forms([0, 1, 1])
    _, between = several.distances(columns.T @ columns)
    assert between[0, 1] == pytest.approx(0.0, abs=1e-6)
    assert between[1, 0] == pytest.approx(50.0)


def test_stated_size_is_seen_as_often_as_promised():
    generator = np.random.default_rng(3)
    misfit = misfit_seen(1, 1)
    # One direction of one effect: the likelihood ratio against what chance reaches once in a hundred.
    gains = (np.sqrt(misfit) + generator.standard_normal(200_000)) ** 2
    chance = np.quantile(generator.standard_normal(200_000) ** 2, 0.99)
    assert np.mean(gains > chance) > POWER
    told = misfit_told()
    ratio = told + 2.0 * np.sqrt(told) * generator.standard_normal(200_000)
    assert np.mean(ratio > 14.0) == pytest.approx(POWER, abs=0.005)


def test_information_is_that_of_two_normal_hypotheses():
    generator = np.random.default_rng(5)
    for squared in (0.3, 2.0, 9.0):
        ratio = 0.5 * squared + np.sqrt(squared) * generator.standard_normal(400_000)
        expected = 1.0 - np.mean(np.log2(1.0 + np.exp(-ratio)))
        assert float(bits(np.array(squared))) == pytest.approx(expected, abs=3e-3)


def test_plan_of_a_network_is_written_and_readable(machine, tmp_path):
    content = plan(machine(), tmp_path / "out", test="steps:1h", sensors=["a"], inputs=["power=40 W"])
    written = json.loads((tmp_path / "out" / "plan.json").read_text(encoding="utf-8"))
    assert written["schema"] == "spindle-fem/plan/1"
    assert {"sensors", "test", "pairs", "detectable", "best_next_sensor", "best_test"} <= set(written)
    assert written["best_next_sensor"]["name"] == "b"
    assert set(written["pairs"][0]) >= {"first", "second", "told_apart", "information_bit", "from_size"}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert content["summary"][0].split(",")[0] in page
    assert not (tmp_path / "out" / "INCOMPLETE").exists()


def test_inputs_of_unknown_size_warm_the_hottest_node_by_thirty_kelvin(machine):
    found = conditions_of(str(machine()), (), {}, recorded=False)
    # Power at a, which has 2 W/K to the room and 1 W/K to b with 2 W/K to the room: 2 + 2/3 W/K.
    assert found.assumed == ("power",)
    assert found.usual["power"] == pytest.approx(30.0 * (2.0 + 2.0 / 3.0))
    assert found.units["power"] == base_name("W")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"sensors": ["c"]}, '"c" is no sensor of this machine'),
        ({"sensors": ["a=0.1"]}, "bare number"),
        ({"sensors": ["a=-0.1 K"]}, "above 0 K"),
        ({"inputs": ["power=40"]}, "power"),
        ({"inputs": ["speed=40 W"]}, "not an input of this machine"),
        ({"test": "soak"}, "heat_up, steps, cool_down"),
        ({"test": "steps:4"}, "bare number"),
    ],
)
def test_bad_input_is_refused_with_what_is_allowed(machine, tmp_path, options, words):
    asked = {"inputs": ["power=40 W"], "test": "steps:1h"} | options
    with pytest.raises(BadInputError) as caught:
        plan(machine(), tmp_path / "out", **asked)
    assert caught.value.exit_status == 2
    assert words in str(caught.value)


@pytest.fixture
def drive(tmp_path):
    """A network, and what writes a recording of it without one of its columns."""
    path = tmp_path / "drive.toml"
    path.write_text(MACHINE, encoding="utf-8")

    def recorded_without(column, warmer=0.0, times=None):
        run = record(tmp_path / "run", 3, times=times)
        columns = pd.read_csv(run / "data.csv")
        columns[["Tw", "Tl", "Tb", "room"]] += warmer
        columns.drop(columns=column).to_csv(run / "data.csv", index=False)
        lines = (run / "recording.toml").read_text(encoding="utf-8").splitlines()
        kept = [line for line in lines if f'column = "{column}"' not in line]
        (run / "recording.toml").write_text("\n".join(kept), encoding="utf-8")
        return run

    return path, recorded_without


def test_a_recording_without_an_input_is_refused_as_a_diagnosis_refuses_it(drive, tmp_path):
    path, recorded_without = drive
    run = recorded_without("P")
    with pytest.raises(FaultsError, match='no channel drives "power"') as caught:
        planned_measurement(path, test=run)
    with pytest.raises(FaultsError) as of_diagnosis:
        diagnose_without_report(path, [run], tmp_path / "out")
    assert str(caught.value) == str(of_diagnosis.value)


def test_one_text_gives_the_noise_of_all_and_a_sensor_that_a_recording_does_not_read(drive):
    path, recorded_without = drive
    found = planned_measurement(
        path, test=recorded_without("Tb"), sensors=["all=0.2K,body"], compare=False
    ).sensors
    assert [(item.probe, item.noise) for item in found] == [("body", 0.2)]


def test_tests_beside_a_recording_begin_at_the_temperature_of_its_room(drive):
    path, recorded_without = drive
    found = planned_measurement(path, test=recorded_without("Tb", warmer=15.0))
    asked, *others = found.plan.machine.recordings
    room = asked.input_at("ambient", asked.times).mean()
    assert room > 306.0
    for item in others:
        assert item.temperature[0] == pytest.approx(room, abs=1e-6)


def test_a_sensor_that_a_recording_does_not_read_leaves_what_the_others_would_read(drive):
    path, recorded_without = drive
    # From amid a run, when the body is cooler than what is read.
    run = recorded_without("Tb", warmer=15.0, times=np.arange(4440.0, 14401.0, 60.0))
    few, more = (
        planned_measurement(path, test=run, sensors=sensors, compare=False).plan.machine.recordings[0]
        for sensors in (["winding,bearing"], ["winding,bearing,body"])
    )
    assert more.probes[2] == "body"
    assert few.temperature[0].min() - more.temperature[0, 2] > 1.0
    np.testing.assert_allclose(more.temperature[:, :2], few.temperature, atol=1e-3)


def test_unread_probes_of_a_spindle_begin_with_those_that_a_recording_reads():
    units = {"ambient": "kelvin"}
    read = defined_recording("warm", ("SP01",), 313.15, {"ambient": (309.0, 309.0)}, units)
    conditions = _as_recorded(conditions_of("recorded_spindle", (), {}, recorded=True), read)
    asked, _ = _of_recording(read, ["SP01,SP05"], conditions)
    assert asked.first_readings() == {"SP01": 313.15, "SP05": 313.15}
    assert conditions.start == 309.0


def test_a_test_of_a_machine_without_a_channel_has_no_coolant() -> None:
    assert set(conditions_of("groove_spindle", (), {}, recorded=False).usual) == {
        "speed",
        "thrust",
        "ambient",
    }
    with pytest.raises(SpecError, match="coolant_inlet"):
        conditions_of("groove_spindle", (), {"coolant_inlet": (293.15, "kelvin")}, recorded=False)
