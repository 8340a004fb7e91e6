"""Coefficients of the air around the machine, from its definition and the state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import ConstantFilm, Film, Gap, NaturalFilm
from spindle_fem.errors import OutOfValidityError
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.surroundings.air_gaps import (
    gap_coefficient_becker_kaye,
    gap_coefficient_power_law,
    nusselt_becker_kaye,
    taylor_number,
)
from spindle_fem.physics.surroundings.rotating_surfaces import rotating_film
from spindle_fem.physics.surroundings.still_air import outside_coefficient
from spindle_fem.validity import CodedWarning

_SHAPES = {"horizontal_cylinder": "cylinder", "vertical_plate": "plate"}
_AIR_KINEMATIC_VISCOSITY = 1.55e-5


def film_coefficient(
    film: Film, point: OperatingPoint, wall: NDArray[np.float64], fluid: float
) -> tuple[NDArray[np.float64], tuple[CodedWarning, ...]]:
    """Coefficient of a film on each facet.

    Parameters
    ----------
    wall : (n_facets,) ndarray, [K]
    fluid : float, [K]

    Returns
    -------
    coefficient : (n_facets,) ndarray, [W/(m²·K)]
    warnings : tuple of CodedWarning
    """
    if isinstance(film, ConstantFilm):
        return np.full(wall.shape, film.coefficient.value), ()
    if isinstance(film, NaturalFilm):
        shape = _SHAPES[film.orientation]
        value = outside_coefficient(wall, fluid, film.characteristic_length, film.emissivity, shape=shape)
        return film.factor.value * value, ()
    rotating = rotating_film("becker", point.speed, film.diameter, minimum=film.minimum)
    return np.full(wall.shape, film.factor.value * rotating.value), rotating.warnings


def gap_coefficient(
    gap: Gap, point: OperatingPoint, inner_radius: float, outer_radius: float
) -> tuple[float, tuple[CodedWarning, ...]]:
    """Coefficient of an air gap on its turning surface, W/(m²·K)."""
    if gap.kind == "power_law":
        value = gap_coefficient_power_law(
            point.speed,
            at_rest=gap.at_rest,
            rise_at_reference=gap.rise,
            reference_speed=gap.reference_speed,
            exponent=gap.exponent,
        )
        return gap.factor.value * float(value), ()
    clearance = outer_radius - inner_radius
    taylor = taylor_number(point.speed, inner_radius, clearance, _AIR_KINEMATIC_VISCOSITY)
    value = gap_coefficient_becker_kaye(point.speed, inner_radius, clearance, extrapolate=True)
    return gap.factor.value * float(value), _becker_kaye_warnings(gap.name, float(taylor))


def _becker_kaye_warnings(name: str, taylor: float) -> tuple[CodedWarning, ...]:
    try:
        nusselt_becker_kaye(taylor)
    except OutOfValidityError as error:
        return (CodedWarning("gap_film_extrapolated", f"Gap {name}: {error.what}"),)
    return ()
