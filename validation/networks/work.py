"""Programmes: what machines do through shifts, nights and weekends, and what the room does meanwhile."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
DAY = 86_400.0


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """One draw, even in the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def stretches(rng: np.random.Generator, number: int, shortest: float, longest: float) -> list[slice]:
    """Slices that cover ``number`` steps, each between two lengths in steps, even in the logarithm."""
    out, at = [], 0
    while at < number:
        end = at + max(1, round(log_uniform(rng, shortest, longest)))
        out.append(slice(at, min(end, number)))
        at = end
    return out


def levels(rng: np.random.Generator, number: int, spans: tuple[float, float], off: float = 0.25) -> Array:
    """Levels between 0.2 and 1 held for a while, off in a share of them."""
    out = np.zeros(number)
    for part in stretches(rng, number, *spans):
        out[part] = 0.0 if rng.random() < off else rng.uniform(0.2, 1.0)
    return out


def shifts(rng: np.random.Generator, time: Array) -> NDArray[np.bool_]:
    """While people work: days with one to three shifts, breaks, weekends mostly off."""
    weekday = int(rng.integers(7))
    begin = rng.uniform(5.5, 8.0)
    length = float(rng.choice([8.0, 9.0, 15.5, 22.0], p=[0.25, 0.25, 0.35, 0.15]))
    phase = rng.uniform(0.0, 24.0)
    hours = time / 3600.0 + phase
    on = np.zeros(time.size, dtype=bool)
    for day in range(int(hours[-1] // 24) + 1):
        free = (weekday + day) % 7 >= 5 and rng.random() < 0.8
        if not free:
            start = 24.0 * day + begin + rng.normal(0.0, 0.3)
            on |= (hours >= start) & (hours < start + length + rng.normal(0.0, 0.4))
    return on


def parts(rng: np.random.Generator, step: float, on: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Parts machined one after another: level while cutting, jobs' second level, how hard it cuts; 0 to 1."""
    n = on.size
    first, second, load = np.zeros(n), np.zeros(n), np.zeros(n)
    for job in stretches(rng, n, 2400.0 / step, 16_000.0 / step):
        if rng.random() < 0.15:
            continue
        cycle = max(4, round(log_uniform(rng, 60.0, 500.0) / step))
        pattern = np.zeros((3, cycle))
        for piece in stretches(rng, cycle, cycle / 6, cycle / 2):
            pattern[0, piece] = rng.choice([0.25, 0.5, 0.7, 0.85, 1.0])
            pattern[1, piece] = rng.choice([0.0, 0.0, 0.4, 0.8])
            pattern[2, piece] = rng.uniform(0.05, 0.6)
        pattern[:, : max(1, round(rng.uniform(0.05, 0.3) * cycle))] = 0.0
        length = job.stop - job.start
        tiled = np.tile(pattern, length // cycle + 1)[:, :length]
        first[job], second[job], load[job] = tiled[0], tiled[1], tiled[2] * (tiled[0] > 0)
        if rng.random() < 0.5:
            second[job] = 0.0
    return first * on, second * on, load * on


def room(rng: np.random.Generator, time: Array, swing: float) -> Array:
    """Room temperature, °C: a mean, a day's swing, what wanders; all within ``swing``, K, peak to peak."""
    hours = time / 3600.0
    phase, skew = rng.uniform(0.0, 24.0), rng.uniform(-0.4, 0.4)
    turn = 2.0 * np.pi * (hours - phase) / 24.0
    noons = np.arange(0.0, hours[-1] + 48.0, 24.0)
    days = np.interp(hours, noons, rng.normal(0.0, 0.2 * swing, noons.size))
    keep = np.exp(-(time[1] - time[0]) / 2400.0)
    wander = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal(time.size))
    shape = 0.5 * swing * np.sin(turn + skew * np.sin(turn)) + days + 0.06 * swing * wander
    # Over days the whole of it spans the swing; a short recording sees a part of a day.
    return rng.uniform(17.0, 26.0) + shape * min(1.0, swing / max(float(np.ptp(shape)), 1e-9))
