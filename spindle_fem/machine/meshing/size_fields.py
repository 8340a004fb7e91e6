"""Element sizes handed to gmsh: at the corners of the model, and graded around tight places."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.geometry.channel_geometry import PortGeometry
from spindle_fem.machine.geometry.meridian import MeridianMap
from spindle_fem.machine.meshing.classify_faces import EXACT, port_coordinates
from spindle_fem.machine.meshing.sizes import CLEARANCE_SHARE, MeshSizes, edge_sizes

# A wall is tight when it needs sizes below this share of the channel's.
_TIGHT = 0.7
# Growth of size per distance between corners of the meridian section.
_CORNER_GROWTH = 0.8


def set_sizes(assembly: AssemblyGeometry, sizes: MeshSizes, clearance_share: float = CLEARANCE_SHARE) -> None:
    """Give the open model its sizes; gmsh carries those of corners inwards."""
    import gmsh

    wanted: dict[tuple[int, int], float] = {}
    for edge, size in zip(assembly.edges, edge_sizes(assembly, sizes, clearance_share), strict=True):
        for z, r in ((edge.z[0], edge.r[0]), (edge.z[1], edge.r[1])):
            key = _micrometres(z, r)
            wanted[key] = min(wanted.get(key, size), size)
    wanted = _graded(wanted)
    tags = [tag for _, tag in gmsh.model.getEntities(0)]
    points = np.array([gmsh.model.getValue(0, tag, []) for tag in tags]).reshape(-1, 3)
    radius = np.hypot(points[:, 0], points[:, 1])
    chosen = np.array(
        [wanted.get(_micrometres(z, r), sizes.channel) for z, r in zip(points[:, 2], radius, strict=True)]
    )
    fields = []
    if assembly.channel is not None:
        walls = _Walls(assembly)
        inner, outer = assembly.channel.definition.inner_radius, assembly.channel.outer_radius
        own = (np.abs(radius - inner) < EXACT) | (np.abs(radius - outer) < EXACT)
        own &= np.array([_micrometres(z, r) not in wanted for z, r in zip(points[:, 2], radius, strict=True)])
        chosen[own] = np.minimum(chosen[own], sizes.wall_edges * walls.thickness(points[own, 2], radius[own]))
        for port in assembly.channel.ports:
            fine = port_size(port, assembly, sizes)
            along, across, axial = port_coordinates(port, points)
            near = (along > 0.99 * port.start_radius) & (np.hypot(across, axial) < 1.05 * port.radius)
            chosen[near] = np.minimum(chosen[near], fine)
            fields.append(_around_port(port, fine, sizes))
        fields.extend(_at_tight_walls(assembly, sizes, walls))
    for tag, size in zip(tags, chosen.tolist(), strict=True):
        gmsh.model.mesh.setSize([(0, tag)], size)
    if fields:
        smallest = gmsh.model.mesh.field.add("Min")
        gmsh.model.mesh.field.setNumbers(smallest, "FieldsList", fields)
        gmsh.model.mesh.field.setAsBackgroundMesh(smallest)


def port_size(port: PortGeometry, assembly: AssemblyGeometry, sizes: MeshSizes) -> float:
    """Edge length around a port, m.

    Its circle in segments, and no edge so long that its sagitta h² / 8 r would
    flatten elements on the strip that the port leaves of the channel's end.
    """
    strip = 0.5 * assembly.channel.definition.width - port.radius
    return min(
        2.0 * np.pi * port.radius / sizes.port_segments, float(np.sqrt(8.0 * port.radius * 0.1 * strip))
    )


def _graded(wanted: dict[tuple[int, int], float]) -> dict[tuple[int, int], float]:
    """Sizes at meridian corners, none much larger than a neighbour's for the distance between them."""
    places = 1e-6 * np.array(list(wanted), dtype=np.float64)
    sizes = np.array(list(wanted.values()))
    distance = np.linalg.norm(places[:, None] - places[None], axis=2)
    graded = (sizes[None] + _CORNER_GROWTH * distance).min(axis=1)
    return dict(zip(wanted, graded.tolist(), strict=True))


def _micrometres(z: float, r: float) -> tuple[int, int]:
    return round(z * 1e6), round(r * 1e6)


class _Walls:
    """Distance in the meridian plane from places in the channel's part to its outside."""

    def __init__(self, assembly: AssemblyGeometry) -> None:
        part = assembly.part_names.index(assembly.channel.definition.part)
        boxes, owner = MeridianMap.of_parts(assembly.parts, (), []).cell_boxes()
        self._foreign = boxes[owner != part] * 1e-9

    def thickness(self, z: NDArray[np.float64], r: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) distances, m."""
        low_z, high_z, low_r, high_r = self._foreign.T
        axial = np.maximum(0.0, np.maximum(low_z - z[:, None], z[:, None] - high_z))
        radial = np.maximum(0.0, np.maximum(low_r - r[:, None], r[:, None] - high_r))
        return np.hypot(axial, radial).min(axis=1)


def _around_port(port: PortGeometry, fine: float, sizes: MeshSizes) -> int:
    """Field that lets sizes grow steadily away from a drilling."""
    bulk = max(sizes.part.values())
    x, y = port.direction
    start = port.start_radius - port.radius
    reach = port.radius + (bulk - fine) / sizes.growth
    return _field(
        "Frustum",
        X1=x * start,
        Y1=y * start,
        Z1=port.z,
        X2=x * port.end_radius,
        Y2=y * port.end_radius,
        Z2=port.z,
        InnerR1=port.radius,
        InnerR2=port.radius,
        OuterR1=reach,
        OuterR2=reach,
        InnerV1=fine,
        InnerV2=fine,
        OuterV1=bulk,
        OuterV2=bulk,
    )


def _at_tight_walls(assembly: AssemblyGeometry, sizes: MeshSizes, walls: _Walls) -> list[int]:
    """Fields that refine both sides of walls much thinner than the elements, where the helix nears a face."""
    channel = assembly.channel
    definition = channel.definition
    bulk = max(sizes.part.values())
    fields = []
    for start in channel.start_angles:
        for side in (-0.5, 0.5):
            angle = 0.0
            while angle <= abs(channel.angle_span):
                z = definition.z_start + definition.pitch * angle / (2.0 * np.pi) + side * definition.width
                radii = np.linspace(definition.inner_radius, channel.outer_radius, 3)
                thickness = float(walls.thickness(np.full(3, z), radii).min())
                size = sizes.wall_edges * thickness
                if size < _TIGHT * sizes.channel:
                    theta = start + np.sign(channel.angle_span) * angle
                    number = max(1, int(np.ceil(definition.depth / (2.0 * size))))
                    for r in definition.inner_radius + definition.depth * (np.arange(number) + 0.5) / number:
                        fields.append(
                            _field(
                                "Ball",
                                XCenter=-r * np.sin(theta),
                                YCenter=r * np.cos(theta),
                                ZCenter=z,
                                Radius=max(size, 1.5 * thickness),
                                Thickness=(bulk - size) / sizes.growth,
                                VIn=size,
                                VOut=bulk,
                            )
                        )
                angle += 1.5 * min(size, sizes.channel) / channel.outer_radius
    return fields


def _field(kind: str, **values: float) -> int:
    import gmsh

    tag = gmsh.model.mesh.field.add(kind)
    for name, value in values.items():
        gmsh.model.mesh.field.setNumber(tag, name, float(value))
    return tag
