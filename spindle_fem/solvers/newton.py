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
# Steps in time: how many, K that one may warm, share of the imbalance that is near, K of what runs away.
MOST_MARCHED, LONGEST_MARCH, NEAR_ENOUGH, HOTTEST_MARCHED = 200, 20.0, 1.0e-3, 900.0
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
    begun = np.array(start, dtype=float)
    try:
        return _iterated(balance, begun, enough)
    except NoSteadyStateError:
        nearer = _marched(balance, begun)
        if nearer is None:
            raise
        return _iterated(balance, nearer, enough)


def _iterated(balance: SparseBalance, start: Array, enough: float) -> tuple[Array, Matrix, int]:
    """Damped steps from a start until they settle."""
    temperature = start
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


def _marched(balance: SparseBalance, start: Array) -> Array | None:
    """State reached by implicit time steps, with each node's capacity set to its losses; None if none.

    Cold grease may rub more as it warms: there Newton's step points away from where the machine warms to,
    and steps in time, longer as less happens in them, follow it (pseudo-transient continuation).

    Raises
    ------
    NoSteadyStateError
        It warms without end.
    """
    temperature = start
    net, derivative = balance(temperature)
    first = float(np.abs(net).max(initial=0.0))
    inertia = 1.0
    for _ in range(MOST_MARCHED):
        diagonal = np.asarray(derivative.diagonal())
        # a node whose heat grows faster than its losses still has to warm forwards in time
        share = np.where(diagonal > 0.0, max(inertia, 2.0), inertia)
        try:
            change = _step(balance, _with_inertia(derivative, share * np.abs(diagonal)), net)
        except NoSteadyStateError:
            return None
        longest = float(np.abs(change).max(initial=0.0))
        if longest > LONGEST_MARCH:
            change = change * (LONGEST_MARCH / longest)
        inertia *= 2.0 if longest > LONGEST_MARCH else 0.5
        temperature = temperature + change
        if not np.all(np.isfinite(temperature)):
            return None
        if temperature.max(initial=0.0) > HOTTEST_MARCHED:
            hottest = balance.node_names[int(temperature.argmax())]
            what = f'node "{hottest}" warms beyond {HOTTEST_MARCHED - 273.15:.0f} °C, and on.'
            raise NoSteadyStateError(balance.name, what, "Lower speed, load or preload, or cool more.")
        net, derivative = balance(temperature)
        if float(np.abs(net).max(initial=0.0)) < NEAR_ENOUGH * first:
            return temperature
    return None


def _with_inertia(derivative: Matrix, inertia: Array) -> Matrix:
    if isinstance(derivative, np.ndarray):
        return derivative - np.diag(inertia)
    return sparse.csc_array(derivative - sparse.diags_array(inertia))


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
