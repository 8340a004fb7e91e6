"""Bilinear finite elements of a machine in the meridian plane, each coefficient with its own operator.

Parts are rectangles of r and z on one grid of lines; every part numbers its own nodes, so that contacts are
between pairs of nodes. Films, gaps, contacts and balls take nodal areas; all coefficients are per unit.
"""

import itertools
from dataclasses import dataclass
from fnmatch import fnmatch
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .definition import value

Array = NDArray[np.float64]
# Places are written to a hundredth of a millimetre and finer.
SLACK = 2e-6
FACINGS = {"front": (1, -1), "rear": (1, 1), "inward": (0, -1), "outward": (0, 1)}


@dataclass(slots=True)
class Meridian:
    """Operators over the nodes (parts', then one of each bearing's balls).

    ``exchange`` (matrix, load towards its surrounding) by group: ``joint:NAME``, ``film:NAME``, ``gap:NAME``,
    ``balls:SET``. ``place`` (n,) spreads one watt, and read the other way is the mean there.
    """

    conduction: sparse.csc_matrix
    capacity: Array
    exchange: dict[str, tuple[sparse.csc_matrix, Array]]
    place: dict[str, Array]
    probes: dict[str, Array]

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.capacity.size


def rectangles(tables: dict[str, Any]) -> dict[str, tuple[str, list[tuple[float, float, float, float]]]]:
    """Material and rectangles (r from, to, z from, to), m, of every part, rings of the bearings too."""
    out = {}
    for part in tables["part"]:
        out[part["name"]] = (
            part["material"],
            [
                (0.5 * value(s["inner_diameter"]), 0.5 * value(s["outer_diameter"]), *map(value, s["z"]))
                for s in part["segment"]
            ],
        )
    for ring_set in tables["bearing_set"]:
        kind = tables["bearing_types"][ring_set["bearing_type"]]
        bore, outer = 0.5 * value(kind["bore_diameter"]), 0.5 * value(kind["outer_diameter"])
        inner_edge = 0.5 * value(kind["inner_ring_outer_diameter"])
        outer_edge = 0.5 * value(kind["outer_ring_inner_diameter"])
        for bearing in ring_set["bearing"]:
            z = tuple(map(value, bearing["z"]))
            out[f"{bearing['name']}.inner_ring"] = (kind["ring_material"], [(bore, inner_edge, *z)])
            out[f"{bearing['name']}.outer_ring"] = (kind["ring_material"], [(outer_edge, outer, *z)])
    return out


def _lines(stops: set[float], longest: float) -> Array:
    edges = np.unique(np.round(sorted(stops), 7))
    parts = [
        np.linspace(a, b, max(1, int(np.ceil((b - a) / longest - 1e-9))), endpoint=False)
        for a, b in itertools.pairwise(edges)
    ]
    return np.append(np.concatenate(parts), edges[-1])


