"""Deviations that drawings and mounting leave open on a machine with geometry, one direction each.

A direction names a quantity, how far it may be from the definition, and how a unit of it changes the
operators of the finite-element model.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.definition.machine_spec import AnnulusSegment, MachineSpec, Part
from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.definition.tolerances import DIAMETER_SHARE, PLACE, TolerancedLength, sigma_of
from spindle_fem.machine.geometry.joint_groups import group_of_contacts
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.moved_faces import MovableMesh, MovedChannel, MovedFace
from spindle_fem.model.reduced.mesh_model import MeshModel, build_mesh_model
from spindle_fem.operation.facet_centres import facet_centres
from spindle_fem.operation.gap_bands import angle_of
from spindle_fem.solvers.prepared_machine import PreparedMachine, machine_on_mesh

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
AIR_DIFFERENCE = 2.0
"""K by which air above a machine is warmer than below."""
# Heat capacity of steel, in which added masses are expressed, J/(kg K).
STEEL = 470.0
# Difference where the mesh moves, this share of a standard deviation: a thousandth off, far from round-off.
STEP = 1e-3


# Fields of a model that directions change, and heat of warmer fluids beside them.
WARMTH = "warmth"
FIELDS = (
    "operators",
    "fluid_load",
    "storage",
    "places",
    "probes",
    "cell_film",
    "cell_load",
    "cell_area",
    WARMTH,
)


@dataclass(frozen=True, slots=True)
class FullMachine:
    """Machine that directions change: its mesh, operators and displacements of faces."""

    machine: PreparedMachine
    model: MeshModel
    movable: MovableMesh


@dataclass(frozen=True, slots=True)
class Difference:
    """Change of a model for one unit of a direction.

    Attributes
    ----------
    fields : mapping of str to matrix or tuple of matrix
        By the name of the model's field, in its shape; ``WARMTH`` is (n_f, n), W for each W/(m²·K) of
        every film whose fluid is warmer.
    channel : mapping of str to float
        Change of keys of the channel, which its film follows.
    """

    fields: Mapping[str, Any]
    channel: Mapping[str, float] = field(default_factory=dict)


class Cause(Protocol):
    """Representation of a direction in the model."""

    def difference(self, full: FullMachine, sigma: float) -> Difference:
        """Change of the full model for one unit."""


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


# ----------------------------------------------------------------------- causes
@dataclass(frozen=True, slots=True)
class Moved:
    """Faces, or the walls of the channel, that are elsewhere by 1 m for a unit.

    Attributes
    ----------
    channel_keys : mapping of str to float
        What the definition of the channel would say, in m for a unit.
    """

    faces: tuple[MovedFace, ...] = ()
    channel: MovedChannel | None = None
    channel_keys: Mapping[str, float] = field(default_factory=dict)

    def difference(self, full: FullMachine, sigma: float) -> Difference:
        """Difference to the same elements with their nodes moved a little."""
        step = STEP * sigma
        return Difference(difference_of(self.moved(full, step), full.model, step), channel=self.channel_keys)

    def moved(self, full: FullMachine, amount: float) -> MeshModel:
        """Model with some units of the direction, on the same elements."""
        mesh = full.movable.moved(full.movable.displacement(self.faces, self.channel), amount)
        keys = {key: amount * value for key, value in self.channel_keys.items()}
        return moved_model(full, mesh, keys)


@dataclass(frozen=True, slots=True)
class FilmAlong:
    """A film better in some places along the channel than in others, in a cosine of some half waves."""

    half_waves: int

    def difference(self, full: FullMachine, sigma: float) -> Difference:
        """Cells whose area counts for more."""
        model = full.model
        starts, along = model.cell_area.shape
        share = np.cos(np.pi * self.half_waves * (np.arange(along) + 0.5) / along)
        share = share - (share * model.cell_area).sum() / model.cell_area.sum()
        cells = np.tile(share, starts)
        return Difference(
            {
                "cell_film": tuple(s * item for s, item in zip(cells, model.cell_film, strict=True)),
                "cell_load": sparse.diags_array(cells) @ model.cell_load,
                "cell_area": share * model.cell_area,
            }
        )


@dataclass(frozen=True, slots=True)
class AddedMass:
    """Steel on a surface that follows its temperature, kg."""

    surface: str

    def difference(self, full: FullMachine, sigma: float) -> Difference:
        """Capacity spread over the surface."""
        model, machine = full.model, full.machine
        part = machine.mesh.part_of_surface[self.surface]
        material = machine.spec.part_material(part)
        key = next(k for k, item in machine.spec.materials.items() if item is material)
        operators = machine.operators
        film = _widened(operators.film_matrix(self.surface), model.size)
        unit = STEEL / (machine.volumetric_capacity[part] * operators.surface_area(self.surface))
        return Difference({"storage": _only(model.storage_names, f"capacity.{key}", unit * film)})


@dataclass(frozen=True, slots=True)
class ContactShare:
    """Contacts that conduct better by a share, which may follow the angle around the axis.

    Attributes
    ----------
    way : {"even", "up", "across"}
        Uniform, as the cosine of the angle from above, or as its sine.
    """

    contacts: tuple[str, ...]
    way: str = "even"

    def difference(self, full: FullMachine, sigma: float) -> Difference:
        """Contacts with their share of conductance on each facet."""
        model, mesh = full.model, full.machine.mesh
        found = dict.fromkeys(model.coefficient_names, sparse.csr_array((model.size, model.size)))
        for contact in self.contacts:
            angle = angle_of(facet_centres(mesh.points, mesh.joints[contact].facets_a))
            share = {"even": np.ones_like, "up": np.cos, "across": np.sin}[self.way](angle)
            matrix = full.machine.operators.joint_matrix(contact, share)
            found[f"joint.{contact}"] = _widened(matrix, model.size)
        return Difference({"operators": tuple(found.values())})


@dataclass(frozen=True, slots=True)
class WarmAbove:
    """Air that is warmer above than below by 1 K for a unit, around some surfaces with films."""

    surfaces: tuple[str, ...]

    def difference(self, full: FullMachine, sigma: float) -> Difference:
        """Heat from air whose excess follows the height, from -1/2 to 1/2 K."""
        operators, mesh = full.machine.operators, full.machine.mesh
        highest = max(mesh.points[mesh.surfaces[name], 1].max() for name in self.surfaces)
        warmth = np.zeros_like(full.model.fluid_load)
        for name in self.surfaces:
            height = facet_centres(mesh.points, mesh.surfaces[name])[:, 1] / (2.0 * highest)
            row = full.model.fluid_names.index(f"film.{name}")
            warmth[row, : operators.n_unknowns] = operators.facet_vector(height, operators.surface_rows[name])
        return Difference({WARMTH: warmth})


# ------------------------------------------------------------------ differences
def moved_model(full: FullMachine, mesh: TaggedMesh, channel: Mapping[str, float]) -> MeshModel:
    """Model of a machine on the same elements with their nodes elsewhere, and its channel's keys changed."""
    spec = with_channel(full.machine.spec, channel)
    # The mesh no longer measures what the solid model does, on purpose.
    operators = build_operators(mesh, 1, area_tolerance=np.inf)
    # Temperatures are weighed for the growth of seats as before; what a sensor of displacement sees is not.
    growth_of = None if spec.displacement_sensor else full.model
    return build_mesh_model(machine_on_mesh(spec, mesh, operators), growth_of)


