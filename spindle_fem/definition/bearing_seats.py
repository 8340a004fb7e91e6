"""Parts that carry the rings of a bearing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal

from spindle_fem.definition.machine_spec import BallBearingType, BearingSet, BearingType, MachineSpec
from spindle_fem.definition.solid_tables import SetBearing
from spindle_fem.errors import SpecError, SpindleFemError

# An interference beyond this share of the diameter yields the ring (Harris: about 1e-3 at most)
LARGEST_FIT = 2.0e-3
# Share of a seat's diameter within which a face under its ring was to be the seat.
MEANT_AS_SEAT = 0.05


def seat_diameter(
    spec: MachineSpec, kind: BearingType, bearing: SetBearing, side: Literal["inner", "outer"]
) -> tuple[str, float] | None:
    """Part that carries a ring of a bearing: its name and the diameter of its far side, m.

    The far side of the shaft is its bore (0: solid), that of the housing its
    outside. None if no part has a seat there.
    """
    middle = 0.5 * (bearing.z[0] + bearing.z[1])
    for part in spec.part:
        for segment in part.segment:
            if part.rotating != (side == "inner") or not segment.z[0] <= middle <= segment.z[1]:
                continue
            near, far = segment.inner_diameter, segment.outer_diameter
            if side == "inner":
                near, far = far, near
            seat = kind.bore_diameter if side == "inner" else kind.outer_diameter
            if abs(near - seat) < 1.0e-6:
                return part.name, far
    return None


def seat_faults(spec: MachineSpec, group: BearingSet) -> Iterator[SpindleFemError]:
    """Rings of a set with a fit that sit on nothing, looser than their bearing or tighter than they bear."""
    found = {name: spec.bearing_types.get(name) for name in map(group.type_name, group.bearing)}
    kinds = {name: kind for name, kind in found.items() if isinstance(kind, BallBearingType)}
    for kind in kinds.values():
        yield from _fit_faults(group, kind)
    for bearing in group.bearing:
        kind = kinds.get(group.type_name(bearing))
        if kind is None:
            continue
        for side, diameter in (("inner", kind.bore_diameter), ("outer", kind.outer_diameter)):
            # A seat that no face touches is told by the geometry, with the face that is nearest.
            if seat_diameter(spec, kind, bearing, side) is None and _touches(spec, diameter, bearing):
                key, near = _nearest_face(spec, diameter, bearing, side)
                if abs(near - diameter) < MEANT_AS_SEAT * diameter:
                    yield SpecError(
                        key,
                        f"the {side} ring of {bearing.name} sits on no part: this face "
                        f"has {near * 1e3:g} mm, its seat {diameter * 1e3:g} mm.",
                        f"Allowed: {diameter * 1e3:g} mm.",
                    )
                    continue
                yield SpecError(
                    f"bearing_set.{group.name}.fit",
                    f"the {side} ring of {bearing.name} sits on no part: none that "
                    f"{'turns' if side == 'inner' else 'stands'} has a face of {diameter * 1e3:g} mm there.",
                    "Allowed: rings on a rotating and a standing part; or leave the fit out.",
                )


def _nearest_face(
    spec: MachineSpec, diameter: float, bearing: SetBearing, side: Literal["inner", "outer"]
) -> tuple[str, float]:
    """Key and diameter [m] of the face under a ring that is nearest to its seat's; infinite where none is."""
    middle = 0.5 * (bearing.z[0] + bearing.z[1])
    kind = "outer_diameter" if side == "inner" else "inner_diameter"
    faces = [
        (f"part.{part.name}.segment.{segment.name}.{kind}", getattr(segment, kind))
        for part in spec.part
        for segment in part.segment
        if part.rotating == (side == "inner") and segment.z[0] <= middle <= segment.z[1]
    ]
    return min(faces, key=lambda face: abs(face[1] - diameter), default=("", math.inf))


def _touches(spec: MachineSpec, diameter: float, bearing: SetBearing) -> bool:
    """Whether some part has a face of a diameter [m] somewhere along a bearing."""
    return any(
        segment.z[0] < bearing.z[1] and bearing.z[0] < segment.z[1]
        for part in spec.part
        for segment in part.segment
        if min(abs(each - diameter) for each in (segment.inner_diameter, segment.outer_diameter)) < 1.0e-6
    )


def _fit_faults(group: BearingSet, kind: BallBearingType) -> Iterator[SpindleFemError]:
    play = kind.play
    for key, clearance, diameter in (
        ("inner_interference", -group.fit.inner_interference, kind.bore_diameter),
        ("outer_clearance", group.fit.outer_clearance, kind.outer_diameter),
    ):
        if -clearance > LARGEST_FIT * diameter:
            yield SpecError(
                f"bearing_set.{group.name}.fit.{key}",
                f"the ring has {-clearance * 1e6:.0f} µm of interference on its seat of "
                f"{diameter * 1e3:g} mm, which makes it yield.",
                f"Allowed: up to {LARGEST_FIT * diameter * 1e6:.0f} µm on the diameter.",
            )
        if clearance > play:
            yield SpecError(
                f"bearing_set.{group.name}.fit.{key}",
                f"the ring has {clearance * 1e6:.0f} µm of clearance on its seat, more than the play "
                f"of the bearing itself ({play * 1e6:.0f} µm on the diameter).",
                "Give a tighter fit, or leave the fit out.",
            )


def followed_joint_faults(spec: MachineSpec) -> Iterator[SpindleFemError]:
    """Joints that are to conduct as fits press, but have no fit or nothing to change."""
    for joint in spec.joint:
        if joint.seat is None:
            continue
        where = f"joint.{joint.name}.seat"
        if joint.conductance == "perfect":
            yield SpecError(where, 'its conductance is "perfect".', "Give the conductance as assembled.")
        if not any(group.fit is not None for group in spec.bearing_set):
            yield SpecError(
                where, "no bearing set has a fit.", "Give bearing_set.fit, or leave the seat out."
            )
