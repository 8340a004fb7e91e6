"""Effects that a machine definition switches on: how they are written, refused and used."""

import tomllib
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.definition.effect_entries import EffectEntry
from spindle_fem.definition.load import find_machine, load_machine, read_definition, validate, write_machine
from spindle_fem.definition.network_load import validate_network_machine, write_network_machine
from spindle_fem.effects.framework.effect import Candidate, Reading
from spindle_fem.effects.framework.sensor import as_felt
from spindle_fem.effects.framework.term import TermParameter
from spindle_fem.errors import FaultsError
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.defined_effects import (
    NO_EFFECTS,
    ActiveEffects,
    active_effects,
    effects_on,
    require_known_effects,
)
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.recordings.align import read_recording
from spindle_fem.studies.simulate import simulate_recordings
from tests.support.lumped_spindle import lumped_model
from tests.support.written_texts import manifest_text, network_text

NETWORK = network_text(
    "small motor",
    {"winding": ("180 J/K", 0.5), "body": ("500 J/K", 0.5)},
    {"winding|body": ("2.3 W/K", 0.5), "body|ambient": ("0.5 W/K", 0.5)},
    [("winding", "power", ("0.8 W/W", 0.1))],
)

SOURCE = """
[[effect]]
effect = "unrecorded_heat_source"
component = "winding"
intervals = [["1000 s", "0.5 h"], ["3000 s", "4000 s"]]
[effect.parameters]
heat = "30 W"
lag = "20 s"
"""

LAG = """
[[effect]]
effect = "sensor_lag"
component = "body"
parameters = {time_constant = "200 s"}
"""

MANIFEST = manifest_text(
    "synthetic", {"T_winding": "winding", "T_body": "body"}, {"T_room": "ambient", "P": "power"}
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recording")
    times = np.arange(0.0, 6000.0, 10.0)
    frame = pd.DataFrame(
        {"time_s": times, "T_winding": 22.0 + times / 900.0, "T_body": 22.0 + times / 1500.0}
    )
    frame["T_room"], frame["P"] = 21.0, np.where(times < 2500.0, 60.0, 0.0)
    frame.to_csv(folder / "data.csv", index=False)
    (folder / "recording.toml").write_text(MANIFEST)
    return read_recording(folder)


def simulated(folder, recording, text):
    path = folder / "machine.toml"
    path.write_text(text)
    return simulate_recordings(path, recording)


def machine_with(*entries):
    content = read_definition(find_machine("recorded_spindle"))
    return {**content, "effect": list(entries)}


PRELOAD = {"effect": "thermal_preload", "component": "front_bearings", "parameters": {"exponent": 1.5}}
HEAT = {
    "effect": "unrecorded_heat_source",
    "component": "nose",
    "parameters": {"heat": "60 W"},
    "intervals": [["0 s", "1 h"], ["7200 s", "10000 s"]],
}


def test_a_machine_with_effects_writes_and_reads_the_same():
    spec = validate(machine_with(PRELOAD, HEAT))
    assert spec.effects[1].intervals == ((0.0, 3600.0), (7200.0, 10000.0))
    again = validate(tomllib.loads(write_machine(spec)))
    assert again == spec
    assert again.effects[1].values() == {"heat": "60 W"}


def test_a_network_with_effects_writes_and_reads_the_same():
    spec = validate_network_machine(tomllib.loads(NETWORK + SOURCE + LAG), "test")
    assert [entry.effect for entry in spec.effects] == ["unrecorded_heat_source", "sensor_lag"]
    assert validate_network_machine(tomllib.loads(write_network_machine(spec)), "again") == spec


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"intervals": [["1 h", "5 s"]]}, r"intervals\[1\]: runs from 3600 s to 5 s"),
        ({"intervals": [["1 h"]]}, r"intervals\[1\]: .* is no interval.*\"0 s\""),
        ({"intervals": [["1", "2 K"]]}, r"intervals\[1\]\[1\]: bare number \"1\""),
        ({"parameters": {"heat": [60]}}, r"parameters\.heat: \[60\] is no quantity"),
        ({"strength": 3}, r"effect\[1\]\.strength: unknown key"),
    ],
)
def test_entries_that_are_written_wrongly_are_refused(change, message):
    with pytest.raises(FaultsError, match=message):
        validate(machine_with({**HEAT, **change}))


