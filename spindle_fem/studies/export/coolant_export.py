"""The coolant of an exported model: operators over flow and inlet, films that follow the wall."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

from spindle_fem.errors import SpecError
from spindle_fem.model.reduced.coolant_maps import coolant_maps
from spindle_fem.model.reduced.drive import STANDARD, WarmedPoint, make_drive
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.reduced_transient import TransientRun
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.recordings.standard_inputs import standard_inputs
from spindle_fem.studies.export.effect_export import ExportedEffects
from spindle_fem.studies.export.interpolation_axes import refined_axis, values_on
from spindle_fem.studies.export.operator_tables import (
    OperatorTable,
    directions_of,
    equal_weights,
    in_a_row,
    operator_parts,
    operator_shapes,
    sampled_table,
)
from spindle_fem.studies.export.state_space import FeedbackTable
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

# Relative error of films and coefficients between the points of a table; this many times that of friction,
# which warms the coolant by tenths of a kelvin, and over scaled flows, which reach further.
TOLERANCE, OF_FRICTION, OF_SCALED = 5e-5, 10.0, 2.0
# Points of the coolant's table.
MOST_POINTS = 5000
# Mean rises of the channel's wall above the inlet, K: where films are worked out, everywhere and about the
# usual one, as a flow that turns turbulent bends within a kelvin; and points of the table.
RISES, NEAR_USUAL, RISE_AXIS, CLOSE_RISES = (
    np.linspace(-15.0, 30.0, 10),
    np.arange(-6.0, 7.0),
    np.linspace(-15.0, 30.0, 46),
    np.arange(-3.0, 3.5, 0.5),
)
# The wall changes the film only a little: fewer flows and directions suffice.
WALL_TOLERANCE, WALL_LEFT_OUT = 2e-3, 3e-6
# Least mean of a wall's rise, as a share of its largest, by which it can be scaled.
LEAST_MEAN = 0.2
# A table is held against this many flows and inlets; beyond this relative departure the flow is scaled by
# viscosity: where a flow turns turbulent, at one Reynolds number, its films bend.
CHECKED, LARGEST_DEPARTURE = 15, 5e-4
SCALED_FLOW, SCALE_POINTS = "scaled_flow", 121
# After which no wall moves any more, and its steps, s.
SETTLED, SETTLING_STEP = 3.0 * 86400.0, 3600.0
# A colder inlet [K] and then a stop, each for some seconds, show how the profile of the wall changes; changes
# of the mean that tell little of that [K].
COLDER, CHANGED, SMALL_CHANGE = 2.0, 3600.0, 0.1


@dataclass(frozen=True, slots=True)
class WallRise:
    """Rise of the channel's wall above the inlet along its cells, by its mean.

    Attributes
    ----------
    profile : (n_cells,) ndarray
        At the usual mean, of mean 1.
    usual : float, [K]
        Mean rise about which films are taken.
    leaning : (n_cells,) ndarray
        Change of the rise beside that in proportion to the mean, per kelvin of it; of mean 0.
    least, most : float, [K]
        Changes of the mean between which that holds; beyond, it stays.
    sense : (r,) ndarray
        Mean temperature of the wall from the fast model's unknowns.
    """

    profile: Array
    usual: float
    leaning: Array
    least: float
    most: float
    sense: Array

    @classmethod
    def of(cls, fast: FastModel) -> WallRise:
        """Rise after days at the definition's operating point, and as inlet and then speed change."""
        point = OperatingPoint.of(fast.spec)
        inputs = standard_inputs(fast.spec)
        held = np.ones(len(STANDARD), dtype=bool)

        def march(
            changes: list[dict[str, float]], seconds: float, step: float, start: float | Array
        ) -> Array:
            values = [[{**inputs, **own}[name] for name in STANDARD] for own in (*changes, changes[-1])]
            times = seconds * np.arange(len(values))
            drive = make_drive(times, STANDARD, np.array(values), held, largest_step=step)
            return TransientRun(fast, drive, {}, (), fast.own_terms(drive)).march(start)[0]

        colder = {"coolant_inlet": point.coolant_inlet_temperature - COLDER}
        settled = march([{}], SETTLED, SETTLING_STEP, point.ambient_temperature)[-1]
        moved = march([colder, colder | {"speed": 0.0}], CHANGED, CHANGED / 12.0, settled)
        inlet = point.coolant_inlet_temperature - COLDER * (np.arange(len(moved)) > 0)
        area = fast.model.cell_area.ravel() / fast.model.cell_area.sum()
        rises = fast.channel.walls(moved) - inlet[:, None]
        means = rises @ area
        mean = float(means[0])
        sense = fast.model.cell_load.sum(axis=0) / fast.model.cell_area.sum()
        if abs(mean) <= LEAST_MEAN * np.abs(rises[0]).max():
            return cls(np.ones(area.size), mean, np.zeros(area.size), 0.0, 0.0, sense)
        profile, change = rises[0] / mean, means - mean
        beside = rises - np.outer(means, profile)
        leaning = change @ beside / (change @ change + change.size * SMALL_CHANGE**2)
        return cls(profile, mean, leaning, float(change.min()), float(change.max()), sense)

    def along(self, mean: float) -> Array:
        """Rise of each cell at a mean rise, (n_cells,) K."""
        return mean * self.profile + np.clip(mean - self.usual, self.least, self.most) * self.leaning

    def means(self) -> Array:
        """Mean rises at which films are worked out, K."""
        near = self.usual + NEAR_USUAL
        return np.union1d(RISES, near[(near > RISES[0]) & (near < RISES[-1])])


