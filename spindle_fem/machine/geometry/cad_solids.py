"""OpenCASCADE solids of an assembly, in pygmsh's occ layer with the gmsh API beside it.

All parts are revolved together from meridian faces that share their lines, so
neighbours share faces from the start and no Boolean fragmentation is needed.
The channel is swept in quarter turns, through sections of the exact helix, and
sewn; short pieces keep the Boolean operations at the ports local.
"""

from __future__ import annotations

import math
import os
import threading
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from spindle_fem.errors import GeometryError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.geometry.channel_geometry import ChannelGeometry, PortGeometry

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
    # Threads of the mesher that wait by spinning starve one another on busy
    # cores (twice the processor time was measured); read when gmsh is loaded.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    import gmsh
    import pygmsh

    with _opened(pygmsh.occ.Geometry()) as geometry:
        # A configuration file of the user would change meshes behind our back.
        gmsh.option.restoreDefaults()
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.AbortOnError", 2)
        gmsh.option.setNumber("General.NumThreads", threads)
        gmsh.option.setNumber("Geometry.OCCParallel", 1 if threads > 1 else 0)
        yield geometry


@contextmanager
def _opened(geometry: Geometry) -> Iterator[Geometry]:
    """The environment; in a worker's thread without gmsh's handler of interrupts, which is the main one's."""
    if threading.current_thread() is threading.main_thread():
        with geometry:
            yield geometry
        return
    import gmsh

    gmsh.initialize([], interruptible=False)
    gmsh.model.add("pygmsh model")
    try:
        yield geometry
    finally:
        geometry.__exit__()


def build_solids(assembly: AssemblyGeometry, geometry: Geometry) -> SolidModel:
    """Make one volume a part in the open session, neighbours sharing their faces.

    Parameters
    ----------
    geometry : pygmsh.occ.Geometry
        Open environment, see :func:`gmsh_session`.

    Raises
    ------
    GeometryError
        The CAD kernel gave no single solid for a part.
    """
    import gmsh

    kernel = gmsh.model.occ
    revolved = _revolve_parts(assembly, geometry)
    shells = {name: [_skin(tag)] for name, tag in revolved.items()}
    order = list(assembly.part_names)
    drilled = None
    if assembly.channel is not None:
        part = assembly.channel.definition.part
        shells[part] = _cut_channel(assembly.channel, revolved.pop(part), geometry)
        order.remove(part)
        order.insert(0, part)
        drilled = part if assembly.channel.ports else None
    # Closing a volume repairs its faces, which makes new ones of all cylinders:
    # neighbours that come later take those over, so that both still share them.
    kernel.remove([(3, tag) for tag in revolved.values()])
    renewed: dict[int, int] = {}
    volumes = {}
    for name in order:
        loops = [[renewed.get(tag, tag) for tag in shell] for shell in shells[name]]
        sew = name == drilled
        volumes[name] = kernel.addVolume([kernel.addSurfaceLoop(loop, sewing=sew) for loop in loops])
        renewed.update(_renewed_faces([tag for loop in loops for tag in loop], volumes[name]))
    geometry.synchronize()
    _remove_construction(volumes.values())
    _require_solids(volumes, assembly)
    return SolidModel(
        {name: volumes[name] for name in assembly.part_names},
        {name: kernel.getMass(3, volumes[name]) for name in assembly.part_names},
    )


def _renewed_faces(before: list[int], volume: int) -> dict[int, int]:
    """Replacement of each face of the volume that a Boolean operation removed, matched by boundary curves."""
    after = set(_skin(volume))
    fresh = {frozenset(_curves(tag)): tag for tag in after.difference(before)}
    return {
        tag: fresh[curves]
        for tag in set(before).difference(after)
        if (curves := frozenset(_curves(tag))) in fresh
    }


