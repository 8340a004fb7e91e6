"""Build the view of a machine and one of its recordings that the effects of the catalogue need."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.circuit_tables import CircuitFilm
from spindle_fem.definition.housing_flange import segment_volume, volume
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.definition.uncertain_parameters import uncertain_parameters
from spindle_fem.effects.framework.machine_view import ChannelFlow, MachineView
from spindle_fem.effects.registry import effects_in_definition
from spindle_fem.machine.geometry.coolant_path import delivered_flow, section_of
from spindle_fem.machine.view.contact_groups import seats_of
from spindle_fem.machine.view.friction_tables import friction_tables
from spindle_fem.machine.view.machine_names import MachineNames
from spindle_fem.machine.view.part_roles import (
    CHANNEL_WALL,
    SHAFT_GAP,
    STANDING_GAP,
    Layout,
)
from spindle_fem.machine.view.place_names import ACROSS, AROUND, NEAR, UP, ringed_probes
from spindle_fem.machine.view.usual_sizes import (
    LEAST_HEAT,
    input_series,
    lowest_speed,
    quantities_of,
    usual_rise,
)
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.source_heat import source_heat
from spindle_fem.recordings.standard_inputs import standard_inputs

Array = NDArray[np.float64]


def view_of(names: MachineNames, recording: Recording) -> MachineView:
    """View of a machine with geometry for one recording.

    Parts are identified by kind and position: the largest rotating
    part is the shaft, what lies ahead of its bearings the nose, behind them
    the drive end; the largest standing part is the housing, its widest segment
    the flange.
    """
    spec, bearings = names.spec, names.bearings
    places = set(names.place_names)
    layout = Layout(spec, places)
    sets = {f"{group.name}_bearings": tuple(b.name for b in group.bearing) for group in spec.bearing_set}
    sets |= {name: (name,) for name in bearings}
    sides = {side: {name: f"{name}.{side}_ring" for name in bearings} for side in ("inner", "outer")}
    heat = layout.heat()
    for key, members in sets.items():
        heat[key] = tuple(f"{name}.{side}_raceway" for name in members for side in ("inner", "outer"))
    films, walls, fluids, surroundings = _films(names, layout)
    seats, outer_seats = seats_of(names, layout, sets)
    spots, reported = _spots(layout, heat, sets)
    known = standard_inputs(spec)
    inputs = {name: input_series(recording, name, known[name]) for name in known}
    if spec.has_pump_limit and "coolant_flow" not in recording.input_names:
        inputs["coolant_flow"] = delivered_flow(spec, inputs["coolant_inlet"])
    channel = _channel(spec)
    speed = np.abs(inputs["speed"])
    tables = friction_tables(spec)
    tabulated = sum((t.heat_at(speed, inputs["thrust"]) for t in tables.values()), np.zeros(speed.size))
    return MachineView(
        kind="geometry",
        sets=sets,
        inner=sides["inner"],
        outer=sides["outer"],
        heat=heat,
        films=films,
        joints={seat.component: (seat.parameter,) for seat in seats if seat.parameter},
        joint_coefficients=outer_seats,
        parameters={item.name: item.sigma_log for item in uncertain_parameters(spec)},
        channels=recording.temperature_names,
        inputs=tuple(dict.fromkeys((*known, *recording.input_names))),
        quantities=quantities_of(recording, ("speed",)),
        has=_switched_on(spec),
        reference_temperature=float(np.nanmean(inputs["ambient"])),
        highest_speed=float(speed.max()),
        duration=float(recording.times[-1] - recording.times[0]),
        lowest_speed=lowest_speed(speed),
        seats=seats,
        spots=spots,
        sides=_sides(layout, spots),
        focal=_focal(layout, spots, sets),
        reported=reported,
        near={p.name: layout.component_of(p.part) for p in spec.probe if f"{NEAR}{p.name}" in spots},
        walls=walls,
        fluids=fluids,
        probes=dict(zip(recording.temperature_names, recording.probes, strict=True)),
        outlets=outlet_channels(spec, recording),
        speed_inputs=dict.fromkeys((*sets, *heat, "shaft"), ("speed",)),
        input_scale={name: float(np.nanmax(np.abs(values))) for name, values in inputs.items()},
        capacity=_capacities(spec, layout),
        typical_heat=max(LEAST_HEAT, float(tabulated.max())),
        typical_rise=usual_rise(recording, inputs["ambient"]),
        channel=channel,
        circuits=tuple(film.name for film in spec.circuits if isinstance(film, CircuitFilm)),
        reynolds=_reynolds(channel, inputs["coolant_flow"], inputs["coolant_inlet"]),
        friction=tables if spec.heat.model == "table" else {},
        inner_share=spec.heat.inner_share.value,
        oiled=tuple(bearing.name for group, bearing in spec.bearings if group.lubrication is not None),
        ring_share=1.0 - spec.heat.ball_share,
        surroundings=surroundings,
        sources=tuple(
            source for source in spec.source if np.any(np.abs(source_heat(source, _given(recording, inputs))))
        ),
        **_viscosity(spec),
    )


def _given(recording: Recording, inputs: Mapping[str, Array]) -> dict[str, Array]:
    """Every input of a recording, and those of the machine that it does not give."""
    return {**dict(zip(recording.input_names, recording.inputs.T, strict=True)), **inputs}


def _films(
    names: MachineNames, layout: Layout
) -> tuple[dict[str, tuple[str, ...]], dict[str, str], dict[str, str | float], dict[str, tuple[str, ...]]]:
    """Films by component, the wall and fluid of each, and those of the ambient."""
    films: dict[str, list[str]] = {}
    walls: dict[str, str] = {}
    fluids: dict[str, str | float] = {}
    spec, places = names.spec, layout.places
    rotating = {part.name for part in spec.part if part.rotating}
    for film in spec.film:
        if isinstance(film, StreamFilm):
            # Effects on coolant handle these; here are the films to the air around the machine.
            continue
        for name in film.surface:
            coefficient = f"film.{name}"
            if coefficient not in names.fluid_names:
                continue
            surface = layout.surface(name)
            walls[coefficient] = name if name in places else surface.part
            fluids[coefficient] = "ambient" if film.temperature == "ambient" else film.temperature
            if surface.part in rotating:
                films.setdefault("shaft", []).append(coefficient)
                end = layout.end_of(surface)
                if end:
                    films.setdefault(end, []).append(coefficient)
            elif layout.is_flange_back(surface):
                films.setdefault("flange", []).append(coefficient)
            else:
                films.setdefault("housing", []).append(coefficient)
    ambient = tuple(name for name, fluid in fluids.items() if fluid == "ambient")
    return (
        {key: tuple(own) for key, own in films.items()},
        walls,
        fluids,
        {"ambient": ambient} if ambient else {},
    )


def _spots(
    layout: Layout,
    heat: Mapping[str, tuple[str, ...]],
    sets: Mapping[str, tuple[str, ...]],
) -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """Places where heat may be added or removed, and the component reported for each."""
    spots = {key: heat[key] for key in (*sets, "shaft", "nose", "drive_end", "flange") if key in heat}
    reported: dict[str, str] = {}
    if SHAFT_GAP in heat and heat[SHAFT_GAP] != heat["shaft"]:
        spots[SHAFT_GAP], reported[SHAFT_GAP] = heat[SHAFT_GAP], "shaft"
    if STANDING_GAP in heat:
        spots[STANDING_GAP] = heat[STANDING_GAP]
        reported[STANDING_GAP] = layout.component_of(layout.surface(heat[STANDING_GAP][0]).part)
    places = layout.places
    housing = layout.housing
    channel = layout.spec.channel
    if channel is not None:
        # Heat at its wall also heats the part it is cut into.
        own = layout.component_of(channel.part)
        spots[CHANNEL_WALL], reported[CHANNEL_WALL] = heat["channel"], own
    if housing is not None:
        segments = [f"{housing.name}.{s.name}" for s in housing.segment if s.name != layout.flange]
        inside = [name for name in segments if name in places]
        for place in inside or [housing.name]:
            spots[place], reported[place] = (place,), "housing"
    for part in layout.spec.part:
        known = part in (layout.shaft, housing) or part.rotating or layout.is_spacer(part)
        if not known and part.name in places:
            spots[part.name], reported[part.name] = (part.name,), layout.component_of(part.name)
    for probe in layout.spec.probe:
        place = f"{NEAR}{probe.name}"
        if place in places:
            spots[place], reported[place] = (place,), probe.name
    for probe in ringed_probes(layout.spec):
        place = f"{AROUND}{probe.name}"
        if place in places:
            spots[place], reported[place] = (place,), layout.component_of(probe.part)
    return spots, reported


def _sides(layout: Layout, spots: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, str]]:
    """First harmonics of spots that are one place; of a ring through a probe those of its segment."""
    of = {spot: place for spot, (place, *more) in spots.items() if not more}
    of |= {f"{AROUND}{probe.name}": layout.place_of_probe(probe) for probe in ringed_probes(layout.spec)}
    return {
        spot: (UP + place, ACROSS + place)
        for spot, place in of.items()
        if spot in spots and {UP + place, ACROSS + place} <= layout.places
    }


def _focal(
    layout: Layout, spots: Mapping[str, tuple[str, ...]], sets: Mapping[str, tuple[str, ...]]
) -> dict[str, str]:
    """Place where a share of a spot's heat may be concentrated.

    A ring through a probe has the probe's own patch, a single bearing its outer raceway.
    """
    rings = {spot: NEAR + spot.removeprefix(AROUND) for spot in spots if spot.startswith(AROUND)}
    bearings = {key: f"{key}.outer_raceway" for key, members in sets.items() if members == (key,)}
    found = {**rings, **bearings}
    return {spot: place for spot, place in found.items() if spot in spots and place in layout.places}


def _switched_on(spec: MachineSpec) -> frozenset[str]:
    """Effects that the machine already has: by id, or by id and component where limited to one component."""
    found = {f"{entry.effect} @ {entry.component}" for entry in spec.effects}
    return frozenset(found) | effects_in_definition(spec)


def _capacities(spec: MachineSpec, layout: Layout) -> dict[str, float]:
    """Heat capacity of the large components, J/K."""
    density = {p.name: spec.part_material(p.name).volumetric_heat_capacity for p in spec.part}
    found: dict[str, float] = {}
    shaft, housing = layout.shaft, layout.housing
    if shaft is not None:
        found["shaft"] = volume(shaft) * density[shaft.name]
        for key, segments in (
            ("nose", [s for s in shaft.segment if s.z[1] <= layout.first + 1e-9]),
            ("drive_end", [s for s in shaft.segment if s.z[0] >= layout.last - 1e-9]),
        ):
            if segments:
                found[key] = sum(map(segment_volume, segments)) * density[shaft.name]
    if housing is not None:
        found["housing"] = volume(housing) * density[housing.name]
        for segment in housing.segment:
            if segment.name == layout.flange:
                found["flange"] = segment_volume(segment) * density[housing.name]
    if spec.channel is not None:
        loop = coolant_by_name(spec.coolant.fluid).properties(spec.coolant.inlet_temperature)
        found["channel"] = float(_wetted_volume(spec) * loop.density * loop.specific_heat_capacity)
    return found


def _wetted_volume(spec: MachineSpec) -> float:
    """Coolant in the channel, m³."""
    section = section_of(spec.channel)
    return spec.channel.depth * spec.channel.width * section.length * spec.channel.starts


def _viscosity(spec: MachineSpec) -> dict[str, tuple[float, float]]:
    """Viscosities of the first set's lubricant: effects on friction assume one oil per machine."""
    lubricants = [spec.lubricant_of(group) for group in spec.bearing_set] or [spec.grease]
    if lubricants[0] is None:
        return {}
    return {"viscosity": (lubricants[0].kinematic_viscosity_40, lubricants[0].kinematic_viscosity_100)}


