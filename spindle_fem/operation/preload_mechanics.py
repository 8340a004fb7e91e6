"""Friction of bearing sets over ring difference, fit, speed and thrust, by the bearings' own mechanics.

What the effect ``thermal_preload`` interpolates: balls, rings and elastic seats solved once for a
machine, kept on disk.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from spindle_fem.cache import cache_directory, load_record, save_record, source_digest
from spindle_fem.definition.machine_spec import BearingSet, MachineSpec
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.preload_response import PreloadResponse
from spindle_fem.errors import NoEquilibriumError, OutOfValidityError
from spindle_fem.machine.view.build_view import view_of
from spindle_fem.machine.view.machine_names import MachineNames
from spindle_fem.machine.view.place_names import growth_names
from spindle_fem.model.elastic.machine_bodies import MachineBodies, carries_rings, machine_bodies
from spindle_fem.model.elastic.ring_seats import RingSeats
from spindle_fem.operation.bearing_heat import BearingMechanics
from spindle_fem.operation.friction_map import NOMINAL_FILM_TEMPERATURE
from spindle_fem.physics.bearings import mounting
from spindle_fem.physics.bearings.bearing_set import solve_states
from spindle_fem.physics.bearings.heat_model import HeatOptions
from spindle_fem.physics.bearings.heat_models import HEAT_MODELS
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]

FORMAT = "spindle-fem/preload-response/3"
# K; of rings, at which the shaft's part in what they do is taken.
REFERENCE_DIFFERENCE = 10.0
# K; of rings behind the shaft there: rings that differ much more from it would lift off.
RING_LAG = 1.0
# K; denser where balls of one side lose their load and where rings meet the housing.
DIFFERENCES = (-8.0, -3.0, 0.0, 3.0, 7.0, 12.0, 20.0, 30.0, 45.0)
# m; from a ring that the housing squeezes hard to one that heavy balls hardly spread to it.
GAPS = (-25e-6, -15e-6, -8e-6, -3e-6, 0.0, 3e-6, 8e-6, 20e-6)
# Shares of the highest speed: load decides less of the friction where balls are thrown outwards.
SPEED_SHARES = (0.05, 0.22, 0.55, 1.0)
# Shares of the definition's thrust: bearings that a thrust relieves lose what preload adds to it.
THRUST_SHARES = (0.0, 1.0, 2.0)
# Points that shape-preserving pieces put between two solved ones: cubic splines through solved points
# alone swing by a tenth where rings meet the housing.
PUT_BETWEEN = 2
# Over the speed of the definition, where no table of heat says how far the machine goes.
HIGHEST_SPEED = 1.5
# Where heat is by table nothing says which law made it; the analytical one knows the load of every contact.
LEVEL_OF_TABLES = "full"
# What is a kelvin warmer in turn.
INNER_RINGS, OUTER_RINGS, SHAFT, HOUSING = range(4)

_known: dict[str, PreloadResponse] = {}


@dataclass(frozen=True, slots=True)
class PreloadMechanics:
    """Preload responses of a machine's bearing sets, each computed on first use.

    Attributes
    ----------
    places : frozenset of str
        That the models of the machine have.
    """

    spec: MachineSpec
    places: frozenset[str]

    def __call__(self, component: str) -> PreloadResponse | None:
        """Response of one bearing set; None where its preload cannot change or is not known how."""
        sets = {f"{group.name}_bearings": group for group in self.spec.bearing_set}
        group = sets.get(component)
        if group is None or group.fit is None or not group.preload > 0.0 or group.spring_force:
            return None
        if self.spec.lubricant_of(group) is None or not carries_rings(self.spec):
            return None
        known = growth_names(self.spec)
        if not all(self.places.issuperset(known[bearing.name]) for bearing in group.bearing):
            return None
        digest = _digest(self.spec, group.name)
        if digest not in _known:
            path = cache_directory() / f"preload-{digest}.npz"
            found = load_record(path, FORMAT, PreloadResponse)
            if found is None:
                _known[digest] = _solved(self.spec, group)
                save_record(_known[digest], path, FORMAT)
            else:
                _known[digest] = PreloadResponse(**found)
        return _known[digest]


def machine_view(names: MachineNames, recording: Recording) -> MachineView:
    """View of a machine with geometry for one recording, with the preload responses of its bearing sets."""
    return replace(
        view_of(names, recording), preload=PreloadMechanics(names.spec, frozenset(names.place_names))
    )


def _digest(spec: MachineSpec, group: str) -> str:
    """Hash of all inputs of a set's response."""
    content = spec.model_dump(mode="json")
    # without quantities that a calibration moves
    sets = [
        {k: v for k, v in own.items() if k not in ("heat_factor", "ball_row")}
        for own in content["bearing_set"]
    ]
    known = [content[key] for key in ("part", "materials", "bearing_types", "grease", "channel", "operation")]
    heat = {k: v for k, v in content["heat"].items() if k not in ("ball_share", "inner_share")}
    own = [source_digest(__name__), group, sets, known, heat]
    return hashlib.sha256(json.dumps(own, sort_keys=True, default=str).encode()).hexdigest()


