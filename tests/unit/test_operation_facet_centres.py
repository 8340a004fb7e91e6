"""Centres of curved facets against closed forms."""

import numpy as np
import pytest

from spindle_fem.operation.facet_centres import facet_centres


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


def test_mean_of_the_centres_converges_to_the_centroid():
    errors = []
    for n in (2, 4, 8):
        points, facets = cylinder_patch(0.05, 0.04, 1.0, n)
        centroid = facet_centres(points, facets).mean(axis=0)
        expected = [-0.05 * (1.0 - np.cos(1.0)), 0.05 * np.sin(1.0), 0.02]
        errors.append(np.linalg.norm(centroid - expected))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates == pytest.approx([4.0, 4.0], abs=0.3)


def test_centre_of_a_straight_facet_is_the_mean_of_its_corners():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0]], dtype=float)
    assert facet_centres(points, np.arange(6)[None, :]) == pytest.approx(np.array([[1 / 3, 1 / 3, 0.0]]))