@dataclass(frozen=True, slots=True)
class FlowScale:
    """Factor on a flow that makes it the one of equal Reynolds number at the definition's inlet temperature.

    Attributes
    ----------
    inlet, factor : (n,) ndarray, [°C], [-]
        Straight between these.
    """

    inlet: Array
    factor: Array

    @classmethod
    def of(cls, fluid: str, usual: float, inlets: tuple[float, float]) -> FlowScale:
        """Scale of a coolant about a usual inlet temperature, over a range, all in °C.

        >>> [round(FlowScale.of("water", 20.0, (10.0, 40.0)).at(inlet), 2) for inlet in (10.0, 20.0, 40.0)]
        [0.77, 1.0, 1.53]
        """
        inlet = np.unique([*np.linspace(*inlets, SCALE_POINTS), usual])
        viscosity = coolant_by_name(fluid).properties(inlet + ZERO_CELSIUS_K).kinematic_viscosity
        return cls(inlet, viscosity[np.searchsorted(inlet, usual)] / viscosity)

    def at(self, inlet: float) -> float:
        """Factor at an inlet temperature [°C]."""
        return float(np.interp(inlet, self.inlet, self.factor))


@dataclass(frozen=True, slots=True)
class CoolantOperators:
    """Contribution of the coolant to a fast model's operators.

    Attributes
    ----------
    wall : WallRise or None
        None where films do not follow the wall, or to have it at the inlet's temperature.
    scaling : FlowScale or None
        Where given, every ``flow`` of the methods is a scaled one.
    """

    fast: FastModel
    effects: ExportedEffects
    nominal: OperatingPoint
    wall: WallRise | None
    scaling: FlowScale | None = None
    # Films by flow, inlet and rise: axes, their check and operators ask for the same ones.
    _known: dict[tuple[float, float, float | None], tuple[Array, float, float]] = field(
        default_factory=dict, init=False, repr=False
    )

    def over(
        self, flows: tuple[float, float], inlets: tuple[float, float]
    ) -> tuple[CoolantOperators, tuple[Array, Array]]:
        """These with the axes of their tables over flows [m³/s] and inlets [°C]; scaled flows where needed.

        Needed they are where tables over flows as they are would not hold the films.

        Raises
        ------
        SpecError
            Neither does.
        """
        fluid, usual = self.fast.spec.coolant.fluid, self.nominal.coolant_inlet_temperature - ZERO_CELSIUS_K
        for scaling in (None, FlowScale.of(fluid, usual, inlets)):
            found = replace(self, scaling=scaling)
            axes = found.axes(flows, inlets)
            if found.departure(axes, flows, inlets) <= LARGEST_DEPARTURE:
                return found, axes
        raise SpecError(
            "coolant",
            f"its film changes so sharply that no table holds it within {100.0 * LARGEST_DEPARTURE:g} %.",
            "Export the machine without the effect or correlation that jumps; simulate takes it.",
        )

    def departure(
        self, axes: tuple[Array, Array], flows: tuple[float, float], inlets: tuple[float, float]
    ) -> float:
        """Largest relative departure of films between the points of the axes; infinite for too many."""
        if axes[0].size * axes[1].size > MOST_POINTS:
            return np.inf
        table = RegularGridInterpolator(axes, values_on(self.means, axes))
        # neither ends nor middles of the axes, where tables hold by their making
        shares = (np.arange(CHECKED) + 0.3819) / CHECKED
        found = 0.0
        for flow, inlet in product(*(low + shares * (high - low) for low, high in (flows, inlets))):
            place = self.place(flow, inlet), inlet
            meant = self.means(*place)
            found = max(found, float(np.abs(table(place).ravel() / meant - 1.0).max()))
        return found

    @property
    def table_inputs(self) -> tuple[str, str]:
        """Axes of the tables."""
        return "coolant_flow" if self.scaling is None else SCALED_FLOW, "coolant_inlet"

    def place(self, flow: float, inlet: float) -> float:
        """Flow [m³/s] as the tables have it."""
        return flow if self.scaling is None else flow * self.scaling.at(inlet)

    def means(self, flow: float, inlet: float) -> Array:
        """Mean film and capacity rate, (2,)."""
        cells, rate, _ = self.film(flow, inlet)
        return np.array([cells.mean(), rate])

    def film(self, flow: float, inlet: float, rise: float | None = None) -> tuple[Array, float, float]:
        """Film of each cell, capacity rate and friction heat at a flow [m³/s], inlet [°C], mean rise [K]."""
        key = flow, inlet, rise
        if key not in self._known:
            self._known[key] = self._film(*key)
        return self._known[key]

    def _film(self, flow: float, inlet: float, rise: float | None) -> tuple[Array, float, float]:
        flow = flow if self.scaling is None else flow / self.scaling.at(inlet)
        point = replace(self.nominal, coolant_flow=flow, coolant_inlet_temperature=inlet + ZERO_CELSIUS_K)
        if self.wall is not None:
            point = self.at_wall(point, rise)
        return self.fast.channel.film(point, self.effects.factors, self.effects.changes(point))

    def at_wall(self, point: OperatingPoint, rise: float | None = None) -> WarmedPoint:
        """A point with the wall above the inlet by a mean rise [K], the usual one where None."""
        mean = self.wall.usual if rise is None else rise
        own = {name: getattr(point, name) for name in OperatingPoint.__slots__}
        coolant = coolant_by_name(self.fast.spec.coolant.fluid)
        wall = point.coolant_inlet_temperature + self.wall.along(mean)
        known = coolant.lowest_temperature, coolant.highest_temperature
        return WarmedPoint(**own, channel_wall=np.clip(wall, *known))

    def sample(self, flow: float, inlet: float, rise: float | None = None) -> Array:
        """Everything that the coolant adds, as :data:`PARTS` one behind the other."""
        fast = self.fast
        driven, friction = (fast.load_names.index(name) for name in ("coolant_inlet", "coolant_friction"))
        outlets = [row for row, probe in enumerate(fast.spec.probe) if probe.kind == "coolant_outlet"][:1]
        maps = coolant_maps(fast.model, *self.film(flow, inlet, rise))
        conduction, load, output, feedthrough = (np.zeros(shape) for shape in operator_shapes(fast))
        conduction += maps.conduction
        load[:, driven], load[:, friction] = maps.inlet_load, maps.constant_load
        output[outlets], feedthrough[outlets, driven] = maps.outlet, maps.outlet_inlet
        feedthrough[outlets, friction] = maps.outlet_constant
        return in_a_row((conduction, load, output, feedthrough))

    def axes(
        self, flows: tuple[float, float], inlets: tuple[float, float], tolerance: float = TOLERANCE
    ) -> tuple[Array, Array]:
        """Flows [m³/s] and inlet temperatures [°C] between which films are straight lines.

        Parameters
        ----------
        flows, inlets : (low, high)
        tolerance : float, [-]
        """
        flow, inlet = (
            self.nominal.coolant_flow,
            self.nominal.coolant_inlet_temperature - ZERO_CELSIUS_K,
        )

        beside = [flow]
        if self.scaling is not None:
            factors = [self.scaling.at(end) for end in (*inlets, inlet)]
            flows = flows[0] * min(factors), flows[1] * max(factors)
            beside, tolerance = [*flows, flow], OF_SCALED * tolerance

        area = float(self.fast.model.cell_area.sum())

        def values(flow: float, inlet: float) -> Array:
            cells, rate, friction = self.film(flow, inlet)
            # what the coolant takes of an even wall, the bend that operators have over a film
            taken = -rate * np.expm1(-cells.mean() * area / rate)
            return np.array([cells.mean(), rate, taken, friction])

        def over_inlets(inlet: float) -> Array:
            return np.concatenate([values(flow, inlet) for flow in beside])

        allowed = tolerance * np.array([1.0, 1.0, 1.0, OF_FRICTION])
        return (
            refined_axis(lambda at: values(at, inlet), *flows, allowed),
            refined_axis(over_inlets, *inlets, np.tile(allowed, len(beside))),
        )


