"""Analytical friction in the fast model: a heat table, constant ball rows, and a term that follows the films.

The bearings' mechanics are solved once into a :class:`FrictionMap`. The fast
model then takes a heat table and constant ball rows, and :class:`FilmHeat` makes
both those of the film temperature of the moment.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import HeatTable, MachineSpec
from spindle_fem.effects.framework.term import Operating, Term, TermContext
from spindle_fem.model.reduced.build_reduced import ReductionOptions
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.followed_preload import FollowedPreload
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.friction_map import (
    CONDUCTANCES,
    FILM_TEMPERATURES,
    MOMENT,
    NOMINAL_FILM_TEMPERATURE,
    FilmSeries,
    FrictionMap,
    film_temperature,
)
from spindle_fem.units import Uncertain

Array = NDArray[np.float64]

TABLE_POINTS = 61
MOST_KNOWN = 1024
# Conductances of the reduced operators, in decimals of their logarithm to ten: FilmHeat gives the rest.
CONDUCTANCE_DECIMALS = 2


class FilmHeat(Term):
    """Friction and ball rows of a map at the film temperature of the moment.

    Parameters
    ----------
    table : MachineSpec
        As :func:`tabulated_machine` makes it of the machine and the map.
    preload : FollowedPreload, optional
        What expansion does to the bearings and the joints of their rings; they keep their size without it.

    Attributes
    ----------
    follow : (k,) ndarray of int
        Bearings whose ball row follows its contacts.
    """

    name = "film_heat"

    def __init__(
        self,
        friction_map: FrictionMap,
        machine: MachineSpec,
        table: MachineSpec,
        preload: FollowedPreload | None = None,
    ) -> None:
        self.friction_map, self.machine, self.preload = friction_map, machine, preload
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
        if preload is not None:
            self.combined, self.coefficients = preload.reads, preload.joints
            self.reads += self.combined
        self._known: dict[tuple[float, float], tuple[FilmSeries, Array]] = {}

    def _points(self, context: TermContext) -> Iterator[tuple[slice | NDArray[np.int64], float, float]]:
        """Each speed and thrust that occurs, with the columns in which it does."""
        speed, thrust = context.inputs["speed"], context.inputs["thrust"]
        if np.ndim(speed) == 0:
            yield slice(None), float(speed), float(thrust)
            return
        pairs = np.column_stack((speed, thrust))
        # Columns of one instant, and mostly of many, lie side by side with the same of both.
        fresh = np.append(True, np.any(pairs[1:] != pairs[:-1], axis=1))
        distinct, number = np.unique(pairs[fresh], axis=0, return_inverse=True)
        if len(distinct) == 1:
            yield slice(None), *distinct[0].tolist()
            return
        number = number.ravel()[np.cumsum(fresh) - 1]
        order = np.argsort(number, kind="stable")
        ends = np.cumsum(np.bincount(number))[:-1]
        for columns, point in zip(np.split(order, ends), distinct.tolist(), strict=True):
            yield columns, *point

    def _series(self, speed: float, thrust: float) -> tuple[FilmSeries, Array]:
        """Moments and conductances over the film temperature, and conductances at 30 °C."""
        key = (speed, thrust)
        if key not in self._known:
            if len(self._known) >= MOST_KNOWN:
                self._known.clear()
            self._known[key] = self.friction_map.at(*key), self.friction_map.nominal_conductance(*key)
        return self._known[key]

    def _film(self, context: TermContext) -> tuple[NDArray, NDArray]:
        """Temperatures by bearing and side, and of the film."""
        by_bearing = context.temperatures[: 3 * len(self._table)].reshape(len(self._table), 3, -1)
        return by_bearing, film_temperature(by_bearing[:, 0], by_bearing[:, 1], by_bearing[:, 2])

    def with_preload(self, preload: FollowedPreload, table: MachineSpec) -> FilmHeat:
        """The term with bearings that follow expansion."""
        return FilmHeat(self.friction_map, self.machine, table, preload)

    def read_row(self, model: ThermalModel, name: str) -> Array:
        """Coordinates of the bearings' states, beside places."""
        if self.preload is not None and name in self.combined:
            return self.preload.read_row(model, name)
        return model.place(name)

    def _quantities(self, context: TermContext) -> NDArray:
        """What expansion does at the state of the moment, as the preload has it."""
        return self.preload.quantities(context.temperatures[3 * len(self._table) :], context)

    def factor(self, context: TermContext) -> NDArray[np.complex128]:
        """Factor on the conductance of every joint that follows its fit, (n_joints, k)."""
        if self.preload is None:
            return super().factor(context)
        return np.exp(self.preload.of_joints(self._quantities(context)))

    def friction(self, context: TermContext) -> NDArray[np.complex128]:
        """Heat of the map over that of the table; 1 at standstill."""
        _, film = self._film(context)
        found = np.ones_like(film)
        for columns, speed, thrust in self._points(context):
            if speed == 0.0:
                continue
            moment = self._series(speed, thrust)[0].at(film[:, columns], MOMENT)[:, 0]
            tabulated = np.array([np.interp(speed, self._grid, row) for row in self._table])
            found[:, columns] = np.exp(moment + np.log(speed / tabulated)[:, None])
        if self.preload is not None:
            found = found * np.exp(self.preload.logarithms(self._quantities(context))[:, 0])
        return found[: len(self.bearings)]

    def heat(self, context: TermContext) -> NDArray[np.complex128]:
        """Heat between balls and raceways beyond that with a film at 30 °C."""
        temperatures, film = self._film(context)
        grown = np.zeros((len(film), 2, film.shape[1]), dtype=film.dtype)
        if self.preload is not None:
            grown += self.preload.logarithms(self._quantities(context))[:, CONDUCTANCES]
        more = np.empty_like(grown)
        for columns, speed, thrust in self._points(context):
            series, nominal = self._series(speed, thrust)
            now = series.at(film[:, columns], CONDUCTANCES) + grown[:, :, columns]
            more[:, :, columns] = np.exp(now) - nominal[:, :, None]
        flow = more * (temperatures[:, 2:] - temperatures[:, :2])
        found = np.concatenate((flow, -flow.sum(axis=1, keepdims=True)), axis=1)
        return found[self.follow].reshape(len(self.heat_places), -1)

    def operating_factor(self, point: Operating, parameters: Mapping[str, float]) -> dict[str, float]:
        """Conductances between balls and raceways at a speed and thrust, over the constant ones."""
        found = self.friction_map.nominal_conductance(point.speed, point.thrust) / self._conductance[:, None]
        return {
            f"balls.{self.friction_map.bearings[row]}.{side}": float(found[row, column])
            for row in self.follow
            for column, side in enumerate(("inner", "outer"))
        }


def film_heat_of(fast: FastModel) -> FilmHeat | None:
    """The term that brings friction and ball rows to their films, where there is one."""
    return next((term for term in fast.inputs.extra_terms if isinstance(term, FilmHeat)), None)


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
    """Machine from which the reduced operators of a tabulated machine are made, whatever its heat.

    Ball rows that follow their contacts get the range over which ``film_heat``
    moves them, so that the basis knows it.

    Parameters
    ----------
    table : MachineSpec
        As :func:`tabulated_machine` makes it, with other parameters or not.
    """
    known = film_heat.friction_map
    highest = float(known.speed[-1])
    thrust = float(np.clip(table.operation.thrust, known.thrust[0], known.thrust[-1]))
    films = np.tile(np.array(FILM_TEMPERATURES), (len(known.bearings), 1))
    decades = np.log10(np.e) * np.array(
        [known.at(speed, thrust).at(films, CONDUCTANCES) for speed in (0.0, highest)]
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
