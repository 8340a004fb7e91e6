"""Convert a solved ball system to the records of each bearing: films, heat, warnings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import NoEquilibriumError
from spindle_fem.physics.bearings.ball_system import BallSystem, Contacts, ellipse_axes
from spindle_fem.physics.bearings.bearing_state import BallStates, BearingHeat, BearingState
from spindle_fem.physics.bearings.equilibrium import Equilibrium
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.heat_model import HeatInputs, HeatOptions, bearing_heat
from spindle_fem.physics.bearings.heat_models import HEAT_MODELS
from spindle_fem.physics.bearings.hertz import INNER, OUTER, STATIC_PRESSURE, maximum_pressure
from spindle_fem.physics.bearings.lubricant_film import (
    film_central_hamrock_dowson,
    film_fit_warnings,
    film_groups,
    film_minimum_hamrock_dowson,
    film_thickness_ratio,
    thermal_reduction,
)
from spindle_fem.physics.bearings.race_control import race_control_friction
from spindle_fem.physics.bearings.rough_surface import SurfaceRoughness
from spindle_fem.physics.bearings.traction import (
    ContactPatch,
    LubricantState,
    TractionIntegrals,
    TractionOptions,
    ball_drag,
    build_patch,
    integrate_traction,
)
from spindle_fem.validity import CodedWarning

FloatArray = NDArray[np.float64]
# Friction coefficient up to which Jones lets a raceway hold the gyroscopic moment
_GYROSCOPIC_FRICTION = 0.02
_ASPERITY_LIMIT = 0.05
_FULL_FILM = 3.0


def lubricant_state(
    lubricant: Lubricant, temperature: FloatArray, roughness: SurfaceRoughness | None
) -> LubricantState:
    """Lubricant of each ball row at its temperature (K)."""
    constant = np.full(len(temperature), 1.0)
    return LubricantState(
        lubricant.dynamic_viscosity(temperature),
        lubricant.viscosity_slope(temperature),
        lubricant.pressure_viscosity_coefficient(temperature),
        constant * lubricant.roelands_pressure_exponent,
        lubricant.limiting_shear_ratio_at(temperature),
        constant * lubricant.asperity_friction,
        constant * lubricant.film_starvation,
        constant * lubricant.thermal_conductivity,
        lubricant.path_fill * lubricant.oil_density(temperature) * constant,
        roughness,
    )


def require_seated(solved: Equilibrium, names: Sequence[str], shoulder: FloatArray, speed: float) -> None:
    """Refuse a state whose loaded balls climb a shoulder (rad, per row), or whose numbers are not finite."""
    loaded = solved.contacts.load[:, INNER] > 0.0
    beyond = loaded & (solved.contacts.cosine[:, INNER] <= 0.0)
    if beyond.any():
        name = names[int(np.argmax(beyond))]
        raise NoEquilibriumError(
            name, f"balls climb out of the inner groove at {speed * 30.0 / math.pi:.0f} rpm.",
            "Raise the axial load or lower the speed.",
        )  # fmt: skip
    angle = np.arctan2(solved.contacts.sine, solved.contacts.cosine)
    over = (solved.contacts.load > 0.0) & (angle > shoulder[:, None])
    if over.any():
        row = int(np.argmax(over.any(axis=1)))
        raise NoEquilibriumError(
            names[row], f"the contact climbs the shoulder at {math.degrees(float(shoulder[row])):.1f}° "
            f"({math.degrees(float(angle[row].max())):.1f}° at {speed * 30.0 / math.pi:.0f} rpm).",
            "Lower the axial load or the speed.",
        )  # fmt: skip
    if not np.isfinite(solved.contacts.load).all():
        raise NoEquilibriumError(" ".join(dict.fromkeys(names)), "the ball loads are not finite.")


@dataclass(frozen=True, slots=True, eq=False)
class SolvedBearings:
    """Bearings, the system of their balls, and its equilibrium.

    Attributes
    ----------
    rows : sequence of dict
        Arrays of each bearing's balls.
    speed : float, [rad/s]
    control : {"outer", "inner", "equilibrium"}
    shaft_columns : (n_bearings,) ndarray
        Where the displacements of each bearing's shaft begin.
    held : bool
        By a distance, so that balls can lose their load; springs and thrust keep it.
    """

    bearings: Sequence
    rows: Sequence[dict[str, FloatArray]]
    system: BallSystem
    equilibrium: Equilibrium
    speed: float
    control: str
    shaft_columns: NDArray[np.int64]
    held: bool


@dataclass(frozen=True, slots=True, eq=False)
class Lubrication:
    """Lubricant of the bearings, and what it is like in each.

    Attributes
    ----------
    film : LubricantState or None
        At every ball.
    temperatures : sequence of float, [K]
        Of each bearing's film.
    roughness : (raceway, ball), [m]
    """

    lubricant: Lubricant | None
    film: LubricantState | None
    temperatures: Sequence[float]
    roughness: tuple[float, float]


def build_states(
    solved_bearings: SolvedBearings, lubrication: Lubrication, options: TractionOptions, heat: HeatOptions
) -> tuple[BearingState, ...]:
    """Records of every bearing of a solved system, in order."""
    bearings, rows, system = solved_bearings.bearings, solved_bearings.rows, solved_bearings.system
    solved, speed, control = solved_bearings.equilibrium, solved_bearings.speed, solved_bearings.control
    lubricant, film = lubrication.lubricant, lubrication.film
    compliance = np.diagonal(np.linalg.pinv(solved.tangent))
    patch = traction = drag = None
    if film is not None and speed > 0.0:
        patch = build_patch(system, solved.contacts, film, options)
        speeds = np.full(system.number, speed)
        traction = integrate_traction(system, patch, film, options, speeds, solved.ball_speeds)
        drag = ball_drag(system, film, options, solved.ball_speeds[:, 0])
    axial_friction = _ring_friction(system, solved, traction, speed, control)
    major, minor, _ = ellipse_axes(system, solved.contacts.cosine, np.maximum(solved.contacts.load, 0.0))
    distance = system.groove_distances(solved.displacement)
    states, first = [], 0
    for index, (bearing, row) in enumerate(zip(bearings, rows, strict=True)):
        part = slice(first, first + len(row["weight"]))
        first = part.stop
        geometry = bearing.geometry
        contacts = _cut(solved.contacts, part)
        weight = system.weight[part]
        friction = axial_friction[part]
        ring_axial = contacts.load[:, INNER] * contacts.sine[:, INNER] + friction * contacts.cosine[:, INNER]
        ring_radial = contacts.load[:, INNER] * contacts.cosine[:, INNER] - friction * contacts.sine[:, INNER]
        axial_force = float(weight @ ring_axial)
        radial_force = 0.0
        if len(weight) > 1:
            pull = weight * ring_radial
            radial_force = float(np.hypot(pull @ np.cos(row["azimuth"]), pull @ np.sin(row["azimuth"])))
        balls = _ball_states(
            row["azimuth"], weight, contacts, (major[part], minor[part]),
            _cut(system, part), solved.ball_speeds[part],
        )  # fmt: skip
        bearing_heat_record: BearingHeat | None = None
        beside = dict.fromkeys(heat.beside, 0.0)
        temperature = float(lubrication.temperatures[index])
        cage = int(np.sum(weight[solved.carried[part]]))
        grooves = (distance[0][part], distance[1][part]) if solved_bearings.held else None
        warnings = _load_warnings(bearing.name, balls, contacts, grooves, control, speed, _cut(system, part))
        if cage:
            text = f"{bearing.name}: friction is too weak to drive {cage} balls; the cage carries them."
            warnings.append(CodedWarning("balls_carried_by_cage", text))
        if lubricant is not None and film is not None:
            warnings += lubricant.temperature_warnings(temperature, bearing.name)
            if patch is not None:
                local = HeatInputs(
                    geometry, _cut(system, part), _cut(patch, part), _cut(traction, part), _cut(film, part),
                    solved.ball_speeds[part, 0], drag[part], speed,
                    float(lubricant.kinematic_viscosity(temperature)), axial_force, radial_force,
                )  # fmt: skip
                bearing_heat_record = bearing_heat(local, heat)
                beside = {other.level: bearing_heat(local, other).total for other in heat.others()}
                balls, film_warnings = _with_films(bearing.name, balls, local, options, lubrication.roughness)
                warnings += film_warnings
                warnings += _heat_warnings(bearing.name, geometry, heat)
            else:
                bearing_heat_record = BearingHeat(heat.level, {}, {})
        total = bearing_heat_record.total if bearing_heat_record is not None else 0.0
        free = geometry.curvature_centre_distance * math.sin(geometry.contact_angle)
        radial_shift = 0.0
        if len(weight) > 1:
            own = slice(solved_bearings.shaft_columns[index], solved_bearings.shaft_columns[index] + 5)
            radial_shift = float(system.radial_map[part][0, own] @ solved.displacement[own])
        soft = float(compliance[solved_bearings.shaft_columns[index]])
        stiffness = 1.0 / soft if soft > 0.0 else 0.0
        states.append(
            BearingState(
                bearing.name, geometry, speed, float(np.mean(distance[0][part])) - free, radial_shift,
                axial_force, radial_force, math.nan, stiffness, balls, bearing_heat_record,
                total / speed if speed else 0.0, temperature, solved.residual, tuple(warnings), beside,
                (float(weight @ ring_radial), float(weight @ (ring_radial + balls.centrifugal_force))),
            )
        )  # fmt: skip
    return tuple(states)


def _ring_friction(
    system: BallSystem, solved: Equilibrium, traction: TractionIntegrals | None, speed: float, control: str
) -> FloatArray:
    """Friction force across the inner groove of every ball, N."""
    if speed == 0.0:
        return np.zeros(system.number)
    if control == "equilibrium" and traction is not None:
        return traction.force_across[:, INNER]
    moment = system.inertia * solved.ball_speeds[:, 0] * solved.ball_speeds[:, 3]
    side = INNER if control == "inner" else OUTER
    return race_control_friction(system, solved.contacts, moment, side)[0]


def _ball_states(
    azimuth: FloatArray,
    weight: FloatArray,
    contacts: Contacts,
    axes: tuple[FloatArray, FloatArray],
    system: BallSystem,
    ball_speeds: FloatArray,
) -> BallStates:
    orbital = ball_speeds[:, 0]
    empty = np.full(contacts.load.shape, np.nan)
    return BallStates(
        azimuth=azimuth,
        weight=weight,
        contact_angle=np.arctan2(contacts.sine, contacts.cosine),
        load=contacts.load,
        deformation=contacts.deformation,
        semi_major=axes[0],
        semi_minor=axes[1],
        pressure=maximum_pressure(contacts.load, *axes),
        centrifugal_force=0.5 * system.mass * system.pitch_diameter * orbital**2,
        gyroscopic_moment=system.inertia * orbital * np.hypot(ball_speeds[:, 3], ball_speeds[:, 2]),
        orbital_speed=orbital,
        spin_speed=np.linalg.norm(ball_speeds[:, 1:], axis=1),
        film_isothermal=empty,
        film_central=empty,
        film_minimum=empty,
        film_thickness_ratio=empty,
        contact_ratio=empty,
        entrainment_speed=empty,
    )


def _with_films(
    name: str, balls: BallStates, inputs: HeatInputs, options: TractionOptions, roughness: tuple[float, float]
) -> tuple[BallStates, list[CodedWarning]]:
    """Add films to the ball records; unloaded contacts have none (NaN)."""
    patch, lubricant, traction = inputs.patch, inputs.lubricant, inputs.traction
    loaded = patch.load > 0.0
    modulus = (2.0 / inputs.system.compliance)[:, None]
    groups = film_groups(
        lubricant.viscosity[:, None], traction.entrainment_speed, np.maximum(patch.load, 1e-12), modulus,
        patch.rolling_radius, lubricant.pressure_viscosity[:, None],
    )  # fmt: skip
    reduction = lubricant.film_starvation[:, None] * thermal_reduction(
        lubricant.viscosity_slope[:, None], traction.entrainment_speed,
        lubricant.thermal_conductivity[:, None],
        model=options.thermal_film, pressure=patch.pressure, reduced_modulus=modulus,
    )  # fmt: skip
    isothermal = film_central_hamrock_dowson(*groups, patch.ellipticity) * patch.rolling_radius
    minimum = film_minimum_hamrock_dowson(*groups, patch.ellipticity) * patch.rolling_radius * reduction
    keep = np.where(loaded, 1.0, np.nan)
    balls = replace(
        balls,
        film_isothermal=isothermal * keep,
        film_central=traction.film * keep,
        film_minimum=minimum * keep,
        film_thickness_ratio=film_thickness_ratio(minimum, *roughness) * keep,
        contact_ratio=traction.contact_ratio * keep,
        entrainment_speed=traction.entrainment_speed * keep,
    )
    warnings = list(
        film_fit_warnings(groups[0][loaded], groups[1] * np.ones(1), patch.ellipticity[loaded], name)
    ) if loaded.any() else []  # fmt: skip
    thinnest = float(np.nanmin(balls.film_thickness_ratio)) if loaded.any() else math.inf
    if thinnest < _FULL_FILM:
        text = f"{name}: lambda is {thinnest:.2f}; below 3 asperities touch."
        warnings.append(CodedWarning("film_not_separating", text))
    touching = float(np.nanmax(balls.contact_ratio)) if loaded.any() else 0.0
    if touching > _ASPERITY_LIMIT:
        text = f"{name}: asperities carry {touching:.2f} of the contact, beyond the 0.05 of the theory."
        warnings.append(CodedWarning("boundary_lubrication", text))
    return balls, warnings


def _load_warnings(
    name: str,
    balls: BallStates,
    contacts: Contacts,
    grooves: tuple[FloatArray, FloatArray] | None,
    control: str,
    speed: float,
    system: BallSystem,
) -> list[CodedWarning]:
    """What a bearing's loads call for; ``grooves`` are None where a force and not a distance holds them."""
    warnings = []
    free = ~(contacts.load[:, INNER] > 0.0)
    # the grooves are too far apart to hold a ball at rest; centrifugal force may still wedge it
    apart = grooves is not None and bool(
        np.all(np.hypot(*grooves) <= system.rest_length.sum(axis=1) * (1.0 + 1e-12))
    )
    if free.all() or apart:
        held = "no ball touches the inner raceway" if free.all() else "only centrifugal force seats its balls"
        warnings.append(CodedWarning("counter_bearing_unloaded", f"{name}: {held}; it carries no preload."))
    elif free.any():
        share = int(np.sum(balls.weight[free]))
        warnings.append(
            CodedWarning("balls_unloaded", f"{name}: {share} balls do not touch the inner raceway.")
        )
    highest = float(np.max(balls.pressure))
    if highest > STATIC_PRESSURE:
        text = f"{name}: contact pressure {highest * 1e-9:.2f} GPa, above the static limit of 4.2 GPa."
        warnings.append(CodedWarning("contact_pressure", text))
    if speed > 0.0 and control in ("outer", "inner") and not free.all():
        warnings += _control_doubts(name, balls, contacts, control, ~free, system)
    return warnings


