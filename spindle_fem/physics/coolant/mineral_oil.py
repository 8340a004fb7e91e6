"""Mineral hydraulic oil of an ISO viscosity grade: all follows from two viscosities and the density."""

from __future__ import annotations

from spindle_fem.physics.coolant.user_coolant import UserCoolant
from spindle_fem.units import ZERO_CELSIUS_K

# kg/(m³·K); of lubricating oils of any density, α ρ = K1 in ASTM D1250, table 54D.
DENSITY_SLOPE = -0.6278
WATER_DENSITY = 999.0
REFERENCE = 15.0


class MineralOil(UserCoolant):
    """Oil of an ISO viscosity grade.

    Conductivity 0.1172 (1 - 0.00054 t)/s and heat capacity (1685 + 3.39 t)/√s, with t in °C and the
    density s at 15 °C relative to water, hold within 10 % and 4 % for petroleum oils by their source.

    Source: viscosity ISO 3448 at 40 °C and ASTM D341; Cragoe (1929), NBS Miscellaneous Publication 97;
    ASTM D1250, lubricating oils.
    """

    source = "ISO 3448, ASTM D341 and D1250, Cragoe 1929"


def mineral_oil(name: str, density: float, at_40: float, at_100: float) -> MineralOil:
    """Oil from its data sheet, from 0 to 80 °C.

    Parameters
    ----------
    density : float, [kg/m³]
        At 15 °C.
    at_40, at_100 : float, [mm²/s]
        Kinematic viscosity.

    >>> oil = mineral_oil("VG 32", 871.0, 32.0, 5.4)
    >>> at_40 = oil.properties(313.15)
    >>> round(float(at_40.thermal_conductivity), 4), round(float(at_40.specific_heat_capacity))
    (0.1315, 1950)
    """
    relative = density / WATER_DENSITY
    conductivity, heat_capacity = 0.1172 / relative, 1.0 / relative**0.5
    return MineralOil(
        name,
        reference_temperature=REFERENCE + ZERO_CELSIUS_K,
        density=density,
        density_slope=DENSITY_SLOPE,
        specific_heat_capacity=(1685.0 + 3.39 * REFERENCE) * heat_capacity,
        specific_heat_capacity_slope=3.39 * heat_capacity,
        thermal_conductivity=conductivity * (1.0 - 5.4e-4 * REFERENCE),
        thermal_conductivity_slope=-5.4e-4 * conductivity,
        viscosity_temperatures=(40.0 + ZERO_CELSIUS_K, 100.0 + ZERO_CELSIUS_K),
        kinematic_viscosities=(1e-6 * at_40, 1e-6 * at_100),
        lowest_temperature=ZERO_CELSIUS_K,
        highest_temperature=80.0 + ZERO_CELSIUS_K,
    )
