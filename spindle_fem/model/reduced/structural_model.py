"""A fast model that also responds to dimensions, places, films and masses that drawings leave open.

The basis of a fast model holds no fields of moved faces, and is costly to make again. This model has a
smaller one of its own, from the physical loads and from what each direction changes of their fields, on the
coarse mesh with linear temperatures: enough for derivatives.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from spindle_fem.cache import cache_directory, load_record, save_record, source_digest
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.term import Term
from spindle_fem.model.mesh.moved_faces import MovableMesh
from spindle_fem.model.reduced.build_reduced import SHIFTS, nominal_channel_film, physical_loads
from spindle_fem.model.reduced.class_operators import NO_CHANGES, ClassOperators
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.film_heat import film_heat_of, operators_machine
from spindle_fem.model.reduced.mesh_model import MeshModel, build_mesh_model
from spindle_fem.model.reduced.reduced_cache import reduced_digest
from spindle_fem.model.reduced.snapshots import Sample, SnapshotSpace
from spindle_fem.model.reduced.spindle_inputs import SpindleInputs
from spindle_fem.model.reduced.structural_causes import FIELDS, WARMTH, Difference, FullMachine, with_channel
from spindle_fem.model.reduced.structural_directions import StructuralDirection, structural_directions
from spindle_fem.model.reduced.unit_loads import coolant_loads, fluid_loads
from spindle_fem.model.thermal_model import ThermalModel, project
from spindle_fem.operation.coefficient_table import build_coefficient_table
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.parallel import in_copies, in_threads, thread_count
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine

Array = NDArray[np.float64]
Progress = Callable[[str], None]

FORMAT = "spindle-fem/structural-model/1"
# Whatever the machine's own: derivatives need no better.
COARSE = {"preset": "coarse", "order": 1, "size_factor": 1.0, "size": {}}
# Tolerance of the proper orthogonal decomposition, and largest number of vectors: what one standard deviation
# of each direction does to readings of the recorded spindle is within 1 to 4 mK of that with 160.
TOLERANCE, LARGEST = 2e-5, 110
# Fields of one direction that join the basis, for each frequency.
FIELDS_EACH = 4
# Shares of the highest speed at which the loads are solved, the usual one first, and each one's frequencies.
SPEEDS = ((0.5, SHIFTS), (0.0, SHIFTS[1:2]), (1.0, SHIFTS[1:2]))
# Entries of a difference below this share of the model's are round-off.
ROUND_OFF = 1e-9
# Share of a standard deviation over which the coolant's march is differenced.
DIFFERENCE = 1e-2


@dataclass(frozen=True, slots=True, kw_only=True)
class AffineChange:
    """Change of a projected model by one unit of a direction.

    Attributes
    ----------
    rows : mapping of str to (k,) int64 ndarray
        Of each field that changes, in the order of the model.
    values : mapping of str to (k, ...) ndarray
        What is added there.
    channel : mapping of str to float
        Change of keys of the channel, which its film follows.
    """

    rows: Mapping[str, NDArray[np.int64]]
    values: Mapping[str, Array]
    channel: Mapping[str, float]

    @property
    def moves_channel(self) -> bool:
        """Whether the way of the coolant, or its film, changes."""
        return bool(self.channel) or not self.rows.keys().isdisjoint(("cell_film", "cell_load", "cell_area"))

    def applied(self, model: ThermalModel, amount: float) -> ThermalModel:
        """The model with some units of the change."""
        changed = {}
        for name in self.rows.keys() - {WARMTH}:
            rows, old = self.rows[name], getattr(model, name)
            new = old.reshape(-1, *self.values[name].shape[1:]).copy()
            new[rows] += amount * self.values[name]
            changed[name] = new.reshape(old.shape)
        return replace(model, **changed)

    def warmth(self, model: ThermalModel) -> Iterator[tuple[str, Array]]:
        """Films whose fluid is warmer, with W on the unknowns for each W/(m²·K)."""
        if WARMTH in self.rows:
            for row, load in zip(self.rows[WARMTH].tolist(), self.values[WARMTH], strict=True):
                yield model.fluid_names[row], load


Projected = tuple[ThermalModel, dict[str, AffineChange], tuple[StructuralDirection, ...]]


class StructuralModel(FastModel):
    """A fast model whose runs may also be differentiated by its directions, by their names.

    Parameters
    ----------
    model : ThermalModel
    changes : mapping of str to AffineChange
        By direction.
    directions : sequence of StructuralDirection
    spec, extra_terms
        As :func:`spindle_fem.model.reduced.spindle_inputs.fast_spindle` takes them.
    """

    def __init__(
        self,
        model: ThermalModel,
        changes: Mapping[str, AffineChange],
        directions: Sequence[StructuralDirection],
        spec: MachineSpec,
        extra_terms: Sequence[Term] = (),
    ) -> None:
        inputs = SpindleInputs(model, spec, extra_terms)
        inputs.table = replace(inputs.table, names=(*inputs.table.names, *changes))
        super().__init__(model, inputs)
        self.changes, self.structural = dict(changes), tuple(directions)
        # Operators follow what a direction changes in proportion, but for what the coolant goes through.
        self._steps = {item.name: DIFFERENCE * item.sigma for item in directions}
        self._changed = {
            name: self.with_amount(name, self._steps[name])
            for name, change in changes.items()
            if self.circuits is not None or change.moves_channel
        }

    def with_amount(self, name: str, amount: float) -> FastModel:
        """The machine with some units of a direction."""
        change = self.changes[name]
        spec = with_channel(self.spec, {key: amount * value for key, value in change.channel.items()})
        model = change.applied(self.model, amount)
        found = FastModel(model, SpindleInputs(model, spec, self.inputs.extra_terms))
        if not change.moves_channel:
            found.channel = self.channel
        return found

    def operators(
        self,
        point: OperatingPoint,
        factors: Mapping[str, float],
        parameters: Sequence[str] = (),
        *,
        changes: Mapping[str, float] = NO_CHANGES,
        conductances: Mapping[str, float] = NO_CHANGES,
    ) -> ClassOperators:
        """Like :meth:`FastModel.operators`; derivatives by directions are per unit."""
        others = [name for name in parameters if name not in self.changes]
        found = super().operators(point, factors, others, changes=changes, conductances=conductances)
        values = self._values(point, factors, changes)
        for name in (item for item in parameters if item in self.changes):
            if name in self._changed:
                step, other = self._steps[name], self._changed[name]
                moved = other.operators(point, factors, changes=changes, conductances=conductances)
                found.conduction_by[name] = (moved.conduction - found.conduction) / step
                found.loads_by[name] = (moved.loads - found.loads) / step
                found.outputs_by[name] = (moved.outputs - found.outputs) / step
                found.output_inputs_by[name] = (moved.output_inputs - found.output_inputs) / step
            else:
                self._add_in_proportion(found, name, values, conductances)
            for film, load in self.changes[name].warmth(self.model):
                # The input that is always one.
                always = self.load_names.index("coolant_friction")
                found.loads_by[name][:, always] += values[self._positions[film]] * load
        return found

    def _add_in_proportion(
        self, found: ClassOperators, name: str, values: Array, conductances: Mapping[str, float]
    ) -> None:
        """Add the derivatives by a direction that leaves the coolant's way alone, in place."""
        change, model = self.changes[name], self.model
        rows, moved = change.rows, change.values
        conduction = np.zeros((model.size, model.size))
        loads = np.zeros_like(found.loads)
        if "operators" in rows:
            conduction += np.tensordot(values[rows["operators"]], moved["operators"], axes=1)
        if "fluid_load" in rows:
            for row, load in zip(rows["fluid_load"].tolist(), moved["fluid_load"], strict=True):
                film = model.fluid_names[row]
                loads[:, self._fluid_columns[film]] += values[self._positions[film]] * load
        if "places" in rows:
            places = [model.place_names[row] for row in rows["places"].tolist()]
            for place, mean in zip(places, moved["places"], strict=True):
                for column in (i for i, heated in enumerate(self.heat_places) if heated == place):
                    loads[:, column] += mean
                if place in conductances:
                    both = np.outer(model.place(place), mean)
                    conduction += conductances[place] * (both + both.T)
                    loads[:, self.load_names.index(self.inputs.ambient_input(place))] += (
                        conductances[place] * mean
                    )
        if "probes" in rows:
            outputs = np.zeros_like(found.outputs)
            outputs[[self.point_rows[row] for row in rows["probes"]]] = moved["probes"]
            found.outputs_by[name] = outputs
            found.output_inputs_by[name] = np.zeros_like(found.output_inputs)
        if conduction.any():
            found.conduction_by[name] = conduction
        if loads.any() or WARMTH in rows:
            found.loads_by[name] = loads

    def storage_by(self, factors: Mapping[str, float], parameters: Sequence[str]) -> dict[str, Array]:
        """Like :meth:`FastModel.storage_by`; derivatives by directions are per unit."""
        found = super().storage_by(factors, [name for name in parameters if name not in self.changes])
        for name in (item for item in parameters if item in self.changes):
            change = self.changes[name]
            if "storage" in change.rows:
                found[name] = np.tensordot(
                    self._capacities(factors)[change.rows["storage"]], change.values["storage"], axes=1
                )
        return found


