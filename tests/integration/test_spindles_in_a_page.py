"""The spindles that ship as a page each, solved coarse: heat balances, elements and network agree."""

from __future__ import annotations

import pytest

import spindle_fem
from spindle_fem.commands.crosscheck_command import crosscheck_machine
from spindle_fem.definition.load import find_machine
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.results.output_folder import is_complete
from spindle_fem.solvers.machine_network_steady import solve_machine_network

# What tells them apart: the warmest bearing, K above the room (no measurement stands behind these bands).
PAGES = {
    "belt_lathe": ("L", 20.0, 80.0),
    "router_spindle": ("F", 10.0, 60.0),
    "externally_driven": ("F", 30.0, 80.0),
    "grinding_spindle": ("R", 15.0, 50.0),
    # cold grease alone would heat it over 350 °C, warm grease does not
    "groove_spindle": ("F", 30.0, 70.0),
}


@pytest.fixture(scope="module", params=PAGES)
def solved(request):
    spec = spindle_fem.load_machine(request.param, ["mesh.preset=coarse", "mesh.order=1"])
    return request.param, spindle_fem.solve(spec)


def test_it_is_written_in_a_page_without_joints_or_surfaces(solved):
    lines = find_machine(solved[0]).read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 70
    assert not [line for line in lines if line.startswith(("joint", "surface", "film", "gap", "materials"))]


def test_its_heat_balances_and_every_check_holds(solved):
    name, result = solved
    assert all(check.passed for check in result.checks)
    assert abs(result.energy.imbalance_relative) < 1e-8
    bearing, low, high = PAGES[name]
    rise = {key: item.temperature_inner - 295.15 for key, item in result.bearings.items()}
    assert max(rise, key=rise.get).startswith(bearing)
    assert low < max(rise.values()) < high


def test_elements_and_network_agree(solved):
    result = solved[1]
    state = solve_machine_network(build_machine_network(result.spec), OperatingPoint.of(result.spec))
    network = state.bearing_temperatures()
    # The network's cells are as coarse as parts: a tenth of the machine's warmest rise.
    band = 0.1 * (max(item.temperature_ball for item in result.bearings.values()) - 295.15) + 1.0
    for name, item in result.bearings.items():
        assert network[name].outer == pytest.approx(item.temperature_outer, abs=band)
        assert network[name].inner == pytest.approx(item.temperature_inner, abs=band)


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_its_cross_check_tells_what_parts_network_and_elements(name, tmp_path):
    """Down to raceways as narrow as their contacts: cells so thin that rounding is most of the imbalance."""
    overrides = ("mesh.preset=coarse", "mesh.order=1")
    content = crosscheck_machine(find_machine(name), tmp_path / "out", overrides)
    assert content["nodes"]
    assert is_complete(tmp_path / "out")
