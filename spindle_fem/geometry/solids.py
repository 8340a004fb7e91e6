"""OpenCASCADE solids of an assembly, in pygmsh's occ layer with the gmsh API beside it.

All parts are revolved together from meridian faces that share their lines, so
neighbours share faces from the start and no Boolean fragmentation is needed.
The channel is swept in quarter turns, through sections of the exact helix, and
sewn: short pieces keep the Boolean operations local (a sweep of all turns in
one face took 12 s to cut, quarter turns 0.3 s).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from spindle_fem.errors import GeometryError
from spindle_fem.geometry.assembly import AssemblyGeometry
from spindle_fem.geometry.channel import ChannelGeometry

if TYPE_CHECKING:
    from pygmsh.occ import Geometry

SECTIONS_PER_TURN = 24
PIECES_PER_TURN = 4


@dataclass(frozen=True, slots=True)
class SolidModel:
    """The solids inside an open gmsh model.

    Attributes
    ----------
    volume_of_part : mapping of str to int
        gmsh tag of each part's volume.
    volume : mapping of str to float, [m³]
    """

    volume_of_part: Mapping[str, int]
    volume: Mapping[str, float]


@contextmanager
def gmsh_session(threads: int = 1) -> Iterator[Geometry]:
    """A pygmsh occ environment with gmsh's defaults, silent, and closed afterwards."""
    import gmsh
    import pygmsh

    with pygmsh.occ.Geometry() as geometry:
        # A configuration file of the user would change meshes behind our back.
        gmsh.option.restoreDefaults()
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.AbortOnError", 2)
        gmsh.option.setNumber("General.NumThreads", threads)
        gmsh.option.setNumber("Geometry.OCCParallel", 1 if threads > 1 else 0)
        yield geometry


def build_solids(assembly: AssemblyGeometry, geometry: Geometry) -> SolidModel:
    """Make one volume a part in the open session, neighbours sharing their faces.

    Parameters
    ----------
    assembly : AssemblyGeometry
    geometry : pygmsh.occ.Geometry
        Open environment, see :func:`gmsh_session`.

    Returns
    -------
    SolidModel

    Raises
    ------
    GeometryError
        The CAD kernel gave no single solid for a part.
    """
    import gmsh

    kernel = gmsh.model.occ
    volumes = _revolve_parts(assembly, geometry)
    if assembly.channel is not None:
        part = assembly.channel.definition.part
        tool = _channel_tool(assembly.channel, geometry)
        result, _ = kernel.cut([(3, volumes[part])], tool)
        solids = [tag for dimension, tag in result if dimension == 3]
        if len(solids) != 1:
            raise GeometryError(
                "channel",
                f'cutting it leaves part "{part}" in {len(solids)} solids.',
                "Allowed: a channel with metal on every side.",
            )
        volumes[part] = solids[0]
    geometry.synchronize()
    _remove_construction(volumes.values())
    return SolidModel(volumes, {name: kernel.getMass(3, tag) for name, tag in volumes.items()})


def _remove_construction(volumes: Iterable[int]) -> None:
    """Delete points, wires and section faces that bound no volume."""
    import gmsh

    kept = {(3, tag) for tag in volumes}
    for dimension in (3, 2, 1):
        layer = [entity for entity in kept if entity[0] == dimension]
        kept.update((d, abs(tag)) for d, tag in gmsh.model.getBoundary(layer, combined=False, oriented=False))
    for dimension in (3, 2, 1, 0):
        unused = [entity for entity in gmsh.model.occ.getEntities(dimension) if entity not in kept]
        if unused:
            gmsh.model.occ.remove(unused)
    gmsh.model.occ.synchronize()


def export_step(assembly: AssemblyGeometry, path: str | Path) -> Path:
    """Write the solid model in mm, balls as spheres included, as STEP.

    Parameters
    ----------
    assembly : AssemblyGeometry
    path : str or Path
        Ends in .step or .stp.

    Returns
    -------
    Path

    Raises
    ------
    GeometryError
        Another suffix.
    """
    import gmsh

    path = Path(path)
    if path.suffix.lower() not in (".step", ".stp"):
        raise GeometryError(str(path), f'suffix "{path.suffix}".', "Allowed: .step, .stp.")
    with gmsh_session() as geometry:
        solids = build_solids(assembly, geometry)
        kernel = gmsh.model.occ
        names = {tag: name for name, tag in solids.volume_of_part.items()}
        for row in assembly.balls:
            for index in range(row.ball_count):
                angle = 2.0 * math.pi * index / row.ball_count
                ball = geometry.add_ball(
                    [-row.pitch_radius * math.sin(angle), row.pitch_radius * math.cos(angle), row.z],
                    0.5 * row.ball_diameter,
                )
                names[ball.dim_tag[1]] = f"{row.name}.ball_{index + 1}"
        kernel.dilate([(3, tag) for tag in names], 0.0, 0.0, 0.0, 1.0e3, 1.0e3, 1.0e3)
        geometry.synchronize()
        for tag, name in names.items():
            gmsh.model.setEntityName(3, tag, name)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.write(str(path))
    return path


