"""A projected model made for the designs of a study, and checked against full solves of some of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.model.mesh.linear_solvers import build_preconditioner, solve_many
from spindle_fem.model.reduced.affine_operators import AffineSystem, build_affine_system
from spindle_fem.operation.coefficients import gap_radii_of
from spindle_fem.solvers.coupled_steady import PreparedMachine
from spindle_fem.studies.sweep.fast.coolant_batch import ChannelBatch
from spindle_fem.studies.sweep.fast.design_inputs import DesignInputs, design_inputs
from spindle_fem.studies.sweep.fast.heat_tables import BearingTables
from spindle_fem.studies.sweep.fast.solve_batch import SteadyBatch, SteadySolver
from spindle_fem.studies.sweep.fast.steady_model import SteadyModel, project
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

# Estimated error at which the basis is good enough, K.
WANTED = 2.0e-3
FIRST_SAMPLES = 4
MORE_SAMPLES = 3
MOST_ROUNDS = 6
# Share of the energy of the largest mode below which modes are dropped.
SMALLEST_MODE = 1.0e-6
MOST_MODES = 110
SOLVER_TOLERANCE = 1.0e-7
PROFILE_DEGREE = 5
HEAT, FLUID_RISE = 80.0, 10.0
# The hottest and coldest that tables of the bearings' heat reach to at first.
FIRST_TABLES = (ZERO_CELSIUS_K + 10.0, ZERO_CELSIUS_K + 75.0)
TRAINING_SIZE = 400


def build_steady_model(
    machine: PreparedMachine,
    specs: Sequence[MachineSpec],
    *,
    film_band: bool = False,
    wanted: float = WANTED,
) -> tuple[SteadyModel, SteadySolver]:
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
        Whether they are also asked for at both ends of the channel film's band.
    wanted : float, [K]
        Of the estimated error, where the basis stops growing.

    Returns
    -------
    SteadyModel
    SteadySolver
        With the heat tables that it needed.
    """
    affine = build_affine_system(machine)
    specs = tuple(specs)[:: max(1, -(-len(specs) // TRAINING_SIZE))]
    inputs = design_inputs(
        specs,
        affine.coefficient_names,
        tuple(affine.fluid_load),
        machine.mesh.joints,
        gap_radii_of(machine.spec, machine.operators),
    )
    if film_band:
        inputs = with_band_ends(inputs, affine, machine)
    workshop = _Workshop(machine, affine, inputs)
    order = workshop.spread()
    workshop.add_central(order[0])
    for row in order[1 : 1 + FIRST_SAMPLES]:
        workshop.add(row)
    tables = BearingTables(*FIRST_TABLES)
    bearings = [bearing.name for _, bearing in machine.spec.bearings]
    for attempt in range(MOST_ROUNDS):
        model = workshop.model()
        solver = SteadySolver(model, tables, bearings)
        batch = solver.solve(inputs)
        model = replace(model, worst_estimate=float(batch.estimate.max()))
        if model.worst_estimate <= wanted or attempt == MOST_ROUNDS - 1:
            break
        if not workshop.add_worst(batch):
            break
    model = replace(model, ranges=coefficient_ranges(batch))
    return model, SteadySolver(model, tables, bearings)


def coefficient_ranges(batch: SteadyBatch) -> Array:
    """Lowest and highest of every coefficient and of the mean channel film, (n_c + 1, 2)."""
    values = state_coefficients(batch)
    return np.column_stack((values.min(axis=0), values.max(axis=0)))


def state_coefficients(batch: SteadyBatch) -> Array:
    """Every coefficient and the mean channel film of every design, (n, n_c + 1)."""
    number = len(batch.coefficients)
    film = np.zeros(number) if batch.channel is None else batch.channel.film.reshape(number, -1).mean(axis=1)
    return np.column_stack((batch.coefficients, film))


def with_band_ends(inputs: DesignInputs, affine: AffineSystem, machine: PreparedMachine) -> DesignInputs:
    """Designs with their nominal, their low and their high channel film."""
    channel = ChannelBatch(_Cells(affine, machine), inputs)
    wall = np.broadcast_to(channel.inlet + 3.0, (len(inputs), *affine.cell_area.shape))
    film = channel.at(wall).source
    several = inputs.take(np.tile(np.arange(len(inputs)), 3))
    ratios = [np.ones(len(inputs))]
    for end in (film.low, film.high):
        ratio = np.broadcast_to(np.asarray(end) / np.asarray(film.value), wall.shape)
        ratios.append(ratio.mean(axis=(1, 2)))
    return replace(several, film_factor=several.film_factor * np.concatenate(ratios))


class _Workshop:
    """Snapshots of some designs and their bases."""

    def __init__(self, machine: PreparedMachine, affine: AffineSystem, inputs: DesignInputs) -> None:
        self.machine, self.affine, self.inputs = machine, affine, inputs
        self.taken: list[int] = []
        self.snapshots: list[Array] = []
        self.uniform = np.ones((affine.size, 1))
        self.energy = None

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
            film = None if batch.channel is None else batch.channel.film[row].ravel()
            self.add(row, batch.coefficients[row], film)
        return bool(chosen)

    # ------------------------------------------------------------- snapshots
    def _first_film(self, rows: Sequence[int]) -> Array:
        """Film of each cell with all of the oil at inlet and the wall little warmer, (n, n_cells)."""
        inputs = self.inputs.take(list(rows))
        cells = _Cells(self.affine, self.machine)
        channel = ChannelBatch(cells, inputs)
        wall = np.broadcast_to(channel.inlet + 3.0, (len(inputs), *self.affine.cell_area.shape))
        return channel.at(wall).film.reshape(len(inputs), -1)

    def _first_coefficients(self, row: int) -> Array:
        values = self.inputs.coefficients[row].copy()
        if np.isnan(values).any():
            loads, _ = self.machine.builder.at(
                self.inputs.points[row], self._uniform_state(self.inputs.ambient[row] + 15.0)
            )
            heat = loads.bearing_heat
            for column, name in enumerate(self.affine.coefficient_names):
                if np.isnan(values[column]):
                    _, bearing, side = name.split(".")
                    values[column] = getattr(heat[bearing], f"conductance_{side}")
        return values

    def _uniform_state(self, temperature: float) -> object:
        operators = self.machine.operators
        return self.machine.field_state(np.full(operators.n_unknowns, temperature), {})

    def _solve(self, coefficients: Array, film: Array, loads: Array) -> Array:
        named = dict(zip(self.affine.coefficient_names, coefficients.tolist(), strict=True))
        matrix = self.affine.conduction(named, film).tocsr()
        if self.energy is None:
            self.energy = matrix
        guesses = np.zeros_like(loads)
        if self.snapshots:
            known = self.snapshots[0]
            small = known.T @ (matrix @ known)
            guesses = known @ np.linalg.lstsq(small, known.T @ loads, rcond=1e-12)[0]
        preconditioner = build_preconditioner(self.affine.system(matrix))
        return solve_many(matrix, loads, preconditioner, guesses, relative_tolerance=SOLVER_TOLERANCE)

    def add_central(self, row: int) -> None:
        """Every source and fluid on its own, at the coefficients of one design."""
        coefficients, film = self._start(row)
        loads = np.hstack(
            (
                HEAT * self._friction(together=False),
                self._fluid_loads(coefficients, together=False),
                self._coolant_loads(film, PROFILE_DEGREE),
            )
        )
        self._keep(row, self._solve(coefficients, film, loads))

    def add(self, row: int, coefficients: Array | None = None, film: Array | None = None) -> None:
        """What heats and cools a design, set by set, at its coefficients."""
        if coefficients is None:
            coefficients, film = self._start(row)
        film = np.zeros(0) if film is None else film
        loads = np.hstack(
            (
                HEAT * self._friction(together=True),
                self._fluid_loads(coefficients, together=True),
                self._coolant_loads(film, 2),
            )
        )
        self._keep(row, self._solve(coefficients, film, loads))

    def _keep(self, row: int, solutions: Array) -> None:
        self.taken.append(row)
        self.snapshots.append(solutions)

    def _start(self, row: int) -> tuple[Array, Array]:
        film = self._first_film([row])[0] if self.inputs.specs[0].channel is not None else np.zeros(0)
        return self._first_coefficients(row), film

    def _friction(self, *, together: bool) -> Array:
        groups = [[b.name for b in group.bearing] for group in self.machine.spec.bearing_set]
        if not together:
            groups = [[name] for group in groups for name in group]
        columns = []
        for names in groups:
            for end in ("inner_raceway", "outer_raceway", "balls"):
                rows = [self.affine.place_names.index(f"{name}.{end}") for name in names]
                columns.append(self.affine.places[rows].toarray().sum(axis=0))
        return np.array(columns).reshape(-1, self.affine.size).T

    def _fluid_loads(self, coefficients: Array, *, together: bool) -> Array:
        named = dict(zip(self.affine.coefficient_names, coefficients, strict=True))
        columns = [FLUID_RISE * named[name] * load for name, load in self.affine.fluid_load.items()]
        if together and columns:
            columns = [sum(columns[1:], columns[0])]
        return np.array(columns).reshape(-1, self.affine.size).T

    def _coolant_loads(self, film: Array, degree: int) -> Array:
        if not film.size:
            return np.zeros((self.affine.size, 0))
        starts, along = self.affine.cell_area.shape
        place = (np.arange(along) + 0.5) / along * 2.0 - 1.0
        shapes = np.polynomial.legendre.legvander(place, degree)
        columns = []
        for start in range(starts):
            own = slice(start * along, (start + 1) * along)
            for shape in shapes.T:
                columns.append(FLUID_RISE * (self.affine.cell_load[own].T @ (film[own] * shape)))
        return np.array(columns).T

    # ------------------------------------------------------------- basis
    def model(self) -> SteadyModel:
        """Projection on the leading modes of all snapshots, the uniform field first."""
        energy = self.energy
        first = self.uniform / np.sqrt(self.uniform[:, 0] @ (energy @ self.uniform[:, 0]))
        rest = np.hstack(self.snapshots)
        rest = rest - first @ (first.T @ (energy @ rest))
        gram = rest.T @ (energy @ rest)
        values, vectors = eigh(0.5 * (gram + gram.T))
        values, vectors = values[::-1], vectors[:, ::-1]
        number = int(np.count_nonzero(values > SMALLEST_MODE**2 * values[0]))
        number = min(number, MOST_MODES)
        modes = rest @ (vectors[:, :number] / np.sqrt(values[:number]))
        basis = np.hstack((first, modes))
        for _ in range(2):  # the smallest modes have lost orthogonality to round-off
            gram = basis.T @ (energy @ basis)
            factor = np.linalg.cholesky(0.5 * (gram + gram.T))
            basis = np.linalg.solve(factor, basis.T).T
        one = basis.T @ (energy @ self.uniform[:, 0])
        return project(self.machine, self.affine, basis, one)


class _Cells:
    """The part of a model that the coolant needs, before there is a model."""

    def __init__(self, affine: AffineSystem, machine: PreparedMachine) -> None:
        self.cell_area = affine.cell_area
        self._cells = machine.builder.cells

    def channel_cells(self) -> object:
        """Cells of the machine."""
        return self._cells
