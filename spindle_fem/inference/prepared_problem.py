"""From a machine and its recordings to a problem that can be searched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference.hypothesis_fit import THETA_BOUND, Belief, Coordinate, Fit, Problem
from spindle_fem.inference.reading_noise import SlowError, likely_slow_error
from spindle_fem.inference.simulated_plant import DIRECTIONS, PROBE_PREFIX, Plant
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]

# Where a probe feels the temperature, m: holes are drilled and filled to a third of a millimetre. How far
# from the bearings a temperature is found differs by more between the discretised and the real machine, but
# alike for all probes of one part.
PROBE_PLACE_SIGMA, COMMON_RADIAL_SIGMA = 0.3e-3, 0.8e-3
RADIAL = f".{DIRECTIONS[0]}"
RADIAL_SIGMA = float(np.hypot(PROBE_PLACE_SIGMA, COMMON_RADIAL_SIGMA))
# Error that neighbouring readings share: of logger and sensor, and of the model against its machine.
EXPECTED_SLOW = SlowError(0.045, 1500.0)
# Of the highest friction, within a gap: most machines went on as they did before and after it.
GAP_SIGMA = 0.3
SLOW_SIGMAS = (0.02, 0.03, 0.045, 0.065, 0.09, 0.13)
SLOW_TIMES = (600.0, 1200.0, 2400.0, 4800.0)
# A network of a few nodes is a coarse picture of its machine: its error is of the order of the
# noise or of some per cent of what the temperatures move, and lasts for a share of the recording.
NETWORK_SIGMAS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
NETWORK_TIMES = 5
LONGEST_SHARE = 0.1
NETWORK_SHARE_OF_RISE = 0.01


@dataclass(frozen=True, slots=True)
class Calibrated:
    """What the calibration recordings told.

    Attributes
    ----------
    belief : Belief
    slow : SlowError
    fit : Fit or None
        None without calibration recordings.
    """

    belief: Belief
    slow: SlowError
    fit: Fit | None


def machine_coordinates(plant: Plant) -> tuple[Coordinate, ...]:
    """The machine's uncertain parameters, and the places of the probes."""
    found = [
        Coordinate(name, 1.0, sigma, True, -THETA_BOUND, min(THETA_BOUND, float(np.log(highest)) / sigma))
        for name, sigma, highest in plant.uncertain()
    ]
    found += [
        Coordinate(
            name,
            0.0,
            RADIAL_SIGMA if name.endswith(RADIAL) else PROBE_PLACE_SIGMA,
            False,
            -THETA_BOUND,
            THETA_BOUND,
            "m",
        )
        for name in plant.displacements()
    ]
    return tuple(found)


def start_coordinates(plant: Plant) -> tuple[Coordinate, ...]:
    """What is uncertain of each recording: temperatures at its start, changes of inputs within gaps."""
    starts = [Coordinate(name, 1.0, sigma, True, -THETA_BOUND, THETA_BOUND) for name, sigma in plant.starts()]
    # Anywhere in the gap: a uniform distribution's mean, spread and ends.
    ends = float(np.sqrt(3.0))
    jumps = [
        Coordinate(name, 0.5 * (least + most), (most - least) / np.sqrt(12.0), False, -ends, ends, "s")
        for name, least, most in plant.jumps()
    ]
    gaps = [
        Coordinate(name, 0.0, GAP_SIGMA, False, -1.0 / GAP_SIGMA, 1.0 / GAP_SIGMA) for name in plant.gaps()
    ]
    return (*starts, *jumps, *gaps)


