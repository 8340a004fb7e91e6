"""Written networks: reading, priors, refusals by name."""

import copy
import tomllib

import numpy as np
import pytest

from spindle_fem.definition.load import machine_folder
from spindle_fem.definition.network_load import (
    is_network_machine,
    load_network_machine,
    validate_network_machine,
    with_parameters,
    write_network_machine,
)
from spindle_fem.errors import FaultsError, SpecError, UnknownSurfaceError
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.units import Uncertain

TEXT = """
schema = "spindle-fem/machine/1"
name = "bench motor"
[[network.node]]
name = "winding"
capacity = {value = "40 J/K", sigma_rel = 0.5}
[[network.node]]
name = "body"
capacity = "0.2 kJ/K"
[[network.boundary]]
name = "ambient"
temperature = "ambient"
[[network.boundary]]
name = "bench"
temperature = {low = "18 degC", high = "28 degC"}
[[network.boundary]]
name = "bath"
temperature = "25 degC"
[[network.link]]
between = ["winding", "body"]
conductance = {value = "1 W/K", sigma_rel = 1.0}
[[network.link]]
between = ["body", "ambient"]
conductance = {low = "0.1 W/K", high = "10 W/K"}
[[network.link]]
between = ["body", "bench"]
conductance = "0.5 W/K"
[[network.link]]
between = ["bath", "body"]
conductance = "0.5 W/K"
[[network.source]]
node = "winding"
input = "electrical_power"
gain = {value = "0.9 W/W", sigma_rel = 0.1}
[[network.source]]
node = "body"
input = "speed"
gain = "60 W"
reference = "3000 rpm"
exponent = 1.5
[[network.source]]
node = "body"
gain = "2 W"
"""


@pytest.fixture
def content():
    return tomllib.loads(TEXT)


def build(content):
    return build_network(validate_network_machine(content, "machine.toml").network)


def test_values_arrive_in_si(content):
    network = build(content)
    assert network.node_names == ("winding", "body")
    np.testing.assert_allclose(network.capacity, [40.0, 200.0])
    np.testing.assert_allclose(network.link_conductance, [1.0, 1.0, 0.5, 0.5])
    assert network.boundary_input == ("ambient", None, None)
    assert np.isnan(network.boundary_temperature[0])
    assert network.boundary_temperature[1] == pytest.approx(np.sqrt(291.15 * 301.15))
    assert network.boundary_temperature[2] == pytest.approx(298.15)
    assert network.link_names[3] == "bath|body"


def test_reference_states_the_heat_at_one_input(content):
    network = build(content)
    heat = network.source_values({"electrical_power": 100.0, "speed": 3000.0 * 2 * np.pi / 60})
    np.testing.assert_allclose(heat, [90.0, 60.0, 2.0])
    heat = network.source_values({"electrical_power": 0.0, "speed": 750.0 * 2 * np.pi / 60})
    np.testing.assert_allclose(heat, [0.0, 60.0 / 8.0, 2.0])


def test_only_values_with_a_prior_are_parameters(content):
    parameters = {item.name: item for item in build(content).parameters}
    assert set(parameters) == {
        "capacity.winding",
        "conductance.winding|body",
        "conductance.body|ambient",
        "temperature.bench",
        "gain.winding.electrical_power",
    }
    assert parameters["capacity.winding"].sigma_log == 0.5
    # 90 % between 0.1 and 10 W/K
    assert parameters["conductance.body|ambient"].sigma_log == pytest.approx(np.log(10.0) / 1.6448536)


@pytest.mark.parametrize(
    ("text", "input_value", "heat"),
    [("0.9 W/W", 100.0, 90.0), ("3 W/percent", 0.5, 150.0), ("0.02 W/rpm", 100.0 * 2 * np.pi / 60, 2.0)],
)
def test_gain_in_any_unit(content, text, input_value, heat):
    content["network"]["source"][0]["gain"] = text
    network = build(content)
    assert network.source_values({"electrical_power": input_value, "speed": 0.0})[0] == pytest.approx(heat)


def test_round_trip_through_toml(content):
    spec = validate_network_machine(content, "machine.toml")
    again = validate_network_machine(tomllib.loads(write_network_machine(spec)), "again.toml")
    one, two = build_network(spec.network), build_network(again.network)
    np.testing.assert_allclose(one.boundary_temperature, two.boundary_temperature, rtol=1e-12)
    np.testing.assert_allclose(one.source_gain, two.source_gain, rtol=1e-12)
    np.testing.assert_allclose(one.source_exponent, two.source_exponent)
    assert [p.name for p in one.parameters] == [p.name for p in two.parameters]
    assert [p.sigma_log for p in one.parameters] == pytest.approx([p.sigma_log for p in two.parameters])


def test_calibrated_values_are_written_and_read_back(content):
    content["network"]["source"][1]["gain"] = {"value": "60 W", "sigma_rel": 0.4}
    spec = validate_network_machine(content, "machine.toml")
    values = {
        "capacity.winding": Uncertain(47.0, 0.02),
        "conductance.body|ambient": Uncertain(0.7, 0.01),
        "gain.body.speed": Uncertain(55.0, 0.05),
        "temperature.bench": Uncertain(300.0, 0.001),
    }
    text = write_network_machine(with_parameters(spec, values))
    network = build_network(validate_network_machine(tomllib.loads(text), "calibrated.toml").network)
    assert network.capacity[0] == pytest.approx(47.0)
    assert network.boundary_temperature[1] == pytest.approx(300.0)
    heat = network.source_values({"electrical_power": 0.0, "speed": 3000.0 * 2 * np.pi / 60})
    assert heat[1] == pytest.approx(55.0)
    found = {item.name: item.sigma_log for item in network.parameters}
    assert found["gain.body.speed"] == pytest.approx(0.05)
    with pytest.raises(UnknownSurfaceError, match=r'Did you mean "capacity\.winding"'):
        with_parameters(spec, {"capacity.windin": Uncertain(1.0)})


