"""``summary.json``: the result as plain numbers in the units users read."""

from __future__ import annotations

import importlib.metadata
import math
import platform
import resource
import sys
from typing import TYPE_CHECKING, Any

from spindle_fem.operation.source_terms import SOURCE_PREFIX
from spindle_fem.results.thermal_result import (
    BearingResult,
    CircuitResult,
    CoolantResult,
    Equilibrium,
    ThermalResult,
)
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from collections.abc import Mapping

    from spindle_fem.model.elastic.machine_growth import Growth, Side
    from spindle_fem.model.elastic.solid_growth import SolidGrowth

SUMMARY_SCHEMA = "spindle-fem/summary/1"
# The ring of a bearing that sits on each of the two.
RING_ON = {"shaft": "inner", "housing": "outer"}
_PACKAGES = (
    "spindle-fem",
    "numpy",
    "scipy",
    "scikit-fem",
    "gmsh",
    "pygmsh",
    "numba",
    "pyvista",
    "vtk",
    "pydantic",
)


def package_versions() -> dict[str, str]:
    """Versions of Python and of the packages that make a result."""
    versions = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = "not installed"
    return versions


def peak_memory_MB() -> float:  # noqa: N802 - the unit belongs to the name
    """Largest resident memory of this process so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024.0**2 if sys.platform == "darwin" else 1024.0)


def build_summary(
    result: ThermalResult,
    wall_time_s: float,
    peak_rss_MB: float,
    *,
    with_shape: bool = True,
    with_rings: bool = True,
) -> dict[str, Any]:
    """Dictionary written as ``summary.json``; ``nan`` becomes ``None``.

    ``with_shape``: growth and displacements too, which take as long as a small machine's solve;
    ``with_rings``: of growth also how rings move and turn, for which every body is deformed.
    """
    growth = result.growth if with_shape else None
    displacements = result.displacements if with_shape else {}
    maximum_mm = [round(float(value) * 1e3, 3) for value in result.temperature_maximum_at]
    return _without_nan(
        {
            "schema": SUMMARY_SCHEMA,
            "machine": result.spec.name,
            "versions": package_versions(),
            "wall_time_s": wall_time_s,
            "peak_rss_MB": peak_rss_MB,
            "timings_s": dict(result.timings),
            "mesh": {
                "nodes": result.n_unknowns,
                "elements": result.mesh.n_elements,
                "order": result.order,
                "min_quality": result.mesh.min_quality,
                "area_error_relative": dict(result.area_error_relative),
                "volume_error_relative": dict(result.volume_error_relative),
                "digest": result.mesh.digest,
            },
            "energy": {
                "heat_in_W": result.energy.heat_in,
                "heat_in_by_W": dict(result.energy.heat_in_by),
                "heat_out_W": dict(result.energy.heat_out),
                "imbalance_relative": result.energy.imbalance_relative,
            },
            "sources": {
                source.name: result.energy.heat_in_by.get(SOURCE_PREFIX + source.name, 0.0)
                for source in result.spec.source
            },
            "bearings": {name: _bearing(bearing) for name, bearing in result.bearings.items()},
            "coolant": None if result.coolant is None else _coolant(result.coolant),
            "circuits": {name: _circuit(circuit) for name, circuit in result.circuits.items()},
            "probes": {name: value - ZERO_CELSIUS_K for name, value in result.probes.items()},
            "temperature": {
                "min_degC": result.temperature_minimum - ZERO_CELSIUS_K,
                "max_degC": result.temperature_maximum - ZERO_CELSIUS_K,
                "max_at_mm": maximum_mm,
            },
            **({} if growth is None else _growth(result, growth, with_rings)),
            "displacements": {name: 1e6 * value for name, value in displacements.items()},
            **({} if result.equilibrium is None else {"equilibrium": _equilibrium(result.equilibrium)}),
            "joints": {name: {"heat_W": value} for name, value in result.heat_flows.items()},
            "iterations": dict(result.iterations),
            "checks": [
                {
                    "name": check.name,
                    "value": check.value,
                    "limit": check.limit,
                    "unit": check.unit,
                    "passed": check.passed,
                    "explanation": check.explanation,
                }
                for check in result.checks
            ],
            "warnings": [{"code": warning.code, "text": warning.text} for warning in result.warnings],
            **result.extra,
        }
    )


def _bearing(bearing: BearingResult) -> dict[str, Any]:
    return {
        "heat_W": bearing.heat,
        "terms_W": dict(bearing.terms),
        "heat_to_W": dict(bearing.heat_to),
        "temperature_inner_degC": bearing.temperature_inner - ZERO_CELSIUS_K,
        "temperature_outer_degC": bearing.temperature_outer - ZERO_CELSIUS_K,
        "temperature_ball_degC": bearing.temperature_ball - ZERO_CELSIUS_K,
        "ring_difference_K": bearing.ring_difference,
        "contact_angle_inner_deg": math.degrees(bearing.contact_angle_inner),
        "contact_angle_outer_deg": math.degrees(bearing.contact_angle_outer),
        "preload_N": bearing.preload,
        "axial_load_N": bearing.axial_load,
        "axial_stiffness_N_um": bearing.axial_stiffness * 1e-6,
        "film_um": bearing.film_thickness * 1e6,
        "lambda": bearing.film_thickness_ratio,
        "contact_pressure_GPa": bearing.contact_pressure * 1e-9,
    }


def _coolant(coolant: CoolantResult) -> dict[str, Any]:
    return {
        "flow_m3_s": coolant.flow,
        "asked_flow_m3_s": coolant.asked_flow,
        "inlet_degC": coolant.inlet_temperature - ZERO_CELSIUS_K,
        "outlet_degC": coolant.outlet_temperature - ZERO_CELSIUS_K,
        "heat_W": coolant.heat,
        "reynolds": coolant.reynolds,
        "prandtl": coolant.prandtl,
        "velocity_m_s": coolant.velocity,
        "regime": coolant.regime,
        "source": coolant.source,
        "in_range": coolant.in_range,
        "film_coefficient_W_m2K": {
            "value": coolant.mean_film_coefficient,
            "low": coolant.mean_film_low,
            "high": coolant.mean_film_high,
        },
        "pressure_drop_Pa": coolant.pressure_drop,
        "ports_pressure_drop_Pa": coolant.ports_pressure_drop,
        "pumping_power_W": coolant.pumping_power,
        "wetted_area_m2": coolant.wetted_area,
        "length_m": coolant.length,
        "hydraulic_diameter_m": coolant.hydraulic_diameter,
    }


def _circuit(circuit: CircuitResult) -> dict[str, Any]:
    return {
        "flow_m3_s": circuit.flow,
        "inlet_degC": circuit.inlet_temperature - ZERO_CELSIUS_K,
        "outlet_degC": circuit.outlet_temperature - ZERO_CELSIUS_K,
        "heat_W": circuit.heat,
        "reynolds": circuit.reynolds,
        "prandtl": circuit.prandtl,
        "velocity_m_s": circuit.velocity,
        "regime": circuit.regime,
        "source": circuit.source,
        "film_coefficient_W_m2K": circuit.film_coefficient,
        "pressure_drop_Pa": circuit.pressure_drop,
        "wetted_area_m2": circuit.wetted_area,
    }


def _growth(result: ThermalResult, growth: Growth, with_rings: bool) -> dict[str, Any]:
    """Blocks ``growth`` and ``fits``, lengths in µm."""
    solid = result.solid_growth
    fits: dict[str, dict[str, dict[str, float]]] = {}
    for (bearing, side), state in growth.seats.items():
        fits.setdefault(bearing, {})[side] = {
            "pressure_MPa": 1e-6 * state.pressure,
            "gap_um": 1e6 * state.gap,
        }
    seats = {key: state.seat_growth for key, state in growth.seats.items()}
    raceways = {key: state.raceway_growth for key, state in growth.seats.items()}
    rings: dict[str, dict[str, float]] = {}
    for (bearing, side), motion in result.raceway_motions.items() if with_rings else ():
        rings.setdefault(bearing, {}).update(
            {
                f"{RING_ON[side]}_axial_um": 1e6 * motion.axial,
                f"{RING_ON[side]}_twist_urad": 1e6 * motion.twist,
            }
        )
    return {
        "growth": {
            **_shape(growth, seats, raceways),
            "rings": rings,
            "spacers": {name: {"length_um": 1e6 * value} for name, value in growth.spacers.items()},
            **({} if solid is None else {"three_dimensional": _solid_shape(solid)}),
        },
        "fits": fits,
    }


def _shape(
    growth: Growth | SolidGrowth,
    seats: Mapping[tuple[str, Side], float],
    raceways: Mapping[tuple[str, Side], float],
) -> dict[str, Any]:
    """Motions of the nose, and growth of seats and raceways by bearing."""
    up, across = growth.nose_radial or (math.nan, math.nan)
    tilt_up, tilt_across = growth.nose_tilt or (math.nan, math.nan)
    found: dict[str, Any] = {
        "nose_axial_um": None if growth.nose_axial is None else 1e6 * growth.nose_axial,
        "nose_radial_up_um": 1e6 * up,
        "nose_radial_across_um": 1e6 * across,
        "nose_tilt_up_urad": 1e6 * tilt_up,
        "nose_tilt_across_urad": 1e6 * tilt_across,
        "raceways": {},
        "seats": {},
    }
    for (bearing, side), value in raceways.items():
        found["raceways"].setdefault(bearing, {})[f"{RING_ON[side]}_um"] = 1e6 * value
    for (bearing, side), value in seats.items():
        found["seats"].setdefault(bearing, {})[f"{side}_um"] = 1e6 * value
    return found


def _solid_shape(solid: SolidGrowth) -> dict[str, Any]:
    read = {name: 1e6 * value for name, value in solid.displacements.items()}
    return {**_shape(solid, solid.seats, solid.raceways), "displacements": read}


def _equilibrium(found: Equilibrium) -> dict[str, Any]:
    def rpm(speed: float | None) -> float | None:
        return None if speed is None else speed * 30.0 / math.pi

    return {
        "followed": found.followed,
        "preload_ratio": dict(found.preload_ratio),
        "fold_speed_rpm": rpm(found.fold_speed),
        "searched_to_rpm": rpm(found.searched_to),
        "limits": list(found.limits),
    }


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
