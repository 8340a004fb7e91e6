"""Deviations that drawings and mounting leave open on a machine with geometry, one direction each.

A direction names a quantity, how far it may be from the definition, and the cause by which a unit of it
changes the operators of the finite-element model.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import AnnulusSegment, MachineSpec, Part
from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.definition.tolerances import DIAMETER_SHARE, PLACE, sigma_of
from spindle_fem.machine.geometry.joint_groups import group_of_contacts
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.mesh.moved_faces import MovedChannel, MovedFace
from spindle_fem.model.reduced.structural_causes import (
    CAPACITY,
    AddedMass,
    Cause,
    ContactShare,
    FilmAlong,
    MoreCapacity,
    Moved,
    WarmAbove,
)

Array = NDArray[np.float64]

# One standard deviation of quantities that no length represents.
FILM_ALONG, FILM_MODES = 0.10, 3
"""Share of the channel's film in each smooth mode along it."""
MASS_SHARE = 0.05
"""Mass on an outer surface, of that of its part."""
RIM_SHARE = 0.30
"""Share by which a joint conducts better on one side of the rim than on average."""
CONTACT_SHARE = 0.30
"""Share by which one contact between standing parts differs from its group."""
CAPACITY_SHARE = 0.02
"""Share by which the heat capacity of a steel or an iron of one name varies with composition."""
AIR_DIFFERENCE = 2.0
"""K by which air above a machine is warmer than below."""


@dataclass(frozen=True, slots=True)
class StructuralDirection:
    """One quantity that may differ from the definition.

    Attributes
    ----------
    name : str
        Unique for a machine.
    key : str
        Key of the definition; words if there is none.
    unit : str
    sigma : float
        One standard deviation, in ``unit``.
    statement : str
        What its value is, in words.
    cause : Cause or None
        None if it is only reported: its effect is already in a projected model.
    """

    name: str
    key: str
    unit: str
    sigma: float
    statement: str
    cause: Cause | None = None


def structural_directions(spec: MachineSpec, mesh: TaggedMesh) -> tuple[StructuralDirection, ...]:
    """Every direction of a machine on its mesh, in one order; those of no width are left out.

    Widths of lengths are the definition's ``sigma``, or else those of
    :mod:`spindle_fem.definition.tolerances`.
    """
    found = [
        *_diameters(spec, mesh),
        *_thicknesses(spec, mesh),
        *_channel(spec),
        *_contacts(spec, mesh),
        *_masses(spec, mesh),
        *_capacities(spec, mesh),
        *_air(spec),
    ]
    return tuple(item for item in found if item.sigma > 0.0)


def _exposed(part: Part, face: MovedFace, mesh: TaggedMesh) -> bool:
    """Whether the mesh has an exposed face there."""
    corners = mesh.points[: mesh.n_corners]
    radius, z = np.hypot(corners[:, 0], corners[:, 1]), corners[:, 2]
    along, across = (radius, z) if face.shape == "cylinder" else (z, radius)
    for name, facets in mesh.surfaces.items():
        if mesh.part_of_surface[name] == part.name:
            corner = facets[:, :3]
            middle = across[corner].mean(axis=1)
            there = np.abs(along[corner] - face.place).max(axis=1, initial=0.0) < 1e-7
            if np.any(there & (middle > face.extent[0]) & (middle < face.extent[1])):
                return True
    return False


def _outside(part: Part, segment: AnnulusSegment, distance: float) -> MovedFace:
    return MovedFace(part.name, "cylinder", segment.outer_diameter / 2.0, segment.z, distance)


def _diameters(spec: MachineSpec, mesh: TaggedMesh) -> Iterator[StructuralDirection]:
    """Outer diameters of stationary parts, together where the definition does not distinguish them."""
    for part in (item for item in spec.part if not item.rotating):
        shared = []
        largest = max(segment.outer_diameter for segment in part.segment)
        for segment in part.segment:
            if not _exposed(part, _outside(part, segment, 0.5), mesh):
                continue
            key = f"part.{part.name}.segment.{segment.name}.outer_diameter"
            sigma = sigma_of(segment.outer_diameter, np.nan)
            if np.isnan(sigma):
                shared.append(_outside(part, segment, 0.5 * segment.outer_diameter / largest))
            else:
                yield StructuralDirection(
                    f"{part.name}.{segment.name}.outer_diameter",
                    key,
                    "m",
                    sigma,
                    f"outer diameter of {part.name} {segment.name} beyond the definition",
                    Moved((_outside(part, segment, 0.5),)),
                )
        if shared:
            yield StructuralDirection(
                f"{part.name}.outer_diameter",
                f"part.{part.name}.segment.outer_diameter",
                "m",
                DIAMETER_SHARE * largest,
                f"outer diameter of {part.name} beyond the definition (at its widest, others in proportion)",
                Moved(tuple(shared)),
            )


def _thicknesses(spec: MachineSpec, mesh: TaggedMesh) -> Iterator[StructuralDirection]:
    """Thickness of the flange and of covers: the end that touches nothing moves."""
    layout = Layout(spec, set())
    for part in (item for item in spec.part if not item.rotating):
        for segment in part.segment:
            radii = (segment.inner_diameter / 2.0, segment.outer_diameter / 2.0)
            disc = part is not layout.housing or segment.name == layout.flange
            if not disc or layout.is_spacer(part) or segment.z[1] - segment.z[0] > radii[1]:
                continue
            for place, sign in ((segment.z[0], -1.0), (segment.z[1], 1.0)):
                face = MovedFace(part.name, "plane", place, radii, sign)
                other = segment.z[1] if sign < 0.0 else segment.z[0]
                behind = replace(face, place=other)
                if _exposed(part, face, mesh) and (
                    part is layout.housing or not _exposed(part, behind, mesh)
                ):
                    yield StructuralDirection(
                        f"{part.name}.{segment.name}.thickness",
                        f"part.{part.name}.segment.{segment.name}.z",
                        "m",
                        PLACE,
                        f"thickness of {part.name} {segment.name} beyond the definition",
                        Moved((face,)),
                    )
                    break