def known_before(plant: Plant) -> Belief:
    """Belief before any recording: each coordinate for itself, but for what radial places of probes share."""
    belief = Belief.prior((*machine_coordinates(plant), *start_coordinates(plant)))
    owner = {} if plant.is_network else {probe.name: probe.part for probe in plant.fast.spec.probe}
    of_part: dict[str, list[int]] = {}
    for index, coordinate in enumerate(belief.coordinates):
        if coordinate.name.startswith(PROBE_PREFIX) and coordinate.name.endswith(RADIAL):
            probe = coordinate.name.removeprefix(PROBE_PREFIX).removesuffix(RADIAL)
            of_part.setdefault(owner[probe], []).append(index)
    shared = (COMMON_RADIAL_SIGMA / RADIAL_SIGMA) ** 2
    for rows in of_part.values():
        correlation = np.full((len(rows), len(rows)), shared)
        np.fill_diagonal(correlation, 1.0)
        belief.root[np.ix_(rows, rows)] = np.linalg.cholesky(np.linalg.inv(correlation)).T
    return belief


def expected_slow_error(plant: Plant) -> SlowError:
    """Slow error before any fit."""
    if not plant.is_network:
        return EXPECTED_SLOW
    unit, times = _network_scales(plant)
    return SlowError(unit, times[len(times) // 2])


def slow_error_of(problem: Problem, fit: Fit) -> SlowError:
    """Most probable slow error of what a fit leaves."""
    plant = problem.plant
    predicted = [
        plant.predict(number, fit.values, fit.candidates).temperature
        for number in range(len(plant.recordings))
    ]
    residuals = [
        (item.bins, item.at(predicted[item.recording][:, item.channel]) - item.values)
        for item in problem.observations
    ]
    if not plant.is_network:
        return likely_slow_error(residuals, prior=EXPECTED_SLOW, sigmas=SLOW_SIGMAS, times=SLOW_TIMES)
    unit, times = _network_scales(plant)
    return likely_slow_error(
        residuals,
        prior=expected_slow_error(plant),
        prior_width=1.5,
        sigmas=[share * unit for share in NETWORK_SIGMAS],
        times=times,
    )


def _network_scales(plant: Plant) -> tuple[float, list[float]]:
    """Usual error of a network [K]; correlation times from a few readings to a tenth of the time [s]."""
    moved = [
        float(np.ptp(np.quantile(recording.temperature[usable, channel], [0.05, 0.95])))
        for recording, use in zip(plant.recordings, plant.use, strict=True)
        for channel, usable in enumerate((recording.usable & use[:, None]).T)
        if usable.any()
    ]
    duration = float(np.median([r.times[-1] - r.times[0] for r in plant.recordings]))
    spacing = float(np.median([np.median(np.diff(item.bins.times)) for item in plant.observations]))
    noise = float(np.median([sigma for r in plant.recordings for sigma in r.sigma]))
    shortest = min(4.0 * spacing, 0.5 * LONGEST_SHARE * duration)
    times = np.geomspace(shortest, LONGEST_SHARE * duration, NETWORK_TIMES)
    return max(noise, NETWORK_SHARE_OF_RISE * float(np.median(moved))), times.tolist()


def calibrate(earlier: Plant | None, plant: Plant) -> Calibrated:
    """Fit calibration recordings; the prior where there are none.

    Parameters
    ----------
    earlier : Plant or None
        The machine on its calibration recordings.
    plant : Plant
        On those to be diagnosed.
    """
    shared, begun = machine_coordinates(plant), start_coordinates(plant)
    if earlier is None:
        return Calibrated(known_before(plant), expected_slow_error(plant), None)
    slow, fit = expected_slow_error(earlier), None
    prior = known_before(earlier)
    for _ in range(2):
        problem = Problem(earlier, prior, slow, earlier.observations)
        fit = problem.fit((), None if fit is None else fit.values)
        slow = slow_error_of(problem, fit)
    count, total = len(shared), len(shared) + len(begun)
    precision = np.linalg.inv(fit.covariance[:count, :count])
    root, mean = np.eye(total), np.zeros(total)
    root[:count, :count] = np.linalg.cholesky(0.5 * (precision + precision.T)).T
    mean[:count] = fit.position[:count]
    return Calibrated(Belief((*shared, *begun), mean, root), slow, fit)


def all_stamps(recordings: Sequence[Recording]) -> list[NDArray[np.bool_]]:
    """Masks that use every stamp."""
    return [np.ones(item.times.size, dtype=bool) for item in recordings]
