"""Areas and centres of curved facets against closed forms."""

import numpy as np
import pytest

from spindle_fem.loads.facets import facet_areas_and_centres, mean_over_facets


def cylinder_patch(radius, height, angle, n):
    """Quadratic triangles covering a cylinder patch, exact edge middles."""
    u = np.linspace(0.0, angle, 2 * n + 1)
    v = np.linspace(0.0, height, 2 * n + 1)
    index = np.arange((2 * n + 1) ** 2).reshape(2 * n + 1, 2 * n + 1)
    points = np.stack(
        [
            -radius * np.sin(u)[:, None] + 0.0 * v,
            radius * np.cos(u)[:, None] + 0.0 * v,
            0.0 * u[:, None] + v,
        ],
        axis=-1,
    ).reshape(-1, 3)
    facets = []
    for i in range(0, 2 * n, 2):
        for j in range(0, 2 * n, 2):
            a, b, c, d = index[i, j], index[i + 2, j], index[i + 2, j + 2], index[i, j + 2]
            ab, bc, cd, da = index[i + 1, j], index[i + 2, j + 1], index[i + 1, j + 2], index[i, j + 1]
            middle = index[i + 1, j + 1]
            facets += [[a, b, c, ab, bc, middle], [a, c, d, middle, cd, da]]
    return points, np.array(facets)


def test_area_of_a_cylinder_patch_converges_with_the_fourth_power():
    errors = []
    for n in (2, 4, 8):
        points, facets = cylinder_patch(0.05, 0.04, 2.0, n)
        areas, _ = facet_areas_and_centres(points, facets)
        errors.append(abs(areas.sum() / (0.05 * 2.0 * 0.04) - 1.0))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates == pytest.approx([4.0, 4.0], abs=0.2)


def test_centres_weighted_by_area_give_the_centroid():
    points, facets = cylinder_patch(0.05, 0.04, 1.0, 6)
    areas, centres = facet_areas_and_centres(points, facets)
    centroid = (areas[:, None] * centres).sum(axis=0) / areas.sum()
    expected = [-0.05 * (1.0 - np.cos(1.0)), 0.05 * np.sin(1.0), 0.02]
    assert centroid == pytest.approx(expected, rel=1e-5)


def test_mean_over_a_flat_facet_is_exact_for_a_quadratic_field():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0]])
    field = 3.0 + points[:, 0] ** 2 - points[:, 0] * points[:, 1]
    mean = mean_over_facets(field, np.arange(6)[None, :])
    assert mean == pytest.approx([3.0 + 1.0 / 6.0 - 1.0 / 12.0])