def _solved(spec: MachineSpec, group: BearingSet) -> PreloadResponse:
    """Solve a set over all differences, gaps, speeds and thrusts."""
    bodies = machine_bodies(spec)
    seating = RingSeats(spec, bodies)
    names = [bearing.name for bearing in group.bearing]
    rows = _rows(bodies, seating)[[seating.bearings.index(name) for name in names]]
    rings, shaft = rows[:, :, INNER_RINGS], rows[:, :, SHAFT]
    seats = seating.of_set(names)
    mechanics = BearingMechanics(spec, {group.name: seats})
    level = LEVEL_OF_TABLES if spec.heat.model == "table" else spec.heat.model
    set_solver = _SetSolver(
        mechanics,
        replace(mechanics.options, level=level),
        group,
        rings + shaft,
    )
    beyond = HIGHEST_SPEED * spec.operation.speed if spec.operation.speed_range is None else 0.0
    speeds = max(beyond, spec.highest_speed) * np.array(SPEED_SHARES)
    carries = group.carries_thrust and spec.operation.thrust != 0.0
    thrusts = np.sort(spec.operation.thrust * np.array(THRUST_SHARES if carries else (1.0,)))
    radial = mechanics.radial_loads[group.name]
    loads = [mounting.ExternalLoad(spec.axial_load(group, thrust), radial) for thrust in thrusts.tolist()]
    friction = [
        [[set_solver.log_friction(gap, speed, load) for load in loads] for speed in speeds.tolist()]
        for gap in GAPS
    ]
    differences, values = _finer(DIFFERENCES, np.moveaxis(np.array(friction), 3, 0), 0)
    gaps, values = _finer(GAPS, values, 1)
    at = (group.fit.outer_clearance / 2.0, spec.operation.speed, loads[len(loads) // 2])
    less = REFERENCE_DIFFERENCE - RING_LAG
    ahead = replace(set_solver, turning=rings + shaft * (REFERENCE_DIFFERENCE / less))
    both, by_all = (
        set_solver.log_ratio(difference, *at).mean() for difference in (less, REFERENCE_DIFFERENCE)
    )
    by_shaft = float((ahead.log_ratio(less, *at).mean() - both) / (by_all - both))
    count = len(names)
    seats_on, seats_in = zip(*(growth_names(spec)[name] for name in names), strict=True)
    return PreloadResponse(
        tuple(names),
        differences,
        gaps,
        speeds,
        thrusts,
        values,
        group.fit.outer_clearance,
        _fit_sigma(spec.bearing_types[group.bearing_type].outer_diameter),
        group.assembly_temperature,
        float(-rows[:, 1, OUTER_RINGS].mean()),
        dict(zip(seats_in, (rows[:, 1, HOUSING] / count).tolist(), strict=True)),
        dict.fromkeys(seats_on, by_shaft / count),
        spec.operation.speed,
        spec.operation.thrust,
    )


def _finer(points: Sequence[float], values: Array, axis: int) -> tuple[Array, Array]:
    """Points and values along an axis with more points between."""
    number = len(points)
    at = np.linspace(0.0, number - 1.0, (number - 1) * (PUT_BETWEEN + 1) + 1)
    dense = np.interp(at, np.arange(number), points)
    return dense, PchipInterpolator(np.array(points), values, axis=axis)(dense)


def _rows(bodies: MachineBodies, seating: RingSeats) -> Array:
    """Shifts (n_bearings, 4, 4) by a kelvin of inner rings, of outer rings, of the shaft, of the housing."""
    columns = {bodies.shaft: SHAFT, bodies.housing: HOUSING}
    values = {}
    for name, body in bodies.bodies.items():
        values[name] = np.zeros((body.section.mesh.p.shape[1], 4))
        ring = INNER_RINGS if name.endswith(".inner_ring") else OUTER_RINGS
        values[name][:, columns.get(name, ring)] = 1.0
    return seating.thermal_rows(*seating.rows_over(values))


def _fit_sigma(diameter: float) -> float:
    """1 σ of the clearance of a housing seat, m: a third of the bore's tolerance IT6 of ISO 286-1."""
    millimetres = 1.0e3 * diameter
    unit = 0.45e-6 * millimetres ** (1.0 / 3.0) + 1.0e-9 * millimetres
    return 10.0 * unit / 3.0


@dataclass(frozen=True, slots=True)
class _SetSolver:
    """Equilibrium of one set at given temperatures.

    Attributes
    ----------
    turning : (n_bearings, 4) ndarray, [m/K]
        Shifts by a kelvin of shaft and inner rings.
    """

    mechanics: BearingMechanics
    options: HeatOptions
    group: BearingSet
    turning: Array

    def log_friction(self, gap: float, speed: float, load: mounting.ExternalLoad) -> Array:
        """Logarithm of the friction at every difference, (n_x, n_bearings).

        Differences at which the balls find no equilibrium have the friction of the nearest that has one.
        """
        try:
            heat = self._heat(DIFFERENCES, gap, speed, load)
        except (NoEquilibriumError, OutOfValidityError):
            heat = np.array([self._alone(difference, gap, speed, load) for difference in DIFFERENCES])
            known = np.flatnonzero(np.isfinite(heat[:, 0]))
            if not len(known):
                raise
            nearest = [known[np.argmin(np.abs(known - index))] for index in range(len(heat))]
            heat = heat[nearest]
        return np.log(heat)

    def log_ratio(self, difference: float, gap: float, speed: float, load: mounting.ExternalLoad) -> Array:
        """Logarithm of every bearing's friction at a difference over that at none."""
        none, warm = np.log(self._heat((0.0, difference), gap, speed, load))
        return warm - none

    def _alone(self, difference: float, gap: float, speed: float, load: mounting.ExternalLoad) -> Array:
        try:
            return self._heat((difference,), gap, speed, load)[0]
        except (NoEquilibriumError, OutOfValidityError):
            return np.full(len(self.group.bearing), np.nan)

    def _heat(
        self, differences: Sequence[float], gap: float, speed: float, load: mounting.ExternalLoad
    ) -> Array:
        mounted = self.mechanics.sets[self.group.name]
        found = solve_states(
            mounted,
            speed,
            load,
            [self._temperatures(mounted, difference, gap) for difference in differences],
            lubricant=self.mechanics.lubricants[self.group.name].at(speed),
            control=HEAT_MODELS[self.options.level].ball_attitude,
            heat=self.mechanics.lubricants[self.group.name].options(self.options),
        )
        return np.array([[state.heat.total for state in states] for states in found])

    def _temperatures(
        self, mounted: mounting.BearingSet, difference: float, gap: float
    ) -> mounting.SetTemperatures:
        """Outer rings as assembled, inner rings and shaft warmer, balls between; the gap as given."""
        assembly = self.group.assembly_temperature
        inner = assembly + difference
        shifts = self.turning * difference
        shifts[:, 1] = gap - mounted.seats.clearance[1::2]
        one = mounting.BearingTemperatures(
            inner,
            assembly,
            assembly + 0.5 * difference,
            NOMINAL_FILM_TEMPERATURE,
            shaft_seat=inner,
            housing_seat=assembly,
        )
        return mounting.SetTemperatures((one,) * len(self.group.bearing), inner, assembly, assembly, shifts)