def _channel(spec: MachineSpec) -> Iterator[StructuralDirection]:
    """Place and section of the cooling channel, and its film along it."""
    channel = spec.channel
    if channel is None:
        return
    moves = (
        ("inner_radius", MovedChannel(1.0, 1.0), "radius at which the cooling channel lies"),
        ("depth", MovedChannel(0.0, 1.0), "radial depth of the cooling channel"),
        ("z_start", MovedChannel(axial=1.0), "distance by which the cooling channel lies further back"),
    )
    for key, move, words in moves:
        sigma = sigma_of(getattr(channel, key), PLACE)
        beyond = words if key == "z_start" else f"{words} beyond the definition"
        yield StructuralDirection(
            f"channel.{key}",
            f"channel.{key}",
            "m",
            sigma,
            beyond,
            Moved(channel=move, channel_keys={key: 1.0}),
        )
    for mode in range(1, FILM_MODES + 1):
        yield StructuralDirection(
            f"channel.film_along.{mode}",
            "coolant.film_factor",
            "",
            FILM_ALONG,
            "share by which the film at the inlet of the channel is better than its mean, "
            f"in {mode} half wave{'s' * (mode > 1)} along it",
            FilmAlong(mode),
        )


def _contacts(spec: MachineSpec, mesh: TaggedMesh) -> Iterator[StructuralDirection]:
    """Seats of outer rings that are tighter on one side, and contacts between standing parts."""
    groups = group_of_contacts(spec, mesh.joints)
    rings = {name: f"{name}.outer_ring" for _, bearing in spec.bearings for name in [bearing.name]}
    rotating = {part.name for part in spec.part if part.rotating}
    for group in spec.bearing_set:
        own = {rings[bearing.name] for bearing in group.bearing}
        seats = tuple(
            name
            for name, joint in groups.items()
            if not name.endswith(":face") and own & set(name.split("|")) and _conducts(joint)
        )
        for way, words in (("up", "above than on average"), ("across", "on one side than on average")):
            if seats:
                yield StructuralDirection(
                    f"joint.{group.name}.outer_seats.{way}",
                    f"joint.{groups[seats[0]].name}.conductance",
                    "",
                    RIM_SHARE,
                    f"share by which the outer rings of the {group.name} bearings conduct better {words}",
                    ContactShare(seats, way),
                )
    plain = {part.name for part in spec.part} - rotating
    for name, joint in groups.items():
        if set(name.removesuffix(":face").split("|")) <= plain and _conducts(joint):
            ends = " and ".join(name.removesuffix(":face").split("|"))
            yield StructuralDirection(
                f"joint.{name}",
                f"joint.{joint.name}.conductance",
                "",
                CONTACT_SHARE,
                f"share by which {ends} are joined better than the other contacts of {joint.name}",
                ContactShare((name,)),
            )


def _conducts(group: Any) -> bool:
    return group.conductance != "perfect" and group.conductance.value > 0.0


def _masses(spec: MachineSpec, mesh: TaggedMesh) -> Iterator[StructuralDirection]:
    """Steel on surfaces with a film of their own: tool holders, pulleys, what is screwed on."""
    for film in spec.film:
        if isinstance(film, StreamFilm):
            continue
        for surface in film.surface:
            part = mesh.part_of_surface[surface]
            mass = mesh.cad_volume[part] * spec.part_material(part).density
            yield StructuralDirection(
                f"mass.{surface}",
                f"mass on {surface}",
                "kg",
                MASS_SHARE * mass,
                f"mass of steel on {surface} that is not in the definition",
                AddedMass(surface),
            )


def _capacities(spec: MachineSpec, mesh: TaggedMesh) -> Iterator[StructuralDirection]:
    """Materials that hold more heat than the definition says."""
    parts = [spec.part_material(part) for part in mesh.cad_volume]
    for name, material in spec.materials.items():
        if any(item is material for item in parts):
            yield StructuralDirection(
                CAPACITY + name,
                f"materials.{name}.specific_heat_capacity",
                "",
                CAPACITY_SHARE,
                f"share by which {name} holds more heat",
                MoreCapacity(name),
            )


def _air(spec: MachineSpec) -> Iterator[StructuralDirection]:
    """Air, or what a film leads to, that is warmer above than below."""
    rotating = {part.name for part in spec.part if part.rotating}
    owner = {surface.name: surface.part for surface in spec.surface}
    for number, film in enumerate(spec.film):
        surfaces = tuple(name for name in film.surface if owner.get(name) not in rotating)
        if film.temperature == "ambient" and surfaces:
            name = film.name or f"film[{number + 1}]"
            yield StructuralDirection(
                f"air.{name}",
                f"temperature of the surroundings of film {name}",
                "K",
                AIR_DIFFERENCE,
                f"surroundings of {', '.join(surfaces)} warmer above than below",
                WarmAbove(surfaces),
            )
