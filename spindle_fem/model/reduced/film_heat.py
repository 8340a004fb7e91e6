"""Analytical friction in the fast model: a map over speed, thrust and film temperature.

While expansion is not followed, the mechanics of a bearing depend on speed,
thrust and the temperature of its film alone (a quarter of each raceway and half
of the balls). The map is solved once by the definition's own heat model; the
fast model then takes a heat table and constant ball rows, and a term that makes
both those of the film temperature of the moment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebvander
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from spindle_fem.definition.machine_spec import HeatTable, MachineSpec
from spindle_fem.effects.framework.term import Operating, Term, TermContext
from spindle_fem.errors import OutOfValidityError, SpecError
from spindle_fem.model.reduced.build_reduced import ReductionOptions
from spindle_fem.operation.bearing_heat import BearingMechanics, FilmCurves
from spindle_fem.operation.effect_terms import OneInstant
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.units import ZERO_CELSIUS_K, Uncertain

Array = NDArray[np.float64]

# Of the highest speed; friction moments bend most where films are thin.
SPEED_SHARES = (0.02, 0.04, 0.08, 0.14, 0.22, 0.32, 0.44, 0.58, 0.72, 0.86, 1.0)
FILM_TEMPERATURES = (ZERO_CELSIUS_K + 5.0, ZERO_CELSIUS_K + 95.0)
# Eight leave 7e-4 of the heat, twelve 5e-5.
TEMPERATURE_POINTS = 12
# Chebyshev points on -1 to 1, and the polynomials there.
NODES = np.cos(np.pi * (np.arange(TEMPERATURE_POINTS) + 0.5) / TEMPERATURE_POINTS)
AT_NODES = chebvander(NODES, TEMPERATURE_POINTS - 1)
NOMINAL_FILM_TEMPERATURE = ZERO_CELSIUS_K + 30.0
TABLE_POINTS = 61
MOST_KNOWN = 1024
# Range of thrusts that two points, the definition's among them, describe to 0.1 %.
NARROW_THRUSTS = 0.1
# Conductances of the reduced operators, in decimals of their logarithm to ten: FilmHeat gives the rest.
CONDUCTANCE_DECIMALS = 2


@dataclass(frozen=True, slots=True, eq=False)
class FrictionMap:
    """Friction moment and ball conductance of every bearing.

    Attributes
    ----------
    bearings : tuple of str
    speed : (n_speeds,) ndarray, [rad/s]
    thrust : (n_thrusts,) ndarray, [N]
    moments : CubicSpline
        Over the logarithm of the speed, (n_thrusts, n_bearings, n_t): Chebyshev
        coefficients, over the film temperature, of the logarithm of the moment.
    conductances : CubicSpline
        Over the same, (n_thrusts, 2 n_bearings, n_t): of the conductance between
        the balls and the inner and the outer raceway of each bearing in turn.
    at_rest : (n_thrusts, 2 n_bearings, n_t) ndarray
        The same at standstill, where no lubricant flows around the balls.
    shares : CubicSpline or None
        Over the thrust, (n_thrusts,): how much each of them counts; None where
        there is but one.
    """

    bearings: tuple[str, ...]
    speed: Array
    thrust: Array
    moments: CubicSpline
    conductances: CubicSpline
    at_rest: Array
    shares: CubicSpline | None

    def log_moment(self, speed: float, thrust: float, film_temperature: NDArray) -> NDArray:
        """Natural logarithm of the friction moment in N·m.

        Below the first speed of the map the moment is that of the first; beyond
        its temperatures the logarithm goes on along its tangent.

        Parameters
        ----------
        speed : float, [rad/s]
        thrust : float, [N]
        film_temperature : (n_bearings, k) ndarray, [K]
            May be complex, for derivatives.
        """
        return _series(self.at(speed, thrust)[0], film_temperature)

    def log_conductance(self, speed: float, thrust: float, film_temperature: NDArray) -> NDArray:
        """Logarithm of the conductance in W/K between balls and raceways, (n_bearings, 2, k).

        Parameters as for :meth:`log_moment`.
        """
        return _by_side(self.at(speed, thrust)[1], film_temperature)

    def heat(self, speed: float, thrust: float, film_temperature: Array) -> Array:
        """Friction heat of every bearing before its factors, (n_bearings,) [W].

        Parameters
        ----------
        film_temperature : (n_bearings,) ndarray, [K]
        """
        return speed * np.exp(self.log_moment(speed, thrust, film_temperature[:, None])[:, 0])

    def nominal_conductance(self, speed: float, thrust: float) -> Array:
        """Between balls and inner and outer raceway with films at 30 °C, (n_bearings, 2) [W/K]."""
        film = np.full((len(self.bearings), 1), NOMINAL_FILM_TEMPERATURE)
        return np.exp(self.log_conductance(speed, thrust, film)[:, :, 0])

    def at(self, speed: float, thrust: float) -> tuple[Array, Array]:
        """Series over the film temperature, of moments (n, n_t) and of conductances (2 n, n_t)."""
        self._require(speed, thrust)
        known = np.log(max(speed, self.speed[0]))
        shares = np.ones(1) if self.shares is None else self.shares(thrust)
        moments, turning, still = (
            np.tensordot(shares, item, axes=1)
            for item in (self.moments(known), self.conductances(known), self.at_rest)
        )
        if speed >= self.speed[0]:
            return moments, turning
        # What the lubricant carries around the balls goes with the root of the speed.
        values = [np.exp(item @ AT_NODES.T) for item in (still, turning)]
        between = values[0] + np.sqrt(speed / self.speed[0]) * (values[1] - values[0])
        return moments, np.linalg.solve(AT_NODES, np.log(between).T).T

    def _require(self, speed: float, thrust: float) -> None:
        for name, value, known in (("speed", speed, self.speed), ("thrust", thrust, self.thrust)):
            lowest = 0.0 if name == "speed" else known[0]
            slack = 1e-6 * max(known[-1], 1.0)
            if not lowest - slack <= value <= known[-1] + slack:
                raise OutOfValidityError(
                    f"friction map: {name}",
                    f"{value:.6g} is outside {lowest:.6g} to {known[-1]:.6g}.",
                    "Tabulate the friction over a range that holds it.",
                )


def _series(coefficients: Array, film_temperature: NDArray) -> NDArray:
    """Chebyshev series of each row at its temperatures, (rows, k)."""
    low, high = FILM_TEMPERATURES
    scaled = (2.0 * film_temperature - low - high) / (high - low)
    # Along the tangent: beyond the ends, and for the imaginary part of a complex step.
    at = np.clip(scaled.real, -1.0, 1.0)
    basis = chebvander(at, coefficients.shape[1] - 1)
    slope = chebder(coefficients, axis=1)
    found = np.matmul(basis, coefficients[:, :, None])[:, :, 0]
    return found + np.matmul(basis[:, :, :-1], slope[:, :, None])[:, :, 0] * (scaled - at)


def _by_side(coefficients: Array, film_temperature: NDArray) -> NDArray:
    """Series of both sides of every bearing at the temperatures of its film, (n_bearings, 2, k)."""
    found = _series(coefficients, np.repeat(film_temperature, 2, axis=0))
    return found.reshape(len(film_temperature), 2, -1)


def needs_map(spec: MachineSpec) -> bool:
    """Whether friction or ball rows of a machine follow their films."""
    return spec.heat.model != "table" or any(group.ball_row.kind == "contact" for group in spec.bearing_set)


def thrusts_between(spec: MachineSpec, low: float, high: float) -> tuple[float, ...]:
    """Thrusts at which to solve the bearings so that a range and the definition's are covered.

    Parameters
    ----------
    low, high : float, [N]
    """
    given = spec.operation.thrust
    low, high = min(low, given), max(high, given)
    found = {low, given, high}
    wide = high - low
    if wide > NARROW_THRUSTS * max(abs(low), abs(high)):
        middle = 0.5 * (low + high)
        # A definition near the middle is the middle.
        if abs(middle - given) > 0.15 * wide:
            found.add(middle)
    return tuple(sorted(found))


def tabulate_friction(spec: MachineSpec, highest_speed: float, thrusts: Sequence[float]) -> FrictionMap:
    """Solve a machine's bearings over speed, thrust and film temperature.

    Parameters
    ----------
    spec : MachineSpec
        With an analytical or empirical heat model, or ball rows that follow
        their contacts.
    highest_speed : float, [rad/s]
    thrusts : sequence of float, [N]
        That occur; a cubic spline between them (a parabola through three).

    Raises
    ------
    SpecError
        Nothing to tabulate, or heat that follows expansion.
    NoEquilibriumError, OutOfValidityError
    """
    if not needs_map(spec):
        raise SpecError("heat.model", "the heat is given by table already.", "Use the machine as it is.")
    if spec.heat.thermal_preload and spec.heat.model != "table":
        raise SpecError(
            "heat.thermal_preload",
            "with it heat follows every ring, and no table over one film temperature holds.",
            "Switch it off for the fast model (--set heat.thermal_preload=false), give the heat by table "
            "(--set heat.model=table, with a [heat.table]), or run the full model (spindle-fem transient).",
        )
    mechanics = BearingMechanics(spec)
    names = tuple(bearing.name for _, bearing in spec.bearings)
    factors = np.array([group.heat_factor.value for group, _ in spec.bearings])[:, None]
    speeds = highest_speed * np.array(SPEED_SHARES)
    loads = np.unique(np.asarray(thrusts, dtype=float))
    low, high = FILM_TEMPERATURES
    kelvin = 0.5 * (low + high) + 0.5 * (high - low) * NODES
    moments = np.empty((len(speeds), len(loads), len(names), TEMPERATURE_POINTS))
    conductances = np.empty((len(speeds), len(loads), 2 * len(names), TEMPERATURE_POINTS))

    def log_conductances(curves: Mapping[str, FilmCurves]) -> Array:
        rows = [(curves[name].conductance_inner, curves[name].conductance_outer) for name in names]
        values = np.array(rows).reshape(-1, TEMPERATURE_POINTS)
        return np.linalg.solve(AT_NODES, np.log(values).T).T

    for i, speed in enumerate(speeds):
        for j, thrust in enumerate(loads):
            curves = mechanics.over_film_temperature(_point(spec, speed, thrust), kelvin)
            heat = np.array([curves[name].heat for name in names]) / factors
            moments[i, j] = np.linalg.solve(AT_NODES, np.log(heat / speed).T).T
            conductances[i, j] = log_conductances(curves)
    at_rest = [
        log_conductances(mechanics.over_film_temperature(_point(spec, 0.0, thrust), kelvin))
        for thrust in loads
    ]
    at = np.log(speeds)
    shares = CubicSpline(loads, np.eye(len(loads))) if len(loads) > 1 else None
    return FrictionMap(
        names,
        speeds,
        loads,
        CubicSpline(at, moments),
        CubicSpline(at, conductances),
        np.array(at_rest),
        shares,
    )


def _point(spec: MachineSpec, speed: float, thrust: float) -> OperatingPoint:
    given = OperatingPoint.of(spec)
    return OperatingPoint(
        float(speed),
        float(thrust),
        given.ambient_temperature,
        given.coolant_inlet_temperature,
        given.coolant_flow,
    )


class FilmHeat(OneInstant, Term):
    """Friction and ball rows of a map at the film temperature of the moment.

    Parameters
    ----------
    friction_map : FrictionMap
    machine : MachineSpec
    table : MachineSpec
        As :func:`tabulated_machine` makes it of the machine and the map.

    Attributes
    ----------
    friction_map : FrictionMap
    follow : (k,) ndarray of int
        Bearings whose ball row follows its contacts.
    """

    name = "film_heat"

    def __init__(self, friction_map: FrictionMap, machine: MachineSpec, table: MachineSpec) -> None:
        self.friction_map = friction_map
        names = friction_map.bearings
        # Heat that is given by table stays as it is, and so do ball rows of constant conductance.
        self.bearings = () if machine.heat.model == "table" else names
        self.follow = np.flatnonzero([group.ball_row.kind == "contact" for group, _ in machine.bearings])
        sides = ("inner_raceway", "outer_raceway", "balls")
        self.reads = tuple(f"{name}.{side}" for name in names for side in sides)
        self._grid = np.asarray(table.heat.table.speed)
        self._table = np.array([table.heat.table.heat[name] for name in names])
        self._conductance = np.array([group.ball_row.conductance.value for group, _ in table.bearings])
        self.heat_places = tuple(self.reads[3 * row + side] for row in self.follow for side in range(3))
        self._known: dict[tuple[float, float], tuple[Array, Array, Array]] = {}

    def _curves(self, context: TermContext) -> tuple[Array, Array, Array]:
        """Of moments and conductances over the film temperature, and conductances at 30 °C."""
        key = (float(context.inputs["speed"]), float(context.inputs["thrust"]))
        if key not in self._known:
            if len(self._known) >= MOST_KNOWN:
                self._known.clear()
            moments, conductances = self.friction_map.at(*key)
            self._known[key] = (moments, conductances, self.friction_map.nominal_conductance(*key))
        return self._known[key]

    def _film(self, context: TermContext) -> tuple[NDArray, NDArray]:
        """Temperatures by bearing and side, and of the film."""
        by_bearing = context.temperatures.reshape(len(self._table), 3, -1)
        return by_bearing, 0.25 * (by_bearing[:, 0] + by_bearing[:, 1]) + 0.5 * by_bearing[:, 2]

    def friction(self, context: TermContext) -> NDArray[np.complex128]:
        """Heat of the map over that of the table; 1 at standstill."""
        speed = float(context.inputs["speed"])
        _, film = self._film(context)
        if speed == 0.0:
            return np.ones_like(film[: len(self.bearings)])
        moments, _, _ = self._curves(context)
        tabulated = np.array([np.interp(speed, self._grid, row) for row in self._table])
        return np.exp(_series(moments, film) + np.log(speed / tabulated)[:, None])[: len(self.bearings)]

    def heat(self, context: TermContext) -> NDArray[np.complex128]:
        """What flows between balls and raceways beside what flows with a film at 30 °C."""
        temperatures, film = self._film(context)
        _, conductances, nominal = self._curves(context)
        more = np.exp(_by_side(conductances, film)) - nominal[:, :, None]
        flow = more * (temperatures[:, 2:] - temperatures[:, :2])
        found = np.concatenate((flow, -flow.sum(axis=1, keepdims=True)), axis=1)
        return found[self.follow].reshape(len(self.heat_places), -1)

    def operating_factor(self, point: Operating, parameters: Mapping[str, float]) -> dict[str, float]:
        """Conductances between balls and raceways at a speed and thrust, over the constant ones."""
        found = self.friction_map.nominal_conductance(point.speed, point.thrust) / self._conductance[:, None]
        return {
            f"balls.{self.bearings[row]}.{side}": float(found[row, column])
            for row in self.follow
            for column, side in enumerate(("inner", "outer"))
        }


def tabulated_machine(spec: MachineSpec, friction_map: FrictionMap) -> MachineSpec:
    """A machine with a heat table and constant ball rows in place of its analytical friction.

    The table holds at the definition's thrust and a film of 30 °C, the ball
    rows at the definition's speed (two thirds of the highest where it stands
    still); :class:`FilmHeat` makes both right elsewhere.
    """
    operation = spec.operation
    thrust = float(np.clip(operation.thrust, friction_map.thrust[0], friction_map.thrust[-1]))
    grid = np.linspace(0.0, friction_map.speed[-1], TABLE_POINTS)
    nominal = np.full(len(friction_map.bearings), NOMINAL_FILM_TEMPERATURE)
    heat = np.array([friction_map.heat(speed, thrust, nominal) for speed in grid])
    turning = operation.speed or 2.0 / 3.0 * friction_map.speed[-1]
    conductance = friction_map.nominal_conductance(min(turning, friction_map.speed[-1]), thrust).mean(axis=1)
    # Round, so that the operators do not depend on which thrusts a recording has.
    conductance = 10.0 ** np.round(np.log10(conductance), CONDUCTANCE_DECIMALS)
    by_name = dict(zip(friction_map.bearings, conductance.tolist(), strict=True))
    table = HeatTable.model_construct(
        speed=tuple(grid.tolist()),
        heat={name: tuple(heat[:, i].tolist()) for i, name in enumerate(friction_map.bearings)},
        thrust_coefficient={},
        reference_thrust=max(thrust, 1.0),
    )
    sets = []
    for group in spec.bearing_set:
        row = group.ball_row
        if row.kind == "contact":
            mean = float(np.mean([by_name[bearing.name] for bearing in group.bearing]))
            row = row.model_copy(update={"kind": "constant", "conductance": Uncertain(mean)})
        sets.append(group.model_copy(update={"ball_row": row}))
    if spec.heat.model == "table":
        return spec.model_copy(update={"bearing_set": tuple(sets)})
    heat_model = spec.heat.model_copy(update={"model": "table", "table": table})
    return spec.model_copy(update={"heat": heat_model, "bearing_set": tuple(sets)})


def operators_machine(table: MachineSpec, film_heat: FilmHeat) -> MachineSpec:
    """What the reduced operators of a tabulated machine are made of, whatever its heat.

    Ball rows that follow their contacts get the range over which ``film_heat``
    moves them, so that the basis knows it.

    Parameters
    ----------
    table : MachineSpec
        As :func:`tabulated_machine` makes it, with other parameters or not.
    film_heat : FilmHeat
    """
    known = film_heat.friction_map
    highest = float(known.speed[-1])
    thrust = float(np.clip(table.operation.thrust, known.thrust[0], known.thrust[-1]))
    films = np.tile(np.array(FILM_TEMPERATURES), (len(known.bearings), 1))
    decades = np.log10(np.e) * np.array(
        [known.log_conductance(speed, thrust, films) for speed in (0.0, highest)]
    )
    least, most = decades.min(axis=(0, 2, 3)), decades.max(axis=(0, 2, 3))
    sets = []
    for group in table.bearing_set:
        rows = [known.bearings.index(bearing.name) for bearing in group.bearing]
        if set(rows) <= set(film_heat.follow.tolist()):
            low, high = least[rows].min(), most[rows].max()
            middle = 10.0 ** round(0.5 * (low + high), CONDUCTANCE_DECIMALS)
            # The next tenth of a decade: other thrusts move it a little further.
            sigma = np.log(10.0) * np.ceil(10.0 * (0.5 * (high - low) + 0.02)) / 10.0
            row = group.ball_row.model_copy(
                update={"conductance": Uncertain(middle, float(sigma / ReductionOptions().sigmas))}
            )
            group = group.model_copy(update={"ball_row": row})
        sets.append(group)
    heat = HeatTable.model_construct(
        speed=(0.0, highest),
        heat=dict.fromkeys(known.bearings, (0.0, 0.0)),
        thrust_coefficient={},
        reference_thrust=table.heat.table.reference_thrust,
    )
    return table.model_copy(
        update={
            "heat": table.heat.model_copy(update={"table": heat}),
            "bearing_set": tuple(sets),
        }
    )