def test_an_unknown_effect_is_refused_with_the_nearest_one():
    entries = [EffectEntry(effect=name, component="shaft") for name in ("windage", "windige", "raditation")]
    with pytest.raises(FaultsError) as caught:
        require_known_effects(entries)
    first, second = caught.value.faults
    assert first.where == "effect[2].effect"
    assert '"windige"' in first.what
    assert 'Did you mean "windage"' in first.how_to_fix
    assert second.where == "effect[3].effect"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('component = "winding"', 'component = "windin"', r'effect\[1\]\.component: "windin".*"winding"'),
        ('heat = "30 W"', 'heat = "30 K"', r'effect\[1\]\.parameters\.heat: "30 K".*units of W'),
        ('heat = "30 W"', "heat = 30", r'effect\[1\]\.parameters\.heat: bare number "30'),
        ('lag = "20 s"', 'lagg = "20 s"', r'"lagg" is unknown. Did you mean "lag"'),
        ('heat = "30 W"', "", r'"heat" is missing'),
    ],
)
def test_entries_that_the_catalogue_refuses(tmp_path, recording, old, new, message):
    with pytest.raises(FaultsError, match=message):
        simulated(tmp_path, recording, NETWORK + SOURCE.replace(old, new))


def test_an_entry_given_twice_is_refused(tmp_path, recording):
    with pytest.raises(FaultsError, match=r"effect\[2\]: unrecorded_heat_source @ winding is given twice"):
        simulated(tmp_path, recording, NETWORK + SOURCE + SOURCE)


def test_heat_of_an_effect_enters_the_simulation(tmp_path, recording):
    plain = simulated(tmp_path, recording, NETWORK)
    heated = simulated(tmp_path, recording, NETWORK + SOURCE)
    change = heated.predicted - plain.predicted
    assert np.abs(change[recording.times < 700.0]).max() < 1e-3
    on = (recording.times > 1600.0) & (recording.times < 1800.0)
    # 30 W over 2.3 W/K between winding and body, the body following slowly.
    assert change[on, 0].min() > 9.0
    assert np.all(change[on, 0] > change[on, 1])
    assert any("unrecorded_heat_source @ winding" in note for note in heated.notes)


def test_a_sensor_effect_changes_its_channel_alone(tmp_path, recording):
    plain = simulated(tmp_path, recording, NETWORK)
    lagging = simulated(tmp_path, recording, NETWORK + LAG)
    np.testing.assert_allclose(lagging.predicted[:, 0], plain.predicted[:, 0], atol=1e-9)
    told, truth = lagging.predicted[:, 1], plain.predicted[:, 1]
    slope = np.gradient(told, recording.times)
    middle = slice(20, -20)
    # 200 s dT/dt + T = truth
    np.testing.assert_allclose((told + 200.0 * slope)[middle], truth[middle], atol=0.05)
    assert np.abs(told - truth).max() > 0.5


class Halved(Reading):
    """A reading that any parameter can be differentiated through."""

    channel = "T"
    name = "halved"
    parameters = (TermParameter("gain", 0.5),)

    def read(self, times, values, inputs, parameters):
        return inputs["ambient"][:, None] + parameters["gain"] * (values - inputs["ambient"][:, None])


