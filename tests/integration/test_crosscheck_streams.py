"""Cross-check of a machine with heat sources and streams: purge air, cutting fluid, oil-air, oil jets."""

import json
import tomllib

import numpy as np
import pytest

from spindle_fem.commands.crosscheck_command import crosscheck_machine
from spindle_fem.definition.load import load_machine
from spindle_fem.definition.network_load import load_network_machine
from spindle_fem.model.lumped.heat_laws import CircuitLaw
from spindle_fem.model.lumped.links import SurfacePatch
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.operation.circuits import CircuitMarch, capacity_rate, wall_cells
from spindle_fem.solvers.machine_network_steady import solve_machine_network
from spindle_fem.solvers.network_steady import solve_steady
from spindle_fem.studies.crosscheck.axisymmetric import solve_axisymmetric
from spindle_fem.studies.crosscheck.flux_matched import _stream_conductances
from spindle_fem.studies.crosscheck.gather_fields import gather_axisymmetric, gather_network
from tests.integration.test_streams_in_models import PURGED
from tests.support.oiled_machine import oiled

SMALL = ("mesh.preset=coarse", "mesh.order=1")
STREAMS = {"cutting_fluid", "purge", *(f"{name}.lubrication" for name in ("F1", "F2", "R1", "R2"))}


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    folder = tmp_path_factory.mktemp("streams")
    path = folder / "streams.toml"
    path.write_text(PURGED.replace('"router_spindle"', f'"{oiled(folder).name}"'), encoding="utf-8")
    return path


def test_axisymmetric_elements_have_the_streams_of_the_network(machine):
    spec = load_machine(machine, SMALL)
    coarse = build_machine_network(spec)
    state = solve_machine_network(build_machine_network(spec, refinement=2, assembly=coarse.assembly))
    elements = solve_axisymmetric(state)
    assert abs(elements.residual_relative) < 1e-9
    ours = gather_axisymmetric(coarse, state.network.machine, elements)
    # An oil jet leaves half a kelvin of 40 at the balls: it draws on the middle of a ring's outermost cell.
    assert np.abs(gather_network(coarse, state) - ours).max() < 0.7


@pytest.fixture(scope="module")
def result(machine, tmp_path_factory):
    folder = tmp_path_factory.mktemp("crosscheck") / "out"
    return folder, crosscheck_machine(machine, folder, SMALL)


@pytest.mark.slow
def test_streams_stand_side_by_side_and_balance(machine, result):
    spec = load_machine(machine, SMALL)
    content = result[1]
    heat = dict.fromkeys(STREAMS, (0.0, 0.0))
    for link in content["links"]:
        if link["kind"] in STREAMS:
            heat[link["kind"]] = tuple(
                np.add(heat[link["kind"]], (link["network_W"], link["fem_W"])).tolist()
            )
    assert {film.name for film in spec.circuits} == STREAMS
    for name, (network, elements) in heat.items():
        assert elements != 0.0, name
        scale = sum(abs(link["fem_W"]) for link in content["links"] if link["kind"] == name)
        assert network == pytest.approx(elements, abs=0.15 * scale), name
    for node in content["nodes"]:
        assert sum(node["contributions_K"].values()) == pytest.approx(node["difference_K"], abs=1e-6)
    assert content["summary"]["max_difference_K"] < 5.0
    # Oil wets whole raceways, however narrow the contacts.
    bands = next(row for row in content["causes"] if row["cause"] == "raceway_bands")
    assert bands["max_K"] < 4.0
    # The question of another machine's paper is not put to this one.
    assert content["claim"] is None


@pytest.mark.slow
def test_the_exported_network_has_streams_and_sources(result):
    folder, content = result
    network = build_network(load_network_machine(folder / "reduced_network.toml").network)
    given = content["matched"]["heat_W"]
    assert given["stator_losses"] == 180.0
    inputs = {f"heat.{name}": value for name, value in given.items()}
    for key in ("ambient", "coolant_inlet"):
        inputs[key] = content["operating_point"][f"{key}_degC"] + 273.15
    state = solve_steady(network, inputs)
    found = dict(zip(network.node_names, state.temperature - 273.15, strict=True))
    worst = max(abs(found[c["node"]] - c["fem_degC"]) for c in content["nodes"] if c["node"] in found)
    assert worst < 0.05
    written = tomllib.loads((folder / "reduced_network.toml").read_text(encoding="utf-8"))
    names = {item["name"] for item in written["network"]["boundary"]}
    assert {f"{name}.fluid" for name in STREAMS} <= names
    inputs_named = json.loads((folder / "state_space.json").read_text(encoding="utf-8"))["inputs"]
    assert {"heat.stator_losses", "heat.F1", "purge.fluid"} <= set(inputs_named)


def test_what_links_make_of_a_stream_gives_its_heat(machine):
    """Links to the inlet and between walls carry what the walls together give to a stream."""
    film = next(film for film in load_machine(machine, SMALL).circuits if film.name == "purge")
    cell = wall_cells(film)
    conductance = np.full(len(cell), 0.4)
    march = CircuitMarch.of(film, conductance, cell)
    nodes = np.arange(len(cell))
    patch = SurfacePatch(nodes, np.ones(len(cell)), np.zeros(len(cell)), np.zeros(len(cell)))
    law = CircuitLaw(patch, conductance, march.warming, film.inlet_temperature, film.name)
    to_inlet, between = _stream_conductances(law)
    assert all(value > 0.0 for value in between.values())
    # All walls equally warm: nothing passes between them, and the stream takes its outlet's rise.
    even = film.inlet_temperature + np.full(len(cell), 10.0)
    carried = capacity_rate(film) * float(march.outlet @ np.full(len(cell), 10.0))
    assert 10.0 * sum(to_inlet.values()) == pytest.approx(carried, rel=1e-9)
    assert law.heat(even).sum() == pytest.approx(carried, rel=1e-9)
