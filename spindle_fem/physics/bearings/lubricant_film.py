"""Elastohydrodynamic film (eqs 6, 10-13): Hamrock-Dowson with thermal and starvation reduction."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.validity import CodedWarning, range_fault

FloatArray = NDArray[np.float64]


def film_groups(
    viscosity: ArrayLike,
    entrainment_speed: ArrayLike,
    load: ArrayLike,
    reduced_modulus: ArrayLike,
    radius: ArrayLike,
    pressure_viscosity: ArrayLike,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Speed, material and load group U, G, W of eq. 11.

    Parameters
    ----------
    viscosity : array_like, [Pa s]
        At the inlet.
    entrainment_speed : array_like, [m/s]
        *Mean* of both surface speeds (the paper prints their sum).
    load : array_like, [N]
    reduced_modulus : array_like, [Pa]
        E' with 2/E' = (1-ν1²)/E1 + (1-ν2²)/E2.
    radius : array_like, [m]
        R_x along the rolling direction.
    pressure_viscosity : array_like, [1/Pa]
    """
    modulus_radius = np.asarray(reduced_modulus) * np.asarray(radius)
    return (
        np.asarray(viscosity) * np.asarray(entrainment_speed) / modulus_radius,
        np.asarray(pressure_viscosity) * np.asarray(reduced_modulus),
        np.asarray(load) / (modulus_radius * np.asarray(radius)),
    )


def film_central_hamrock_dowson(
    speed_group: ArrayLike, material_group: ArrayLike, load_group: ArrayLike, ellipticity: ArrayLike
) -> FloatArray:
    """Central film thickness over R_x, isothermal and flooded (eq. 10).

    Range of the fit: U 1e-12 to 5e-11, G 2500 to 6000, κ 1 to 8.

    Source: Hamrock & Dowson (1977), J. Lubr. Technol. 99, 264-276.

    >>> h = film_central_hamrock_dowson(1.8e-10, 4070.0, 1.2e-5, 8.5)
    >>> 1.2e-4 < float(h) < 1.6e-4
    True
    """
    film = 2.69 * np.power(speed_group, 0.67) * np.power(material_group, 0.53)
    return film * np.power(load_group, -0.067) * (1.0 - 0.61 * np.exp(-0.73 * np.asarray(ellipticity)))


def film_minimum_hamrock_dowson(
    speed_group: ArrayLike, material_group: ArrayLike, load_group: ArrayLike, ellipticity: ArrayLike
) -> FloatArray:
    """Minimum film thickness over R_x, isothermal and flooded; range as the central one.

    Source: Hamrock & Dowson (1977).
    """
    film = 3.63 * np.power(speed_group, 0.68) * np.power(material_group, 0.49)
    return film * np.power(load_group, -0.073) * (1.0 - np.exp(-0.68 * np.asarray(ellipticity)))


def film_fit_warnings(
    speed_group: ArrayLike, material_group: ArrayLike, ellipticity: ArrayLike, name: str = "bearing"
) -> tuple[CodedWarning, ...]:
    """Warning where a film lies outside the range of Hamrock and Dowson's fit."""
    faults = [
        range_fault("speed parameter U", speed_group, 1e-12, 5e-11),
        range_fault("material parameter G", material_group, 2500.0, 6000.0),
        range_fault("ellipticity of the contact", ellipticity, 1.0, 8.0),
    ]
    text = "; ".join(fault for fault in faults if fault)
    if not text:
        return ()
    return (CodedWarning("film_fit_extrapolated", f"{name}: Hamrock-Dowson film outside its fit: {text}."),)


