"""Steady state of a machine's network: heat, contacts and preload at its own bearing temperatures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import ConvergenceError, EnergyBalanceError, NoSteadyStateError, SpindleFemError
from spindle_fem.model.lumped.friction_table import tabulate_friction
from spindle_fem.model.lumped.heat_laws import CircuitLaw, CoolantLaw, WallFilmLaw
from spindle_fem.model.lumped.machine_balance import SparseBalance, bearing_temperatures
from spindle_fem.model.lumped.machine_network import MachineNetwork
from spindle_fem.model.lumped.operating_state import OperatingNetwork, coolant_law, operate
from spindle_fem.operation.bearing_heat import (
    BearingMechanics,
    BearingTemperatures,
    HeatModel,
    at_assembly_size,
    heat_model_of,
)
from spindle_fem.operation.loads import BearingHeat
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.fixed_point import REFUSED, Iteration, fixed_point
from spindle_fem.solvers.newton import newton
from spindle_fem.solvers.preload_runaway import SLOWEST, beyond_the_branch, no_equilibrium
from spindle_fem.solvers.solution_branch import Branch, follow_branch

Array = NDArray[np.float64]
BALANCE_TOLERANCE = 1.0e-10
# Share of a conductance lost to its last digit, for some ten roundings of each node that add up at random.
ROUNDING = 10.0 * np.finfo(float).eps
# Change of the bearings' temperatures between rounds of the heat model, K.
TOLERANCE = 1.0e-7
# Contacts that follow their films leave some 1e-5 of the last change: the state is good to about 1e-6 K.
FOLLOWED_TOLERANCE = 0.1
# K; about a state that films will leave, a smaller Newton step is not worth its while.
FIRST_ROUND = 0.05
# Contacts and heat that expansion does not change are taken anew as they are found.
TAKEN_ANEW = Iteration(relaxation=1.0, mixing_below=0.0, most=30)
FOLLOWING_PRELOAD = Iteration(relaxation=0.4, mixing_below=1.0, depth=4, most=150)
# From below, steps towards a fixed point shrink; this many growing ones in a row lead to none.
GROWING_STEPS = 5


@dataclass(frozen=True, slots=True)
class MachineNetworkState:
    """A steady state of a machine's network.

    Attributes
    ----------
    temperature : (n,) ndarray, [K]
    boundary_heat : mapping of film surface to float, [W]
        Out of the machine; ``coolant`` is what the oil carries away.
    heat_in : float, [W]
    imbalance_relative : float
        Of the heat in and out, over the larger of heat and flows; over 1e10 times what rounding
        leaves where that is more.
    coolant_outlet : float, [K]
        NaN without coolant.
    iterations : int
        Newton steps, all rounds.
    """

    network: OperatingNetwork
    temperature: Array
    boundary_heat: Mapping[str, float]
    heat_in: float
    imbalance_relative: float
    coolant_outlet: float
    iterations: int

    def bearing_temperatures(self) -> dict[str, BearingTemperatures]:
        """Raceways, balls and what the rings sit on."""
        return bearing_temperatures(self.network, self.temperature)

    def links(self) -> list[tuple[int, int, str, float]]:
        """Every flow as (first, second, kind, heat from first to second in W); boundaries follow nodes."""
        network = self.network
        both = np.concatenate([self.temperature, network.boundary_temperature])
        flow = network.conductance * (both[network.first] - both[network.second])
        found = list(
            zip(
                network.first.tolist(),
                network.second.tolist(),
                network.kind.tolist(),
                flow.tolist(),
                strict=True,
            )
        )
        ambient = self.temperature.size
        for law in network.laws:
            if isinstance(law, WallFilmLaw):
                heat = np.bincount(law.patch.node, law.heat(self.temperature)[0], self.temperature.size)
                found += [(int(n), ambient, law.name, float(heat[n])) for n in np.flatnonzero(heat)]
            elif isinstance(law, CircuitLaw):
                heat = np.bincount(law.patch.node, law.heat(self.temperature), self.temperature.size)
                found += [(int(n), ambient, law.name, float(heat[n])) for n in np.flatnonzero(heat)]
            elif isinstance(law, CoolantLaw):
                h = law.coefficients(self.temperature)[0]
                coolant = law.nodes[law.cell]
                heat = law.conductances(h)[0] * (self.temperature[law.patch.node] - self.temperature[coolant])
                pairs, inverse = np.unique(
                    np.column_stack([law.patch.node, coolant]), axis=0, return_inverse=True
                )
                summed = np.bincount(inverse.ravel(), heat, len(pairs))
                found += [
                    (int(a), int(b), "coolant", float(value))
                    for (a, b), value in zip(pairs, summed, strict=True)
                ]
        return found


def network_heat_model(machine: MachineNetwork) -> HeatModel:
    """Heat model of a definition, with rings on the elastic bodies of the network."""
    if machine.growth is None:
        return heat_model_of(machine.spec)
    return BearingMechanics(machine.spec, machine.growth.seats)


def solve_machine_network(
    machine: MachineNetwork,
    point: OperatingPoint | None = None,
    *,
    heat_model: HeatModel | None = None,
) -> MachineNetworkState:
    """Steady state of a machine's network with heat, contacts and films at its own temperatures.

    Parameters
    ----------
    point : OperatingPoint, optional
        The definition's own by default.
    heat_model : HeatModel, optional
        The definition's own by default.

    Raises
    ------
    NoSteadyStateError, ConvergenceError, OutOfValidityError
    EnergyBalanceError
        Heat in and out differ by more than 1e-10 of either, or than rounding leaves.

    Where expansion changes the preload, the iteration starts from the state
    without expansion, so that cold grease does not carry it past the fixed
    point, and creeps up while the preload grows.
    """
    point = OperatingPoint.of(machine.spec) if point is None else point
    if not machine.spec.follows_preload:
        return _Operation(machine, point, heat_model or network_heat_model(machine)).solve()
    heat_model = heat_model or network_heat_model(machine)
    try:
        rigid = replace(machine, spec=at_assembly_size(machine.spec))
        first = _Operation(rigid, point, heat_model_of(rigid.spec)).solve()
        return _PreloadOperation(machine, point, heat_model).solve(first.bearing_temperatures())
    except (NoSteadyStateError, ConvergenceError) as error:
        if not isinstance(heat_model, BearingMechanics):
            raise
        return _crept_up(machine, point, heat_model, error)


def _crept_up(
    machine: MachineNetwork,
    point: OperatingPoint,
    mechanics: BearingMechanics,
    error: NoSteadyStateError | ConvergenceError,
) -> MachineNetworkState:
    """The state at the end of the branch of equilibria over the speed, from slow running.

    Raises
    ------
    NoSteadyStateError
        With the speed at which the branch ends before.
    """
    response = _NetworkResponse(machine, point, mechanics)
    try:
        branch = response.branch()
    except SpindleFemError:
        raise error from None
    if branch.end != "end":
        if not isinstance(error, NoSteadyStateError):
            error = no_equilibrium(machine.spec.name, point, "heat and temperatures do not settle.")
        raise beyond_the_branch(error, branch) from error
    network, temperature, steps = response.solved(branch.states[-1], point.speed)
    return _state(network, temperature, steps)


class _NetworkResponse:
    """Feedback from the bearings' heats and contacts through their temperatures."""

    def __init__(self, machine: MachineNetwork, point: OperatingPoint, mechanics: BearingMechanics) -> None:
        self.machine, self.point, self.mechanics = machine, point, mechanics
        self.names = [bearing.name for _, bearing in machine.spec.bearings]
        self.coolant = None if machine.coolant is None else coolant_law(machine, point)
        self.temperature = np.full(machine.n_nodes, point.ambient_temperature)

    def solved(self, state: Array, speed: float) -> tuple[OperatingNetwork, Array, int]:
        """Network, temperatures and Newton steps at given heats and contacts at a speed (rad/s)."""
        count = len(self.names)
        heats = {
            name: BearingHeat(
                heat, {"friction": heat}, conductance_inner=contacts[0], conductance_outer=contacts[1]
            )
            for name, heat, contacts in zip(
                self.names, state[:count].tolist(), state[count:].reshape(count, 2).tolist(), strict=True
            )
        }
        network = operate(
            self.machine,
            replace(self.point, speed=speed),
            lambda point, around: (heats, ()),
            coolant=self.coolant,
        )
        temperature, _, steps = newton(SparseBalance(network), self.temperature)
        return network, temperature, steps

    def respond(self, states: Array, speed: float) -> Array:
        """The states (n, 3 n_bearings) that the temperatures of states make at a speed (rad/s)."""
        around = []
        for state in states:
            network, self.temperature, _ = self.solved(state, speed)
            around.append(bearing_temperatures(network, self.temperature))
        return self._made(around, speed)

    def _made(self, around: Sequence[Mapping[str, BearingTemperatures]], speed: float) -> Array:
        point = replace(self.point, speed=speed)
        heat, conductance = self.mechanics.heat_and_conductance(point, around, expand=True)
        return np.hstack([heat, conductance.reshape(len(around), -1)])

    def branch(self) -> Branch:
        """States of the bearings from slow running to the speed of the point or a fold before."""
        start = SLOWEST * self.point.speed
        cold = _cold(self.machine, self.point.ambient_temperature)
        first = self.respond(self._made([cold], start), start)[0]
        return follow_branch(self.respond, first, start, self.point.speed, weak=2 * len(self.names))


