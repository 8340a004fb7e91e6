"""Displacement sensors in a planned test: which are read, with what noise, and what they tell."""

from __future__ import annotations

import json

import pytest

from spindle_fem.commands.plan_command import planned_measurement
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import SpindleFemError
from spindle_fem.inference import misdescription_columns, opened_machine
from spindle_fem.inference.diagnosis_content import plain_data
from spindle_fem.inference.growth_misdescriptions import growth_misdescriptions
from spindle_fem.inference.heat_misdescriptions import heat_misdescriptions
from spindle_fem.inference.plan_content import plan_content
from spindle_fem.report.plan_charts import sensor_places
from spindle_fem.report.plan_report import write_plan_report
from tests.support.nose_spindle import nose_machine, nose_recording

TEXT = """schema = "spindle-fem/machine/1"
base = "recorded_spindle"
name = "nose"
[[displacement_sensor]]
name = "S1"
at = "shaft.nose_end"
direction = "axial"
mount = "flange"
"""
SHORT = {"test": "heat_up:1h", "compare": False}


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    path = tmp_path_factory.mktemp("planned") / "machine.toml"
    path.write_text(TEXT, encoding="utf-8")
    fast = nose_machine()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(opened_machine, "fast_model_for", lambda *_, **__: fast)
        patch.setattr(misdescription_columns, "PROVIDERS", (heat_misdescriptions, growth_misdescriptions))
        yield path


@pytest.fixture(scope="module")
def plans(machine):
    """Read by one probe, and by the displacement sensor beside it."""
    return tuple(
        planned_measurement(machine, sensors=names, **SHORT) for names in (["SP01"], ["SP01,S1=0.2um"])
    )


def test_a_displacement_beside_a_temperature_tells_more(plans):
    one, both = (item.plan for item in plans)
    assert both.asked.information > one.asked.information + 0.01
    assert both.asked.seen > one.asked.seen
    # Heat in the shaft, which no probe sees at once.
    seen = [
        float(item.separation.seen_from[names.index(("windage", "shaft"))])
        for item in (one, both)
        for names in [[(own.effect, own.component) for own in item.hypotheticals]]
    ]
    assert seen[1] < 0.7 * seen[0]


def test_one_that_is_not_read_is_among_the_sensors_to_add(machine, plans):
    """It gains nearly what a plan that reads it finds: expansion is in doubt for each by itself."""
    one, both = (item.plan for item in plans)
    (added,) = (item for item in one.further_sensors if item.name == "S1")
    assert added.words == "displacement sensor S1 of the definition"
    assert not [item for item in both.further_sensors if item.name == "S1"]
    gained, found = (item.information - one.asked.information for item in (added, both.asked))
    assert 0.9 * found < gained < found
    planned = plans[0]
    content = plan_content(
        one, planned.sensors, planned.test, planned.inputs, planned.compared, planned.notes
    )
    content["best_next_sensor"]["name"] = "S1"
    figure = sensor_places(content, load_machine(machine))
    assert "S1, reads a displacement and is not drawn" in str([text.get_text() for text in figure.texts])


def test_its_noise_is_a_length(machine, plans):
    recording = plans[1].plan.machine.recordings[0]
    assert recording.temperature_names == ("SP01", "S1")
    assert recording.sigma == pytest.approx([0.1, 0.2])
    for text, said in (("SP01,S1=0.2K", "S1"), ("SP01,S1=0um", "above 0 m"), ("S1", "read no temperature")):
        with pytest.raises(SpindleFemError, match=said):
            planned_measurement(machine, sensors=[text], **SHORT)


def test_every_sensor_of_the_definition_is_read_unless_some_are_asked_for(machine):
    found = planned_measurement(machine, sensors=["all=0.3K"], **SHORT)
    noise = {item.name: item.noise for item in found.sensors}
    assert noise.pop("S1") == 0.3e-6
    assert set(noise.values()) == {0.3}


@pytest.mark.slow
def test_those_of_a_recording_are_read_with_their_noise(machine, tmp_path):
    names = ("SP01", "SP05", "S1")
    nose_recording(tmp_path, dict.fromkeys(names, 20.0))
    found = planned_measurement(machine, test=tmp_path, compare=False)
    assert [(item.name, item.displaced) for item in found.sensors] == [(n, n == "S1") for n in names]
    assert found.sensors[-1].noise == pytest.approx(0.1e-6)


def test_the_plan_states_its_noise_in_micrometres(plans, tmp_path):
    _, both = plans
    content = plan_content(both.plan, both.sensors, both.test, both.inputs, both.compared, both.notes)
    assert content["sensors"][-1] == {"name": "S1", "probe": "S1", "noise_um": pytest.approx(0.2)}
    (tmp_path / "plan.json").write_text(json.dumps(plain_data(content)), encoding="utf-8")
    assert "0.200 µm" in write_plan_report(tmp_path).read_text(encoding="utf-8")
