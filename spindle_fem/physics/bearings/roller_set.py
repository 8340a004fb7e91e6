"""Roller bearings that share a radial load: rollers, films, friction at several temperatures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError
from spindle_fem.physics.bearings.bearing_state import BallStates, BearingHeat, BearingState
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.heat_model import HeatOptions, RollerHeatInputs, roller_heat
from spindle_fem.physics.bearings.hertz import INNER
from spindle_fem.physics.bearings.line_contact import (
    film_central_dowson_toyoda,
    film_minimum_dowson_higginson,
)
from spindle_fem.physics.bearings.lubricant_film import (
    film_groups,
    film_thickness_ratio,
    thermal_reduction,
)
from spindle_fem.physics.bearings.mounting import (
    BearingTemperatures,
    ExternalLoad,
    SetTemperatures,
    disc_growth,
)
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry, RollerStates, solve_roller_bearing
from spindle_fem.validity import CodedWarning

FloatArray = NDArray[np.float64]
# ISO 76: of rollers, where 0.0001 of their diameter stays as dent.
ROLLER_STATIC_PRESSURE = 4.0e9
_FULL_FILM = 3.0
# Clearances are rounded to picometres, so that temperatures that differ by round-off share a solution.
_CLEARANCE_DIGITS = 12


@dataclass(frozen=True, slots=True)
class RollerSet:
    """Roller bearings of one type that share their radial load equally and carry none along the axis.

    Attributes
    ----------
    names : tuple of str
    geometry : RollerGeometry
        Its clearance is that as mounted, at rest and at the temperature of assembly.
    shaft_bore_diameter : float or None, [m]
        Of a hollow shaft; with it the inner ring grows by rotation. None: no growth.
    raceway_roughness, roller_roughness : float, [m]
        Rq.
    """

    names: tuple[str, ...]
    geometry: RollerGeometry
    shaft_bore_diameter: float | None = None
    raceway_roughness: float = 0.05e-6
    roller_roughness: float = 0.05e-6

    def at(self, speed: float, temperatures: BearingTemperatures, assembly: float) -> RollerGeometry:
        """The rollers between rings as warm and as fast as they are; rings grow freely."""
        rises = (
            kelvin - assembly
            for kelvin in (temperatures.inner_ring, temperatures.outer_ring, temperatures.ball)
        )
        inside = 0.5 * self.geometry.raceway_diameters[0]
        spun = 0.0
        if self.shaft_bore_diameter is not None:
            spun = disc_growth(self.geometry, speed, inside, 0.5 * self.shaft_bore_diameter)
        clearance = self.geometry.clearance_at(*rises) - 2.0 * spun
        return replace(self.geometry, radial_clearance=round(clearance, _CLEARANCE_DIGITS))


def solve_roller_set(
    rollers: RollerSet,
    speed: float,
    load: ExternalLoad,
    temperatures: Sequence[SetTemperatures],
    *,
    lubricant: Lubricant | None = None,
    heat: HeatOptions | None = None,
) -> tuple[tuple[BearingState, ...], ...]:
    """States of roller bearings at several temperatures, as ``solve_states`` gives those of balls.

    Parameters
    ----------
    speed : float, [rad/s]
    load : ExternalLoad
        Radial only, of the whole set.

    Raises
    ------
    SpecError
        A thrust or a moment.
    OutOfValidityError
        A lubricant temperature outside the viscosity fit, or a heat model that knows no rollers.
    """
    if load.thrust or load.moment:
        what = f"thrust {load.thrust:g} N and moment {load.moment:g} N m reach cylindrical rollers."
        raise SpecError(" ".join(rollers.names), what, "Let other bearings carry them.")
    options = heat or HeatOptions()
    share = abs(load.radial) / len(rollers.names)
    found = []
    for entry in temperatures:
        states = []
        for name, around in zip(rollers.names, entry.bearings, strict=True):
            geometry = rollers.at(abs(speed), around, entry.assembly)
            solved = solve_roller_bearing(geometry, share, abs(speed))
            state = _dry_state(name, geometry, solved, abs(speed), share, around.film)
            if lubricant is not None:
                state = _lubricated(rollers, state, solved, lubricant, options)
            states.append(state)
        found.append(tuple(states))
    return tuple(found)


def _dry_state(
    name: str, geometry: RollerGeometry, solved: RollerStates, speed: float, radial: float, film: float
) -> BearingState:
    """State without lubricant; rollers take the place of balls, half as long as the major axis."""
    shape = solved.load.shape
    number, empty = shape[0], np.full(shape, np.nan)
    balls = BallStates(
        azimuth=solved.azimuth,
        weight=np.ones(number),
        contact_angle=np.zeros(shape),
        load=solved.load,
        deformation=solved.approach,
        semi_major=np.where(solved.load > 0.0, 0.5 * geometry.roller_length, 0.0),
        semi_minor=solved.half_width,
        pressure=solved.pressure,
        centrifugal_force=np.full(number, solved.centrifugal_force),
        gyroscopic_moment=np.zeros(number),
        orbital_speed=np.full(number, geometry.orbital_speed(speed)),
        spin_speed=np.full(number, geometry.spin_speed(speed)),
        film_isothermal=empty,
        film_central=empty,
        film_minimum=empty,
        film_thickness_ratio=empty,
        contact_ratio=empty,
        entrainment_speed=np.full(shape, geometry.entrainment_speed(speed)),
    )
    warnings = []
    if not (solved.load[:, INNER] > 0.0).any():
        text = f"{name}: no roller carries load; what slip and the cage's friction do is not counted."
        warnings.append(CodedWarning("rollers_unloaded", text))
    highest = float(solved.pressure.max())
    if highest > ROLLER_STATIC_PRESSURE:
        text = f"{name}: contact pressure {highest * 1e-9:.2f} GPa, above the static limit of 4 GPa."
        warnings.append(CodedWarning("contact_pressure", text))
    return BearingState(
        name, geometry, speed, 0.0, solved.radial_displacement, 0.0, radial, math.nan, math.nan, balls,
        None, 0.0, film, 0.0, tuple(warnings),
    )  # fmt: skip


def _lubricated(
    rollers: RollerSet,
    state: BearingState,
    solved: RollerStates,
    lubricant: Lubricant,
    options: HeatOptions,
) -> BearingState:
    """A state with films and friction heat."""
    kelvin, speed = state.lubricant_temperature, state.speed
    warnings = [*state.warnings, *lubricant.temperature_warnings(kelvin, state.name)]
    if not speed > 0.0:
        return replace(
            state,
            heat=BearingHeat(options.level, {}, {}),
            warnings=tuple(warnings),
            heat_beside=dict.fromkeys(options.beside, 0.0),
        )
    viscosity = float(lubricant.kinematic_viscosity(kelvin))
    given = RollerHeatInputs(state.geometry, solved, speed, viscosity)
    heat = roller_heat(given, options)
    balls = _with_films(rollers, state, lubricant)
    thinnest = np.nanmin(balls.film_thickness_ratio, initial=math.inf)
    if thinnest < _FULL_FILM:
        text = f"{state.name}: lambda is {thinnest:.2f}; below 3 asperities touch."
        warnings.append(CodedWarning("film_not_separating", text))
    return replace(
        state,
        balls=balls,
        heat=heat,
        friction_moment=heat.total / speed,
        warnings=tuple(warnings),
        heat_beside={other.level: roller_heat(given, other).total for other in options.others()},
    )


def _with_films(rollers: RollerSet, state: BearingState, lubricant: Lubricant) -> BallStates:
    """Roller records with their films; contacts without load have none (NaN)."""
    geometry, balls, kelvin = state.geometry, state.balls, np.array([state.lubricant_temperature])
    radius, modulus = geometry.contact_radius, 2.0 / geometry.compliance
    speed = balls.entrainment_speed
    loaded = balls.load > 0.0
    load = np.where(loaded, balls.load, np.nan)
    speed_group, material_group, _ = film_groups(
        lubricant.dynamic_viscosity(kelvin), speed, load, modulus, radius,
        lubricant.pressure_viscosity_coefficient(kelvin),
    )  # fmt: skip
    load_group = load / (modulus * radius * geometry.roller_length)
    reduction = lubricant.film_starvation * thermal_reduction(
        lubricant.viscosity_slope(kelvin), speed, lubricant.thermal_conductivity
    )
    isothermal = film_central_dowson_toyoda(speed_group, material_group, load_group) * radius
    minimum = film_minimum_dowson_higginson(speed_group, material_group, load_group) * radius * reduction
    return replace(
        balls,
        film_isothermal=isothermal,
        film_central=isothermal * reduction,
        film_minimum=minimum,
        film_thickness_ratio=film_thickness_ratio(
            minimum, rollers.raceway_roughness, rollers.roller_roughness
        ),
    )
