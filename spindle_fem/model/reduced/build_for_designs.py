"""Make a reduced model for the designs of a study: sampled where its own estimate of the error is largest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.term import CHANNEL_FILM
from spindle_fem.model.mesh.evaluate import temperature_at_nodes
from spindle_fem.model.reduced.coolant_batch import ChannelBatch
from spindle_fem.model.reduced.design_inputs import DesignInputs, design_inputs
from spindle_fem.model.reduced.heat_tables import BearingTables
from spindle_fem.model.reduced.mesh_model import MeshModel, build_mesh_model
from spindle_fem.model.reduced.snapshots import Sample, SnapshotSpace, shifted_systems
from spindle_fem.model.reduced.steady_batch import SteadyBatch, SteadySolver
from spindle_fem.model.reduced.unit_loads import coolant_loads, fluid_loads, friction_loads
from spindle_fem.model.thermal_model import ThermalModel, project
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

# Estimated error at which the basis is good enough, K.
WANTED = 2.0e-3
# Designs sampled beside the central one, then in each round, and rounds at most.
FIRST_SAMPLES, MORE_SAMPLES, MOST_ROUNDS = 4, 3, 6
# Singular values below this share of the largest are dropped.
SMALLEST_MODE = 1.0e-6
MOST_MODES = 110
SOLVER_TOLERANCE = 1.0e-7
# Highest polynomial of the coolant's temperature along the channel, in the central design and in the others.
CENTRAL_DEGREE, DEGREE = 5, 2
# Basis vectors from which first guesses are combined.
GUESS_SIZE = 80
# Initial rise of walls and films above the ambient, K.
FIRST_RISE = 15.0
# The hottest and coldest that tables of the bearings' heat reach to at first.
FIRST_TABLES = (ZERO_CELSIUS_K + 10.0, ZERO_CELSIUS_K + 75.0)
# Designs at most that choose the samples.
TRAINING_SIZE = 400


def build_model_for_designs(
    machine: PreparedMachine,
    specs: Sequence[MachineSpec],
    *,
    film_band: bool = False,
) -> tuple[ThermalModel, SteadySolver]:
    """Basis for some designs of one structure: sampled where its own estimate is largest.

    Snapshots are full linear solutions, one for each load, at the
    coefficients of chosen designs: a central one, those farthest from it and
    from one another, then those whose estimated error is largest, until none
    is above what is wanted.

    Parameters
    ----------
    machine : PreparedMachine
        Of any of the designs.
    specs : sequence of MachineSpec
        The designs.
    film_band : bool
        Whether both ends of the channel film's band are needed too.

    Returns
    -------
    SteadySolver
        With the heat tables that it needed.
    """
    full = build_mesh_model(machine)
    specs = tuple(specs)[:: max(1, -(-len(specs) // TRAINING_SIZE))]
    inputs = design_inputs(
        specs,
        full.coefficient_names,
        full.fluid_names,
        full.contacts,
        full.gap_radii,
    )
    if film_band:
        inputs = with_band_ends(inputs, full)
    samples = _Samples(machine, full, inputs)
    order = samples.spread()
    samples.add_central(order[0])
    for row in order[1 : 1 + FIRST_SAMPLES]:
        samples.add(row)
    tables = BearingTables(*FIRST_TABLES)
    bearings = [bearing.name for _, bearing in machine.spec.bearings]
    for attempt in range(MOST_ROUNDS):
        model = samples.model()
        solver = SteadySolver(model, tables, bearings)
        batch = solver.solve(inputs)
        worst = float(batch.estimate.max())
        if worst <= WANTED or attempt == MOST_ROUNDS - 1:
            break
        if not samples.add_worst(batch):
            break
    model = replace(model, ranges=coefficient_ranges(model, batch), errors={"estimated": worst})
    return model, SteadySolver(model, tables, bearings)


def coefficient_ranges(model: ThermalModel, batch: SteadyBatch) -> dict[str, tuple[float, float]]:
    """Lowest and highest of every coefficient and of the mean channel film."""
    values = state_coefficients(batch)
    ends = zip(values.min(axis=0).tolist(), values.max(axis=0).tolist(), strict=True)
    return dict(zip((*model.coefficient_names, CHANNEL_FILM), ends, strict=True))


def state_coefficients(batch: SteadyBatch) -> Array:
    """Every coefficient and the mean channel film of every design, (n, n_c + 1)."""
    number = len(batch.coefficients)
    film = np.zeros(number) if batch.channel is None else batch.channel.film.reshape(number, -1).mean(axis=1)
    return np.column_stack((batch.coefficients, film))


def with_band_ends(inputs: DesignInputs, full: MeshModel) -> DesignInputs:
    """Designs with their nominal, their low and their high channel film."""
    channel = ChannelBatch(full, inputs)
    wall = np.broadcast_to(channel.inlet + 3.0, (len(inputs), *full.cell_area.shape))
    film = channel.at(wall).channel.film
    several = inputs.take(np.tile(np.arange(len(inputs)), 3))
    ratios = [np.ones(len(inputs))]
    for end in (film.low, film.high):
        ratio = np.broadcast_to(np.asarray(end) / np.asarray(film.value), wall.shape)
        ratios.append(ratio.mean(axis=(1, 2)))
    return replace(several, film_factor=several.film_factor * np.concatenate(ratios))


class _Samples:
    """Designs at which the full model is solved, and the space of their solutions."""

    def __init__(self, machine: PreparedMachine, full: MeshModel, inputs: DesignInputs) -> None:
        self.machine, self.full, self.inputs = machine, full, inputs
        self.taken: list[int] = []
        self.space: SnapshotSpace | None = None
        self.energy: sparse.csr_array | None = None

    # ------------------------------------------------------------- which designs
    def _places(self) -> Array:
        """Designs by the logarithms of what their matrix depends on, (n, d)."""
        inputs = self.inputs
        columns = [np.log(np.maximum(np.nan_to_num(inputs.coefficients, nan=1.0), 1e-12))]
        if inputs.specs[0].channel is not None:
            columns.append(np.log(self._first_film(range(len(inputs))).mean(axis=1, keepdims=True)))
        return np.hstack(columns)

    def spread(self) -> list[int]:
        """Designs in an order in which each is far from those before; the first is central."""
        places = self._places()
        centre = places - np.median(places, axis=0)
        order = [int(np.argmin(np.linalg.norm(centre, axis=1)))]
        distance = np.linalg.norm(places - places[order[0]], axis=1)
        while len(order) <= FIRST_SAMPLES:
            far = int(np.argmax(distance))
            if distance[far] <= 1e-6:
                break
            order.append(far)
            distance = np.minimum(distance, np.linalg.norm(places - places[far], axis=1))
        return order

    def add_worst(self, batch: SteadyBatch) -> bool:
        """Sample where the estimate is largest; whether there was a design left."""
        order = [int(row) for row in np.argsort(-batch.estimate) if int(row) not in self.taken]
        chosen: list[int] = []
        places = self._places()
        for row in order:
            near = [np.linalg.norm(places[row] - places[other]) for other in chosen]
            if not near or min(near) > 1e-3:
                chosen.append(row)
            if len(chosen) == MORE_SAMPLES:
                break
        for row in chosen:
            film = np.zeros(0) if batch.channel is None else batch.channel.film[row].ravel()
            self.add(row, self._sample(batch.coefficients[row], film))
        return bool(chosen)

    # ------------------------------------------------------------- coefficients of a design
    def _sample(self, coefficients: Array, film: Array) -> Sample:
        return Sample(dict(zip(self.full.coefficient_names, coefficients.tolist(), strict=True)), film, {})

    def _first_sample(self, row: int) -> Sample:
        """Coefficients of a design before its temperatures are known."""
        has_channel = self.inputs.specs[0].channel is not None
        film = self._first_film([row])[0] if has_channel else np.zeros(0)
        return self._sample(self._first_coefficients(row), film)

    def _first_film(self, rows: Sequence[int]) -> Array:
        """Film of each cell with all of the oil at inlet and the wall little warmer, (n, n_cells)."""
        inputs = self.inputs.take(list(rows))
        channel = ChannelBatch(self.full, inputs)
        wall = np.broadcast_to(channel.inlet + 3.0, (len(inputs), *self.full.cell_area.shape))
        return channel.at(wall).film.reshape(len(inputs), -1)

    def _first_coefficients(self, row: int) -> Array:
        values = self.inputs.coefficients[row].copy()
        if np.isnan(values).any():
            field = np.full(self.machine.operators.n_unknowns, self.inputs.ambient[row] + FIRST_RISE)
            loads, _ = self.machine.builder.at(self.inputs.points[row], self.machine.field_state(field, {}))
            for column, name in enumerate(self.full.coefficient_names):
                if np.isnan(values[column]):
                    _, bearing, side = name.split(".")
                    values[column] = getattr(loads.bearing_heat[bearing], f"conductance_{side}")
        return values

    # ------------------------------------------------------------- snapshots
    def add_central(self, row: int) -> None:
        """Every source and fluid on its own, at the coefficients of one design."""
        full, sample = self.full, self._first_sample(row)
        self.energy = full.conduction(sample.coefficients, sample.channel_film)
        self.space = SnapshotSpace(self.energy, full.one[:, None], SMALLEST_MODE)
        bearings = [[bearing.name] for _, bearing in self.machine.spec.bearings]
        self._solve(row, sample, bearings, CENTRAL_DEGREE, together=False)

    def add(self, row: int, sample: Sample | None = None) -> None:
        """Add solutions for the heat and cooling of a design, set by set, at its coefficients."""
        sets = [[bearing.name for bearing in group.bearing] for group in self.machine.spec.bearing_set]
        self._solve(row, sample or self._first_sample(row), sets, DEGREE, together=True)

    def _solve(
        self, row: int, sample: Sample, groups: Sequence[Sequence[str]], degree: int, *, together: bool
    ) -> None:
        full = self.full
        loads = np.hstack(
            (
                friction_loads(full, groups, ("inner_raceway", "outer_raceway", "balls")),
                fluid_loads(full, sample.coefficients, together=together),
                coolant_loads(full, sample.channel_film, degree),
            )
        )
        known = self.space.basis(GUESS_SIZE)
        [system] = shifted_systems(full, sample, [0.0], known, SOLVER_TOLERANCE)
        self.taken.append(row)
        self.space.add(system.solve(loads))

    def model(self) -> ThermalModel:
        """Projection on the leading modes of all solutions, the uniform field first."""
        full, machine = self.full, self.machine
        basis = self.space.basis(MOST_MODES + 1)
        return replace(
            project(full, basis, basis.T @ (self.energy @ full.one)),
            nodes=np.ascontiguousarray(
                temperature_at_nodes(machine.operators, basis[: full.n_unknowns]).T, dtype=np.float32
            ),
            mesh_numbers={
                "nodes": machine.operators.n_unknowns,
                "elements": machine.mesh.n_elements,
                "min_quality": machine.mesh.min_quality,
            },
            mesh_digest=machine.mesh.digest,
        )