def _cold(machine: MachineNetwork, ambient: float) -> dict[str, BearingTemperatures]:
    """Every bearing of a machine that is at ambient temperature (K) throughout."""
    shifts = {} if machine.growth is None else machine.growth.shifts(np.full(machine.n_solid, ambient))
    return {name: BearingTemperatures(*(ambient,) * 5, shifts.get(name)) for name in machine.ball_nodes}


class _Operation:
    """A machine's network at one point, bearing temperatures by bearing temperatures."""

    def __init__(self, machine: MachineNetwork, point: OperatingPoint, heat_model: HeatModel) -> None:
        self.machine, self.point, self.heat_model = machine, point, heat_model
        self.friction = tabulate_friction(machine.spec, point, heat_model)
        self.coolant = None if machine.coolant is None else coolant_law(machine, point)
        ambient = point.ambient_temperature
        self.temperature = np.full(machine.n_nodes, ambient)
        self.cold = _cold(machine, ambient)
        self.network: OperatingNetwork | None = None
        self.newton_steps = 0
        self.rounds = 0

    def solve(self) -> MachineNetworkState:
        """Steady state with heat and contacts of the bearings at its own temperatures."""
        fixed_point(self.respond, self.settled, _vector(self.cold), TAKEN_ANEW, self.machine.spec.name)
        return _state(self.network, self.temperature, self.newton_steps)

    def respond(self, given: Array) -> Array:
        """Bearing temperatures of the machine with heat and contacts at given ones."""
        self.network = operate(
            self.machine,
            self.point,
            self.heat_model,
            around=_named(given, self.cold),
            friction=self.friction,
            coolant=self.coolant,
        )
        # only where another round follows may the first one end early
        first = self.rounds == 0 and self.friction is not None and self._contacts_follow()
        self.temperature, _, used = newton(
            SparseBalance(self.network), self.temperature, enough=FIRST_ROUND if first else 0.0
        )
        self.newton_steps += used
        self.rounds += 1
        return _vector(bearing_temperatures(self.network, self.temperature))

    def settled(self, given: Array, found: Array) -> bool:
        """Whether the bearings have the temperatures that their contacts were taken at."""
        if not self._contacts_follow():
            return True
        tolerance = TOLERANCE if self.friction is None else FOLLOWED_TOLERANCE
        return self.rounds > 1 and float(np.abs(found - given).max(initial=0.0)) < tolerance

    def _contacts_follow(self) -> bool:
        """Whether a ball row conducts through contacts that change with its temperatures."""
        return any(group.ball_row.kind == "contact" for group in self.machine.spec.bearing_set)


