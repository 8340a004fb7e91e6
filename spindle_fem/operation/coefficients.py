"""Coefficients of a machine at an operating point: films, air gaps, joints, ball contacts, capacities.

Every model of a machine takes them from here. Functions get the definition, the
operating point and the few temperatures they need; they know no mesh. A film's
and a gap's coefficient is W/(m²·K), a joint's conductance too, that of a ball row W/K.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.definition.circuit_tables import Film
from spindle_fem.definition.machine_spec import (
    BearingSet,
    ConstantFilm,
    Gap,
    MachineSpec,
    NaturalFilm,
    StreamFilm,
)
from spindle_fem.definition.solid_tables import SetBearing
from spindle_fem.machine.geometry.joint_groups import group_of_contacts
from spindle_fem.operation.circuits import stream_answer, stream_warnings, wall_coefficients
from spindle_fem.operation.loads import BearingHeat
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.surroundings.air_gaps import AirGap
from spindle_fem.physics.surroundings.gap_laws import GAP_LAWS
from spindle_fem.physics.surroundings.rotating_surfaces import rotating_film
from spindle_fem.physics.surroundings.still_air import outside_coefficient
from spindle_fem.validity import CodedWarning

Array = NDArray[np.float64]

# K; a natural film's reference coefficient is taken where the wall is this much warmer than the air.
NATURAL_DIFFERENCE = 10.0
# K; step of the central difference for the slope of a natural film.
SLOPE_STEP = 1.0e-3


def fluid_temperature(film: Film, ambient: float) -> float:
    """Temperature of the fluid that a film joins its surface to, K."""
    return ambient if film.temperature == "ambient" else film.temperature


def film_coefficient(
    film: Film, point: OperatingPoint, wall: NDArray[np.float64], fluid: float
) -> tuple[NDArray[np.float64], tuple[CodedWarning, ...]]:
    """Coefficient of a film on each facet; those of streams are :func:`stream_coefficients`.

    Parameters
    ----------
    wall : (n_facets,) ndarray, [K]
    fluid : float, [K]

    Returns
    -------
    coefficient : (n_facets,) ndarray, [W/(m²·K)]
    """
    if isinstance(film, ConstantFilm):
        return np.full(wall.shape, film.coefficient.value), ()
    if isinstance(film, NaturalFilm):
        return _natural_coefficient(film, wall, fluid), ()
    rotating = rotating_film(film.correlation, point.speed, film.diameter, minimum=film.minimum)
    warnings = tuple(CodedWarning(said.code, f"{film.surface[0]}: {said.text}") for said in rotating.warnings)
    return np.full(wall.shape, film.factor.value * rotating.value), warnings


def stream_coefficients(
    film: StreamFilm, point: OperatingPoint
) -> tuple[dict[str, float], tuple[CodedWarning, ...]]:
    """Coefficient of a stream on each of its walls, W/(m²·K)."""
    answer = stream_answer(film, point.speed)
    values = wall_coefficients(film, answer)
    return dict(zip(film.surface, values.tolist(), strict=True)), stream_warnings(film, answer)


def _natural_coefficient(film: NaturalFilm, wall: Array, fluid: ArrayLike) -> Array:
    return film.factor.value * outside_coefficient(
        wall, fluid, film.characteristic_length, film.emissivity, orientation=film.orientation
    )


def natural_coefficient_and_slope(film: NaturalFilm, wall: Array, fluid: ArrayLike) -> tuple[Array, Array]:
    """Coefficient of a natural film and its slope to the wall's temperature [W/(m²·K²)].

    Correlations take no complex numbers, so the slope is a central difference.

    Parameters
    ----------
    wall : (..., k) ndarray, [K]
    fluid : float or (k,) array_like, [K]
    """
    walls = wall + np.array([0.0, SLOPE_STEP, -SLOPE_STEP]).reshape(-1, *(1,) * wall.ndim)
    value, above, below = _natural_coefficient(film, walls, fluid)
    return value, (above - below) / (2.0 * SLOPE_STEP)


def natural_reference(spec: MachineSpec, film: NaturalFilm) -> float:
    """Coefficient of a natural film 10 K above the defined surroundings: what a linear model takes."""
    point = OperatingPoint.of(spec)
    fluid = fluid_temperature(film, point.ambient_temperature)
    return float(film_coefficient(film, point, np.array([fluid + NATURAL_DIFFERENCE]), fluid)[0][0])


def gap_coefficient(
    gap: Gap, point: OperatingPoint, inner_radius: float, outer_radius: float
) -> tuple[float, tuple[CodedWarning, ...]]:
    """Coefficient of an air gap on its turning surface, W/(m²·K)."""
    given = AirGap(
        point.speed,
        inner_radius,
        outer_radius,
        gap.at_rest or 0.0,
        gap.rise,
        gap.reference_speed,
        gap.exponent,
    )
    found = GAP_LAWS[gap.kind](given)
    warnings: tuple[CodedWarning, ...] = ()
    if found.faults:
        warnings = (CodedWarning("gap_film_extrapolated", f"{gap.name}: {'; '.join(found.faults)}."),)
    return gap.factor.value * found.value, warnings


def joint_conductances(spec: MachineSpec, contacts: Iterable[str]) -> dict[str, float]:
    """Conductance of every contact, W/(m²·K); infinite where its joint is perfect.

    Raises
    ------
    FaultsError
        As :func:`~spindle_fem.machine.geometry.joint_groups.group_of_contacts`.
    """
    return {
        contact: np.inf if group.conductance == "perfect" else group.conductance.value
        for contact, group in group_of_contacts(spec, contacts).items()
    }


def ball_conductances(group: BearingSet, heat: BearingHeat | None = None) -> tuple[float, float]:
    """Conductance between a row of balls and its inner and its outer raceway, W/K.

    Parameters
    ----------
    heat : BearingHeat, optional
        What the contacts conduct at the state; without it, or where the heat
        model has no contacts, ``nan`` for a row that follows them.
    """
    row = group.ball_row
    if row.kind == "constant":
        return row.conductance.value, row.conductance.value
    return (np.nan, np.nan) if heat is None else (heat.conductance_inner, heat.conductance_outer)


def ball_row_capacity(spec: MachineSpec, group: BearingSet, bearing: SetBearing) -> float:
    """Heat capacity of the balls or rollers of one bearing of a set, J/K."""
    kind = spec.bearing_types[group.type_name(bearing)]
    capacity = group.ball_row.capacity
    if capacity is None:
        capacity = kind.element_volume * spec.materials[kind.element_material].volumetric_heat_capacity
    return capacity * spec.heat_capacity_factor.value


def material_capacities(spec: MachineSpec) -> dict[str, float]:
    """Volumetric heat capacity of every material with the machine's factor, J/(m³·K)."""
    factor = spec.heat_capacity_factor.value
    return {name: factor * item.volumetric_heat_capacity for name, item in spec.materials.items()}


