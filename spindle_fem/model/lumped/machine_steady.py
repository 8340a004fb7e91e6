"""Steady state of a machine's network: Newton with sparse, analytic Jacobian."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import ConvergenceError, EnergyBalanceError, NoSteadyStateError
from spindle_fem.model.lumped.friction_table import tabulate_friction
from spindle_fem.model.lumped.heat_laws import CoolantLaw, WallFilmLaw
from spindle_fem.model.lumped.machine_network import MachineNetwork
from spindle_fem.model.lumped.operating_state import OperatingNetwork, coolant_law, operate
from spindle_fem.model.lumped.preload_feedback import highest_settling_speed, settle, with_limit
from spindle_fem.operation.bearing_heat import BearingTemperatures, HeatModel, heat_model_of
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]
BALANCE_TOLERANCE = 1.0e-10
NEWTON_STEPS = 40
CONTACT_ROUNDS = 30
CONTACT_TOLERANCE = 1.0e-7
# Contacts that follow their films leave some 1e-5 of the last change: the state is good to about 1e-6 K.
FOLLOWED_TOLERANCE = 0.1
FIRST_ROUND = 0.05
# K; a step beyond it comes from a matrix that is singular but for rounding.
LARGEST_STEP = 1.0e9


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
        Of the heat in and out, over the larger of heat and flows.
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


# Up to this many nodes a full matrix is quicker than a sparse one.
DENSE_UP_TO = 200


class SparseBalance:
    """Net heat into every node and its derivative: sparse, full for a small network."""

    def __init__(self, network: OperatingNetwork) -> None:
        self.network = network
        n, total = network.n_nodes, network.n_nodes + len(network.boundary_names)
        first, second, g = network.first, network.second, network.conductance
        up, down = network.streams
        rate = np.full(len(up), network.stream_rate)
        rows = np.concatenate([first, second, first, second, down, down])
        columns = np.concatenate([first, second, second, first, down, up])
        values = np.concatenate([g, g, -g, -g, rate, -rate])
        self.full: Array | None = None
        if total <= DENSE_UP_TO:
            whole = np.bincount(rows * total + columns, values, total * total).reshape(total, total)
            self.matrix = self.full = np.ascontiguousarray(whole[:n, :n])
        else:
            whole = sparse.csr_array((values, (rows, columns)), shape=(total, total))
            self.matrix = whole[:n, :n].tocsc()
        self.load = network.heat - whole[:n, n:] @ network.boundary_temperature
        self.n = n

    def net_heat(self, temperature: Array) -> Array:
        """Net heat into every node, (n,) [W]."""
        net = self.load - self.matrix @ temperature
        for law in self.network.laws:
            net = net + law.value(temperature)
        return net

    def __call__(self, temperature: Array) -> tuple[Array, sparse.csc_array | Array]:
        """Net heat (n,) [W] and derivative (n, n) [W/K]."""
        net = self.load - self.matrix @ temperature
        if self.full is not None:
            return self._full(net, temperature)
        derivative = -self.matrix
        if self.network.laws:
            pieces = [law(temperature) for law in self.network.laws]
            net = net + sum(heat for heat, _ in pieces)
            rows, columns, values = (np.concatenate([item[1][k] for item in pieces]) for k in range(3))
            derivative = derivative + sparse.csc_array((values, (rows, columns)), shape=(self.n, self.n))
        return net, derivative.tocsc()

    def jacobian(self, temperature: Array) -> Array:
        """Derivative of the net heat as a full matrix, (n, n) [W/K]."""
        derivative = self(temperature)[1]
        return derivative if isinstance(derivative, np.ndarray) else derivative.toarray()

    def _full(self, net: Array, temperature: Array) -> tuple[Array, Array]:
        derivative = -self.full
        for law in self.network.laws:
            heat, (rows, columns, values) = law(temperature)
            net = net + heat
            derivative = derivative + np.bincount(rows * self.n + columns, values, self.n * self.n).reshape(
                self.n, self.n
            )
        return net, derivative


def _solve(derivative: sparse.csc_array | Array, right: Array) -> Array:
    """Newton's step; a singular full matrix is refused by its condition."""
    if not isinstance(derivative, np.ndarray):
        return splu(derivative).solve(right)
    step = np.linalg.solve(derivative, right)
    if not np.isfinite(step).all() or np.abs(step).max() > LARGEST_STEP:
        raise np.linalg.LinAlgError("singular")
    return step


