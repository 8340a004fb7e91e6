"""`check` on written networks and on the effects that definitions switch on."""

import json

import pytest

from spindle_fem.commands.machine_commands import check_machine
from spindle_fem.definition.load import find_machine
from spindle_fem.errors import FaultsError

BROKEN_NETWORK = """
schema = "spindle-fem/machine/1"
name = "broken"
initial = "sometimes"
[[network.node]]
name = "winding"
capacity = "0 J/K"
[[network.node]]
name = "body"
capacity = "500 J/K"
[[network.boundary]]
name = "ambient"
temperature = "ambient"
[[network.link]]
between = ["winding", "boddy"]
conductance = "2.3 W/K"
[[network.link]]
between = ["body", "ambient"]
conductance = "0.5 W/K"
[[effect]]
effect = "windige"
component = "body"
[[effect]]
effect = "unrecorded_heat_source"
component = "body"
intervals = [["1", "2 s"]]
"""

WINDAGE = """
[[effect]]
effect = "windage"
component = "{component}"
form = "{form}"
parameters = {{heat_at_4500rpm = "{heat}"}}
"""


def faults_of(machine, *overrides):
    with pytest.raises(FaultsError) as caught:
        check_machine(machine, overrides=overrides)
    assert caught.value.exit_status == 2
    return [str(fault) for fault in caught.value.faults]


@pytest.mark.parametrize(("machine", "node"), [("bench_motor", "winding"), ("turning_centre", "headstock")])
def test_written_networks_that_ship_are_valid(command, machine, node):
    process = command("check", machine)
    assert process.returncode == 0, process.stderr
    assert "is valid" in process.stdout
    assert node in process.stdout


def test_a_network_is_told_by_its_nodes_boundaries_links_and_sources():
    content = check_machine("turning_centre", overrides=["network.node.headstock.capacity=100 kJ/K"])
    assert {"name": "headstock", "detail": "100000 J/K"} in content["nodes"]
    assert [row["name"] for row in content["boundaries"]] == ["room"]
    assert "headstock|room" in {row["name"] for row in content["links"]}
    assert "main_spindle.main_speed" in {row["name"] for row in content["sources"]}
    assert json.dumps(content)


def test_all_faults_of_a_network_and_its_effects_come_at_once(command, tmp_path):
    path = tmp_path / "broken.toml"
    path.write_text(BROKEN_NETWORK)
    process = command("check", path, "--set", "network.node.body.capacityy=1 J/K")
    assert process.returncode == 2
    for text in (
        "capacityy",
        'initial: "sometimes" is not allowed',
        'network.node[1].capacity: "winding" has 0 J/K',
        '"boddy" is neither a node nor a boundary. Did you mean "body"?',
        'effect[1].effect: "windige" is not in the catalogue. Did you mean "windage"?',
        'effect[2].intervals[1][1]: bare number "1"',
    ):
        assert text in process.stderr, text
    assert "Traceback" not in process.stderr


@pytest.fixture
def written(tmp_path):
    """A definition of ours, and effects, in a file."""

    def write(machine, effects):
        path = tmp_path / "machine.toml"
        path.write_text(find_machine(machine).read_text(encoding="utf-8") + effects, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(("component", "form"), [
    ("main_spindle", "milling_speed"),  # one of several speeds of a recording
    ("headstock", ""),  # the only speed of one
    ("milling_spindle", "tool_speed"),  # one that only a recording knows
])  # fmt: skip
def test_effects_that_follow_a_speed_pass_where_a_recording_could_have_it(written, component, form):
    text = WINDAGE.format(component=component, form=form, heat="20 W")
    assert check_machine(written("turning_centre", text))["effects"][0]["name"] == "windage"


def test_effects_of_a_network_are_checked_without_a_recording(written):
    text = WINDAGE.format(component="spindle", form="", heat="20 W")
    text += WINDAGE.format(component="headstock", form="", heat="20 K")
    text += '[[effect]]\neffect = "sensor_lag"\ncomponent = "headstok"\nparameters = {time_constant = "9s"}\n'
    text += '[[effect]]\neffect = "coolant_film"\ncomponent = "channel"\nparameters = {factor = 0.7}\n'
    place, unit, sensor, channel = faults_of(written("turning_centre", text))
    assert 'effect[1].component: "spindle" cannot have windage.' in place
    assert 'effect[2].parameters.heat_at_4500rpm: "20 K"' in unit
    assert 'effect[3].component: "headstok" cannot have sensor_lag. Did you mean "headstock"' in sensor
    assert 'effect[4].component: "channel" cannot have coolant_film.' in channel


SPINDLE = """
base = "{base}"
[[effect]]
effect = "windige"
component = "shaft"
[[effect]]
effect = "unrecorded_heat_source"
component = "nose"
intervals = [["1", "2 s"]]
parameters = {{heat = "20 W"}}
[[effect]]
effect = "unrecorded_heat_source"
component = "nose"
intervals = [["1 s", "2 s"]]
parameters = {{heat = "20 K"}}
[[effect]]
effect = "radiation"
component = "rear_flange"
parameters = {{radiative_share = 0.3}}
[[effect]]
effect = "coolant_film"
component = "channel"
form = "transitional"
parameters = {{film_increase = 2}}
[[effect]]
effect = "chiller_cycling"
component = "channel"
parameters = {{period = "900 s"}}
"""


@pytest.mark.parametrize("base", ["recorded_spindle", "wu_tan_2016"])
def test_effects_of_a_machine_with_geometry_are_checked_without_mesh_or_recording(tmp_path, base):
    path = tmp_path / "machine.toml"
    path.write_text(SPINDLE.format(base=base))
    faults = "\n".join(faults_of(path))
    for text in (
        'machine.toml: effect[1].effect: "windige" is not in the catalogue. Did you mean "windage"?',
        'effect[2].intervals[1][1]: bare number "1"',
        'effect[3].parameters.heat: "20 K"',
        'effect[4].component: "rear_flange" cannot have radiation',
        'effect[5].form: "transitional" is unknown.',
        'effect[6].parameters: "amplitude" is missing.',
    ):
        assert text in faults, text
    # With more wrong beside them only their names can be judged.
    names = "\n".join(faults_of(path, "channel.depth=41mm"))
    assert 'effect[1].effect: "windige"' in names
    assert "channel.depth" in names
    assert names.count("leaves a wall of only") == 1


def test_places_near_probes_and_segments_are_known_without_a_mesh(tmp_path):
    path = tmp_path / "machine.toml"
    text = """
[[effect]]
effect = "unrecorded_heat_source"
component = "{component}"
form = "{form}"
intervals = [["1 s", "2 s"]]
parameters = {{heat = "20 W"}}
"""
    path.write_text('base = "recorded_spindle"\n' + text.format(component="SP04", form="near.SP04"))
    assert check_machine(path)["effects"] == [{"name": "unrecorded_heat_source", "detail": "SP04 near.SP04"}]
    path.write_text('base = "recorded_spindle"\n' + text.format(component="SP04", form="near.SP05"))
    assert "effect[1].form" in faults_of(path)[0]
