"""Properties of a coolant over temperature, within the range of their source."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.units import ZERO_CELSIUS_K
from spindle_fem.validity import CodedWarning, range_fault, require_range

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
            how_to_fix="Keep the coolant in this range, or register one known further (docs/python.md).",
        )
        return kelvin


def coolant_by_name(name: str) -> Coolant:
    """Coolant of ``coolant.fluid``.

    Raises
    ------
    OutOfValidityError
        Unknown name; the message lists the known ones.

    >>> coolant_by_name("iso_vg_32").name
    'iso_vg_32'
    """
    return COOLANTS[name]
