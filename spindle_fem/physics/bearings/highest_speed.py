"""Speed that no rolling bearing of a diameter runs at."""

from __future__ import annotations

import numpy as np

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import SpecError

# Speed times pitch diameter, m·rad/s: 5 million mm/min. On a rig, ball bearings of 120 mm bore (pitch
# diameter 155 mm) ran at 25,000 rpm, 3.9 million: Zaretsky, Bamberger and Signer (1974), NASA TN D-7837.
_PITCH_SPEED = 5.0e3 * 2.0 * np.pi / 60.0


def highest_speed(pitch_diameter: float) -> float:
    """Speed that no rolling bearing of a pitch diameter [m] reaches, rad/s; infinite for none.

    >>> round(highest_speed(0.1) * 30.0 / np.pi)
    50000
    """
    return _PITCH_SPEED / pitch_diameter if pitch_diameter > 0.0 else np.inf


def too_fast(spec: MachineSpec, speed: float) -> str | None:
    """Why the bearings of a machine cannot turn at a speed [rad/s]; None where they may or it is NaN."""
    # In a definition with other faults, bearings may be of no known type.
    types = [spec.bearing_types.get(group.type_name(bearing)) for group, bearing in spec.bearings]
    pitch = max((kind.pitch for kind in types if kind is not None), default=0.0)
    return why_too_fast(pitch, speed)


def file_speed_faults(file: str, pitch_diameter: float, speed: float) -> list[SpecError]:
    """Fault of a bearing file whose bearing [m] cannot turn at its speed [rad/s]."""
    why = why_too_fast(pitch_diameter, speed)
    what = f"speed is {speed * 30.0 / np.pi:g} rpm."
    return [SpecError(f"{file}: operation.speed", what, why)] if why else []


def why_too_fast(pitch_diameter: float, speed: float) -> str | None:
    """Why no bearing of a pitch diameter [m] turns at a speed [rad/s]; None where one may or it is NaN.

    >>> why_too_fast(0.1, 6000.0)
    'No rolling bearing of 100 mm pitch diameter runs above 50000 rpm; is the unit right?'
    """
    highest = highest_speed(pitch_diameter)
    if not abs(speed) > highest:
        return None
    return (
        f"No rolling bearing of {1e3 * pitch_diameter:.0f} mm pitch diameter runs above "
        f"{highest * 30.0 / np.pi:.0f} rpm; is the unit right?"
    )
