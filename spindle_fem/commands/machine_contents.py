"""What a machine with geometry is made of, as ``spindle-fem check`` lists it: rows of name and detail."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from spindle_fem.machine.geometry.assembly import REMAINING, AssemblyGeometry
from spindle_fem.machine.geometry.coolant_path import section_of
from spindle_fem.machine.geometry.joint_groups import group_of_contacts
from spindle_fem.operation.circuits import duct_flow
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.radial_loads import radial_loads
from spindle_fem.recordings.source_heat import source_heat
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from spindle_fem.definition.machine_spec import BearingSet, HeatSource, MachineSpec
    from spindle_fem.machine.geometry.channel_geometry import ChannelGeometry
    from spindle_fem.machine.geometry.faces import MeridianEdge


def contents_of(spec: MachineSpec, assembly: AssemblyGeometry) -> dict[str, list[dict[str, Any]]]:
    """Lists of a sound machine by name, in the order in which they are shown."""
    groups = group_of_contacts(spec, assembly.joint_names)

    def conductance(name: str) -> str:
        value = groups[name].conductance
        return "perfect" if value == "perfect" else f"{groups[name].name}: {value.value:g} W/(m²·K)"

    return {
        "operation": list(_operation_rows(spec)),
        "parts": [
            {
                "name": part.name,
                "detail": f"{'rotating, ' if part.rotating else ''}{len(part.segments)} "
                f"segment{'s' * (len(part.segments) > 1)}",
            }
            for part in assembly.parts
        ],
        "surfaces": [{"name": surface.name, "detail": surface.part} for surface in spec.all_surfaces],
        "adiabatic": list(_adiabatic_rows(assembly)),
        "contacts": [{"name": name, "detail": conductance(name)} for name in assembly.joint_names],
        "probes": [
            {"name": probe.name, "detail": probe.part or probe.circuit or "mixed coolant outlet"}
            for probe in spec.probe
        ],
        "sources": [{"name": source.name, "detail": _source_detail(source, spec)} for source in spec.source],
        "bearing_sets": [{"name": group.name, "detail": _set_detail(group)} for group in spec.bearing_set],
        "channel": [] if assembly.channel is None else list(_channel_rows(spec, assembly.channel)),
        "circuits": list(_circuit_rows(spec)),
        "displacement_sensors": [
            {"name": sensor.name, "detail": sensor.direction} for sensor in spec.displacement_sensor
        ],
        "radial_loads": [
            {"name": name, "detail": f"{force:.0f} N"}
            for name, force in (radial_loads(spec) if spec.radial_load else {}).items()
        ],
    }


def _operation_rows(spec: MachineSpec) -> Iterator[dict[str, str]]:
    """Operating point, in customary units."""
    point, coolant = spec.operation, spec.coolant
    yield {"name": "speed", "detail": f"{point.speed * 30.0 / math.pi:.6g} rpm"}
    yield {"name": "thrust", "detail": f"{point.thrust:.6g} N"}
    yield {"name": "ambient", "detail": f"{point.ambient_temperature - ZERO_CELSIUS_K:.4g} °C"}
    if point.speed_range is not None:
        ends = " to ".join(f"{end * 30.0 / math.pi:.6g}" for end in point.speed_range)
        yield {"name": "speed range", "detail": f"{ends} rpm"}
    if point.load_torque is not None:
        power = point.load_torque * point.speed
        yield {"name": "torque", "detail": f"{point.load_torque:.4g} N m, {power:.4g} W"}
    if coolant is not None:
        stream = _stream_detail(coolant.fluid, coolant.flow, coolant.inlet_temperature)
        yield {"name": "coolant", "detail": stream}


def _stream_detail(fluid: str, flow: float, inlet: float) -> str:
    return f"{fluid}, {6e4 * flow:.4g} L/min at {inlet - ZERO_CELSIUS_K:.4g} °C"


def _adiabatic_rows(assembly: AssemblyGeometry) -> Iterator[dict[str, Any]]:
    """Faces of each part that exchange no heat, the largest told."""
    faces: dict[str, list[MeridianEdge]] = defaultdict(list)
    for edge in assembly.edges:
        if edge.name.endswith(f".{REMAINING}"):
            faces[edge.parts[0]].append(edge)
    for part, edges in faces.items():
        edges.sort(key=lambda edge: -edge.area)
        area, places = sum(edge.area for edge in edges), [_place(edge) for edge in edges]
        said = places[0] if len(places) == 1 else f"{len(places)} faces, the largest {places[0]}"
        detail = f"{1e4 * area:.4g} cm²: {said}"
        yield {"name": part, "detail": detail, "area_m2": area, "faces": places}


def _place(edge: MeridianEdge) -> str:
    fixed, along = ("r", "z") if edge.is_cylinder else ("z", "r")
    (at, _), (low, high) = getattr(edge, fixed), getattr(edge, along)
    return f"{edge.facings[0]} {fixed} {1e3 * at:.6g} mm, {along} {1e3 * low:.6g} to {1e3 * high:.6g} mm"


def _channel_rows(spec: MachineSpec, channel: ChannelGeometry) -> Iterator[dict[str, str]]:
    drawn = channel.definition
    kind = f"helical in {drawn.part}, {drawn.turns:g} turns of {1e3 * drawn.pitch:g} mm, {drawn.hand} hand"
    yield {"name": "kind", "detail": kind + (f", {drawn.starts} starts" if drawn.starts > 1 else "")}
    section = f"{1e3 * drawn.width:g} mm wide, {1e3 * drawn.depth:g} mm deep"
    yield {"name": "section", "detail": f"{section}, from r {1e3 * drawn.inner_radius:g} mm"}
    low, high = channel.z_bounds
    yield {"name": "z", "detail": f"{1e3 * low:.4g} to {1e3 * high:.4g} mm"}
    yield {"name": "length", "detail": f"{section_of(spec.channel).length:.4g} m"}
    yield {"name": "wetted area", "detail": f"{1e4 * channel.wall_area:.4g} cm²"}
    ports = ", ".join(f"{2e3 * port.radius:.4g} mm" for port in channel.ports)
    if ports:
        yield {"name": "ports", "detail": ports}


def _circuit_rows(spec: MachineSpec) -> Iterator[dict[str, str]]:
    for film in spec.film:
        if film.kind not in ("circuit", "wetted"):
            continue
        detail = _stream_detail(film.fluid, film.flow, film.inlet_temperature)
        if film.kind == "circuit":
            flow = duct_flow(film)
            section, length = flow.section, flow.section.path_length or film.length
            size = f"{1e6 * section.area:.4g} mm² section"
            paths = f"{section.paths} paths of " if section.paths > 1 else ""
            area = section.paths * section.perimeter * length
            kind = film.duct.replace("_", " ")
            detail = f"{kind}, {size}, {paths}{length:.3g} m, {1e4 * area:.4g} cm² wet; {detail}"
        yield {"name": film.name, "detail": detail}


def _set_detail(group: BearingSet) -> str:
    """Bearings of a set, their types and what preloads them."""
    types = ", ".join(dict.fromkeys(map(group.type_name, group.bearing)))
    names = ", ".join(bearing.name for bearing in group.bearing)
    rollers = group.bearing[0].takes_thrust is None
    preload = "" if rollers else f", preload {group.preload:.4g} N ({group.preload_kind})"
    return f"{names}: {types}{preload}{', carries thrust' if group.carries_thrust else ''}"


def _source_detail(source: HeatSource, spec: MachineSpec) -> str:
    value = float(source_heat(source, OperatingPoint.of(spec).inputs))
    if source.follows_torque:
        heat = f"{value:.4g} W by the torque"
    elif source.heat is None:
        heat = "no heat of its own"
    else:
        heat = f"{value:.4g} W" + ("" if isinstance(source.heat, float) else " by a table")
    return f"{heat} into {source.place}" + (f', follows "{source.input}"' if source.input else "")
