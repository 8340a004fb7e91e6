"""Growth by CalculiX on the same curved quadratic tetrahedra: a tube of two parts, unevenly warm."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.model.elastic.solid_body import SolidMesh
from spindle_fem.physics.elasticity.elastic_material import ElasticMaterial
from validation.calculix import WarmSolid, compare, four_points, holding_corners, is_there

STEEL = ElasticMaterial(206e9, 0.3, 12e-6, 7850.0)
IRON = ElasticMaterial(110e9, 0.26, 10.5e-6, 7200.0)


def tube(rise) -> WarmSolid:
    """Steel within iron, fused; ``rise`` over x, y, z."""
    mesh = build_joined_tubes((0.03, 0.045, 0.06), 0.08, ((2, 1), 12, 4), parts=("shaft", "housing"))
    materials = {"shaft": STEEL, "housing": IRON}
    return WarmSolid.of(SolidMesh.of(mesh, mesh.part_names), materials, rise(*mesh.points.T))


def test_an_even_rise_moves_every_node_away_from_the_held_one() -> None:
    """By α ΔT times the distance, whatever the body turns."""
    even = tube(lambda x, y, z: np.full(x.shape, 10.0))
    alike = WarmSolid(even.mesh, dict.fromkeys(even.mesh.parts, STEEL), even.rise)
    held = holding_corners(alike.mesh)
    shift, apart = alike.by_package(held, four_points()), alike.mesh.points - alike.mesh.points[held[0]]
    growth = 10.0 * STEEL.thermal_expansion * (apart**2).sum(axis=1)
    np.testing.assert_allclose((shift * apart).sum(axis=1), growth, atol=1e-9 * growth.max())


@pytest.mark.skipif(not is_there(), reason="CalculiX (ccx) is not installed")
def test_calculix_says_the_same_of_every_node() -> None:
    """CalculiX prints seven digits."""
    found = compare("tube", tube(lambda x, y, z: 5.0 + 300.0 * np.hypot(x, y) + 150.0 * x + 1000.0 * z**2))
    assert found.largest > 1e-5
    assert found.apart < 1e-6
    # curved sides are no polynomials, which four points integrate less exactly
    assert found.apart < found.by_points < 1e-2