def with_channel(spec: MachineSpec, changes: Mapping[str, float]) -> MachineSpec:
    """A machine with keys of its channel changed by some m."""
    if not changes:
        return spec
    keys = {}
    for key, change in changes.items():
        own = getattr(spec.channel, key)
        keys[key] = TolerancedLength(own + change, getattr(own, "sigma", None))
    return spec.model_copy(update={"channel": spec.channel.model_copy(update=keys)})


def difference_of(above: MeshModel, below: MeshModel, distance: float) -> dict[str, Any]:
    """Difference of every field of two models that directions change, over a distance."""
    found: dict[str, Any] = {}
    for name in FIELDS[:-1]:
        one, other = getattr(above, name), getattr(below, name)
        if isinstance(one, tuple):
            found[name] = tuple((a - b) / distance for a, b in zip(one, other, strict=True))
        else:
            found[name] = (one - other) / distance
    return found


def _only(names: Sequence[str], name: str, matrix: sparse.csr_array) -> tuple[sparse.csr_array, ...]:
    nothing = sparse.csr_array(matrix.shape)
    return tuple(matrix if own == name else nothing for own in names)


def _widened(matrix: sparse.csr_array, size: int) -> sparse.csr_array:
    entries = matrix.tocoo()
    return sparse.coo_array((entries.data, entries.coords), shape=(size, size)).tocsr()


# ------------------------------------------------------------- what is left open
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
