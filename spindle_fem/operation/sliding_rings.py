"""Outer rings that are to slide along their seats, and the friction that holds them there."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.definition.machine_spec import BearingSet
from spindle_fem.validity import CodedWarning


def sliding_rings(group: BearingSet) -> tuple[str, ...]:
    """Bearings of a set whose outer rings are to slide in the housing.

    All of a set that does not hold the shaft along the axis, which moves with it; of one that does, those
    that springs press against the others.
    """
    if not group.carries_thrust:
        return tuple(bearing.name for bearing in group.bearing)
    if group.is_sprung:
        return tuple(b.name for b in group.bearing if b.takes_thrust == "towards_nose")
    return ()


def stuck_rings(group: BearingSet, pressing: Mapping[str, tuple[float, float]]) -> tuple[CodedWarning, ...]:
    """Warning of rings that friction holds with more than what is to move them.

    Parameters
    ----------
    pressing : mapping of bearing to (float, float)
        Pressure on the seat of each outer ring (Pa) and its area (m²).
    """
    sliding = sliding_rings(group)
    if group.fit is None or group.preload == 0.0 or not sliding:
        return ()
    held = group.fit.seat_friction * sum(pressure * area for pressure, area in map(pressing.get, sliding))
    if held <= group.preload:
        return ()
    pressure = max(pressing[name][0] for name in sliding)
    by = "the force of the springs" if group.is_sprung else "the preload of the set"
    where = f"bearing_set.{group.name}.fit"
    advice = f"Raise {where}.outer_clearance"
    if group.is_sprung and not group.faces_one_way:
        advice += f', or see with {where}.outer_ring = "held" what the preload becomes when they stay'
    text = (
        f"{', '.join(sliding)}: outer rings that are to slide in the housing stick: seats pressed with up to "
        f"{pressure / 1e6:.2f} MPa hold them with {held:.0f} N (friction {group.fit.seat_friction:g}), more "
        f"than {by}, {group.preload:.0f} N. {advice}."
    )
    return (CodedWarning("ring_sticks", text),)
