"""Names of places around probes, of sides of standing parts and of seats, known before there is a mesh."""

from __future__ import annotations

from spindle_fem.definition.machine_spec import MachineSpec, Probe

# A patch of a probe's own part around it, and the ring about the axis through it.
NEAR, AROUND = "near.", "around."
# First harmonics around the axis of a standing place: along y, where a probe's angle is 0, and along -x.
UP, ACROSS = "up.", "across."
# Growth of seats of shaft and housing, as temperatures of bodies that are as warm all over.
GROWTH = "growth."
# Root mean square distance from the probe, in space, of a patch that no wall cuts, m.
STANDARD_DISTANCE = 20e-3


def ringed_probes(spec: MachineSpec) -> tuple[Probe, ...]:
    """Point probes in standing parts, away from the bearings: a bearing is a ring itself."""
    standing = {part.name for part in spec.part if not part.rotating}
    sets = [[z for bearing in group.bearing for z in bearing.z] for group in spec.bearing_set]
    return tuple(
        probe
        for probe in spec.probe
        if probe.kind == "point"
        and probe.part in standing
        and not any(min(ends) <= probe.z <= max(ends) for ends in sets)
    )


def sided_names(spec: MachineSpec) -> tuple[str, ...]:
    """Places that have sides: segments of standing parts with more than one."""
    return tuple(
        f"{part.name}.{segment.name}"
        for part in spec.part
        if not part.rotating and len(part.segment) > 1
        for segment in part.segment
    )


def growth_names(spec: MachineSpec) -> dict[str, tuple[str, str]]:
    """Places of the seats of every bearing with fits, on shaft and in housing; empty where one is missing."""
    if {part.rotating for part in spec.part} != {False, True}:
        return {}
    return {
        bearing.name: (f"{GROWTH}{bearing.name}.shaft", f"{GROWTH}{bearing.name}.housing")
        for group, bearing in spec.bearings
        if group.fit is not None
    }
