"""A table of heat against speed for every bearing, as the definition has it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spindle_fem.physics.bearings.heat_models import HEAT_MODELS


@HEAT_MODELS.register
def table(speed: float, speeds: Sequence[float], heat: Sequence[float]) -> float:
    """Heat at a speed, linear between the entries of a table; the end segments go on.

    Parameters
    ----------
    speed : float, [rad/s]
    speeds : (n,) sequence, [rad/s]
        Growing, at least two.
    heat : (n,) sequence, [W]

    >>> table(150.0, [0.0, 100.0, 200.0], [0.0, 10.0, 40.0])
    25.0
    """
    segment = int(np.clip(np.searchsorted(speeds, speed, side="right") - 1, 0, len(speeds) - 2))
    fraction = (speed - speeds[segment]) / (speeds[segment + 1] - speeds[segment])
    return heat[segment] + fraction * (heat[segment + 1] - heat[segment])
