"""Tables and keys of a bearing file, and how each is read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.physics.bearings.bearing_geometry import select_orientations
from spindle_fem.physics.bearings.bearing_kinds import BEARING_KINDS
from spindle_fem.physics.bearings.heat_model import friction_model_names
from spindle_fem.units import to_si

Reader = Callable[[Any, str], Any]


def _quantity(unit: str, kind: str = "quantity") -> Reader:
    return lambda value, where: to_si(value, unit, where=where, kind=kind)


def _text(*allowed: str, names: Callable[[], tuple[str, ...]] | None = None) -> Reader:
    def read(value: Any, where: str) -> str:
        known = names() if names is not None else allowed
        if not isinstance(value, str) or (known and value not in known):
            raise SpecError(where, f"{value!r} is not allowed.", did_you_mean(str(value), known))
        return value

    return read


def _count(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise SpecError(where, f"{value!r} is not a whole number.", "Allowed: a whole number from 3.")
    return value


def _row(value: Any, where: str) -> tuple[int, ...]:
    if not isinstance(value, str | list):
        raise SpecError(
            where, f"{value!r} is no arrangement.", 'Write a name such as "TBT" or a list of 1 and -1.'
        )
    return select_orientations(value, where)


_LENGTH, _FORCE, _PRESSURE, _NUMBER = _quantity("m"), _quantity("N"), _quantity("Pa"), _quantity("")
_TEMPERATURE = _quantity("K", "temperature")
GEOMETRY: dict[str, Reader] = {
    "ball_diameter": _LENGTH,
    "ball_count": _count,
    "pitch_diameter": _LENGTH,
    "contact_angle": _quantity("rad"),
    "groove_curvature_inner": _NUMBER,
    "groove_curvature_outer": _NUMBER,
    "young_modulus": _PRESSURE,
    "poisson_ratio": _NUMBER,
    "density": _quantity("kg/m**3"),
    "ring_density": _quantity("kg/m**3"),
    "ball_young_modulus": _PRESSURE,
    "ball_poisson_ratio": _NUMBER,
    "bore_diameter": _LENGTH,
    "outer_diameter": _LENGTH,
    "width": _LENGTH,
    "shoulder_angle": _quantity("rad"),
    "static_load_rating": _FORCE,
    "dynamic_load_rating": _FORCE,
    "kind": _text(names=lambda: tuple(BEARING_KINDS)),
    "radial_clearance": _LENGTH,
    "seal_moment": _quantity("N*m"),
}
CAGE: dict[str, Reader] = {
    "land_diameter": _LENGTH,
    "land_width": _LENGTH,
    "clearance": _LENGTH,
    "land": _text("inner", "outer"),
}
MOUNTING: dict[str, Reader] = {
    "arrangement": _row,
    "preload": _FORCE,
    "preload_kind": _text("rigid", "spring"),
    "spacing": _LENGTH,
    "roughness_raceway": _LENGTH,
    "roughness_ball": _LENGTH,
}
FIT: dict[str, Reader] = {
    "inner_interference": _LENGTH,
    "outer_clearance": _LENGTH,
    "housing_outer_diameter": _LENGTH,
    "shaft_bore_diameter": _LENGTH,
    "inner_ring_outer_diameter": _LENGTH,
    "outer_ring_inner_diameter": _LENGTH,
    "ring_density": _quantity("kg/m**3"),
    "housing_young_modulus": _PRESSURE,
    "housing_poisson_ratio": _NUMBER,
    "housing_thermal_expansion": _quantity("1/K"),
}
HOUSING_FIELDS = {
    "housing_young_modulus": "young_modulus",
    "housing_poisson_ratio": "poisson_ratio",
    "housing_thermal_expansion": "thermal_expansion",
}
TEMPERATURES: dict[str, Reader] = dict.fromkeys(
    ("assembly", "inner_ring", "outer_ring", "ball", "shaft", "housing"), _TEMPERATURE
)
OPERATION: dict[str, Reader] = {
    "speed": _quantity("rad/s"),
    "axial_load": _FORCE,
    "radial_load": _FORCE,
    "moment": _quantity("N*m"),
    "temperature": _TEMPERATURE,
    "raceway_control": _text("outer", "inner", "equilibrium"),
}
LUBRICANT: dict[str, Reader] = {
    "name": _text(),
    "kinematic_viscosity_40": _quantity("m**2/s"),
    "kinematic_viscosity_100": _quantity("m**2/s"),
    "base_oil_density": _quantity("kg/m**3"),
    "density_slope": _quantity("1/K"),
    "viscosity_law": _text("walther", "roelands"),
    "pressure_viscosity": _quantity("1/Pa"),
    "limiting_shear_ratio": _NUMBER,
    "limiting_shear_slope": _quantity("1/K"),
    "asperity_friction": _NUMBER,
    "thermal_conductivity": _quantity("W/(m*K)"),
    "film_starvation": _NUMBER,
    "path_fill": _NUMBER,
    "temperature_limit": _TEMPERATURE,
}
HEAT: dict[str, Reader] = {
    "model": _text(names=friction_model_names),
    "palmgren_f0": _NUMBER,
    "skf_mu_ehl": _NUMBER,
    "hysteresis_loss": _NUMBER,
}
REQUIRED = {
    "bearing": tuple(GEOMETRY)[:6],
    "operation": ("speed", "axial_load"),
    "fit": ("inner_interference", "outer_clearance", "housing_outer_diameter"),
    "temperatures": ("assembly",),
    "lubricant": ("kinematic_viscosity_40", "kinematic_viscosity_100"),
    "heat": (),
    "cage": ("land_diameter", "land_width", "clearance"),
}
TABLES = {
    "bearing": GEOMETRY | MOUNTING,
    "cage": CAGE,
    "fit": FIT,
    "operation": OPERATION,
    "temperatures": TEMPERATURES,
    "lubricant": LUBRICANT,
    "heat": HEAT,
}
HEAT_FIELDS = {"model": "level", "skf_mu_ehl": "skf_friction_ehl"}
