"""Effects that a machine definition switches on: how they are written, refused and used."""

import tomllib
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.effect_entries import NO_EFFECTS, ActiveEffects, active_effects, require_known_effects
from spindle_fem.effects.base import Candidate, Reading
from spindle_fem.effects.term import TermParameter
from spindle_fem.errors import FaultsError
from spindle_fem.recordings.align import read_recording
from spindle_fem.simulate import simulate_recordings
from spindle_fem.spec.effects import EffectEntry
from spindle_fem.spec.load import find_machine, read_definition, validate, write_machine
from spindle_fem.spec.network import validate_network_machine, write_network_machine

NETWORK = """
schema = "spindle-fem/machine/1"
name = "small motor"
[[network.node]]
name = "winding"
capacity = {value = "180 J/K", sigma_rel = 0.5}
[[network.node]]
name = "body"
capacity = {value = "500 J/K", sigma_rel = 0.5}
[[network.boundary]]
name = "ambient"
temperature = "ambient"
[[network.link]]
between = ["winding", "body"]
conductance = {value = "2.3 W/K", sigma_rel = 0.5}
[[network.link]]
between = ["body", "ambient"]
conductance = {value = "0.5 W/K", sigma_rel = 0.5}
[[network.source]]
node = "winding"
input = "power"
gain = {value = "0.8 W/W", sigma_rel = 0.1}
"""

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
]
"""


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
    candidate = Candidate("x", "T", "", "sensor", "halved.gain", 1.0, 1.0, reading=Halved())
    effects = ActiveEffects((candidate,))
    times, rng = np.arange(5.0), np.random.default_rng(1)
    temperature, by = 300.0 + rng.normal(size=(5, 2)), rng.normal(size=(5, 2, 3))
    told, told_by = effects.read(("other", "T"), times, temperature, by, {"ambient": np.full(5, 290.0)})
    np.testing.assert_allclose(told[:, 0], temperature[:, 0])
    np.testing.assert_allclose(told[:, 1], 290.0 + 0.5 * (temperature[:, 1] - 290.0))
    np.testing.assert_allclose(told_by[:, 1], 0.5 * by[:, 1])
    np.testing.assert_allclose(told_by[:, 0], by[:, 0])


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