def _require_solids(volumes: Mapping[str, int], assembly: AssemblyGeometry) -> None:
    """Parts in contact share faces, and no solid is inside out."""
    import gmsh

    shared = sum(len(gmsh.model.getAdjacencies(2, tag)[0]) == 2 for _, tag in gmsh.model.getEntities(2))
    contacts = sum(edge.is_contact for edge in assembly.edges)
    if shared != contacts:
        raise GeometryError(
            "solids",
            f"{shared} faces are shared between parts instead of {contacts}.",
            "Report this machine: the CAD kernel lost a contact.",
        )
    for name, tag in volumes.items():
        if gmsh.model.occ.getMass(3, tag) <= 0.0:
            raise GeometryError(f'part "{name}"', "its solid has no volume.", "Report this machine.")


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


def _revolve_parts(assembly: AssemblyGeometry, geometry: Geometry) -> dict[str, int]:
    """One volume per part; meridian faces are revolved as one compound so that neighbours share faces."""
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
    kernel.remove(faces)
    volumes = [tag for dimension, tag in swept if dimension == 3]
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


def _cut_channel(channel: ChannelGeometry, body: int, geometry: Geometry) -> list[list[int]]:
    """Shells of a body without its channel and ports.

    The skin of the channel is known, so it is put into the body as it is; a
    Boolean of both would intersect every wall with those of the next turn,
    which lie on the same cylinders (16 s for two starts of eight turns). Each
    drilling is made in two halves, one cut from the body and one fused with the
    channel, whose skins meet inside the metal.
    """
    import gmsh

    kernel = gmsh.model.occ
    sweeps = [(3, _sweep(channel, angle, geometry)) for angle in channel.start_angles]
    if not channel.ports:
        skins = [_skin(volume) for _, volume in ((3, body), *sweeps)]
        kernel.remove([(3, body), *sweeps])
        return skins
    outer_halves = [_drill(port, port.seam_radius, port.end_radius, geometry) for port in channel.ports]
    drilled, _ = kernel.cut([(3, body)], outer_halves)
    outside = _skin(drilled[0][1])
    kernel.remove(drilled)
    inside = []
    per_start = len(channel.ports) // len(sweeps)
    for index, sweep in enumerate(sweeps):
        ports = channel.ports[index * per_start : (index + 1) * per_start]
        inner_halves = [_drill(port, port.start_radius, port.seam_radius, geometry) for port in ports]
        wetted, _ = kernel.fuse([sweep], inner_halves)
        inside += _skin(wetted[0][1])
        kernel.remove(wetted)
    return [_without_seams(outside, channel) + _without_seams(inside, channel)]


def _skin(volume: int) -> list[int]:
    """Faces of a volume."""
    import gmsh

    return [int(tag) for loop in gmsh.model.occ.getSurfaceLoops(volume)[1] for tag in loop]


def _drill(port: PortGeometry, start: float, end: float, geometry: Geometry) -> tuple[int, int]:
    x, y = port.direction
    length = end - start
    return geometry.add_cylinder(
        [x * start, y * start, port.z], [x * length, y * length, 0.0], port.radius
    ).dim_tag


def _without_seams(skin: list[int], channel: ChannelGeometry) -> list[int]:
    """Faces without the discs that close the halves of the drillings."""
    import gmsh

    discs = {tag for tag in skin if any(_is_seam(tag, port) for port in channel.ports)}
    if len(discs) != len(channel.ports):
        raise GeometryError(
            "channel.ports",
            f"{len(discs)} of {len(channel.ports)} drillings end inside the metal.",
            "Allowed: ports with metal all around between channel and outside.",
        )
    gmsh.model.occ.remove([(2, tag) for tag in discs])
    return [tag for tag in skin if tag not in discs]


def _is_seam(tag: int, port: PortGeometry) -> bool:
    import gmsh

    x, y = port.direction
    centre = gmsh.model.occ.getCenterOfMass(2, tag)
    target = (x * port.seam_radius, y * port.seam_radius, port.z)
    return (
        math.dist(centre, target) < 1e-3 * port.radius
        and abs(gmsh.model.occ.getMass(2, tag) / (math.pi * port.radius**2) - 1.0) < 1e-6
    )


def _curves(tag: int) -> set[int]:
    import gmsh

    return {abs(int(curve)) for loop in gmsh.model.occ.getCurveLoops(tag)[1] for curve in loop}


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
