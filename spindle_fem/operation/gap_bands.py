"""Air gaps as bands of mixed air between a turning and a standing surface.

Every point of a turning surface passes all angles in a fraction of a second,
so it sees the mean of what faces it. A band of air with one temperature, joined
to both sides, gives exactly that: the turning part receives the same flux at
every angle and its own temperature comes out uniform around the axis.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import GeometryError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.operation.facet_centres import facet_centres


@dataclass(frozen=True, slots=True)
class GapBands:
    """Facets of both sides sorted into cells of the gap.

    Attributes
    ----------
    conductance_share : (n_cells,) ndarray, [m²]
        Area of the turning surface in each cell: conductance per unit film
        coefficient.
    rotating_cell : (n_facets,) int ndarray
        Cell of each facet of the turning surface.
    standing_cells : mapping of surface to (n_facets,) int ndarray
    rotating_area, standing_area : (n_cells,) ndarray, [m²]
        Meshed area that each cell owns on either side.
    """

    conductance_share: NDArray[np.float64]
    rotating_cell: NDArray[np.int64]
    standing_cells: dict[str, NDArray[np.int64]]
    rotating_area: NDArray[np.float64]
    standing_area: NDArray[np.float64]

    @property
    def n_cells(self) -> int:
        """Number of air cells."""
        return len(self.conductance_share)


def angle_of(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """θ in [0, 2π) of points (n, 3): 0 along +y, right-handed about +z."""
    return np.mod(np.arctan2(-points[:, 0], points[:, 1]), 2.0 * np.pi)


def build_gap_bands(
    mesh: TaggedMesh,
    facet_area: Mapping[str, NDArray[np.float64]],
    rotating: str,
    standing: tuple[str, ...],
    band_width: float,
    n_sectors: int,
) -> GapBands:
    """Sort the facets of a gap into cells.

    Parameters
    ----------
    facet_area : mapping of surface to (n_facets,) ndarray, [m²]
    band_width : float, [m]
        Wanted axial width of a band; widened until every cell owns facets of
        both sides.
    n_sectors : int
        1 averages around the axis; more keeps angles apart.

    Raises
    ------
    GeometryError
        The two sides do not face each other along z.
    """
    where = f"gap between {rotating} and {', '.join(standing)}"
    turning_areas = facet_area[rotating]
    turning_centres = facet_centres(mesh.points, mesh.require_surface(rotating, where))
    standing_areas = np.concatenate([facet_area[name] for name in standing])
    standing_centres = np.concatenate(
        [facet_centres(mesh.points, mesh.require_surface(name, where)) for name in standing]
    )
    turning_nodes = mesh.points[mesh.surfaces[rotating]].reshape(-1, 3)
    low, high = turning_nodes[:, 2].min(), turning_nodes[:, 2].max()
    if standing_centres[:, 2].max() < low or standing_centres[:, 2].min() > high:
        raise GeometryError(where, "the two surfaces do not face each other along z.")
    n_bands = max(1, round((high - low) / band_width))
    while True:
        cells_turning = _cells(turning_centres, low, high, n_bands, n_sectors)
        cells_standing = _cells(standing_centres, low, high, n_bands, n_sectors)
        n_cells = n_bands * n_sectors
        rotating_area = np.bincount(cells_turning, turning_areas, n_cells)
        standing_area = np.bincount(cells_standing, standing_areas, n_cells)
        if (rotating_area > 0.0).all() and (standing_area > 0.0).all():
            break
        if n_bands == 1 and n_sectors == 1:
            raise GeometryError(where, "one side has no facets.")
        n_bands, n_sectors = (n_bands - 1, n_sectors) if n_bands > 1 else (1, n_sectors - 1)
    starts = np.cumsum([0, *(len(facet_area[name]) for name in standing)])
    return GapBands(
        conductance_share=np.full(n_cells, turning_areas.sum() / n_cells),
        rotating_cell=cells_turning,
        standing_cells={name: cells_standing[starts[i] : starts[i + 1]] for i, name in enumerate(standing)},
        rotating_area=rotating_area,
        standing_area=standing_area,
    )


def _cells(
    centres: NDArray[np.float64], low: float, high: float, n_bands: int, n_sectors: int
) -> NDArray[np.int64]:
    band = np.clip(((centres[:, 2] - low) / (high - low) * n_bands).astype(np.int64), 0, n_bands - 1)
    sector = np.minimum((angle_of(centres) / (2.0 * np.pi) * n_sectors).astype(np.int64), n_sectors - 1)
    return band * n_sectors + sector