def thermal_reduction(
    viscosity_slope: ArrayLike,
    entrainment_speed: ArrayLike,
    thermal_conductivity: ArrayLike,
    slide_ratio: ArrayLike = 0.0,
    *,
    model: Literal["wilson", "gupta", "none"] = "wilson",
    pressure: ArrayLike = 0.0,
    reduced_modulus: ArrayLike = 1.0,
) -> FloatArray:
    """Factor on the isothermal film for shear heating in the inlet.

    Parameters
    ----------
    viscosity_slope : array_like, [Pa s/K]
        -dη/dT at the inlet temperature.
    entrainment_speed : array_like, [m/s]
    thermal_conductivity : array_like, [W/(m K)]
        Of the lubricant.
    slide_ratio : array_like, [-]
        Σ = 2|u1-u2|/(u1+u2).
    model : {"wilson", "gupta", "none"}
    pressure, reduced_modulus : array_like, [Pa]
        Hertz pressure and E', for Gupta's factor only.

    Range: thermal loading L up to about 10; Gupta's factor turns negative
    beyond 13.2 (p_0/E') L^0.42 = 1 and is refused there by being 0.

    Source: Wilson & Sheu (1983); Gupta, Cheng, Zhu, Forster & Schrand (1992).

    >>> float(thermal_reduction(6.8e-4, 12.87, 0.14).round(2))
    0.92
    """
    loading = (
        np.asarray(viscosity_slope) * np.asarray(entrainment_speed) ** 2 / np.asarray(thermal_conductivity)
    )
    sliding = np.asarray(slide_ratio) ** 0.83
    if model == "none":
        return np.ones_like(loading)
    if model == "gupta":
        numerator = 1.0 - 13.2 * np.asarray(pressure) / np.asarray(reduced_modulus) * loading**0.42
        return np.maximum(numerator, 0.0) / (1.0 + 0.213 * (1.0 + 2.23 * sliding) * loading**0.64)
    return 1.0 / (1.0 + 0.1 * (1.0 + 14.8 * sliding) * loading**0.64)


def inlet_shear_factor(
    speed: ArrayLike, mean_diameter: ArrayLike, kinematic_viscosity: ArrayLike
) -> FloatArray:
    """SKF inlet shear heating factor φ_ish of the rolling friction moment.

    Parameters
    ----------
    speed : array_like, [rad/s]
    mean_diameter : array_like, [m]
    kinematic_viscosity : array_like, [m²/s]

    Source: SKF rolling bearings catalogue (2013).

    >>> import math
    >>> float(inlet_shear_factor(3000 * math.pi / 30, 0.165, 21e-6).round(4))
    0.7992
    """
    n_dm = _rpm(speed) * np.asarray(mean_diameter) * 1e3
    return 1.0 / (1.0 + 1.84e-9 * n_dm**1.28 * (np.asarray(kinematic_viscosity) * 1e6) ** 0.64)


def replenishment_factor(
    speed: ArrayLike,
    bore_diameter: ArrayLike,
    outer_diameter: ArrayLike,
    kinematic_viscosity: ArrayLike,
    *,
    constant: float = 6.0e-8,
    geometry_constant: float = 4.4,
) -> FloatArray:
    """SKF kinematic replenishment (starvation) factor φ_rs of the rolling friction moment.

    Parameters
    ----------
    speed : array_like, [rad/s]
    bore_diameter, outer_diameter : array_like, [m]
    kinematic_viscosity : array_like, [m²/s]
    constant : float
        K_rs: 6e-8 for grease and oil-air, 3e-8 for a low oil bath.
    geometry_constant : float
        K_Z, that of the kind: 4.4 for single-row angular-contact ball bearings, 3.1 for deep grooves.

    Source: SKF rolling bearings catalogue (2013).

    >>> import math
    >>> float(replenishment_factor(3000 * math.pi / 30, 0.14, 0.19, 21e-6).round(4))
    0.7698
    """
    bore, outer = np.asarray(bore_diameter) * 1e3, np.asarray(outer_diameter) * 1e3
    viscosity = np.asarray(kinematic_viscosity) * 1e6
    shape = np.sqrt(geometry_constant / (2.0 * (outer - bore)))
    return np.exp(-constant * viscosity * _rpm(speed) * (bore + outer) * shape)


def film_thickness_ratio(
    minimum_film: ArrayLike, roughness_raceway: ArrayLike, roughness_ball: ArrayLike
) -> FloatArray:
    """Λ of eq. 6: minimum film over the composite roughness (all lengths in m).

    >>> float(film_thickness_ratio(0.5e-6, 0.04e-6, 0.03e-6))
    10.0
    """
    return np.asarray(minimum_film) / np.hypot(roughness_raceway, roughness_ball)


def _rpm(speed: ArrayLike) -> FloatArray:
    return np.abs(np.asarray(speed, float)) * 30.0 / np.pi
