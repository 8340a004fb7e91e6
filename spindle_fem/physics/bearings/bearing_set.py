"""Preloaded sets on one shaft: common displacement, thrust, temperatures (eq. 3, thermal preload)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import NoEquilibriumError, SpecError
from spindle_fem.physics.bearings.ball_system import BallSystem
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_state import BearingState
from spindle_fem.physics.bearings.equilibrium import (
    Equilibrium,
    RacewayControl,
    equilibrium_near,
    solve_equilibrium,
)
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.heat_model import HeatOptions
from spindle_fem.physics.bearings.mounting import (
    BearingSet,
    BearingTemperatures,
    ExternalLoad,
    MountedBearing,
    SetTemperatures,
    uniform_temperatures,
)
from spindle_fem.physics.bearings.set_problem import (
    SetProblem,
    build_problem,
    side_by_side,
    start_displacement,
)
from spindle_fem.physics.bearings.state_records import (
    Lubrication,
    SolvedBearings,
    build_states,
    lubricant_state,
    require_seated,
)
from spindle_fem.physics.bearings.traction import LubricantState, TractionOptions
from spindle_fem.validity import CodedWarning

FloatArray = NDArray[np.float64]
# Of the speed: how far another equilibrium may be to begin from it.
_NEAR_SPEED = 0.05
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
    speed : float, [rad/s]
        Of the shaft.
    load : ExternalLoad or float
        A float is the thrust in N.
    lubricant : Lubricant, optional
        Without it there is no film, no heat, and friction cannot decide.
    control : {"equilibrium", "outer", "inner"}
        ``"equilibrium"`` lets friction decide (eqs 22, 23).

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
    wanted = (external,)
    if bearing_set.has_counter_bearings and external != ExternalLoad() and bearing_set.preload != 0.0:
        wanted = (external, ExternalLoad())
    try:
        found = solve_states(
            bearing_set, speed, wanted, (temperatures,) * len(wanted), lubricant=lubricant, control=control,
            heat=heat, options=options,
        )  # fmt: skip
    except NoEquilibriumError:
        # Either may have none; the loaded one says why.
        found = solve_states(
            bearing_set, speed, external, (temperatures,), lubricant=lubricant, control=control, heat=heat,
            options=options,
        )  # fmt: skip
    states = found[0]
    if control == "equilibrium" and any(state.cage_slip > _GROSS_SLIP for state in states):
        onset = gross_sliding_onset(
            bearing_set, abs(speed), external, temperatures, lubricant, options=options
        )
        states = tuple(_with_sliding_note(state, onset) for state in states)
    if not bearing_set.has_counter_bearings:
        return states
    if external == ExternalLoad() or len(found) == 2:
        return tuple(
            replace(state, preload=idle.axial_force) for state, idle in zip(states, found[-1], strict=True)
        )
    return _with_preloads(
        states, bearing_set, speed, temperatures, lubricant=lubricant, control=control, options=options
    )


def solve_states(
    bearing_set: BearingSet,
    speed: float,
    load: ExternalLoad | Sequence[ExternalLoad],
    temperatures: Sequence[SetTemperatures],
    *,
    lubricant: Lubricant | None = None,
    control: RacewayControl = "equilibrium",
    heat: HeatOptions | None = None,
    options: TractionOptions | None = None,
) -> tuple[tuple[BearingState, ...], ...]:
    """States of a set at several temperatures in one solution, without the preload that would remain.

    Parameters as of :func:`solve_bearing_set`; one set of states for each of
    ``temperatures``, under one load or each under its own.

    Raises
    ------
    NoEquilibriumError
        One of the states does not exist.
    OutOfValidityError
    """
    options, heat = options or TractionOptions(), heat or HeatOptions()
    for entry in temperatures:
        _require_consistent(bearing_set, entry, control, lubricant)
    speed = abs(speed)
    loads = (load,) * len(temperatures) if isinstance(load, ExternalLoad) else load
    problems = _problems(bearing_set, speed, loads, temperatures)
    films = [entry.film for state in temperatures for entry in state.bearings]
    rows = [row for problem in problems for row in problem.rows]
    film = None
    if lubricant is not None:
        kelvin = np.repeat(films, [len(row["weight"]) for row in rows])
        film = lubricant_state(lubricant, kelvin, bearing_set.composite_roughness)
    system = problems[0].system if len(problems) == 1 else side_by_side(problems)
    solved = _solve(problems, loads, system, speed, control=control, film=film, options=options)
    bearings = bearing_set.bearings * len(problems)
    counts = [len(row["weight"]) for row in rows]
    names = [b.name for b, number in zip(bearings, counts, strict=True) for _ in range(number)]
    shoulders = np.repeat([bearing.geometry.largest_contact_angle for bearing in bearings], counts)
    require_seated(solved, names, shoulders, speed)
    width = problems[0].system.axial_map.shape[1]
    number = len(bearing_set.bearings)
    columns = np.repeat(width * np.arange(len(problems)), number)
    states = build_states(
        SolvedBearings(bearings, rows, system, solved, speed, control, columns, _is_held(bearing_set, loads)),
        Lubrication(lubricant, film, films, (bearing_set.raceway_roughness, bearing_set.ball_roughness)),
        options,
        heat,
    )
    return tuple(states[first : first + number] for first in range(0, len(states), number))


def _problems(
    bearing_set: BearingSet,
    speed: float,
    loads: Sequence[ExternalLoad],
    temperatures: Sequence[SetTemperatures],
) -> list[SetProblem]:
    """Problem of every state; states that only their films' temperatures tell apart share one."""
    known: dict[object, SetProblem] = {}
    problems = []
    for load, entry in zip(loads, temperatures, strict=True):
        bodies = tuple(replace(bearing, lubricant=None) for bearing in entry.bearings)
        shifts = None if entry.shifts is None else entry.shifts.tobytes()
        key = load, bodies, entry.shaft, entry.housing, entry.assembly, shifts
        if key not in known:
            known[key] = build_problem(bearing_set, speed, load, entry)
        problems.append(known[key])
    return problems


