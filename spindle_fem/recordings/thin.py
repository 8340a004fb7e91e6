"""Long recordings averaged over bins of time, so that months of them can be fitted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import OutOfValidityError, RecordingError
from spindle_fem.recordings.align import SMALLEST_SIGMA, Recording
from spindle_fem.recordings.channel_checks import Flag
from spindle_fem.recordings.defects import Thinning
from spindle_fem.units import ANGULAR_SPEED_UNIT

Array = NDArray[np.float64]

# A bin's mean is used if at least this share of its rows is usable.
LEAST_SHARE = 0.5


def thinned_recording(
    recording: Recording, step: float, *, exponents: Mapping[str, float] | None = None
) -> Recording:
    """Means over bins of time.

    A stamp is the mean time of a bin's rows, to half a median step of the
    recording. Temperatures and covariates are means of what can be used in
    the bin; a channel of which less than half can be used there is flagged as
    missing. Inputs keep their integral: one that is held is averaged from a
    stamp to the next, one that is joined by straight lines over the bin.
    Rotational speeds lose their direction. No bin reaches over a long gap.

    Parameters
    ----------
    step : float, [s]
        Length of a bin.
    exponents : mapping of input to float, optional
        Inputs whose power is to be averaged, as heat that grows with a power
        of speed needs it: the bin's value is ``mean(x^p)^(1/p)``.

    Returns
    -------
    Recording
        With the noise of the means, their quantisation kept, and the counts in
        ``defects.thinned``.

    Raises
    ------
    RecordingError
        A step that is not positive, or so long that fewer than two bins are left.
    OutOfValidityError
        A negative input whose power is requested.
    """
    if not step > 0.0:
        raise RecordingError(recording.source, f"bins of {step:g} s.", "Allowed: above 0.")
    label, segments = _bins(recording, step)
    n_bins = int(label[-1]) + 1
    if n_bins < 2:
        raise RecordingError(
            recording.source, f"bins of {step:g} s leave {n_bins} of it.", "Take a shorter step."
        )
    count = np.bincount(label)
    stamps = _stamps(recording, label, count, segments)
    used = recording.usable & np.isfinite(recording.temperature)
    temperature, number = _means(np.where(used, recording.temperature, np.nan), label, n_bins)
    missing = number < LEAST_SHARE * count[:, None]
    temperature[missing] = np.nan
    per_bin = np.array([np.median(n[n > 0]) if np.any(n > 0) else 1.0 for n in number.T])
    averaged = [
        replace(item, white=item.white / np.sqrt(n)) for item, n in zip(recording.noise, per_bin, strict=True)
    ]
    rounding = np.array([item.coarse_step for item in recording.noise]) / np.sqrt(12.0)
    sigma = np.sqrt(recording.sigma**2 / per_bin + rounding**2)
    counts = Thinning(
        step,
        recording.times.size,
        n_bins,
        int(np.count_nonzero(missing)),
        int((~used).sum()),
    )
    thinned = replace(
        recording,
        times=stamps,
        whole_spacing=None,
        temperature=temperature,
        flags=np.where(missing, np.uint8(Flag.MISSING), np.uint8(0)),
        sigma=np.clip(sigma, SMALLEST_SIGMA, np.maximum(recording.sigma, SMALLEST_SIGMA)),
        noise=tuple(averaged),
        inputs=_inputs(recording, label, count, stamps, segments, exponents or {}),
        covariates=_means(recording.covariates, label, n_bins)[0],
        segments=segments,
        defects=replace(recording.defects, thinned=counts),
    )
    for array in (thinned.times, thinned.temperature, thinned.flags, thinned.inputs, thinned.sigma):
        array.setflags(write=False)
    return thinned


def _bins(recording: Recording, step: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Bin of every row, counted through the recording, and the bins of every segment."""
    label = np.empty(recording.times.size, dtype=np.int64)
    segments = np.empty_like(recording.segments)
    first = 0
    for number, (begin, end) in enumerate(recording.segments):
        times = recording.times[begin:end]
        _, own = np.unique(np.floor((times - times[0]) / step * (1.0 + 1e-12)), return_inverse=True)
        label[begin:end] = first + own.reshape(-1)
        segments[number] = first, first + int(own.max()) + 1
        first = int(segments[number, 1])
    return label, segments