class _PreloadOperation(_Operation):
    """Operation whose preload changes with expansion, and with it the heat."""

    def __init__(self, machine: MachineNetwork, point: OperatingPoint, heat_model: HeatModel) -> None:
        super().__init__(machine, point, heat_model)
        self.change, self.growing = np.inf, 0

    def solve(self, start: Mapping[str, BearingTemperatures]) -> MachineNetworkState:
        """Steady state, from the bearing temperatures without expansion."""
        name = self.machine.spec.name
        try:
            fixed_point(self.respond, self.settled, _vector(start), FOLLOWING_PRELOAD, name)
        except REFUSED as error:
            raise no_equilibrium(name, self.point, str(error)) from error
        return _state(self.network, self.temperature, self.newton_steps)

    def settled(self, given: Array, found: Array) -> bool:
        """Whether the bearings have the temperatures that their heat was taken at; refuses a runaway."""
        name = self.machine.spec.name
        change = float(np.abs(found - given).max())
        if change < TOLERANCE:
            return True
        self.growing = self.growing + 1 if self.change < change else 0
        self.change = change
        if self.growing >= GROWING_STEPS and change > FOLLOWING_PRELOAD.mixing_below:
            raise no_equilibrium(
                name, self.point, "heat grows faster with the preload than the machine carries it away."
            )
        return False


