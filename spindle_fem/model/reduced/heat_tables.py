"""Bearing heat of many designs: tables over the film's temperature, from the machine's own heat model."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.operation.bearing_heat import BearingTemperatures, heat_model_of, table_heat
from spindle_fem.operation.friction_map import FilmSeries, chebyshev_nodes
from spindle_fem.operation.loads import BearingHeat
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]

TABLE_POINTS = 9
# Film temperatures beyond which no table goes, K; a design there is left to the full solve.
COLDEST, HOTTEST = 243.15, 473.15
MARGIN = 6.0
# Tables of a definition that heat and contacts depend on.
_MECHANICAL = ("heat", "bearing_set", "bearing_types", "grease", "materials")
# Quantities of a bearing besides the terms of its heat.
QUANTITIES = (
    "total",
    "conductance_inner",
    "conductance_outer",
    "contact_angle_inner",
    "contact_angle_outer",
    "preload",
    "film_thickness",
    "film_thickness_ratio",
)


@dataclass(frozen=True, slots=True)
class HeatTable:
    """Heat and conductances of the bearings of one mechanical state over the temperature of their films.

    The bearings of a set feel one another's films only through the loads,
    which hardly change: every bearing has its own temperature in a table made
    with all at the same.

    Attributes
    ----------
    series : FilmSeries
        ``QUANTITIES``, then the terms of the heat; nan for what the heat model does not have.
    """

    series: FilmSeries
    terms: tuple[str, ...]

    @property
    def number(self) -> int:
        """Quantities, terms included."""
        return self.series.coefficients.shape[1]

    def at(self, film: Array) -> Array:
        """Quantities at the film temperature of each bearing, (n, n_bearings) K to (n, n_bearings, n_q)."""
        return self.series.at(film.T).transpose(2, 0, 1)

    def heat_slope(self, film: Array) -> Array:
        """Derivative of each bearing's heat to its film's temperature, (n, n_bearings) [W/K]."""
        return self.series.slope(film.T, slice(0, 1))[:, 0].T


@dataclass(slots=True)
class BearingTables:
    """Heat tables of designs, made where they are needed.

    Attributes
    ----------
    low, high : float, [K]
        Temperatures that new tables reach to.
    tables : dict
        By mechanical state.
    """

    low: float
    high: float
    tables: dict[str, HeatTable] = field(default_factory=dict)

    def widen(self, low: float, high: float) -> bool:
        """Make the tables reach temperatures; whether they must be made anew."""
        wanted = max(low, COLDEST), min(high, HOTTEST)
        if self.low <= wanted[0] and wanted[1] <= self.high:
            return False
        self.low = self.low if self.low <= wanted[0] else max(wanted[0] - MARGIN, COLDEST)
        self.high = self.high if wanted[1] <= self.high else min(wanted[1] + MARGIN, HOTTEST)
        self.tables.clear()
        return True

    def of(self, spec: MachineSpec, point: OperatingPoint, key: str) -> HeatTable:
        """Table of a mechanical state.

        Raises
        ------
        OutOfValidityError, NoEquilibriumError
            The heat model does not reach over the temperatures.
        """
        if key not in self.tables:
            self.tables[key] = _make_table(spec, point, self.low, self.high)
        return self.tables[key]


def is_constant(spec: MachineSpec) -> bool:
    """Whether neither heat nor the paths through the balls depend on temperature."""
    return spec.heat.model == "table" and all(group.ball_row.kind == "constant" for group in spec.bearing_set)


def mechanical_keys(specs: Sequence[MachineSpec], points: Sequence[OperatingPoint]) -> tuple[str, ...]:
    """Key of the mechanical state of every design: the same key, the same table."""
    return tuple(mechanical_key(spec, point) for spec, point in zip(specs, points, strict=True))


def mechanical_key(spec: MachineSpec, point: OperatingPoint, dump: Mapping[str, Any] | None = None) -> str:
    """Key of one design's mechanical state.

    Parameters
    ----------
    dump : mapping, optional
        The dumped definition, where there is one already.
    """
    if is_constant(spec):
        return repr(tuple(table_heat(spec, point)[0].items()))
    kept = dump if dump is not None else spec.model_dump(mode="json", include=set(_MECHANICAL))
    text = json.dumps([point.speed, point.thrust, *(kept.get(name) for name in _MECHANICAL)], default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def _make_table(spec: MachineSpec, point: OperatingPoint, low: float, high: float) -> HeatTable:
    if is_constant(spec):
        heat, _ = table_heat(spec, point)
        states = [{name: BearingHeat(float(value), {"table": float(value)}) for name, value in heat.items()}]
        nodes = np.array([0.5 * (low + high)])
    else:
        model = heat_model_of(spec)
        nodes = chebyshev_nodes(low, high, TABLE_POINTS, ends=True)
        names = [bearing.name for _, bearing in spec.bearings]
        states = [
            model(point, {name: BearingTemperatures(*(float(node),) * 5) for name in names})[0]
            for node in nodes
        ]
    terms = tuple(dict.fromkeys(term for state in states for item in state.values() for term in item.terms))
    values = np.array([[_row(state[name], terms) for name in state] for state in states])
    return HeatTable(FilmSeries.through(nodes, values.transpose(1, 2, 0), low, high), terms)


def _row(heat: BearingHeat, terms: Sequence[str]) -> list[float]:
    return [getattr(heat, name) for name in QUANTITIES] + [heat.terms.get(term, math.nan) for term in terms]