def _is_held(bearing_set: BearingSet, loads: Sequence[ExternalLoad]) -> bool:
    """Whether a distance holds the set, and no force along the axis."""
    if bearing_set.has_counter_bearings:
        return bearing_set.preload_kind == "rigid" or bearing_set.preload == 0.0
    return all(load.thrust == 0.0 for load in loads)


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
    external = load if isinstance(load, ExternalLoad) else ExternalLoad(float(load))

    def slides(speed: float) -> bool:
        try:
            (states,) = solve_states(
                bearing_set, speed, external, (temperatures,), lubricant=lubricant, options=options,
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


def _with_sliding_note(state: BearingState, onset: float) -> BearingState:
    if not state.cage_slip > _GROSS_SLIP:
        return state
    begins = f"it begins at about {onset * 30.0 / math.pi:.0f} rpm" if onset > 0.0 else "it slides from rest"
    text = (
        f"{state.name}: gross sliding, the balls orbit {state.cage_slip:.0%} slower than rolling asks; "
        f"in this set {begins}."
    )
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
        (bare,) = solve_states(
            bearing_set, speed, ExternalLoad(), (temperatures,), lubricant=lubricant,
            control="outer" if loose else control, heat=HeatOptions("paper"), options=options,
        )  # fmt: skip
    except NoEquilibriumError as error:
        note = CodedWarning("preload_unknown", f"without external load: {error.what}")
        return tuple(replace(state, warnings=(*state.warnings, note)) for state in states)
    return tuple(replace(state, preload=idle.axial_force) for state, idle in zip(states, bare, strict=True))


def solve_bearing(
    geometry: BearingGeometry,
    speed: float,
    load: float | ExternalLoad,
    *,
    temperature: float = 313.15,
    lubricant: Lubricant | None = None,
    control: RacewayControl = "equilibrium",
    heat: HeatOptions | None = None,
    options: TractionOptions | None = None,
) -> BearingState:
    """One bearing under axial load, radial load and moment, all parts at one temperature.

    Parameters
    ----------
    speed : float, [rad/s]
    load : float [N] or ExternalLoad
        A plain number is an axial load.
    temperature : float, [K]

    Source: Jones (1960); golden values of the 218 bearing in the published tests.

    >>> g = BearingGeometry(14.2875e-3, 30, 165e-3, math.radians(15), 0.52, 0.52)
    >>> state = solve_bearing(g, 3000 * math.pi / 30, 1137.2, control="outer")
    >>> round(math.degrees(state.contact_angle_inner), 3)
    18.345
    """
    single = BearingSet((MountedBearing("bearing", geometry),))
    given = load if isinstance(load, ExternalLoad) else ExternalLoad(load)
    return solve_bearing_set(
        single, speed, given, uniform_temperatures(1, temperature),
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


def _solve(
    problems: Sequence[SetProblem],
    loads: Sequence[ExternalLoad],
    system: BallSystem,
    speed: float,
    *,
    control: RacewayControl,
    film: LubricantState | None,
    options: TractionOptions,
) -> Equilibrium:
    where = " ".join(bearing.name for bearing in problems[0].bearing_set.bearings)
    ball_load = max(problem.ball_load for problem in problems)
    if speed > 0.0 and ball_load == 0.0:
        raise NoEquilibriumError(
            where, "a turning bearing without load or preload has no equilibrium: nothing seats its balls.",
            "Give an axial load or a preload.",
        )  # fmt: skip
    load = np.concatenate([problem.load for problem in problems])
    recent = problems[0].bearing_set.recent if control == "equilibrium" and speed > 0.0 else None
    key = system.number, len(load)
    if recent is not None and key in recent:
        at, before = recent[key]
        if abs(speed - at) <= _NEAR_SPEED * speed:
            before = replace(before, ball_speeds=before.ball_speeds * (speed / at))
            near = equilibrium_near(system, speed, load, before, ball_load, film, options)
            if near is not None:
                recent[key] = speed, near
                return near
    starts = {problem: start_displacement(problem, where) for problem in dict.fromkeys(problems)}
    start = np.concatenate([starts[problem] for problem in problems])
    try:
        solved = solve_equilibrium(
            system, speed, load, control, at_rest=(start, ball_load), lubricant=film, options=options,
            where=where,
        )  # fmt: skip
    except NoEquilibriumError as error:
        # Of loads side by side the first is the one that was asked for.
        raise _under(error, loads[0]) from error
    if recent is not None:
        recent[key] = speed, solved
    return solved


def _under(error: NoEquilibriumError, load: ExternalLoad) -> NoEquilibriumError:
    """The error of balls that find no place, with the load that the set is under."""
    radial = abs(load.radial)
    across = f" and {radial:.0f} N across" if radial else ""
    what = f"{error.what.removesuffix('.')}, with {load.thrust:.0f} N along the shaft{across}."
    return NoEquilibriumError(error.where, what, error.how_to_fix)


__all__ = [
    "BearingSet",
    "BearingTemperatures",
    "ExternalLoad",
    "MountedBearing",
    "SetTemperatures",
    "gross_sliding_onset",
    "solve_bearing",
    "solve_bearing_set",
    "solve_states",
    "uniform_temperatures",
]