def newton(network: OperatingNetwork, start: Array, *, enough: float = 0.0) -> tuple[Array, int]:
    """Temperatures at which every balance is zero, or that a step moved by less than ``enough`` K.

    Raises
    ------
    NoSteadyStateError
        The balance is singular, or no step lowers the imbalance.
    ConvergenceError
    """
    balance = SparseBalance(network)
    temperature = start.copy()
    net, derivative = balance(temperature)
    norm = float(np.abs(net).max())
    for iteration in range(1, NEWTON_STEPS + 1):
        try:
            step = _solve(derivative, -net)
        except (RuntimeError, np.linalg.LinAlgError) as error:
            raise NoSteadyStateError(
                network.machine.spec.name, "the network's heat balance is singular.", "A body loses no heat."
            ) from error
        damping = 1.0
        while True:
            trial = temperature + damping * step
            trial_net, trial_derivative = balance(trial)
            trial_norm = float(np.abs(trial_net).max())
            rounding = 1.0e-13 * float(np.abs(derivative.diagonal()).max()) * float(trial.max())
            if trial_norm <= max((1.0 - 0.25 * damping) * norm, rounding):
                break
            damping *= 0.5
            if damping < 1.0e-4:
                raise NoSteadyStateError(
                    network.machine.spec.name,
                    f"no step lowers the network's imbalance of {norm:.3g} W.",
                    "Friction heat grows faster with temperature than it is lost.",
                )
        temperature, net, derivative, norm = trial, trial_net, trial_derivative, trial_norm
        moved = float(np.abs(damping * step).max())
        if moved < enough:
            return temperature, iteration
        if norm <= rounding and (not network.laws or moved < 1.0e-8):
            return temperature, iteration
    raise ConvergenceError(
        network.machine.spec.name, f"{NEWTON_STEPS} Newton steps left an imbalance of {norm:.3g} W."
    )


def solve_machine_network(
    machine: MachineNetwork,
    point: OperatingPoint | None = None,
    *,
    heat_model: HeatModel | None = None,
    start: Array | None = None,
) -> MachineNetworkState:
    """Steady state of a machine's network with heat, contacts and films at its own temperatures.

    Parameters
    ----------
    machine : MachineNetwork
    point : OperatingPoint, optional
        The definition's own by default.
    heat_model : HeatModel, optional
        The definition's own by default.
    start : (n,) ndarray, [K], optional

    Raises
    ------
    NoSteadyStateError, ConvergenceError, OutOfValidityError
    EnergyBalanceError
        Heat in and out differ by more than 1e-10.
    """
    point = OperatingPoint.of(machine.spec) if point is None else point
    heat_model = heat_model_of(machine.spec) if heat_model is None else heat_model
    if follows_preload(machine.spec):
        return _solve_following_preload(machine, point, heat_model, start)
    friction = tabulate_friction(machine.spec, point, heat_model)
    coolant = None if machine.coolant is None else coolant_law(machine, point)
    around, steps = None, 0
    temperature = np.full(machine.n_nodes, point.ambient_temperature) if start is None else start
    for _ in range(CONTACT_ROUNDS):
        network = operate(machine, point, heat_model, around=around, friction=friction, coolant=coolant)
        # about a state that films will leave, rounding is not worth a step
        first = around is None and friction is not None
        temperature, used = newton(network, temperature, enough=FIRST_ROUND if first else 0.0)
        steps += used
        found = bearing_temperatures(network, temperature)
        change = _change(around, found)
        if _is_settled(machine, change, CONTACT_TOLERANCE if friction is None else FOLLOWED_TOLERANCE):
            return _state(network, temperature, steps)
        around = found
    raise ConvergenceError(
        machine.spec.name,
        f"heat and contacts of the bearings still follow a change of {change:.2g} K.",
        "Friction heat may rise with temperature faster than the machine can carry it away.",
    )


def follows_preload(spec: MachineSpec) -> bool:
    """Whether expansion changes the heat of a machine's bearings."""
    return bool(spec.bearing_set) and spec.heat.thermal_preload and spec.heat.model != "table"


def without_expansion(machine: MachineNetwork) -> MachineNetwork:
    """The same network with bearings that keep the size of assembly."""
    heat = machine.spec.heat.model_copy(update={"thermal_preload": False})
    return replace(machine, spec=machine.spec.model_copy(update={"heat": heat}))