def _stamps(
    recording: Recording, label: NDArray[np.int64], count: NDArray[np.int64], segments: NDArray[np.int64]
) -> Array:
    """Mean time of every bin, on a lattice so that few lengths of steps are left."""
    means = np.bincount(label, recording.times) / count
    spacing = 0.5 * float(np.median(np.diff(recording.times)))
    origin = np.repeat(recording.times[recording.segments[:, 0]], np.diff(segments, axis=1).ravel())
    rounded = origin + np.round((means - origin) / spacing) * spacing
    return rounded if np.all(np.diff(rounded) > 0.0) else means


def _means(values: Array, label: NDArray[np.int64], n_bins: int) -> tuple[Array, Array]:
    """Mean of the finite values of each column in each bin, and their number; NaN where there are none."""
    found, number = np.full((n_bins, values.shape[1]), np.nan), np.zeros((n_bins, values.shape[1]))
    for column, series in enumerate(values.T):
        present = np.isfinite(series)
        number[:, column] = np.bincount(label[present], minlength=n_bins)
        total = np.bincount(label[present], series[present], minlength=n_bins)
        some = number[:, column] > 0
        found[some, column] = total[some] / number[some, column]
    return found, number


def _inputs(
    recording: Recording,
    label: NDArray[np.int64],
    count: NDArray[np.int64],
    stamps: Array,
    segments: NDArray[np.int64],
    exponents: Mapping[str, float],
) -> Array:
    times = recording.times
    first_row = np.concatenate(([0], np.cumsum(count)[:-1]))
    last_row = np.cumsum(count) - 1
    # A held input is averaged until the next stamp, at the end of a segment until its last row.
    until = np.append(stamps[1:], times[-1])
    until[segments[:, 1] - 1] = times[recording.segments[:, 1] - 1]
    history = recording.input_history()
    found = np.empty((len(stamps), len(history.names)))
    for column, name in enumerate(history.names):
        values = history.values[:, column]
        if recording.input_units[column] == ANGULAR_SPEED_UNIT:
            values = np.abs(values)
        exponent = exponents.get(name, 1.0)
        if exponent != 1.0:
            if np.any(values < 0.0):
                raise OutOfValidityError(
                    f'input "{name}"', f"falls to {values.min():g}, which has no power {exponent:g}.", ""
                )
            values = values**exponent
        if history.held[column]:
            means = _held_mean(times, values, stamps, until)
        else:
            means = _linear_mean(times, values, times[first_row], times[last_row])
        found[:, column] = means ** (1.0 / exponent) if exponent != 1.0 else means
    return found


def _held_mean(times: Array, values: Array, begin: Array, end: Array) -> Array:
    """Means of a series that holds, over intervals."""
    integral = np.concatenate(([0.0], np.cumsum(values[:-1] * np.diff(times))))

    def until(at: Array) -> Array:
        row = np.clip(np.searchsorted(times, at, side="right") - 1, 0, times.size - 1)
        return integral[row] + values[row] * (at - times[row])

    length = end - begin
    row = np.clip(np.searchsorted(times, begin, side="right") - 1, 0, times.size - 1)
    some = length > 0.0
    found = values[row].astype(float)
    found[some] = (until(end) - until(begin))[some] / length[some]
    return found


def _linear_mean(times: Array, values: Array, begin: Array, end: Array) -> Array:
    """Means of a series joined by straight lines, over intervals between two of its stamps."""
    integral = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(times))))
    length = end - begin
    some = length > 0.0
    found = np.interp(begin, times, values)
    found[some] = (np.interp(end, times, integral) - np.interp(begin, times, integral))[some] / length[some]
    return found
