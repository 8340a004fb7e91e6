"""Position in the meridian plane of a component, spot or probe of a machine with geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from spindle_fem.definition.circuit_tables import CircuitFilm
from spindle_fem.definition.machine_spec import LubricationFilm, MachineSpec
from spindle_fem.machine.view.part_roles import CHANNEL_WALL, SHAFT_GAP, STANDING_GAP, Layout
from spindle_fem.machine.view.place_names import AROUND, NEAR, STANDARD_DISTANCE


@dataclass(frozen=True, slots=True)
class Region:
    """A ring of rectangular section about the axis; a point where it has no extent.

    Attributes
    ----------
    z : (float, float), [m]
    r : (float, float), [m]
    """

    z: tuple[float, float]
    r: tuple[float, float]

    @property
    def volume(self) -> float:
        """Swept volume over pi, m³."""
        return (self.r[1] ** 2 - self.r[0] ** 2) * (self.z[1] - self.z[0])

    @property
    def middle(self) -> tuple[float, float]:
        """Radius and place along the axis of the middle of the section, m."""
        return 0.5 * (self.r[0] + self.r[1]), 0.5 * (self.z[0] + self.z[1])


def regions_of(spec: MachineSpec, name: str) -> tuple[Region, ...]:
    """Sections of a component as findings name it, of a spot, part, segment, ring or probe.

    Parameters
    ----------
    name : str
        ``front_bearings``, ``F2``, ``F2.outer_ring``, ``shaft``, ``housing``,
        ``housing.flange``, ``nose``, ``drive_end``, ``flange``, ``channel``,
        ``near.SP01``, ``around.SP04``, ``SP01``, ...; two joined by ``|`` are both.

    Returns
    -------
    tuple of Region
        Empty where the name has no place in the machine (``ambient``).
    """
    if "|" in name:
        both = name.partition("@")[0].removesuffix(":face").split("|")
        return tuple(region for part in both for region in regions_of(spec, part))
    for find in (_of_bearings, _of_probe, _of_channel, _of_ring, _of_gap, _of_ends, _of_part):
        found = find(spec, name)
        if found:
            return found
    return ()


def centre_of(spec: MachineSpec, name: str) -> tuple[float, float] | None:
    """Radius and place along the axis [m] of a component's centroid; None where it has no place.

    The radius is that of the middle of the wall, not of the axis on which the
    centroid of every ring lies.
    """
    regions = regions_of(spec, name)
    if not regions:
        return None
    weights = [region.volume for region in regions]
    total = sum(weights)
    if total <= 0.0:
        # Without volume: cylinders weighted by area, points equally.
        weights = [region.middle[0] * (region.z[1] - region.z[0]) or 1.0 for region in regions]
        total = sum(weights)
    radius = sum(w * region.middle[0] for w, region in zip(weights, regions, strict=True)) / total
    place = sum(w * region.middle[1] for w, region in zip(weights, regions, strict=True)) / total
    return radius, place


def _of_bearings(spec: MachineSpec, name: str) -> tuple[Region, ...]:
    found = []
    for group, bearing in spec.bearings:
        kind = spec.bearing_types[group.type_name(bearing)]
        bore, outside = 0.5 * kind.bore_diameter, 0.5 * kind.outer_diameter
        if name in (bearing.name, f"{group.name}_bearings"):
            found.append(Region(tuple(bearing.z), (bore, outside)))
        elif name in (f"{bearing.name}.inner_ring", f"{bearing.name}.inner_raceway"):
            found.append(Region(tuple(bearing.z), (bore, 0.5 * kind.inner_ring_outer_diameter)))
        elif name in (f"{bearing.name}.outer_ring", f"{bearing.name}.outer_raceway"):
            found.append(Region(tuple(bearing.z), (0.5 * kind.outer_ring_inner_diameter, outside)))
    return tuple(found)


def _of_probe(spec: MachineSpec, name: str) -> tuple[Region, ...]:
    for probe in spec.probe:
        if probe.name == name.removeprefix(NEAR):
            if probe.kind == "point":
                return (Region((probe.z, probe.z), (probe.r, probe.r)),)
            for film in spec.circuits:
                if film.name != probe.circuit:
                    continue
                if isinstance(film, LubricationFilm):
                    return _of_bearings(spec, film.bearing)
                if isinstance(film, CircuitFilm):
                    place = film.z[1] if film.flows_to == "rear" else film.z[0]
                    return (Region((place, place), (0.5 * film.diameter,) * 2),)
            channel = spec.channel
            if channel is None:
                return ()
            end, middle = channel.z_start + channel.pitch * channel.turns, _channel_middle(spec)
            return (Region((end, end), (middle, middle)),)
    return ()


def _channel_middle(spec: MachineSpec) -> float:
    return spec.channel.inner_radius + 0.5 * spec.channel.depth


def _of_channel(spec: MachineSpec, name: str) -> tuple[Region, ...]:
    channel = spec.channel
    if channel is None or name not in ("channel", CHANNEL_WALL):
        return ()
    half = 0.5 * channel.width
    return (
        Region(
            (channel.z_start - half, channel.z_start + channel.pitch * channel.turns + half),
            (channel.inner_radius, channel.inner_radius + channel.depth),
        ),
    )


def _of_ring(spec: MachineSpec, name: str) -> tuple[Region, ...]:
    """Section of the part covered by a ring through a probe, one standard deviation to either side."""
    reach = STANDARD_DISTANCE / 3.0**0.5
    for probe in spec.probe:
        if name == f"{AROUND}{probe.name}":
            part = next(p for p in spec.part if p.name == probe.part)
            whole = [r for r in _sections(part.segment) if r.z[0] <= probe.z <= r.z[1]]
            low = max(probe.r - reach, min(region.r[0] for region in whole))
            high = min(probe.r + reach, max(region.r[1] for region in whole))
            return (Region((probe.z - reach, probe.z + reach), (low, high)),)
    return ()


def _of_gap(spec: MachineSpec, name: str) -> tuple[Region, ...]:
    """Standing walls of the gaps around the shaft."""
    layout = Layout(spec, set())
    if name != STANDING_GAP or layout.shaft is None:
        return ()
    return tuple(
        Region(_ends(where.z), _ends(where.r))
        for gap in layout.gaps()
        for surface in gap.standing
        for where in layout.surface(surface).where
        if where.z is not None and where.r is not None
    )


def _of_ends(spec: MachineSpec, name: str) -> tuple[Region, ...]:
    if name not in ("shaft", SHAFT_GAP, "housing", "nose", "drive_end", "flange"):
        return ()
    layout = Layout(spec, set())
    if name == "housing":
        return () if layout.housing is None else _sections(layout.housing.segment)
    if name == "flange":
        if not layout.flange:
            return ()
        return _sections([s for s in layout.housing.segment if s.name == layout.flange])
    if layout.shaft is None:
        return ()
    segments = layout.shaft.segment
    if name == "nose":
        segments = [s for s in segments if s.z[1] <= layout.first + 1e-9]
    elif name == "drive_end":
        segments = [s for s in segments if s.z[0] >= layout.last - 1e-9]
    elif name == SHAFT_GAP:
        seats = [tuple(bearing.z) for _, bearing in spec.bearings]
        inner = [s for s in segments if s.z[0] >= layout.first - 1e-9 and s.z[1] <= layout.last + 1e-9]
        segments = [s for s in inner if not any(s.z[0] < z[1] and z[0] < s.z[1] for z in seats)]
    return _sections(segments)


def _of_part(spec: MachineSpec, name: str) -> tuple[Region, ...]:
    for part in spec.part:
        if part.name == name:
            return _sections(part.segment)
        for segment in part.segment:
            if name == f"{part.name}.{segment.name}":
                return _sections([segment])
    return ()


def _ends(value: float | Sequence[float]) -> tuple[float, float]:
    both = (value, value) if isinstance(value, (int, float)) else value
    return float(min(both)), float(max(both))


def _sections(segments: Sequence) -> tuple[Region, ...]:
    return tuple(Region(tuple(s.z), (0.5 * s.inner_diameter, 0.5 * s.outer_diameter)) for s in segments)
