"""Damped Newton iteration for heat balances that give their own derivative.

Source: Deuflhard (2004), Newton Methods for Nonlinear Problems, chapter 3 (residual monotonicity).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from spindle_fem.errors import ConvergenceError, NoSteadyStateError
from spindle_fem.model.lumped.machine_balance import SparseBalance

Array = NDArray[np.float64]
Matrix = sparse.csc_array | Array
# K; a step beyond it comes from a matrix that is singular but for rounding.
LARGEST_STEP = 1.0e9
SMALLEST_DAMPING = 1.0e-4
MOST_STEPS = 60
# K; a balance that is not linear must also have stopped moving.
SETTLED = 1.0e-8


def newton(
    balance: SparseBalance,
    start: Array,
    *,
    enough: float = 0.0,
) -> tuple[Array, Matrix, int]:
    """Temperatures at which every node's net heat is zero.

    Parameters
    ----------
    start : (n,) ndarray, [K]
    enough : float, [K]
        A step that moves less ends the iteration, whatever imbalance is left.

    Returns
    -------
    temperature : (n,) ndarray, [K]
    derivative : (n, n) matrix, [W/K]
        Of the net heat, there.

    Raises
    ------
    NoSteadyStateError
        The balance is singular, or no step lowers the imbalance.
    ConvergenceError
        Steps used up.
    """
    temperature = np.array(start, dtype=float)
    net, derivative = balance(temperature)
    norm = float(np.abs(net).max(initial=0.0))
    for step in range(1, MOST_STEPS + 1):
        change = _step(balance, derivative, net)
        trial, trial_net, trial_derivative, floor = _damped(balance, temperature, change, net, derivative)
        moved = float(np.abs(trial - temperature).max(initial=0.0))
        temperature, net, derivative = trial, trial_net, trial_derivative
        norm = float(np.abs(net).max(initial=0.0))
        if moved < enough or (norm <= floor and (balance.is_linear or moved < SETTLED)):
            return temperature, derivative, step
    raise ConvergenceError(
        balance.name,
        f"{MOST_STEPS} Newton steps left an imbalance of {norm:.3g} W.",
        "Start nearer to the solution or allow more steps.",
    )


def _step(balance: SparseBalance, derivative: Matrix, net: Array) -> Array:
    """Newton's step; a singular matrix is refused, a full one by how far it would go."""
    try:
        if not isinstance(derivative, np.ndarray):
            return splu(derivative).solve(-net)
        step = np.linalg.solve(derivative, -net)
        if not np.isfinite(step).all() or np.abs(step).max(initial=0.0) > LARGEST_STEP:
            raise np.linalg.LinAlgError("singular")
    except (RuntimeError, np.linalg.LinAlgError) as error:
        raise NoSteadyStateError(
            balance.name,
            "the heat balance is singular.",
            "A body loses no heat at this state, or heat grows with temperature as fast as it is lost.",
        ) from error
    return step


def _damped(
    balance: SparseBalance, temperature: Array, change: Array, net: Array, derivative: Matrix
) -> tuple[Array, Array, Matrix, float]:
    """First of the halved steps that lowers the imbalance: state, net heat, derivative, rounding."""
    norm, damping = float(np.abs(net).max(initial=0.0)), 1.0
    while damping >= SMALLEST_DAMPING:
        trial = temperature + damping * change
        if np.all(np.isfinite(trial)) and np.all(trial > 0.0):
            trial_net, trial_derivative = balance(trial)
            floor = balance.rounding(trial, derivative)
            if float(np.abs(trial_net).max(initial=0.0)) <= max((1.0 - 0.25 * damping) * norm, floor):
                return trial, trial_net, trial_derivative, floor
        damping *= 0.5
    worst = balance.node_names[int(np.abs(net).argmax())]
    raise NoSteadyStateError(
        balance.name,
        f'no step lowers the imbalance of {norm:.3g} W at node "{worst}".',
        "Heat grows with temperature faster than it is lost, or a law and its derivative disagree.",
    )
