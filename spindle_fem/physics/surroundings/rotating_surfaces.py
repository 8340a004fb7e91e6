"""Films of rotating surfaces in still air."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.correlation import Array, Correlation, Range
from spindle_fem.physics.surroundings.rotating_films import ROTATING_FILMS
from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, CodedWarning, range_fault, require_range

_HOW_TO_FIX = "Use another rotating-surface model, or extrapolate=True and say so."


def rotational_reynolds(
    angular_speed: ArrayLike, diameter: float, kinematic_viscosity: float
) -> NDArray[np.float64]:
    """Reynolds number of a rotating cylinder, surface speed times diameter over viscosity.

    Parameters
    ----------
    angular_speed : (n,) array_like, [rad/s]
        Either sense of rotation.
    diameter : float, [m]
    kinematic_viscosity : float, [m²/s]

    Returns
    -------
    (n,) ndarray, [-]
        ω D²/(2 ν).

    Raises
    ------
    OutOfValidityError
        Diameter or viscosity not positive.

    >>> float(rotational_reynolds(100.0, 0.1, 1.55e-5).round(0))
    32258.0
    """
    require_range(
        "rotational_reynolds",
        diameter=(diameter, *POSITIVE),
        kinematic_viscosity=(kinematic_viscosity, *POSITIVE),
        angular_speed=(angular_speed, -POSITIVE[1], POSITIVE[1]),
        how_to_fix="Give SI values, speed in rad/s.",
    )
    return np.abs(np.asarray(angular_speed, float)) * diameter**2 / (2.0 * kinematic_viscosity)


class RotatingCorrelation(Correlation):
    """A Nusselt number of a Reynolds and a Prandtl number of a rotating surface.

    Attributes
    ----------
    on_radius : bool
        Whether both are on the radius, ω R²/ν, not on the diameter, ω D²/(2 ν).
    """

    def __init__(self, function: Callable[..., Array], reynolds: Range, on_radius: bool) -> None:
        super().__init__(function, {"reynolds": reynolds}, _HOW_TO_FIX)
        self.on_radius = on_radius


def rotating_correlation(
    lowest_reynolds: float, highest_reynolds: float, *, on_radius: bool = False
) -> Callable[[Callable[..., Array]], RotatingCorrelation]:
    """Make a Nusselt number of (reynolds, prandtl) the film of a rotating surface within a range."""
    return lambda function: RotatingCorrelation(function, (lowest_reynolds, highest_reynolds), on_radius)


@dataclass(frozen=True, slots=True)
class RotatingFilm:
    """Heat transfer coefficient of a rotating surface.

    Attributes
    ----------
    value : float or (n,) ndarray, [W/(m²·K)]
    reynolds : float or (n,) ndarray, [-]
    in_range : bool or (n,) ndarray of bool
        Whether the source covers the state; at the minimum it always does.
    """

    value: Any
    reynolds: Any
    in_range: Any
    warnings: tuple[CodedWarning, ...]


def rotating_film(
    model: str,
    angular_speed: ArrayLike,
    diameter: float,
    *,
    kinematic_viscosity: float = 1.55e-5,
    thermal_conductivity: float = 0.026,
    prandtl: float = 0.71,
    minimum: float = 0.0,
) -> RotatingFilm:
    """Heat transfer coefficient of a rotating surface against speed.

    With ``"becker"``, the default air and ``minimum = 10`` it is the shaft-end
    film max(10, 0.133 Re^(2/3) 0.71^(1/3) 0.026/D), Re = ω D²/(2·1.55e-5).

    Parameters
    ----------
    model : str
        One of ``ROTATING_FILMS``.
    angular_speed : (n,) array_like or float, [rad/s]
    diameter : float, [m]
    kinematic_viscosity : float, [m²/s]
        Air at about 25 °C by default, like the next two.
    thermal_conductivity : float, [W/(m·K)]
    prandtl : float, [-]
    minimum : float, [W/(m²·K)]
        Natural convection and radiation at rest.

    Returns
    -------
    RotatingFilm
        Outside the source's range it is computed all the same, ``in_range`` is
        false and a warning says so.

    Raises
    ------
    OutOfValidityError
        Unknown model, value that is not physical.

    >>> film = rotating_film("becker", 3000 * 2 * np.pi / 60, 0.11, minimum=10.0)
    >>> round(film.value, 2), film.in_range
    (69.22, False)
    >>> rotating_film("becker", 0.0, 0.11, minimum=10.0).value
    10.0
    """
    correlation = ROTATING_FILMS[model]
    require_range("rotating film", minimum=(minimum, *NOT_NEGATIVE), how_to_fix="Give it in W/(m²·K).")
    reynolds = rotational_reynolds(angular_speed, diameter, kinematic_viscosity)
    length = diameter
    if correlation.on_radius:
        # ω R²/ν is half of ω D²/(2 ν).
        reynolds, length = reynolds / 2.0, diameter / 2.0
    number = correlation(reynolds, prandtl, extrapolate=True)
    computed = number * thermal_conductivity / length
    value = np.maximum(computed, minimum)
    lowest, highest = correlation.ranges["reynolds"]
    in_range = ((reynolds >= lowest) & (reynolds <= highest)) | (computed < minimum)
    warnings: tuple[CodedWarning, ...] = ()
    if not in_range.all():
        fault = range_fault("rotational Reynolds number", reynolds[~in_range], lowest, highest)
        text = f'Rotating-surface film "{model}" is extrapolated: {fault}.'
        warnings = (CodedWarning("rotating_film_extrapolated", text),)
    if np.ndim(value):
        return RotatingFilm(value, reynolds, in_range, warnings)
    return RotatingFilm(float(value), float(reynolds), bool(in_range), warnings)