class _Builder:
    def __init__(self, tables: dict[str, Any], longest: float) -> None:
        self.tables = tables
        shapes = rectangles(tables)
        self.names = list(shapes)
        stops_r, stops_z = set(), set()
        for _, boxes in shapes.values():
            for r0, r1, z0, z1 in boxes:
                stops_r |= {r0, r1}
                stops_z |= {z0, z1}
        for surface in tables["surface"]:
            for where in surface["where"]:
                for key, stops in (("r", stops_r), ("z", stops_z)):
                    given = where.get(key, [])
                    stops |= {value(x) for x in (given if isinstance(given, list) else [given])}
        self.r, self.z = _lines(stops_r, longest), _lines(stops_z, longest)
        r_mid, z_mid = 0.5 * (self.r[1:] + self.r[:-1]), 0.5 * (self.z[1:] + self.z[:-1])
        self.part = np.full((r_mid.size, z_mid.size), -1)
        for number, (_, boxes) in enumerate(shapes.values()):
            for r0, r1, z0, z1 in boxes:
                inside = np.ix_((r_mid > r0) & (r_mid < r1), (z_mid > z0) & (z_mid < z1))
                self.part[inside] = number
        nodes_r, nodes_z = self.r.size, self.z.size
        self.index = np.full((len(self.names), nodes_r, nodes_z), -1)
        count = 0
        for number in range(len(self.names)):
            used = np.zeros((nodes_r, nodes_z), dtype=bool)
            i, k = np.nonzero(self.part == number)
            for a in (0, 1):
                for b in (0, 1):
                    used[i + a, k + b] = True
            self.index[number][used] = count + np.arange(used.sum())
            count += int(used.sum())
        self.count = count
        materials = [tables["materials"][material] for material, _ in shapes.values()]
        self.k = np.array([value(m["thermal_conductivity"]) for m in materials])
        self.rho_c = np.array([value(m["density"]) * value(m["specific_heat_capacity"]) for m in materials])

    def solid(self, size: int) -> tuple[sparse.csc_matrix, Array]:
        """Conduction matrix and lumped capacity, every cell by 2 x 2 Gauss points."""
        i, k = np.nonzero(self.part >= 0)
        number = self.part[i, k]
        nodes = np.stack([self.index[number, i + a, k + b] for a, b in ((0, 0), (1, 0), (0, 1), (1, 1))])
        dr, dz = np.diff(self.r)[i], np.diff(self.z)[k]
        blocks, mass = np.zeros((4, 4, i.size)), np.zeros((4, i.size))
        ends = 0.5 * (1.0 + np.array([-1.0, 1.0]) / np.sqrt(3.0))
        for x in ends:
            for y in ends:
                shape = np.array([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y])
                slope_r = np.array([-(1 - y), 1 - y, -y, y])[:, None] / dr
                slope_z = np.array([-(1 - x), -x, 1 - x, x])[:, None] / dz
                weight = 0.25 * dr * dz * 2.0 * np.pi * (self.r[i] + x * dr)
                both = slope_r[:, None] * slope_r[None] + slope_z[:, None] * slope_z[None]
                blocks += weight * self.k[number] * both
                mass += weight * self.rho_c[number] * shape[:, None]
        rows, columns = np.broadcast_arrays(nodes[:, None], nodes[None])
        matrix = sparse.coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))
        capacity = np.bincount(nodes.ravel(), mass.ravel(), minlength=size)
        return matrix.tocsc(), capacity

    def edges(self, part: int, facing: str) -> dict[str, Array]:
        """Edges of a part's cells that look somewhere: cells, nodes (2, n), areas (2, n), who is beside."""
        axis, side = FACINGS[facing]
        i, k = np.nonzero(self.part == part)
        step = (side, 0) if axis == 0 else (0, side)
        padded = np.pad(self.part, 1, constant_values=-1)
        beside = padded[i + 1 + step[0], k + 1 + step[1]]
        out = beside != part
        i, k, beside = i[out], k[out], beside[out]
        line_r, line_z = i + (side > 0), k + (side > 0)
        if axis == 0:
            ends = [(line_r, k), (line_r, k + 1)]
            half = np.pi * self.r[line_r] * np.diff(self.z)[k]
            areas = np.stack([half, half])
            at = self.r[line_r]
        else:
            ends = [(i, line_z), (i + 1, line_z)]
            a, b = self.r[i], self.r[i + 1]
            areas = np.pi / 3.0 * (b - a) * np.stack([2.0 * a + b, a + 2.0 * b])
            at = self.z[line_z]
        nodes = np.stack([self.index[part, p, q] for p, q in ends])
        return {"nodes": nodes, "areas": areas, "beside": beside, "at": at, "i": i, "k": k, "ends": ends}

    def surface(self, name: str) -> list[dict[str, Array]]:
        """Free edges of a named surface."""
        entry = next(s for s in self.tables["surface"] if s["name"] == name)
        part, out = self.names.index(entry["part"]), []
        for where in entry["where"]:
            e = self.edges(part, where["facing"])
            keep = e["beside"] < 0
            mids = {
                "r": 0.5 * (self.r[e["i"]] + self.r[e["i"] + 1]),
                "z": 0.5 * (self.z[e["k"]] + self.z[e["k"] + 1]),
            }
            mids["r" if FACINGS[where["facing"]][0] == 0 else "z"] = e["at"]
            for key in ("r", "z"):
                given = where.get(key)
                if isinstance(given, list):
                    keep &= (mids[key] > value(given[0])) & (mids[key] < value(given[1]))
                elif given is not None:
                    keep &= np.abs(mids[key] - value(given)) < 1e-6
            out.append({key: v[..., keep] if key != "ends" else v for key, v in e.items()})
        return out

    def spread(self, size: int, *groups: dict[str, Array]) -> Array:
        """(n,) nodal areas of some edges."""
        total = np.zeros(size)
        for e in groups:
            np.add.at(total, e["nodes"].ravel(), e["areas"].ravel())
        return total


def _between(first: Array, second: Array, areas: Array, size: int) -> sparse.csc_matrix:
    a, b, w = first.ravel(), second.ravel(), areas.ravel()
    rows, columns = np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a])
    return sparse.coo_matrix((np.concatenate([w, w, -w, -w]), (rows, columns)), shape=(size, size)).tocsc()