def linear_coefficients(
    spec: MachineSpec,
    point: OperatingPoint,
    contacts: Iterable[str],
    gap_radii: Mapping[str, tuple[float, float]],
) -> dict[str, float]:
    """Every coefficient that a model linear in temperature has at an operating point, SI, by name.

    ``conductivity.<material>``, ``joint.<contact>``, ``film.<surface>`` (a
    natural film's is its reference), ``gap.<gap>`` and ``balls.<bearing>.<side>``
    (``nan`` where the row follows its contacts).

    Parameters
    ----------
    gap_radii : mapping of gap to (float, float), [m]
        Mean radius of the turning side and of what faces it.
    """
    values = {f"conductivity.{name}": item.thermal_conductivity for name, item in spec.materials.items()}
    values |= {f"joint.{name}": value for name, value in joint_conductances(spec, contacts).items()}
    for film in spec.film:
        if isinstance(film, StreamFilm):
            found, _ = stream_coefficients(film, point)
            values |= {f"film.{surface}": value for surface, value in found.items()}
            continue
        fluid = fluid_temperature(film, point.ambient_temperature)
        if isinstance(film, NaturalFilm):
            value = natural_reference(spec, film)
        else:
            value = float(film_coefficient(film, point, np.array([fluid]), fluid)[0][0])
        values |= {f"film.{surface}": value for surface in film.surface}
    for gap in spec.gap:
        values[f"gap.{gap.name}"] = gap_coefficient(gap, point, *gap_radii[gap.name])[0]
    for group, bearing in spec.bearings:
        for side, value in zip(("inner", "outer"), ball_conductances(group), strict=True):
            values[f"balls.{bearing.name}.{side}"] = value
    return values
