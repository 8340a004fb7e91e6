"""Set up a problem that can be searched from a machine and its recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference import tuned
from spindle_fem.inference.belief import THETA_BOUND, Belief, Coordinate
from spindle_fem.inference.calibration import coordinate_of
from spindle_fem.inference.coordinate_names import DIRECTIONS, JUMP_PREFIX, PROBE_PREFIX
from spindle_fem.inference.earlier_readings import EarlierReadings
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.input_sampling import sampled_errors
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.misdescription_columns import with_misdescriptions
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.reading_noise import (
    Absorbed,
    ChannelBins,
    SlowError,
    likely_slow_error,
    slow_errors_of,
)
from spindle_fem.inference.recording_clocks import restamped
from spindle_fem.inference.recording_gaps import about_rows_amid
from spindle_fem.inference.robust_size import huber

Array = NDArray[np.float64]
# Residuals of the bin means of every observation, [K].
Residuals = list[tuple[ChannelBins, Array]]

RADIAL = f".{DIRECTIONS[0]}"
RADIAL_SIGMA = float(np.hypot(tuned.PROBE_PLACE_SIGMA, tuned.COMMON_RADIAL_SIGMA))
EXPECTED_SLOW = SlowError(tuned.EXPECTED_SLOW_SIGMA, tuned.EXPECTED_SLOW_TIME)
# Correlation times that are tried for a network, from that between readings to this share of its recording.
NETWORK_TIMES = 6
LONGEST_SHARE = 0.1
# Fits to calibration recordings at most: slow error and what directions do follow from the one before.
CALIBRATION_ROUNDS = 3
# Largest move of a coordinate, in deviations of its prior, after which another round changes nothing.
SETTLED = 0.1


@dataclass(frozen=True, slots=True)
class Calibrated:
    """Result of the calibration recordings.

    Attributes
    ----------
    belief : Belief
        Of the machine after them, as a normal distribution.
    known : Belief
        With the readings themselves where the machine is a network, whose values are guesses.
    fit : Fit or None
        None without calibration recordings.
    suspected : object or None
        What ``suspect`` of :func:`calibrate` says.
    """

    belief: Belief
    known: Belief
    slow: SlowError
    fit: Fit | None
    suspected: Any = None


def machine_coordinates(predictor: Predictor) -> tuple[Coordinate, ...]:
    """The machine's uncertain parameters, the places of the probes, and how else it may differ."""
    found = [coordinate_of(prior, THETA_BOUND) for prior in predictor.uncertain()]
    found += [
        Coordinate(
            name,
            0.0,
            RADIAL_SIGMA if name.endswith(RADIAL) else tuned.PROBE_PLACE_SIGMA,
            False,
            -THETA_BOUND,
            THETA_BOUND,
            "m",
        )
        for name in predictor.displacements()
    ]
    return (*found, *(_direction(item) for item in predictor.misdescribed if item.recording is None))


def _direction(item: Misdescription) -> Coordinate:
    return Coordinate(item.coordinate, 0.0, item.sigma, False, -THETA_BOUND, THETA_BOUND, item.unit)


def _jump(name: str, least: float, most: float) -> Coordinate:
    """How much earlier an input changed than it is drawn [s]: about alike from ``least`` to ``most``.

    A normal distribution about the middle that ends at one standard deviation.
    """
    return Coordinate(name, 0.5 * (least + most), 0.5 * (most - least), False, -1.0, 1.0, "s")


def start_coordinates(predictor: Predictor) -> tuple[Coordinate, ...]:
    """Uncertain quantities of each recording: temperatures at its start, inputs within gaps, its clocks."""
    starts = [coordinate_of(prior, THETA_BOUND) for prior in predictor.starts()]
    jumps = [_jump(name, least, most) for name, least, most in predictor.jumps()]
    gaps = [
        Coordinate(name, 0.0, sigma, False, -1.0 / sigma, 1.0 / sigma) for name, sigma in predictor.gaps()
    ]
    own = [_direction(item) for item in predictor.misdescribed if item.recording is not None]
    return (*starts, *jumps, *gaps, *own)


def known_before(predictor: Predictor) -> Belief:
    """Belief before any recording: each coordinate for itself but for two kinds that share a part.

    Those are radial places of probes, and when inputs changed beside rows that lie amid a change.
    """
    belief = Belief.prior((*machine_coordinates(predictor), *start_coordinates(predictor)))
    place = {c.name: index for index, c in enumerate(belief.coordinates)}
    owner = {} if predictor.is_network else {probe.name: probe.part for probe in predictor.fast.spec.probe}
    of_part: dict[str, list[int]] = {}
    for name, index in place.items():
        if name.startswith(PROBE_PREFIX) and name.endswith(RADIAL):
            probe = name.removeprefix(PROBE_PREFIX).removesuffix(RADIAL)
            of_part.setdefault(owner[probe], []).append(index)
    for rows in of_part.values():
        _alike(belief.root, rows, (tuned.COMMON_RADIAL_SIGMA / RADIAL_SIGMA) ** 2)
    for number, jumps in enumerate(predictor.unread_jumps):
        recording, drive = predictor.recordings[number], predictor.drives[number]
        for own in about_rows_amid(recording, drive, jumps):
            rows = [place[f"{JUMP_PREFIX}{number}.{index}"] for index in own]
            _alike(belief.root, rows, tuned.SHARED_OF_ROWS)
    return belief


