"""Films of rotating surfaces in still air."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.errors import OutOfValidityError, did_you_mean
from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, CodedWarning, range_fault, require_range

ROTATING_MODELS = ("becker", "dropkin_carmi", "mixed", "disc")

RANGES: dict[str, tuple[float, float]] = {
    "becker": (800.0, 1.0e5),
    "dropkin_carmi": (8.0e3, 4.3e5),
    "mixed": (0.0, 1.5e4),
    "disc": (0.0, 5.0e6),
}

_DISC_TRANSITION = 2.4e5
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


def nusselt_becker(
    reynolds: ArrayLike, prandtl: ArrayLike = 0.71, *, extrapolate: bool = False
) -> NDArray[np.float64]:
    """Nusselt number of a horizontal cylinder that rotates in still fluid.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        ω D²/(2 ν).
    prandtl : (n,) array_like, [-]
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]
        On the diameter.

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: 800 <= Re <= 1e5.

    Source: Becker (1963), Int. J. Heat Mass Transfer 6, 1053–1062.

    >>> float(nusselt_becker(1.0e4, 0.71).round(2))
    55.07
    """
    re, pr = np.broadcast_arrays(np.asarray(reynolds, float), np.asarray(prandtl, float))
    if not extrapolate:
        require_range("nusselt_becker", reynolds=(re, *RANGES["becker"]), how_to_fix=_HOW_TO_FIX)
    return 0.133 * np.cbrt(re) ** 2 * np.cbrt(pr)


def nusselt_dropkin_carmi(reynolds: ArrayLike, *, extrapolate: bool = False) -> NDArray[np.float64]:
    """Nusselt number of a horizontal cylinder that rotates fast in still air.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        ω D²/(2 ν).
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]
        On the diameter.

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: 8000 <= Re <= 4.3e5, air; natural convection plays no part above 15 000.

    Source: Dropkin & Carmi (1957), Trans. ASME 79, 741–749.

    >>> float(nusselt_dropkin_carmi(1.0e5).round(1))
    230.8
    """
    re = np.asarray(reynolds, float)
    if not extrapolate:
        require_range(
            "nusselt_dropkin_carmi", reynolds=(re, *RANGES["dropkin_carmi"]), how_to_fix=_HOW_TO_FIX
        )
    return 0.073 * re**0.7


def nusselt_rotating_mixed(
    reynolds: ArrayLike, grashof: ArrayLike, prandtl: ArrayLike = 0.71, *, extrapolate: bool = False
) -> NDArray[np.float64]:
    """Nusselt number of a rotating cylinder where buoyancy and rotation both matter.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        ω D²/(2 ν).
    grashof : (n,) array_like, [-]
        On the diameter.
    prandtl : (n,) array_like, [-]
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]
        On the diameter.

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: Re <= 1.5e4, air.

    Source: Etemad (1955), Trans. ASME 77, 1283–1289; Kays & Bjorklund (1958),
    Trans. ASME 80, 70–78: 0.11 [(0.5 Re² + Gr) Pr]^0.35.

    >>> float(nusselt_rotating_mixed(5.0e3, 1.0e7).round(1))
    36.5
    """
    re, gr, pr = np.broadcast_arrays(
        np.asarray(reynolds, float), np.asarray(grashof, float), np.asarray(prandtl, float)
    )
    if not extrapolate:
        require_range(
            "nusselt_rotating_mixed",
            reynolds=(re, *RANGES["mixed"]),
            grashof=(gr, *NOT_NEGATIVE),
            how_to_fix=_HOW_TO_FIX,
        )
    return 0.11 * ((0.5 * re**2 + gr) * pr) ** 0.35


def nusselt_rotating_disc(reynolds: ArrayLike, *, extrapolate: bool = False) -> NDArray[np.float64]:
    """Mean Nusselt number of a disc that rotates in still air.

    Laminar inside the radius where ω r²/ν = 2.4e5, turbulent outside it; the
    mean over the area has no jump and tends to 0.015 Re^0.8.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        ω R²/ν with the outer radius.
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]
        On the outer radius.

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: Re <= 5e6, air, isothermal disc.

    Source: Cobb & Saunders (1956), Proc. R. Soc. A 236, 343–351; Dorfman (1963):
    local 0.36 Re_r^0.5 laminar, mean 0.015 Re^0.8 of an all-turbulent disc.

    >>> nusselt_rotating_disc([1.0e5, 2.4e5, 4.0e6]).round(1).tolist()
    [113.8, 176.4, 2838.2]
    """
    re = np.asarray(reynolds, float)
    if not extrapolate:
        require_range("nusselt_rotating_disc", reynolds=(re, *RANGES["disc"]), how_to_fix=_HOW_TO_FIX)
    # Share of the area that is laminar: (r_c/R)².
    core = np.minimum(_DISC_TRANSITION / np.maximum(re, _DISC_TRANSITION), 1.0)
    return 0.36 * np.sqrt(re) * core + 0.015 * re**0.8 * (1.0 - core**1.3)


@dataclass(frozen=True, slots=True)
class RotatingFilm:
    """Heat transfer coefficient of a rotating surface.

    Attributes
    ----------
    value : float or (n,) ndarray, [W/(m²·K)]
    reynolds : float or (n,) ndarray, [-]
    in_range : bool or (n,) ndarray of bool
        Whether the source covers the state; at the minimum it always does.
    warnings : tuple of CodedWarning
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
    grashof: ArrayLike = 0.0,
    minimum: float = 0.0,
) -> RotatingFilm:
    """Heat transfer coefficient of a rotating surface against speed.

    With ``"becker"``, the default air and ``minimum = 10`` it is the shaft-end
    film max(10, 0.133 Re^(2/3) 0.71^(1/3) 0.026/D), Re = ω D²/(2·1.55e-5).

    Parameters
    ----------
    model : {"becker", "dropkin_carmi", "mixed", "disc"}
    angular_speed : (n,) array_like or float, [rad/s]
    diameter : float, [m]
    kinematic_viscosity : float, [m²/s]
        Air at about 25 °C by default, like the next two.
    thermal_conductivity : float, [W/(m·K)]
    prandtl : float, [-]
    grashof : (n,) array_like or float, [-]
        On the diameter; ``"mixed"`` alone uses it.
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
    if model not in ROTATING_MODELS:
        raise OutOfValidityError(
            "rotating film", f'"{model}" is not known.', did_you_mean(model, ROTATING_MODELS)
        )
    require_range("rotating film", minimum=(minimum, *NOT_NEGATIVE), how_to_fix="Give it in W/(m²·K).")
    reynolds = rotational_reynolds(angular_speed, diameter, kinematic_viscosity)
    length = diameter
    if model == "becker":
        number = nusselt_becker(reynolds, prandtl, extrapolate=True)
    elif model == "dropkin_carmi":
        number = nusselt_dropkin_carmi(reynolds, extrapolate=True)
    elif model == "mixed":
        number = nusselt_rotating_mixed(reynolds, grashof, prandtl, extrapolate=True)
    else:
        # ω R²/ν is half of ω D²/(2 ν).
        reynolds, length = reynolds / 2.0, diameter / 2.0
        number = nusselt_rotating_disc(reynolds, extrapolate=True)
    computed = number * thermal_conductivity / length
    value = np.maximum(computed, minimum)
    lowest, highest = RANGES[model]
    in_range = ((reynolds >= lowest) & (reynolds <= highest)) | (computed < minimum)
    warnings: tuple[CodedWarning, ...] = ()
    if not in_range.all():
        fault = range_fault("rotational Reynolds number", reynolds[~in_range], lowest, highest)
        text = f'Rotating-surface film "{model}" is extrapolated: {fault}.'
        warnings = (CodedWarning("rotating_film_extrapolated", text),)
    if np.ndim(value):
        return RotatingFilm(value, reynolds, in_range, warnings)
    return RotatingFilm(float(value), float(reynolds), bool(in_range), warnings)