def _control_doubts(
    name: str,
    balls: BallStates,
    contacts: Contacts,
    control: str,
    loaded: NDArray[np.bool_],
    system: BallSystem,
) -> list[CodedWarning]:
    """Whether raceway control can hold: spin moments (Harris) and the gyroscopic moment (Jones)."""
    spin_hold = balls.load * balls.semi_major
    difference = np.cos(balls.contact_angle[:, INNER] - balls.contact_angle[:, OUTER])
    held, other = (OUTER, INNER) if control == "outer" else (INNER, OUTER)
    slips = loaded & (spin_hold[:, held] * difference < spin_hold[:, other])
    demand = balls.gyroscopic_moment / system.ball_diameter
    capacity = _GYROSCOPIC_FRICTION * balls.load
    if control == "outer":
        gyrates = loaded & (2.0 * demand > capacity[:, OUTER])
    else:
        gyrates = loaded & (demand > capacity.min(axis=1))
    reasons = []
    if slips.any():
        reasons.append(f"the {'inner' if control == 'outer' else 'outer'} raceway resists spin more")
    if gyrates.any():
        reasons.append("the gyroscopic moment would need a friction coefficient above 0.02")
    if not reasons:
        return []
    return [
        CodedWarning("race_control_doubtful", f"{name}: {control} raceway control: {' and '.join(reasons)}.")
    ]


def _heat_warnings(name: str, geometry, heat: HeatOptions) -> list[CodedWarning]:
    warnings = []
    model = HEAT_MODELS[heat.level]
    if model.counts_cage and geometry.cage is None and geometry.seal_moment is None:
        text = f"{name}: cage and seal friction count 0; give cage and seal_moment of its bearing type."
        warnings.append(CodedWarning("cage_seal_not_given", text))
    if model.needs_boundary and None in (geometry.bore_diameter, geometry.outer_diameter):
        text = f"{name}: bore or outer diameter assumed 1.75 ball diameters from the pitch circle."
        warnings.append(CodedWarning("boundary_dimensions_assumed", text))
    return warnings


def _cut(record, part: slice):
    """Record with some rows only; fields that are not arrays are kept."""
    names = type(record).__slots__
    return type(record)(
        *(value[part] if isinstance(value := getattr(record, name), np.ndarray) else value for name in names)
    )


__all__ = [
    "ContactPatch",
    "Lubrication",
    "SolvedBearings",
    "build_states",
    "lubricant_state",
    "require_seated",
]
