"""Load cycles, rooms and oil temperatures like those of a test bench."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .stepping import Drive

STEP = 10.0
_BLOCK = 60.0
_SPEEDS = np.array([800, 1500, 2200, 3000, 3600, 4200, 4500, 0])
_THRUSTS = np.array([0, 500, 1750, 2500, 3500])
CYCLES = ("hold", "staircase", "intermittent", "random", "two_level")


@dataclass(frozen=True, slots=True)
class Plan:
    """Choices for one recording."""

    cycle: str
    oil: str
    drive: Drive


def _schedule(cycle: str, rng: np.random.Generator, blocks: int) -> tuple[NDArray, NDArray]:
    speed, thrust = np.zeros(blocks), np.zeros(blocks)
    start = 5
    if cycle == "hold":
        stop = min(blocks - 40, 245)
        speed[start:stop] = rng.choice([2500, 3000, 3000, 3500, 4000])
        thrust[start:stop] = 1750
    elif cycle == "staircase":
        length = int(rng.integers(24, 29))
        levels = np.arange(500, 4501, 500)
        if rng.random() < 0.25:
            levels = np.concatenate([levels[::2], levels[-2::-2]])
        for number, level in enumerate(levels):
            here = slice(start + number * length, start + (number + 1) * length)
            speed[here], thrust[here] = level, 1750
    elif cycle == "intermittent":
        top = rng.choice([3000, 3600, 4000, 4500])
        on, off = int(rng.integers(12, 24)), int(rng.integers(11, 16))
        at = start
        while at < blocks - on - 40:
            speed[at : at + on], thrust[at : at + on] = top, 1750
            low = rng.choice([0, 0, 500, 1000])
            speed[at + on : at + on + off], thrust[at + on : at + on + off] = low, 1750 * (low > 0)
            at += on + off
    elif cycle == "random":
        at, stop = start, blocks - int(rng.integers(25, 60))
        while at < stop:
            length = int(rng.integers(3, 22))
            at_speed = rng.choice(_SPEEDS)
            here = slice(at, min(at + length, stop))
            speed[here], thrust[here] = at_speed, rng.choice(_THRUSTS) * (at_speed > 0)
            at += length
            if rng.random() < 0.4:
                longer = slice(at, min(at + length, stop))
                speed[longer], thrust[longer] = at_speed, rng.choice(_THRUSTS) * (at_speed > 0)
                at += length
    else:
        half = int(blocks * 0.42)
        low, high = rng.choice([1500, 2000, 2500]), rng.choice([3500, 4000, 4500])
        speed[start:half], speed[half : blocks - 40] = low, high
        thrust[start : blocks - 40] = rng.choice([500, 1750, 2500])
    for values in (speed, thrust):
        jumps = np.flatnonzero(np.diff(values)) + 1
        middle = [0.5 * (values[j - 1] + values[j]) for j in jumps]
        values[jumps - 1] = middle
    return np.round(speed / 50) * 50, np.round(thrust / 125) * 125


def draw_drive(rng: np.random.Generator, *, cycle: str | None = None, oil: str | None = None) -> Plan:
    """Draw a load cycle of 4 to 6 hours, with its room and oil temperatures."""
    cycle = cycle or str(rng.choice(CYCLES, p=[0.25, 0.2, 0.2, 0.3, 0.05]))
    oil = oil or str(rng.choice(["constant", "step", "stairs"], p=[0.55, 0.3, 0.15]))
    blocks = int(rng.integers(285, 352))
    speed, thrust = _schedule(cycle, rng, blocks)
    per_block = int(_BLOCK / STEP)
    n = blocks * per_block
    time = np.arange(n) * STEP
    total = time[-1]
    ambient = rng.uniform(16.5, 21.5) + rng.normal(0.0, 1.3) * time / total
    phase = rng.uniform(0, 2 * np.pi)
    swing = np.sin(2 * np.pi * time / rng.uniform(5000, 16000) + phase) - np.sin(phase)
    ambient += rng.uniform(0.05, 0.5) * swing
    set_point = np.full(n, rng.choice([15.0, 15.0, 17.0, 20.0, 22.0]))
    if oil == "step":
        set_point[int(rng.uniform(0.3, 0.6) * n) :] = rng.choice([28.0, 33.0, 25.0])
    elif oil == "stairs":
        levels = rng.permutation([15.0, 22.0, 29.0, 36.0])
        set_point = levels[np.minimum((np.arange(n) * 4) // n, 3)]
    coolant = np.empty(n)
    value = set_point[0]
    keep = np.exp(-STEP / 330.0)
    for k in range(n):
        value = set_point[k] + (value - set_point[k]) * keep
        coolant[k] = value
    expand = np.repeat
    return Plan(
        cycle, oil, Drive(time, expand(speed, per_block), expand(thrust, per_block), ambient, coolant)
    )
