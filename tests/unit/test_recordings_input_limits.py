"""Recorded inputs beside what a machine can do: refused, said, or taken."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import FaultsError, RecordingError
from spindle_fem.machine.view.defined_point import at_the_defined_point
from spindle_fem.recordings.input_limits import require_possible_inputs

RPM = np.pi / 30.0


@pytest.fixture(scope="module")
def spec():
    return load_machine("recorded_spindle")


def recorded(spec, **inputs):
    """A day at the defined point, with other readings of some inputs."""
    recording = at_the_defined_point(spec)
    values = recording.inputs.copy()
    for name, value in inputs.items():
        values[-1, recording.input_names.index(name)] = value
    return replace(recording, inputs=values)


def test_the_defined_point_is_possible(spec):
    assert require_possible_inputs(spec, recorded(spec)) == ()


def test_a_speed_that_no_rolling_bearing_reaches_is_refused(spec):
    with pytest.raises(
        RecordingError, match=r"reaches 100000 rpm\. No rolling bearing of .* is the unit right"
    ):
        require_possible_inputs(spec, recorded(spec, speed=-1e5 * RPM))


def test_a_speed_beyond_the_heat_table_is_said(spec):
    (said,) = require_possible_inputs(spec, recorded(spec, speed=9000.0 * RPM))
    assert said.startswith("speed reaches 9000 rpm, the heat table ends at")


def test_coolant_that_stands_is_refused_with_its_first_row(spec):
    with pytest.raises(
        RecordingError, match=r'"coolant_flow".* falls to 0 l/min; 1 of \d+ rows .*0\.1 L/min'
    ):
        require_possible_inputs(spec, recorded(spec, coolant_flow=0.0))
    # without a channel no coolant flows anyway
    assert require_possible_inputs(load_machine("groove_spindle"), recorded(spec, coolant_flow=0.0))


@pytest.mark.parametrize(("name", "what"), [("ambient", "usual"), ("coolant_inlet", "range of")])
def test_temperatures_beyond_what_is_known_are_said(spec, name, what):
    (said,) = require_possible_inputs(spec, recorded(spec, **{name: 640.0}))
    assert said.startswith(f"{name} runs from")
    assert what in said


def test_every_input_that_cannot_be_is_told_at_once(spec):
    recording = recorded(spec, coolant_flow=-1e-4)
    names = tuple({"speed": "spindle", "thrust": "force"}.get(name, name) for name in recording.input_names)
    with pytest.raises(FaultsError) as caught:
        require_possible_inputs(spec, replace(recording, input_names=names))
    told = str(caught.value)
    assert len(caught.value.faults) == 4
    for text in ('drives "spindle"', 'drives "force"', "no channel drives the speed", "falls to -6 l/min"):
        assert text in told


def test_unknown_probes_are_told_beside_unknown_inputs(spec):
    sound = recorded(spec)
    names = ("ambiente", *sound.input_names[1:])
    faulty = replace(sound, input_names=names, probes=("FORNT", *sound.probes[1:]))
    with pytest.raises(FaultsError, match=r'drives "ambiente".*\n.*\n.*reads "FORNT"'):
        require_possible_inputs(spec, faulty)


def test_the_inlet_of_a_stream_is_an_input_and_that_of_no_channel_is_said(tmp_path):
    page = tmp_path / "cooled.toml"
    page.write_text(
        'schema = "spindle-fem/machine/1"\nbase = "groove_spindle"\nname = "cooled"\n'
        '[[film]]\nkind = "circuit"\nname = "bore"\npart = "shaft"\ndiameter = "20 mm"\n'
        'z = ["0 mm", "100 mm"]\nfluid = "water"\n'
        'inlet_temperature = "20 degC"\nflow = "1 L/min"\n'
    )
    spec = load_machine(page)
    recording = recorded(spec)
    assert require_possible_inputs(spec, recording) == ()
    column = recording.input_names.index("coolant_inlet")

    def named(name, unit="kelvin"):
        names, units = list(recording.input_names), list(recording.input_units)
        names[column], units[column] = name, unit
        values = recording.inputs.copy()
        values[-1, column] += 5.0
        return replace(recording, input_names=tuple(names), input_units=tuple(units), inputs=values)

    assert require_possible_inputs(spec, named("inlet.bore")) == ()
    (said,) = require_possible_inputs(spec, named("coolant_inlet"))
    assert said.endswith("this machine does not have; inlet.bore is the inlet temperature of a stream")
    with pytest.raises(RecordingError, match=r'"inlet\.bore" is in watt\. Allowed: a temperature'):
        require_possible_inputs(spec, named("inlet.bore", "watt"))
    with pytest.raises(RecordingError, match=r'drives "inlet\.bor".*inlet\.bore'):
        require_possible_inputs(spec, named("inlet.bor"))
