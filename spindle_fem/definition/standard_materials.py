"""Solids and greases that a definition may name without giving their values."""

from __future__ import annotations

from typing import Any


def _solid(
    conductivity: float, density: float, capacity: float, modulus: float, poisson: float, expansion: float
) -> dict[str, Any]:
    return {
        "marks": "A",
        "thermal_conductivity": f"{conductivity:g} W/m/K",
        "density": f"{density:g} kg/m**3",
        "specific_heat_capacity": f"{capacity:g} J/kg/K",
        "young_modulus": f"{modulus:g} GPa",
        "poisson_ratio": poisson,
        "thermal_expansion": f"{expansion:g} 1/K",
    }


# Usual values at 20 to 100 °C; grades of one kind differ by some 10 % in conductivity, castings by 20 %.
# Laminations conduct across their sheets a tenth of what they do along: the value is along, that is radially.
MATERIALS: dict[str, dict[str, Any]] = {
    "aluminium_alloy": _solid(170.0, 2700.0, 900.0, 70.0, 0.33, 23.4e-6),
    "bearing_steel": _solid(46.0, 7810.0, 475.0, 206.0, 0.3, 12.5e-6),
    "case_hardening_steel": _solid(44.0, 7850.0, 470.0, 206.0, 0.3, 11.5e-6),
    "cast_iron": _solid(48.0, 7200.0, 500.0, 110.0, 0.26, 10.5e-6),
    "electrical_steel": _solid(28.0, 7650.0, 460.0, 200.0, 0.3, 12.0e-6),
    "silicon_nitride": _solid(28.0, 3240.0, 700.0, 310.0, 0.26, 3.2e-6),
    "steel": _solid(45.0, 7850.0, 470.0, 206.0, 0.3, 12.0e-6),
}

GREASES: dict[str, dict[str, Any]] = {
    "high_speed_grease": {
        "marks": {"default": "A"},
        "name": "synthetic base oil of low viscosity, for high-speed spindle bearings",
        "kinematic_viscosity_40": "22 mm**2/s",
        "kinematic_viscosity_100": "5 mm**2/s",
        "base_oil_density": "920 kg/m**3",
        "pressure_viscosity": "1.6e-8 1/Pa",
    },
    "general_grease": {
        "marks": {"default": "A"},
        "name": "lithium soap with mineral oil of ISO VG 100",
        "kinematic_viscosity_40": "100 mm**2/s",
        "kinematic_viscosity_100": "11 mm**2/s",
        "pressure_viscosity": "2.2e-8 1/Pa",
    },
}

# Typical mineral oils of ISO 3448 grades with a viscosity index of about 100, as coolants of these names.
OILS: dict[str, dict[str, Any]] = {
    f"iso_vg_{grade}": {
        "marks": {"default": "A"},
        "kinematic_viscosity_40": f"{grade} mm**2/s",
        "kinematic_viscosity_100": f"{at_100} mm**2/s",
        "density": f"{density} kg/m**3",
    }
    for grade, at_100, density in (
        (10, 2.6, 850),
        (22, 4.3, 866),
        (32, 5.4, 871),
        (46, 6.8, 877),
        (68, 8.7, 882),
        (100, 11.2, 886),
    )
}
