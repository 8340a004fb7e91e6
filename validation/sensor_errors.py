"""How a lying channel distorts what it reads: offset, gain, lag, drift, loose contact, shifted clock.

Temperatures °C, times s.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Sensor:
    """What a lying channel does to its readings; ``kind`` is the effect's name."""

    kind: str
    channel: int
    size: float
    onset: float = 0.0
    shape: float = 1.0

    def apply(
        self, time: NDArray[np.float64], readings: NDArray[np.float64], ambient: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Readings (n, 6) as the recorder got them."""
        out = readings.copy()
        y = readings[:, self.channel]
        if self.kind == "sensor_offset":
            changed = y + self.size
        elif self.kind == "sensor_gain":
            changed = 20.0 + self.size * (y - 20.0)
        elif self.kind == "sensor_lag":
            changed = first_order(time, y, self.size)
        elif self.kind == "sensor_drift":
            hours = time / 3600.0
            changed = y + self.size * hours[-1] * (hours / hours[-1]) ** self.shape
        elif self.kind == "sensor_detached":
            loose = (
                1.0 / (1.0 + np.exp(-(time - self.onset) / 60.0)) if self.onset > 0 else np.ones_like(time)
            )
            changed = y - self.size * loose * (y - ambient)
            # The worse the contact, the slower: the share of air and the lag grow together.
            changed = first_order(time, changed, np.maximum(400.0 * self.shape * self.size * loose, 1e-3))
        else:
            changed = np.interp(time - self.size, time, y)
        out[:, self.channel] = changed
        return out


def first_order(
    time: NDArray[np.float64], value: NDArray[np.float64], constant: float | NDArray[np.float64]
) -> NDArray[np.float64]:
    """Response of a first-order sensor on a uniform step, exact for linear segments; its constant may change.

    >>> first_order(np.arange(3.0), np.array([0.0, 0.0, 0.0]), 5.0).tolist()
    [0.0, 0.0, 0.0]
    """
    step = time[1] - time[0]
    constant = np.broadcast_to(constant, value.shape)
    keep = np.exp(-step / constant)
    slope_part = 1.0 - (1.0 - keep) * constant / step
    out = np.empty_like(value)
    out[0] = value[0]
    for k in range(1, value.size):
        kept = keep[k] * out[k - 1] + (1 - keep[k]) * value[k - 1]
        out[k] = kept + slope_part[k] * (value[k] - value[k - 1])
    return out