def _channel(spec: MachineSpec) -> ChannelFlow | None:
    channel = spec.channel
    if channel is None:
        return None
    area = channel.depth * channel.width * channel.starts
    return ChannelFlow(spec.coolant.fluid, section_of(channel).hydraulic_diameter, area)


def _reynolds(channel: ChannelFlow | None, flow: Array, inlet: Array) -> tuple[float, float]:
    if channel is None:
        return (0.0, 0.0)
    flowing = flow > 0.0
    if not flowing.any():
        return (0.0, 0.0)
    # Grows with flow and, through the viscosity, with temperature: the ends lie at ends of both together.
    ranks = np.unique(
        [
            np.argmin(flow[flowing]),
            np.argmax(flow[flowing]),
            np.argmin(inlet[flowing]),
            np.argmax(inlet[flowing]),
        ]
    )
    values = [channel.reynolds_number(float(flow[flowing][i]), float(inlet[flowing][i])) for i in ranks]
    return (min(values), max(values))


def outlet_channels(spec: MachineSpec, recording: Recording) -> tuple[str, ...]:
    """Temperature channels of a recording that read where coolant leaves."""
    outlets = {probe.name for probe in spec.probe if probe.kind == "coolant_outlet"}
    return tuple(
        channel
        for channel, probe in zip(recording.temperature_names, recording.probes, strict=True)
        if probe in outlets
    )
