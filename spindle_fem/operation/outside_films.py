"""Coefficients of the air around the machine, from its definition and the state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import ConstantFilm, Film, Gap, NaturalFilm
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.surroundings.air_gaps import AirGap
from spindle_fem.physics.surroundings.gap_laws import GAP_LAWS
from spindle_fem.physics.surroundings.rotating_surfaces import rotating_film
from spindle_fem.physics.surroundings.still_air import outside_coefficient
from spindle_fem.validity import CodedWarning


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
        value = outside_coefficient(
            wall, fluid, film.characteristic_length, film.emissivity, orientation=film.orientation
        )
        return film.factor.value * value, ()
    rotating = rotating_film(film.correlation, point.speed, film.diameter, minimum=film.minimum)
    return np.full(wall.shape, film.factor.value * rotating.value), rotating.warnings


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
        warnings = (CodedWarning("gap_film_extrapolated", f"Gap {gap.name}: {'; '.join(found.faults)}."),)
    return gap.factor.value * found.value, warnings
