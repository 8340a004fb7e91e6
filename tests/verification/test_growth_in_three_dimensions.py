"""Growth of shaft and housing in the meridian plane against elasticity on the thermal mesh, channel and all.

The reference spindle as it runs at 3000 rpm. In three dimensions each body is free: quadratic displacements
on the tetrahedra, the helix of the channel cut out as meshed, no lands made even, no mean round the axis.
"""

from __future__ import annotations

import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.elastic.machine_growth import flange_back
from spindle_fem.solvers.prepared_machine import prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared
from validation.solid_growth import free_growth, warm_body

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def machine():
    return prepare_machine(load_machine("wu_tan_2016", ["mesh.preset=coarse", "mesh.order=1"]))


@pytest.fixture(scope="module")
def field(machine):
    return solve_prepared(machine, find_fold=False).temperature[: machine.mesh.n_corners]


@pytest.mark.parametrize("body", ["shaft", "housing"])
def test_seats_and_nose_grow_as_in_three_dimensions(machine, field, body):
    growth = machine.growth
    solid = free_growth(warm_body(machine, field, body))
    seats = growth.seat_rows @ (field - growth.assembly_temperature)
    found = 0
    for ring, seat in zip(growth.rings, seats, strict=True):
        if ring.seat.carrier == body:
            exact = solid.mean(solid.outwards, solid.on(ring.seat.face.z, ring.seat.face.r))
            assert seat == pytest.approx(exact, rel=0.03 if body == "housing" else 2e-3), ring.seat.ring
            found += 1
    assert found == 5
    held = growth.holding_seat(body)
    at_bearing = solid.mean(solid.shift[2], solid.on(held.z, held.r))
    if body == "shaft":
        forward = at_bearing - solid.mean(solid.shift[2], solid.on((0.0, 0.0), (0.0, 1.0)))
    else:
        back = flange_back(Layout(machine.spec, set()))
        forward = solid.mean(solid.shift[2], solid.on(back.z, back.r)) - at_bearing
    outputs, rows = growth.carriers[body]
    told = rows[outputs.names.index("forward")] @ (field - growth.assembly_temperature)
    assert told == pytest.approx(forward, rel=0.02)