def test_readings_and_their_derivatives_go_through_the_sensor():
    times, rng = np.arange(5.0), np.random.default_rng(1)
    temperature, by = 300.0 + rng.normal(size=5), rng.normal(size=(5, 3))
    inputs = {"ambient": np.full(5, 290.0)}
    told, told_by, own = Halved().read_with_derivatives(times, temperature, by, inputs, {}, ("gain",))
    np.testing.assert_allclose(told, 290.0 + 0.5 * (temperature - 290.0))
    np.testing.assert_allclose(told_by, 0.5 * by)
    # To the logarithm of the gain.
    np.testing.assert_allclose(own[:, 0], 0.5 * (temperature - 290.0))
    told, _, own = Halved().read_with_derivatives(times, temperature, by[:, :0], inputs, {"gain": 2.0})
    np.testing.assert_allclose(told, 290.0 + 2.0 * (temperature - 290.0))
    assert own.shape == (5, 0)


def test_factors_of_effects_multiply_those_of_the_machine():
    candidates = [
        Candidate("x", "c", "", "parameter", name, 1.0, 1.0, factors=(TermParameter(name, value),))
        for name, value in (("heat.front", 1.2), ("joint.flange", 0.5))
    ]
    effects = ActiveEffects(tuple(candidates))
    assert effects.times_parameters({"heat.front": 1.5}) == {
        "heat.front": pytest.approx(1.8),
        "joint.flange": 0.5,
    }
    assert NO_EFFECTS.times_parameters({"a": 2.0}) == {"a": 2.0}
    assert active_effects((), SimpleNamespace()) == NO_EFFECTS


GAIN = 'effect = "sensor_gain"\nparameters = {gain = 0.5}'
OFFSET = 'effect = "sensor_offset"\nparameters = {offset = "1.5 K"}'
LATE = 'effect = "sensor_lag"\nparameters = {time_constant = "200 s"}'


@pytest.mark.parametrize("entries", [(GAIN,), (OFFSET,), (LATE,), (GAIN, OFFSET)])
def test_a_sensor_that_lies_begins_with_its_first_reading(tmp_path, recording, entries):
    """The node starts from what it must have felt."""
    effects = "".join(f'[[effect]]\ncomponent = "body"\n{entry}\n' for entry in entries)
    told = simulated(tmp_path, recording, NETWORK + effects)
    assert told.predicted[0] == pytest.approx(recording.temperature[0])


def test_a_sensor_that_reads_the_air_says_nothing_of_its_place(recording):
    air = Halved()
    air.channel, air.parameters = "T_body", (TermParameter("gain", 0.0),)
    told = as_felt(recording, [air], {"ambient": np.full(recording.times.size, 294.15)})
    assert set(told.first_readings()) == {"winding"}


IMPROVED = """
base = "recorded_spindle"
[[effect]]
effect = "sensor_lag"
component = "SP03"
parameters = {time_constant = "1500 s"}
[[effect]]
effect = "sensor_offset"
component = "SP05"
parameters = {offset = "1 K"}
[[effect]]
effect = "coolant_film"
component = "channel"
form = "transition"
parameters = {film_increase = 1.5, onset_reynolds = 900.0, width = 60.0}
[[effect]]
effect = "coolant_bypass"
component = "channel"
form = "outlet mixed"
parameters = {fraction = 0.2}
[[effect]]
effect = "chiller_cycling"
component = "channel"
parameters = {amplitude = "1.5 K", period = "5000 s", phase = "0.4 rad"}
[[effect]]
effect = "unrecorded_heat_source"
component = "nose"
intervals = [["300 s", "900 s"], ["7200 s", "10000 s"]]
parameters = {heat = "60 W", lag = "290 s", factor_1 = 1.1, factor_2 = 0.9}
[[effect]]
effect = "gap_closure"
component = "front_bearings"
form = "ring over housing"
parameters = {opening = 0.7, closing_difference = "9 K", width = "4 K", lag = "500 s"}
[[effect]]
effect = "starvation"
component = "front_bearings"
parameters = {friction_change = 0.5, onset_speed = "3600 rpm", width = "100 rpm"}
[[effect]]
effect = "sensor_detached"
component = "SP01"
parameters = {share_of_air = 0.4, time = "9000 s", time_in_air = "300 s"}
[[effect]]
effect = "ambient_drift"
component = "ambient"
form = "step"
parameters = {change = "2 K", time = "8000 s", width = "300 s"}
"""
SPINDLE_MANIFEST = """
schema = "spindle-fem/recording/1"
name = "half an hour"
data = "data.csv"
time = {column = "time_s", unit = "s"}
channel = [
{column = "T1", role = "temperature", probe = "SP01", unit = "degC", sigma = 0.1},
{column = "T3", role = "temperature", probe = "SP03", unit = "degC", sigma = 0.1},
{column = "room", role = "input", drives = "ambient", unit = "degC"},
{column = "n", role = "input", drives = "speed", unit = "rpm", hold = "previous"},
{column = "flow", role = "input", drives = "coolant_flow", unit = "L/min", hold = "previous"},
]
"""


