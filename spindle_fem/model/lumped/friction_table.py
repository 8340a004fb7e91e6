"""Friction heat and ball contacts of every bearing, tabulated over the temperature of its film.

While expansion is not followed, a bearing's mechanics depend on its own film
temperature only. A table of a few exact states, solved side by side, then
replaces them in every Newton step and time step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import NoEquilibriumError, OutOfValidityError
from spindle_fem.operation.bearing_heat import BearingMechanics, BearingTemperatures, HeatModel
from spindle_fem.operation.friction_map import FilmSeries, chebyshev_nodes
from spindle_fem.operation.loads import BearingHeat
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]
# Operating points of a heat model whose tables are remembered.
TABLES_KEPT = 256
# About the ambient temperature, K; heat bends most in cold grease.
HEAT_RANGE = (-15.0, 120.0)
# Exact states of a table: with 19 the heat between them is right to 1e-5.
HEAT_POINTS = 19
FEWEST_HEAT_POINTS = 4
# Cubic pieces that represent the polynomials.
PIECES = 4 * (HEAT_POINTS - 1)


@dataclass(frozen=True, slots=True)
class FrictionTables:
    """Heat and contacts over film temperature.

    Attributes
    ----------
    heat : mapping of bearing to CubicHermiteSpline, [W] over [K]
    conductance : mapping of bearing to (inner, outer) CubicHermiteSpline, [W/K] over [K]
        Between raceway and balls.
    """

    heat: Mapping[str, CubicHermiteSpline]
    conductance: Mapping[str, tuple[CubicHermiteSpline, CubicHermiteSpline]]

    def at(self, name: str, film_temperature: float) -> BearingHeat:
        """Heat and contacts of a bearing, from the nearest end where a film (K) is beyond the table."""
        table = self.heat[name]
        kelvin = float(np.clip(film_temperature, table.x[0], table.x[-1]))
        total = float(table(kelvin))
        inner, outer = (float(curve(kelvin)) for curve in self.conductance[name])
        return BearingHeat(total, {"friction": total}, conductance_inner=inner, conductance_outer=outer)


_REMEMBERED: WeakKeyDictionary[BearingMechanics, dict[tuple[float, float, float], FrictionTables]] = (
    WeakKeyDictionary()
)


def tabulate_friction(
    spec: MachineSpec, point: OperatingPoint, heat_model: HeatModel
) -> FrictionTables | None:
    """Friction of every bearing over its film temperature; None where heat is by table or follows expansion.

    Raises
    ------
    OutOfValidityError
        The grease is known at too few of the temperatures.
    NoEquilibriumError
    """
    if spec.heat.model == "table" or spec.follows_preload or not spec.bearing_set:
        return None
    base = point.ambient_temperature
    known = _REMEMBERED.setdefault(heat_model, {}) if isinstance(heat_model, BearingMechanics) else {}
    key = (point.speed, point.thrust, base)
    if key not in known:
        if len(known) >= TABLES_KEPT:
            known.clear()
        known[key] = _tables(spec, point, heat_model, base)
    return known[key]


def _tables(spec: MachineSpec, point: OperatingPoint, heat_model: HeatModel, base: float) -> FrictionTables:
    """Cubic pieces through the series of heat and conductances over film temperature."""
    names = tuple(bearing.name for _, bearing in spec.bearings)
    kelvin, values = _states(point, heat_model, names, base + HEAT_RANGE[0], base + HEAT_RANGE[1])
    ends = kelvin[0], kelvin[-1]
    # The logarithm of the heat bends least; at standstill there is no heat.
    logarithmic = bool(np.all(values[:, 0] > 0.0))
    if logarithmic:
        values[:, 0] = np.log(values[:, 0])
    series = FilmSeries.through(kelvin, values, *ends)
    at = np.linspace(*ends, PIECES + 1)
    films = np.tile(at, (len(names), 1))
    found, slope = series.at(films), series.slope(films)
    if logarithmic:
        found[:, 0] = np.exp(found[:, 0])
        slope[:, 0] *= found[:, 0]
    curves = [
        [CubicHermiteSpline(at, *pair) for pair in zip(*own, strict=True)]
        for own in zip(found, slope, strict=True)
    ]
    return FrictionTables(
        {name: heat for name, (heat, _, _) in zip(names, curves, strict=True)},
        {name: (inner, outer) for name, (_, inner, outer) in zip(names, curves, strict=True)},
    )


def _states(
    point: OperatingPoint, heat_model: HeatModel, names: Sequence[str], low: float, high: float
) -> tuple[Array, Array]:
    """Exact heat and conductances at Chebyshev points of the part of a range where the grease is known.

    Returns
    -------
    (m,) ndarray, [K]
        Both ends among them.
    (n_bearings, 3, m) ndarray
        Heat [W], conductance to the inner and to the outer raceway [W/K].

    Raises
    ------
    OutOfValidityError
        The grease is known at too few of the temperatures.
    """
    if isinstance(heat_model, BearingMechanics):
        asked = np.linspace(low, high, HEAT_POINTS)
        known = [value for value in asked.tolist() if heat_model.knows(value)]
        if len(known) >= FEWEST_HEAT_POINTS:
            kelvin = chebyshev_nodes(known[0], known[-1], HEAT_POINTS, ends=True)
            try:
                curves = heat_model.over_film_temperature(point, kelvin.tolist())
            except NoEquilibriumError:
                # One state that is hard to reach stops all of them; alone each has its own way.
                pass
            else:
                rows = [(c.heat, c.conductance_inner, c.conductance_outer) for c in map(curves.get, names)]
                return kelvin, np.nan_to_num(np.array(rows))
    kelvin = chebyshev_nodes(low, high, HEAT_POINTS, ends=True)
    known, values = _one_by_one(point, heat_model, names, kelvin)
    if len(known) < len(kelvin):
        # Beyond the grease's own range the law ends: points of the part that is known.
        kelvin = chebyshev_nodes(known[0], known[-1], HEAT_POINTS, ends=True)
        _, values = _one_by_one(point, heat_model, names, kelvin)
    return kelvin, values


def _one_by_one(
    point: OperatingPoint, heat_model: HeatModel, names: Sequence[str], temperatures: Array
) -> tuple[list[float], Array]:
    """Temperatures within the range of a heat model, and its states there, (n_bearings, 3, m)."""
    known: list[float] = []
    states: list[list[tuple[float, float, float]]] = []
    refused: OutOfValidityError | None = None
    for temperature in temperatures.tolist():
        around = {name: BearingTemperatures(*(temperature,) * 5) for name in names}
        try:
            heats, _ = heat_model(point, around)
        except OutOfValidityError as error:
            refused = error
            continue
        known.append(temperature)
        own = [heats[name] for name in names]
        states.append([(heat.total, heat.conductance_inner, heat.conductance_outer) for heat in own])
    if len(known) < FEWEST_HEAT_POINTS:
        raise refused
    return known, np.nan_to_num(np.array(states)).transpose(1, 2, 0)