def coolant_table(coolant: CoolantOperators, axes: tuple[Array, Array]) -> OperatorTable:
    """Coolant operators over flow and inlet temperature, on the few directions in which they vary."""
    nominal = coolant.nominal
    base = coolant.sample(nominal.coolant_flow, nominal.coolant_inlet_temperature - ZERO_CELSIUS_K)
    return sampled_table(
        coolant.fast, coolant.table_inputs, axes, lambda *place: coolant.sample(*place) - base, base
    )


def wall_feedback(coolant: CoolantOperators, axes: tuple[Array, Array]) -> FeedbackTable | None:
    """Change of the channel's film when its wall is not as far above the inlet as usual.

    The change of conduction and loads is written as heats, each proportional to one combination of
    unknowns and loads: the singular vectors of the directions in which the operators vary. The outlet's
    change joins them as one that warms nothing and is read. None where the film hardly varies.

    Parameters
    ----------
    axes : tuple of ndarray
        Flows and inlet temperatures of the table.
    """
    fast, wall, nominal = coolant.fast, coolant.wall, coolant.nominal
    usual = coolant.sample(nominal.coolant_flow, nominal.coolant_inlet_temperature - ZERO_CELSIUS_K)
    scale = equal_weights(fast, usual)
    at_usual = {place: coolant.sample(*place) for place in product(*axes)}

    def change(place: tuple[float, ...]) -> Array:
        rise, *driven = place
        return (coolant.sample(*driven, rise) - at_usual[tuple(driven)]) / scale

    rises = wall.means()
    basis, weights = directions_of(change, list(product(rises, *axes)), WALL_LEFT_OUT)
    if not len(basis):
        return None
    coarse = weights.reshape(rises.size, *(axis.size for axis in axes), -1)
    rise_axis = np.union1d(RISE_AXIS, [*rises, *(wall.usual + CLOSE_RISES)])
    values = PchipInterpolator(rises, coarse)(rise_axis)
    parts = operator_parts(fast, basis * scale)
    loads = [fast.load_names.index(name) for name in ("coolant_inlet", "coolant_friction")]
    size = fast.model.size
    column, out, into, load, read = [], [], [], [], []

    def add(direction: int, warmed: Array, weighted: Array, shown: Array) -> None:
        column.append(direction)
        out.append(warmed)
        into.append(weighted[:size])
        load.append({fast.load_names[k]: float(v) for k, v in zip(loads, weighted[size:], strict=True)})
        read.append(shown)

    heat = operator_parts(fast, usual[None])
    least = WALL_LEFT_OUT * np.linalg.norm(heat["conduction"])
    largest = np.abs(weights).max(axis=0)
    for direction in range(len(basis)):
        entering = np.hstack((-parts["conduction"][direction], parts["load"][direction][:, loads]))
        left, strength, right = np.linalg.svd(entering, full_matrices=False)
        for k in np.flatnonzero(strength * largest[direction] > least):
            add(direction, strength[k] * left[:, k], right[k], np.zeros(len(fast.channels)))
        for row in np.flatnonzero(np.any(parts["output"][direction] != 0.0, axis=1)):
            shown = np.eye(len(fast.channels))[row]
            weighted = np.concatenate(
                (parts["output"][direction][row], parts["feedthrough"][direction][row, loads])
            )
            add(direction, np.zeros(size), weighted, shown)
    return FeedbackTable(
        wall.sense,
        {"coolant_inlet": -1.0},
        coolant.table_inputs,
        (rise_axis, *axes),
        values,
        np.array(column),
        np.array(out),
        np.array(into),
        load,
        np.array(read),
    )
