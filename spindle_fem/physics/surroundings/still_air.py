"""Still air around a machine: properties, natural convection, radiation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.physics.surroundings.natural_films import NATURAL_FILMS
from spindle_fem.units import ZERO_CELSIUS_K
from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, require_range

STEFAN_BOLTZMANN = 5.670374419e-8
STANDARD_GRAVITY = 9.80665
ATMOSPHERIC_PRESSURE = 101325.0
_SPECIFIC_GAS_CONSTANT = 287.05
_AIR_RANGE_K = (ZERO_CELSIUS_K - 50.0, ZERO_CELSIUS_K + 200.0)


@dataclass(frozen=True, slots=True)
class AirProperties:
    """Properties of dry air; every array has the shape of the temperature.

    Attributes
    ----------
    density : ndarray, [kg/m³]
    dynamic_viscosity : ndarray, [Pa·s]
    specific_heat_capacity : ndarray, [J/(kg·K)]
    thermal_conductivity : ndarray, [W/(m·K)]
    expansion_coefficient : ndarray, [1/K]
    """

    density: NDArray[np.float64]
    dynamic_viscosity: NDArray[np.float64]
    specific_heat_capacity: NDArray[np.float64]
    thermal_conductivity: NDArray[np.float64]
    expansion_coefficient: NDArray[np.float64]

    @property
    def kinematic_viscosity(self) -> NDArray[np.float64]:
        """Dynamic viscosity over density, [m²/s]."""
        return self.dynamic_viscosity / self.density

    @property
    def prandtl(self) -> NDArray[np.float64]:
        """Prandtl number, [-]."""
        return self.specific_heat_capacity * self.dynamic_viscosity / self.thermal_conductivity


def air_properties(temperature: ArrayLike, pressure: float = ATMOSPHERIC_PRESSURE) -> AirProperties:
    """Properties of dry air at moderate pressure.

    Parameters
    ----------
    temperature : (n,) array_like, [K]
    pressure : float, [Pa]

    Raises
    ------
    OutOfValidityError
        Outside Range.

    Range: −50 to 200 °C, 0.5 to 2 bar; within 0.5 % of the source.

    Source: ideal gas; Sutherland's form for viscosity and conductivity, constants
    fitted to Lemmon & Jacobsen (2004), Int. J. Thermophys. 25, 21–69; heat
    capacity a parabola through Lemmon et al. (2000), J. Phys. Chem. Ref. Data 29, 331–385.

    >>> air = air_properties(293.15)
    >>> [float(x.round(3)) for x in (air.density, air.thermal_conductivity * 1e3, air.prandtl)]
    [1.204, 25.911, 0.707]
    """
    kelvin = np.asarray(temperature, dtype=np.float64)
    require_range(
        "air_properties",
        temperature=(kelvin, *_AIR_RANGE_K),
        pressure=(pressure, 0.5e5, 2.0e5),
        how_to_fix="Temperatures in K, pressure in Pa.",
    )
    ratio = kelvin / ZERO_CELSIUS_K
    celsius = kelvin - ZERO_CELSIUS_K
    return AirProperties(
        density=pressure / (_SPECIFIC_GAS_CONSTANT * kelvin),
        dynamic_viscosity=1.7224e-5 * ratio**1.5 * (ZERO_CELSIUS_K + 118.8) / (kelvin + 118.8),
        specific_heat_capacity=1005.6 + celsius * (0.017 + 4.0e-4 * celsius),
        thermal_conductivity=0.024373 * ratio**1.5 * (ZERO_CELSIUS_K + 163.5) / (kelvin + 163.5),
        expansion_coefficient=1.0 / kelvin,
    )


def rayleigh_number(
    surface_temperature: ArrayLike, ambient_temperature: ArrayLike, length: float
) -> NDArray[np.float64]:
    """Rayleigh number in air, properties at the mean of surface and ambient.

    Parameters
    ----------
    surface_temperature, ambient_temperature : (n,) array_like, [K]
    length : float, [m]

    Returns
    -------
    (n,) ndarray, [-]

    Raises
    ------
    OutOfValidityError
        Temperatures outside the range of ``air_properties``, length not positive.

    >>> float(rayleigh_number(303.15, 293.15, 0.3).round(-4))
    25800000.0
    """
    require_range("rayleigh_number", length=(length, *POSITIVE), how_to_fix="Length in m.")
    surface = np.asarray(surface_temperature, dtype=np.float64)
    ambient = np.asarray(ambient_temperature, dtype=np.float64)
    air = air_properties(0.5 * (surface + ambient))
    grashof = (
        STANDARD_GRAVITY
        * air.expansion_coefficient
        * np.abs(surface - ambient)
        * length**3
        / air.kinematic_viscosity**2
    )
    return grashof * air.prandtl


def natural_convection(
    orientation: str, surface_temperature: ArrayLike, ambient_temperature: ArrayLike, length: float
) -> NDArray[np.float64]:
    """Heat transfer coefficient of a surface in still air, properties at the film temperature.

    Parameters
    ----------
    orientation : str
        One of ``NATURAL_FILMS``.
    surface_temperature, ambient_temperature : (n,) array_like, [K]
    length : float, [m]
        Of the correlation: diameter of a cylinder, height of a plate.

    Returns
    -------
    (n,) ndarray, [W/(m²·K)]

    Raises
    ------
    OutOfValidityError
        Unknown orientation; as ``rayleigh_number`` and the correlation.

    >>> float(natural_convection("horizontal_cylinder", 303.15, 293.15, 0.3).round(2))
    3.28
    >>> float(natural_convection("vertical_plate", 303.15, 293.15, 0.3).round(2))
    3.59
    """
    nusselt = NATURAL_FILMS[orientation]
    rayleigh = rayleigh_number(surface_temperature, ambient_temperature, length)
    mean = 0.5 * (np.asarray(surface_temperature, float) + np.asarray(ambient_temperature, float))
    air = air_properties(mean)
    return nusselt(rayleigh, air.prandtl) * air.thermal_conductivity / length


def radiation_coefficient(
    surface_temperature: ArrayLike, ambient_temperature: ArrayLike, emissivity: ArrayLike
) -> NDArray[np.float64]:
    """Heat transfer coefficient of grey radiation to large surroundings, exact.

    h (T_s − T_a) equals ε σ (T_s⁴ − T_a⁴) without remainder.

    Parameters
    ----------
    surface_temperature, ambient_temperature : (n,) array_like, [K]
    emissivity : (n,) array_like, [-]

    Returns
    -------
    (n,) ndarray, [W/(m²·K)]

    Raises
    ------
    OutOfValidityError
        Negative temperature, emissivity outside 0–1.

    Range: convex grey surface in surroundings much larger than itself.

    Source: Stefan–Boltzmann law, σ = 5.670374419e-8 W/(m²·K⁴) (CODATA 2018).

    >>> float(radiation_coefficient(300.0, 290.0, 0.9).round(2))
    5.24
    """
    surface, ambient, grey = np.broadcast_arrays(
        np.asarray(surface_temperature, float),
        np.asarray(ambient_temperature, float),
        np.asarray(emissivity, float),
    )
    require_range(
        "radiation_coefficient",
        surface_temperature=(surface, *NOT_NEGATIVE),
        ambient_temperature=(ambient, *NOT_NEGATIVE),
        emissivity=(grey, 0.0, 1.0),
        how_to_fix="Temperatures in K.",
    )
    return grey * STEFAN_BOLTZMANN * (surface**2 + ambient**2) * (surface + ambient)


def outside_coefficient(
    surface_temperature: ArrayLike,
    ambient_temperature: ArrayLike,
    length: float,
    emissivity: float,
    *,
    orientation: str = "horizontal_cylinder",
) -> NDArray[np.float64]:
    """Natural convection and radiation of an outside face together.

    Parameters
    ----------
    surface_temperature, ambient_temperature : (n,) array_like, [K]
    length : float, [m]
        Diameter of a cylinder, height of a plate.
    emissivity : float, [-]
    orientation : str
        One of ``NATURAL_FILMS``.

    Returns
    -------
    (n,) ndarray, [W/(m²·K)]

    Raises
    ------
    OutOfValidityError
        Unknown orientation, or as the two parts.

    >>> float(outside_coefficient(303.15, 293.15, 0.3, 0.9).round(2))
    8.69
    """
    convection = natural_convection(orientation, surface_temperature, ambient_temperature, length)
    return convection + radiation_coefficient(surface_temperature, ambient_temperature, emissivity)