def _alike(root: Array, rows: Sequence[int], shared: float) -> None:
    """Give coordinates, each for itself before, a part in common: ``shared`` of the variance, in place."""
    correlation = np.full((len(rows), len(rows)), shared)
    np.fill_diagonal(correlation, 1.0)
    root[np.ix_(rows, rows)] = np.linalg.cholesky(np.linalg.inv(correlation)).T


def expected_slow_error(predictor: Predictor) -> SlowError:
    """Slow error before any fit.

    Of a displacement it is what expansion coefficients leave of growth; of a node that a rarely read input
    heats, also what that did between its readings.
    """
    if not predictor.is_network:
        sigma, time = tuned.DISPLACEMENT_SLOW_SIGMA, tuned.EXPECTED_SLOW_TIME
        keys = dict.fromkeys(item.bins.key for item in predictor.observations if item.bins.is_relative)
        return replace(EXPECTED_SLOW, channels=tuple((key, sigma, time) for key in keys))
    unit, times = _network_scales(predictor)
    usual = SlowError(unit, times[len(times) // 2])
    if not predictor.unseen:
        return usual
    channels, sampled = {}, sampled_errors(predictor.fast.inputs.moved({}), predictor.unseen)
    for recording in predictor.recordings:
        for channel, probe in enumerate(recording.probes):
            beside = sampled[probe]
            time = beside.time if beside.sigma > unit else usual.time
            channels[channel] = SlowError(float(np.hypot(unit, beside.sigma)), time)
    return SlowError.each(channels)


def slow_error_of(problem: Problem, fit: Fit) -> SlowError:
    """Most probable slow error of what a fit leaves."""
    choices = _slow_choices(problem.predictor)
    return likely_slow_error(problem.binned_residuals(fit), **choices, absorbed=_absorbed(problem, fit))


def _absorbed(problem: Problem, fit: Fit) -> Absorbed | None:
    """What a fit takes up of slow errors; None for a network, each channel of which has its own.

    Coordinates of a machine that is drawn are a hundred, which follow an error of hours in part.
    """
    return None if problem.predictor.is_network else problem.absorbed(fit)


def with_inexact_laws(problem: Problem, fit: Fit) -> Problem:
    """The problem with the slow error that laws of what is missing will leave beside that of the machine.

    What is added follows nature to a share only: where a fit without it leaves much, the best set leaves more
    than the machine did by itself.
    """
    left: dict[int, list[Array]] = {}
    for bins, values in problem.binned_residuals(fit):
        # The constant of a displacement is free.
        left.setdefault(bins.key, []).append(values - values.mean() if bins.is_relative else values)
    return replace(
        problem,
        slow=SlowError.each(
            {
                key: replace(
                    problem.slow.of(key),
                    sigma=float(
                        np.hypot(
                            problem.slow.of(key).sigma,
                            tuned.LAW_INEXACT * np.sqrt(np.mean(np.concatenate(values) ** 2)),
                        )
                    ),
                )
                for key, values in left.items()
            }
        ),
    )


def with_own_noise(
    plain: Problem,
    residuals: Callable[[Fit], list[tuple[ChannelBins, Array]]],
    hypotheses: Sequence[Hypothesis],
) -> list[Hypothesis]:
    """Each hypothesis with its own most probable slow error.

    The size of the unexplained error is as unknown as the parameters: fixed at the residual of the best set
    it would make everything else look impossible.

    Parameters
    ----------
    plain : Problem
        With nothing missing.
    residuals : callable
        What a fit leaves of every observation, as :meth:`Problem.binned_residuals` has it.
    """
    choices = _slow_choices(plain.predictor)
    fits = [item.fit for item in hypotheses]
    choices["absorbed"] = _absorbed(plain, next(fit for fit in fits if not fit.candidates))
    for index, fit in enumerate(fits):
        # Nothing missing is fitted anew: what the others explain it must take for error.
        slow = plain.slow if fit.candidates else likely_slow_error(residuals(fit), **choices)
        if slow != plain.slow:
            own = Problem(plain.predictor, plain.belief, slow, plain.observations)
            fits[index] = own.fit((), fit.values)
    left = [residuals(fit) for fit in fits]
    together = [
        (own[0][0], np.column_stack([values for _, values in own])) for own in zip(*left, strict=True)
    ]
    slow_errors = slow_errors_of(together, size=huber, **choices)
    return [
        replace(item, deviance=deviance + fit.misfit_with_prior - fit.misfit)
        for item, fit, (_, deviance) in zip(hypotheses, fits, slow_errors, strict=True)
    ]


def _slow_choices(predictor: Predictor) -> dict[str, Any]:
    """Choices for the slow error, as :func:`likely_slow_error` takes them."""
    if not predictor.is_network:
        displaced = any(item.bins.is_relative for item in predictor.observations)
        # None of the larger ones is likely of a temperature before any reading.
        sigmas = tuned.SLOW_SIGMAS + (tuned.DISPLACEMENT_SLOW_SIGMAS if displaced else ())
        return {"prior": EXPECTED_SLOW, "sigmas": sigmas, "times": tuned.SLOW_TIMES}
    unit, times = _network_scales(predictor)
    return {
        "prior": expected_slow_error(predictor),
        "prior_width": 1.5,
        "sigmas": [share * unit for share in tuned.NETWORK_SLOW_SIGMAS],
        "times": times,
        "by_channel": True,
    }


def _network_scales(predictor: Predictor) -> tuple[float, list[float]]:
    """Usual error of a network [K]; correlation times from a few readings to a tenth of the time [s]."""
    moved = [
        float(np.ptp(np.quantile(recording.temperature[usable, channel], [0.05, 0.95])))
        for recording, use in zip(predictor.recordings, predictor.use, strict=True)
        for channel, usable in enumerate((recording.usable & use[:, None]).T)
        if usable.any()
    ]
    duration = float(np.median([r.times[-1] - r.times[0] for r in predictor.recordings]))
    spacing = float(np.median([np.median(np.diff(item.bins.times)) for item in predictor.observations]))
    noise = float(np.median([sigma for r in predictor.recordings for sigma in r.sigma]))
    shortest = min(spacing, 0.5 * LONGEST_SHARE * duration)
    times = np.geomspace(shortest, LONGEST_SHARE * duration, NETWORK_TIMES)
    return max(noise, tuned.NETWORK_SHARE_OF_RISE * float(np.median(moved))), times.tolist()


def calibrate(
    earlier: Predictor | None,
    predictor: Predictor,
    suspect: Callable[[Problem, Fit], Any] = lambda problem, fit: None,
    known: Callable[[Predictor], Belief] = known_before,
) -> Calibrated:
    """Fit calibration recordings; the prior where there are none.

    Parameters
    ----------
    earlier : Predictor or None
        The machine on its calibration recordings.
    predictor : Predictor
        On those to be diagnosed.
    suspect : callable
        Says what is suspicious of the fit to calibration recordings of a machine with geometry.
    known : callable
        Belief before any recording.
    """
    belief = known(predictor)
    if earlier is None:
        return Calibrated(belief, belief, expected_slow_error(predictor), None)
    slow, fit, begin = expected_slow_error(earlier), None, None
    prior, shared = known(earlier), belief.coordinates[: len(machine_coordinates(predictor))]
    for _ in range(CALIBRATION_ROUNDS):
        if fit is not None:
            # Directions are linearised about the fitted numbers.
            earlier, begin = restamped(earlier, fit)
            earlier = with_misdescriptions(earlier, earlier.misdescribed, begin)
        problem, before = Problem(earlier, prior, slow, earlier.observations), fit
        fit = problem.fit((), begin)
        slow = slow_error_of(problem, fit)
        if before is not None and np.abs(fit.position - before.position).max(initial=0.0) < SETTLED:
            break
    # Channels that only the diagnosed recordings have stay as they were known before.
    slow = _with_displacements_of(slow, predictor)
    place = {c.name: index for index, c in enumerate(fit.coordinates)}
    rows = [index for index, c in enumerate(shared) if c.name in place]
    fitted = [place[shared[index].name] for index in rows]
    covariance = np.linalg.inv(belief.root.T @ belief.root)
    before = np.linalg.inv(prior.root.T @ prior.root)[np.ix_(fitted, fitted)]
    covariance[rows, :] = covariance[:, rows] = 0.0
    covariance[np.ix_(rows, rows)] = _as_stated(before, fit.covariance[np.ix_(fitted, fitted)])
    precision = np.linalg.inv(covariance)
    mean = belief.mean.copy()
    mean[rows] = fit.position[fitted]
    root = np.linalg.cholesky(0.5 * (precision + precision.T)).T
    after = Belief(belief.coordinates, mean, root)
    if not predictor.is_network:
        return Calibrated(after, after, slow, fit, suspect(problem, fit))
    problem = Problem(earlier, prior, slow, earlier.observations)
    own = EarlierReadings.about(problem, problem.fit((), fit.values, iterations=0))
    return Calibrated(after, replace(belief, earlier=own, begin=mean), slow, fit)


def _with_displacements_of(slow: SlowError, predictor: Predictor) -> SlowError:
    """A slow error, the usual one for each displacement that it lacks: one in K says nothing of µm."""
    known = {key for key, _, _ in slow.channels}
    usual = expected_slow_error(predictor).channels
    new = tuple(item for item in usual if item[0] < 0 and item[0] not in known)
    return replace(slow, channels=(*slow.channels, *new))


def _as_stated(before: Array, after: Array) -> Array:
    """Covariance after a calibration, widened like stated intervals.

    The information gained by the calibration counts less, since a model that is not exact has other
    best parameters in another duty.
    """
    known, learned = np.linalg.inv(before), np.linalg.inv(after)
    return np.linalg.inv(known + (learned - known) / tuned.INTERVAL_WIDENING**2)
