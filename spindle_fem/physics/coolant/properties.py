"""Properties of coolants against temperature: ISO VG 32 oil, water, a fluid of the user's."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.errors import OutOfValidityError, did_you_mean
from spindle_fem.units import ZERO_CELSIUS_K
from spindle_fem.validity import POSITIVE, CodedWarning, range_fault, require_range

# Rounding of °C to K and back must not put a temperature outside its range.
_TEMPERATURE_ROUNDING_K = 1.0e-6


@dataclass(frozen=True, slots=True)
class CoolantProperties:
    """Properties of a liquid at given temperatures; every array has their shape.

    Attributes
    ----------
    density : ndarray, [kg/m³]
    dynamic_viscosity : ndarray, [Pa·s]
    specific_heat_capacity : ndarray, [J/(kg·K)]
    thermal_conductivity : ndarray, [W/(m·K)]
    """

    density: NDArray[np.float64]
    dynamic_viscosity: NDArray[np.float64]
    specific_heat_capacity: NDArray[np.float64]
    thermal_conductivity: NDArray[np.float64]

    @property
    def kinematic_viscosity(self) -> NDArray[np.float64]:
        """Dynamic viscosity over density, [m²/s]."""
        return self.dynamic_viscosity / self.density

    @property
    def prandtl(self) -> NDArray[np.float64]:
        """Prandtl number, [-]."""
        return self.specific_heat_capacity * self.dynamic_viscosity / self.thermal_conductivity


class Coolant(ABC):
    """A liquid with a range of temperature outside which it refuses.

    Subclasses give the property formulas; this class guards their range.
    """

    name: str
    source: str
    lowest_temperature: float
    highest_temperature: float
    lowest_accurate_temperature: float
    highest_accurate_temperature: float

    @abstractmethod
    def _density(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]: ...

    @abstractmethod
    def _dynamic_viscosity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]: ...

    @abstractmethod
    def _specific_heat_capacity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]: ...

    @abstractmethod
    def _thermal_conductivity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]: ...

    @abstractmethod
    def _specific_enthalpy(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]: ...

    def properties(self, temperature: ArrayLike) -> CoolantProperties:
        """All properties at the given temperatures.

        Parameters
        ----------
        temperature : array_like, [K]

        Returns
        -------
        CoolantProperties

        Raises
        ------
        OutOfValidityError
            Outside the range of the source.
        """
        kelvin = self._guarded(temperature)
        return CoolantProperties(
            density=self._density(kelvin),
            dynamic_viscosity=self._dynamic_viscosity(kelvin),
            specific_heat_capacity=self._specific_heat_capacity(kelvin),
            thermal_conductivity=self._thermal_conductivity(kelvin),
        )

    def specific_enthalpy(self, temperature: ArrayLike) -> NDArray[np.float64]:
        """Integral of the specific heat capacity from 0 °C, [J/kg].

        Parameters
        ----------
        temperature : array_like, [K]

        Raises
        ------
        OutOfValidityError
            Outside the range of the source.
        """
        return self._specific_enthalpy(self._guarded(temperature))

    def temperature_warnings(self, temperature: ArrayLike) -> tuple[CodedWarning, ...]:
        """Warn where the source is defined but known to be less accurate.

        Parameters
        ----------
        temperature : array_like, [K]
        """
        fault = range_fault(
            "temperature",
            np.asarray(temperature, dtype=np.float64) - ZERO_CELSIUS_K,
            self.lowest_accurate_temperature - ZERO_CELSIUS_K - _TEMPERATURE_ROUNDING_K,
            self.highest_accurate_temperature - ZERO_CELSIUS_K + _TEMPERATURE_ROUNDING_K,
        )
        if not fault:
            return ()
        text = f"Coolant {self.name}: {fault} °C for full accuracy ({self.source})."
        return (CodedWarning("coolant_property_accuracy", text),)

    def _guarded(self, temperature: ArrayLike) -> NDArray[np.float64]:
        kelvin = np.asarray(temperature, dtype=np.float64)
        require_range(
            f"coolant {self.name}",
            temperature_in_degC=(
                kelvin - ZERO_CELSIUS_K,
                self.lowest_temperature - ZERO_CELSIUS_K - _TEMPERATURE_ROUNDING_K,
                self.highest_temperature - ZERO_CELSIUS_K + _TEMPERATURE_ROUNDING_K,
            ),
            how_to_fix="Keep the coolant in this range, or define a coolant of your own with a wider one.",
        )
        return kelvin


class OilIsoVg32(Coolant):
    """ISO VG 32 hydraulic oil, fits of the paper.

    Against a Walther line through 32 and 5.4 mm²/s the viscosity is 17 % low
    at 10 °C, 10 % low at 15 °C, within 8 % from 20 to 40 °C, 12 % low at 45 °C.

    Range: 10–50 °C; warns outside 15–45 °C.

    Source: Wu & Tan (2016), Adv. Mech. Eng. 8(8), equation 29.

    >>> at_15 = OilIsoVg32().properties(288.15)
    >>> round(float(at_15.dynamic_viscosity) * 1e3, 2), round(float(at_15.prandtl))
    (90.62, 1214)
    """

    name = "iso_vg_32"
    source = "Wu & Tan 2016, equation 29"
    lowest_temperature = 10.0 + ZERO_CELSIUS_K
    highest_temperature = 50.0 + ZERO_CELSIUS_K
    lowest_accurate_temperature = 15.0 + ZERO_CELSIUS_K
    highest_accurate_temperature = 45.0 + ZERO_CELSIUS_K

    def _density(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return 869.1 * (1.0 - 7.9744e-4 * (temperature - ZERO_CELSIUS_K - 21.0))

    def _dynamic_viscosity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return 0.06673 * np.exp(-0.051 * (temperature - ZERO_CELSIUS_K - 21.0))

    def _specific_heat_capacity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return 4.428 * (temperature - ZERO_CELSIUS_K - 21.0) + 1884.2

    def _thermal_conductivity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return 0.1381 * (1.012 - 5.5018e-4 * (temperature - ZERO_CELSIUS_K))

    def _specific_enthalpy(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        celsius = temperature - ZERO_CELSIUS_K
        return celsius * (1884.2 - 4.428 * 21.0 + 0.5 * 4.428 * celsius)


class Water(Coolant):
    """Liquid water at 0.1 MPa.

    Viscosity and conductivity are the IAPWS formulas; density and heat
    capacity are polynomials fitted to IAPWS-95 within 1e-5 and 3e-5 relative.

    Range: 1–95 °C.

    Source: IAPWS SR6-08(2011), Supplementary Release on Properties of Liquid
    Water at 0.1 MPa; IAPWS R6-95(2018).

    >>> at_20 = Water().properties(293.15)
    >>> round(float(at_20.density), 1), round(float(at_20.dynamic_viscosity) * 1e3, 3)
    (998.2, 1.002)
    """

    name = "water"
    source = "IAPWS SR6-08 and R6-95"
    lowest_temperature = 1.0 + ZERO_CELSIUS_K
    highest_temperature = 95.0 + ZERO_CELSIUS_K
    lowest_accurate_temperature = lowest_temperature
    highest_accurate_temperature = highest_temperature

    # In (T - 323.15 K) / 50 K.
    _density_fit = np.polynomial.Polynomial(
        [988.032856, -22.6062632, -8.15035956, 1.51074266, -0.765143795, 0.354202374]
    )
    _heat_capacity_fit = np.polynomial.Polynomial(
        [4181.32876906, 14.00332935, 21.02491084, -5.90578129, 9.4193708, -9.69734781, 5.86256731]
    )
    _enthalpy_fit = 50.0 * _heat_capacity_fit.integ(lbnd=-1.0)

    @staticmethod
    def _scaled(temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return (temperature - 323.15) / 50.0

    def _density(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._density_fit(self._scaled(temperature))

    def _dynamic_viscosity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        ratio = temperature / 300.0
        series = 280.68 * ratio**-1.9 + 511.45 * ratio**-7.7 + 61.131 * ratio**-19.6 + 0.45903 * ratio**-40.0
        return 1.0e-6 * series

    def _specific_heat_capacity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._heat_capacity_fit(self._scaled(temperature))

    def _thermal_conductivity(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        ratio = temperature / 300.0
        return 1.6630 * ratio**-1.15 - 1.7781 * ratio**-3.4 + 1.1567 * ratio**-6.0 - 0.432115 * ratio**-7.6

    def _specific_enthalpy(self, temperature: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._enthalpy_fit(self._scaled(temperature))


@dataclass(frozen=True)
class UserCoolant(Coolant):
    """A liquid from a data sheet: two viscosities, the rest constant or linear.

    Attributes
    ----------
    name : str
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


_BUILT_IN = {fluid.name: fluid for fluid in (OilIsoVg32(), Water())}

COOLANT_NAMES = tuple(_BUILT_IN)


def coolant_by_name(name: str) -> Coolant:
    """Coolant that ships with the program.

    Raises
    ------
    OutOfValidityError
        Unknown name; the message lists the known ones.

    >>> coolant_by_name("iso_vg_32").name
    'iso_vg_32'
    """
    if name not in _BUILT_IN:
        raise OutOfValidityError("coolant", f'"{name}" is not known.', did_you_mean(name, COOLANT_NAMES))
    return _BUILT_IN[name]