# ------------------------------------------------------------------------ build
def structural_model_of(fast: FastModel, progress: Progress = lambda stage: None) -> StructuralModel:
    """The machine of a fast model with its directions, from the cache where they were made before.

    Parameters
    ----------
    fast : FastModel
        Of a machine with geometry.
    """
    terms = fast.inputs.extra_terms
    film_heat = film_heat_of(fast)
    made_of = fast.spec if film_heat is None else operators_machine(fast.spec, film_heat)
    coarse = made_of.model_copy(update={"mesh": made_of.mesh.model_copy(update=COARSE)})
    model, changes, directions = _projected(coarse, progress)
    return StructuralModel(model, changes, directions, fast.spec, terms)


def build_structural_model(
    machine: PreparedMachine,
    directions: Sequence[StructuralDirection] | None = None,
    *,
    progress: Progress = lambda stage: None,
) -> Projected:
    """Project a prepared machine and what every direction changes.

    The basis holds the fields of the physical loads at several Laplace frequencies and speeds, and for every
    direction the fields ``-(K + s M)⁻¹ (dK + s dM) u`` that a unit of it adds to them.

    Parameters
    ----------
    machine : PreparedMachine
        With linear temperatures.
    directions : sequence of StructuralDirection, optional
        All of the machine by default.
    """
    progress("structural directions: operators")
    full = full_machine(machine)
    if directions is None:
        directions = structural_directions(machine.spec, machine.mesh)
    differences = in_copies(
        [partial(item.cause.difference, full, item.sigma) for item in directions], thread_count()
    )
    progress("structural directions: fields")
    basis, energy = _basis(full.model, machine, differences, [item.sigma for item in directions])
    model = project(full.model, basis, basis.T @ (energy @ full.model.one))
    model = ThermalModel(**{name: getattr(model, name) for name in ThermalModel.__slots__})
    changes = {
        item.name: _projected_change(full.model, difference, basis)
        for item, difference in zip(directions, differences, strict=True)
    }
    return model, changes, tuple(directions)


