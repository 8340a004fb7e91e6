"""How far the nose moves from the flange and seats of the housing open, by elasticity in the meridian plane.

Biquadratic elements, one for each cell of the finite volumes, on displacements along r and z. A body is
free but for one point; the channel's turns are rings where a few cuts through the helix have them. A shift
J(u) is linear in the temperatures: K λ = J once, and a cell's share is λ · f for the load f of its kelvin.

Source: Zienkiewicz & Taylor (2000), The Finite Element Method 1, chapters 4 (axisymmetric stress) and 8.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from . import machine as m

Array = NDArray[np.float64]

# Poisson's ratio, expansion in 1/K. Growth of a free body of one material does not depend on its modulus.
SHAFT, HOUSING = (0.30, 12.5e-6), (0.26, 10.5e-6)
# F3 holds the shaft along the axis: its seats from z to z, on the shaft and in the bore; m.
SEAT, ON_SHAFT, IN_BORE = (0.113, 0.137), 0.070, 0.095
# The sensor's spot on the nose (z, r) and the flange's back: z, from r to r; m.
SPOT, BACK = (0.0, 0.060), (0.065, 0.150, 0.190)
# Cuts through the helix whose rings stand for it.
CUTS = 4
# Directions of a displacement: along r, along z.
ACROSS, ALONG = 0, 1
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True, slots=True)
class Body:
    """A free body of revolution over cells of a grid.

    Attributes
    ----------
    r, z : (nr + 1,), (nz + 1,) ndarray, [m]
        Lines of the grid.
    solid : (nr, nz) bool ndarray
    poisson : float
    expansion : float, [1/K]
    """

    r: Array
    z: Array
    solid: NDArray[np.bool_]
    poisson: float
    expansion: float

    def _nodes(self) -> NDArray[np.int64]:
        """Nodes of every solid cell, (cells, 9), r before z: lines and their middles numbered along z."""
        i, k = np.nonzero(self.solid)
        step = np.arange(3)
        along = 2 * len(self.z) - 1
        rows = (2 * i)[:, None, None] + step[:, None]
        columns = (2 * k)[:, None, None] + step
        return (rows * along + columns).reshape(len(i), 9)

    def by_cell(self, *shifts: Array) -> Array:
        """What one kelvin of each cell adds to every shift, (k, nr, nz) m/K.

        ``shifts`` (2, 2 nr + 1, 2 nz + 1) are weights of the displacement along r, then along z, at lines and
        their middles.
        """
        i, k = np.nonzero(self.solid)
        nodes = self._nodes()
        r0 = self.r[i]
        hr, hz = np.diff(self.r)[i], np.diff(self.z)[k]
        nu = self.poisson
        # Per unit modulus; strains along r, around, along z, shear.
        lame = nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
        stiff = np.full((4, 4), lame)
        stiff[3] = stiff[:, 3] = 0.0
        stiff[np.diag_indices(4)] += np.array([1.0, 1.0, 1.0, 0.5]) / (1.0 + nu)
        by_kelvin = stiff @ (self.expansion * np.array([1.0, 1.0, 1.0, 0.0]))
        matrices, loads = np.zeros((len(i), 18, 18)), np.zeros((len(i), 18))
        for xi, first in zip(_POINTS, _WEIGHTS, strict=True):
            for eta, second in zip(_POINTS, _WEIGHTS, strict=True):
                (a, da), (b, db) = _lagrange(xi), _lagrange(eta)
                radius = r0 + 0.5 * (1.0 + xi) * hr
                shape = np.outer(a, b).ravel()
                by_r = np.outer(da, b).ravel() * (2.0 / hr)[:, None]
                by_z = np.outer(a, db).ravel() * (2.0 / hz)[:, None]
                strain = np.zeros((len(i), 4, 18))
                strain[:, 0, :9] = by_r
                strain[:, 1, :9] = shape / radius[:, None]
                strain[:, 2, 9:] = by_z
                strain[:, 3, :9], strain[:, 3, 9:] = by_z, by_r
                size = first * second * 0.25 * hr * hz * radius
                matrices += size[:, None, None] * (strain.transpose(0, 2, 1) @ stiff @ strain)
                loads += size[:, None] * (by_kelvin @ strain)
        used, place = np.unique(nodes, return_inverse=True)
        place = place.reshape(nodes.shape)
        unknowns = np.concatenate([place, place + len(used)], axis=1)
        n = 2 * len(used)
        rows, columns = np.repeat(unknowns, 18, axis=1), np.tile(unknowns, (1, 18))
        whole = sparse.coo_matrix((matrices.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n)).tocsc()
        # One point is kept from moving along the axis; what counts between two places does not see it.
        free = np.delete(np.arange(n), len(used))
        asked = np.array([shift.reshape(2, -1)[:, used].ravel() for shift in shifts])
        adjoint = np.zeros((len(shifts), n))
        adjoint[:, free] = splu(whole[free][:, free]).solve(asked[:, free].T).T
        found = np.zeros((len(shifts), *self.solid.shape))
        found[:, i, k] = np.einsum("scj,cj->sc", adjoint[:, unknowns], loads)
        return found

    def mean_on_cylinder(self, radius: float, low: float, high: float, axis: int = ALONG) -> Array:
        """Weights of the mean shift of a cylinder between two z."""
        found = self._none()
        line = 2 * int(np.argmin(np.abs(self.r - radius)))
        for k in np.flatnonzero((self.z[:-1] > low - 1e-7) & (self.z[1:] < high + 1e-7)):
            found[axis, line, 2 * k : 2 * k + 3] += np.array([1.0, 4.0, 1.0]) * (self.z[k + 1] - self.z[k])
        return found / found.sum()

    def mean_on_plane(self, z: float, low: float, high: float) -> Array:
        """Weights of the mean shift along z of a ring-shaped plane between two radii."""
        found = self._none()
        line = 2 * int(np.argmin(np.abs(self.z - z)))
        for i in np.flatnonzero((self.r[:-1] > low - 1e-7) & (self.r[1:] < high + 1e-7)):
            middle = 0.5 * (self.r[i] + self.r[i + 1])
            weights = np.array([self.r[i], 4.0 * middle, self.r[i + 1]])
            found[ALONG, 2 * i : 2 * i + 3, line] += weights * (self.r[i + 1] - self.r[i])
        return found / found.sum()

    def at_spot(self, z: float, radius: float) -> Array:
        """Weight of the shift along z of a point where lines of the grid cross."""
        found = self._none()
        found[ALONG, 2 * int(np.argmin(np.abs(self.r - radius))), 2 * int(np.argmin(np.abs(self.z - z)))] = (
            1.0
        )
        return found

    def _none(self) -> Array:
        return np.zeros((2, 2 * len(self.r) - 1, 2 * len(self.z) - 1))


def _lagrange(x: float) -> tuple[Array, Array]:
    """Quadratic shapes with nodes at −1, 0, 1, and their slopes."""
    return (
        np.array([0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)]),
        np.array([x - 0.5, -2.0 * x, x + 0.5]),
    )


def growth_by_cell(grid: m.Grid) -> dict[str, Array]:
    """What a kelvin of each cell does, (nr, nz): to the nose, m/K, and to every seat of the housing.

    ``nose``: how far forward the sensor's spot moves from the flange's back. Of a bearing: what opens its
    seat, as weights of the temperature at which a housing that is as warm all over opens it as far.
    Cells of shaft, housing and cover; a cell of the channel's turns counts with the mean of what is solid.
    """
    parts = {name: grid.part == m.PARTS.index(name) for name in ("shaft", "housing", "cover")}
    shaft = Body(grid.r, grid.z, parts["shaft"], *SHAFT)
    forward = shaft.mean_on_cylinder(ON_SHAFT, *SEAT) - shaft.at_spot(*SPOT)
    found = np.zeros((1 + len(m.BEARINGS), *grid.part.shape))
    found[0] = shaft.by_cell(forward)[0]
    seats = [1e-3 * np.array(m.standing(f"{name}.outer")[0])[[3, 0, 1]] for name in m.BEARINGS]
    for sector in np.arange(CUTS) * grid.sectors // CUTS:
        solid = (parts["housing"] & ~grid.wet[:, sector]) | parts["cover"]
        housing = Body(grid.r, grid.z, solid, *HOUSING)
        back = housing.mean_on_plane(*BACK)
        openings = [housing.mean_on_cylinder(*seat, axis=ACROSS) for seat in seats]
        found += housing.by_cell(back - housing.mean_on_cylinder(IN_BORE, *SEAT), *openings) / CUTS
    found[1:] /= found[1:].sum(axis=(1, 2), keepdims=True)
    return dict(zip(("nose", *m.BEARINGS), found, strict=True))