def _revolve_parts(assembly: AssemblyGeometry, geometry: Geometry) -> dict[str, int]:
    """One volume a part; the compound of meridian faces is revolved in one go."""
    import gmsh

    kernel = gmsh.model.occ
    points: dict[tuple[float, float], object] = {}

    def point(z: float, r: float) -> object:
        if (z, r) not in points:
            points[z, r] = geometry.add_point([0.0, r, z])
        return points[z, r]

    # Lines run along +z or +r; a part's boundary keeps its metal on the left,
    # seen with z to the right and r upwards.
    outgoing: dict[str, dict[tuple[float, float], tuple[tuple[float, float], object]]] = defaultdict(dict)
    for edge in assembly.edges:
        low, high = (edge.z[0], edge.r[0]), (edge.z[1], edge.r[1])
        line = geometry.add_line(point(*low), point(*high))
        for part, facing in zip(edge.parts, edge.facings, strict=True):
            if facing in ("inward", "rear"):
                outgoing[part][low] = (high, line)
            else:
                outgoing[part][high] = (low, -line)
    faces = []
    for part in assembly.part_names:
        loops = sorted(_closed_loops(outgoing[part]), key=lambda loop: loop[0])
        curve_loops = [geometry.add_curve_loop(lines) for _, lines in loops]
        faces.append(geometry.add_plane_surface(curve_loops[0], curve_loops[1:]).dim_tag)
    swept = kernel.revolve(faces, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0 * math.pi)
    volumes = [tag for dimension, tag in swept if dimension == 3]
    kernel.remove(faces, recursive=False)
    return dict(zip(assembly.part_names, volumes, strict=True))


def _closed_loops(
    outgoing: dict[tuple[float, float], tuple[tuple[float, float], object]],
) -> Iterator[tuple[tuple[float, float], list[object]]]:
    """Loops of directed lines with their lowest corner; the outer one has the lowest of all."""
    remaining = dict(outgoing)
    while remaining:
        corner = min(remaining)
        lowest, lines = corner, []
        while corner in remaining:
            corner, line = remaining.pop(corner)
            lines.append(line)
        yield lowest, lines


def _channel_tool(channel: ChannelGeometry, geometry: Geometry) -> list[tuple[int, int]]:
    """Solids to cut away: every start, fused with its ports."""
    import gmsh

    kernel = gmsh.model.occ
    tools = [(3, _sweep(channel, angle, geometry)) for angle in channel.start_angles]
    if not channel.ports:
        return tools
    ports = []
    for port in channel.ports:
        x, y = port.direction
        length = port.end_radius - port.start_radius
        cylinder = geometry.add_cylinder(
            [x * port.start_radius, y * port.start_radius, port.z], [x * length, y * length, 0.0], port.radius
        )
        ports.append(cylinder.dim_tag)
    per_start = len(ports) // len(tools)
    fused = []
    for index, tool in enumerate(tools):
        result, _ = kernel.fuse([tool], ports[index * per_start : (index + 1) * per_start])
        fused.extend(result)
    return fused


def _sweep(channel: ChannelGeometry, start_angle: float, geometry: Geometry) -> int:
    """Volume of one start: quarter turns through sections of the helix, sewn."""
    import gmsh

    kernel = gmsh.model.occ
    definition = channel.definition
    pieces = math.ceil(definition.turns * PIECES_PER_TURN - 1.0e-9)
    per_piece = max(3, math.ceil(SECTIONS_PER_TURN * definition.turns / pieces - 1.0e-9))
    corners = (
        (definition.inner_radius, -0.5),
        (channel.outer_radius, -0.5),
        (channel.outer_radius, 0.5),
        (definition.inner_radius, 0.5),
    )

    def section(station: float) -> int:
        angle = start_angle + channel.angle_span * station
        z = definition.z_start + definition.pitch * definition.turns * station
        points = [
            geometry.add_point([-r * math.sin(angle), r * math.cos(angle), z + side * definition.width])
            for r, side in corners
        ]
        lines = [geometry.add_line(points[index], points[(index + 1) % 4]) for index in range(4)]
        return kernel.addWire([line._id for line in lines])

    skin = []
    for piece in range(pieces):
        wires = [section((piece + step / per_piece) / pieces) for step in range(per_piece + 1)]
        solid = kernel.addThruSections(wires, makeSolid=True, makeRuled=False, continuity="C2")
        sides = kernel.getSurfaceLoops(solid[0][1])[1][0]
        kernel.remove(solid)
        # OpenCASCADE lists the four sides first, then both ends.
        skin.extend(sides[:4])
        if piece == 0:
            skin.append(sides[4])
        if piece == pieces - 1:
            skin.append(sides[5])
    return kernel.addVolume([kernel.addSurfaceLoop(skin, sewing=True)])
