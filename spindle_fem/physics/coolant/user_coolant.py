"""A coolant from a data sheet: two viscosities, the rest constant or linear in temperature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import OutOfValidityError, did_you_mean
from spindle_fem.physics.coolant.properties import Coolant
from spindle_fem.units import ZERO_CELSIUS_K
from spindle_fem.validity import POSITIVE, require_range


@dataclass(frozen=True)
class UserCoolant(Coolant):
    """A liquid from a data sheet: two viscosities, the rest constant or linear.

    Attributes
    ----------
    reference_temperature : float, [K]
        Temperature of the three reference values.
    density, specific_heat_capacity, thermal_conductivity : float
        At the reference temperature, [kg/m³], [J/(kg·K)], [W/(m·K)].
    viscosity_temperatures : tuple of two float, [K]
    kinematic_viscosities : tuple of two float, [m²/s]
    lowest_temperature, highest_temperature : float, [K]
        Range in which the data sheet may be used.
    density_slope, specific_heat_capacity_slope, thermal_conductivity_slope : float
        Change per kelvin; 0 for a constant.
    viscosity_law : {"walther", "andrade"}
        Walther (ASTM D341) for oils above 2 mm²/s; Andrade, ln η linear in
        1/T, for thin liquids such as water and glycol.

    Raises
    ------
    OutOfValidityError
        Values that are not physical, or Walther below 2 mm²/s.

    Source: ASTM D341 without its low-viscosity term; Andrade (1930), Nature 125, 309.

    >>> known_at, known = (313.15, 373.15), (22e-6, 4.3e-6)
    >>> oil = UserCoolant("VG 22", 313.15, 860.0, 1950.0, 0.13, known_at, known, 273.15, 373.15)
    >>> round(float(oil.properties(313.15).kinematic_viscosity) * 1e6, 6)
    22.0
    """

    name: str
    reference_temperature: float
    density: float
    specific_heat_capacity: float
    thermal_conductivity: float
    viscosity_temperatures: tuple[float, float]
    kinematic_viscosities: tuple[float, float]
    lowest_temperature: float
    highest_temperature: float
    density_slope: float = 0.0
    specific_heat_capacity_slope: float = 0.0
    thermal_conductivity_slope: float = 0.0
    viscosity_law: str = "walther"

    source = "user's definition"

    def __post_init__(self) -> None:
        where = f"coolant {self.name}"
        require_range(
            where,
            reference_temperature=(self.reference_temperature, 100.0, 1000.0),
            viscosity_temperature=(self.viscosity_temperatures, 100.0, 1000.0),
            kinematic_viscosity=(self.kinematic_viscosities, *POSITIVE),
            lowest_temperature=(self.lowest_temperature, 100.0, self.highest_temperature),
            how_to_fix="Give SI values: K, m²/s.",
        )
        if self.viscosity_law not in ("walther", "andrade"):
            raise OutOfValidityError(
                where,
                f'viscosity_law is "{self.viscosity_law}".',
                did_you_mean(self.viscosity_law, ("walther", "andrade")),
            )
        cold, warm = self.viscosity_temperatures
        thick, thin = self.kinematic_viscosities
        if cold == warm or (warm - cold) * (thick - thin) < 0.0:
            raise OutOfValidityError(
                where,
                f"viscosities {thick:.4g} and {thin:.4g} m²/s at {cold:.6g} and {warm:.6g} K make no line.",
                "Give two different temperatures; a liquid gets thinner as it warms.",
            )
        ends = np.array([self.lowest_temperature, self.highest_temperature])
        require_range(
            where,
            density=(self._density(ends), *POSITIVE),
            specific_heat_capacity=(self._specific_heat_capacity(ends), *POSITIVE),
            thermal_conductivity=(self._thermal_conductivity(ends), *POSITIVE),
            how_to_fix="Check the slopes: these are the values at the ends of the temperature range.",
        )
        if self.viscosity_law == "walther":
            require_range(
                where,
                kinematic_viscosity_in_mm2_s=(
                    1.0e6 * self._kinematic_viscosity(np.append(ends, self.viscosity_temperatures)),
                    2.0 - 1.0e-9,
                    2.0e7,
                ),
                how_to_fix='Use viscosity_law = "andrade" for a thin liquid, or a narrower range.',
            )

    @property
    def lowest_accurate_temperature(self) -> float:
        """The whole range is accurate, as far as we know."""
        return self.lowest_temperature

    @property
    def highest_accurate_temperature(self) -> float:
        """The whole range is accurate, as far as we know."""
        return self.highest_temperature

    def _kinematic_viscosity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        known_temperature = np.array(self.viscosity_temperatures)
        known_viscosity = np.array(self.kinematic_viscosities)
        if self.viscosity_law == "walther":
            ordinate = np.log10(np.log10(1.0e6 * known_viscosity + 0.7))
            abscissa, wanted = np.log10(known_temperature), np.log10(temperature)
        else:
            ordinate = np.log(known_viscosity)
            abscissa, wanted = 1.0 / known_temperature, 1.0 / temperature
        slope = (ordinate[1] - ordinate[0]) / (abscissa[1] - abscissa[0])
        value = ordinate[0] + slope * (wanted - abscissa[0])
        if self.viscosity_law == "walther":
            return 1.0e-6 * (10.0 ** (10.0**value) - 0.7)
        return np.exp(value)

    def _density(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.density + self.density_slope * (temperature - self.reference_temperature)

    def _dynamic_viscosity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._kinematic_viscosity(temperature) * self._density(temperature)

    def _specific_heat_capacity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        rise = temperature - self.reference_temperature
        return self.specific_heat_capacity + self.specific_heat_capacity_slope * rise

    def _thermal_conductivity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        rise = temperature - self.reference_temperature
        return self.thermal_conductivity + self.thermal_conductivity_slope * rise

    def _specific_enthalpy(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        middle = 0.5 * (temperature + ZERO_CELSIUS_K)
        return (temperature - ZERO_CELSIUS_K) * self._specific_heat_capacity(middle)
