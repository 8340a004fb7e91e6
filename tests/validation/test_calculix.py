"""Growth by CalculiX on the same quadratic tetrahedra: a quarter of a tube, unevenly warm."""

from __future__ import annotations

import numpy as np
import pytest
import skfem

from spindle_fem.definition.load import load_machine
from validation.calculix import by_calculix, by_same_elements, holding_corners, is_there
from validation.solid_growth import WarmBody


@pytest.fixture(scope="module")
def tube():
    """A quarter of a tube of the reference shaft's steel, as warm as it is wide and long."""
    box = skfem.MeshTet.init_tensor(
        np.linspace(0.03, 0.06, 3), np.linspace(0.0, 0.5 * np.pi, 6), np.linspace(0.0, 0.08, 4)
    )
    r, angle, z = box.p
    mesh = skfem.MeshTet(np.array([r * np.cos(angle), r * np.sin(angle), z]), box.t)
    rise = 5.0 + 300.0 * r + 40.0 * np.cos(angle) * r / 0.06 + 1000.0 * z**2
    return WarmBody(mesh, rise, load_machine("wu_tan_2016").part_material("shaft"))


def test_an_even_rise_moves_every_node_away_from_the_held_one(tube) -> None:
    """By α ΔT times the distance, whatever the body turns."""
    even = WarmBody(tube.mesh, np.full(tube.mesh.p.shape[1], 10.0), tube.material)
    held = holding_corners(even)
    shift = by_same_elements(even, held)[:, : tube.mesh.p.shape[1]]
    apart = tube.mesh.p - tube.mesh.p[:, [held[0]]]
    growth = 10.0 * tube.material.thermal_expansion * (apart**2).sum(axis=0)
    np.testing.assert_allclose((shift * apart).sum(axis=0), growth, atol=1e-10 * growth.max())


@pytest.mark.skipif(not is_there(), reason="CalculiX (ccx) is not installed")
def test_calculix_says_the_same_of_every_node(tube) -> None:
    """CalculiX prints seven digits."""
    held = holding_corners(tube)
    theirs, ours = by_calculix(tube, held), by_same_elements(tube, held)
    assert theirs.shape == ours.shape
    assert np.ptp(ours) > 1e-5
    np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=1e-6 * np.abs(ours).max())
