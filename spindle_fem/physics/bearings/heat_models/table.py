"""A table of heat against speed for every bearing, of first order in the thrust."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.physics.bearings.heat_models import HEAT_MODELS


@HEAT_MODELS.register
def table(
    speed: ArrayLike,
    speeds: ArrayLike,
    heats: ArrayLike,
    thrust: ArrayLike = 1.0,
    *,
    thrust_coefficient: float = 0.0,
    reference_thrust: float = 1.0,
) -> NDArray[np.float64]:
    """Friction heat, straight between the entries of the table and on beyond its last one.

    Parameters
    ----------
    speed : (n,) array_like or float, [rad/s]
    speeds : (k,) array_like, [rad/s]
        Increasing, two or more.
    heats : (k,) array_like, [W]
        At the reference thrust.
    thrust : (n,) array_like or float, [N]
    thrust_coefficient : float, [-]
        c of the factor ``1 + c (thrust / reference_thrust - 1)``.
    reference_thrust : float, [N]

    Returns
    -------
    (n,) ndarray, [W]
        Never negative.

    >>> float(table(150.0, [0.0, 100.0, 200.0], [0.0, 10.0, 40.0]))
    25.0
    """
    grid, values = np.asarray(speeds, dtype=float), np.asarray(heats, dtype=float)
    at = np.asarray(speed, dtype=float)
    segment = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, grid.size - 2)
    fraction = (at - grid[segment]) / (grid[segment + 1] - grid[segment])
    nominal = values[segment] + fraction * (values[segment + 1] - values[segment])
    factor = 1.0 + thrust_coefficient * (np.asarray(thrust, dtype=float) / reference_thrust - 1.0)
    return np.maximum(0.0, nominal * factor)
