"""Outputs of designs from their projected states: the same paths as in a run's summary."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.reduced.circuit_operators import CircuitWalls
from spindle_fem.model.reduced.coolant_batch import pressure_drops
from spindle_fem.model.reduced.design_inputs import DesignInputs
from spindle_fem.model.reduced.heat_tables import QUANTITIES
from spindle_fem.model.reduced.steady_batch import SteadyBatch
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.channel_cells import cells_of_model
from spindle_fem.operation.coolant_loop import CoolantLoop
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.studies.sweep.outputs import derived_values, value_of
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

REGIMES = ("laminar", "transition", "turbulent")
# Designs whose whole field is made at a time.
FIELDS_AT_ONCE = 64


def values_of(
    model: ThermalModel, inputs: DesignInputs, batch: SteadyBatch, outputs: Sequence[str]
) -> list[dict[str, Any]]:
    """Values of the outputs of every design.

    Parameters
    ----------
    batch : SteadyBatch
        Their states.

    Returns
    -------
    list of mapping of output to value
    """
    number = len(inputs)
    summaries: list[dict[str, Any]] = [{"mesh": dict(model.mesh_numbers)} for _ in range(number)]
    asked = {path.partition(".")[0] for path in outputs}
    if asked & {"bearings", "derived"}:
        _put(summaries, "bearings", _bearings(inputs, batch))
    if asked & {"coolant", "derived"}:
        _put(summaries, "coolant", _coolant(model, inputs, batch))
    if "probes" in asked:
        _put(summaries, "probes", _probes(model, inputs, batch))
    if "energy" in asked:
        _put(summaries, "energy", _energy(model, inputs, batch))
    if "temperature" in asked:
        low, high = extreme_temperatures(model, batch.unknowns, inputs.ambient)
        ends = [
            {"min_degC": float(a) - ZERO_CELSIUS_K, "max_degC": float(b) - ZERO_CELSIUS_K}
            for a, b in zip(low, high, strict=True)
        ]
        _put(summaries, "temperature", ends)
    found = []
    for summary, spec in zip(summaries, inputs.specs, strict=True):
        if "derived" in asked:
            summary["derived"] = derived_values(summary, spec)
        found.append({path: _without_nan(value_of(summary, path)) for path in outputs})
    return found


def _put(summaries: list[dict[str, Any]], name: str, parts: Sequence[Any] | Iterator[Any]) -> None:
    for summary, part in zip(summaries, parts, strict=True):
        summary[name] = part


def _without_nan(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def extreme_temperatures(model: ThermalModel, unknowns: Array, reference: Array) -> tuple[Array, Array]:
    """Lowest and highest temperature of any node of the mesh, (n,) K each.

    Parameters
    ----------
    unknowns : (n, r) ndarray
    reference : (n,) ndarray, [K]
        A temperature near the field's: single precision takes the rise above it.
    """
    low, high = np.empty(len(unknowns)), np.empty(len(unknowns))
    rises = (unknowns - reference[:, None] * model.one).astype(np.float32)
    for first in range(0, len(unknowns), FIELDS_AT_ONCE):
        rows = slice(first, first + FIELDS_AT_ONCE)
        field = rises[rows] @ model.nodes
        low[rows], high[rows] = field.min(axis=1), field.max(axis=1)
    return low + reference, high + reference


def _bearings(inputs: DesignInputs, batch: SteadyBatch) -> Iterator[dict[str, Any]]:
    names = [bearing.name for _, bearing in inputs.specs[0].bearings]
    kept = len(QUANTITIES)
    for row in range(len(inputs)):
        found = {}
        for column, name in enumerate(names):
            quantities = batch.bearings[row, column].tolist()
            total, _, _, inner_angle, outer_angle, preload, film, ratio = quantities[:kept]
            inner, outer, ball = (batch.temperatures[row, column] - ZERO_CELSIUS_K).tolist()
            shares = inputs.shares[row].tolist()
            terms = dict(zip(batch.terms[row], quantities[kept:], strict=False))
            found[name] = {
                "heat_W": total,
                "terms_W": {term: value for term, value in terms.items() if not math.isnan(value)},
                "heat_to_W": {
                    place: share * total
                    for place, share in zip(("inner", "outer", "balls"), shares, strict=True)
                },
                "temperature_inner_degC": inner,
                "temperature_outer_degC": outer,
                "temperature_ball_degC": ball,
                "ring_difference_K": inner - outer,
                "contact_angle_inner_deg": math.degrees(inner_angle),
                "contact_angle_outer_deg": math.degrees(outer_angle),
                "preload_N": preload,
                "film_um": film * 1e6,
                "lambda": ratio,
            }
        yield found


def _coolant(
    model: ThermalModel, inputs: DesignInputs, batch: SteadyBatch
) -> Iterator[dict[str, Any] | None]:
    if batch.channel is None:
        yield from (None for _ in inputs.specs)
        return
    spec, field = inputs.specs[0], batch.channel
    loop = CoolantLoop(spec, cells_of_model(model))
    section = loop.section
    properties = coolant_by_name(spec.coolant.fluid).properties(inputs.inlet)
    velocity = section.velocity(inputs.flow)
    reynolds = velocity * section.hydraulic_diameter / properties.kinematic_viscosity
    films = [mean_film(model, field.film * ratio) for ratio in (1.0, *_band(field))]
    outlet = field.march.outlet_temperature.mean(axis=1)
    order = np.array(REGIMES)
    regime = np.asarray(field.channel.film.regime)
    level = sum((regime == name) * number for number, name in enumerate(REGIMES))
    highest = np.broadcast_to(level.reshape(len(level), -1).max(axis=1), len(inputs))
    drops = pressure_drops(loop, inputs)
    for row in range(len(inputs)):
        yield {
            "flow_m3_s": float(inputs.flow[row]),
            "asked_flow_m3_s": inputs.specs[row].coolant.flow,
            "inlet_degC": float(inputs.inlet[row]) - ZERO_CELSIUS_K,
            "outlet_degC": float(outlet[row]) - ZERO_CELSIUS_K,
            "heat_W": float(field.enthalpy_rise[row]),
            "reynolds": float(reynolds[row]),
            "prandtl": float(properties.prandtl[row]),
            "velocity_m_s": float(velocity[row]),
            "regime": str(order[highest[row]]),
            "film_coefficient_W_m2K": {
                end: float(film[row]) for end, film in zip(("value", "low", "high"), films, strict=True)
            },
            "pressure_drop_Pa": drops[row].total,
            "pumping_power_W": drops[row].pumping_power,
            "wetted_area_m2": float(model.cell_area.sum()),
            "length_m": section.length,
            "hydraulic_diameter_m": section.hydraulic_diameter,
        }


def mean_film(model: ThermalModel, film: Array) -> Array:
    """Area mean over the channel without its ports, (n,) W/(m²·K)."""
    weight = np.where(model.cell_is_port, 0.0, model.cell_area)
    return (film * weight).sum(axis=(1, 2)) / weight.sum()


def _band(field: Any) -> tuple[Array, Array]:
    """Low and high film over the film, for every cell."""
    value = np.asarray(field.channel.film.value)
    return np.asarray(field.channel.film.low) / value, np.asarray(field.channel.film.high) / value


def band_ratios(field: Any) -> tuple[Array, Array]:
    """Low and high film over the film along the channel, (n, n_along) each, as the first start has them."""
    shape = field.film.shape
    return tuple(np.broadcast_to(ratio, shape)[:, 0] for ratio in _band(field))


def _probes(model: ThermalModel, inputs: DesignInputs, batch: SteadyBatch) -> Iterator[Mapping[str, float]]:
    readings = batch.unknowns @ model.probes.T
    for row in range(len(inputs)):
        found = dict(zip(model.probe_names, (readings[row] - ZERO_CELSIUS_K).tolist(), strict=True))
        for probe in inputs.specs[0].probe:
            if probe.kind == "coolant_outlet":
                found[probe.name] = float(batch.channel.march.outlet_temperature[row].mean()) - ZERO_CELSIUS_K
            elif probe.kind == "circuit_outlet":
                film = next(film for film in inputs.specs[row].circuits if film.name == probe.circuit)
                walls = CircuitWalls(model, film)
                maps = walls.maps(film, batch.coefficients[row, walls.rows])
                outlet = maps.outlet @ batch.unknowns[row] + maps.outlet_inlet * film.inlet_temperature
                found[probe.name] = float(outlet) - ZERO_CELSIUS_K
        yield found


def _energy(model: ThermalModel, inputs: DesignInputs, batch: SteadyBatch) -> Iterator[dict[str, Any]]:
    surfaces = [name.removeprefix("film.") for name in model.fluid_names]
    columns = [model.coefficient_names.index(name) for name in model.fluid_names]
    area = model.fluid_load @ model.one
    means = batch.unknowns @ np.array([model.place(name) for name in surfaces]).reshape(-1, model.size).T
    out = batch.coefficients[:, columns] * area * (means - inputs.fluid)
    for number, film in enumerate(inputs.specs[0].circuits):
        walls, places = CircuitWalls(model, film), [surfaces.index(name) for name in film.surface]
        for row, spec in enumerate(inputs.specs):
            coefficients = batch.coefficients[row, walls.rows]
            out[row, places] = walls.heat(spec.circuits[number], coefficients, batch.unknowns[row])
    heat = batch.bearings[:, :, QUANTITIES.index("total")].sum(axis=1)
    wall = f"{inputs.specs[0].channel.part}.channel_wall" if batch.channel is not None else ""
    for row in range(len(inputs)):
        leaves = dict(zip(surfaces, out[row].tolist(), strict=True))
        if wall:
            leaves[wall] = float(batch.channel.march.heat[row][:, ~model.cell_is_port].sum())
        yield {"heat_in_W": float(heat[row]), "heat_out_W": leaves}
