"""Friction and ball conductances of bearings as polynomials of the temperature of their films.

While expansion is not followed, the mechanics of a bearing depend on speed,
thrust and the temperature of its film alone (a quarter of each raceway and half
of the balls). :class:`FilmSeries` holds quantities over that temperature at one
speed and thrust; :class:`FrictionMap` joins series over speeds and thrusts.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebvander
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import NoEquilibriumError, OutOfValidityError, SpecError, SpindleFemError
from spindle_fem.operation.bearing_heat import BearingMechanics, FilmCurves
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

# Shares of the highest speed; friction moments and what contacts conduct bend most where films are thin.
SPEED_SHARES = (0.001, 0.004, 0.01, 0.02, 0.04, 0.08, 0.14, 0.22, 0.32, 0.44, 0.58, 0.72, 0.86, 1.0)
FILM_TEMPERATURES = (ZERO_CELSIUS_K + 5.0, ZERO_CELSIUS_K + 95.0)
# Eight leave 7e-4 of the heat, twelve 5e-5.
TEMPERATURE_POINTS = 12
NOMINAL_FILM_TEMPERATURE = ZERO_CELSIUS_K + 30.0
# Range of thrusts that two points, the definition's among them, describe to 0.1 %.
NARROW_THRUSTS = 0.1
# Quantities of a map's series: natural logarithms of the moment in N·m and of both conductances in W/K.
MOMENT, CONDUCTANCES = slice(0, 1), slice(1, 3)
# Position of a state of a map: speed, thrust, temperature of the film.
State = tuple[int, int, int]


def film_temperature(inner: ArrayLike, outer: ArrayLike, balls: ArrayLike) -> NDArray:
    """Temperature at which a film's viscosity is taken: a quarter of each raceway, half of the balls, K."""
    return 0.25 * (np.asarray(inner) + np.asarray(outer)) + 0.5 * np.asarray(balls)


def chebyshev_nodes(low: float, high: float, number: int, *, ends: bool = False) -> Array:
    """Temperatures to solve at, ascending, (number,) [K]; including both ends on request.

    >>> chebyshev_nodes(0.0, 2.0, 3, ends=True).round(12).tolist()
    [0.0, 1.0, 2.0]
    """
    step = np.arange(number) / (number - 1) if ends else (np.arange(number) + 0.5) / number
    return 0.5 * (low + high) - 0.5 * (high - low) * np.cos(np.pi * step)


@dataclass(frozen=True, slots=True, eq=False)
class FilmSeries:
    """Chebyshev series of quantities of every bearing over the temperature of its film.

    Attributes
    ----------
    low, high : float, [K]
    coefficients : (n_bearings, n_q, n_t) ndarray
    """

    low: float
    high: float
    coefficients: Array

    @classmethod
    def through(cls, temperatures: Array, values: Array, low: float, high: float) -> FilmSeries:
        """The polynomials through values at as many temperatures as they have terms.

        Parameters
        ----------
        temperatures : (n_t,) ndarray, [K]
        values : (n_bearings, n_q, n_t) ndarray
        low, high : float, [K]
            Ends of the range.
        """
        scaled = (2.0 * temperatures - low - high) / (high - low)
        at_nodes = chebvander(scaled, len(temperatures) - 1)
        flat = values.reshape(-1, len(temperatures))
        return cls(low, high, np.linalg.solve(at_nodes, flat.T).T.reshape(values.shape))

    def at(self, film: NDArray, quantities: slice = slice(None)) -> NDArray:
        """Quantities at film temperatures, (n_bearings, n_q, k).

        Beyond the range the series goes on along its tangent, and so it does
        for the imaginary part of a complex step: derivatives are exact.

        Parameters
        ----------
        film : (n_bearings, k) ndarray, [K]
            May be complex.
        quantities : slice
        """
        own = self.coefficients[:, quantities].transpose(0, 2, 1)
        scaled, basis = self._basis(film)
        slope = chebder(own, axis=1)
        beyond = np.matmul(basis[:, :, : slope.shape[1]], slope) * scaled[:, :, None]
        found = np.matmul(basis, own) + beyond
        return found.transpose(0, 2, 1)

    def slope(self, film: Array, quantities: slice = slice(None)) -> Array:
        """Derivatives to the film's temperature, (n_bearings, n_q, k) [1/K]; as :meth:`at`."""
        own = chebder(self.coefficients[:, quantities].transpose(0, 2, 1), axis=1)
        _, basis = self._basis(film)
        return (2.0 / (self.high - self.low)) * np.matmul(basis[:, :, : own.shape[1]], own).transpose(0, 2, 1)

    def _basis(self, film: NDArray) -> tuple[NDArray, Array]:
        """Excess of films beyond the range, in half widths (n_bearings, k), and polynomials inside."""
        scaled = (2.0 * film - self.low - self.high) / (self.high - self.low)
        inside = np.clip(scaled.real, -1.0, 1.0)
        return scaled - inside, chebvander(inside, self.coefficients.shape[2] - 1)