def _joints(b: _Builder, size: int) -> dict[str, sparse.csc_matrix]:
    out: dict[str, sparse.csc_matrix] = {}
    for part, name in enumerate(b.names):
        for facing, face in (("outward", ""), ("rear", ":face")):
            e = b.edges(part, facing)
            for other in np.unique(e["beside"][e["beside"] >= 0]):
                mine = e["beside"] == other
                pair = (f"{name}|{b.names[other]}{face}", f"{b.names[other]}|{name}{face}")
                joint = next(
                    (
                        j["name"]
                        for j in b.tables["joint"]
                        if any(fnmatch(p, c) for c in j["contacts"] for p in pair)
                    ),
                    None,
                )
                if joint is None:
                    continue
                across = np.stack([b.index[other, p[mine], q[mine]] for p, q in e["ends"]])
                matrix = _between(e["nodes"][:, mine], across, e["areas"][:, mine], size)
                key = f"joint:{joint}"
                if joint == "outer_ring_seats":
                    key += f":{_set_beside(b.tables, pair[0])}"
                out[key] = out[key] + matrix if key in out else matrix
    return out


def _set_beside(tables: dict[str, Any], contact: str) -> str:
    """Bearing set at a contact of rings or spacers, identified by the letter that their names share."""
    letters = {name[0].upper() for name in contact.split("|")}
    return next(s["name"] for s in tables["bearing_set"] if s["name"][0].upper() in letters)


def assemble(tables: dict[str, Any], longest: float = 0.006) -> Meridian:
    """Operators of a machine; ``longest`` edge of an element, m. Outer seats of each set are a group."""
    b = _Builder(tables, longest)
    bearings = [(s["name"], one["name"]) for s in tables["bearing_set"] for one in s["bearing"]]
    size = b.count + len(bearings)
    conduction, capacity = b.solid(size)
    none = np.zeros(size)
    exchange = {key: (matrix, none) for key, matrix in _joints(b, size).items()}
    place = {}
    for surface in tables["surface"]:
        area = b.spread(size, *b.surface(surface["name"]))
        place[surface["name"]] = area / area.sum()
    for film in tables["film"]:
        area = sum(b.spread(size, *b.surface(name)) for name in film["surface"])
        exchange[f"film:{film['name']}"] = (sparse.diags(area).tocsc(), area)
    for gap in tables["gap"]:
        total = sparse.csc_matrix((size, size))
        facing = {
            int(k): e["nodes"][:, n]
            for name in gap["standing"]
            for e in b.surface(name)
            for n, k in enumerate(e["k"])
        }
        for e in b.surface(gap["rotating"]):
            for n, k in enumerate(e["k"]):
                if int(k) in facing:
                    total = total + _between(e["nodes"][:, n], facing[int(k)], e["areas"][:, n], size)
        exchange[f"gap:{gap['name']}"] = (total, none)
    for ring_set in tables["bearing_set"]:
        row = ring_set["ball_row"]
        matrix = sparse.csc_matrix((size, size))
        for one in ring_set["bearing"]:
            node = b.count + bearings.index((ring_set["name"], one["name"]))
            capacity[node] = value(row["capacity"])
            for ring, facing in (("inner", "outward"), ("outer", "inward")):
                e = b.edges(b.names.index(f"{one['name']}.{ring}_ring"), facing)
                free = e["beside"] < 0
                area = np.zeros(size)
                np.add.at(area, e["nodes"][:, free].ravel(), e["areas"][:, free].ravel())
                place[f"{one['name']}.{ring}"] = area / area.sum()
                at = np.flatnonzero(area)
                matrix = matrix + _between(at, np.full(at.size, node), (area / area.sum())[at], size)
        exchange[f"balls:{ring_set['name']}"] = (matrix, none)
    probes = {p["name"]: _read(b, p, size) for p in tables["probe"]}
    return Meridian(conduction, capacity, exchange, place, probes)


def _read(b: _Builder, probe: dict[str, Any], size: int) -> Array:
    """(n,) weights that interpolate within the probe's part."""
    part = b.names.index(probe["part"])
    r, z = value(probe["r"]), value(probe["z"])
    at = np.zeros(size)
    for i in np.flatnonzero((b.r[:-1] <= r + SLACK) & (b.r[1:] >= r - SLACK)):
        for k in np.flatnonzero((b.z[:-1] <= z + SLACK) & (b.z[1:] >= z - SLACK)):
            if b.part[i, k] != part:
                continue
            x = np.clip((r - b.r[i]) / (b.r[i + 1] - b.r[i]), 0.0, 1.0)
            y = np.clip((z - b.z[k]) / (b.z[k + 1] - b.z[k]), 0.0, 1.0)
            for a, wa in ((0, 1.0 - x), (1, x)):
                for c, wc in ((0, 1.0 - y), (1, y)):
                    at[b.index[part, i + a, k + c]] += wa * wc
            return at
    raise ValueError(f"probe {probe['name']} lies outside {probe['part']}")
