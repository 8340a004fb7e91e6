"""Liquid water at 0.1 MPa, by the formulas of IAPWS."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.properties import Coolant
from spindle_fem.units import ZERO_CELSIUS_K


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


COOLANTS.add(Water.name, Water())
