"""Temperatures over time by the reduced model, and their derivatives to parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError
from spindle_fem.reduced.drive import Drive, heat_of_table
from spindle_fem.reduced.fast_model import ClassOperators, FastModel
from spindle_fem.reduced.stepping import (
    Propagator,
    build_propagator,
    group_steps,
    load_response,
    sensitivity_forcing,
    stage_values,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FastTransient:
    """Prediction of every probe.

    Attributes
    ----------
    times : (N,) ndarray, [s]
    channels : tuple of str
    temperature : (N, c) ndarray, [K]
    sensitivity : (N, c, p) ndarray, [K]
        Derivative to the natural logarithm of each parameter.
    parameters : tuple of str
    grid : (G + 1,) ndarray, [s]
    states : (G + 1, r) ndarray
        Reduced unknowns at the ends of the steps.
    """

    times: Array
    channels: tuple[str, ...]
    temperature: Array
    sensitivity: Array
    parameters: tuple[str, ...]
    grid: Array
    states: Array


def simulate_fast(
    fast: FastModel,
    drive: Drive,
    initial_temperature: float,
    *,
    parameters: Mapping[str, float] | None = None,
    derivatives: Sequence[str] = (),
) -> FastTransient:
    """Follow a drive from a uniform temperature.

    Parameters
    ----------
    fast : FastModel
    drive : Drive
    initial_temperature : float, [K]
    parameters : mapping of str to float, optional
        Factors, 1 where absent.
    derivatives : sequence of str
        Parameters to differentiate by.

    Returns
    -------
    FastTransient
    """
    if fast.spec.heat.model != "table":
        raise SpecError(
            "heat.model",
            f'"{fast.spec.heat.model}" follows the temperatures of every bearing.',
            'The fast model takes heat.model = "table".',
        )
    run = _LinearRun(fast, drive, parameters or {}, tuple(derivatives))
    return run.solve(initial_temperature)


class _LinearRun:
    """One drive with one set of parameters."""

    def __init__(
        self, fast: FastModel, drive: Drive, parameters: Mapping[str, float], derivatives: tuple[str, ...]
    ) -> None:
        self.fast, self.drive, self.derivatives = fast, drive, derivatives
        self.factors = fast.table.factors(parameters)
        self.operators: list[ClassOperators] = [
            fast.operators(point, self.factors, derivatives) for point in drive.points
        ]
        self.storage = fast.storage(self.factors)
        self.storage_by = fast.storage_by(self.factors, derivatives)
        self.groups = group_steps(drive.step_class, drive.steps)
        self.propagators: dict[tuple[int, float], Propagator] = {
            key: build_propagator(self.storage, self.operators[key[0]].conduction, key[1])
            for key in self.groups
        }
        self.start, self.start_by = self._load_inputs(drive.start)
        self.end, self.end_by = self._load_inputs(drive.end)

    def _load_inputs(self, inputs: Array) -> tuple[Array, dict[str, Array]]:
        """Load inputs of every step at one of its ends, and their derivatives."""
        fast, drive = self.fast, self.drive
        heat = heat_of_table(fast.spec, inputs[:, drive.column("speed")], inputs[:, drive.column("thrust")])
        friction, by = fast.friction_loads(heat, self.factors, self.derivatives)
        found = np.zeros((len(inputs), len(fast.load_names)))
        found[:, : friction.shape[1]] = friction
        found[:, fast.load_names.index("ambient")] = inputs[:, drive.column("ambient")]
        found[:, fast.load_names.index("coolant_inlet")] = inputs[:, drive.column("coolant_inlet")]
        found[:, fast.load_names.index("coolant_friction")] = 1.0
        for number, temperature in enumerate(fast.fixed_fluids):
            found[:, fast.load_names.index(f"fixed[{number}]")] = temperature
        return found, by

    def solve(self, initial_temperature: float) -> FastTransient:
        states = self._march(initial_temperature)
        sensitivities = self._march_sensitivities(states) if self.derivatives else None
        return self._outputs(states, sensitivities)

    def _march(self, initial_temperature: float) -> Array:
        drive, size = self.drive, self.fast.model.size
        added = np.empty((len(drive.steps), size))
        for key, rows in self.groups.items():
            loads = self.operators[key[0]].loads
            added[rows] = load_response(self.propagators[key], self.start[rows], self.end[rows], loads)
        states = np.empty((len(drive.steps) + 1, size))
        states[0] = initial_temperature * self.fast.model.one
        advance = self._advance_by_step()
        for step, matrix in enumerate(advance):
            np.dot(matrix, states[step], out=states[step + 1])
            states[step + 1] += added[step]
        return states

    def _advance_by_step(self) -> list[Array]:
        by_step: list[Array] = [None] * len(self.drive.steps)
        for key, rows in self.groups.items():
            matrix = self.propagators[key].advance
            for row in rows:
                by_step[row] = matrix
        return by_step

    def _march_sensitivities(self, states: Array) -> Array:
        drive, size = self.drive, self.fast.model.size
        forcing = np.zeros((len(drive.steps), size, len(self.derivatives)))
        for key, rows in self.groups.items():
            operators, propagator = self.operators[key[0]], self.propagators[key]
            start, end = self.start[rows], self.end[rows]
            before, after = states[rows], states[rows + 1]
            stage = stage_values(propagator, before, start, end, operators.loads)
            for column, parameter in enumerate(self.derivatives):
                load_start = load_end = None
                if parameter in operators.loads_by:
                    load_start = start @ operators.loads_by[parameter].T
                    load_end = end @ operators.loads_by[parameter].T
                if parameter in self.start_by:
                    heat = operators.loads[:, : self.start_by[parameter].shape[1]].T
                    by_start, by_end = (
                        self.start_by[parameter][rows] @ heat,
                        self.end_by[parameter][rows] @ heat,
                    )
                    load_start = by_start if load_start is None else load_start + by_start
                    load_end = by_end if load_end is None else load_end + by_end
                forcing[rows, :, column] = sensitivity_forcing(
                    propagator,
                    before,
                    stage,
                    after,
                    operators.conduction_by.get(parameter),
                    self.storage_by.get(parameter),
                    load_start,
                    load_end,
                )
        found = np.zeros((len(drive.steps) + 1, size, len(self.derivatives)))
        for step, matrix in enumerate(self._advance_by_step()):
            np.dot(matrix, found[step], out=found[step + 1])
            found[step + 1] += forcing[step]
        return found

    def _outputs(self, states: Array, sensitivities: Array | None) -> FastTransient:
        """Outputs at the wanted times; the class is that of the step that begins there."""
        fast, drive = self.fast, self.drive
        n_out, n_par = len(fast.channels), len(self.derivatives)
        at_grid = np.empty((len(states), n_out))
        by_grid = np.zeros((len(states), n_out, n_par))
        last = len(drive.steps) - 1
        owner = np.append(drive.step_class, drive.step_class[last])
        inputs = np.vstack((self.start, self.end[last:]))
        for number, operators in enumerate(self.operators):
            rows = np.flatnonzero(owner == number)
            at_grid[rows] = states[rows] @ operators.outputs.T + inputs[rows] @ operators.output_inputs.T
            if sensitivities is None:
                continue
            by_grid[rows] = np.einsum("or,nrp->nop", operators.outputs, sensitivities[rows], optimize=True)
            for column, parameter in enumerate(self.derivatives):
                if parameter in operators.outputs_by:
                    by_grid[rows, :, column] += states[rows] @ operators.outputs_by[parameter].T
                    by_grid[rows, :, column] += inputs[rows] @ operators.output_inputs_by[parameter].T
        return FastTransient(
            drive.times,
            fast.channels,
            _at(drive.times, drive.grid, at_grid),
            _at(drive.times, drive.grid, by_grid),
            self.derivatives,
            drive.grid,
            states,
        )


def _at(times: Array, grid: Array, values: Array) -> Array:
    """Values at times by straight lines between the grid's; exact where a time is on the grid."""
    right = np.clip(np.searchsorted(grid, times - 1e-7), 1, grid.size - 1)
    part = np.clip((times - grid[right - 1]) / (grid[right] - grid[right - 1]), 0.0, 1.0)
    part = part.reshape(-1, *([1] * (values.ndim - 1)))
    return values[right - 1] + part * (values[right] - values[right - 1])
