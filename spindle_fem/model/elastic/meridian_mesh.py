"""Rectangles of a body of revolution in the plane (z, r), on lines that all its corners share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from skfem import MeshQuad

from spindle_fem.machine.geometry.part_shapes import AnnularSegment

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MeridianMesh:
    """A body's meridian section as cells of a grid.

    Attributes
    ----------
    z, r : (n,), (m,) ndarray, [m]
        Lines of the grid.
    cell : (n - 1, m - 1) int64 ndarray
        Element of each cell of the grid, -1 outside the body.
    region : (n_elements,) int64 ndarray
        Which region each element belongs to.
    mesh : skfem.MeshQuad
        The cells inside the body.
    """

    z: Array
    r: Array
    cell: NDArray[np.int64]
    region: NDArray[np.int64]
    mesh: MeshQuad

    @classmethod
    def of(
        cls,
        regions: Sequence[Sequence[AnnularSegment]],
        size: float,
        *,
        z_lines: Iterable[float] = (),
        r_lines: Iterable[float] = (),
    ) -> MeridianMesh:
        """Cells of at most ``size`` (m); where regions overlap, the later one holds.

        Parameters
        ----------
        regions : sequence of sequences of AnnularSegment
            Together the body.
        z_lines, r_lines : iterable of float, [m]
            Further lines that the grid must have, such as the ends of seats.
        """
        segments = [segment for region in regions for segment in region]
        z = _lines([x for s in segments for x in (s.z_start, s.z_end)], z_lines, size)
        r = _lines([x for s in segments for x in (s.inner_radius, s.outer_radius)], r_lines, size)
        middle_z, middle_r = 0.5 * (z[1:] + z[:-1]), 0.5 * (r[1:] + r[:-1])
        of_cell = np.full((len(middle_z), len(middle_r)), -1)
        for number, region in enumerate(regions):
            for s in region:
                inside_z = (middle_z > s.z_start) & (middle_z < s.z_end)
                inside_r = (middle_r > s.inner_radius) & (middle_r < s.outer_radius)
                of_cell[np.ix_(inside_z, inside_r)] = number
        inside = of_cell >= 0
        i, j = np.nonzero(inside)
        cell = np.full(of_cell.shape, -1)
        cell[i, j] = np.arange(len(i))
        corners = np.array([[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]])
        node = corners[:, 0] * len(r) + corners[:, 1]
        used, numbers = np.unique(node, return_inverse=True)
        points = np.array([z[used // len(r)], r[used % len(r)]])
        return cls(z, r, cell, of_cell[i, j], MeshQuad(points, numbers.reshape(node.shape)))

    def moved(self, distance: float) -> MeridianMesh:
        """The same section further along the axis, by a distance in m."""
        return replace(self, z=self.z + distance, mesh=self.mesh.translated((distance, 0.0)))

    def locate(self, z: Array, r: Array) -> tuple[NDArray[np.int64], Array]:
        """Element of each point, the nearest of one outside, and its place (2, n) in the unit square."""
        i = np.clip(np.searchsorted(self.z, z, side="right") - 1, 0, len(self.z) - 2)
        j = np.clip(np.searchsorted(self.r, r, side="right") - 1, 0, len(self.r) - 2)
        nearest = distance_transform_edt(self.cell < 0, return_distances=False, return_indices=True)
        i, j = nearest[0, i, j], nearest[1, i, j]
        place = np.array([(z - self.z[i]) / np.diff(self.z)[i], (r - self.r[j]) / np.diff(self.r)[j]])
        return self.cell[i, j], np.clip(place, 0.0, 1.0)


def _lines(corners: Iterable[float], further: Iterable[float], size: float) -> Array:
    """Coordinates of the grid's lines, nowhere farther apart than ``size``; equal to 1 nm counts as one."""
    corners = np.array(list(corners))
    low, high = corners.min(), corners.max()
    wanted = np.round(np.concatenate((corners, [x for x in further if low < x < high])), 9)
    fixed = np.unique(wanted)
    pieces = [
        np.linspace(a, b, max(int(np.ceil((b - a) / size - 1e-9)), 1), endpoint=False)
        for a, b in pairwise(fixed)
    ]
    return np.append(np.concatenate(pieces), fixed[-1])
