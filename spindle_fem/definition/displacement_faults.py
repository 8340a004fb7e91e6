"""Displacement sensors that look at nothing or hang on nothing; machines that are to grow, but cannot."""

from __future__ import annotations

from collections.abc import Iterator

from spindle_fem.definition.machine_spec import DisplacementSensor, MachineSpec
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
    z, radius = sensor.at.z, sensor.at.radius
    for part in spec.part:
        for segment in part.segment if part.rotating else ():
            low, high = segment.z
            radii = (0.5 * segment.inner_diameter, 0.5 * segment.outer_diameter)
            on_cylinder = abs(radius - radii[1]) < _TOLERANCE and low - _TOLERANCE <= z <= high + _TOLERANCE
            on_end = (
                min(abs(z - low), abs(z - high)) < _TOLERANCE
                and radii[0] - _TOLERANCE <= radius <= radii[1] + _TOLERANCE
            )
            if on_cylinder or on_end:
                return
    yield SpecError(
        where,
        f"nothing that turns has a face at z {z * 1e3:g} mm, radius {radius * 1e3:g} mm.",
        "Put it on an end or on the outside of a segment of the shaft.",
    )


def _mount(spec: MachineSpec, sensor: DisplacementSensor) -> Iterator[SpindleFemError]:
    standing = {s.name: s for part in spec.part if not part.rotating for s in part.segment if s.name}
    if sensor.mount not in standing:
        yield SpecError(
            f"displacement_sensor.{sensor.name}.mount",
            f'"{sensor.mount}" is no segment of a standing part.',
            did_you_mean(sensor.mount, standing),
        )
