"""Outputs that a study may request of a solved design: dotted paths into the summary, with their units."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.schema import split_name
from spindle_fem.errors import SpecError, UnknownKeyError
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.elastic.machine_bodies import carries_rings
from spindle_fem.units import ZERO_CELSIUS_K, to_si


@dataclass(frozen=True, slots=True)
class OutputUnit:
    """Unit of a number of the summary.

    Attributes
    ----------
    text : str
        For people.
    si : str
        What a limit must convert to, as for :func:`spindle_fem.units.to_si`.
    from_si : callable
        Number of the summary from the SI value.
    """

    text: str
    si: str
    kind: str = "quantity"
    from_si: Callable[[float], float] = float


_PURE = OutputUnit("", "")
_CELSIUS = OutputUnit("°C", "K", "temperature", lambda kelvin: kelvin - ZERO_CELSIUS_K)
# Endings of the summary's keys, longest first.
_ENDINGS: dict[str, OutputUnit] = {
    "_N_um": OutputUnit("N/µm", "N/m", from_si=lambda stiffness: 1e-6 * stiffness),
    "_W_m2K": OutputUnit("W/(m²·K)", "W/m**2/K"),
    "_K_per_m": OutputUnit("K/m", "K/m"),
    "_m3_s": OutputUnit("m³/s", "m**3/s"),
    "_m_s": OutputUnit("m/s", "m/s"),
    "_degC": _CELSIUS,
    "_deg": OutputUnit("°", "rad", from_si=math.degrees),
    "_urad": OutputUnit("µrad", "rad", from_si=lambda radian: 1e6 * radian),
    "_um": OutputUnit("µm", "m", from_si=lambda metre: 1e6 * metre),
    "_m2": OutputUnit("m²", "m**2"),
    "_Pa": OutputUnit("Pa", "Pa"),
    "_W": OutputUnit("W", "W"),
    "_N": OutputUnit("N", "N"),
    "_K": OutputUnit("K", "K", "temperature_difference"),
    "_m": OutputUnit("m", "m"),
}

_BEARING = (
    "heat_W", "heat_to_W.inner", "heat_to_W.outer", "heat_to_W.balls", "temperature_inner_degC",
    "temperature_outer_degC", "temperature_ball_degC", "ring_difference_K", "contact_angle_inner_deg",
    "contact_angle_outer_deg", "preload_N", "film_um", "lambda",
)  # fmt: skip
_COOLANT = (
    "flow_m3_s", "asked_flow_m3_s", "inlet_degC", "outlet_degC", "heat_W", "reynolds", "prandtl",
    "velocity_m_s", "regime",
    "film_coefficient_W_m2K.value", "film_coefficient_W_m2K.low", "film_coefficient_W_m2K.high",
    "pressure_drop_Pa", "pumping_power_W", "wetted_area_m2", "length_m", "hydraulic_diameter_m",
)  # fmt: skip
_CIRCUIT = (
    "flow_m3_s", "inlet_degC", "outlet_degC", "heat_W", "reynolds", "prandtl", "velocity_m_s",
    "film_coefficient_W_m2K", "pressure_drop_Pa", "wetted_area_m2",
)  # fmt: skip
_GENERAL = (
    "temperature.min_degC", "temperature.max_degC", "energy.heat_in_W", "energy.imbalance_relative",
    "mesh.nodes", "mesh.elements", "mesh.min_quality",
)  # fmt: skip
# From the numbers above; ``derived_values`` explains each.
_OF_BEARINGS = (
    "derived.largest_ring_difference_K",
    "derived.axial_difference_K",
    "derived.axial_gradient_K_per_m",
)
COOLER_HEAT = "derived.cooler_heat_W"
# How a ring moves and turns beside its raceway's growth.
_RING = ("_axial_um", "_twist_urad")
# How the nose bends aside, where a machine has two sets of bearings.
_NOSE_ASIDE = ("radial_up_um", "radial_across_um", "tilt_up_urad", "tilt_across_urad")
# Of each bearing and its set; only full solves have them.
STIFFNESS = ".axial_stiffness_N_um"
AXIAL_LOAD = ".axial_load_N"
# Summary blocks, and one number, that only a solve of the whole field has.
_ONLY_FULL = ("circuits.", "growth.", "displacements.", "equilibrium.", "energy.imbalance_relative")
# Outputs that are words, which no limit or objective can use.
WORDS = frozenset({"coolant.regime"})


def output_paths(spec: MachineSpec) -> tuple[str, ...]:
    """Every path that a study of this machine may name, without solving it.

    Terms of the bearing heat (``bearings.F1.terms_W.cage``) depend on the heat
    model; those are accepted by :func:`require_outputs` for any term name.
    """
    return tuple(_paths(spec))


def only_full(path: str) -> bool:
    """Whether only full solves have an output.

    >>> only_full("growth.nose_axial_um"), only_full("probes.SP01")
    (True, False)
    """
    return path.startswith(_ONLY_FULL) or path.endswith((STIFFNESS, AXIAL_LOAD))


def of_shape(path: str) -> bool:
    """Whether an output needs the elastic bodies of a solved machine."""
    return path.startswith(("growth.", "displacements."))


def of_rings(path: str) -> bool:
    """Whether an output needs the deformed shapes of these bodies."""
    return path.startswith("growth.rings.")


def _paths(spec: MachineSpec) -> Iterator[str]:
    yield from _GENERAL
    names = [bearing.name for _, bearing in spec.bearings]
    for name in names:
        yield from (f"bearings.{name}.{key}" for key in _BEARING)
    if names:
        yield from _OF_BEARINGS
    if spec.channel is not None:
        yield from (f"coolant.{key}" for key in _COOLANT)
        yield COOLER_HEAT
    for circuit in spec.circuits:
        yield from (f"circuits.{circuit.name}.{key}" for key in _CIRCUIT)
    yield from (f"probes.{probe.name}" for probe in spec.probe)
    cooled = [surface for film in spec.film for surface in film.surface]
    if spec.channel is not None:
        cooled.append(f"{spec.channel.part}.channel_wall")
    yield from (f"energy.heat_out_W.{surface}" for surface in cooled)
    if carries_rings(spec):
        if Layout(spec, set()).flange_ends() is not None:
            yield "growth.nose_axial_um"
            if len(spec.bearing_set) > 1:
                yield from (f"growth.nose_{key}" for key in _NOSE_ASIDE)
        for name in names:
            for ring in ("inner", "outer"):
                yield f"growth.raceways.{name}.{ring}_um"
                yield from (f"growth.rings.{name}.{ring}{key}" for key in _RING)
            yield from (f"growth.seats.{name}.{side}_um" for side in ("shaft", "housing"))
        spacers = (part.name for part in spec.part if Layout(spec, set()).is_spacer(part))
        yield from (f"growth.spacers.{name}.length_um" for name in spacers)
    yield from (f"displacements.{sensor.name}" for sensor in spec.displacement_sensor)
    for group in spec.bearing_set if spec.heat.model != "table" else ():
        for bearing in group.bearing:
            if bearing.takes_thrust is not None:
                yield f"bearings.{bearing.name}{AXIAL_LOAD}"
        if group.preload > 0.0:
            yield from (f"equilibrium.preload_ratio.{bearing.name}" for bearing in group.bearing)
            yield from (f"bearings.{bearing.name}{STIFFNESS}" for bearing in group.bearing)


def output_fault(path: str, spec: MachineSpec, where: str) -> UnknownKeyError | None:
    """Fault of a path that leads to nothing, None for a sound one."""
    allowed = output_paths(spec)
    if path in allowed:
        return None
    for _, bearing in spec.bearings:
        stem = f"bearings.{bearing.name}.terms_W."
        if path.startswith(stem) and path != stem and "." not in path[len(stem) :]:
            return None
    near, *others = difflib.get_close_matches(path, allowed, n=4, cutoff=0.0)
    fix = f'Did you mean "{near}"? Also near: {", ".join(others)}; see docs/design_studies.md.'
    return UnknownKeyError(where, f'there is no output "{path}".', fix)


def unit_of(path: str) -> OutputUnit:
    """Unit of an output.

    >>> [unit_of(path).text for path in ("bearings.F2.ring_difference_K", "probes.SP01", "coolant.reynolds")]
    ['K', '°C', '']
    """
    if path.startswith("probes."):
        return _CELSIUS
    if path.startswith("displacements."):
        return _ENDINGS["_um"]
    if path.startswith("energy.heat_out_W."):
        return _ENDINGS["_W"]
    for key in reversed(path.split(".")[-2:]):
        for ending, unit in _ENDINGS.items():
            if key.endswith(ending):
                return unit
    return _PURE


def limit_of(value: Any, path: str, where: str) -> float:
    """A limit with its unit as a number in the unit of an output.

    Raises
    ------
    SpecError
        The output is a word, or the limit has another dimension or no unit.

    >>> limit_of("5 bar", "coolant.pressure_drop_Pa", "constraint[1].max")
    500000.0
    """
    if path in WORDS:
        raise SpecError(where, f'"{path}" is a word, it has no limit.', "Give an output that is a number.")
    unit = unit_of(path)
    return float(f"{unit.from_si(to_si(value, unit.si, where=where, kind=unit.kind)):.13g}")


def value_of(summary: Mapping[str, Any], path: str) -> Any:
    """Value at a path of a summary; names may hold dots.

    Raises
    ------
    SpecError
        Nothing is there: the model that was solved has no such output.

    >>> value_of({"probes": {"SP.01": 21.5}}, "probes.SP.01")
    21.5
    """
    node: Any = summary
    rest = path
    while rest:
        found = split_name(rest, list(node)) if isinstance(node, Mapping) else None
        if found is None:
            raise SpecError(path, "is no output of this design.", "Its model does not give it.")
        node, rest = node[found[0]], found[1]
    return node


def derived_values(summary: Mapping[str, Any], spec: MachineSpec) -> dict[str, float]:
    """Numbers that designers compare and that need several of the summary.

    ``largest_ring_difference_K``: inner less outer ring, of the bearing where
    its size is largest. ``axial_difference_K``: warmest less coldest outer
    ring; ``axial_gradient_K_per_m`` the same over the distance between these
    two bearings. ``cooler_heat_W``: what the coolant carries away, with the
    pumping power, all of which ends as heat in it.
    """
    found: dict[str, float] = {}
    bearings = summary["bearings"]
    if bearings:
        found["largest_ring_difference_K"] = max(
            (item["ring_difference_K"] for item in bearings.values()), key=abs
        )
        middle = {bearing.name: 0.5 * sum(bearing.z) for _, bearing in spec.bearings}
        outer = {name: item["temperature_outer_degC"] for name, item in bearings.items()}
        warmest, coldest = max(outer, key=outer.get), min(outer, key=outer.get)
        difference = outer[warmest] - outer[coldest]
        found["axial_difference_K"] = difference
        distance = abs(middle[warmest] - middle[coldest])
        found["axial_gradient_K_per_m"] = difference / distance if distance > 0.0 else 0.0
    coolant = summary["coolant"]
    if coolant is not None:
        in_enthalpy = spec.coolant.pumping_heat
        found["cooler_heat_W"] = coolant["heat_W"] + (0.0 if in_enthalpy else coolant["pumping_power_W"])
    return found
