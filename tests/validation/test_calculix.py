"""Growth by CalculiX on the same curved quadratic tetrahedra: a tube of two parts, warm, pressed, turning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.model.elastic.solid_body import SolidMesh
from spindle_fem.model.mesh.element_integrals import EDGES, triangle_table
from spindle_fem.physics.elasticity.elastic_material import ElasticMaterial
from validation.calculix import (
    SIDES,
    LoadedSolid,
    Pressed,
    calculix_points,
    compare,
    holding_corners,
    is_there,
)

STEEL = ElasticMaterial(206e9, 0.3, 12e-6, 7850.0)
IRON = ElasticMaterial(110e9, 0.26, 10.5e-6, 7200.0)


def tube(rise) -> LoadedSolid:
    """Steel within iron, fused; ``rise`` over x, y, z."""
    mesh = build_joined_tubes((0.03, 0.045, 0.06), 0.08, ((2, 1), 12, 4), parts=("shaft", "housing"))
    materials = {"shaft": STEEL, "housing": IRON}
    return LoadedSolid.of(SolidMesh.of(mesh, mesh.part_names), materials, rise(*mesh.points.T))


def test_an_even_rise_moves_every_node_away_from_the_held_one() -> None:
    """By α ΔT times the distance, whatever the body turns."""
    even = tube(lambda x, y, z: np.full(x.shape, 10.0))
    alike = LoadedSolid(even.mesh, dict.fromkeys(even.mesh.parts, STEEL), even.rise)
    held = holding_corners(alike.mesh)
    shift, apart = alike.by_package(held, *calculix_points()), alike.mesh.points - alike.mesh.points[held[0]]
    growth = 10.0 * STEEL.thermal_expansion * (apart**2).sum(axis=1)
    np.testing.assert_allclose((shift * apart).sum(axis=1), growth, atol=1e-9 * growth.max())


def bore(solid: LoadedSolid):
    """Facets of the inner surface, by nodes."""
    mesh = solid.mesh
    sides = mesh.tetrahedra[:, SIDES].reshape(-1, 3)
    on = np.abs(np.hypot(*mesh.points[:, :2].T) - 0.03) < 1e-9
    sides = sides[on[sides].all(axis=1)]
    edges = {
        tuple(sorted(pair)): middle
        for cell in mesh.tetrahedra.tolist()
        for pair, middle in zip(np.array(cell)[EDGES].tolist(), cell[4:], strict=True)
    }
    middles = [[edges[tuple(sorted((row[i], row[j])))] for i, j in ((0, 1), (1, 2), (0, 2))] for row in sides]
    return np.hstack([sides, middles])


UNEVEN = tube(lambda x, y, z: 5.0 + 300.0 * np.hypot(x, y) + 150.0 * x + 1000.0 * z**2)
STILL = replace(UNEVEN, rise=np.zeros_like(UNEVEN.rise))
LOADS = {
    "temperatures": UNEVEN,
    "pressure": replace(STILL, pressed=(Pressed(bore(STILL), 50e6),)),
    "rotation": replace(STILL, speed=1000.0),
}


def test_a_pressure_pushes_as_its_area_says() -> None:
    """Out of the bore all round, by p times 2π r times the length."""
    mesh, (pressed,) = STILL.mesh, LOADS["pressure"].pressed
    forces = pressed.load(mesh, triangle_table(2))
    radial = (forces * mesh.points)[:, :2].sum(axis=1) / np.hypot(*mesh.points[:, :2].T)
    assert radial.sum() == pytest.approx(50e6 * 2.0 * np.pi * 0.03 * 0.08, rel=1e-3)
    assert np.abs(forces.sum(axis=0)).max() < 1e-9 * radial.sum()


@pytest.mark.skipif(not is_there(), reason="CalculiX (ccx) is not installed")
@pytest.mark.parametrize("load", LOADS)
def test_calculix_says_the_same_of_every_node(load) -> None:
    """CalculiX prints seven digits."""
    found = compare("tube", load, LOADS[load])
    assert found.largest > 1e-6
    assert found.apart < 1e-6
    # curved sides are no polynomials, which few points integrate less exactly
    assert found.apart < found.by_points < 1e-2