def _solve_following_preload(
    machine: MachineNetwork, point: OperatingPoint, heat_model: HeatModel, start: Array | None
) -> MachineNetworkState:
    steady = without_expansion(machine)
    steady_model = heat_model_of(steady.spec)
    temperature, steps = start, 0
    coolant: dict[float, CoolantLaw | None] = {}

    def solved(at: OperatingPoint, around: Mapping[str, BearingTemperatures]) -> OperatingNetwork:
        nonlocal temperature, steps
        if at.speed not in coolant:
            coolant[at.speed] = None if machine.coolant is None else coolant_law(machine, at)
        network = operate(machine, at, heat_model, around=around, coolant=coolant[at.speed])
        begin = np.full(machine.n_nodes, at.ambient_temperature) if temperature is None else temperature
        temperature, used = newton(network, begin)
        steps += used
        return network

    def response(
        at: OperatingPoint, around: Mapping[str, BearingTemperatures]
    ) -> tuple[Mapping[str, BearingTemperatures], Mapping[str, float]]:
        network = solved(at, around)
        preload = {name: heat.preload for name, heat in network.bearing_heat.items()}
        return bearing_temperatures(network, temperature), preload

    def found(at: OperatingPoint) -> Mapping[str, BearingTemperatures]:
        first = solve_machine_network(steady, at, heat_model=steady_model).bearing_temperatures()
        return settle(at, heat_model, response, first, machine.spec.name)

    def settles(speed: float) -> bool:
        try:
            found(replace(point, speed=speed))
        except (NoSteadyStateError, ConvergenceError):
            return False
        return True

    try:
        around = found(point)
    except NoSteadyStateError as error:
        raise with_limit(error, highest_settling_speed(point.speed, settles)) from error
    return _state(solved(point, around), temperature, steps)


def _is_settled(machine: MachineNetwork, change: float, tolerance: float) -> bool:
    spec = machine.spec
    contacts = any(group.ball_row.kind == "contact" for group in spec.bearing_set)
    coupled = bool(spec.bearing_set) and contacts
    return not coupled or change < tolerance


def _change(
    before: Mapping[str, BearingTemperatures] | None, after: Mapping[str, BearingTemperatures]
) -> float:
    if before is None:
        return np.inf
    fields = BearingTemperatures.__slots__
    changes = [abs(getattr(after[name], f) - getattr(before[name], f)) for name in after for f in fields]
    return max(changes, default=0.0)


def bearing_temperatures(network: OperatingNetwork, temperature: Array) -> dict[str, BearingTemperatures]:
    """Raceways, balls and seats of every bearing at node temperatures (n,), K."""
    machine = network.machine
    found = {}
    for name, ball in machine.ball_nodes.items():
        inner, outer = network.raceway_temperatures(temperature, name)
        shaft = _seat(machine, temperature, f"{name}.inner_ring", inner)
        housing = _seat(machine, temperature, f"{name}.outer_ring", outer)
        found[name] = BearingTemperatures(inner, outer, float(temperature[ball]), shaft, housing)
    return found


def _seat(machine: MachineNetwork, temperature: Array, ring: str, default: float) -> float:
    """Mean of what a ring sits on, taken at the nodes behind the joint."""
    nodes, share = machine.seats[ring]
    return float(temperature[nodes] @ share) if nodes.size else default


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
        elif not isinstance(law, CoolantLaw):
            heat_in += float(law(temperature)[0].sum())
    outlet = float("nan")
    if machine.coolant is not None:
        outlet = float(temperature[network.streams[1][-1]])
        rises = both[network.streams[1]] - both[network.streams[0]]
        out["coolant"] = float(network.stream_rate * rises.sum())
    # at rest there is no flow to compare with: rounding is that of conductance times absolute temperature
    rounding = 1.0e-7 * float(network.conductance.sum()) * float(both.max())
    scale = max(abs(heat_in), *(abs(value) for value in out.values()), rounding)
    imbalance = abs(heat_in - sum(out.values())) / scale
    if imbalance > BALANCE_TOLERANCE:
        raise EnergyBalanceError(
            machine.spec.name,
            f"the network takes in {heat_in:.9g} W and gives off {sum(out.values()):.9g} W "
            f"({imbalance:.1e} relative).",
            f"Allowed: {BALANCE_TOLERANCE:.0e}.",
        )
    return MachineNetworkState(network, temperature, out, heat_in, imbalance, outlet, iterations)