def full_machine(machine: PreparedMachine) -> FullMachine:
    """Data for the directions of a prepared machine."""
    channel = machine.spec.channel
    walls = None
    if channel is not None:
        walls = (channel.part, channel.inner_radius, channel.inner_radius + channel.depth)
    return FullMachine(machine, build_mesh_model(machine), MovableMesh(machine.operators, walls))


def _samples(full: MeshModel, machine: PreparedMachine) -> list[Sample]:
    """Coefficients at the speeds that are solved."""
    spec = machine.spec
    table = build_coefficient_table(spec, full.contacts, full.gap_radii)
    points = [replace(OperatingPoint.of(spec), speed=share * spec.highest_speed) for share, _ in SPEEDS]
    return [Sample(table.base(p), nominal_channel_film(spec, full, p), table.capacities()) for p in points]


def _basis(
    full: MeshModel, machine: PreparedMachine, differences: Sequence[Difference], sigmas: Sequence[float]
) -> tuple[Array, sparse.csr_array]:
    """Vectors (n, r), and the energy in which they are orthonormal."""
    samples = _samples(full, machine)
    usual = samples[0]
    conduction = full.conduction(usual.coefficients, usual.channel_film)
    energy = (conduction + 1e-4 * full.capacity(usual.capacities)).tocsr()
    space = SnapshotSpace(energy, full.one[:, None], TOLERANCE)
    for sample, (_, shifts) in zip(samples, SPEEDS, strict=True):
        loads = np.hstack(
            (
                physical_loads(full, sample, machine.spec),
                fluid_loads(full, sample.coefficients, together=False),
                coolant_loads(full, sample.channel_film, 3),
            )
        )
        given = differences if sample is usual else ()
        jobs = [partial(_fields, full, sample, loads, shift, given, sigmas) for shift in shifts]
        for found in in_threads(jobs):
            for fields in found:
                space.add(fields)
    return space.basis(LARGEST), energy