def half_an_hour(folder, *, flow):
    """A recording that could not have shown most of the effects above, and lacks sensors of some."""
    times = np.arange(0.0, 1800.0, 20.0)
    frame = pd.DataFrame({"time_s": times, "T1": 20.0 + times / 900.0, "T3": 20.0 + times / 900.0})
    frame["room"], frame["n"], frame["flow"] = 20.0, 2000.0, flow
    frame.to_csv(folder / "data.csv", index=False)
    (folder / "recording.toml").write_text(SPINDLE_MANIFEST)
    return read_recording(folder)


@pytest.mark.parametrize("flow", [20.0, 0.0])
def test_a_machine_that_was_improved_on_one_recording_runs_on_a_shorter_one(tmp_path, flow):
    path = tmp_path / "improved_machine.toml"
    path.write_text(IMPROVED)
    spec = load_machine(path)
    fast = fast_spindle(lumped_model(spec), spec)
    recording = half_an_hour(tmp_path, flow=flow)
    effects = effects_on(spec.effects, fast, recording)
    assert [candidate.effect for candidate in effects.candidates] == [e.effect for e in spec.effects]
    if not flow:
        return  # a channel without flow has no film to simulate with
    nominal = Predictor(fast, [recording], at_stamps=True).predict(0, {}).temperature
    improved = Predictor(fast, [recording], effects=effects, at_stamps=True).predict(0, {}).temperature
    assert np.isfinite(improved).all()
    assert np.abs(improved - nominal).max() > 0.2
    # A lag of 1500 s lets little of the first 20 s through.
    assert np.ptp(improved[:2, 1]) < 0.1 * np.ptp(nominal[:2, 1])


def test_the_physical_limits_of_an_entry_hold_on_every_recording(tmp_path):
    spec = load_machine("recorded_spindle")
    fast = fast_spindle(lumped_model(spec), spec)
    recording = half_an_hour(tmp_path, flow=20.0)
    entries = [
        EffectEntry(effect="coolant_bypass", component="channel", parameters={"fraction": 1.4}),
        EffectEntry(effect="sensor_lag", component="SP01", parameters={"time_constant": "-5 s"}),
        EffectEntry(effect="sensor_lag", component="SP09", parameters={"time_constant": "5 s"}),
        EffectEntry(
            effect="chiller_cycling", component="channel", parameters={"amplitude": "1 K", "sharpness": 1.2}
        ),
    ]
    with pytest.raises(FaultsError) as caught:
        effects_on(entries, fast, recording)
    messages = [str(fault) for fault in caught.value.faults]
    assert "effect[1].parameters.fraction: is 1.4. Allowed: 0 to 0.95." in messages
    assert "effect[2].parameters.time_constant: is -5 s. Allowed: 0 or more s." in messages
    assert any('effect[3].component: "SP09" cannot have sensor_lag' in text for text in messages)
    assert "effect[4].parameters.sharpness: is 1.2. Allowed: -0.97 to 0.97." in messages
