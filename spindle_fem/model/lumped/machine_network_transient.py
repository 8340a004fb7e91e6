"""A machine's network over time: exponential steps of second order.

The equations are linear but for films and friction, so a step solves its
linearisation exactly and corrects for the rest: the stiff modes of coolant and
air cost nothing, and at ten-second steps the error is far below a millikelvin.

Source: Hochbruck & Ostermann (2010), Acta Numerica 19, 209-286, sections 2.3
(exponential Rosenbrock methods) and 2.1 (phi functions).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from spindle_fem.errors import NoSteadyStateError, SpecError
from spindle_fem.model.lumped.friction_table import FrictionTables, tabulate_friction
from spindle_fem.model.lumped.machine_network import MachineNetwork
from spindle_fem.model.lumped.machine_steady import SparseBalance, bearing_temperatures, follows_preload
from spindle_fem.model.lumped.operating_state import OperatingNetwork, coolant_law, operate
from spindle_fem.operation.bearing_heat import HeatModel, heat_model_of
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]
RELINEARISE_AFTER = 4.0
# Bearings that have moved this far (K) have their heat and contacts taken anew where expansion is followed.
PRELOAD_AFTER = 0.25
# The same for bearings that only creep, after this many steps.
CREEP_AFTER, CREEP_STEPS = 0.01, 20
RUNAWAY_TEMPERATURE = 600.0
# Steps between looks at whether films and friction are still inside their tables.
CHECK_EVERY = 10
# The second-order part of a step; its own error is a small share of this.
LARGEST_CORRECTION = 0.02
SHORTEST_STEP = 1.0e-3


@dataclass(frozen=True, slots=True)
class MachineTransient:
    """Temperatures over time.

    Attributes
    ----------
    times : (N,) ndarray, [s]
    temperature : (N, n) ndarray, [K]
    node_names : tuple of str
    linearisations : int
        How often the propagators were made.
    """

    times: Array
    temperature: Array
    node_names: tuple[str, ...]
    linearisations: int


class _Propagator:
    """Exact solution of the linearised equations over one step length."""

    def __init__(self, balance: SparseBalance, network: OperatingNetwork, state: Array, step: float) -> None:
        self.rate = balance.jacobian(state) / network.machine.capacity[:, None]
        self.inverse_capacity = 1.0 / network.machine.capacity
        self.state, self.step = state.copy(), step
        scaled = step * self.rate
        decay = scipy.linalg.expm(scaled)
        identity = np.eye(len(state))
        factored = scipy.linalg.lu_factor(scaled)
        phi_one = scipy.linalg.lu_solve(factored, decay - identity)
        self.level = step * phi_one
        self.slope = step * scipy.linalg.lu_solve(factored, phi_one - identity)


def simulate_machine_network(
    machine: MachineNetwork,
    times: ArrayLike,
    schedule: Sequence[tuple[float, OperatingPoint]],
    initial: ArrayLike | None = None,
    *,
    heat_model: HeatModel | None = None,
) -> MachineTransient:
    """Follow a machine's network through operating points that hold until the next.

    Parameters
    ----------
    machine : MachineNetwork
        Of the paper's size: the propagators are dense.
    times : (N,) array_like, [s]
        Increasing; one step between neighbours.
    schedule : sequence of (start [s], OperatingPoint)
        Increasing; each must start at one of ``times``, the first at or before the first.
    initial : (n,) array_like, [K], optional
        The first point's ambient temperature by default.
    heat_model : HeatModel, optional

    Raises
    ------
    SpecError
        Times or schedule out of order.
    NoSteadyStateError
        The temperatures run away.
    OutOfValidityError
        Films or friction beyond the range they are known for.

    With ``heat.thermal_preload`` heat and contacts follow the bearings in steps
    of 0.25 K.
    """
    instants = np.asarray(times, dtype=float)
    starts = np.array([start for start, _ in schedule])
    if instants.size < 2 or np.any(np.diff(instants) <= 0.0):
        raise SpecError("times", "they do not increase.", "Allowed: two or more increasing times in s.")
    if not len(starts) or starts[0] > instants[0] or np.any(np.diff(starts) <= 0.0):
        raise SpecError(
            "schedule", "it does not cover the times.", "Allowed: increasing starts, the first in time."
        )
    if not np.isin(starts[1:], instants).all():
        raise SpecError(
            "schedule", "a change falls between two times.", "Allowed: changes at one of the times."
        )
    heat_model = heat_model_of(machine.spec) if heat_model is None else heat_model
    ambient = schedule[0][1].ambient_temperature
    state = np.full(machine.n_nodes, ambient) if initial is None else np.array(initial, dtype=float)
    temperature = np.empty((instants.size, machine.n_nodes))
    temperature[0] = state
    segment, stepper, linearisations = -1, None, 0
    for k, step in enumerate(np.diff(instants)):
        current = int(np.searchsorted(starts, instants[k], side="right")) - 1
        if current != segment:
            segment = current
            linearisations += 0 if stepper is None else stepper.linearisations
            point = schedule[segment][1]
            stepper = _Stepper(machine, point, heat_model, state)
        state = stepper.cross(state, float(step))
        if not np.all(np.isfinite(state)) or state.max() > RUNAWAY_TEMPERATURE:
            raise NoSteadyStateError(
                machine.spec.name,
                f"the network runs away at {instants[k + 1]:.0f} s.",
                "Lower the speed or the preload, or cool more.",
            )
        temperature[k + 1] = state
        if k % CHECK_EVERY == 0 or k == instants.size - 2:
            for law in stepper.network.laws:
                law.require_valid(state)
    return MachineTransient(
        instants, temperature, machine.node_names, linearisations + stepper.linearisations
    )


class _Stepper:
    """Steps at one operating point, with the propagators made so far."""

    def __init__(
        self, machine: MachineNetwork, point: OperatingPoint, heat_model: HeatModel, state: Array
    ) -> None:
        self.machine, self.point, self.heat_model = machine, point, heat_model
        self.friction: FrictionTables | None = tabulate_friction(machine.spec, point, heat_model)
        self.coolant = None if machine.coolant is None else coolant_law(machine, point)
        self.linearisations = 0
        self.bearing_nodes = np.array(sorted(self._bearing_nodes()), dtype=np.int64)
        self.follows = follows_preload(machine.spec)
        self.network: OperatingNetwork | None = None
        self._take_up(state)

    def _bearing_nodes(self) -> set[int]:
        nodes = set(self.machine.ball_nodes.values())
        for name in self.machine.ball_nodes:
            for side in ("inner", "outer"):
                nodes |= set(self.machine.surfaces[f"{name}.{side}_raceway"].node.tolist())
        return nodes

    def _take_up(self, state: Array) -> None:
        """Heat and contacts at a state; twice the first time, since raceways follow from the heat."""
        for _ in range(2 if self.network is None else 1):
            around = None if self.network is None else bearing_temperatures(self.network, state)
            self.network = operate(
                self.machine, self.point, self.heat_model, around=around, friction=self.friction,
                coolant=self.coolant,
            )  # fmt: skip
        self.balance = SparseBalance(self.network)
        self.propagators: dict[float, _Propagator] = {}
        self.taken, self.steps = state[self.bearing_nodes].copy(), 0

    def _keep_up(self, state: Array) -> None:
        if not self.follows:
            return
        moved = float(np.abs(state[self.bearing_nodes] - self.taken).max(initial=0.0))
        self.steps += 1
        if moved > PRELOAD_AFTER or (self.steps >= CREEP_STEPS and moved > CREEP_AFTER):
            self._take_up(state)

    def cross(self, state: Array, length: float) -> Array:
        """Over one interval, in halves where the equations bend too much within it."""
        self._keep_up(state)
        after, correction = _advance(self._propagator(state, length), self.balance, state)
        if correction <= LARGEST_CORRECTION or length <= SHORTEST_STEP:
            return after
        return self.cross(self.cross(state, 0.5 * length), 0.5 * length)

    def _propagator(self, state: Array, length: float) -> _Propagator:
        key = round(length, 9)
        stored = self.propagators.get(key)
        moved = np.inf if stored is None else float(np.abs(state - stored.state).max())
        if stored is None or (self.network.laws and moved > RELINEARISE_AFTER):
            stored = self.propagators[key] = _Propagator(self.balance, self.network, state, key)
            self.linearisations += 1
        return stored


def _advance(propagator: _Propagator, balance: SparseBalance, state: Array) -> tuple[Array, float]:
    """One step: exponential Euler, then the change of what is not linear; and how large that is, K."""
    rate = propagator.inverse_capacity * balance.net_heat(state)
    euler = state + propagator.level @ rate
    if not balance.network.laws:
        return euler, 0.0
    change = propagator.inverse_capacity * balance.net_heat(euler) - rate - propagator.rate @ (euler - state)
    correction = propagator.slope @ change
    return euler + correction, float(np.abs(correction).max())