def test_overrides_by_name(content, tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(TEXT)
    spec = load_network_machine(path, ["network.node.winding.capacity=55 J/K"])
    assert spec.network.node[0].capacity == Uncertain(55.0, 0.5)  # the prior stays
    with pytest.raises(SpecError, match="windin"):
        load_network_machine(path, ["network.node.windin.capacity=55 J/K"])


def test_kind_of_machine(content):
    assert is_network_machine(content)
    assert not is_network_machine({"schema": "spindle-fem/machine/1", "part": []})


def changed(content, path, value):
    result = copy.deepcopy(content)
    target = result["network"]
    *steps, last = path
    for step in steps:
        target = target[step]
    if value is None:
        del target[last]
    else:
        target[last] = value
    return result


FAULTS = [
    (("node", 0, "capacity"), "-5 J/K", r'node\[1\].capacity: "winding" has -5 J/K. Allowed: above 0'),
    (("node", 0, "capacity"), 40, r"node\[1\].capacity.*bare number 40, a unit is needed"),
    (("node", 0, "capacity"), "40 W", "wrong dimension"),
    (
        ("node", 1, "name"),
        "winding",
        r'node\[2\].name: "winding" is defined twice, first as network.node\[1\]',
    ),
    (("boundary", 1, "name"), "ambient", r'boundary\[2\].name: "ambient" is defined twice'),
    (("boundary", 0, "name"), "body", '"body" is defined twice, first as network.node'),
    (("boundary", 2, "temperature"), "-300 degC", "is below absolute zero"),
    (("boundary", 2, "temperature"), 25, "bare number 25"),
    (("link", 0, "between"), ["winding", "winding"], r'link\[1\].between: joins "winding" to itself'),
    (
        ("link", 1, "between"),
        ["body", "ambiant"],
        '"ambiant" is neither a node nor a boundary. Did you mean "ambient"',
    ),
    (("link", 1, "between"), ["bench", "ambient"], 'joins the boundaries "bench" and "ambient"'),
    (("link", 1, "between"), ["body", "winding"], r"is the same link as network.link\[1\]"),
    (("link", 0, "conductance"), "0 W/K", r'"winding\|body" has 0 W/K. Allowed: above 0'),
    (("link", 0, "between"), ["body", "bench"], r"same link as network.link\[1\]"),
    (("source", 0, "node"), "windin", r'source\[1\].node: "windin" is not a node. Did you mean "winding"'),
    (("source", 0, "gain"), "0.9 Wat", 'has the unknown unit "Wat"'),
    (("source", 0, "exponent"), -1.0, "exponent"),
    (("source", 1, "gain"), "60 J", "with a reference the gain is the heat there, a power"),
    (("source", 2, "gain"), "2 K", "a source without input needs a power"),
    (("source", 2, "exponent"), 2.0, "exponent and reference need an input"),
    (("source", 2, "input"), "speed", r"already takes heat from speed in network.source\[2\]"),
    (("link", 0, "conductivity"), "1 W/K", 'unknown key. Did you mean "conductance"'),
    (("node", 0, "capacity"), None, "capacity: is missing"),
]


@pytest.mark.parametrize(("path", "value", "message"), FAULTS)
def test_faults_name_key_value_and_what_is_allowed(content, path, value, message):
    with pytest.raises(FaultsError, match=message) as caught:
        build(changed(content, path, value))
    assert "machine.toml" in str(caught.value)


def test_floating_node_is_named(content):
    content["network"]["node"].append({"name": "rotor", "capacity": "10 J/K"})
    with pytest.raises(FaultsError, match=r'network.node\[3\]: "rotor" floats'):
        build(content)
    content["network"]["node"].append({"name": "shaft", "capacity": "10 J/K"})
    content["network"]["link"].append({"between": ["rotor", "shaft"], "conductance": "1 W/K"})
    with pytest.raises(FaultsError) as caught:
        build(content)
    assert len(caught.value.faults) == 2


def test_every_fault_at_once(content):
    content["network"]["node"][0]["capacity"] = "-1 J/K"
    content["network"]["source"][0]["node"] = "nothing"
    content["network"]["link"][1]["between"] = ["body", "body"]
    with pytest.raises(FaultsError) as caught:
        build(content)
    assert len(caught.value.faults) == 3


def test_second_link_between_the_same_two_takes_a_name(content):
    content["network"]["link"].append(
        {"between": ["winding", "body"], "conductance": "2 W/K", "name": "wires"}
    )
    assert build(content).link_names[-1] == "wires"


@pytest.mark.parametrize("schema", [None, "spindle-fem/machine/2"])
def test_unknown_schema_is_refused(content, schema):
    content["schema"] = schema
    with pytest.raises(FaultsError, match=r'schema: .* is not known. Allowed: "spindle-fem/machine/1"'):
        build(content)


@pytest.mark.parametrize("name", ["bench_motor", "turning_centre"])
def test_shipped_machines_can_be_solved(name):
    spec = load_network_machine(machine_folder() / f"{name}.toml")
    network = build_network(spec.network)
    assert spec.initial == "first_reading"
    assert all(item.sigma_log > 0.2 or item.kind in ("temperature", "gain") for item in network.parameters)
