"""Lubricant: viscosity of temperature and pressure, and the constants of film and friction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.errors import OutOfValidityError, SpecError
from spindle_fem.validity import CodedWarning

CELSIUS_40 = 313.15
CELSIUS_100 = 373.15
ROELANDS_PRESSURE = 5.1e-9
ROELANDS_LOGARITHM = 9.67
_ROELANDS_TEMPERATURE = 138.0
_WALTHER_LOWEST_MM2_S = 2.0
_TRUSTED_RANGE = (273.15, 393.15)
_ALLOWED_RANGE = (233.15, 473.15)


@dataclass(frozen=True, slots=True)
class Lubricant:
    """Grease (or oil) by its base oil at two temperatures.

    Attributes
    ----------
    kinematic_viscosity_40, kinematic_viscosity_100 : float, [m²/s]
        Base oil at 40 and 100 °C.
    density : float, [kg/m³]
        Base oil at 40 °C.
    density_slope : float, [1/K]
        Relative fall of the density with temperature.
    viscosity_law : {"walther", "roelands"}
        Temperature law between the two points (ASTM D341, or eq. 15).
    pressure_viscosity : float or None, [1/Pa]
        At 40 °C; None: what Roelands's pressure exponent 0.68 implies.
    limiting_shear_ratio : float, [-]
        Limiting shear stress over pressure at 40 °C, 0.03-0.1.
    limiting_shear_slope : float, [1/K]
        Relative fall of that ratio with temperature.
    asperity_friction : float, [-]
        Friction coefficient of touching asperities, 0.1-0.15.
    thermal_conductivity : float, [W/(m K)]
    film_starvation : float, [-]
        Film over the flooded film of the base oil (0.5-0.7 in aged grease).
    path_fill : float, [-]
        Share of the balls' path filled by lubricant, 0-0.02 once channelled;
        not the fill of the free volume.
    temperature_limit : float, [K]
        Above it the grease ages fast: a warning.
    word : {"grease", "oil"}
        For messages.

    Raises
    ------
    SpecError
        Values that are no lubricant.

    >>> nbu15 = Lubricant(21e-6, 4.7e-6, density=990.0)
    >>> round(float(nbu15.kinematic_viscosity(333.15)) * 1e6, 2)
    11.34
    """

    kinematic_viscosity_40: float
    kinematic_viscosity_100: float
    density: float = 890.0
    density_slope: float = 0.0
    viscosity_law: Literal["walther", "roelands"] = "walther"
    pressure_viscosity: float | None = None
    limiting_shear_ratio: float = 0.07
    limiting_shear_slope: float = 0.0
    asperity_friction: float = 0.12
    thermal_conductivity: float = 0.14
    film_starvation: float = 1.0
    path_fill: float = 0.01
    temperature_limit: float = 393.15
    word: Literal["grease", "oil"] = "grease"

    def __post_init__(self) -> None:
        lowest = _WALTHER_LOWEST_MM2_S * 1e-6
        if not lowest <= self.kinematic_viscosity_100 < self.kinematic_viscosity_40 < math.inf:
            raise SpecError(
                "kinematic_viscosity_100",
                f"{self.kinematic_viscosity_100 * 1e6:g} mm²/s at 100 °C against "
                f"{self.kinematic_viscosity_40 * 1e6:g} mm²/s at 40 °C.",
                f"Viscosity must fall with temperature and stay above {_WALTHER_LOWEST_MM2_S:g} mm²/s.",
            )
        if self.viscosity_law not in ("walther", "roelands"):
            raise SpecError(
                "viscosity_law", f"{self.viscosity_law!r} is unknown.", "Allowed: walther, roelands."
            )
        for key, low, high in (
            ("density", 500.0, 2500.0), ("density_slope", 0.0, 2e-3), ("limiting_shear_ratio", 0.005, 0.2),
            ("limiting_shear_slope", 0.0, 2e-2), ("asperity_friction", 0.0, 0.5),
            ("thermal_conductivity", 0.05, 1.0), ("film_starvation", 0.05, 1.0),
            ("path_fill", 0.0, 0.3), ("temperature_limit", 273.15, 700.0),
        ):  # fmt: skip
            value = getattr(self, key)
            if not low <= value <= high:
                raise SpecError(key, f"{key} is {value:g}.", f"Allowed: {low:g} to {high:g}.")
        if self.pressure_viscosity is not None and not 1e-9 <= self.pressure_viscosity <= 1e-7:
            raise SpecError(
                "pressure_viscosity", f"{self.pressure_viscosity:g} 1/Pa.", "Allowed: 1e-9 to 1e-7 1/Pa."
            )

    @property
    def walther_constants(self) -> tuple[float, float]:
        """A and B of log10 log10(ν + 0.7) = A - B log10 T, ν in mm²/s (ASTM D341)."""
        cold = math.log10(math.log10(self.kinematic_viscosity_40 * 1e6 + 0.7))
        hot = math.log10(math.log10(self.kinematic_viscosity_100 * 1e6 + 0.7))
        slope = (cold - hot) / math.log10(CELSIUS_100 / CELSIUS_40)
        return cold + slope * math.log10(CELSIUS_40), slope

    @property
    def roelands_temperature_exponent(self) -> float:
        """S_0 of eq. 15 that meets both given viscosities."""
        cold = math.log(self.kinematic_viscosity_40 * self.density) + ROELANDS_LOGARITHM
        hot = (
            math.log(self.kinematic_viscosity_100 * float(self.oil_density(CELSIUS_100))) + ROELANDS_LOGARITHM
        )
        ratio = (CELSIUS_100 - _ROELANDS_TEMPERATURE) / (CELSIUS_40 - _ROELANDS_TEMPERATURE)
        return -math.log(hot / cold) / math.log(ratio)

    @property
    def roelands_pressure_exponent(self) -> float:
        """Z_R of eq. 15; 0.68 unless a pressure-viscosity coefficient is given."""
        if self.pressure_viscosity is None:
            return 0.68
        logarithm = math.log(self.kinematic_viscosity_40 * self.density) + ROELANDS_LOGARITHM
        return self.pressure_viscosity / (ROELANDS_PRESSURE * logarithm)

    def oil_density(self, temperature: ArrayLike) -> NDArray[np.float64]:
        """Density of the base oil, kg/m³."""
        return self.density * (1.0 - self.density_slope * (np.asarray(temperature, float) - CELSIUS_40))

    def kinematic_viscosity(self, temperature: ArrayLike) -> NDArray[np.float64]:
        """Kinematic viscosity of the base oil at ambient pressure.

        Parameters
        ----------
        temperature : array_like, [K]

        Returns
        -------
        ndarray, [m²/s]

        Raises
        ------
        OutOfValidityError
            Outside -40 to 200 °C, or where the law falls below 2 mm²/s.

        Source: ASTM D341 (ν above 2 mm²/s), or Roelands (1966) as eq. 15.
        """
        kelvin = np.asarray(temperature, float)
        outside = ~((kelvin >= _ALLOWED_RANGE[0]) & (kelvin <= _ALLOWED_RANGE[1]))
        if np.any(outside):
            worst = float(kelvin[outside].flat[0]) if kelvin.ndim else float(kelvin)
            raise OutOfValidityError(
                "lubricant temperature",
                f"{worst - 273.15:.1f} °C lies outside the viscosity fit of this lubricant.",
                f"Allowed: {_ALLOWED_RANGE[0] - 273.15:g} to {_ALLOWED_RANGE[1] - 273.15:g} °C.",
            )
        if self.viscosity_law == "walther":
            constant, slope = self.walther_constants
            viscosity = (10.0 ** (10.0 ** (constant - slope * np.log10(kelvin))) - 0.7) * 1e-6
        else:
            reference = math.log(self.kinematic_viscosity_40 * self.density) + ROELANDS_LOGARITHM
            ratio = (kelvin - _ROELANDS_TEMPERATURE) / (CELSIUS_40 - _ROELANDS_TEMPERATURE)
            exponent = reference * ratio**-self.roelands_temperature_exponent - ROELANDS_LOGARITHM
            viscosity = np.exp(exponent) / self.oil_density(kelvin)
        if np.any(viscosity < _WALTHER_LOWEST_MM2_S * 1e-6):
            raise OutOfValidityError(
                "lubricant temperature",
                f"at {float(np.max(kelvin)) - 273.15:.1f} °C the viscosity fit gives "
                f"{float(np.min(viscosity)) * 1e6:.2f} mm²/s.",
                "Allowed: temperatures at which it stays above 2 mm²/s.",
            )
        return viscosity

    def dynamic_viscosity(self, temperature: ArrayLike) -> NDArray[np.float64]:
        """Dynamic viscosity at ambient pressure, Pa s (temperature in K)."""
        return self.kinematic_viscosity(temperature) * self.oil_density(temperature)

    def viscosity_slope(self, temperature: ArrayLike) -> NDArray[np.float64]:
        """-dη/dT at ambient pressure, Pa s/K."""
        step = 0.05
        kelvin = np.asarray(temperature, float)
        return (self.dynamic_viscosity(kelvin - step) - self.dynamic_viscosity(kelvin + step)) / (2.0 * step)

    def pressure_viscosity_coefficient(self, temperature: ArrayLike) -> NDArray[np.float64]:
        """Pressure-viscosity coefficient at a temperature (K), 1/Pa.

        5.1e-9 Z_R (ln η + 9.67): consistent with the law used in the contact.
        """
        logarithm = np.log(self.dynamic_viscosity(temperature)) + ROELANDS_LOGARITHM
        return ROELANDS_PRESSURE * self.roelands_pressure_exponent * logarithm

    def limiting_shear_ratio_at(self, temperature: ArrayLike) -> NDArray[np.float64]:
        """Limiting shear stress over pressure at a temperature (K), falling exponentially from 40 °C.

        Source: Wikström & Höglund (1994), J. Tribol. 116, 612-620, for the fall; -20 to 110 °C.

        >>> oil = Lubricant(21e-6, 4.7e-6, limiting_shear_ratio=0.05, limiting_shear_slope=0.01)
        >>> oil.limiting_shear_ratio_at([313.15, 323.15]).round(4).tolist()
        [0.05, 0.0452]
        """
        above = np.asarray(temperature, float) - CELSIUS_40
        return self.limiting_shear_ratio * np.exp(-self.limiting_shear_slope * above)

    def temperature_warnings(self, temperature: float, name: str = "bearing") -> tuple[CodedWarning, ...]:
        """Warnings that a temperature (K) earns."""
        warnings = []
        if temperature > self.temperature_limit:
            warnings.append(
                CodedWarning(
                    f"{self.word}_temperature",
                    f"{name}: {temperature - 273.15:.1f} °C is above the {self.word}'s limit of "
                    f"{self.temperature_limit - 273.15:.1f} °C.",
                )
            )
        if not _TRUSTED_RANGE[0] <= temperature <= _TRUSTED_RANGE[1]:
            warnings.append(
                CodedWarning(
                    "viscosity_fit_extrapolated",
                    f"{name}: {temperature - 273.15:.1f} °C is far from the two viscosities given at 40 and "
                    "100 °C (trusted 0 to 120 °C).",
                )
            )
        return tuple(warnings)
