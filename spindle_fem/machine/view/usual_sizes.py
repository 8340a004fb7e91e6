"""Sizes that a recording has: speeds, rises, inputs, and what heat may follow of it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.machine_view import RecordedQuantity
from spindle_fem.effects.framework.term import COVARIATE
from spindle_fem.recordings.align import Recording
from spindle_fem.units import TEMPERATURE_UNIT, registry

Array = NDArray[np.float64]

# Channels rise at least this much, K, and heat is at least this much, W, for usual sizes of effects.
LEAST_RISE = 2.0
LEAST_HEAT = 1.0
# A quantity is on above this share of its largest value; number of quantiles that represent its levels.
LEAST_ON, QUANTILES = 0.05, 32
# Share of the time that a machine turns for which it is slow.
LOW = 0.1
# Units that have a name, by what they come out as from SI base units.
NAMED = {"kg*m/s**2": "N", "kg*m**2/s**3": "W"}


def input_series(recording: Recording, name: str, otherwise: float) -> Array:
    """An input at every stamp; a constant where it is not recorded."""
    if name not in recording.input_names:
        return np.full(recording.times.size, otherwise)
    return recording.input_at(name, recording.times)


def lowest_speed(speed: Array) -> float:
    """Speed that is not exceeded for a tenth of the rows above standstill.

    >>> lowest_speed(np.array([0.0, 0.0, 1.0, *[100.0] * 20, 300.0]))
    100.0
    """
    turning = speed[speed > 1e-3 * max(float(speed.max()), 1e-12)]
    return float(np.quantile(turning, LOW)) if turning.size else 0.0


def usual_rise(recording: Recording, ambient: Array) -> float:
    """Usual deviation of the channels from the ambient temperature: the 95th percentile, K."""
    difference = np.abs(np.where(recording.usable, recording.temperature, np.nan) - ambient[:, None])
    if not np.isfinite(difference).any():
        return LEAST_RISE
    return max(LEAST_RISE, float(np.nanpercentile(difference, 95.0)))


def quantities_of(recording: Recording, speeds: Collection[str]) -> tuple[RecordedQuantity, ...]:
    """Loads and covariates, and changes of speeds; temperatures, flows and heat have laws of their own.

    Parameters
    ----------
    speeds : collection of str
        Inputs that are speeds.
    """
    found, times = [], recording.times
    for name, unit in zip(recording.input_names, recording.input_units, strict=True):
        if unit != TEMPERATURE_UNIT and name != "coolant_flow" and not name.startswith("heat."):
            changes = name in speeds
            values = recording.input_at(name, times)
            found.append(
                _quantity(f"change of {name}" if changes else name, name, times, values, unit, changes)
            )
    units = dict(zip(recording.covariate_names, recording.covariate_units, strict=True))
    for name, values in recording.covariate_history().items():
        if units[name] != TEMPERATURE_UNIT:
            found.append(replace(_quantity(name, COVARIATE + name, times, values, units[name]), beside=True))
    return tuple(item for item in found if item.highest > 0.0)


def _quantity(
    name: str, own: str, times: Array, values: Array, unit: str, changes: bool = False
) -> RecordedQuantity:
    size = np.abs(values)
    highest = float(size.max())
    if changes:
        sizes = np.abs(np.diff(size**2))
        levels = sizes[sizes > LEAST_ON * highest**2]
    else:
        on = np.flatnonzero(size > LEAST_ON * highest)
        order = on[np.argsort(size[on])]
        passed = np.cumsum(np.gradient(times)[order]) if order.size else np.zeros(0)
        wanted = (np.arange(QUANTILES) + 0.5) / QUANTILES
        levels = np.interp(wanted * passed[-1], passed, size[order]) if order.size else order
    varies = float(np.ptp(size)) / max(highest, 1e-300)
    return RecordedQuantity(name, own, highest, varies, tuple(levels.tolist()), short_unit(unit), changes)


def short_unit(unit: str) -> str:
    """An SI base unit as people write it.

    >>> short_unit("kilogram * meter ** 2 / second ** 3"), short_unit("radian / second")
    ('W', 'rad/s')
    """
    short = f"{registry().Unit(unit or 'dimensionless'):~C}"
    return NAMED.get(short, short)


def common_quantities(
    by_recording: Sequence[Sequence[RecordedQuantity]],
) -> tuple[RecordedQuantity, ...]:
    """Quantities that every one of several recordings has, with the widest range of each."""
    found = []
    for item in by_recording[0]:
        same = [other for own in by_recording for other in own if other.name == item.name]
        if len(same) == len(by_recording):
            found.append(
                replace(
                    item,
                    highest=max(other.highest for other in same),
                    varies=max(other.varies for other in same),
                    levels=tuple(level for other in same for level in other.levels),
                )
            )
    return tuple(found)
