"""Preloaded sets on one shaft: common displacement, thrust, temperatures (eq. 3, thermal preload)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import NoEquilibriumError, SpecError
from spindle_fem.tribology.ball_system import build_ball_rows, join_rows
from spindle_fem.tribology.bearing import BearingGeometry
from spindle_fem.tribology.equilibrium import Equilibrium, RacewayControl, solve_equilibrium
from spindle_fem.tribology.fits import FitTemperatures, mounted_state, seated_rings
from spindle_fem.tribology.grease import Lubricant
from spindle_fem.tribology.heat import HeatOptions
from spindle_fem.tribology.mounting import (
    BearingSet,
    BearingTemperatures,
    ExternalLoad,
    MountedBearing,
    SetTemperatures,
    rotation_growth,
    uniform_temperatures,
)
from spindle_fem.tribology.rings import RingLaw
from spindle_fem.tribology.set_problem import SetProblem, start_displacement
from spindle_fem.tribology.state import BearingState
from spindle_fem.tribology.state_report import build_states, lubricant_state, require_seated
from spindle_fem.tribology.traction import LubricantState, TractionOptions
from spindle_fem.validity import CodedWarning

FloatArray = NDArray[np.float64]
# Cage slip from which a bearing is said to slide
_GROSS_SLIP = 0.1


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
    names, shoulders = _rows_of_bearings(problem)
    require_seated(solved, names, shoulders, abs(speed))
    states = build_states(
        bearing_set.bearings, problem.rows, problem.system, solved, abs(speed),
        lubricant=lubricant, film=film, options=options, heat=heat, control=control,
        film_temperatures=[entry.film for entry in temperatures.bearings],
        roughness=(bearing_set.raceway_roughness, bearing_set.ball_roughness),
    )  # fmt: skip
    states = tuple(_with_sliding_note(state) for state in states)
    if not bearing_set.has_counter_bearings:
        return states
    if external == ExternalLoad():
        return tuple(replace(state, preload=state.axial_force) for state in states)
    return _with_preloads(
        states, bearing_set, speed, temperatures, lubricant=lubricant, control=control, options=options
    )


def gross_sliding_onset(
    bearing_set: BearingSet,
    highest_speed: float,
    load: ExternalLoad | float,
    temperatures: SetTemperatures,
    lubricant: Lubricant,
    *,
    tolerance: float = 0.02,
    options: TractionOptions | None = None,
) -> float:
    """Speed from which friction no longer keeps the balls rolling, rad/s.

    Bisection on the speed at which a cage slips by a tenth or the equilibrium
    ends; between standstill and the onset the balls are taken to roll.

    Parameters
    ----------
    highest_speed : float, [rad/s]
    tolerance : float, [-]
        Of the onset, relative to ``highest_speed``.

    Returns
    -------
    float
        Infinite where the balls still roll at ``highest_speed``.
    """

    def slides(speed: float) -> bool:
        try:
            states = solve_bearing_set(
                bearing_set, speed, load, temperatures, lubricant=lubricant, options=options,
                heat=HeatOptions("paper"),
            )  # fmt: skip
        except NoEquilibriumError:
            return True
        return any(state.cage_slip > _GROSS_SLIP for state in states)

    if not slides(highest_speed):
        return math.inf
    low, high = 0.0, highest_speed
    while high - low > tolerance * highest_speed:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if slides(middle) else (middle, high)
    return high


def _with_sliding_note(state: BearingState) -> BearingState:
    if not state.cage_slip > _GROSS_SLIP:
        return state
    text = f"{state.name}: gross sliding, the balls orbit {state.cage_slip:.0%} slower than rolling asks."
    return replace(state, warnings=(*state.warnings, CodedWarning("gross_sliding", text)))


def _with_preloads(
    states: tuple[BearingState, ...],
    bearing_set: BearingSet,
    speed: float,
    temperatures: SetTemperatures,
    *,
    lubricant: Lubricant | None,
    control: RacewayControl,
    options: TractionOptions,
) -> tuple[BearingState, ...]:
    """Add the axial forces that remain without external load."""
    if bearing_set.preload == 0.0 and speed != 0.0:
        return states
    # a loose set leaves friction nothing to decide
    loose = any(note.code == "counter_bearing_unloaded" for state in states for note in state.warnings)
    try:
        bare = solve_bearing_set(
            bearing_set, speed, ExternalLoad(), temperatures, lubricant=lubricant,
            control="outer" if loose else control, heat=HeatOptions("paper"), options=options,
        )  # fmt: skip
    except NoEquilibriumError as error:
        note = CodedWarning("preload_unknown", f"without external load: {error.what}")
        return tuple(replace(state, warnings=(*state.warnings, note)) for state in states)
    return tuple(replace(state, preload=idle.axial_force) for state, idle in zip(states, bare, strict=True))


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
) -> SetProblem:
    approaches = bearing_set.assembly_approaches()
    middle = float(np.mean([bearing.axial_position for bearing in bearing_set.bearings]))
    shaft_rise = temperatures.shaft - temperatures.assembly
    housing_rise = temperatures.housing - temperatures.assembly
    rows, laws, growths = [], [], []
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
        law, growth = _ring_law(bearing_set, bearing, heat, temperatures, speed, external)
        laws.append(law)
        if law is not None:
            growths.append(growth)
        rows.append(
            build_ball_rows(
                geometry, azimuth, float(count) if single else 1.0,
                ring_rise=(heat.inner_ring - temperatures.assembly, heat.outer_ring - temperatures.assembly),
                ball_rise=heat.ball - temperatures.assembly,
                radial_growth=rotation_growth(geometry, speed, bearing_set.shaft_bore_diameter)
                if law is None else 0.0,
                axial_offset=approach + thermal,
                orientation=sign,
                axial_position=position,
            )
            | {"azimuth": azimuth}
        )  # fmt: skip
    columns = [0] if external.is_axial else [0, 1, 2, 3, 4]
    system = join_rows([{k: v for k, v in row.items() if k != "azimuth"} for row in rows], columns, laws)
    load = np.array([external.thrust, external.radial, 0.0, external.moment, 0.0])[columns]
    load = np.append(load, np.zeros(len(growths)))
    spring = bearing_set.preload_kind == "spring" and bearing_set.has_counter_bearings
    if spring:
        sides = np.repeat([b.orientation for b in bearing_set.bearings], [len(row["weight"]) for row in rows])
        floating = (sides < 0).astype(float)[:, None]
        system = replace(
            system, axial_map=np.hstack([system.axial_map, floating]),
            radial_map=np.hstack([system.radial_map, np.zeros_like(floating)]),
        )  # fmt: skip
        load = np.append(load, bearing_set.preload)
    return SetProblem(
        bearing_set, rows, system, load, spring, _ball_load(bearing_set, external), np.array(growths)
    )


def _ring_law(
    bearing_set: BearingSet,
    bearing: MountedBearing,
    heat: BearingTemperatures,
    temperatures: SetTemperatures,
    speed: float,
    external: ExternalLoad,
) -> tuple[RingLaw | None, float]:
    """How the rings of a bearing give way, and the growth to look for first (m); None for rigid rings."""
    if bearing.fits is None:
        return None, 0.0
    rise = FitTemperatures(
        *(
            kelvin - temperatures.assembly
            for kelvin in (
                heat.inner_ring,
                heat.outer_ring,
                temperatures.shaft if heat.shaft_seat is None else heat.shaft_seat,
                temperatures.housing if heat.housing_seat is None else heat.housing_seat,
            )
        )
    )
    geometry = bearing.geometry
    # the outer ring carries the balls' own centrifugal force too; they orbit as in pure rolling
    orbital = 0.5 * speed * (1.0 - geometry.diameter_ratio * math.cos(geometry.contact_angle))
    centrifugal = 0.5 * geometry.ball_count * geometry.ball_mass * geometry.pitch_diameter * orbital**2
    law = seated_rings(geometry, bearing.fits).law(rise, speed, centrifugal)
    beside = sum(1 for other in bearing_set.bearings if other.orientation == bearing.orientation)
    force = (bearing_set.preload or abs(external.thrust)) / beside
    radial = mounted_state(geometry, bearing.fits, force).radial_force if force > 0.0 else 0.0
    return law, law.growth(radial)


def _ball_load(bearing_set: BearingSet, external: ExternalLoad) -> float:
    """Size of the largest ball load at rest, N."""
    geometry = bearing_set.bearings[0].geometry
    sine = max(math.sin(geometry.contact_angle), 0.1)
    axial = (bearing_set.preload + abs(external.thrust)) / (geometry.ball_count * sine)
    radial = 5.0 * abs(external.radial) / geometry.ball_count
    tilting = 5.0 * abs(external.moment) / (geometry.ball_count * 0.5 * geometry.pitch_diameter * sine)
    return max(axial, radial, tilting)


def _solve(
    problem: SetProblem,
    speed: float,
    control: RacewayControl,
    film: LubricantState | None,
    options: TractionOptions,
) -> Equilibrium:
    where = " ".join(bearing.name for bearing in problem.bearing_set.bearings)
    if speed > 0.0 and problem.ball_load == 0.0:
        raise NoEquilibriumError(
            where, "a turning bearing without load or preload has no equilibrium: nothing seats its balls.",
            "Give an axial load or a preload.",
        )  # fmt: skip
    start = start_displacement(problem, where)
    return solve_equilibrium(
        problem.system, speed, problem.load, control, start=start, ball_load=problem.ball_load,
        lubricant=film, options=options, where=where,
    )  # fmt: skip


def _rows_of_bearings(problem: SetProblem) -> tuple[list[str], FloatArray]:
    """Bearing name and largest contact angle (rad) of every ball row."""
    counts = [len(row["weight"]) for row in problem.rows]
    bearings = problem.bearing_set.bearings
    names = [b.name for b, number in zip(bearings, counts, strict=True) for _ in range(number)]
    return names, np.repeat([b.geometry.largest_contact_angle for b in bearings], counts)


__all__ = [
    "BearingSet",
    "BearingTemperatures",
    "ExternalLoad",
    "MountedBearing",
    "SetTemperatures",
    "gross_sliding_onset",
    "solve_bearing",
    "solve_bearing_set",
    "uniform_temperatures",
]
