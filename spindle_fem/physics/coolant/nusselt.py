"""Nusselt numbers of straight channels, and the ranges of every correlation.

Every function refuses values outside the range of its source unless it is
told ``extrapolate=True``; whoever says so must tell the user. ``RANGES``
holds the ranges, and ``range_faults`` says which one is left.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.physics.coolant.transition import TURBULENT_FROM_REYNOLDS
from spindle_fem.validity import range_fault, require_range

RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "nusselt_paper_turbulent": {"reynolds": (1.0e4, 1.2e5), "prandtl": (0.7, 160.0)},
    "nusselt_sieder_tate": {"graetz": (10.0, np.inf), "viscosity_ratio": (0.0044, 9.75)},
    "nusselt_rectangle": {"aspect_ratio": (0.0, 1.0)},
    "nusselt_hausen": {"graetz": (0.0, np.inf), "nusselt_developed": (0.0, np.inf)},
    "nusselt_schmidt": {
        "reynolds": (100.0, 2.2e4),
        "prandtl": (0.5, np.inf),
        "curvature_ratio": (0.012, 0.2),
        "viscosity_ratio": (0.0044, 9.75),
    },
    "nusselt_manlapaz_churchill": {"dean": (0.0, np.inf), "prandtl": (0.0, np.inf)},
    "nusselt_seban_mclaughlin": {
        "reynolds": (12.0, 5600.0),
        "prandtl": (100.0, 657.0),
        "curvature_ratio": (0.0096, 0.059),
    },
    "nusselt_janssen_hoogendoorn": {
        "dean": (100.0, 830.0),
        "prandtl": (20.0, 450.0),
        "curvature_ratio": (0.010, 0.083),
    },
    "nusselt_dravid": {"dean": (50.0, 2000.0), "prandtl": (5.0, 175.0)},
    "nusselt_gnielinski_helical": {
        "reynolds": (TURBULENT_FROM_REYNOLDS, 1.5e5),
        "prandtl": (0.6, 2000.0),
        "curvature_ratio": (0.0, 0.2),
    },
}


def range_faults(correlation: str, **quantities: ArrayLike) -> tuple[str, ...]:
    """Sentence parts that say which quantities leave the range of a correlation.

    >>> range_faults("nusselt_seban_mclaughlin", reynolds=292.0, prandtl=1214.0, curvature_ratio=0.048)
    ('prandtl is 1214, allowed 100 to 657',)
    """
    ranges = RANGES[correlation]
    texts = (range_fault(name, value, *ranges[name]) for name, value in quantities.items())
    return tuple(text for text in texts if text)


def guard_range(correlation: str, extrapolate: bool, **quantities: ArrayLike) -> None:
    """Refuse quantities outside the range of a correlation, unless told to extrapolate.

    Raises
    ------
    OutOfValidityError
        Outside ``RANGES``, unless ``extrapolate``.
    """
    if extrapolate:
        return
    ranges = RANGES[correlation]
    require_range(
        correlation,
        how_to_fix="Let coolant.regimes choose the correlation.",
        **{name: (value, *ranges[name]) for name, value in quantities.items()},
    )


def nusselt_paper_turbulent(
    reynolds: ArrayLike, prandtl: ArrayLike, *, extrapolate: bool = False
) -> NDArray[np.float64]:
    """Nusselt number of turbulent flow as the paper has it (its equation 30).

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        On the paper's length, the channel depth h_gap.
    prandtl : (n,) array_like, [-]
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]
        On the channel depth.

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: 1e4 <= Re <= 1.2e5, 0.7 <= Pr <= 160, straight pipe. Cooling oil has
    Pr 360–1500: the paper used it outside.

    Source: Wu & Tan (2016), Adv. Mech. Eng. 8(8), equation 30 and Table 1;
    form and range of Dittus & Boelter (1930).

    >>> float(nusselt_paper_turbulent(1.0e4, 100.0).round(1))
    142.0
    """
    re, pr = np.broadcast_arrays(np.asarray(reynolds, float), np.asarray(prandtl, float))
    guard_range("nusselt_paper_turbulent", extrapolate, reynolds=re, prandtl=pr)
    return 0.0225 * re**0.8 * pr**0.3


def nusselt_sieder_tate(
    graetz: ArrayLike, viscosity_ratio: ArrayLike = 1.0, *, extrapolate: bool = False
) -> NDArray[np.float64]:
    """Mean Nusselt number of laminar flow that develops thermally in a straight duct.

    Parameters
    ----------
    graetz : (n,) array_like, [-]
        Re Pr D/L with the length D on which the Nusselt number is wanted.
    viscosity_ratio : (n,) array_like, [-]
        Dynamic viscosity at bulk over that at wall temperature.
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: Gz >= 10, 0.0044 <= η/η_wall <= 9.75, laminar. With viscosity ratio
    1 and the channel depth as length it is the paper's equation 31.

    Source: Sieder & Tate (1936), Ind. Eng. Chem. 28, 1429–1435.

    >>> float(nusselt_sieder_tate(1000.0).round(2))
    18.6
    """
    gz, ratio = np.broadcast_arrays(np.asarray(graetz, float), np.asarray(viscosity_ratio, float))
    guard_range("nusselt_sieder_tate", extrapolate, graetz=gz, viscosity_ratio=ratio)
    return 1.86 * np.cbrt(gz) * ratio**0.14


def nusselt_rectangle(aspect_ratio: ArrayLike, *, extrapolate: bool = False) -> NDArray[np.float64]:
    """Nusselt number of developed laminar flow in a straight rectangular duct.

    Uniform wall temperature on all four sides.

    Parameters
    ----------
    aspect_ratio : (n,) array_like, [-]
        Short over long side.
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]
        On the hydraulic diameter.

    Raises
    ------
    OutOfValidityError
        Outside Range, unless ``extrapolate``.

    Range: 0 (slit) to 1 (square).

    Source: Shah & London (1978), Laminar Flow Forced Convection in Ducts,
    polynomial within 0.1 % of their table.

    >>> nusselt_rectangle([0.0, 1.0]).round(2).tolist()
    [7.54, 2.98]
    """
    a = np.asarray(aspect_ratio, float)
    guard_range("nusselt_rectangle", extrapolate, aspect_ratio=a)
    return 7.541 * (1.0 + a * (-2.610 + a * (4.970 + a * (-5.119 + a * (2.702 - 0.548 * a)))))


def nusselt_hausen(
    graetz: ArrayLike, nusselt_developed: ArrayLike, *, extrapolate: bool = False
) -> NDArray[np.float64]:
    """Mean Nusselt number over the thermal entry of a straight duct.

    Parameters
    ----------
    graetz : (n,) array_like, [-]
        Re Pr D_h/L.
    nusselt_developed : (n,) array_like, [-]
        Far from the inlet, for example ``nusselt_rectangle``.
    extrapolate : bool
        Compute outside Range too.

    Returns
    -------
    (n,) ndarray, [-]

    Raises
    ------
    OutOfValidityError
        Negative input, unless ``extrapolate``.

    Range: laminar, velocity profile developed (Pr > 5), uniform wall temperature.

    Source: Hausen (1943), VDI-Z Beih. Verfahrenstechnik 4, 91–98; the entry
    term of the round tube is used for other ducts, on the hydraulic diameter.

    >>> float(nusselt_hausen(1090.0, 3.0).round(1))
    16.9
    """
    gz, developed = np.broadcast_arrays(np.asarray(graetz, float), np.asarray(nusselt_developed, float))
    guard_range("nusselt_hausen", extrapolate, graetz=gz, nusselt_developed=developed)
    return developed + 0.0668 * gz / (1.0 + 0.04 * np.cbrt(gz) ** 2)
