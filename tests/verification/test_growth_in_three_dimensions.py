"""Growth of shaft and housing in the meridian plane against elasticity on the thermal mesh, channel and all.

The reference spindle as it runs at 3000 rpm. In three dimensions each body is free: quadratic displacements
on the tetrahedra, the helix of the channel cut out as meshed, no lands made even, no mean round the axis.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
import skfem
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, cg
from skfem.helpers import ddot, div, sym_grad

from spindle_fem.definition.load import load_machine
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.elastic.machine_growth import flange_back
from spindle_fem.solvers.prepared_machine import prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared

pytestmark = pytest.mark.slow

Array = NDArray[np.float64]
ON_FACE = 2.0e-4


class Solid(NamedTuple):
    """Corners of a body (3, n), its outer facets (3, m), and the shift of every corner (3, n), m."""

    points: Array
    facets: NDArray[np.int64]
    shift: Array

    def mean(self, values: Array, on: NDArray[np.bool_]) -> float:
        """Mean of values at corners over the facets that lie on some of them."""
        own = self.facets[:, on[self.facets].all(axis=0)]
        first, second, third = self.points[:, own].transpose(1, 0, 2)
        area = np.linalg.norm(np.cross((second - first).T, (third - first).T), axis=1)
        return float(area @ values[own].mean(axis=0) / area.sum())

    def on(self, z: tuple[float, float], r: tuple[float, float]) -> NDArray[np.bool_]:
        """Corners between places along the axis and radii."""
        radius = np.hypot(*self.points[:2])
        along = (self.points[2] > z[0] - 1e-6) & (self.points[2] < z[1] + 1e-6)
        return along & (radius > r[0] - ON_FACE) & (radius < r[1] + ON_FACE)


@pytest.fixture(scope="module")
def machine():
    return prepare_machine(load_machine("wu_tan_2016", ["mesh.preset=coarse", "mesh.order=1"]))


@pytest.fixture(scope="module")
def field(machine):
    return solve_prepared(machine, find_fold=False).temperature[: machine.mesh.n_corners]


def solved(machine, field: Array, body: str) -> Solid:
    """The free body at its temperatures."""
    mesh, growth = machine.mesh, machine.growth
    own = [mesh.part_names.index(part) for part in growth.bodies.parts[body]]
    corners = mesh.tetrahedra[np.isin(mesh.part_of_element, own)][:, :4]
    used = np.unique(corners)
    # Parts that move as one body are joined where their nodes meet.
    places = np.round(mesh.points[used] / 1e-8).astype(np.int64)
    _, first, joined = np.unique(places, axis=0, return_index=True, return_inverse=True)
    local = np.full(mesh.n_corners, -1)
    local[used] = joined.ravel()
    tetrahedra = skfem.MeshTet(
        np.ascontiguousarray(mesh.points[used][first].T), np.ascontiguousarray(local[corners].T)
    )
    material = machine.spec.part_material(body)
    young, poisson = material.young_modulus, material.poisson_ratio
    first_lame = young * poisson / (1.0 + poisson) / (1.0 - 2.0 * poisson)
    shear = young / 2.0 / (1.0 + poisson)
    basis = skfem.Basis(tetrahedra, skfem.ElementVector(skfem.ElementTetP2()), intorder=2)

    @skfem.BilinearForm
    def stiffness(u, v, w):
        return first_lame * div(u) * div(v) + 2.0 * shear * ddot(sym_grad(u), sym_grad(v))

    @skfem.LinearForm
    def expansion(v, w):
        return (3.0 * first_lame + 2.0 * shear) * material.thermal_expansion * w["rise"] * div(v)

    rise = basis.with_element(skfem.ElementTetP1()).interpolate(
        field[used][first] - growth.assembly_temperature
    )
    matrix, load = stiffness.assemble(basis).tocsr(), expansion.assemble(basis, rise=rise)
    diagonal = matrix.diagonal()
    scaled = LinearOperator(matrix.shape, matvec=lambda vector: vector / diagonal)
    # Free in space, and the load is in balance: conjugate gradients leave the rigid motion alone.
    shift, failed = cg(matrix, load, rtol=1e-6, maxiter=4000, M=scaled)
    assert not failed
    outer = tetrahedra.facets[:, tetrahedra.boundary_facets()]
    return Solid(tetrahedra.p, outer, shift[basis.nodal_dofs])


@pytest.mark.parametrize("body", ["shaft", "housing"])
def test_seats_and_nose_grow_as_in_three_dimensions(machine, field, body):
    growth = machine.growth
    solid = solved(machine, field, body)
    outwards = (solid.points[:2] * solid.shift[:2]).sum(axis=0) / np.hypot(*solid.points[:2])
    seats = growth.seat_rows @ (field - growth.assembly_temperature)
    found = 0
    for ring, seat in zip(growth.rings, seats, strict=True):
        if ring.seat.carrier == body:
            exact = solid.mean(outwards, solid.on(ring.seat.face.z, ring.seat.face.r))
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