def _fields(
    full: MeshModel,
    sample: Sample,
    loads: Array,
    shift: float,
    differences: Sequence[Difference],
    sigmas: Sequence[float],
) -> list[Array]:
    """Fields (n, m) K of loads at a Laplace frequency, then those that differences, if any, add to them."""
    matrix = full.conduction(sample.coefficients, sample.channel_film) + shift * full.capacity(
        sample.capacities
    )
    factor = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    found = [factor.solve(loads)]
    if differences:
        added = [
            sigma * _largest(_added_loads(full, item, sample, shift, found[0]), FIELDS_EACH)
            for item, sigma in zip(differences, sigmas, strict=True)
        ]
        found.append(factor.solve(np.hstack(added)))
    return found


def _added_loads(
    full: MeshModel, difference: Difference, sample: Sample, shift: float, fields: Array
) -> Array:
    """``-(dK + s dM) u`` and heat from warmer fluids for one unit, (n, m) W."""
    found = np.zeros_like(fields)
    groups = (
        ("operators", [sample.coefficients[name] for name in full.coefficient_names]),
        ("cell_film", sample.channel_film),
        ("storage", [shift * sample.capacities[name] for name in full.storage_names]),
    )
    for name, weights in groups:
        for weight, matrix in zip(weights, difference.fields.get(name, ()), strict=False):
            if weight != 0.0 and matrix.nnz:
                found -= weight * (matrix @ fields)
    for film, load in zip(full.fluid_names, difference.fields.get(WARMTH, ()), strict=False):
        found[:, 0] += sample.coefficients[film] * load
    return found


def _largest(columns: Array, number: int) -> Array:
    """Combinations of columns (n, m) of the largest norm, (n, number)."""
    _, vectors = np.linalg.eigh(columns.T @ columns)
    return columns @ vectors[:, -number:]


def _projected_change(full: MeshModel, difference: Difference, basis: Array) -> AffineChange:
    """A difference on a basis, without the rows that do not change."""
    nothing = sparse.csr_array((full.size, full.size))
    whole: dict[str, Any] = {name: getattr(full, name) for name in ThermalModel.__slots__}
    for name in FIELDS:
        if name != WARMTH:
            own = whole[name]
            none = tuple(nothing for _ in own) if isinstance(own, tuple) else 0.0 * own
            whole[name] = difference.fields.get(name, none)
    projected = project(ThermalModel(**whole), basis, np.zeros(basis.shape[1]))
    rows, values = {}, {}
    for name, own in difference.fields.items():
        array = own @ basis if name == WARMTH else np.asarray(getattr(projected, name))
        array = array.reshape(-1, 1) if name == "cell_area" else array
        size = np.abs(array).max(axis=tuple(range(1, array.ndim)), initial=0.0)
        kept = np.flatnonzero(size > ROUND_OFF * size.max(initial=np.finfo(float).tiny))
        if kept.size:
            rows[name], values[name] = kept, array[kept]
    return AffineChange(rows=rows, values=values, channel=dict(difference.channel))


