"""What the effects of the catalogue need to know of a machine and of a recording made with it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spindle_fem.coolant.properties import coolant_by_name
from spindle_fem.coolant.section import ChannelSection
from spindle_fem.effects.coolant_film import reynolds_number
from spindle_fem.effects.view import ChannelFlow, FrictionTable, MachineView, Seat
from spindle_fem.loads.operating_point import OperatingPoint
from spindle_fem.network.model import ThermalNetwork
from spindle_fem.recordings.align import Recording
from spindle_fem.reduced.coefficients import free_parameters
from spindle_fem.reduced.drive import heat_of_table, standard_inputs
from spindle_fem.reduced.fast_model import FastModel
from spindle_fem.spec.model import MachineSpec, NaturalFilm, Part, Surface

Array = NDArray[np.float64]

ANGULAR = "radian / second"
# A segment is a flange where its diameter passes the next largest by this share.
FLANGE_STEP = 1.1
# Channels rise at least this much, K, and heat is at least this much, W, for usual sizes of effects.
LEAST_RISE = 2.0
LEAST_HEAT = 1.0
COOLANT_WORD = re.compile("coolant|oil|water|chiller", re.IGNORECASE)


def view_of(fast: FastModel, recording: Recording) -> MachineView:
    """A machine with geometry on one recording.

    Parts are told by what they are and where they lie: the largest rotating
    part is the shaft, what lies ahead of its bearings the nose, behind them
    the drive end; the largest standing part is the housing, its widest segment
    the flange.

    Parameters
    ----------
    fast : FastModel
    recording : Recording
    """
    spec = fast.spec
    layout = _Layout(spec, set(fast.model.place_names))
    sets = {f"{group.name}_bearings": tuple(b.name for b in group.bearing) for group in spec.bearing_set}
    sets |= {name: (name,) for name in fast.bearings}
    sides = {side: {name: f"{name}.{side}_ring" for name in fast.bearings} for side in ("inner", "outer")}
    heat = layout.heat()
    for key, members in sets.items():
        heat[key] = tuple(f"{name}.{side}_raceway" for name in members for side in ("inner", "outer"))
    films, walls, fluids, surroundings = _films(spec, layout, fast)
    seats, outer_seats = _seats(spec, fast, layout, sets)
    spots, reported = _spots(fast, layout, heat, sets)
    known = standard_inputs(spec)
    inputs = {name: _series(recording, name, known[name]) for name in known}
    channel = _channel(spec)
    speed = np.abs(inputs["speed"])
    return MachineView(
        kind="geometry",
        sets=sets,
        inner=sides["inner"],
        outer=sides["outer"],
        heat=heat,
        films=films,
        joints={seat.component: (seat.parameter,) for seat in seats if seat.parameter},
        joint_coefficients=outer_seats,
        parameters=free_parameters(spec),
        channels=recording.temperature_names,
        inputs=tuple(dict.fromkeys((*known, *recording.input_names))),
        covariates=recording.covariate_names,
        has=_switched_on(spec),
        reference_temperature=float(np.nanmean(inputs["ambient"])),
        highest_speed=float(speed.max()),
        duration=float(recording.times[-1] - recording.times[0]),
        lowest_speed=_lowest(speed),
        seats=seats,
        spots=spots,
        reported=reported,
        walls=walls,
        fluids=fluids,
        probes=dict(zip(recording.temperature_names, recording.probes, strict=True)),
        outlets=_outlets(spec, recording),
        speed_inputs=dict.fromkeys((*sets, *heat, "shaft"), ("speed",)),
        input_scale={name: float(np.nanmax(np.abs(values))) for name, values in inputs.items()},
        capacity=_capacities(spec, layout),
        typical_heat=max(
            LEAST_HEAT,
            float(heat_of_table(spec, speed, inputs["thrust"]).sum(axis=1).max())
            if spec.heat.table is not None
            else LEAST_HEAT,
        ),
        typical_rise=_rise(recording, inputs["ambient"]),
        channel=channel,
        reynolds=_reynolds(channel, inputs["coolant_flow"], inputs["coolant_inlet"]),
        friction=_friction(spec),
        inner_share=spec.heat.inner_share.value,
        ring_share=1.0 - spec.heat.ball_share,
        surroundings=surroundings,
        **_viscosity(spec),
    )


# ------------------------------------------------------------------ geometry
class _Layout:
    """Which part is what."""

    def __init__(self, spec: MachineSpec, places: set[str]) -> None:
        self.spec, self.places = spec, places
        ends = [z for _, bearing in spec.bearings for z in bearing.z]
        self.first, self.last = (min(ends), max(ends)) if ends else (0.0, 0.0)
        rotating = [part for part in spec.part if part.rotating]
        standing = [part for part in spec.part if not part.rotating]
        self.shaft = max(rotating, key=_volume, default=None)
        self.housing = max(standing, key=_volume, default=None)
        self.flange = self._flange()

    def _flange(self) -> str:
        """Widest segment of the housing; empty where none stands out."""
        if self.housing is None or len(self.housing.segment) < 2:
            return ""
        wide = sorted(self.housing.segment, key=lambda s: s.outer_diameter)
        stands_out = wide[-1].outer_diameter > FLANGE_STEP * wide[-2].outer_diameter
        return wide[-1].name if stands_out else ""

    def flange_ends(self) -> tuple[float, float] | None:
        """Both ends of the flange along the axis."""
        if not self.flange:
            return None
        return next(s.z for s in self.housing.segment if s.name == self.flange)

    def segment_place(self, part: Part, segment: str) -> str:
        """Place of a segment; of its part where that is one, or where the mesh has no other."""
        place = f"{part.name}.{segment}"
        return place if place in self.places else part.name

    def is_spacer(self, part: Part) -> bool:
        """Whether a part lies between the bearings of one set."""
        start, end = _extent(part)
        for group in self.spec.bearing_set:
            ends = [z for bearing in group.bearing for z in bearing.z]
            if min(ends) - 1e-9 <= start and end <= max(ends) + 1e-9:
                return True
        return False

    def component_of(self, part: str) -> str:
        """Component that a part belongs to."""
        if self.shaft is not None and part == self.shaft.name:
            return "shaft"
        if self.housing is not None and part == self.housing.name:
            return "housing"
        bearing = part.rpartition(".")[0]
        if bearing:
            return bearing
        found = next(p for p in self.spec.part if p.name == part)
        start, end = _extent(found)
        if self.is_spacer(found):
            middle = 0.5 * (start + end)
            group = min(
                self.spec.bearing_set,
                key=lambda g: min(abs(middle - z) for bearing in g.bearing for z in bearing.z),
            )
            return f"{group.name}_bearings"
        if end <= self.first + 1e-9:
            return "nose"
        if start >= self.last - 1e-9:
            return "drive_end"
        return "shaft" if found.rotating else "housing"

    def heat(self) -> dict[str, tuple[str, ...]]:
        """Places of the large components."""
        found: dict[str, tuple[str, ...]] = {}
        if self.shaft is not None:
            found["shaft"] = (self.shaft.name,)
            ahead = [s for s in self.shaft.segment if s.z[1] <= self.first + 1e-9]
            behind = [s for s in self.shaft.segment if s.z[0] >= self.last - 1e-9]
            # Of several segments the outermost: what rubs or drives sits at the end.
            if ahead:
                found["nose"] = (self.segment_place(self.shaft, min(ahead, key=lambda s: s.z[0]).name),)
            if behind:
                found["drive_end"] = (self.segment_place(self.shaft, max(behind, key=lambda s: s.z[1]).name),)
            gaps = [g.rotating for g in self.spec.gap if g.rise > 0.0 or g.kind != "power_law"]
            gaps = [name for name in gaps if self._part_of(name) == self.shaft.name and name in self.places]
            found["shaft_gap"] = tuple(gaps) or found["shaft"]
        if self.housing is not None:
            found["housing"] = (self.housing.name,)
            if self.flange:
                found["flange"] = (self.segment_place(self.housing, self.flange),)
        if self.spec.channel is not None:
            walls = [f"{self.spec.channel.part}.channel_wall", self.spec.channel.part]
            found["channel"] = (next((w for w in walls if w in self.places), walls[-1]),)
        return found

    def _part_of(self, surface: str) -> str:
        return self.surface(surface).part

    def surface(self, name: str) -> Surface:
        """A named surface."""
        return next(s for s in self.spec.all_surfaces if s.name == name)

    def is_flange_back(self, surface: Surface) -> bool:
        """Whether a surface is nothing but a plane end of the flange: what is bolted to a frame."""
        ends = self.flange_ends()
        if ends is None or surface.part != self.housing.name:
            return False
        return (
            all(
                where.facing in ("front", "rear")
                and where.z is not None
                and any(abs(z - end) < 1e-6 for z in _both(where.z) for end in ends)
                for where in surface.where
            )
            and len(surface.where) == 1
        )

    def end_of(self, surface: Surface) -> str:
        """Which end of the shaft a rotating surface belongs to; empty in between."""
        middle = self._middle(surface)
        if middle is None:
            return ""
        if middle <= self.first:
            return "nose"
        return "drive_end" if middle >= self.last else ""

    def _middle(self, surface: Surface) -> float | None:
        """Mean place of a surface along the axis."""
        part = next((p for p in self.spec.part if p.name == surface.part), None)
        found = []
        for where in surface.where:
            if where.z is not None:
                found.append(float(np.mean(_both(where.z))))
            elif part is not None:
                radius = None if where.r is None else float(np.mean(_both(where.r)))
                fitting = [
                    s for s in part.segment if radius is None or abs(0.5 * s.outer_diameter - radius) < 1e-6
                ]
                found += [float(np.mean(s.z)) for s in fitting]
        return float(np.mean(found)) if found else None


def _both(value: float | Sequence[float]) -> tuple[float, ...]:
    return (float(value),) if isinstance(value, (int, float)) else tuple(float(v) for v in value)


def _extent(part: Part) -> tuple[float, float]:
    return min(s.z[0] for s in part.segment), max(s.z[1] for s in part.segment)


def _volume(part: Part) -> float:
    return sum(_segment_volume(s) for s in part.segment)


def _segment_volume(segment: object) -> float:
    area = 0.25 * np.pi * (segment.outer_diameter**2 - segment.inner_diameter**2)
    return float(area * (segment.z[1] - segment.z[0]))


def _films(
    spec: MachineSpec, layout: _Layout, fast: FastModel
) -> tuple[dict[str, tuple[str, ...]], dict[str, str], dict[str, str | float], dict[str, tuple[str, ...]]]:
    """Films by component, the wall and fluid of each, and those of the ambient."""
    films: dict[str, list[str]] = {}
    walls: dict[str, str] = {}
    fluids: dict[str, str | float] = {}
    places = set(fast.model.place_names)
    rotating = {part.name for part in spec.part if part.rotating}
    for film in spec.film:
        for name in film.surface:
            coefficient = f"film.{name}"
            if coefficient not in fast.model.fluid_names:
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
        {key: tuple(names) for key, names in films.items()},
        walls,
        fluids,
        {"ambient": ambient} if ambient else {},
    )


def _seats(
    spec: MachineSpec, fast: FastModel, layout: _Layout, sets: Mapping[str, tuple[str, ...]]
) -> tuple[tuple[Seat, ...], dict[str, tuple[str, ...]]]:
    """Groups of contacts that may differ together, and the outer seats of every set and bearing."""
    conducting = [
        name.removeprefix("joint.")
        for name, value in fast.table.base(_nominal_point(spec)).items()
        if name.startswith("joint.") and value > 0.0
    ]
    by_ends = {name: name.removesuffix(":face").split("|") for name in conducting}
    housing = layout.housing.name if layout.housing is not None else ""
    owner = {b: key for key, members in sets.items() if members != (key,) for b in members}
    found: list[Seat] = []
    outer: dict[str, tuple[str, ...]] = {}
    # Whole sets: rings and spacers on shaft and housing.
    for key, members in sets.items():
        for side, partner in (("outer", housing), ("inner", layout.shaft.name if layout.shaft else "")):
            rings = {f"{bearing}.{side}_ring" for bearing in members}
            own = tuple(
                f"joint.{name}"
                for name, ends in by_ends.items()
                if not name.endswith(":face")
                and partner in ends
                and any(
                    end in rings
                    or (
                        members != (key,)
                        and end not in (partner,)
                        and "." not in end
                        and layout.component_of(end) == key
                    )
                    for end in ends
                )
            )
            if not own:
                continue
            if side == "outer":
                outer[key] = own
            if members == (key,) or owner.get(members[0]) == key:
                found.append(Seat(key, f"{side} ring seats", own, _own_parameter(fast, own)))
    seen = {frozenset(seat.coefficients) for seat in found}
    # The machine's own groups, and single contacts between other parts.
    for group in spec.joint:
        own = tuple(
            n for n in (f"joint.{c}" for c in conducting) if f"joint.{group.name}" in fast.table.groups[n]
        )
        if own and frozenset(own) not in seen:
            components = {layout.component_of(e) for n in own for e in by_ends[n.removeprefix("joint.")]}
            place = _common(components, owner)
            found.append(Seat(place, group.name.replace("_", " "), own, f"joint.{group.name}"))
            seen.add(frozenset(own))
    for name, ends in by_ends.items():
        parts = [next((p for p in spec.part if p.name == end), None) for end in ends]
        alone = all(part is not None and not layout.is_spacer(part) for part in parts)
        if alone and frozenset((f"joint.{name}",)) not in seen:
            small = min(parts, key=_volume)
            contact = f"joint.{name}"
            found.append(Seat(layout.component_of(small.name), f"{small.name} contact", (contact,), contact))
    for film in spec.film:
        if not isinstance(film, NaturalFilm) and all(
            layout.is_flange_back(layout.surface(s)) for s in film.surface
        ):
            own = tuple(f"film.{surface}" for surface in film.surface)
            name = f"film.{film.name}" if film.name else own[0]
            found.append(Seat("flange", "to the frame", own, name if name in fast.table.names else ""))
    return tuple(found), outer


def _own_parameter(fast: FastModel, coefficients: tuple[str, ...]) -> str:
    """Parameter that scales exactly these coefficients; empty where there is none."""
    if len(coefficients) == 1:
        return coefficients[0]
    common = set.intersection(*(set(fast.table.groups[name]) for name in coefficients))
    for name in sorted(common):
        scaled = {
            key for key, groups in fast.table.groups.items() if name in groups and key.startswith("joint.")
        }
        if scaled == set(coefficients):
            return name
    return ""


def _common(components: set[str], owner: Mapping[str, str]) -> str:
    """One component for several: their set, the shaft or the housing."""
    groups = {owner.get(name, name) for name in components}
    rest = groups - {"shaft", "housing"}
    if len(rest) == 1:
        return rest.pop()
    if len(groups) == 1:
        return groups.pop()
    return "shaft" if "shaft" in groups else "housing"


def _spots(
    fast: FastModel,
    layout: _Layout,
    heat: Mapping[str, tuple[str, ...]],
    sets: Mapping[str, tuple[str, ...]],
) -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """Places where heat may come and go, and the component that each is told as."""
    groups = [key for key, members in sets.items() if members != (key,)]
    spots = {
        key: heat[key] for key in (*groups, "shaft", "nose", "drive_end", "flange", "channel") if key in heat
    }
    reported: dict[str, str] = {}
    places = layout.places
    housing = layout.housing
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
        place = f"near.{probe.name}"
        if place in places:
            spots[place], reported[place] = (place,), probe.name
    return spots, reported


def _nominal_point(spec: MachineSpec) -> OperatingPoint:
    return OperatingPoint.of(spec)


def _switched_on(spec: MachineSpec) -> frozenset[str]:
    found = set(spec.effects)
    if spec.channel is not None:
        found.add("coolant_heating")
    if spec.heat.thermal_preload:
        found.add("thermal_preload")
    if any(isinstance(film, NaturalFilm) for film in spec.film):
        found |= {"natural_convection", "radiation"}
    # Entries [[effect]], each at its own component.
    for entry in getattr(spec, "effect", ()):
        found.add(f"{entry.effect} @ {entry.component}")
    return frozenset(found)


def _capacities(spec: MachineSpec, layout: _Layout) -> dict[str, float]:
    """Heat capacity of the large components, J/K."""
    density = {p.name: spec.part_material(p.name).volumetric_heat_capacity for p in spec.part}
    found: dict[str, float] = {}
    shaft, housing = layout.shaft, layout.housing
    if shaft is not None:
        found["shaft"] = _volume(shaft) * density[shaft.name]
        for key, segments in (
            ("nose", [s for s in shaft.segment if s.z[1] <= layout.first + 1e-9]),
            ("drive_end", [s for s in shaft.segment if s.z[0] >= layout.last - 1e-9]),
        ):
            if segments:
                found[key] = sum(map(_segment_volume, segments)) * density[shaft.name]
    if housing is not None:
        found["housing"] = _volume(housing) * density[housing.name]
        for segment in housing.segment:
            if segment.name == layout.flange:
                found["flange"] = _segment_volume(segment) * density[housing.name]
    if spec.channel is not None:
        loop = coolant_by_name(spec.coolant.fluid).properties(spec.coolant.inlet_temperature)
        found["channel"] = float(_wetted_volume(spec) * loop.density * loop.specific_heat_capacity)
    return found


def _wetted_volume(spec: MachineSpec) -> float:
    """Coolant in the channel, m³."""
    section = _section(spec)
    return spec.channel.depth * spec.channel.width * section.length * spec.channel.starts


def _friction(spec: MachineSpec) -> dict[str, FrictionTable]:
    table = spec.heat.table
    if table is None or spec.heat.model != "table":
        return {}
    return {
        bearing.name: FrictionTable(
            tuple(table.speed),
            tuple(value * group.heat_factor.value for value in table.heat[bearing.name]),
            table.thrust_coefficient.get(bearing.name, 0.0),
            table.reference_thrust,
        )
        for group, bearing in spec.bearings
    }


def _viscosity(spec: MachineSpec) -> dict[str, tuple[float, float]]:
    if spec.grease is None:
        return {}
    return {"viscosity": (spec.grease.kinematic_viscosity_40, spec.grease.kinematic_viscosity_100)}


def _channel(spec: MachineSpec) -> ChannelFlow | None:
    channel = spec.channel
    if channel is None:
        return None
    area = channel.depth * channel.width * channel.starts
    return ChannelFlow(spec.coolant.fluid, _section(spec).hydraulic_diameter, area)


def _section(spec: MachineSpec) -> ChannelSection:
    channel = spec.channel
    return ChannelSection(
        channel.inner_radius, channel.depth, channel.width, channel.pitch, channel.turns, channel.starts
    )


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
    values = [reynolds_number(channel, float(flow[flowing][i]), float(inlet[flowing][i])) for i in ranks]
    return (min(values), max(values))


def _outlets(spec: MachineSpec, recording: Recording) -> tuple[str, ...]:
    outlets = {probe.name for probe in spec.probe if probe.kind == "coolant_outlet"}
    return tuple(
        channel
        for channel, probe in zip(recording.temperature_names, recording.probes, strict=True)
        if probe in outlets
    )


# ------------------------------------------------------------------ recordings
def _series(recording: Recording, name: str, otherwise: float) -> Array:
    """An input at every stamp; a constant where it is not recorded."""
    if name not in recording.input_names:
        return np.full(recording.times.size, otherwise)
    return recording.input_at(name, recording.times)


def _lowest(speed: Array) -> float:
    """Lowest speed above standstill."""
    turning = speed[speed > 1e-3 * max(float(speed.max()), 1e-12)]
    return float(turning.min()) if turning.size else 0.0


def _rise(recording: Recording, ambient: Array) -> float:
    """How far the channels leave the surroundings, the 95th percentile."""
    difference = np.abs(np.where(recording.usable, recording.temperature, np.nan) - ambient[:, None])
    if not np.isfinite(difference).any():
        return LEAST_RISE
    return max(LEAST_RISE, float(np.nanpercentile(difference, 95.0)))


# ------------------------------------------------------------------ networks
def view_of_network(
    network: ThermalNetwork, recording: Recording, *, has: frozenset[str] = frozenset()
) -> MachineView:
    """A written network on one recording.

    Every source is a bearing, every node a place, every link a joint, and
    those to boundaries are films. An input is speed-like where its unit is
    that of an angular speed.

    Parameters
    ----------
    network : ThermalNetwork
    recording : Recording
    has : frozenset of str
        Effects that the definition switches on.
    """
    names = (*network.node_names, *network.boundary_names)
    n = network.n_nodes
    scale = {
        name: float(np.nanmax(np.abs(recording.input_at(name, recording.times))))
        for name in recording.input_names
    }
    units = dict(zip(recording.input_names, recording.input_units, strict=True))
    turning = tuple(name for name in recording.input_names if units[name] == ANGULAR)
    boundary = _boundary_temperatures(network)
    films: dict[str, tuple[str, ...]] = {}
    walls: dict[str, str] = {}
    fluids: dict[str, str | float] = {}
    surroundings: dict[str, list[str]] = {}
    joints: dict[str, tuple[str, ...]] = {}
    conductance: dict[str, float] = {}
    seats: list[Seat] = []
    heated = {int(node) for node in network.source_node}
    for link, first, second, value in zip(
        network.link_names, network.link_first, network.link_second, network.link_conductance, strict=True
    ):
        coefficient = f"link.{link}"
        conductance[coefficient] = float(value)
        seats.append(Seat(link, "", (coefficient,), f"conductance.{link}"))
        ends = sorted((int(first), int(second)))
        if ends[1] >= n > ends[0]:
            other = names[ends[1]]
            films[link], walls[coefficient] = (coefficient,), names[ends[0]]
            fluids[coefficient] = boundary[other]
            surroundings.setdefault(other, []).append(coefficient)
        elif ends[1] < n:
            # What is heated expands into what holds it.
            hot, cold = ends if ends[0] in heated or ends[1] not in heated else ends[::-1]
            walls[coefficient], fluids[coefficient] = names[hot], names[cold]
            joints[link] = (coefficient,)
    nodes = {name: (name,) for name in network.node_names}
    inner, outer, speeds, reported = _sources(network, turning)
    speeds |= dict.fromkeys((*nodes, *films), turning)
    coolants = {name: tuple(links) for name, links in surroundings.items() if COOLANT_WORD.search(name)}
    heat = _network_heat(network, scale)
    ambient, room = _room(network, recording, boundary)
    return MachineView(
        kind="network",
        sets={name: (name,) for name in network.source_names},
        inner=inner,
        outer=outer,
        heat=nodes,
        films=films,
        joints={link: (f"conductance.{link}",) for link in network.link_names},
        joint_coefficients=joints,
        parameters={item.name: item.sigma_log for item in network.parameters if item.sigma_log > 0.0},
        channels=recording.temperature_names,
        inputs=tuple(dict.fromkeys((*recording.input_names, *network.input_names))),
        covariates=recording.covariate_names,
        has=has,
        reference_temperature=room,
        highest_speed=max((scale[name] for name in turning), default=0.0),
        duration=float(recording.times[-1] - recording.times[0]),
        lowest_speed=min(
            (_lowest(np.abs(recording.input_at(t, recording.times))) for t in turning), default=0.0
        ),
        seats=tuple(seats),
        spots=nodes,
        reported=reported,
        walls=walls,
        fluids=fluids,
        probes=dict(zip(recording.temperature_names, recording.probes, strict=True)),
        speed_inputs=speeds,
        input_scale=scale,
        capacity=dict(zip(network.node_names, network.capacity.tolist(), strict=True)),
        typical_heat=max(LEAST_HEAT, heat),
        typical_rise=_rise(recording, ambient),
        coolant_links=coolants,
        conductance=conductance,
        source_inputs={
            name: source
            for name, source in zip(network.source_names, network.source_input, strict=True)
            if source is not None
        },
        surroundings={name: tuple(links) for name, links in surroundings.items()},
    )


def _boundary_temperatures(network: ThermalNetwork) -> dict[str, str | float]:
    return {
        name: float(value) if driven is None else driven
        for name, value, driven in zip(
            network.boundary_names, network.boundary_temperature, network.boundary_input, strict=True
        )
    }


def _sources(
    network: ThermalNetwork, turning: tuple[str, ...]
) -> tuple[dict[str, str], dict[str, str], dict[str, tuple[str, ...]], dict[str, str]]:
    """Node that each source heats, what that is joined to, its speed-like input, and what it is told as."""
    inner: dict[str, str] = {}
    outer: dict[str, str] = {}
    speeds: dict[str, tuple[str, ...]] = {}
    reported: dict[str, str] = {}
    n = network.n_nodes
    for name, node, source in zip(
        network.source_names, network.source_node, network.source_input, strict=True
    ):
        inner[name] = network.node_names[node]
        reported[name] = network.node_names[node]
        speeds[name] = (source,) if source in turning else ()
        joined = [
            (float(value), int(b if a == node else a))
            for a, b, value in zip(
                network.link_first, network.link_second, network.link_conductance, strict=True
            )
            if node in (a, b) and max(a, b) < n
        ]
        if joined:
            outer[name] = network.node_names[max(joined)[1]]
    return inner, outer, speeds, reported


def _network_heat(network: ThermalNetwork, scale: Mapping[str, float]) -> float:
    """All sources with every input at its largest, W."""
    return float(
        sum(
            gain * (1.0 if name is None else scale.get(name, 0.0) ** exponent)
            for gain, name, exponent in zip(
                network.source_gain, network.source_input, network.source_exponent, strict=True
            )
        )
    )


def _room(
    network: ThermalNetwork, recording: Recording, boundary: Mapping[str, str | float]
) -> tuple[Array, float]:
    """Temperature of the surroundings at every stamp and its mean: ambient, or the first boundary."""
    name = "ambient" if "ambient" in boundary else next(iter(boundary), "")
    given = boundary.get(name, "")
    if isinstance(given, float):
        series = np.full(recording.times.size, given)
    elif given in recording.input_names:
        series = recording.input_at(given, recording.times)
    else:
        series = np.full(recording.times.size, float(np.nanmean(recording.temperature)))
    return series, float(np.nanmean(series))
