"""Findings, alternatives and fit numbers as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate, Reported, place_words, quantity
from spindle_fem.effects.framework.interval_effect import in_intervals
from spindle_fem.effects.framework.unrecorded import followed_name
from spindle_fem.effects.registry import effect_of
from spindle_fem.inference import tuned
from spindle_fem.inference.calibration import LEVEL
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX
from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.hypothesis import Ranked
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.other_answers import draws_of
from spindle_fem.inference.predictor import Predictor

Array = NDArray[np.float64]

# Draws of the posterior from which intervals are read.
DRAWS = 400
# Sizes of intervals are said one by one where there are no more than these, and differ by more than this.
MOST_SIZES, SAME_SIZE = 6, 1.05


def candidate_values(candidate: Candidate, values: Mapping[str, float]) -> dict[str, float]:
    """Values of a candidate's parameters by the names that it gives them, sizes in their own units."""
    factors = {item.name for item in candidate.factors}
    found = {
        name: values.get(EFFECT_PREFIX + name if name in factors else name, item.value)
        for name, item in candidate.parameters.items()
    }
    found[candidate.amplitude] *= values.get(candidate.sized_by, 1.0)
    return found


def reported_parameters(fit: Fit, candidate: Candidate, seed: int = 0) -> dict[str, dict[str, Any]]:
    """Values and 90 % intervals of what a finding states, from draws of the posterior.

    Parameters
    ----------
    candidate : Candidate
        One of the fit's.
    """
    effect = effect_of(candidate.effect)
    central = effect.report(candidate, candidate_values(candidate, fit.values))
    generator = np.random.default_rng(seed)
    draws = draws_of(fit, generator, DRAWS)
    low = np.array([c.low for c in fit.coordinates])
    high = np.array([c.high for c in fit.coordinates])
    samples: dict[str, list[float]] = {name: [] for name in central}
    for draw in np.clip(draws, low, high):
        values = {c.name: c.at(u) for c, u in zip(fit.coordinates, draw, strict=True)}
        for name, item in effect.report(candidate, candidate_values(candidate, values)).items():
            samples[name].append(item.value)
    for name, sigma in effect.law_sigma.items():
        if name in samples:
            spread = np.exp(sigma * generator.standard_normal(DRAWS))
            samples[name] = (np.array(samples[name]) * spread).tolist()
    if effect.delays:
        # What the sensor answers late by itself is in it, and what is never negative is not stated so.
        name = candidate.amplitude.rpartition(".")[2]
        moved = np.array(samples[name]) + tuned.RESPONSE_SIGMA * generator.standard_normal(DRAWS)
        samples[name] = np.maximum(moved, min(candidate.parameters[candidate.amplitude].low, 0.0)).tolist()
    for name, sigma in effect.law_shift.items():
        if name in samples:
            moved = np.array(samples[name]) + sigma * generator.standard_normal(DRAWS)
            samples[name] = moved.tolist()
    found = {}
    for name, item in central.items():
        ends = np.quantile(samples[name], [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
        found[name] = {
            "value": item.value,
            "low": float(min(ends[0], item.value)),
            "high": float(max(ends[1], item.value)),
            "unit": item.unit,
        }
    return found


def finding(diagnosis: Diagnosis, fit: Fit, candidate: Candidate, probability: float) -> dict[str, Any]:
    """One finding of a set; of the chosen one with states that all readings tell."""
    effect = effect_of(candidate.effect)
    state = None
    if fit is diagnosis.final:
        state = diagnosis.states.get(candidate.amplitude)
        fit, place = diagnosis.stated_fit, fit.candidates.index(candidate)
        candidate = fit.candidates[place] if state is None else state.candidate
    parameters = reported_parameters(fit, candidate)
    reported = {name: Reported(item["value"], item["unit"]) for name, item in parameters.items()}
    values = candidate_values(candidate, fit.values)
    intervals, named = [], _named(diagnosis, candidate)
    if in_intervals(effect, candidate):
        pairs = effect.intervals(candidate, values)
        intervals = [
            {
                "start": diagnosis.stamp(start, candidate.recording or 0),
                "end": diagnosis.stamp(end, candidate.recording or 0),
                "value": size,
            }
            | named
            for (start, end), size in zip(pairs, effect.sizes(candidate, values), strict=True)
        ]
    law = candidate.effect, followed_name(candidate)
    elsewhere = [c for c in fit.candidates if c is not candidate and (c.effect, followed_name(c)) == law]
    words = "".join(f" That is in {name} only." for name in named.values())
    words += "".join(f" It enters at {place_words(c.component)} as well." for c in elsewhere if law[1])
    if state is None and intervals:
        words += sizes_words([item["value"] for item in intervals], size_unit(parameters))
    elif state is not None:
        words += state.words
        intervals = [
            item | {"probability": share} for item, share in zip(intervals, state.probability, strict=True)
        ]
    return {
        "effect": candidate.effect,
        "component": candidate.component,
        "form": candidate.form,
        "kind": candidate.kind,
        "probability": probability,
        "parameters": parameters,
        "intervals": intervals,
        "follows": followed_name(candidate) or None,
        "statement": effect.statement(candidate, reported) + words,
        "check": effect.check_of(candidate),
    } | named


def size_unit(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Unit of what is on in intervals, the first that a finding states; its name where it has none."""
    name, size = next(iter(parameters.items()))
    return size["unit"] or name


def sizes_words(sizes: Sequence[float], unit: str) -> str:
    """Sizes of a few intervals as a sentence; empty where they are many, or all of one size.

    >>> sizes_words([34.83, 147.5], "W/K"), sizes_words([39.0, 40.0], "W")
    (' One after the other: 34.8 W/K, 148 W/K.', '')
    """
    if not 1 < len(sizes) <= MOST_SIZES or max(sizes) <= SAME_SIZE * min(sizes):
        return ""
    return f" One after the other: {', '.join(quantity(Reported(size, unit)) for size in sizes)}."


def _named(diagnosis: Diagnosis, candidate: Candidate) -> dict[str, str]:
    """Name of the recording in which a candidate acts, where there are several."""
    if candidate.recording is None or len(diagnosis.predictor.recordings) < 2:
        return {}
    return {"recording": diagnosis.predictor.recordings[candidate.recording].name}


def findings_of(diagnosis: Diagnosis, ranked: Ranked, *, split: bool) -> list[dict[str, Any]]:
    """Findings of a set; where ``split``, each carries its share of the set's probability.

    Shares keep the sum of all probabilities in a file at most one; the set's
    own probability is stored beside them.
    """
    count = max(len(ranked.fit.named), 1)
    share = ranked.probability / count if split else ranked.probability
    return [finding(diagnosis, ranked.fit, candidate, share) for candidate in ranked.fit.named]


def states_of(findings: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row for each interval in which something is on."""
    rows = []
    for item in findings:
        for interval in item["intervals"]:
            rows.append(
                {
                    "start": interval["start"],
                    "end": interval["end"],
                    "effect": item["effect"],
                    "component": item["component"],
                    "value": interval["value"],
                    "unit": size_unit(item["parameters"]),
                }
                | ({"recording": interval["recording"]} if "recording" in interval else {})
            )
    return rows


def predictions_at_stamps(predictor: Predictor, fit: Fit) -> list[Array]:
    """Predicted readings of every channel of every recording at its own stamps, (N, c) K.

    Displacements, in µm, count from the sensor's zero, which is estimated from the readings.
    """
    return [
        at_stamps(predictor, number, predictor.predict(number, fit.values, fit.candidates).temperature)
        for number in range(len(predictor.recordings))
    ]


def at_stamps(predictor: Predictor, number: int, on_grid: Array) -> Array:
    """Readings (N, c) of every channel of a recording at its stamps, from those on its grid (G + 1, c).

    Displacements then count from the sensor's zero, which is estimated from the readings.
    """
    recording, grid = predictor.recordings[number], predictor.drives[number].grid
    kelvins = recording.temperature_count
    predicted = np.array([np.interp(predictor.stamps(number), grid, column) for column in on_grid.T]).T
    apart = np.where(recording.usable, recording.temperature - predicted, np.nan)[:, kelvins:]
    predicted[:, kelvins:] += [np.nanmean(own) if np.isfinite(own).any() else 0.0 for own in apart.T]
    return predicted


def fitted_and_heldout_errors(predictor: Predictor, predicted: Sequence[Array]) -> dict[str, float]:
    """``train_rmse_K`` and ``heldout_rmse_K`` of predictions at the stamps, as :func:`rmse` has them."""
    return {
        "train_rmse_K": rmse(predictor, predicted, heldout=False),
        "heldout_rmse_K": rmse(predictor, predicted, heldout=True),
    }


def rmse(predictor: Predictor, predicted: Sequence[Array], *, heldout: bool) -> float:
    """Root mean square error over all temperatures of all recordings, K; NaN without readings."""
    total, number = 0.0, 0
    for recording, use, values in zip(predictor.recordings, predictor.use, predicted, strict=True):
        chosen = recording.usable & (~use if heldout else use)[:, None]
        count = recording.temperature_count
        error = (values[:, :count] - recording.temperature[:, :count])[chosen[:, :count]]
        total += float(error @ error)
        number += error.size
    return float(np.sqrt(total / number)) if number else float("nan")


def noise_level(predictor: Predictor) -> float:
    """Root mean square noise of a reading over all temperatures, K: declared, rounding included."""
    variances = []
    for recording in predictor.recordings:
        for channel in range(recording.temperature_count):
            variances.append(channel_noise(predictor, recording, channel) ** 2)
    return float(np.sqrt(np.mean(variances)))


def channel_noise(predictor: Predictor, recording, channel: int) -> float:
    """Noise of a reading of one channel, K, of a displacement µm."""
    rounding = recording.noise[channel].resolution / np.sqrt(12.0)
    return float(np.hypot(recording.sigma[channel], rounding))


def channel_errors(predictor: Predictor, predicted: Sequence[Array]) -> list[dict[str, Any]]:
    """Error of every temperature of every recording."""
    return _errors(predictor, predicted, "K")


def displacement_errors(predictor: Predictor, predicted: Sequence[Array]) -> list[dict[str, Any]]:
    """Error of every displacement of every recording, but for where its sensor was set."""
    return _errors(predictor, predicted, "um")


def _errors(predictor: Predictor, predicted: Sequence[Array], unit: str) -> list[dict[str, Any]]:
    several = len(predictor.recordings) > 1
    rows = []
    for recording, values in zip(predictor.recordings, predicted, strict=True):
        count, every = recording.temperature_count, len(recording.temperature_names)
        for channel in range(count) if unit == "K" else range(count, every):
            usable = recording.usable[:, channel]
            error = values[usable, channel] - recording.temperature[usable, channel]
            row = {
                "channel": recording.temperature_names[channel],
                f"rmse_{unit}": float(np.sqrt(np.mean(error**2))) if error.size else None,
                f"noise_{unit}": channel_noise(predictor, recording, channel),
                f"max_{unit}": float(np.abs(error).max()) if error.size else None,
            }
            rows.append(row | ({"recording": recording.name} if several else {}))
    return rows
