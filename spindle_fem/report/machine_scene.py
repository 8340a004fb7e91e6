"""Scenes of machines: their solids with fields, their balls and probes; networks as nodes and links."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.drawn_tables import element_rows
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.network_tables import NetworkMachineSpec
from spindle_fem.errors import BadInputError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.report.drawn_surfaces import outer_faces
from spindle_fem.report.interactive_view import welded
from spindle_fem.report.viewed_scene import Layer, Scene, Sphere

Array = NDArray[np.float64]

PROBE_SHARE = 0.008  # radius of a probe as drawn, of the machine's length
NODE_SHARE = 0.05
_TETRAHEDRON = 24  # VTK's number of the quadratic one


@dataclass(frozen=True, slots=True)
class Solid:
    """Curved tetrahedra of a machine's parts.

    Attributes
    ----------
    points : (n, 3) ndarray, [m]
    tetrahedra : (e, 10) ndarray of int
    part : (e,) ndarray of int
    """

    points: Array
    tetrahedra: NDArray[np.int64]
    part: NDArray[np.int64]
    part_names: tuple[str, ...]

    @classmethod
    def of(cls, mesh: TaggedMesh) -> Solid:
        """Solid of a tagged mesh."""
        return cls(mesh.points, mesh.tetrahedra, mesh.part_of_element.astype(np.int64), mesh.part_names)

    @property
    def part_of_point(self) -> NDArray[np.int64]:
        """Part of every point, (n,): parts share none."""
        found = np.zeros(len(self.points), dtype=np.int64)
        found[self.tetrahedra] = self.part[:, None]
        return found


def read_run_fields(path: Path) -> tuple[Solid, Array]:
    """Solid and temperature (n,) °C of a run's ``fields.vtu``.

    Raises
    ------
    BadInputError
        There is no such file, or it is none of a run.
    """
    import pyvista as pv

    if not path.is_file():
        raise BadInputError(str(path), "there is no such file.", "Give the folder of a finished run.")
    try:
        grid = pv.read(path)
        tetrahedra = grid.cells_dict[_TETRAHEDRON].astype(np.int64)
        part = np.asarray(grid.cell_data["part_id"])[: len(tetrahedra)].astype(np.int64)
        temperature = np.asarray(grid.point_data["temperature_degC"], dtype=np.float64)
        numbered = {
            int(grid.field_data[name][0]): name.removeprefix("part.")
            for name in grid.field_data.keys()  # noqa: SIM118 - no mapping
            if name.startswith("part.")
        }
        names = tuple(numbered[number] for number in range(len(numbered)))
        points = np.asarray(grid.points, dtype=np.float64)
    except (KeyError, IndexError, ValueError, AttributeError, TypeError) as error:
        raise BadInputError(str(path), f"cannot be read ({error}).", "Run again to write it anew.") from error
    return Solid(points, tetrahedra, part, names), temperature


def solid_scene(
    solid: Solid,
    layers: Mapping[str, Array],
    times: Array | None = None,
    *,
    differences: Mapping[str, Array] | None = None,
    shift: Array | None = None,
    exaggeration: float = 1.0,
) -> Scene:
    """Scene of a solid whose cut can be moved.

    Parameters
    ----------
    layers : mapping of str to (t, n) ndarray, [degC]
        By the name to show; empty to show the machine grey.
    times : (t,) ndarray, optional, [s]
    differences : mapping of str to (t, n) ndarray, [K]
        Layers that are coloured about zero.
    shift : (n, 3) ndarray, optional, [m]
        Since assembly.
    """
    faces, face_part = outer_faces(solid.tetrahedra, solid.part)
    node, triangles, normals, part = welded(solid.points, faces, face_part.astype(np.int64))
    corners = solid.tetrahedra[:, :4]
    used = np.zeros(len(solid.points), dtype=bool)
    used[corners] = used[node] = True
    number = np.cumsum(used) - 1
    shown = [Layer(name, "°C", np.asarray(values)[:, used]) for name, values in layers.items()]
    shown += [
        Layer(name, "K", np.asarray(values)[:, used], difference=True)
        for name, values in (differences or {}).items()
    ]
    return Scene(
        points=solid.points[used],
        layers=tuple(shown),
        part_names=solid.part_names,
        vertex_point=number[node],
        normals=normals,
        triangles=triangles,
        triangle_part=part,
        tetrahedra=number[corners],
        tetrahedron_part=solid.part,
        times=np.zeros(0) if times is None else np.asarray(times, dtype=np.float64),
        shift=None if shift is None else shift[used],
        exaggeration=exaggeration,
    )


def bearing_balls(spec: MachineSpec, values: Mapping[str, Mapping[str, Array]]) -> tuple[Sphere, ...]:
    """Every ball and roller of every bearing.

    Parameters
    ----------
    values : mapping of str to mapping of str to (t,) ndarray
        By bearing, then by layer.
    """
    found = []
    for group, bearing in spec.bearings:
        for row in element_rows(bearing, spec.bearing_types[group.type_name(bearing)]):
            found += [
                Sphere(
                    np.array(place), 0.5 * row.ball_diameter, values.get(bearing.name, {}), length=row.length
                )
                for place in row.centres
            ]
    return tuple(found)


def probes_of(
    spec: MachineSpec, scene: Scene, values: Mapping[str, Mapping[str, Array]]
) -> tuple[Sphere, ...]:
    """Probes that read a point of a machine.

    Parameters
    ----------
    values : mapping of str to mapping of str to (t,) ndarray
        By probe, then by layer; probes without any stay away.
    """
    radius = PROBE_SHARE * float(np.ptp(scene.points, axis=0).max())
    return tuple(
        Sphere(
            np.array([-probe.r * np.sin(probe.angle), probe.r * np.cos(probe.angle), probe.z]),
            radius,
            values[probe.name],
            probe.name,
        )
        for probe in spec.probe
        if probe.kind == "point" and probe.name in values
    )


def network_scene(
    spec: NetworkMachineSpec,
    layers: tuple[Layer, ...],
    times: Array,
    values: Mapping[str, Mapping[str, Array]],
) -> Scene:
    """Scene of a network: nodes and boundaries apart as their links are, joined by lines.

    Parameters
    ----------
    layers : tuple of Layer
        Without values at points.
    values : mapping of str to mapping of str to (t,) ndarray
        By node, then by layer; what has none is grey.
    """
    names = [item.name for item in (*spec.network.node, *spec.network.boundary)]
    pairs = [(names.index(a), names.index(b)) for a, b in (link.between for link in spec.network.link)]
    flat = spread_out(len(names), pairs)
    places = np.column_stack([np.zeros(len(names)), flat[:, 1], flat[:, 0]])
    scene = Scene(points=places, layers=layers, times=times)
    radius = NODE_SHARE * float(max(np.ptp(flat, axis=0).max(), 1.0))
    return replace(
        scene,
        places=tuple(
            Sphere(place, radius, values.get(name, {}), name)
            for name, place in zip(names, places, strict=True)
        ),
        links=tuple((places[a], places[b]) for a, b in pairs),
    )


def spread_out(number: int, pairs: list[tuple[int, int]]) -> Array:
    """Places (number, 2) in a plane, as far apart as the fewest links between them (stress majorisation).

    Kamada and Kawai's springs, begun on a circle: equal graphs give equal pictures. Wide rather than tall.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import shortest_path

    ends = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (number, number)).tocsr()
    apart = shortest_path(graph, directed=False, unweighted=True)
    apart[~np.isfinite(apart)] = 1.0 + apart[np.isfinite(apart)].max()
    angle = 2.0 * np.pi * np.arange(number) / number
    # no two angles opposite each other: a symmetric start stays on its line
    places = np.column_stack([np.cos(angle), np.sin(angle + 0.1 * angle**2)])
    weight = 1.0 / np.maximum(apart, 1.0e-9) ** 2
    np.fill_diagonal(weight, 0.0)
    laplacian = np.diag(weight.sum(axis=1)) - weight
    inverse = np.linalg.pinv(laplacian)
    for _ in range(300):
        difference = places[:, None, :] - places[None, :, :]
        distance = np.linalg.norm(difference, axis=2)
        pull = np.where(distance > 1.0e-12, weight * apart / np.maximum(distance, 1.0e-12), 0.0)
        places = inverse @ ((np.diag(pull.sum(axis=1)) - pull) @ places)
    places = places - places.mean(axis=0)
    _, _, axes = np.linalg.svd(places, full_matrices=True)
    return places @ axes.T


def table_times(number: int, most: int) -> NDArray[np.int64]:
    """Indices of the rows to show: at most ``most``, evenly spread, first and last among them."""
    return np.unique(np.round(np.linspace(0, number - 1, min(number, most))).astype(np.int64))