@dataclass(frozen=True, slots=True, eq=False)
class FrictionStates:
    """Solved states of a map's bearings.

    Attributes
    ----------
    speed : (n_speeds,) ndarray, [rad/s]
    thrust : (n_thrusts,) ndarray, [N]
    turning : (n_speeds, n_thrusts, n_bearings, 3, n_t) ndarray
        Logarithms of the moment before its factor and of both conductances; nan where refused.
    at_rest : (n_thrusts, n_bearings, 3, n_t) ndarray
        The same at standstill; logarithms of the moment are 0.
    refused : mapping of State to SpindleFemError
        Why there are none, where there are none.
    """

    speed: Array
    thrust: Array
    turning: Array
    at_rest: Array
    refused: Mapping[State, SpindleFemError]


@dataclass(frozen=True, slots=True, eq=False)
class FrictionMap:
    """Friction moment and ball conductance of every bearing over speed, thrust and film temperature.

    Attributes
    ----------
    speed : (n_speeds,) ndarray, [rad/s]
    thrust : (n_thrusts,) ndarray, [N]
    turning : CubicSpline
        Over the logarithm of the speed, (n_thrusts, n_bearings, 3, n_t): series of the
        logarithms of the moment and of the conductances to the inner and the outer raceway.
    at_rest : (n_thrusts, n_bearings, 3, n_t) ndarray
        The same at standstill, where no lubricant flows around the balls; moments as at the first speed.
    shares : CubicSpline or None
        Over the thrust, (n_thrusts,): how much each of them counts; None where
        there is but one.
    refused : mapping of State to SpindleFemError
        States in which the bearings have no equilibrium at the size of assembly. What the map has there goes
        on smoothly from the others: something to count from, no answer. See :meth:`require_solved`.
    """

    bearings: tuple[str, ...]
    speed: Array
    thrust: Array
    turning: CubicSpline
    at_rest: Array
    shares: CubicSpline | None
    refused: Mapping[State, SpindleFemError]

    @classmethod
    def through(cls, spec: MachineSpec, states: FrictionStates) -> FrictionMap:
        """Map of a machine's solved bearings."""
        kelvin = chebyshev_nodes(*FILM_TEMPERATURES, TEMPERATURE_POINTS)
        names = tuple(bearing.name for _, bearing in spec.bearings)
        over, thrust = np.log(states.speed), states.thrust
        turning, still = (
            FilmSeries.through(kelvin, values, *FILM_TEMPERATURES).coefficients
            for values in (_continued(states.turning, over), states.at_rest)
        )
        shares = CubicSpline(thrust, np.eye(len(thrust))) if len(thrust) > 1 else None
        return cls(names, states.speed, thrust, CubicSpline(over, turning), still, shares, states.refused)

    def at(self, speed: float, thrust: float) -> FilmSeries:
        """Series over the film temperature at a speed (rad/s) and thrust (N).

        Below the first speed of the map the moment is that of the first.

        Raises
        ------
        OutOfValidityError
            A speed or thrust outside the map.
        """
        self._require(speed, thrust)
        shares = np.ones(1) if self.shares is None else self.shares(thrust)
        turning = np.tensordot(shares, self.turning(np.log(max(speed, self.speed[0]))), axes=1)
        found = FilmSeries(*FILM_TEMPERATURES, turning)
        if speed >= self.speed[0]:
            return found
        # Heat carried by the lubricant around the balls varies with the root of the speed.
        nodes = chebyshev_nodes(*FILM_TEMPERATURES, TEMPERATURE_POINTS)
        films = np.tile(nodes, (len(self.bearings), 1))
        still = FilmSeries(*FILM_TEMPERATURES, np.tensordot(shares, self.at_rest, axes=1))
        values = [np.exp(item.at(films)) for item in (still, found)]
        between = values[0] + np.sqrt(speed / self.speed[0]) * (values[1] - values[0])
        between[:, MOMENT] = values[1][:, MOMENT]
        return FilmSeries.through(nodes, np.log(between), *FILM_TEMPERATURES)

    def heat(self, speed: float, thrust: float, film: Array) -> Array:
        """Friction heat of every bearing before its factors, (n_bearings,) [W], at films (n_bearings,) K."""
        return speed * np.exp(self.at(speed, thrust).at(film[:, None], MOMENT)[:, 0, 0])

    def nominal_conductance(self, speed: float, thrust: float) -> Array:
        """Between balls and inner and outer raceway with films at 30 °C, (n_bearings, 2) [W/K]."""
        film = np.full((len(self.bearings), 1), NOMINAL_FILM_TEMPERATURE)
        return np.exp(self.at(speed, thrust).at(film, CONDUCTANCES)[:, :, 0])

    def require_solved(self, speed: Array, thrust: Array, films: Array) -> None:
        """Refuse instants of a run that lie next to a state in which the bearings have no equilibrium.

        Parameters
        ----------
        speed, thrust : (n,) ndarray, [rad/s], [N]
        films : (n_bearings, n) ndarray, [K]

        Raises
        ------
        NoEquilibriumError, OutOfValidityError
            As the bearings gave it, with the state.
        """
        if not self.refused:
            return
        kelvin = chebyshev_nodes(*FILM_TEMPERATURES, TEMPERATURE_POINTS)
        missing = np.zeros((len(self.speed), len(self.thrust), len(kelvin)), dtype=bool)
        missing[tuple(np.array(list(self.refused)).T)] = True
        sides = _beside(self.speed, speed), _beside(self.thrust, thrust), _beside(kelvin, films)
        for state in itertools.product(*sides):
            row, instant = np.nonzero(missing[state] & (speed > 0.0))
            if len(row):
                first = row[0], instant[0]
                raise self.refused[tuple(int(np.broadcast_to(item, films.shape)[first]) for item in state)]

    def require_complete(self) -> None:
        """Refuse a map with states in which the bearings have no equilibrium.

        Raises
        ------
        NoEquilibriumError, OutOfValidityError
        """
        for error in self.refused.values():
            raise error

    def _require(self, speed: float, thrust: float) -> None:
        rpm = 30.0 / np.pi
        for name, value, lowest, highest, unit in (
            ("speed", speed * rpm, 0.0, self.speed[-1] * rpm, "rpm"),
            ("thrust", thrust, self.thrust[0], self.thrust[-1], "N"),
        ):
            slack = 1e-6 * max(highest, 1.0)
            if not lowest - slack <= value <= highest + slack:
                raise OutOfValidityError(
                    name,
                    f"{value:.6g} {unit} is outside {lowest:.6g} to {highest:.6g} {unit}, for which the fast "
                    "model has its bearings' friction.",
                    f"Keep the {name} within, or build the model with a definition (operation.{name}) or a "
                    "recording that reaches there.",
                )


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


