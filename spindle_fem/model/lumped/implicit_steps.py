"""Implicit second-order steps of any network: TR-BDF2 with analytic Jacobians.

The scheme is that of :mod:`spindle_fem.model.trbdf2`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spindle_fem.errors import ConvergenceError
from spindle_fem.model.lumped.driven_inputs import boundary_history, source_history
from spindle_fem.model.lumped.node_balance import NetworkBalance, explicit_derivative
from spindle_fem.model.lumped.thermal_network import Array, Parameter, ThermalNetwork
from spindle_fem.model.trbdf2 import (
    DIAGONAL,
    GAMMA,
    OUTER_WEIGHT,
    error_defect,
    extrapolated_end,
    right_of_end,
    right_of_middle,
)
from spindle_fem.recordings.input_samples import InputHistory

NEWTON_TOLERANCE = 1.0e-11
SLOW_CONTRACTION = 0.1
ROUNDING_UNITS = 4.0
MAX_NEWTON = 15
# Of an interval; also what rounding may leave of one.
SHORTEST_STEP = 1.0e-9


@dataclass(slots=True)
class StepCounts:
    """What a transient cost and how well its energy balances.

    Attributes
    ----------
    heat_stored, heat_in : float, [J]
        Change of stored heat, and the time integral (by the scheme's own
        quadrature) of the net heat into all nodes.
    heat_exchanged : float, [J]
        Integral of the magnitudes of the net heats.
    """

    steps: int = 0
    rejected: int = 0
    newton: int = 0
    heat_stored: float = 0.0
    heat_in: float = 0.0
    heat_exchanged: float = 0.0

    @property
    def imbalance_relative(self) -> float:
        """Difference of stored and received heat over all the heat exchanged."""
        if self.heat_exchanged == 0.0:
            return 0.0
        return abs(self.heat_stored - self.heat_in) / self.heat_exchanged


class _Forcing:
    """Boundary temperatures, node heat and law inputs inside one interval."""

    def __init__(self, network: ThermalNetwork, history: InputHistory) -> None:
        ends = history.ends()
        self.names, self.values = history.names, ends
        self.boundary = [boundary_history(network, history, v) for v in ends]
        self.source = [source_history(network, history, v) for v in ends]
        self.node_heat = [network.node_heat(s) for s in self.source]
        self.needs_inputs = not network.is_linear

    def at(self, interval: int, fraction: float) -> tuple[Array, Array, dict[str, float]]:
        """Boundary ``(b,)``, node heat ``(n,)`` and inputs at a fraction of the interval."""
        inputs: dict[str, float] = {}
        if self.needs_inputs:
            values = self._mixed(self.values, interval, fraction)
            inputs = dict(zip(self.names, values.tolist(), strict=True))
        return (
            self._mixed(self.boundary, interval, fraction),
            self._mixed(self.node_heat, interval, fraction),
            inputs,
        )

    def sources_at(self, interval: int, fraction: float) -> Array:
        return self._mixed(self.source, interval, fraction)

    @staticmethod
    def _mixed(ends: list[Array] | tuple[Array, Array], interval: int, fraction: float) -> Array:
        start = ends[0][interval]
        return start + fraction * (ends[1][interval] - start)


def implicit_transient(
    network: ThermalNetwork,
    history: InputHistory,
    initial: Array,
    outputs: Array,
    parameters: tuple[Parameter, ...] = (),
    initial_derivative: Array | None = None,
    *,
    step_error: float | None = 1.0e-3,
    max_step: float = np.inf,
) -> tuple[Array, Array, Array, StepCounts]:
    """Temperatures at every time and their derivatives to log-parameters.

    Parameters
    ----------
    initial : (n,) ndarray, [K]
    outputs : (q,) int ndarray
    initial_derivative : (n, p) ndarray, [K], optional
    step_error : float or None, [K]
        Largest estimated error of a step; steps are divided to keep it. None:
        one step an interval, or as many as ``max_step`` asks for.
    max_step : float, [s]

    Returns
    -------
    temperature : (N, q) ndarray, [K]
    sensitivity : (N, q, p) ndarray, [K]
        Derivatives of the discrete solution, step lengths held.
    final : (n,) ndarray, [K]

    Raises
    ------
    ConvergenceError
        A step fails at any length: heat and temperature run away.
    """
    stepper = _Stepper(network, history, parameters, step_error, max_step)
    state = np.array(initial, dtype=float)
    number = len(parameters)
    slope = np.zeros((network.n_nodes, number))
    if initial_derivative is not None:
        slope = np.array(initial_derivative, dtype=float)
    temperature = np.empty((history.times.size, len(outputs)))
    sensitivity = np.empty((history.times.size, len(outputs), number))
    temperature[0], sensitivity[0] = state[outputs], slope[outputs]
    for interval in range(history.times.size - 1):
        state, slope = stepper.cross(interval, state, slope)
        temperature[interval + 1], sensitivity[interval + 1] = state[outputs], slope[outputs]
    stepper.counts.heat_stored = float(network.capacity @ (state - np.asarray(initial)))
    return temperature, sensitivity, state, stepper.counts


class _Stepper:
    def __init__(self, network, history, parameters, step_error, max_step):
        self.network = network
        self.balance = NetworkBalance(network)
        self.forcing = _Forcing(network, history)
        self.times = history.times
        self.parameters = parameters
        self.step_error, self.max_step = step_error, max_step
        self.wanted_step = np.inf
        self._rate = np.zeros(network.n_nodes)
        self.counts = StepCounts()
        self._matrix_step = np.nan
        self._rounding = 0.0
        self._inverse = np.empty(0)

    def cross(self, interval: int, state: Array, slope: Array) -> tuple[Array, Array]:
        """From one time of the history to the next."""
        length = self.times[interval + 1] - self.times[interval]
        shortest = SHORTEST_STEP * length
        done = 0.0
        while length - done > shortest:
            step = self._next_length(length, length - done)
            outcome = self._try(interval, done / length, step, length, state)
            ratio = np.inf
            if outcome is not None:
                stages, error = outcome
                ratio = 0.0 if self.step_error is None else error / self.step_error
            if ratio > 1.0:
                self.counts.rejected += 1
                shrunk = 0.25 if outcome is None else max(0.2, 0.9 * ratio ** (-1.0 / 3.0))
                self.wanted_step = shrunk * step
                if self.wanted_step < shortest or self.step_error is None:
                    raise ConvergenceError(
                        "network",
                        f"no step succeeds at {self.times[interval] + done:.6g} s.",
                        "Heat may grow with temperature without limit, or a law and its derivative disagree.",
                    )
                continue
            growth = min(4.0, 0.9 * max(ratio, 1.0e-6) ** (-1.0 / 3.0))
            # a step cut short by the end of an interval says nothing against the longer one before it
            self.wanted_step = max(growth * step, self.wanted_step if step < self.wanted_step else 0.0)
            if self.parameters:
                slope = self._slope(interval, done / length, step, length, state, stages, slope)
            self._account(step, stages)
            self._rate = (stages[1][0] - state) / step
            state = stages[1][0]
            done += step
        return state, slope

    def _next_length(self, length: float, remaining: float) -> float:
        """Length of the next step: even parts of what remains, none above what is wanted."""
        if self.step_error is None:
            # equal steps over the whole interval, whatever came before
            return length / max(1.0, np.ceil(length / self.max_step * (1.0 - 1.0e-12)))
        return remaining / max(1.0, np.ceil(remaining / min(self.wanted_step, self.max_step)))

    def _try(self, interval, fraction, step, length, state):
        """Both stages as (temperature, net heat, inputs) and the error, or None if Newton fails."""
        middle = fraction + GAMMA * step / length
        end = fraction + step / length
        first_net = self.balance.net_heat(state, *self.forcing.at(interval, fraction))
        capacity = self.network.capacity
        guess = state + GAMMA * step * self._rate
        stage = self._solve(right_of_middle(capacity * state, step, first_net), step, interval, middle, guess)
        if stage is None:
            return None
        two, two_net = stage
        known = right_of_end(capacity * state, step, first_net, two_net)
        stage = self._solve(known, step, interval, end, extrapolated_end(state, two))
        if stage is None:
            return None
        three, three_net = stage
        error = 0.0
        if self.step_error is not None:
            defect = error_defect(step, (first_net, two_net, three_net))
            # the filter by the step matrix keeps the estimate bounded for stiff modes (Hosea and Shampine)
            error = float(np.abs(self._inverse @ defect).max(initial=0.0))
        return ((two, two_net, first_net), (three, three_net)), error

    def _solve(self, known, step, interval, fraction, guess):
        """Solve ``C T - dt d F(T) = known`` by Newton; the inverse is kept while it converges."""
        capacity, scaled = self.network.capacity, step * DIAGONAL
        forcing = self.forcing.at(interval, fraction)
        temperature, previous = guess, np.inf
        if step != self._matrix_step:
            self._refactor(temperature, forcing, step)
        for iteration in range(MAX_NEWTON):
            self.counts.newton += 1
            net = self.balance.net_heat(temperature, *forcing)
            change = self._inverse @ (known - capacity * temperature + scaled * net)
            size = float(np.abs(change).max())
            temperature = temperature + change
            if not math.isfinite(size) or (size > 1.0 and temperature.min() <= 0.0):
                return None
            contraction = size / previous
            # what is left after this change is smaller by the contraction that the last two show
            left = size * contraction if iteration and contraction < SLOW_CONTRACTION else size
            if left <= max(NEWTON_TOLERANCE, self._rounding):
                return temperature, self.balance.net_heat(temperature, *forcing)
            if iteration and contraction > SLOW_CONTRACTION:
                self._refactor(temperature, forcing, step)
            previous = size
        return None

    def _refactor(self, temperature, forcing, step) -> None:
        derivative = self.balance(temperature, *forcing)[1]
        scaled, capacity = step * DIAGONAL, self.network.capacity
        self._inverse = np.linalg.inv(np.diag(capacity) - scaled * derivative)
        self._matrix_step = step
        # what the rounding of large flows between tightly joined nodes leaves in a Newton change
        sizes = capacity * temperature + scaled * (np.abs(derivative) @ temperature)
        self._rounding = ROUNDING_UNITS * np.finfo(float).eps * float((np.abs(self._inverse) @ sizes).max())

    def _account(self, step, stages) -> None:
        (two, two_net, first_net), (three, three_net) = stages
        del two, three
        received = step * (OUTER_WEIGHT * (first_net + two_net) + DIAGONAL * three_net)
        self.counts.steps += 1
        self.counts.heat_in += float(received.sum())
        self.counts.heat_exchanged += float(np.abs(received).sum())

    def _slope(self, interval, fraction, step, length, state, stages, slope):
        """Derivative of the step to the log-parameters."""
        capacity = self.network.capacity[:, None]
        points = (fraction, fraction + GAMMA * step / length, fraction + step / length)
        (two, _, _), (three, _) = stages
        rates, jacobians = [], []
        for temperature, point in zip((state, two, three), points, strict=True):
            forcing = self.forcing.at(interval, point)
            jacobians.append(self.balance(temperature, *forcing)[1])
            sources = self.forcing.sources_at(interval, point)
            rates.append(self._explicit(temperature, forcing[0], sources))
        inertia = [self._inertia(stage - state) for stage in (two, three)]
        first = jacobians[0] @ slope + rates[0]
        matrix = np.diag(self.network.capacity) - step * DIAGONAL * jacobians[1]
        known = capacity * slope - inertia[0] + step * DIAGONAL * (first + rates[1])
        slope_two = np.linalg.solve(matrix, known)
        second = jacobians[1] @ slope_two + rates[1]
        matrix = np.diag(self.network.capacity) - step * DIAGONAL * jacobians[2]
        known = capacity * slope - inertia[1] + step * (OUTER_WEIGHT * (first + second) + DIAGONAL * rates[2])
        return np.linalg.solve(matrix, known)

    def _inertia(self, change: Array) -> Array:
        """``(dC/d ln p) (T - T_n)``, ``(n, p)``."""
        result = np.zeros((self.network.n_nodes, len(self.parameters)))
        for p, parameter in enumerate(self.parameters):
            if parameter.kind == "capacity":
                node = parameter.index
                result[node, p] = self.network.capacity[node] * change[node]
        return result

    def _explicit(self, temperature: Array, boundary: Array, sources: Array) -> Array:
        """Derivative of the net heat to the log-parameters at fixed temperature, ``(n, p) [W]``."""
        return explicit_derivative(
            self.network, self.balance, self.parameters, temperature, boundary, sources
        )
