"""Friction heat and ball contacts of every bearing, tabulated over the temperature of its film.

While expansion is not followed, a bearing's mechanics depend on its own film
temperature only. A table of a few exact states, solved side by side, then
stands for them in every Newton step and time step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import NoEquilibriumError, OutOfValidityError
from spindle_fem.operation.bearing_heat import BearingMechanics, BearingTemperatures, FilmCurves, HeatModel
from spindle_fem.operation.loads import BearingHeat
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]
# Operating points of a heat model whose tables are remembered.
TABLES_KEPT = 256
# About the ambient temperature, K; heat bends most in cold grease.
HEAT_RANGE = (-15.0, 120.0)
HEAT_POINTS = 19
FEWEST_HEAT_POINTS = 4
# Pieces of the cubic that stands for the logarithmic spline between two exact states.
PIECES = 4


@dataclass(frozen=True, slots=True)
class FrictionTables:
    """Heat and contacts over film temperature.

    Attributes
    ----------
    heat : mapping of bearing to CubicHermiteSpline, [W] over [K]
    conductance : mapping of bearing to (inner, outer) CubicSpline, [W/K] over [K]
        Between raceway and balls.
    """

    heat: Mapping[str, CubicHermiteSpline]
    conductance: Mapping[str, tuple[CubicSpline, CubicSpline]]

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


def film_temperature(around: BearingTemperatures) -> float:
    """A quarter of each raceway's and half of the balls', K."""
    return 0.25 * (around.inner + around.outer) + 0.5 * around.ball


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
    if spec.heat.model == "table" or spec.heat.thermal_preload or not spec.bearing_set:
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
    temperatures = np.linspace(base + HEAT_RANGE[0], base + HEAT_RANGE[1], HEAT_POINTS)
    curves = _curves(spec, point, heat_model, temperatures)
    return FrictionTables(
        {name: _heat_spline(curve) for name, curve in curves.items()},
        {
            name: (
                CubicSpline(curve.temperature, curve.conductance_inner),
                CubicSpline(curve.temperature, curve.conductance_outer),
            )
            for name, curve in curves.items()
        },
    )


def _heat_spline(curve: FilmCurves) -> CubicHermiteSpline:
    """Spline of the logarithm, which bends least, as cubic pieces."""
    steps = len(curve.temperature) - 1
    kelvin = np.interp(np.arange(PIECES * steps + 1) / PIECES, np.arange(steps + 1), curve.temperature)
    if np.all(curve.heat > 0.0):
        logarithm = CubicSpline(curve.temperature, np.log(curve.heat))
        heat = np.exp(logarithm(kelvin))
        return CubicHermiteSpline(kelvin, heat, heat * logarithm(kelvin, 1))
    plain = CubicSpline(curve.temperature, curve.heat)
    return CubicHermiteSpline(kelvin, plain(kelvin), plain(kelvin, 1))


def _curves(
    spec: MachineSpec, point: OperatingPoint, heat_model: HeatModel, temperatures: Array
) -> Mapping[str, FilmCurves]:
    if isinstance(heat_model, BearingMechanics):
        known = [value for value in temperatures.tolist() if heat_model.knows(value)]
        if len(known) >= FEWEST_HEAT_POINTS:
            try:
                return heat_model.over_film_temperature(point, known)
            except NoEquilibriumError:
                # one state that is hard to reach stops all of them; alone each has its own way
                pass
    return _one_by_one(spec, point, heat_model, temperatures)


def _one_by_one(
    spec: MachineSpec, point: OperatingPoint, heat_model: HeatModel, temperatures: Array
) -> Mapping[str, FilmCurves]:
    names = [bearing.name for _, bearing in spec.bearings]
    known: list[float] = []
    values: dict[str, list[tuple[float, float, float]]] = {name: [] for name in names}
    refused: OutOfValidityError | None = None
    for temperature in temperatures.tolist():
        around = {name: BearingTemperatures(*(temperature,) * 5) for name in names}
        try:
            heats, _ = heat_model(point, around)
        except OutOfValidityError as error:
            # beyond the grease's own range the law ends; a state out there is refused by name
            refused = error
            continue
        known.append(temperature)
        for name in names:
            heat = heats[name]
            values[name].append((heat.total, heat.conductance_inner, heat.conductance_outer))
    if len(known) < FEWEST_HEAT_POINTS:
        raise refused
    return {
        name: FilmCurves(np.array(known), *(np.nan_to_num(column) for column in np.array(rows).T))
        for name, rows in values.items()
    }
