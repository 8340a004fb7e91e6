"""Finite volumes on the grid: every coefficient that can change has an operator of its own.

The heat balance of the cells is ``M dT/dt = -(K0 + sum g_i K_i) T + sum g_i b_i T_i + S q + coolant``.
``g_i`` is the conductance of group i per unit area, the joint or film in series with the half
cells beside it, so that a cell's temperature need not be the surface's.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from . import machine as m
from .nose_growth import growth_by_cell

Groups = dict[str, tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]]


@dataclass(slots=True)
class FiniteVolumes:
    """Operators over the unknowns (cells, then one node a bearing's balls).

    ``pair_groups`` are exchanges between two cells (joints, gaps, balls): cells, cells, areas;
    ``film_groups`` exchanges with a surrounding: cells, areas. ``series`` is the resistance of the
    half cells, m²K/W. ``wall`` is (n, stations): wetted area of a cell at a station of the helix.
    ``sources`` distributes one watt, and read the other way gives the mean temperature there.
    """

    grid: m.Grid
    conduction: sparse.csr_matrix
    capacity: NDArray[np.float64]
    pair_groups: dict[str, sparse.csr_matrix]
    film_groups: dict[str, NDArray[np.float64]]
    series: dict[str, float]
    wall: sparse.csr_matrix
    sources: dict[str, NDArray[np.float64]]
    readings: dict[str, NDArray[np.float64]] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.capacity.size


def _laplacian(first: NDArray, second: NDArray, conductance: NDArray, size: int) -> sparse.csr_matrix:
    rows = np.concatenate([first, second, first, second])
    columns = np.concatenate([first, second, second, first])
    values = np.concatenate([conductance, conductance, -conductance, -conductance])
    return sparse.coo_matrix((values, (rows, columns)), shape=(size, size)).tocsr()


class _Builder:
    def __init__(self, grid: m.Grid) -> None:
        self.grid = grid
        self.nr, self.nz = grid.part.shape
        self.n_theta = grid.sectors
        self.angle = 2.0 * np.pi / self.n_theta
        self.r_mid = 0.5 * (grid.r[1:] + grid.r[:-1])
        self.z_mid = 0.5 * (grid.z[1:] + grid.z[:-1])
        self.dz = np.diff(grid.z)
        self.rotating = np.isin(grid.part, [m.PARTS.index(name) for name in m.ROTATING])
        part = np.repeat(grid.part[:, None, :], self.n_theta, axis=1)
        self.part = np.where(grid.wet, -1, part)
        self.number()
        self.flat_part = self.part.ravel()
        materials = np.array([m.material_of(name) for name in m.PARTS])
        self.k = np.where(self.part >= 0, materials[self.part, 0], 0.0)
        self.rho_c = np.where(self.part >= 0, materials[self.part, 1], 0.0)

    def number(self) -> None:
        index = np.full(self.part.shape, -1)
        ring = self.rotating
        index[:, 0, :][ring] = np.arange(ring.sum())
        index[:] = np.where(ring[:, None, :], index[:, :1, :], index)
        solid = (self.part >= 0) & ~ring[:, None, :]
        index[solid] = ring.sum() + np.arange(solid.sum())
        self.index = index
        self.cells = int(ring.sum() + solid.sum())
        self.size = self.cells + len(m.BEARINGS)

    def faces(self) -> None:
        """Sort the faces between solid cells into bulk conduction and joints."""
        r, angle = self.grid.r, self.angle
        full = self.part.shape
        joints: dict[str, list] = {}
        bulk = []
        area_r = np.broadcast_to((r[1:-1, None, None] * angle) * self.dz, (self.nr - 1, *full[1:]))
        lower = np.log(r[1:-1] / self.r_mid[:-1]) * r[1:-1]
        upper = np.log(self.r_mid[1:] / r[1:-1]) * r[1:-1]
        half_r = (np.broadcast_to(x[:, None, None], area_r.shape) for x in (lower, upper))
        area_z = np.broadcast_to(
            (self.r_mid * np.diff(r) * angle)[:, None, None], (self.nr, self.n_theta, self.nz - 1)
        )
        half_z = (np.broadcast_to(0.5 * x, area_z.shape) for x in (self.dz[:-1], self.dz[1:]))
        area_t = np.broadcast_to((np.diff(r)[:, None, None]) * self.dz, full)
        half_t = np.broadcast_to((0.5 * angle * self.r_mid)[:, None, None], full)
        roll = (np.arange(self.n_theta) + 1) % self.n_theta
        kinds = (
            ("seat", np.s_[:-1], np.s_[1:], area_r, *half_r),
            ("axial", np.s_[..., :-1], np.s_[..., 1:], area_z, *half_z),
            ("angle", np.s_[:], np.s_[:, roll], area_t, half_t, half_t),
        )
        spinning = np.repeat(self.rotating[:, None, :], self.n_theta, axis=1)
        for kind, low, high, area, half_low, half_high in kinds:
            p, q = self.part[low], self.part[high]
            ok = (p >= 0) & (q >= 0) & (spinning[low] == spinning[high])
            i, j = self.index[low][ok], self.index[high][ok]
            resistance = half_low[ok] / self.k[low][ok] + half_high[ok] / self.k[high][ok]
            same = (p == q)[ok] & (i != j)
            bulk.append((i[same], j[same], area[ok][same] / resistance[same]))
            pairs = np.stack([p[ok], q[ok]], axis=1)[(p != q)[ok]]
            apart = (p != q)[ok]
            for a, b in np.unique(pairs, axis=0):
                chosen = apart & (p[ok] == a) & (q[ok] == b)
                name = f"{kind}:{m.PARTS[a]}|{m.PARTS[b]}"
                joints.setdefault(name, []).append(
                    (i[chosen], j[chosen], area[ok][chosen], resistance[chosen])
                )
        joined = (np.concatenate(x) for x in zip(*bulk, strict=True))
        self.conduction = _laplacian(*joined, self.size)
        self.joints = {name: [np.concatenate(x) for x in zip(*v, strict=True)] for name, v in joints.items()}

    def boundary(self, axis: str, place: float, low: float, high: float, outward: int) -> tuple:
        """Cells, areas and half-cell depth of the solid just inside a face.

        ``axis`` "r": the cylinder r = place between z = low and high; "z": the plane z = place
        between r = low and high, as drawn. ``outward`` is +1 or −1 along the axis.
        """
        tolerance = 1e-7
        if axis == "r":
            line = int(np.argmin(np.abs(self.grid.r_drawn - place)))
            i, place = line - (1 if outward > 0 else 0), float(self.grid.r[line])
            span = (self.z_mid > low - tolerance) & (self.z_mid < high + tolerance)
            cells = self.index[i][:, span]
            area = np.broadcast_to(place * self.angle * self.dz[span], cells.shape)
            depth = abs(self.r_mid[i] - place) / self.k[i, 0, span].max()
        else:
            k = int(np.argmin(np.abs(self.grid.z - place))) - (1 if outward > 0 else 0)
            drawn = 0.5 * (self.grid.r_drawn[1:] + self.grid.r_drawn[:-1])
            span = (drawn > low - tolerance) & (drawn < high + tolerance)
            cells = self.index[span][:, :, k]
            area = np.broadcast_to((self.r_mid * np.diff(self.grid.r) * self.angle)[span, None], cells.shape)
            depth = 0.5 * self.dz[k] / self.k[span][:, 0, k].max()
        if (cells < 0).any():
            raise ValueError(f"face {axis} = {place} ({low}-{high}) lies beside a void")
        return cells.ravel(), area.ravel(), float(depth)

    def weights(self, *faces: tuple) -> NDArray[np.float64]:
        vector = np.zeros(self.size)
        for cells, area, _ in faces:
            np.add.at(vector, cells, area)
        return vector


def assemble(grid: m.Grid) -> FiniteVolumes:
    """Assemble the operators of the reference spindle on a grid."""
    b = _Builder(grid)
    b.faces()
    size, boundary = b.size, b.boundary
    capacity = np.zeros(size)
    volume = (b.r_mid * np.diff(grid.r) * b.angle)[:, None, None] * b.dz
    solid = b.part >= 0
    np.add.at(capacity, b.index[solid], (volume * b.rho_c)[solid])
    pairs: dict[str, sparse.csr_matrix] = {}
    series: dict[str, float] = {}
    for name, (i, j, area, resistance) in b.joints.items():
        mean = float((resistance * area).sum() / area.sum())
        pairs[name] = _laplacian(i, j, area * mean / resistance if np.ptp(resistance) > 0 else area, size)
        series[name] = mean
    films: dict[str, NDArray[np.float64]] = {}
    for name, faces in _film_faces(boundary).items():
        films[name] = b.weights(*faces)
        series[name] = float(np.mean([f[2] for f in faces]))
    for name, (shaft_radius, housings) in {
        "gap": (0.065, ((0.095, 0.157, 0.180), (0.090, 0.180, 0.410))),
        "labyrinth": (0.090, ((0.091, 0.025, 0.040),)),
    }.items():
        blocks, depth = [], 0.0
        for radius, z0, z1 in housings:
            shaft, area, depth_shaft = boundary("r", shaft_radius, z0, z1, +1)
            facing, _, depth_housing = boundary("r", radius, z0, z1, -1)
            depth = depth_shaft + depth_housing * shaft_radius / radius
            blocks.append((shaft, facing, area))
        pairs[name] = _laplacian(*(np.concatenate(x) for x in zip(*blocks, strict=True)), size)
        series[name] = depth
    sources = _places(b)
    readings: dict[str, NDArray[np.float64]] = {}
    for number, bearing in enumerate(m.BEARINGS):
        node = b.cells + number
        capacity[node] = m.BALL_CAPACITY[bearing[0]]
        lone = np.zeros(size)
        lone[node] = 1.0
        readings[f"{bearing}.balls"] = lone
        matrix = sparse.csr_matrix((size, size))
        for ring in ("inner", "outer"):
            cells = np.flatnonzero(sources[f"{bearing}.{ring}"])
            weight = sources[f"{bearing}.{ring}"][cells]
            matrix = matrix + _laplacian(cells, np.full(cells.size, node), weight, size)
        pairs[f"balls:{bearing}"] = matrix
        series[f"balls:{bearing}"] = 0.0
    _read(b, readings)
    return FiniteVolumes(grid, b.conduction, capacity, pairs, films, series, _wall(b), sources, readings)


def _film_faces(boundary) -> dict[str, tuple]:
    r, z = "r", "z"
    return {
        "outside:cover": (boundary(z, 0.025, 0.091, 0.150, -1), boundary(r, 0.150, 0.025, 0.040, +1)),
        "outside:flange": (boundary(z, 0.040, 0.150, 0.190, -1), boundary(r, 0.190, 0.040, 0.065, +1)),
        "outside:front": (boundary(r, 0.150, 0.065, 0.180, +1),),
        "outside:middle": (boundary(r, 0.150, 0.180, 0.410, +1), boundary(z, 0.410, 0.130, 0.150, +1)),
        "outside:rear": (boundary(r, 0.130, 0.410, 0.490, +1), boundary(z, 0.490, 0.0825, 0.130, +1)),
        "flange_back": (boundary(z, 0.065, 0.150, 0.190, +1),),
        "nose_end": (boundary(z, 0.0, 0.030, 0.090, -1), boundary(r, 0.090, 0.0, 0.025, +1)),
        "drive_end": (
            boundary(r, 0.070, 0.490, 0.500, +1), boundary(z, 0.500, 0.055, 0.070, +1),
            boundary(r, 0.055, 0.500, 0.560, +1), boundary(z, 0.560, 0.030, 0.055, +1),
        ),
    }  # fmt: skip


def _places(b: _Builder) -> dict[str, NDArray[np.float64]]:
    """Places where heat can enter: raceways, and places of unrecorded heat."""
    places: dict[str, NDArray[np.float64]] = {}

    def put(name: str, vector: NDArray[np.float64]) -> None:
        places[name] = vector / vector.sum()

    for part, rectangles in {**m._ROTATING, **m._STANDING}.items():
        if part[:2] in m.BEARINGS:
            ((z0, z1, r0, r1),) = rectangles
            radius, outward = (r1, +1) if part.endswith("inner") else (r0, -1)
            put(part, b.weights(b.boundary("r", radius * 1e-3, z0 * 1e-3, z1 * 1e-3, outward)))
    put("nose", b.weights(b.boundary("r", 0.090, 0.025, 0.040, +1)))
    put("nose_cover", b.weights(b.boundary("r", 0.091, 0.025, 0.040, -1)))
    put("drive_end", b.weights(b.boundary("r", 0.055, 0.500, 0.560, +1)))
    put("drive_lip", b.weights(b.boundary("r", 0.070, 0.490, 0.500, +1)))
    put("shaft_gap", b.weights(b.boundary("r", 0.065, 0.157, 0.410, +1)))
    put("shaft_middle", b.weights(b.boundary("r", 0.065, 0.260, 0.310, +1)))
    put("shaft_front", b.weights(b.boundary("r", 0.065, 0.157, 0.200, +1)))
    put("flange", b.weights(b.boundary("z", 0.065, 0.150, 0.190, +1)))
    put("flange_rim", b.weights(b.boundary("r", 0.190, 0.040, 0.065, +1)))
    top = {
        "housing_middle_top": (0.150, 0.260, 0.320), "housing_front_top": (0.150, 0.070, 0.130),
        "housing_behind_front": (0.150, 0.150, 0.200), "housing_rear_top": (0.130, 0.435, 0.480),
        "housing_middle_bottom": (0.150, 0.250, 0.330),
    }  # fmt: skip
    sectors = b.n_theta
    for name, (radius, z0, z1) in top.items():
        cells, area, _ = b.boundary("r", radius, z0, z1, +1)
        angle = np.repeat(np.arange(sectors), cells.size // sectors)
        near = np.minimum(angle, sectors - 1 - angle) < max(1, sectors // 10)
        if name.endswith("bottom"):
            near = np.abs(angle - (sectors - 1) / 2) < sectors / 8
        put(name, b.weights((cells[near], area[near], 0.0)))
    put("housing_bore", b.weights(b.boundary("r", 0.090, 0.270, 0.310, -1)))
    put("housing_all", b.weights(b.boundary("r", 0.150, 0.180, 0.410, +1)))
    put("housing_rear_all", b.weights(b.boundary("r", 0.130, 0.410, 0.490, +1)))
    return places


def _wall(b: _Builder) -> sparse.csr_matrix:
    """Wetted area of each cell at each station of the helix, every wall of its exact area."""
    stations = m.CHANNEL_TURNS * b.n_theta
    rows, columns, values = [], [], []
    station = b.grid.station
    theta_length = b.angle
    inner, outer = b.grid.deviation.radius(np.array([m.CHANNEL_INNER, m.CHANNEL_OUTER]))
    exact_side = 0.5 * (outer**2 - inner**2) * theta_length
    exact = {
        "inner": inner * theta_length * m.CHANNEL_WIDTH,
        "outer": outer * theta_length * m.CHANNEL_WIDTH,
        "before": exact_side, "behind": exact_side,
    }  # fmt: skip
    total = sum(exact.values()) * stations
    wet = station >= 0
    radius = np.where(wet.any(axis=(1, 2)))[0]
    moves = {
        "inner": (radius[0], -1, 0),
        "outer": (radius[-1], +1, 0),
        "before": (None, 0, -1),
        "behind": (None, 0, 1),
    }
    for wall, (only, dr, dz) in moves.items():
        i, t, k = np.nonzero(wet)
        chosen = (i == only) if only is not None else ~wet[i, t, k + dz]
        i, t, k = i[chosen], t[chosen], k[chosen]
        beside = b.index[i + dr, t, k + dz]
        at = station[i, t, k]
        area = b.dz[k] if only is not None else (b.r_mid * np.diff(b.grid.r))[i]
        area = area * exact[wall] / np.bincount(at, area, minlength=stations)[at] * (m.CHANNEL_AREA / total)
        rows.append(beside), columns.append(at), values.append(area)
    values = [v * b.grid.deviation.film_factor(stations)[c] for v, c in zip(values, columns, strict=True)]
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sparse.coo_matrix(entries, shape=(b.size, stations)).tocsr()


def _read(b: _Builder, readings: dict[str, NDArray[np.float64]]) -> None:
    for (probe, (r, z)), (dr, dz) in zip(m.PROBE_PLACES.items(), b.grid.deviation.probes, strict=True):
        r, z = r + dr, z + dz
        vector = np.zeros(b.size)
        i = np.clip(np.searchsorted(b.r_mid, r) - 1, 0, b.nr - 2)
        k = np.clip(np.searchsorted(b.z_mid, z) - 1, 0, b.nz - 2)
        part = m.PARTS.index("housing")
        if b.grid.part[i, k] != part:
            i += 1
        u = (r - b.r_mid[i]) / (b.r_mid[i + 1] - b.r_mid[i])
        v = (z - b.z_mid[k]) / (b.z_mid[k + 1] - b.z_mid[k])
        for sector in (0, b.n_theta - 1):
            for di, wi in ((0, 1 - u), (1, u)):
                for dk, wk in ((0, 1 - v), (1, v)):
                    vector[b.index[i + di, sector, k + dk]] += 0.5 * wi * wk
        readings[probe] = vector
    volume = (b.r_mid * np.diff(b.grid.r) * b.angle)[:, None, None] * b.dz * np.ones((1, b.n_theta, 1))
    for name in m.PARTS:
        chosen = b.part == m.PARTS.index(name)
        vector = np.zeros(b.size)
        np.add.at(vector, b.index[chosen], volume[chosen])
        readings[f"mean:{name}"] = vector / vector.sum()
    # Not a mean, and of the nose in m/K; of a cell's sectors one share each.
    i, t, k = np.nonzero(b.index >= 0)
    for name, cell in growth_by_cell(b.grid).items():
        vector = np.zeros(b.size)
        np.add.at(vector, b.index[i, t, k], (cell / np.maximum((b.index >= 0).sum(axis=1), 1))[i, k])
        readings[f"growth:{name}"] = vector
