"""Gradient of a function of all predictions in one backward pass, whatever the number of parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import Term
from spindle_fem.errors import SpecError
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.model.reduced.exponential_step import ExactPropagator
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.reduced_transient import TransientRun, grid_weights
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.model.reduced.trbdf2_matrices import GAMMA, SHARE, STAGE_WEIGHT, START_WEIGHT, stage_values

Array = NDArray[np.float64]


def fast_gradient(
    fast: FastModel,
    drive: Drive,
    initial: float | Array | Start,
    by_prediction: Array,
    derivatives: Sequence[str],
    *,
    parameters: Mapping[str, float] | None = None,
    terms: Sequence[Term] = (),
) -> Array:
    """Derivative of a scalar to the logarithms of parameters, by the discrete adjoint.

    Exact for the discrete solution: the same as contracting the sensitivities
    of :func:`spindle_fem.model.reduced.reduced_transient.simulate_fast`, at the price of
    about one more run.

    Parameters
    ----------
    fast : FastModel
    drive : Drive
    initial : float, (r,) ndarray or Start
        As :func:`spindle_fem.model.reduced.reduced_transient.simulate_fast` takes it.
    by_prediction : (N, c) ndarray, [1/K]
        Derivative of the scalar to every prediction, channels as the model has
        them; for half a sum of squared residuals these are the residuals.
    derivatives : sequence of str
    parameters : mapping of str to float, optional
    terms : sequence of Term
        Such as only change coefficients, capacities or flow.

    Returns
    -------
    (p,) ndarray

    Raises
    ------
    SpecError
        A term that depends on temperature or time: take the sensitivities.
    """
    run = TransientRun(fast, drive, parameters or {}, tuple(derivatives), tuple(terms), open_loop=False)
    if run.dynamic is not None:
        raise SpecError(
            "gradient",
            "a term depends on temperature or time.",
            "Contract the sensitivities of simulate_fast instead.",
        )
    start = Start.of(initial, fast.model.one)
    states, _ = run.march(start)
    weights = np.zeros((len(states), len(fast.channels)))
    right, part = grid_weights(drive.times, drive.grid)
    np.add.at(weights, right - 1, (1.0 - part)[:, None] * by_prediction)
    np.add.at(weights, right, part[:, None] * by_prediction)
    owner = np.append(drive.step_class, drive.step_class[-1])
    seeds = np.empty_like(states)
    for number, operators in enumerate(run.operators):
        rows = np.flatnonzero(owner == number)
        seeds[rows] = weights[rows] @ operators.outputs
    adjoint, gradient = _march_back(run, start, seeds)
    gradient += _direct(run, states, weights, owner)
    if any(isinstance(item, ExactPropagator) for item in run.propagators.values()):
        # A few unknowns: their derivatives are as cheap as anything cleverer.
        return gradient + np.einsum("nr,nrp->p", adjoint, run.forcing_of(states, None))
    for key, rows in run.groups.items():
        gradient += _of_group(run, key, rows, states, adjoint[rows])
    return gradient


def _march_back(run: TransientRun, start: Start, seeds: Array) -> tuple[Array, Array]:
    """Derivative of the scalar to the end of each step, (G, r); gradient through the given states, (p,)."""
    given, slopes = start.rows(), start.derivatives(run.derivatives)
    gradient = np.zeros(len(run.derivatives))
    transposed = [np.ascontiguousarray(run.propagators[key].advance.T) for key in run.groups]
    adjoint = np.empty((len(seeds) - 1, seeds.shape[1]))
    carried = seeds[-1].copy()
    for step in range(len(adjoint) - 1, -1, -1):
        adjoint[step] = carried
        carried = transposed[run.group_of_step[step]] @ carried + seeds[step]
        if step in given:
            gradient += carried @ slopes[given[step]]
            # What came before a given state does not move it.
            carried = np.zeros_like(carried)
    return adjoint, gradient


def _direct(run: TransientRun, states: Array, weights: Array, owner: NDArray[np.int64]) -> Array:
    """Through the outputs themselves: the coolant's outlet depends on its film."""
    gradient = np.zeros(len(run.derivatives))
    inputs = np.vstack((run.start, run.end[-1:]))
    for number, operators in enumerate(run.operators):
        rows = np.flatnonzero(owner == number)
        for column, parameter in enumerate(run.derivatives):
            if parameter in operators.outputs_by:
                gradient[column] += np.sum((weights[rows].T @ states[rows]) * operators.outputs_by[parameter])
                gradient[column] += np.sum(
                    (weights[rows].T @ inputs[rows]) * operators.output_inputs_by[parameter]
                )
    return gradient


def _of_group(
    run: TransientRun, key: tuple[int, float], rows: NDArray[np.int64], states: Array, adjoint: Array
) -> Array:
    """Through the matrices and loads of equal steps."""
    operators, propagator = run.operators[key[0]], run.propagators[key]
    weight = SHARE * propagator.step
    start, end = run.start[rows], run.end[rows]
    before, after = states[rows], states[rows + 1]
    stage = stage_values(propagator, before, start, end, operators.loads)
    first, second = adjoint @ propagator.carried, adjoint @ propagator.inverse
    by_conduction = -weight * (first.T @ (before + stage) + second.T @ after)
    by_loads = weight * (first.T @ ((2.0 - GAMMA) * start + GAMMA * end) + second.T @ end)
    by_storage = None
    gradient = np.zeros(len(run.derivatives))
    for column, parameter in enumerate(run.derivatives):
        if parameter in operators.conduction_by:
            gradient[column] += np.sum(by_conduction * operators.conduction_by[parameter])
        if parameter in run.built.storage_by:
            if by_storage is None:
                moved = STAGE_WEIGHT * stage - START_WEIGHT * before - after
                by_storage = first.T @ (before - stage) + second.T @ moved
            gradient[column] += np.sum(by_storage * run.built.storage_by[parameter])
        if parameter in operators.loads_by:
            gradient[column] += np.sum(by_loads * operators.loads_by[parameter])
        if parameter in run.start_by:
            columns = run.start_by[parameter].shape[1]
            heat = operators.loads[:, :columns]
            at_start, at_end = run.start_by[parameter][rows], run.end_by[parameter][rows]
            gradient[column] += weight * np.sum((first @ heat) * ((2.0 - GAMMA) * at_start + GAMMA * at_end))
            gradient[column] += weight * np.sum((second @ heat) * at_end)
    return gradient
