"""Centres of curved (six-node) boundary triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Degree-4 rule of Dunavant (1985), six points, on the unit triangle; weights sum to 1.
_A, _B = 0.445948490915965, 0.091576213509771
_WEIGHT_A, _WEIGHT_B = 0.223381589678011, 0.109951743655322
_POINTS = np.array(
    [(_A, _A), (1 - 2 * _A, _A), (_A, 1 - 2 * _A), (_B, _B), (1 - 2 * _B, _B), (_B, 1 - 2 * _B)]
)
_WEIGHTS = np.array([_WEIGHT_A] * 3 + [_WEIGHT_B] * 3)


def _shapes(points: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray]:
    x, y = points.T
    z = 1.0 - x - y
    values = np.stack(
        [z * (2 * z - 1), x * (2 * x - 1), y * (2 * y - 1), 4 * z * x, 4 * x * y, 4 * y * z], axis=1
    )
    zero = np.zeros_like(x)
    along_x = np.stack([1 - 4 * z, 4 * x - 1, zero, 4 * (z - x), 4 * y, -4 * y], axis=1)
    along_y = np.stack([1 - 4 * z, zero, 4 * y - 1, -4 * x, 4 * x, 4 * (z - y)], axis=1)
    return values, along_x, along_y


def facet_centres(points: NDArray[np.float64], facets: NDArray[np.int64]) -> NDArray[np.float64]:
    """Centroid of every curved triangle.

    Parameters
    ----------
    points : (n_nodes, 3) ndarray, [m]
    facets : (n, 6) ndarray
        Corners, then the middles of edges 01, 12, 20.

    Returns
    -------
    (n, 3) ndarray, [m]
    """
    values, along_x, along_y = _shapes(_POINTS)
    corners = points[facets]
    tangent_x = np.einsum("qk,fkd->fqd", along_x, corners)
    tangent_y = np.einsum("qk,fkd->fqd", along_y, corners)
    jacobian = 0.5 * np.linalg.norm(np.cross(tangent_x, tangent_y), axis=2) * _WEIGHTS
    places = np.einsum("qk,fkd->fqd", values, corners)
    return np.einsum("fq,fqd->fd", jacobian, places) / jacobian.sum(axis=1)[:, None]