def _vector(around: Mapping[str, BearingTemperatures]) -> Array:
    return np.array([item.state for item in around.values()], dtype=float).ravel()


def _named(values: Array, like: Mapping[str, BearingTemperatures]) -> dict[str, BearingTemperatures]:
    rows = values.reshape(len(like), -1) if like else []
    return {name: BearingTemperatures.of_state(row) for name, row in zip(like, rows, strict=True)}


def _state(network: OperatingNetwork, temperature: Array, iterations: int) -> MachineNetworkState:
    machine, n = network.machine, network.n_nodes
    both = np.concatenate([temperature, network.boundary_temperature])
    flow = network.conductance * (both[network.first] - both[network.second])
    out: dict[str, float] = {}
    outward = network.second >= n
    for kind in dict.fromkeys(network.kind[outward]):
        out[str(kind)] = float(flow[outward & (network.kind == kind)].sum())
    heat_in = float(network.heat.sum())
    for law in network.laws:
        law.require_valid(temperature)
        if isinstance(law, WallFilmLaw):
            out[law.name] = float(law.heat(temperature)[0].sum())
        elif isinstance(law, CircuitLaw):
            out[law.name] = float(law.heat(temperature).sum())
        elif not isinstance(law, CoolantLaw):
            heat_in += float(law(temperature)[0].sum())
    outlet = float("nan")
    if machine.coolant is not None:
        outlet = float(temperature[network.streams[1][-1]])
        rises = both[network.streams[1]] - both[network.streams[0]]
        out["coolant"] = float(network.stream_rate * rises.sum())
    # where a node's conductances are rounded, heat of its absolute temperature appears: most from many thin
    # cells, and all that there is at rest
    of_node = np.bincount(np.append(network.first, network.second), np.tile(network.conductance, 2))
    rounding = ROUNDING * float(np.linalg.norm(of_node)) * float(both.max())
    scale = max(abs(heat_in), *(abs(value) for value in out.values()), rounding / BALANCE_TOLERANCE)
    imbalance = abs(heat_in - sum(out.values())) / scale
    if imbalance > BALANCE_TOLERANCE:
        raise EnergyBalanceError(
            machine.spec.name,
            f"the network takes in {heat_in:.9g} W and gives off {sum(out.values()):.9g} W "
            f"({imbalance:.1e} relative).",
            f"Allowed: {BALANCE_TOLERANCE:.0e}.",
        )
    return MachineNetworkState(network, temperature, out, heat_in, imbalance, outlet, iterations)
