"""Shifts of rings by the temperatures of a network's nodes."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.model.elastic.growth_outputs import RADIAL
from spindle_fem.model.elastic.machine_bodies import machine_bodies
from spindle_fem.model.lumped.machine_balance import bearing_temperatures
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.model.lumped.operating_state import operate
from spindle_fem.operation.bearing_heat import heat_model_of
from spindle_fem.operation.operating_point import OperatingPoint


@pytest.fixture(scope="module")
def networks():
    spec = load_machine("wu_tan_2016")
    return {n: build_machine_network(spec, refinement=n) for n in (1, 3)}


def test_even_warming_grows_every_body_freely(networks):
    for network in networks.values():
        growth = network.growth
        found = growth.shifts(np.full(network.n_solid, growth.assembled_at[0] + 10.0))
        steel, iron = 12.5e-6, 10.5e-6
        assert found["F3"] == pytest.approx(
            10.0 * np.array([0.0, (iron - steel) * 95e-3, steel * 79e-3, steel * 86e-3]), abs=1e-11
        )
        assert growth.shifts(np.full(network.n_solid, growth.assembled_at[0]))["R1"] == pytest.approx(0.0)


def test_a_field_on_fine_cells_moves_seats_as_elasticity_has_it(networks):
    """A housing that is warmer outside, at the corners of its section and on cells."""
    network = networks[3]
    bodies = machine_bodies(network.spec)
    housing = bodies.bodies[bodies.housing]
    shift = housing.solve(housing.expansion_load @ (100.0 * (housing.section.mesh.p[1] - 82.5e-3)))
    cells, node = network.cells, network.partition.node_of_cell
    # parts turn or stand: outside the housing everything stays as assembled
    own = np.isin(np.array(cells.part_names)[cells.part], bodies.parts[bodies.housing])
    warm = np.where(own, 100.0 * (cells.r.mean(axis=1) - 82.5e-3), 0.0) * cells.volume
    temperature = network.growth.assembled_at[0] + np.bincount(node, warm) / np.bincount(node, cells.volume)
    found = network.growth.shifts(temperature)
    for seat in bodies.seats:
        if not seat.is_inner:
            expected = housing.mean_shift(seat.face, RADIAL) @ shift
            assert found[seat.bearing][1] == pytest.approx(expected, rel=0.03)
            assert found[seat.bearing][2:] == pytest.approx(0.0, abs=1e-12)


def test_refining_the_network_moves_the_shifts_little(networks):
    """A field along the axis, on lumps, whose borders are steps in it, and on cells a third of a bearing."""
    found = []
    for network in networks.values():
        z = np.zeros(network.n_solid)
        np.add.at(z, network.partition.node_of_cell, network.cells.volume * network.cells.z.mean(axis=1))
        z /= np.bincount(network.partition.node_of_cell, network.cells.volume, network.n_solid)
        shifts = network.growth.shifts(network.growth.assembled_at[0] + 10.0 + 20.0 * z)
        found.append(np.array(list(shifts.values())))
    assert found[0] == pytest.approx(found[1], abs=0.15 * np.abs(found[1]).max())


def test_bearings_of_the_network_know_their_shifts(networks):
    network = networks[1]
    point = OperatingPoint.of(network.spec)
    state = operate(network, point, heat_model_of(network.spec))
    around = bearing_temperatures(state, np.linspace(300.0, 310.0, network.n_nodes))
    expected = network.growth.shifts(np.linspace(300.0, 310.0, network.n_nodes)[: network.n_solid])
    assert around["F1"].shifts == pytest.approx(expected["F1"])
    rigid = load_machine("wu_tan_2016", ("heat.thermal_preload=false",))
    assert build_machine_network(rigid).growth is None
