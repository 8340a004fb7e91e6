"""Displacement sensors that look at nothing or hang on nothing; machines that are to grow, but cannot."""

from __future__ import annotations

from collections.abc import Iterator

from spindle_fem.definition.displacement_tables import FRAME, DisplacementSensor, MountSpot, SensorSpot
from spindle_fem.definition.housing_flange import flange_of, housing_of
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import SpecError, SpindleFemError, did_you_mean

_TOLERANCE = 1.0e-6


def displacement_faults(spec: MachineSpec) -> Iterator[SpindleFemError]:
    """Every fault of the displacement sensors of a machine, and of materials that must expand."""
    for sensor in spec.displacement_sensor:
        yield from _target(spec, sensor)
        yield from _mount(spec, sensor)
    reads = "displacement sensors read how parts grow" if spec.displacement_sensor else ""
    if spec.displacement_sensor and not spec.bearing_set:
        first = spec.displacement_sensor[0].name
        what = "no bearing holds the shaft."
        yield SpecError(f"displacement_sensor.{first}", what, "Add a [[bearing_set]].")
    if spec.heat is not None and spec.follows_preload:
        reads = reads or "heat.thermal_preload follows how parts grow"
    for name in dict.fromkeys(part.material for part in spec.part) if reads else ():
        material = spec.materials.get(name)
        if material is not None and not material.thermal_expansion > 0.0:
            what = f"it is 0, but {reads}."
            yield SpecError(f"materials.{name}.thermal_expansion", what, 'Give it, such as "1.2e-5 1/K".')


def _target(spec: MachineSpec, sensor: DisplacementSensor) -> Iterator[SpindleFemError]:
    where = f"displacement_sensor.{sensor.name}.at"
    turning = {part.name for part in spec.part if part.rotating}
    if isinstance(sensor.at, str):
        surfaces = [surface.name for surface in spec.surface if surface.part in turning]
        if sensor.at not in surfaces:
            yield SpecError(
                where,
                f'"{sensor.at}" is no surface of a turning part.',
                did_you_mean(sensor.at, surfaces) or "Give a surface, or z, radius and angle of a spot.",
            )
        return
    if not _is_face(spec, sensor.at, rotating=True):
        yield SpecError(
            where,
            f"nothing that turns has a face at {_words(sensor.at)}.",
            "Put it on an end or on the outside of a segment of the shaft.",
        )


def _words(spot: SensorSpot | MountSpot) -> str:
    return f"z {spot.z * 1e3:g} mm, radius {spot.radius * 1e3:g} mm"


def _is_face(spec: MachineSpec, spot: SensorSpot | MountSpot, *, rotating: bool) -> bool:
    """Whether a spot lies on an end or on the outside of a segment that turns, or of one that stands."""
    for part in spec.part:
        for segment in part.segment if part.rotating is rotating else ():
            low, high = segment.z
            radii = (0.5 * segment.inner_diameter, 0.5 * segment.outer_diameter)
            along = low - _TOLERANCE <= spot.z <= high + _TOLERANCE
            across = radii[0] - _TOLERANCE <= spot.radius <= radii[1] + _TOLERANCE
            on_end = min(abs(spot.z - low), abs(spot.z - high)) < _TOLERANCE
            if (along and abs(spot.radius - radii[1]) < _TOLERANCE) or (across and on_end):
                return True
    return False


def _mount(spec: MachineSpec, sensor: DisplacementSensor) -> Iterator[SpindleFemError]:
    where = f"displacement_sensor.{sensor.name}.mount"
    if isinstance(sensor.mount, MountSpot):
        if not _is_face(spec, sensor.mount, rotating=False):
            yield SpecError(
                where,
                f"nothing that stands has a face at {_words(sensor.mount)}.",
                "Put it on an end or on the outside of a segment of the housing or a cover.",
            )
        return
    standing = [part for part in spec.part if not part.rotating]
    segments = [segment.name for part in standing for segment in part.segment if segment.name]
    parts = {part.name for part in standing}
    surfaces = [surface.name for surface in spec.surface if surface.part in parts]
    if sensor.mount not in (FRAME, *segments, *surfaces):
        flange = flange_of(housing_of(spec.part))
        none = "" if flange else "; the housing has no flange, so neither a segment nor a frame holds it"
        allowed = did_you_mean(sensor.mount, [*([flange, FRAME] if flange else []), *surfaces])
        yield SpecError(
            where,
            f'"{sensor.mount}" is no segment or surface of a standing part{none}.',
            f"{allowed} Or z and radius of a spot on a standing part.",
        )
