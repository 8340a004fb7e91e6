"""What deviations that drawings and mounting leave open change of the operators of a finite-element model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.tolerances import TolerancedLength
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.moved_faces import MovableMesh, MovedChannel, MovedFace
from spindle_fem.model.reduced.mesh_model import MeshModel, build_mesh_model
from spindle_fem.operation.facet_centres import facet_centres
from spindle_fem.operation.gap_bands import angle_of
from spindle_fem.solvers.prepared_machine import PreparedMachine, machine_on_mesh

Array = NDArray[np.float64]

# Heat capacity of steel, in which added masses are expressed, J/(kg K).
STEEL = 470.0
# Difference where the mesh moves, this share of a standard deviation: a thousandth off, far from round-off.
STEP = 1e-3
# Beginning of the names of heat capacities of materials, in a model's storage and of directions.
CAPACITY = "capacity."
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
class MoreCapacity:
    """A material that holds as much heat again."""

    material: str

    def difference(self, full: FullMachine, sigma: float) -> Difference:
        """Its own part of the storage."""
        names = full.model.storage_names
        own = CAPACITY + self.material
        return Difference({"storage": _only(names, own, full.model.storage[names.index(own)])})


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
