"""Sensor, place or test that would best distinguish the remaining explanations.

Every explanation that is left predicts, with its own uncertain parameters, a
Gaussian for the readings of every test. The expected information of a test is the
mutual information between explanation and readings; it is bounded from below
by the pairwise distances of the Gaussians.

Source of the bound: Kolchinsky & Tracey (2017), Estimating mixture entropy
with pairwise distances, Entropy 19, 361 (Bhattacharyya distance).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from spindle_fem.effects.framework.effect import place_words
from spindle_fem.effects.framework.interval_effect import in_intervals
from spindle_fem.effects.registry import effect_of
from spindle_fem.inference import tuned
from spindle_fem.inference.further_tests import (
    AGAIN,
    FURTHER_DISPLACEMENT,
    FURTHER_SLOW,
    Answer,
    Place,
    Trial,
    answer,
    beside_probes,
    network_places,
    reachable_places,
    trials_of,
    unread_displacements,
)
from spindle_fem.inference.growth_misdescriptions import EXPANSION_SIGMA
from spindle_fem.inference.hypothesis import Ranked
from spindle_fem.inference.hypothesis_fit import NOT_SIMULATED, Fit
from spindle_fem.inference.reading_noise import SlowError, key_of
from spindle_fem.inference.set_odds import rank
from spindle_fem.recordings.align import Recording
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from spindle_fem.inference.diagnosis import Diagnosis

Array = NDArray[np.float64]

# Number of explanations that a test should distinguish, the most probable ones.
MOST_HYPOTHESES = 3
# Distance of the instants at which tests are compared, s, and their number at least and at most.
SPACING = 300.0
FEWEST_INSTANTS, MOST_INSTANTS = 12, 48
# Options with this share of the best one's information are worth as much; the simplest of them is proposed.
AS_GOOD = 0.9
# A test that is expected to tell less than this share of what is open does not separate the explanations.
HARDLY = 0.3
EXISTING = "the sensors that are there"


@dataclass(frozen=True, slots=True)
class Option:
    """One test with the existing sensors, and perhaps one more.

    Attributes
    ----------
    information : float
        Expected, in bits.
    distance : float
        Bhattacharyya distance of the readings under the two likeliest explanations.
    channel : str
        Where these two differ most clearly.
    difference : float, [K, µm]
        There, at the clearest instant.
    spread : float, [K, µm]
        1 σ of the difference from noise and unknown parameters.
    time : float, [s]
        When that instant is, from the start of the test.
    levels : (float, float), [K, µm]
        What the two predict then.
    displaced : bool
        Whether the channel reads a displacement, which counts from the start of the test.
    """

    trial: Trial
    place: Place | None
    information: float
    distance: float
    channel: str
    difference: float
    spread: float
    time: float
    levels: tuple[float, float]
    displaced: bool = False

    @property
    def unit(self) -> str:
        """Unit of the difference, as in the names of keys."""
        return "um" if self.displaced else "K"

    @property
    def effort(self) -> int:
        """Effort: a test, a further sensor, or both."""
        return self.trial.effort + (0 if self.place is None else 2)

    @property
    def sensor(self) -> str:
        """The place of the further sensor, in words."""
        return EXISTING if self.place is None else self.place.words


def next_measurement(diagnosis: Diagnosis) -> dict[str, Any]:
    """Measurement that would best separate the explanations that are left.

    Where only one is left, the best is set against the next in rank, both as
    likely: what would confirm it.

    Returns
    -------
    dict
        ``where``, ``quantity``, ``condition``, ``why``, ``expected_information``
        (bits), ``between`` and ``options``: the proposed one, then the most informative first.
    """
    rivals, weights, decided = rivals_of(diagnosis)
    between = [hypothesis_words(item.fit, diagnosis.predictor.recordings) for item in rivals]
    if len(rivals) < 2:
        return {
            "where": EXISTING,
            "quantity": "temperature",
            "condition": AGAIN,
            "why": "No explanation came near: another recording would tell whether it comes again."
            if diagnosis.judgement.verdict == "unexplained"
            else "No other explanation came near: another recording would test this one.",
            "expected_information": 0.0,
            "between": between,
            "options": [],
        }
    options, failed = evaluate(diagnosis, [item.fit for item in rivals], weights)
    if not options:
        return {
            "where": EXISTING,
            "quantity": "temperature",
            "condition": AGAIN,
            "why": "None of the tests could be simulated under every explanation.",
            "expected_information": 0.0,
            "between": between,
            "options": [],
        }
    best = choose(options)
    listed = shortlist(options, best)
    return {
        "where": best.sensor if best.place is not None else f"{EXISTING}, above all {best.channel}",
        "quantity": "displacement" if best.displaced else "temperature",
        "condition": best.trial.name,
        "why": why(best, between, lead_words(diagnosis, decided), float(-weights @ np.log2(weights)))
        + timed_words([item.fit for item in rivals]),
        "expected_information": best.information,
        "between": between,
        "options": [
            {
                "where": item.sensor,
                "condition": item.trial.name,
                "expected_information": item.information,
                "channel": item.channel,
                f"difference_{item.unit}": item.difference,
                f"sigma_{item.unit}": item.spread,
                "after_s": item.time,
                "chosen": item is best,
            }
            for item in listed
        ],
    } | ({"not_simulated": failed} if failed else {})


def rivals_of(diagnosis: Diagnosis) -> tuple[list[Ranked], Array, bool]:
    """Explanations to distinguish, their probabilities, and whether only one was left."""
    judgement = diagnosis.judgement
    # What is listed without being likely is not to be told apart.
    found = [judgement.chosen, *(i for i in judgement.alternatives if i.probability >= tuned.LISTED)]
    found, decided = found[:MOST_HYPOTHESES], len(found) < 2
    if decided:
        ranked = rank(diagnosis.hypotheses, diagnosis.coarseness)
        others = [item for item in ranked if item.fit.keys != found[0].fit.keys]
        # The same set plus one effect is not a different explanation, and "nothing missing" is excluded.
        others.sort(key=lambda item: (item.fit.keys > found[0].fit.keys, not item.fit.candidates))
        found += others[:1]
    weights = np.ones(len(found)) if decided else np.array([item.probability for item in found])
    return found, weights / weights.sum(), decided


def hypothesis_words(fit: Fit, recordings: Sequence[Recording]) -> str:
    """A set of effects in words.

    >>> from types import SimpleNamespace
    >>> one, other = (SimpleNamespace(effect="windage", component="shaft", recording=n) for n in (None, 1))
    >>> runs = [SimpleNamespace(name="monday"), SimpleNamespace(name="tuesday")]
    >>> hypothesis_words(SimpleNamespace(candidates=(one, other)), runs)
    'windage at the shaft with windage at the shaft in tuesday'
    """
    if not fit.candidates:
        return "nothing missing"
    return " with ".join(
        f"{c.effect.replace('_', ' ')} at {place_words(c.component)}"
        + ("" if c.recording is None else f" in {recordings[c.recording].name}")
        for c in fit.candidates
    )


def evaluate(
    diagnosis: Diagnosis, fits: Sequence[Fit], weights: Array
) -> tuple[list[Option], list[dict[str, str]]]:
    """Every test with and without a further sensor, and the tests that cannot be simulated."""
    predictor = diagnosis.predictor
    recording = predictor.recordings[0]
    if diagnosis.view.kind == "network":
        places = network_places(predictor.fast.model.place_names, recording.probes)
    else:
        doubted = dict.fromkeys(c.component for fit in fits for c in fit.candidates if c.reading is not None)
        places = (
            *beside_probes(tuple(doubted), predictor.fast.model.probe_names),
            *reachable_places(predictor.fast.spec, predictor.fast.model.place_names),
            *unread_displacements(predictor.fast.spec, recording.probes),
        )
    count, read = len(recording.temperature_names), recording.temperature_count
    usual = float(np.median(recording.sigma[:read]))
    white = [*recording.sigma.tolist(), *(FURTHER_DISPLACEMENT if p.displaced else usual for p in places)]
    step = float(np.median(np.diff(recording.times)))
    names = (*recording.temperature_names, *(place.words for place in places))
    moved = recording.temperature_names[read:]
    options: list[Option] = []
    failed = []
    for trial in trials_of(predictor, diagnosis.view):
        duration = float(trial.drive.grid[-1] - trial.drive.grid[0])
        spacing = max(min(SPACING, duration / FEWEST_INSTANTS), duration / MOST_INSTANTS)
        try:
            known: list[Array] = []
            answers = [answer(predictor, fit, trial, places, spacing, known) for fit in fits]
        except NOT_SIMULATED as error:
            failed.append({"condition": trial.name, "reason": str(error)})
            continue
        slow, begin, noise = diagnosis.final.slow, float(trial.drive.grid[0]), []
        for channel, sigma in enumerate(white):
            usual_of = partial(reading_covariance, answers[0].times, sigma, step, spacing)
            if channel >= count and places[channel - count].displaced:
                # By coefficients of expansion that are not those of the definition as well.
                grown = EXPANSION_SIGMA * answers[0].readings[:, channel]
                noise.append(usual_of(FURTHER_SLOW, counted_from=begin) + np.outer(grown, grown))
            elif read <= channel < count:
                noise.append(usual_of(slow.of(key_of(recording, channel)), counted_from=begin))
            else:
                noise.append(usual_of(slow))
        for position in (None, *range(len(places))):
            chosen = [*range(count), *([] if position is None else [count + position])]
            place = None if position is None else places[position]
            option = _option(trial, place, answers, fits, weights, chosen, noise, names)
            displaced = option.channel in moved if place is None else place.displaced
            options.append(replace(option, displaced=displaced))
    return options, failed


def reading_covariance(
    times: Array,
    sigma: float,
    step: float,
    spacing: float,
    slow: SlowError,
    *,
    counted_from: float | None = None,
) -> Array:
    """Covariance of means over ``spacing`` of one channel's readings, (n, n) K² or µm².

    ``counted_from`` is the time [s] of the reading that the others are counted from, if from one.
    """
    number = max(1.0, spacing / step)
    if counted_from is not None:
        times = np.append(counted_from, times)
    apart = np.abs(times[:, None] - times)
    found = slow.sigma**2 * np.exp(-apart / slow.time) + sigma**2 / number * np.eye(len(times))
    return found if counted_from is None else found[1:, 1:] - found[1:, :1] - found[:1, 1:] + found[0, 0]


def _option(
    trial: Trial,
    place: Place | None,
    answers: Sequence[Answer],
    fits: Sequence[Fit],
    weights: Array,
    chosen: Sequence[int],
    noise: Sequence[Array],
    names: Sequence[str],
) -> Option:
    means, covariances = [], []
    size = len(answers[0].times)
    for expected, fit in zip(answers, fits, strict=True):
        means.append(expected.readings[:, chosen].T.ravel())
        slopes = expected.slopes[:, chosen].transpose(1, 0, 2).reshape(size * len(chosen), -1)
        of_fit = slopes @ _root(fit.covariance)
        covariance = of_fit @ of_fit.T
        for position, channel in enumerate(chosen):
            own = slice(position * size, (position + 1) * size)
            covariance[own, own] += noise[channel]
        covariances.append(covariance)
    distances = pairwise_distances(means, covariances)
    order = np.argsort(-weights, kind="stable")
    first, second = int(order[0]), int(order[1])
    difference = means[second] - means[first]
    spread = np.sqrt(0.5 * (np.diag(covariances[first]) + np.diag(covariances[second])))
    # The gain of a further sensor is judged at that sensor.
    searched = np.abs(difference / spread)
    if place is not None:
        searched[: -size or None] = -1.0
    at = int(np.argmax(searched))
    return Option(
        trial,
        place,
        expected_information(weights, distances / tuned.GAIN_DIVISOR),
        float(distances[first, second]),
        names[chosen[at // size]],
        float(difference[at]),
        float(spread[at]),
        float(answers[0].times[at % size] - trial.drive.grid[0]),
        (float(means[first][at]), float(means[second][at])),
    )


def pairwise_distances(means: Sequence[Array], covariances: Sequence[Array]) -> Array:
    """Bhattacharyya distances of Gaussians, (k, k).

    >>> one = np.eye(1)
    >>> float(pairwise_distances([np.zeros(1), np.full(1, 4.0)], [one, one])[0, 1].round(6))
    2.0
    """
    count = len(means)
    found = np.zeros((count, count))
    halves = [_half_log_det(item) for item in covariances]
    for i in range(count):
        for j in range(i):
            lower = _lower(0.5 * (covariances[i] + covariances[j]))
            scaled = solve_triangular(lower, means[i] - means[j], lower=True)
            volume = float(np.log(np.diag(lower)).sum()) - 0.5 * (halves[i] + halves[j])
            found[i, j] = found[j, i] = 0.125 * float(scaled @ scaled) + volume
    return found


def _half_log_det(covariance: Array) -> float:
    return float(np.log(np.diag(_lower(covariance))).sum())


def _root(covariance: Array) -> Array:
    """A matrix whose product with its transpose is the covariance, without what rounding left below zero."""
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _lower(covariance: Array) -> Array:
    """Cholesky factor of a covariance with what rounding takes from its largest variance added to all."""
    rounding = np.finfo(float).eps * len(covariance) * float(np.diag(covariance).max())
    return np.linalg.cholesky(covariance + rounding * np.eye(len(covariance)))


def expected_information(weights: Array, distances: Array) -> float:
    """Lower bound of the mutual information between explanation and readings, bits.

    Parameters
    ----------
    weights : (k,) ndarray
        Probabilities, sum 1.
    distances : (k, k) ndarray

    >>> even = np.array([0.5, 0.5])
    >>> expected_information(even, np.zeros((2, 2))), expected_information(even, 50.0 * (1 - np.eye(2)))
    (0.0, 1.0)
    """
    return float(max(0.0, -weights @ np.log2(np.exp(-distances) @ weights)))


def choose(options: Sequence[Option]) -> Option:
    """The simplest of the options with nearly the most information; of these the clearest."""
    new = [item for item in options if item.trial.name != AGAIN or item.place is not None]
    # A network whose inputs never change, all of whose nodes are read, can only be read again.
    new = new or list(options)
    highest = max(item.information for item in new)
    good = [item for item in new if item.information >= AS_GOOD * highest]
    effort = min(item.effort for item in good)
    return max((item for item in good if item.effort == effort), key=lambda item: item.distance)


def shortlist(options: Sequence[Option], best: Option) -> list[Option]:
    """Every test with the existing sensors, and every further place in its most informative test."""
    found: dict[str, Option] = {}
    for item in options:
        key = item.trial.name if item.place is None else item.place.name
        if key not in found or _merit(item) > _merit(found[key]):
            found[key] = item
    listed = list(found.values())
    if all(item is not best for item in listed):
        listed.append(best)
    return sorted(listed, key=lambda item: (item is not best, *(-value for value in _merit(item))))


def _merit(option: Option) -> tuple[float, float]:
    return round(option.information, 3), option.distance


def timed_words(fits: Sequence[Fit]) -> str:
    """Assumption about effects that come and go; empty if there are none."""
    timed = any(in_intervals(effect_of(c.effect), c) for fit in fits for c in fit.candidates)
    return " Unrecorded heat or cooling is taken to come and go as it did in the recording." if timed else ""


def lead_words(diagnosis: Diagnosis, decided: bool) -> str:
    """How nearly the data decide already; empty if several explanations are left."""
    if diagnosis.judgement.verdict == "unexplained":
        return "Nothing explains the recording; this would tell apart what comes nearest. "
    return "The data have decided; this would confirm it. " if decided else ""


def why(option: Option, between: Sequence[str], lead: str, open_bits: float) -> str:
    """The reason in a sentence or two with numbers, after what leads to it; of what is open, in bits."""
    digits = 1 if abs(option.difference) >= 0.2 else 2
    zero, level, unit = (0.0, "µm", "µm") if option.displaced else (ZERO_CELSIUS_K, "°C", "K")
    levels = [f"{value - zero:.{digits}f} {level}" for value in option.levels]
    at = option.channel if option.place is None else "the new sensor"
    text = (
        f"If it is {between[0]}, {at} reads {levels[0]} after {option.time / 60.0:.0f} min; "
        f"if it is {between[1]}, {levels[1]}: they differ by {abs(option.difference):.2g} {unit}, "
        f"{abs(option.difference) / option.spread:.1f} times what noise and unknown parameters leave "
        f"({option.spread:.2g} {unit})."
    )
    if option.information < HARDLY * open_bits:
        lead += "No single test tells these apart well; this one does it best. "
    tail = f" Expected to tell {option.information:.2f} of the {open_bits:.2f} bits that are open."
    return lead + text + tail
