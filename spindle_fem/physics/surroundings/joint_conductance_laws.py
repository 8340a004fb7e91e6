"""Thermal conductance of joints, and the pressure of an interference fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, require_range


def harmonic_conductivity(conductivity_a: ArrayLike, conductivity_b: ArrayLike) -> NDArray[np.float64]:
    """Harmonic mean of the conductivities of two bodies in contact.

    Parameters
    ----------
    conductivity_a, conductivity_b : (n,) array_like, [W/(m·K)]

    Returns
    -------
    (n,) ndarray, [W/(m·K)]

    Raises
    ------
    OutOfValidityError
        A conductivity that is not positive.

    >>> float(harmonic_conductivity(42.0, 46.0).round(2))
    43.91
    """
    a, b = np.broadcast_arrays(np.asarray(conductivity_a, float), np.asarray(conductivity_b, float))
    require_range(
        "harmonic_conductivity",
        conductivity_a=(a, *POSITIVE),
        conductivity_b=(b, *POSITIVE),
        how_to_fix="Give W/(m·K).",
    )
    return 2.0 * a * b / (a + b)


def joint_conductance_yovanovich(
    pressure: ArrayLike,
    conductivity: float,
    roughness: float,
    slope: float,
    microhardness: float,
) -> NDArray[np.float64]:
    """Contact conductance of rough flat surfaces whose asperities yield.

    Parameters
    ----------
    pressure : (n,) array_like, [Pa]
        Apparent; 0 gives 0.
    conductivity : float, [W/(m·K)]
        Harmonic mean of both bodies.
    roughness : float, [m]
        Combined rms, √(σ1² + σ2²).
    slope : float, [-]
        Combined rms of the profile slope.
    microhardness : float, [Pa]
        Of the softer body.

    Returns
    -------
    (n,) ndarray, [W/(m²·K)]

    Raises
    ------
    OutOfValidityError
        Outside Range.

    Range: p/H <= 0.02; the source starts at 1e-6, below which it tends to 0.

    Source: Yovanovich (1982), AIAA-82-0888: h = 1.25 k (m/σ)(p/H)^0.95.

    >>> float(joint_conductance_yovanovich(10e6, 43.9, 1.0e-6, 0.1, 3.0e9).round(-2))
    24300.0
    """
    p = np.asarray(pressure, float)
    _require_surface("joint_conductance_yovanovich", conductivity, roughness, slope)
    require_range(
        "joint_conductance_yovanovich",
        microhardness=(microhardness, *POSITIVE),
        pressure_over_hardness=(p / microhardness, 0.0, 0.02),
        how_to_fix="Beyond this the asperities touch nearly everywhere: treat the joint as perfect.",
    )
    return 1.25 * conductivity * slope / roughness * (p / microhardness) ** 0.95


def joint_conductance_mikic_elastic(
    pressure: ArrayLike,
    conductivity: float,
    roughness: float,
    slope: float,
    contact_modulus: float,
) -> NDArray[np.float64]:
    """Contact conductance of rough flat surfaces whose asperities stay elastic.

    Parameters
    ----------
    pressure : (n,) array_like, [Pa]
        Apparent; 0 gives 0.
    conductivity : float, [W/(m·K)]
        Harmonic mean of both bodies.
    roughness : float, [m]
        Combined rms.
    slope : float, [-]
        Combined rms of the profile slope.
    contact_modulus : float, [Pa]
        1/E' = (1 − ν1²)/E1 + (1 − ν2²)/E2.

    Returns
    -------
    (n,) ndarray, [W/(m²·K)]

    Raises
    ------
    OutOfValidityError
        A value that is not positive; √2 p/(m E') above 0.02.

    Range: elastic asperities (lapped or run-in surfaces, repeated loading).

    Source: Mikic (1974), Int. J. Heat Mass Transfer 17, 205–214:
    h = 1.55 k (m/σ)(√2 p/(m E'))^0.94.

    >>> float(joint_conductance_mikic_elastic(10e6, 43.9, 1.0e-6, 0.1, 113.2e9).round(-2))
    12700.0
    """
    p = np.asarray(pressure, float)
    _require_surface("joint_conductance_mikic_elastic", conductivity, roughness, slope)
    require_range(
        "joint_conductance_mikic_elastic",
        contact_modulus=(contact_modulus, *POSITIVE),
        relative_pressure=(np.sqrt(2.0) * p / (slope * contact_modulus), 0.0, 0.02),
        how_to_fix="Beyond this the asperities touch nearly everywhere: treat the joint as perfect.",
    )
    relative = np.sqrt(2.0) * p / (slope * contact_modulus)
    return 1.55 * conductivity * slope / roughness * relative**0.94


def _require_surface(where: str, conductivity: float, roughness: float, slope: float) -> None:
    require_range(
        where,
        conductivity=(conductivity, *POSITIVE),
        roughness=(roughness, *POSITIVE),
        slope=(slope, *POSITIVE),
        how_to_fix="Give SI values: W/(m·K), m, and the slope as a tangent.",
    )


def mean_plane_separation(pressure: ArrayLike, roughness: float, microhardness: float) -> NDArray[np.float64]:
    """Distance of the mean planes of two rough surfaces in contact.

    Parameters
    ----------
    pressure : (n,) array_like, [Pa]
    roughness : float, [m]
        Combined rms.
    microhardness : float, [Pa]

    Returns
    -------
    (n,) ndarray, [m]

    Raises
    ------
    OutOfValidityError
        Outside Range.

    Range: 1e-5 <= p/H <= 0.02.

    Source: Antonetti (1983): Y = 1.53 σ (p/H)^−0.097.

    >>> float((mean_plane_separation(10e6, 1.0e-6, 3.0e9) * 1e6).round(2))
    2.66
    """
    p = np.asarray(pressure, float)
    require_range(
        "mean_plane_separation",
        roughness=(roughness, *POSITIVE),
        microhardness=(microhardness, *POSITIVE),
        pressure_over_hardness=(p / microhardness, 1.0e-5, 0.02),
        how_to_fix="Without pressure give the clearance as separation.",
    )
    return 1.53 * roughness * (p / microhardness) ** -0.097


def gap_conductance(
    separation: ArrayLike,
    gas_conductivity: float = 0.026,
    rarefaction_length: float = 0.37e-6,
) -> NDArray[np.float64]:
    """Conductance of the gas, grease or oil between two surfaces.

    Parameters
    ----------
    separation : (n,) array_like, [m]
        Mean distance of the surfaces.
    gas_conductivity : float, [W/(m·K)]
        Air by default.
    rarefaction_length : float, [m]
        Temperature jump of a gas at both walls, about six mean free paths
        for air at 1 bar; 0 for a liquid.

    Returns
    -------
    (n,) ndarray, [W/(m²·K)]

    Raises
    ------
    OutOfValidityError
        Negative separation, or separation and rarefaction length both 0.

    Source: Yovanovich (1986), AIAA-86-1164: h = k_g/(Y + M).

    >>> float(gap_conductance(5.0e-6).round(0))
    4842.0
    """
    distance = np.asarray(separation, float)
    require_range(
        "gap_conductance",
        separation=(distance, *NOT_NEGATIVE),
        gas_conductivity=(gas_conductivity, *POSITIVE),
        rarefaction_length=(rarefaction_length, *NOT_NEGATIVE),
        heat_path=(distance + rarefaction_length, *POSITIVE),
        how_to_fix="Give metres.",
    )
    return gas_conductivity / (distance + rarefaction_length)


@dataclass(frozen=True, slots=True)
class InterferenceFit:
    """State of a ring on a hollow shaft.

    Attributes
    ----------
    interference : ndarray, [m]
        On the diameter, hot and turning; negative is a clearance.
    pressure : ndarray, [Pa]
        0 where the ring is loose.
    radial_gap : ndarray, [m]
        0 where it is tight.
    """

    interference: NDArray[np.float64]
    pressure: NDArray[np.float64]
    radial_gap: NDArray[np.float64]


def interference_fit(
    assembly_interference: ArrayLike,
    shaft_bore: float,
    seat_diameter: float,
    ring_outer_diameter: float,
    *,
    young_modulus: float,
    shaft_rise: ArrayLike = 0.0,
    ring_rise: ArrayLike = 0.0,
    expansion_coefficient: float = 12.0e-6,
    angular_speed: ArrayLike = 0.0,
    density: float = 7850.0,
    poisson_ratio: float = 0.3,
) -> InterferenceFit:
    """Pressure of an interference fit with ring and shaft temperatures and speed.

    Shaft and ring of one steel. A ring that is warmer than its shaft and a
    faster one both loosen it.

    Parameters
    ----------
    assembly_interference : (n,) array_like, [m]
        On the diameter, at assembly temperature and standstill.
    shaft_bore, seat_diameter, ring_outer_diameter : float, [m]
        d_1 < d_2 < d_3; 0 for a solid shaft.
    young_modulus : float, [Pa]
    shaft_rise, ring_rise : (n,) array_like, [K]
        Above assembly temperature.
    expansion_coefficient : float, [1/K]
    angular_speed : (n,) array_like, [rad/s]
    density : float, [kg/m³]
    poisson_ratio : float, [-]

    Returns
    -------
    InterferenceFit

    Raises
    ------
    OutOfValidityError
        Diameters not in order, a material value that is not physical.

    Range: thin compared with its length is not needed (plane stress), rings
    without neighbours.

    Source: Lamé (1852) cylinders, p = (E Δ/d_2)(d_2² − d_1²)(d_3² − d_2²) /
    (2 d_2² (d_3² − d_1²)); rotating discs, Timoshenko & Goodier, Theory of Elasticity, §32.

    >>> fit = interference_fit(20e-6, 0.060, 0.140, 0.158, young_modulus=206e9)
    >>> float((fit.pressure / 1e6).round(2))
    3.02
    """
    require_range(
        "interference_fit",
        shaft_bore=(shaft_bore, 0.0, seat_diameter * (1.0 - 1.0e-9)),
        seat_diameter=(seat_diameter, *POSITIVE),
        ring_outer_diameter=(ring_outer_diameter, seat_diameter * (1.0 + 1.0e-9), POSITIVE[1]),
        young_modulus=(young_modulus, *POSITIVE),
        density=(density, *POSITIVE),
        poisson_ratio=(poisson_ratio, 0.0, 0.5),
        expansion_coefficient=(expansion_coefficient, *NOT_NEGATIVE),
        how_to_fix="Diameters must grow from bore to seat to outside; SI values.",
    )
    thermal = (
        expansion_coefficient * seat_diameter * (np.asarray(shaft_rise, float) - np.asarray(ring_rise, float))
    )
    # Growth of the seat diameter of ring and shaft if each turned alone.
    stress = density * np.asarray(angular_speed, float) ** 2 / 4.0
    growth = stress * (seat_diameter / young_modulus) / 4.0
    ring_growth = growth * (
        (3.0 + poisson_ratio) * ring_outer_diameter**2 + (1.0 - poisson_ratio) * seat_diameter**2
    )
    shaft_growth = growth * ((1.0 - poisson_ratio) * seat_diameter**2 + (3.0 + poisson_ratio) * shaft_bore**2)
    interference = np.asarray(assembly_interference, float) + thermal - (ring_growth - shaft_growth)
    stiffness = (
        young_modulus
        / seat_diameter
        * (seat_diameter**2 - shaft_bore**2)
        * (ring_outer_diameter**2 - seat_diameter**2)
        / (2.0 * seat_diameter**2 * (ring_outer_diameter**2 - shaft_bore**2))
    )
    return InterferenceFit(
        interference=interference,
        pressure=stiffness * np.maximum(interference, 0.0),
        radial_gap=0.5 * np.maximum(-interference, 0.0),
    )


def seat_conductance(
    fit: InterferenceFit,
    conductivity: float,
    roughness: float,
    slope: float,
    microhardness: float,
    *,
    gas_conductivity: float = 0.026,
    rarefaction_length: float = 0.37e-6,
) -> NDArray[np.float64]:
    """Conductance of a ring seat: contact and gas where tight, gas alone where loose.

    Parameters
    ----------
    fit : InterferenceFit
    conductivity : float, [W/(m·K)]
        Harmonic mean of both bodies.
    roughness : float, [m]
        Combined rms.
    slope : float, [-]
    microhardness : float, [Pa]
    gas_conductivity : float, [W/(m·K)]
    rarefaction_length : float, [m]

    Returns
    -------
    ndarray, [W/(m²·K)]
        Shape of the fit; grows with pressure, falls with the gap, and has no
        jump where the ring comes loose.

    Raises
    ------
    OutOfValidityError
        As ``joint_conductance_yovanovich`` and ``gap_conductance``.

    >>> fit = interference_fit(20e-6, 0.060, 0.140, 0.158, young_modulus=206e9)
    >>> float(seat_conductance(fit, 43.9, 1.0e-6, 0.1, 3.0e9).round(-2))
    15500.0
    """
    lightest_touch = 1.0e-5 * microhardness
    separation = mean_plane_separation(np.maximum(fit.pressure, lightest_touch), roughness, microhardness)
    contact = joint_conductance_yovanovich(fit.pressure, conductivity, roughness, slope, microhardness)
    return contact + gap_conductance(separation + fit.radial_gap, gas_conductivity, rarefaction_length)