def solve_friction(spec: MachineSpec, speeds: Array, thrusts: Array) -> FrictionStates:
    """Every state of a map; raises as :func:`tabulate_friction` does."""
    mechanics = BearingMechanics(spec)
    factors = np.array([group.heat_factor.value for group, _ in spec.bearings])
    kelvin = chebyshev_nodes(*FILM_TEMPERATURES, TEMPERATURE_POINTS)
    refused: dict[State, SpindleFemError] = {}
    turning = np.empty((len(speeds), len(thrusts), len(factors), 3, len(kelvin)))
    for row, speed in enumerate(speeds.tolist()):
        for column, thrust in enumerate(thrusts.tolist()):
            turning[row, column], errors = _states(mechanics, _point(spec, speed, thrust), kelvin)
            refused |= {(row, column, film): error for film, error in errors.items()}
    turning[:, :, :, MOMENT] -= np.log(factors)[:, None, None]
    for column in range(len(thrusts)):
        if np.isnan(turning[:, column]).all():
            raise refused[0, column, 0]
    at_rest = []
    for thrust in thrusts.tolist():
        still, errors = _states(mechanics, _point(spec, 0.0, thrust), kelvin)
        for error in errors.values():
            raise error
        at_rest.append(still)
    return FrictionStates(speeds, thrusts, turning, np.array(at_rest), refused)


def tabulate_friction(
    spec: MachineSpec,
    highest_speed: float,
    thrusts: Sequence[float],
    solve: Callable[[MachineSpec, Array, Array], FrictionStates] = solve_friction,
) -> FrictionMap:
    """Solve a machine's bearings, at the size of assembly, over speed, thrust and film temperature.

    Parameters
    ----------
    spec : MachineSpec
        With an analytical or empirical heat model, or ball rows that follow
        their contacts.
    highest_speed : float, [rad/s]
    thrusts : sequence of float, [N]
        That occur; a cubic spline between them (a parabola through three).
    solve : callable
        As :func:`solve_friction`.

    States without an equilibrium are left to :meth:`FrictionMap.require_solved`: a machine may never have
    them, or not at the size of assembly.

    Raises
    ------
    SpecError
        Nothing to tabulate, or heat that was asked to follow expansion.
    NoEquilibriumError, OutOfValidityError
        There is none at standstill, or in any state at one of the thrusts.
    """
    if not needs_map(spec):
        raise SpecError("heat.model", "the heat is given by table already.", "Use the machine as it is.")
    if spec.follows_preload and spec.heat.thermal_preload:
        raise SpecError(
            "heat.thermal_preload",
            "with it heat follows every ring, and no table over one film temperature holds.",
            "Switch it off here (--set heat.thermal_preload=false), give the heat by table "
            "(--set heat.model=table, with a [heat.table]), or use spindle-fem simulate or transient.",
        )
    speeds = highest_speed * np.array(SPEED_SHARES)
    return FrictionMap.through(spec, solve(spec, speeds, np.unique(np.asarray(thrusts, dtype=float))))


