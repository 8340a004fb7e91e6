"""Preloaded sets of bearings on one shaft: common displacement, thrust, temperatures (eq. 3, thermal preload)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from spindle_fem.errors import NoEquilibriumError, SpecError
from spindle_fem.tribology.ball_system import BallSystem, build_ball_rows, join_rows
from spindle_fem.tribology.bearing import STEEL_EXPANSION, BearingGeometry
from spindle_fem.tribology.equilibrium import Equilibrium, RacewayControl, solve_equilibrium
from spindle_fem.tribology.grease import Lubricant
from spindle_fem.tribology.heat import HeatOptions
from spindle_fem.tribology.preload import axial_state, require_force, tandem_approach
from spindle_fem.tribology.race_control import static_evaluation
from spindle_fem.tribology.state import BearingState
from spindle_fem.tribology.state_report import build_states, lubricant_state, require_seated
from spindle_fem.tribology.surface import SurfaceRoughness, roughness_from_rms
from spindle_fem.tribology.traction import TractionOptions

FloatArray = NDArray[np.float64]
ROOM_TEMPERATURE = 293.15


@dataclass(frozen=True, slots=True)
class MountedBearing:
    """A bearing of a set.

    Attributes
    ----------
    name : str
    geometry : BearingGeometry
    orientation : {+1, -1}
        +1: shaft motion towards +z loads it.
    axial_position : float, [m]
        Of the bearing's middle along z.
    """

    name: str
    geometry: BearingGeometry
    orientation: int = 1
    axial_position: float = 0.0

    def __post_init__(self) -> None:
        if self.orientation not in (1, -1):
            raise SpecError(f"{self.name}.orientation", f"it is {self.orientation}.", "Allowed: 1, -1.")


@dataclass(frozen=True, slots=True)
class BearingSet:
    """Bearings mounted against one another on one shaft.

    Attributes
    ----------
    bearings : tuple of MountedBearing
    preload : float, [N]
        Force through the set at assembly, at rest: bearings in tandem share it.
    preload_kind : {"rigid", "spring"}
        Rigid (locknut) keeps the displacement of the rings; a spring on the
        outer rings of the bearings with orientation -1 keeps the force.
    shaft_expansion, housing_expansion : float, [1/K]
    shaft_bore_diameter : float or None, [m]
        Of a hollow shaft; with it the inner ring grows by rotation. None: no growth.
    raceway_roughness, ball_roughness : float, [m]
        Rq.
    roughness : SurfaceRoughness or None
        Composite moments from measured profiles; None: assumed from both Rq.

    Raises
    ------
    SpecError
        No bearing, or preload that is negative or has nothing to act against.
    """

    bearings: tuple[MountedBearing, ...]
    preload: float = 0.0
    preload_kind: Literal["rigid", "spring"] = "rigid"
    shaft_expansion: float = STEEL_EXPANSION
    housing_expansion: float = STEEL_EXPANSION
    shaft_bore_diameter: float | None = None
    raceway_roughness: float = 0.05e-6
    ball_roughness: float = 0.01e-6
    roughness: SurfaceRoughness | None = None

    def __post_init__(self) -> None:
        if not self.bearings:
            raise SpecError("bearings", "the set has no bearing.", "Give at least one.")
        require_force("preload", self.preload)
        if self.preload_kind not in ("rigid", "spring"):
            raise SpecError("preload_kind", f"{self.preload_kind!r} is unknown.", "Allowed: rigid, spring.")
        if self.preload > 0.0 and not self.has_counter_bearings:
            raise SpecError(
                "preload", f"{self.preload:g} N through bearings that all face one way.",
                "Preload needs a counter bearing; give the force as axial load instead.",
            )  # fmt: skip
        for key in ("raceway_roughness", "ball_roughness"):
            if not getattr(self, key) > 0.0:
                raise SpecError(key, f"it is {getattr(self, key):g} m.", "It must be above 0.")

    @property
    def has_counter_bearings(self) -> bool:
        """Whether bearings of both orientations are in the set."""
        return len({bearing.orientation for bearing in self.bearings}) == 2

    @property
    def composite_roughness(self) -> SurfaceRoughness:
        """Moments of raceway and ball together."""
        if self.roughness is not None:
            return self.roughness
        return roughness_from_rms(self.raceway_roughness) + roughness_from_rms(self.ball_roughness)

    def assembly_approaches(self) -> FloatArray:
        """Axial approach of each bearing after assembly, (n_bearings,), m."""
        approach = {}
        for side in (1, -1):
            group = tuple(b.geometry for b in self.bearings if b.orientation == side)
            approach[side] = tandem_approach(group, self.preload) if group and self.preload else 0.0
        return np.array([approach[bearing.orientation] for bearing in self.bearings])


@dataclass(frozen=True, slots=True)
class BearingTemperatures:
    """Temperatures of one bearing, K.

    ``lubricant`` None: the mean of rings and balls.
    """

    inner_ring: float
    outer_ring: float
    ball: float
    lubricant: float | None = None

    @property
    def film(self) -> float:
        """Temperature at which viscosity is taken, K."""
        if self.lubricant is not None:
            return self.lubricant
        return 0.25 * (self.inner_ring + self.outer_ring) + 0.5 * self.ball


@dataclass(frozen=True, slots=True)
class SetTemperatures:
    """Temperatures of a set, K.

    Attributes
    ----------
    bearings : tuple of BearingTemperatures
    shaft, housing : float
        Between the bearings.
    assembly : float
        At which the preload was set.
    """

    bearings: tuple[BearingTemperatures, ...]
    shaft: float
    housing: float
    assembly: float = ROOM_TEMPERATURE


def uniform_temperatures(number: int, temperature: float) -> SetTemperatures:
    """A set at one temperature (K) that was assembled at it: no thermal displacement."""
    one = BearingTemperatures(temperature, temperature, temperature)
    return SetTemperatures((one,) * number, temperature, temperature, temperature)


@dataclass(frozen=True, slots=True)
class ExternalLoad:
    """Load on the shaft at a set.

    Attributes
    ----------
    thrust : float, [N]
        Towards +z; loads bearings of orientation +1.
    radial : float, [N]
        Along azimuth 0.
    moment : float, [N m]
        Moves the shaft towards +z at azimuth 0.
    """

    thrust: float = 0.0
    radial: float = 0.0
    moment: float = 0.0

    @property
    def is_axial(self) -> bool:
        """Whether all balls of a bearing see the same load."""
        return self.radial == 0.0 and self.moment == 0.0


def solve_bearing_set(
    bearing_set: BearingSet,
    speed: float,
    load: ExternalLoad | float,
    temperatures: SetTemperatures,
    *,
    lubricant: Lubricant | None = None,
    control: RacewayControl = "equilibrium",
    heat: HeatOptions | None = None,
    options: TractionOptions | None = None,
) -> tuple[BearingState, ...]:
    """Loads, angles, films and heat of every bearing of a set at one state.

    Parameters
    ----------
    bearing_set : BearingSet
    speed : float, [rad/s]
        Of the shaft.
    load : ExternalLoad or float
        A float is the thrust in N.
    temperatures : SetTemperatures
    lubricant : Lubricant, optional
        Without it there is no film, no heat, and friction cannot decide.
    control : {"equilibrium", "outer", "inner"}
        ``"equilibrium"`` lets friction decide (eqs 22, 23).
    heat : HeatOptions, optional
    options : TractionOptions, optional

    Returns
    -------
    tuple of BearingState
        In the order of the set.

    Raises
    ------
    NoEquilibriumError
        With the speed from which on none exists.
    OutOfValidityError
        A lubricant temperature outside the viscosity fit.
    """
    external = load if isinstance(load, ExternalLoad) else ExternalLoad(float(load))
    options, heat = options or TractionOptions(), heat or HeatOptions()
    _require_consistent(bearing_set, temperatures, control, lubricant)
    problem = _build_problem(bearing_set, abs(speed), external, temperatures)
    film = None
    if lubricant is not None:
        counts = [len(rows["weight"]) for rows in problem.rows]
        kelvin = np.repeat([entry.film for entry in temperatures.bearings], counts)
        film = lubricant_state(lubricant, kelvin, bearing_set.composite_roughness)
    solved = _solve(problem, abs(speed), control, film, options)
    unloaded = external == ExternalLoad()
    preloads = np.full(len(bearing_set.bearings), np.nan)
    if bearing_set.has_counter_bearings:
        bare = problem
        if not unloaded:
            bare = _build_problem(bearing_set, abs(speed), ExternalLoad(), temperatures)
        reference = solved if unloaded else _solve(bare, abs(speed), "outer", None, options)
        preloads = _axial_forces(bare, reference)
    require_seated(problem.system, solved, _names_of_rows(problem, bearing_set), abs(speed))
    return build_states(
        bearing_set.bearings, problem.rows, problem.system, solved, abs(speed),
        lubricant=lubricant, film=film, options=options, heat=heat, control=control, preloads=preloads,
        film_temperatures=[entry.film for entry in temperatures.bearings],
        roughness=(bearing_set.raceway_roughness, bearing_set.ball_roughness),
    )  # fmt: skip


def solve_bearing(
    geometry: BearingGeometry,
    speed: float,
    axial_load: float,
    *,
    radial_load: float = 0.0,
    moment: float = 0.0,
    temperature: float = 313.15,
    lubricant: Lubricant | None = None,
    control: RacewayControl = "equilibrium",
    heat: HeatOptions | None = None,
    options: TractionOptions | None = None,
    name: str = "bearing",
) -> BearingState:
    """One bearing under axial load, radial load and moment, all parts at one temperature.

    Parameters
    ----------
    speed : float, [rad/s]
    axial_load, radial_load : float, [N]
    moment : float, [N m]
    temperature : float, [K]

    Source: Jones (1960); golden values of the 218 bearing in the published tests.

    >>> g = BearingGeometry(14.2875e-3, 30, 165e-3, math.radians(15), 0.52, 0.52)
    >>> state = solve_bearing(g, 3000 * math.pi / 30, 1137.2, control="outer")
    >>> round(math.degrees(state.contact_angle_inner), 3)
    18.345
    """
    single = BearingSet((MountedBearing(name, geometry),))
    return solve_bearing_set(
        single, speed, ExternalLoad(axial_load, radial_load, moment), uniform_temperatures(1, temperature),
        lubricant=lubricant, control=control, heat=heat, options=options,
    )[0]  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    bearing_set: BearingSet
    rows: list[dict[str, FloatArray]]
    system: BallSystem
    load: FloatArray
    spring: bool
    ball_load: float


def _require_consistent(
    bearing_set: BearingSet, temperatures: SetTemperatures, control: str, lubricant: Lubricant | None
) -> None:
    if len(temperatures.bearings) != len(bearing_set.bearings):
        raise SpecError(
            "temperatures", f"{len(temperatures.bearings)} entries for {len(bearing_set.bearings)} bearings.",
            "Give one for each bearing.",
        )  # fmt: skip
    if control not in ("equilibrium", "outer", "inner"):
        raise SpecError("raceway_control", f"{control!r} is unknown.", "Allowed: outer, inner, equilibrium.")
    if control == "equilibrium" and lubricant is None:
        raise SpecError(
            "raceway_control", "equilibrium lets friction decide, but no lubricant is given.",
            "Give a lubricant, or outer or inner raceway control.",
        )  # fmt: skip


def _build_problem(
    bearing_set: BearingSet, speed: float, external: ExternalLoad, temperatures: SetTemperatures
) -> _Problem:
    approaches = bearing_set.assembly_approaches()
    middle = float(np.mean([bearing.axial_position for bearing in bearing_set.bearings]))
    shaft_rise = temperatures.shaft - temperatures.assembly
    housing_rise = temperatures.housing - temperatures.assembly
    rows = []
    for bearing, heat, approach in zip(bearing_set.bearings, temperatures.bearings, approaches, strict=True):
        geometry, sign = bearing.geometry, bearing.orientation
        position = bearing.axial_position - middle
        offset = sign * geometry.ball_diameter * math.sin(geometry.contact_angle)
        inner_place = position + (geometry.groove_curvature_inner - 0.5) * offset
        outer_place = position - (geometry.groove_curvature_outer - 0.5) * offset
        thermal = sign * (
            bearing_set.shaft_expansion * inner_place * shaft_rise
            - bearing_set.housing_expansion * outer_place * housing_rise
        )
        single = external.is_axial
        count = geometry.ball_count
        azimuth = np.zeros(1) if single else 2.0 * np.pi * np.arange(count) / count
        rows.append(
            build_ball_rows(
                geometry, azimuth, float(count) if single else 1.0,
                ring_rise=(heat.inner_ring - temperatures.assembly, heat.outer_ring - temperatures.assembly),
                ball_rise=heat.ball - temperatures.assembly,
                radial_growth=rotation_growth(geometry, speed, bearing_set.shaft_bore_diameter),
                axial_offset=approach + thermal,
                orientation=sign,
                axial_position=position,
            )
            | {"azimuth": azimuth}
        )  # fmt: skip
    columns = [0] if external.is_axial else [0, 1, 2, 3, 4]
    system = join_rows([{k: v for k, v in row.items() if k != "azimuth"} for row in rows], columns)
    load = np.array([external.thrust, external.radial, 0.0, external.moment, 0.0])[columns]
    spring = bearing_set.preload_kind == "spring" and bearing_set.has_counter_bearings
    if spring:
        sides = np.repeat([b.orientation for b in bearing_set.bearings], [len(row["weight"]) for row in rows])
        floating = (sides < 0).astype(float)[:, None]
        system = replace(
            system, axial_map=np.hstack([system.axial_map, floating]),
            radial_map=np.hstack([system.radial_map, np.zeros_like(floating)]),
        )  # fmt: skip
        load = np.append(load, bearing_set.preload)
    return _Problem(bearing_set, rows, system, load, spring, _ball_load(bearing_set, external))


def _ball_load(bearing_set: BearingSet, external: ExternalLoad) -> float:
    """Size of the largest ball load at rest, N."""
    geometry = bearing_set.bearings[0].geometry
    sine = max(math.sin(geometry.contact_angle), 0.1)
    axial = (bearing_set.preload + abs(external.thrust)) / (geometry.ball_count * sine)
    radial = 5.0 * abs(external.radial) / geometry.ball_count
    tilting = 5.0 * abs(external.moment) / (geometry.ball_count * 0.5 * geometry.pitch_diameter * sine)
    return max(axial, radial, tilting)


def rotation_growth(geometry: BearingGeometry, speed: float, shaft_bore: float | None) -> float:
    """Radial growth of the inner raceway by rotation, ring and shaft as one hollow body, m.

    u = ρω²b/(4E) [(1-ν) b² + (3+ν) a²] at the outside b of a bore a.

    Source: Timoshenko & Goodier, rotating discs.
    """
    if shaft_bore is None or speed == 0.0:
        return 0.0
    outside = 0.5 * (geometry.pitch_diameter - geometry.ball_diameter * math.cos(geometry.contact_angle))
    inside = 0.5 * shaft_bore
    if not 0.0 <= inside < outside:
        raise SpecError(
            "shaft_bore_diameter", f"it is {shaft_bore * 1e3:g} mm.", "It must lie inside the ring."
        )
    ratio = geometry.poisson_ratio
    shape = (1.0 - ratio) * outside**2 + (3.0 + ratio) * inside**2
    return geometry.density * speed**2 * outside / (4.0 * geometry.young_modulus) * shape


def _solve(
    problem: _Problem, speed: float, control: RacewayControl, film, options: TractionOptions
) -> Equilibrium:
    where = " ".join(bearing.name for bearing in problem.bearing_set.bearings)
    if speed > 0.0 and problem.ball_load == 0.0:
        raise NoEquilibriumError(
            where, "a turning bearing without load or preload has no equilibrium: nothing seats its balls.",
            "Give an axial load or a preload.",
        )  # fmt: skip
    start = _start(problem, where)
    return solve_equilibrium(
        problem.system, speed, problem.load, control, start=start, ball_load=problem.ball_load,
        lubricant=film, options=options, where=where,
    )  # fmt: skip


def _start(problem: _Problem, where: str) -> FloatArray:
    """Displacements at rest under the axial part of the load."""
    system, load = problem.system, problem.load
    displacement = np.zeros(system.axial_map.shape[1])
    axial = problem.spring or not problem.bearing_set.has_counter_bearings

    def approach_of(side: int, force: float) -> float:
        group = [b.geometry for b in problem.bearing_set.bearings if b.orientation == side]
        return tandem_approach(tuple(group), force) if len(group) else 0.0

    if axial:
        side = 1 if not problem.spring else None
        if problem.spring:
            front = problem.bearing_set.preload + load[0]
            if front < 0.0:
                raise NoEquilibriumError(
                    where, f"thrust {load[0]:g} N lifts the set off its spring of "
                    f"{problem.bearing_set.preload:g} N.", "Raise the preload or lower the thrust.",
                )  # fmt: skip
            offsets = system.start[:, 0] - _free_axial(problem)
            sides = _row_sides(problem)
            displacement[0] = approach_of(1, front) - float(offsets[sides > 0].mean())
            rear = approach_of(-1, problem.bearing_set.preload) - float(offsets[sides < 0].mean())
            displacement[-1] = rear + displacement[0]
        else:
            side = problem.bearing_set.bearings[0].orientation
            if side * load[0] < 0.0:
                raise NoEquilibriumError(
                    where, f"thrust {load[0]:g} N unloads bearings that all face the other way.",
                    "Turn the thrust round, or add a counter bearing.",
                )  # fmt: skip
            group = tuple(b.geometry for b in problem.bearing_set.bearings)
            alpha_free = load[0] == 0.0 and problem.ball_load > 0.0
            approach = -group[0].curvature_centre_distance * math.sin(group[0].contact_angle)
            displacement[0] = side * (approach if alpha_free else tandem_approach(group, abs(load[0])))
    else:
        displacement[0] = _balanced_shift(problem, load[0], where)
    if len(load) >= 5 and load[1] != 0.0:
        geometry = problem.bearing_set.bearings[0].geometry
        from spindle_fem.tribology.hertz import mean_load_constant

        count = float(system.weight.sum())
        share = 4.37 * abs(load[1]) / (count * math.cos(geometry.contact_angle))
        guess = (share / mean_load_constant(geometry)) ** (2.0 / 3.0)
        loosened = 0.0 if load[0] or problem.bearing_set.preload else 1.0
        displacement[1] = math.copysign(guess * (loosened or 0.3), load[1])
    return displacement


def _free_axial(problem: _Problem) -> FloatArray:
    """BD sin α_0 of every row, m."""
    values = [b.geometry.curvature_centre_distance * math.sin(b.geometry.contact_angle)
              for b in problem.bearing_set.bearings]  # fmt: skip
    return np.repeat(values, [len(row["weight"]) for row in problem.rows])


def _row_sides(problem: _Problem) -> NDArray[np.int64]:
    sides = [bearing.orientation for bearing in problem.bearing_set.bearings]
    return np.repeat(sides, [len(row["weight"]) for row in problem.rows])


def _balanced_shift(problem: _Problem, thrust: float, where: str) -> float:
    """Shaft displacement of a rigid set that balances the thrust at rest, m."""
    system = problem.system
    direction = np.zeros(system.axial_map.shape[1])
    direction[0] = 1.0

    def excess(shift: float) -> float:
        axial, radial = system.groove_distances(direction * shift)
        force = static_evaluation(system, axial, radial).ring_force[:, 0]
        return float(system.axial_map[:, 0] @ (system.weight * force)) - thrust

    if excess(0.0) == 0.0:
        return 0.0
    reach = 1e-6
    largest = 20.0 * float(np.max(system.rest_length))
    while excess(-reach) * excess(reach) > 0.0:
        reach *= 2.0
        if reach > largest:
            raise NoEquilibriumError(
                where, f"thrust {thrust:g} N is more than the set can carry.", "Lower the thrust."
            )
    return float(brentq(excess, -reach, reach, xtol=1e-15, rtol=1e-13))


def _axial_forces(problem: _Problem, solved: Equilibrium) -> FloatArray:
    """Axial force of each bearing in its own load direction, N (friction across the groove left out)."""
    contacts = solved.contacts
    force = problem.system.weight * contacts.load[:, 0] * contacts.sine[:, 0]
    edges = np.cumsum([0] + [len(row["weight"]) for row in problem.rows])
    return np.array([force[a:b].sum() for a, b in zip(edges[:-1], edges[1:], strict=True)])


def _names_of_rows(problem: _Problem, bearing_set: BearingSet) -> Sequence[str]:
    counts = [len(row["weight"]) for row in problem.rows]
    return [b.name for b, number in zip(bearing_set.bearings, counts, strict=True) for _ in range(number)]


__all__ = [
    "BearingSet", "BearingTemperatures", "ExternalLoad", "MountedBearing", "SetTemperatures", "axial_state",
    "rotation_growth", "solve_bearing", "solve_bearing_set", "uniform_temperatures",
]  # fmt: skip