# ------------------------------------------------------------------------ cache
@dataclass(frozen=True, slots=True, kw_only=True)
class _Record:
    """Changes of all directions as plain arrays.

    Attributes
    ----------
    directions : tuple of (name, key, unit, sigma, statement)
    channel : mapping of direction to mapping of str to float
    owner, field, row : (k,) int64 ndarray
        Direction, field and row of each changed row.
    values : (n,) ndarray
        All of them, one after the other.
    """

    directions: tuple[Any, ...]
    channel: Mapping[str, Mapping[str, float]]
    owner: NDArray[np.int64]
    field: NDArray[np.int64]
    row: NDArray[np.int64]
    values: Array

    @classmethod
    def of(cls, changes: Mapping[str, AffineChange], directions: Sequence[StructuralDirection]) -> _Record:
        entries = [
            (number, FIELDS.index(name), row, values)
            for number, change in enumerate(changes.values())
            for name, rows in change.rows.items()
            for row, values in zip(rows.tolist(), change.values[name], strict=True)
        ]
        owner, field, row = np.array([entry[:3] for entry in entries]).reshape(-1, 3).T
        return cls(
            directions=tuple((d.name, d.key, d.unit, d.sigma, d.statement) for d in directions),
            channel={name: dict(change.channel) for name, change in changes.items()},
            owner=owner,
            field=field,
            row=row,
            values=np.concatenate([np.ravel(entry[3]) for entry in entries]),
        )

    def changes(self, model: ThermalModel) -> dict[str, AffineChange]:
        shapes = {name: _row_shape(model, name) for name in FIELDS}
        sizes = np.array([int(np.prod(shapes[name])) for name in FIELDS])
        ends = np.cumsum(sizes[self.field])
        found = {}
        for number, (name, *_) in enumerate(self.directions):
            rows: dict[str, Array] = {}
            values: dict[str, Array] = {}
            for index in np.unique(self.field[self.owner == number]):
                own = np.flatnonzero((self.owner == number) & (self.field == index))
                parts = [self.values[ends[i] - sizes[index] : ends[i]] for i in own]
                rows[FIELDS[index]] = self.row[own]
                values[FIELDS[index]] = np.array(parts).reshape(-1, *shapes[FIELDS[index]])
            found[name] = AffineChange(rows=rows, values=values, channel=self.channel[name])
        return found


def _row_shape(model: ThermalModel, name: str) -> tuple[int, ...]:
    """Shape of one row of a field as changes hold it."""
    if name == "cell_area":
        return (1,)
    return getattr(model, "fluid_load" if name == WARMTH else name).shape[1:]


def _projected(spec: MachineSpec, progress: Progress) -> Projected:
    """Model, changes and directions of a machine, from the cache where they were made before."""
    # The reduced model's own does not know tolerances.
    solids = spec.model_dump_json(include={"part", "channel"})
    digest = hashlib.sha256((reduced_digest(spec, {}) + source_digest(__name__) + solids).encode())
    return _read_or_made(cache_directory() / f"structural-{digest.hexdigest()}.npz", spec, progress)


_known: dict[Path, Projected] = {}


def _read_or_made(path: Path, spec: MachineSpec, progress: Progress) -> Projected:
    beside = path.with_suffix(".changes.npz")
    if path not in _known:
        model, found = ThermalModel.load(path), load_record(beside, FORMAT, _Record)
        if model is None or found is None:
            machine = prepare_machine(spec, progress=progress)
            made = build_structural_model(machine, progress=progress)
            made[0].save(path)
            save_record(_Record.of(*made[1:]), beside, FORMAT)
        else:
            record = _Record(**found)
            directions = tuple(StructuralDirection(*item) for item in record.directions)
            made = model, record.changes(model), directions
        # One machine at a time.
        _known.clear()
        _known[path] = made
    return _known[path]