def _states(
    mechanics: BearingMechanics, point: OperatingPoint, kelvin: Array
) -> tuple[Array, dict[int, SpindleFemError]]:
    """Logarithms of moment and conductances over film temperatures, (n_bearings, 3, n_t), nan where refused.

    The second answer is why, by the number of the temperature.
    """
    try:
        curves = mechanics.over_film_temperature(point, kelvin)
    except (NoEquilibriumError, OutOfValidityError):
        # One state that is hard to reach stops all of them; alone each has its own way.
        return _one_by_one(mechanics, point, kelvin)
    return np.array([_log_quantities(item, point.speed) for item in curves.values()]), {}


def _one_by_one(
    mechanics: BearingMechanics, point: OperatingPoint, kelvin: Array
) -> tuple[Array, dict[int, SpindleFemError]]:
    """As :func:`_states`, every temperature by itself."""
    values = np.full((len(mechanics.spec.bearings), 3, len(kelvin)), np.nan)
    errors: dict[int, SpindleFemError] = {}
    for number, temperature in enumerate(kelvin.tolist()):
        try:
            curves = mechanics.over_film_temperature(point, [temperature])
        except (NoEquilibriumError, OutOfValidityError) as error:
            what = (
                f"{error.what.removesuffix('.')}. The fast model needs the friction near "
                f"{point.speed * 30.0 / np.pi:.0f} rpm, {point.thrust:.0f} N of thrust and a film of "
                f"{temperature - ZERO_CELSIUS_K:.0f} °C, at the size of assembly."
            )
            errors[number] = type(error)(error.where, what, error.how_to_fix)
            continue
        values[:, :, [number]] = [_log_quantities(item, point.speed) for item in curves.values()]
    return values, errors


def _continued(values: Array, log_speeds: Array) -> Array:
    """Values (n_speeds, n_thrusts, n_bearings, 3, n_t), the missing ones (nan) put where curves bend least.

    Over the film's temperature where any are known, else over the speed, so that curves through the known
    ones are not drawn aside.
    """
    found = values.copy()
    for state in np.ndindex(found.shape[:2]):
        known = np.isfinite(found[state][0, 0])
        if known.any() and not known.all():
            found[state][..., ~known] = found[state][..., known] @ _smoothest(known).T
    whole = np.isfinite(found).all(axis=(2, 3, 4))
    for row, column in np.argwhere(~whole):
        near = np.flatnonzero(whole[:, column])
        weights = [np.interp(log_speeds[row], log_speeds[near], one) for one in np.eye(len(near))]
        found[row, column] = np.tensordot(weights, found[near, column], axes=1)
    return found


def _smoothest(known: NDArray[np.bool_]) -> Array:
    """Missing values of known ones, (n_missing, n_known): those whose polynomial has the least high terms."""
    nodes = chebyshev_nodes(-1.0, 1.0, len(known))
    terms = np.linalg.inv(chebvander(nodes, len(known) - 1)) * np.arange(len(known))[:, None] ** 2.0
    return np.linalg.lstsq(terms[:, ~known], -terms[:, known])[0]


def _beside(points: Array, values: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Positions of the points below and above each value; one twice where it is there, or beyond the ends."""
    last = len(points) - 1
    above = np.minimum(np.searchsorted(points, values, side="left"), last)
    return np.clip(np.searchsorted(points, values, side="right") - 1, 0, last), above


def _log_quantities(curves: FilmCurves, speed: float) -> Array:
    """Logarithms of moment and conductances over the film temperature, (3, n_t); no moment at standstill."""
    moment = np.log(curves.heat / speed) if speed > 0.0 else np.zeros_like(curves.heat)
    return np.array((moment, np.log(curves.conductance_inner), np.log(curves.conductance_outer)))


def _point(spec: MachineSpec, speed: float, thrust: float) -> OperatingPoint:
    given = OperatingPoint.of(spec)
    return OperatingPoint(
        float(speed),
        float(thrust),
        given.ambient_temperature,
        given.coolant_inlet_temperature,
        given.coolant_flow,
    )
