"""Bearings of a machine over speed and thrust: loads, angles, films and heat term by term."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import NoEquilibriumError, SpecError
from spindle_fem.model.elastic.machine_bodies import machine_bodies
from spindle_fem.model.elastic.ring_seats import RingSeats
from spindle_fem.operation.bearing_heat import BearingMechanics, BearingTemperatures, grows
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.bearings.bearing_state import BearingState
from spindle_fem.physics.bearings.heat_model import HeatOptions, friction_model_names
from spindle_fem.physics.bearings.heat_models import HEAT_MODELS
from spindle_fem.physics.bearings.highest_speed import too_fast
from spindle_fem.physics.bearings.roller_set import RollerSet
from spindle_fem.physics.bearings.seat_contact import SeatBodies
from spindle_fem.units import ZERO_CELSIUS_K
from spindle_fem.validity import CodedWarning, fold_warnings

HEAT_SCHEMA = "spindle-fem/heat/1"
RPM = np.pi / 30.0
STEPS_TO_OPERATION, STEPS = 6, 9
THRUST_STEPS = 11


def heat_study(
    spec: MachineSpec,
    speeds: Sequence[float] = (),
    temperature: float = 313.15,
    *,
    coupled: bool = False,
    temperatures: Mapping[str, BearingTemperatures] | None = None,
    seats: Mapping[str, SeatBodies] | None = None,
) -> dict[str, Any]:
    """Speed sweep of every bearing, beside every heat model, and a thrust sweep.

    Parameters
    ----------
    speeds : sequence of float, [rad/s]
        Nine up to one and a half times the machine's operating speed when empty.
    temperature : float, [K]
        Of rings, balls and grease; the uncoupled sweep has one for all.
    coupled : bool
        Solve the machine at every speed (on its mesh) and take the
        temperatures from there.
    temperatures : mapping of bearing to BearingTemperatures, optional
        Of a solved machine, kept for every speed; the isothermal films keep
        ``temperature``.
    seats : mapping of bearing set to SeatBodies, optional
        Elastic bodies under its rings where they are known; solved for here otherwise.

    Bearings grow with temperatures that were solved for, where the machine follows its preload; at one for
    all they keep the size of assembly.

    Returns
    -------
    dict
        ``bearings`` (rows over speed), ``models`` (heat by every model at each
        speed), ``thrust`` (rows over thrust at the definition's speed) and
        ``warnings``, ready for JSON.

    Raises
    ------
    SpecError
        The machine has no bearings or no lubricant.
    """
    if not spec.bearing_set:
        raise SpecError(spec.name, "has no [[bearing_set]].", "There is no bearing heat to study.")
    if not spec.knows_lubricants:
        raise SpecError(f"{spec.name}: grease", "is missing.", "Films and friction need it, or lubrication.")
    chosen = tuple(speeds) or usual_speeds(spec)
    point = OperatingPoint.of(spec)
    expand = spec.follows_preload and (coupled or temperatures is not None)
    if seats is None and expand and grows(spec):
        seats = RingSeats(spec, machine_bodies(spec)).of_sets(spec)
    mechanics = BearingMechanics(spec, seats)
    factors = {bearing.name: group.heat_factor.value for group, bearing in spec.bearings}
    own = _with_alike(mechanics, mechanics.options.level)
    names = [bearing.name for _, bearing in spec.bearings]
    uniform = {name: BearingTemperatures(*(temperature,) * 5) for name in names}
    by_speed = _solved_temperatures(spec, chosen) if coupled else {}
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
    models: list[dict[str, Any]] = []
    warnings: list[CodedWarning] = []
    for speed in chosen:
        at_speed = replace(point, speed=speed)
        here = by_speed.get(speed, temperatures or uniform)
        try:
            states = mechanics.states(at_speed, here, expand=expand, options=own)
            isothermal = mechanics.states(at_speed, uniform, expand=False)
        except NoEquilibriumError as error:
            warnings.append(CodedWarning("no_equilibrium", f"{speed / RPM:.0f} rpm: {error}"))
            continue
        for name in names:
            state = _scaled(states[name], factors[name])
            rows[name].append(_row(state, speed, here[name], isothermal[name]))
            warnings += state.warnings
        models.append(_by_model(mechanics, at_speed, here, states, expand))
    return {
        "schema": HEAT_SCHEMA,
        "machine": spec.name,
        "model": spec.heat.model,
        "temperature_degC": None if coupled or temperatures else temperature - ZERO_CELSIUS_K,
        "bearings": rows,
        "models": models,
        "thrust": _thrust_sweep(spec, mechanics, point, dict(temperatures or uniform)),
        "warnings": [
            {"code": item.code, "text": item.text} for item in fold_warnings(warnings, tuple(names))
        ],
    }


def usual_speeds(spec: MachineSpec) -> tuple[float, ...]:
    """Nine speeds over the machine's range, its ends included but rest, rad/s.

    Without a range in steps of a sixth of the operating speed (of 3000 rpm where it is 0). Speeds between
    have two digits in rpm; those that no bearing of the machine reaches are left out.
    """
    if spec.operation.speed_range is not None:
        low, high = spec.operation.speed_range
        even = np.linspace(low, high, STEPS if low else STEPS + 1)[1:-1]
        between = [float(f"{speed / RPM:.2g}") * RPM for speed in even.tolist()]
        return tuple(sorted({*between, high} | ({low} if low else set())))
    step = float(f"{(spec.operation.speed / RPM or 3000.0) / STEPS_TO_OPERATION:.2g}")
    speeds = (step * number * RPM for number in range(1, STEPS + 1))
    return tuple(speed for speed in speeds if too_fast(spec, speed) is None)


def _solved_temperatures(
    spec: MachineSpec, speeds: Sequence[float]
) -> dict[float, dict[str, BearingTemperatures]]:
    from spindle_fem.solvers.coupled_steady import solve_coupled
    from spindle_fem.solvers.prepared_machine import prepare_machine

    machine = prepare_machine(spec)
    point = OperatingPoint.of(spec)
    found = {}
    start = None
    for speed in speeds:
        coupled = solve_coupled(machine, replace(point, speed=speed), start)
        start = coupled.solution.temperature
        lumped = dict(
            zip(
                coupled.solution.problem.lumped_names,
                coupled.solution.lumped_temperature.tolist(),
                strict=True,
            )
        )
        found[speed] = machine.builder.bearing_temperatures(machine.field_state(start, lumped))
    return found


def _scaled(state: BearingState, factor: float) -> BearingState:
    """A state with a factor on its friction."""
    terms = {term: factor * value for term, value in state.heat.terms.items()}
    return replace(
        state, heat=replace(state.heat, terms=terms), friction_moment=factor * state.friction_moment
    )


def _row(
    state: BearingState, speed: float, temperatures: BearingTemperatures, isothermal: BearingState
) -> dict[str, Any]:
    balls = state.balls
    first = {
        name: float(getattr(balls, name)[0]) for name in ("centrifugal_force", "orbital_speed", "spin_speed")
    }
    contact = {
        side: {
            "contact_angle_deg": float(np.degrees(balls.contact_angle[0, index])),
            "load_N": float(balls.load[0, index]),
            "deformation_um": 1e6 * float(balls.deformation[0, index]),
            "pressure_GPa": 1e-9 * float(balls.pressure[0, index]),
            "semi_major_mm": 1e3 * float(balls.semi_major[0, index]),
            "semi_minor_mm": 1e3 * float(balls.semi_minor[0, index]),
            "film_um": 1e6 * float(balls.film_central[0, index]),
            "film_isothermal_um": 1e6 * float(isothermal.balls.film_isothermal[0, index]),
            "lambda": float(balls.film_thickness_ratio[0, index]),
        }
        for index, side in enumerate(("inner", "outer"))
    }
    return {
        "speed_rpm": speed / RPM,
        "heat_W": state.heat.total,
        "terms_W": dict(state.heat.terms),
        "friction_moment_Nmm": 1e3 * state.friction_moment,
        "axial_load_N": state.axial_force,
        "axial_displacement_um": 1e6 * state.axial_displacement,
        "preload_N": state.preload if np.isfinite(state.preload) else None,
        "contact_angle_inner_deg": contact["inner"]["contact_angle_deg"],
        "contact_angle_outer_deg": contact["outer"]["contact_angle_deg"],
        "film_um": 1e6 * state.thinnest_film,
        "lambda": state.smallest_film_ratio,
        "centrifugal_force_N": first["centrifugal_force"],
        "gyroscopic_moment_Nmm": 1e3 * float(balls.gyroscopic_moment[0]),
        "orbital_speed_rad_s": first["orbital_speed"],
        "spin_speed_rad_s": first["spin_speed"],
        "temperature_inner_degC": temperatures.inner - ZERO_CELSIUS_K,
        "temperature_outer_degC": temperatures.outer - ZERO_CELSIUS_K,
        "temperature_ball_degC": temperatures.ball - ZERO_CELSIUS_K,
        "contacts": contact,
    }


def _levels(mechanics: BearingMechanics) -> tuple[str, ...]:
    """Heat models that know every bearing of a machine."""
    rollers = any(isinstance(mounted, RollerSet) for mounted in mechanics.sets.values())
    return friction_model_names(rollers=rollers)


def _with_alike(mechanics: BearingMechanics, level: str) -> HeatOptions:
    """Options of a heat model, beside it those of which the balls turn as with it."""
    attitude = HEAT_MODELS[level].ball_attitude
    alike = [name for name in _levels(mechanics) if HEAT_MODELS[name].ball_attitude == attitude]
    return replace(mechanics.options, level=level, beside=tuple(name for name in alike if name != level))


def _by_model(
    mechanics: BearingMechanics,
    point: OperatingPoint,
    temperatures: Mapping[str, BearingTemperatures],
    states: Mapping[str, BearingState],
    expand: bool,
) -> dict[str, Any]:
    """Heat of every bearing by every model, side by side, with the factor of the machine on it.

    ``states`` are those with the options of :func:`_with_alike`.
    """
    factors = {bearing.name: group.heat_factor.value for group, bearing in mechanics.spec.bearings}
    found = _heats(states, factors)
    levels = _levels(mechanics)
    for level in levels:
        if level not in found:
            options = _with_alike(mechanics, level)
            others = mechanics.states(point, temperatures, expand=expand, options=options)
            found |= _heats(others, factors)
    return {"speed_rpm": point.speed / RPM, "heat_W": {level: found[level] for level in levels}}


def _heats(states: Mapping[str, BearingState], factors: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Heat of states by model and bearing, W."""
    found: dict[str, dict[str, float]] = {}
    for name, state in states.items():
        for level, heat in {state.heat.model: state.heat.total, **state.heat_beside}.items():
            found.setdefault(level, {})[name] = factors[name] * heat
    return found


def _thrust_sweep(
    spec: MachineSpec,
    mechanics: BearingMechanics,
    point: OperatingPoint,
    temperatures: dict[str, BearingTemperatures],
) -> list[dict[str, Any]]:
    """Axial load and displacement of the set that carries the thrust, up to twice the operating thrust.

    Without a thrust, up to twice the largest preload; no rows where there is none either.
    """
    largest = point.thrust or max((group.preload for group in spec.bearing_set), default=0.0)
    if not largest:
        return []
    thrusts = np.linspace(0.0, 2.0 * largest, THRUST_STEPS).tolist()
    rows = [{"thrust_N": thrust, "bearings": {}} for thrust in thrusts]
    for group in spec.bearing_set:
        if group.carries_thrust:
            found = mechanics.states_over_thrust(group, point, thrusts, temperatures)
            for row, states in zip(rows, found, strict=True):
                row["bearings"] |= {
                    state.name: {
                        "axial_load_N": state.axial_force,
                        "axial_displacement_um": 1e6 * state.axial_displacement,
                    }
                    for state in states
                }
    return rows
