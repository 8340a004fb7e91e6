"""Steady states of many designs at once on the projected model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.reduced.circuit_operators import CircuitWalls
from spindle_fem.model.reduced.coolant_batch import ChannelBatch, ChannelField
from spindle_fem.model.reduced.design_inputs import DesignInputs
from spindle_fem.model.reduced.heat_tables import (
    QUANTITIES,
    BearingTables,
    HeatTable,
)
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.friction_map import film_temperature

Array = NDArray[np.float64]

# Largest last change of any temperature, K; the remaining error is a fraction of it.
SETTLED = 2.0e-5
MOST_ITERATIONS = 60
# The matrix is made anew at the films of the moment where it does not settle by then.
RENEWED_AFTER = 8
FIRST_RISE = 15.0
# Share of the basis, the leading vectors, that the estimate compares with.
COARSE_SHARE = 2.0 / 3.0
_TOTAL, _INNER, _OUTER = (QUANTITIES.index(n) for n in ("total", "conductance_inner", "conductance_outer"))


@dataclass(frozen=True, slots=True)
class SteadyBatch:
    """Steady states of some designs.

    Attributes
    ----------
    unknowns : (n, r) ndarray
    settled : (n,) bool ndarray
        Whether heat, films and field agree.
    estimate : (n,) ndarray, [K]
        What the last third of the basis moves of any mean, probe or channel cell.
    temperatures : (n, n_bearings, 3) ndarray, [K]
        Inner raceway, outer raceway, balls.
    bearings : (n, n_bearings, n_q) ndarray
        ``QUANTITIES`` and the terms of each design's own table.
    terms : tuple of tuple of str
        Of each design.
    coefficients : (n, n_c) ndarray
        With those of the balls.
    """

    unknowns: Array
    settled: NDArray[np.bool_]
    estimate: Array
    temperatures: Array
    bearings: Array
    terms: tuple[tuple[str, ...], ...]
    coefficients: Array
    channel: ChannelField | None


class SteadySolver:
    """Solves batches of designs of one model.

    Parameters
    ----------
    model : ThermalModel
        Dense, its unknowns by falling weight.
    bearings : sequence of str
        In the order of the definition.
    """

    def __init__(self, model: ThermalModel, tables: BearingTables, bearings: Sequence[str]) -> None:
        self.model, self.tables, self.bearings = model, tables, tuple(bearings)
        size = model.size
        names = model.coefficient_names
        balls = [[names.index(f"balls.{name}.{side}") for side in ("inner", "outer")] for name in bearings]
        self.balls = np.array(balls, dtype=np.int64).reshape(-1)
        self.steady = np.setdiff1d(np.arange(len(names)), self.balls)
        places = [
            model.place(f"{name}.{end}")
            for name in bearings
            for end in ("inner_raceway", "outer_raceway", "balls")
        ]
        self.heat_places = np.array(places).reshape(-1, size)
        area = model.cell_area.ravel()
        # Mean wall temperature of each cell, (n_cells, r): what the coolant's march takes up whole.
        self.cell_mean = model.cell_load / area[:, None]
        # The rest of a cell's film is that of its uneven wall.
        rest = model.cell_film - area[:, None, None] * self.cell_mean[:, :, None] * self.cell_mean[:, None]
        # Temperature-dependent operators: ball conductances, then films of the channel's cells.
        self.moving = np.concatenate((model.operators[self.balls], rest)).reshape(-1, size, size)
        self.fixed = model.operators[self.steady].reshape(len(self.steady), -1)
        self.fluids = [names.index(name) for name in model.fluid_names]
        # Everything that an output may read: places, probes, cells of the channel.
        self.functionals = np.vstack((model.places, model.probes, self.cell_mean))

    def solve(self, inputs: DesignInputs, band: Array | None = None) -> SteadyBatch:
        """Steady states of designs.

        Tables of the bearings' heat that prove too narrow are made wider and
        the batch is solved again.

        Parameters
        ----------
        band : (n, n_along) ndarray, optional
            Further factor on the film of each cell along the channel.

        Raises
        ------
        OutOfValidityError, NoEquilibriumError
            A correlation does not reach some design of the batch.
        """
        while True:
            found, film = _Run(self, inputs, band).settle()
            read = film[found.settled]
            if not read.size or not self.tables.widen(float(read.min()), float(read.max())):
                return replace(found, settled=found.settled & self._within_tables(film))

    def _within_tables(self, film: Array) -> NDArray[np.bool_]:
        return np.all((film >= self.tables.low) & (film <= self.tables.high), axis=1)


class _Run:
    """One batch, iterated to its steady states."""

    def __init__(self, solver: SteadySolver, inputs: DesignInputs, band: Array | None) -> None:
        self.solver, self.model, self.inputs = solver, solver.model, inputs
        self.number, self.size = len(inputs), solver.model.size
        self.channel = ChannelBatch(self.model, inputs, band) if inputs.specs[0].channel is not None else None
        self.field: ChannelField | None = None
        given = inputs.coefficients
        self.base = (given[:, solver.steady] @ solver.fixed).reshape(self.number, self.size, self.size)
        self.fluid_load = (given[:, solver.fluids] * inputs.fluid) @ self.model.fluid_load
        self._add_circuits()
        self._tables: list[tuple[HeatTable, NDArray[np.int64]]] = []
        owners: dict[str, list[int]] = {}
        for row, key in enumerate(inputs.mechanics):
            owners.setdefault(key, []).append(row)
        for key, rows in owners.items():
            table = solver.tables.of(inputs.specs[rows[0]], inputs.points[rows[0]], key)
            self._tables.append((table, np.array(rows)))

    def _add_circuits(self) -> None:
        """Let the coolant of circuits warm on its way: films by themselves have it at inlet temperature."""
        for number, film in enumerate(self.inputs.specs[0].circuits):
            walls = CircuitWalls(self.model, film)
            for row, spec in enumerate(self.inputs.specs):
                own = spec.circuits[number]
                maps = walls.maps(own, self.inputs.coefficients[row, walls.rows])
                self.base[row] += maps.conduction
                self.fluid_load[row] += own.inlet_temperature * maps.inlet_load

    # ------------------------------------------------------------- what follows the field
    def _quantities(self, film: Array) -> Array:
        """Heat and paths of every bearing at its film's temperature, (n, n_bearings, n_q)."""
        tables = self.solver.tables
        film = np.clip(film, tables.low, tables.high)  # the caller widens tables that were left
        most = max(table.number for table, _ in self._tables)
        found = np.full((*film.shape, most), np.nan)
        for table, rows in self._tables:
            found[rows, :, : table.number] = table.at(film[rows])
        return found

    def _moving(self, quantities: Array) -> Array:
        """Ball conductances and cell films, (n, m)."""
        given = self.inputs.coefficients[:, self.solver.balls]
        own = quantities[:, :, [_INNER, _OUTER]].reshape(self.number, -1)
        parts = [np.where(np.isnan(given), own, given)]
        if self.field is not None:
            parts.append(self.field.film.reshape(self.number, -1))
        return np.hstack(parts)

    def _heat_load(self, quantities: Array) -> Array:
        heat = quantities[:, :, _TOTAL, None] * self.inputs.shares[:, None, :]
        return heat.reshape(self.number, -1) @ self.solver.heat_places

    def temperatures(self, unknowns: Array) -> Array:
        return (unknowns @ self.solver.heat_places.T).reshape(self.number, -1, 3)

    def _wall(self, unknowns: Array) -> Array:
        return (unknowns @ self.solver.cell_mean.T).reshape(self.number, *self.model.cell_area.shape)

    def _follow(self, unknowns: Array) -> tuple[Array, Array]:
        """Bearings and coolant at a field: quantities of the bearings, the temperature of their films."""
        film = film_temperature(*np.moveaxis(self.temperatures(unknowns), -1, 0))
        if self.channel is not None:
            self.field = self.channel.at(self._wall(unknowns), self.field)
        return self._quantities(film), film

    # ------------------------------------------------------------- solving
    def _system(self, quantities: Array) -> tuple[Array, Array]:
        """Matrix with the coolant eliminated, and load, at the heat and films of the moment."""
        moving = self._moving(quantities)
        flat = self.solver.moving[: moving.shape[1]].reshape(moving.shape[1], -1)
        matrix = self.base + (moving @ flat).reshape(self.base.shape)
        load = self._heat_load(quantities) + self.fluid_load
        if self.channel is not None:
            lines, constant = self.channel.linear(self.field)
            along = self.model.cell_area.shape[1]
            for start in range(lines.shape[1]):
                mean = self.solver.cell_mean[start * along : (start + 1) * along]
                matrix += mean.T @ (lines[:, start] @ mean)
                load -= constant[:, start] @ mean
        return matrix, load

    def _residual(self, quantities: Array, unknowns: Array) -> Array:
        """Heat that the field leaves unbalanced."""
        moving = self._moving(quantities)
        operators = self.solver.moving[: moving.shape[1]]
        size = self.size
        acted = (unknowns @ operators.transpose(1, 0, 2).reshape(size, -1)).reshape(self.number, -1, size)
        residual = self._heat_load(quantities) + self.fluid_load
        residual -= np.einsum("nij,nj->ni", self.base, unknowns)
        residual -= np.einsum("nm,nmr->nr", moving, acted, optimize=True)
        if self.field is not None:
            residual -= self.field.march.heat.reshape(self.number, -1) @ self.solver.cell_mean
        return residual

    def _heat_slope(self, film: Array) -> Array:
        """Decrease of each bearing's heat per kelvin of its film, (n, n_bearings, r) W/K."""
        tables = self.solver.tables
        change = np.empty_like(film)
        for table, rows in self._tables:
            change[rows] = -table.heat_slope(np.clip(film[rows], tables.low, tables.high))
        places = self.solver.heat_places.reshape(-1, 3, self.size)
        return change[:, :, None] * np.einsum("ns,bsi->nbi", self.inputs.shares, places, optimize=True)

    def _film_readings(self) -> Array:
        """The film temperature of every bearing from the unknowns, (n_bearings, r)."""
        places = self.solver.heat_places.reshape(-1, 3, self.size)
        return film_temperature(*np.moveaxis(places, 1, 0))

    def settle(self) -> tuple[SteadyBatch, Array]:
        """The steady states and the film temperatures at which the tables were read."""
        first = np.broadcast_to(self.inputs.ambient[:, None], (self.number, len(self.solver.bearings)))
        if self.channel is not None:
            wall = np.broadcast_to(self.channel.inlet, (self.number, *self.model.cell_area.shape))
            self.field = self.channel.at(wall + 0.2 * FIRST_RISE)
        matrix, load = self._system(self._quantities(first + FIRST_RISE))
        slope = self._heat_slope(first + FIRST_RISE)
        readings = self._film_readings()
        matrix += np.einsum("nbi,bj->nij", slope, readings, optimize=True)
        inverse = np.linalg.inv(matrix)
        load += np.einsum("nbi,nb->ni", slope, first + FIRST_RISE)
        unknowns = np.einsum("nij,nj->ni", inverse, load)
        settled = np.zeros(self.number, dtype=bool)
        for iteration in range(1, MOST_ITERATIONS + 1):
            quantities, film = self._follow(unknowns)
            step = np.einsum("nij,nj->ni", inverse, self._residual(quantities, unknowns))
            unknowns = unknowns + step
            moved = np.abs(step @ self.solver.functionals.T).max(axis=1)
            settled = moved <= SETTLED
            if settled.all() or not np.isfinite(moved).all():
                break
            if iteration % RENEWED_AFTER == 0:
                slope = self._heat_slope(film)
                matrix = self._system(quantities)[0] + np.einsum(
                    "nbi,bj->nij", slope, readings, optimize=True
                )
                inverse = np.linalg.inv(matrix)
        quantities, film = self._follow(unknowns)
        moving = self._moving(quantities)
        if self.channel is not None:
            self.field = self.channel.with_bounds(self._wall(unknowns), self.field)
        coefficients = self.inputs.coefficients.copy()
        coefficients[:, self.solver.balls] = moving[:, : len(self.solver.balls)]
        batch = SteadyBatch(
            unknowns,
            settled,
            self._estimate(quantities, unknowns),
            self.temperatures(unknowns),
            quantities,
            self._terms(),
            coefficients,
            self.field,
        )
        return batch, film

    def _estimate(self, quantities: Array, unknowns: Array) -> Array:
        """Largest change of any functional where the basis ends earlier, (n,) K."""
        matrix, load = self._system(quantities)
        coarse = max(1, round(COARSE_SHARE * self.size))
        less = np.linalg.solve(matrix[:, :coarse, :coarse], load[:, :coarse, None])[..., 0]
        functionals = self.solver.functionals
        return np.abs(unknowns @ functionals.T - less @ functionals[:, :coarse].T).max(axis=1)

    def _terms(self) -> tuple[tuple[str, ...], ...]:
        found: list[tuple[str, ...]] = [()] * self.number
        for table, rows in self._tables:
            for row in rows:
                found[row] = table.terms
        return tuple(found)
