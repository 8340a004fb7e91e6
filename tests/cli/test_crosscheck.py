"""Files of a cross-check: what they hold, and that others can use them."""

import json

import numpy as np
import pytest

from spindle_fem.commands.crosscheck_command import crosscheck_machine
from spindle_fem.definition.network_load import load_network_machine
from spindle_fem.errors import FaultsError, SpindleFemError
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.solvers.network_steady import solve_steady

# The small machine as if it were the paper's, so that the paper's claim is put to it.
MACHINE = """
schema = "spindle-fem/machine/1"
base = "small_two_start"
name = "small"
channel = {marks = {depth = "P"}}
"""
OVERRIDES = ("mesh.preset=coarse", "mesh.order=1", "heat.model=palmgren")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crosscheck") / "out"
    told = []
    path = folder.parent / "small.toml"
    path.write_text(MACHINE, encoding="utf-8")
    content = crosscheck_machine(path, folder, OVERRIDES, told.append)
    return folder, content, told


def test_every_file_is_there_and_the_folder_complete(result):
    folder, content, told = result
    names = {path.name for path in folder.iterdir()}
    assert {
        "crosscheck.json", "report.html", "machine.toml", "figures",
        "reduced_network.toml", "state_space.npz", "state_space.json",
    } <= names  # fmt: skip
    assert "INCOMPLETE" not in names
    assert json.loads((folder / "crosscheck.json").read_text(encoding="utf-8")) == json.loads(
        json.dumps(content)
    )
    assert {path.stem for path in (folder / "figures").glob("*.png")} == {
        "difference", "temperatures", "causes", "speeds", "convergence",
    }  # fmt: skip
    assert "flux matching" in told


def test_nodes_and_links_stand_side_by_side(result):
    _, content, _ = result
    assert content["schema"] == "spindle-fem/crosscheck/1"
    for node in content["nodes"]:
        assert node["difference_K"] == pytest.approx(node["network_degC"] - node["fem_degC"], abs=1e-9)
        assert sum(node["contributions_K"].values()) == pytest.approx(node["difference_K"], abs=1e-6)
    names = {node["node"] for node in content["nodes"]}
    assert len(names) == content["network"]["nodes"]
    assert {"B1.inner_ring", "B1.balls", "B1.outer_ring"} <= names
    assert all({"link", "network_W", "fem_W", "surface"} <= set(link) for link in content["links"])
    assert content["network"]["imbalance_relative"] < 1e-10


def test_the_elements_flows_balance_at_the_balls(result):
    _, content, _ = result
    for name in ("B1", "B2"):
        into = [link["fem_W"] for link in content["links"] if link["link"].endswith(f"|{name}.balls")]
        shares = 0.5  # of the friction heat, given to the balls themselves
        assert -sum(into) == pytest.approx(shares * content["matched"]["heat_W"][name], rel=1e-6)
        assert len(into) == 2


def test_flux_matching_meets_the_elements(result):
    _, content, _ = result
    speeds = content["matched"]["speeds"]
    assert min(row["matched_max_K"] for row in speeds) < 0.05
    # at other speeds the factors of one are half as far off as none
    worst = {kind: max(row[f"{kind}_max_K"] for row in speeds) for kind in ("matched", "unmatched")}
    assert worst["matched"] < 0.5 * worst["unmatched"]
    own = content["operating_point"]["speed_rpm"]
    assert [row["speed_rpm"] / own for row in speeds] == pytest.approx([1 / 6, 0.5, 1.0, 1.5], rel=0.03)
    assert content["matched"]["not_reached"] == []


def test_refinement_converges(result):
    errors = [row["max_difference_K"] for row in result[1]["convergence"]["rows"]]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.11


def test_the_exported_network_is_a_machine_that_reproduces_the_elements(result):
    folder, content, _ = result
    network = build_network(load_network_machine(folder / "reduced_network.toml").network)
    heat = json.loads((folder / "state_space.json").read_text(encoding="utf-8"))
    names = [name for name in heat["inputs"] if name.startswith("heat.")]
    case = next(c for c in content["nodes"] if c["node"] == "B1.inner_ring")
    friction = content["matched"]["heat_W"]
    inputs = {name: friction[name.removeprefix("heat.")] for name in names}
    inputs |= {
        "ambient": content["operating_point"]["ambient_degC"] + 273.15,
        "coolant_inlet": content["operating_point"]["coolant_inlet_degC"] + 273.15,
    }
    state = solve_steady(network, inputs)
    found = dict(zip(network.node_names, state.temperature - 273.15, strict=True))
    assert found["B1.inner_ring"] == pytest.approx(case["fem_degC"], abs=0.01)
    worst = max(abs(found[c["node"]] - c["fem_degC"]) for c in content["nodes"] if c["node"] in found)
    assert worst < 0.05


def test_the_state_space_reproduces_it_too(result):
    folder, content, _ = result
    with np.load(folder / "state_space.npz") as space:
        assert space["schema"] == "spindle-fem/network-state-space/1"
        speed = content["operating_point"]["speed_rpm"]
        k = int(np.argmin(np.abs(space["speed_rpm"] - speed)))
        a, b, c, d = (space[name][k] for name in "ABCD")
        inputs = {f"heat.{name}": value for name, value in content["matched"]["heat_W"].items()}
        inputs["ambient"] = content["operating_point"]["ambient_degC"] + 273.15
        inputs["coolant_inlet"] = content["operating_point"]["coolant_inlet_degC"] + 273.15
        u = np.array([inputs.get(name, np.nan) for name in space["inputs"]])
        x = np.linalg.solve(a, -b @ u)
        y = dict(zip(space["outputs"].tolist(), c @ x + d @ u - 273.15, strict=True))
    assert np.linalg.eigvals(a).real.max() < 0.0
    for node in content["nodes"]:
        if node["node"] in y:
            assert y[node["node"]] == pytest.approx(node["fem_degC"], abs=0.05)
    assert y["coolant_outlet"] == pytest.approx(content["fem"]["coolant_outlet_degC"], abs=0.1)


def test_the_claim_is_answered_by_both_models(result):
    claim = result[1]["claim"]
    if "not_possible" in claim:
        assert "channel" in claim["not_possible"]
    else:
        assert set(claim["verdicts"]) == {"network", "elements"}
        assert claim["explanation"]


def test_a_bad_override_is_bad_input_and_leaves_nothing(tmp_path):
    with pytest.raises(SpindleFemError) as caught:
        crosscheck_machine("small_two_start", tmp_path / "out", ("channel.dept=3mm",))
    assert caught.value.exit_status == 2
    assert not (tmp_path / "out").exists()


def test_a_design_that_does_not_fit_marks_the_folder(tmp_path):
    with pytest.raises(FaultsError):
        crosscheck_machine("small_two_start", tmp_path / "out", ("channel.depth=80mm", "mesh.preset=coarse"))
    assert (tmp_path / "out" / "INCOMPLETE").exists()
