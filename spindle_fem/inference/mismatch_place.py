"""Place and conditions of the differences between a machine and its recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.interval_effect import IntervalEffect
from spindle_fem.effects.registry import effect_of
from spindle_fem.inference import tuned
from spindle_fem.inference.hypothesis_fit import Fit, candidate_coordinates
from spindle_fem.inference.missing_heat import Explanation, shares, stretches
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.reading_noise import SlowError
from spindle_fem.inference.set_odds import counted
from spindle_fem.inference.verdict import kind_of
from spindle_fem.machine.view.meridian_places import centre_of
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.conditions import Conditions, operating_conditions
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from spindle_fem.inference.diagnosis import Diagnosis

Array = NDArray[np.float64]

# Places are listed until they hold this probability together.
CREDIBLE = 0.95
# A mean residual, or heat, counts beyond this many standard errors.
SIGNIFICANT_SIGMAS = 3.0
# Residuals are averaged over a window of this length at least, s, and of a sixtieth of the recording.
SHORTEST_WINDOW = 600.0
WINDOWS_A_RECORDING = 60


@dataclass(frozen=True, slots=True)
class MissingHeat:
    """Heat at one component which, alone, would explain what the model leaves.

    Attributes
    ----------
    mean : float, [W]
        Over the time of all recordings.
    peak : float, [W]
        Largest magnitude, with its sign: positive heats.
    """

    mean: float
    peak: float


@dataclass(frozen=True, slots=True)
class Stretch:
    """A time in which the difference is significant.

    Attributes
    ----------
    start, end : float, [s]
        From the start of its recording.
    """

    start: float
    end: float
    condition: str
    recording: int


@dataclass(frozen=True, slots=True)
class Where:
    """Place, credible places, missing heat and times of a mismatch.

    Attributes
    ----------
    component : str
        Empty when nothing is missing.
    radius, axial : float, [m]
        Centroid of the component; NaN where it has none (networks, the surroundings).
    credible : tuple of str
        Components that together hold 95 % of the probability, the findings' own among them.
    shares : mapping of component to float
        Probability of heat missing there, if at one place.
    spots : mapping of component to str
        Spot of each that explains the residual best.
    missing_heat : mapping of component to MissingHeat
        Heat missing at each credible component that heat can come from.
    stamps : tuple of (start, end, recording)
        The ends of ``when`` as the recordings have them; the recording only where there are several.
    condition : str
        What the machine does while heat is missing; while the difference is
        significant where it is no heat.
    """

    component: str
    radius: float
    axial: float
    credible: tuple[str, ...]
    shares: Mapping[str, float]
    spots: Mapping[str, str]
    missing_heat: Mapping[str, MissingHeat]
    when: tuple[Stretch, ...]
    stamps: tuple[tuple[float | str, float | str, str | None], ...] = ()
    condition: str = ""

    def to_json(self) -> dict[str, Any]:
        """``where``, ``when`` and ``missing_heat_W`` as plain data; null where there is no number."""
        found = []
        for stretch, (start, end, recording) in zip(self.when, self.stamps, strict=True):
            own = {} if recording is None else {"recording": recording}
            found.append({"start": start, "end": end, "condition": stretch.condition} | own)
        return {
            "where": {
                "component": self.component or None,
                "r_mm": _millimetres(self.radius),
                "z_mm": _millimetres(self.axial),
                "credible": list(self.credible),
                "condition": self.condition or None,
                "shares": dict(self.shares),
            },
            "when": found,
            "missing_heat_W": {
                name: {"mean": item.mean, "peak": item.peak} for name, item in self.missing_heat.items()
            },
        }


def _millimetres(value: float) -> float | None:
    return round(1.0e3 * value, 3) if np.isfinite(value) else None


def where_of(diagnosis: Diagnosis) -> Where:
    """Place and time of the mismatch that a diagnosis found.

    Returns
    -------
    Where
        Empty when the verdict is ``consistent``.
    """
    if diagnosis.judgement.verdict == "consistent":
        return Where("", np.nan, np.nan, (), {}, {}, {}, ())
    view, candidates = diagnosis.view, diagnosis.final.candidates
    by_component, spots = component_shares(diagnosis.explanations, view.reported)
    ranked = sorted(by_component, key=lambda name: -by_component[name])
    component = main_component(diagnosis) or (ranked[0] if ranked else "")
    named = list(dict.fromkeys((component, *(c.component for c in candidates)) if component else ()))
    credible = list(named)
    # A finding that is no heat at a place says itself where; otherwise the inversion widens it.
    covered = 0.0
    for name in ranked:
        if covered >= CREDIBLE:
            break
        covered += by_component[name]
        if name not in credible:
            credible.append(name)
    # A sensor's reading is wrong without any heat.
    sensors = {c.component for c in candidates if c.kind == "sensor"}
    heat = {
        name: missing_heat(diagnosis.explanations, spots[name], diagnosis.predictor)
        for name in credible
        if name in spots and name not in sensors
    }
    radius, axial = _centre(diagnosis, component)
    when = significant_stretches(diagnosis.unchanged, diagnosis.null)
    several = len(diagnosis.predictor.recordings) > 1
    stamps = tuple(
        (
            diagnosis.stamp(item.start, item.recording),
            diagnosis.stamp(item.end, item.recording),
            diagnosis.predictor.recordings[item.recording].name if several else None,
        )
        for item in when
    )
    longest = max(when, key=lambda item: item.end - item.start, default=None)
    spot = "" if component in sensors else spots.get(component, "")
    condition = heat_condition(diagnosis.explanations, spot, diagnosis.predictor) or (
        longest.condition if longest else ""
    )
    return Where(
        component, radius, axial, tuple(credible), by_component, spots, heat, when, stamps, condition
    )


def _centre(diagnosis: Diagnosis, component: str) -> tuple[float, float]:
    """Radius and axial place of a component, or of the spot where unrecorded heat was found there."""
    if diagnosis.view.kind != "geometry":
        return np.nan, np.nan
    spec = diagnosis.predictor.fast.spec
    found = None
    for candidate in diagnosis.final.candidates:
        if candidate.component == component and isinstance(effect_of(candidate.effect), IntervalEffect):
            spot = next((s for s in diagnosis.view.spots if s in candidate.form.split()), component)
            found = centre_of(spec, spot)
    return found or centre_of(spec, component) or (np.nan, np.nan)


# ---------------------------------------------------------------------- place
def component_shares(
    explanations: Sequence[Explanation], reported: Mapping[str, str]
) -> tuple[dict[str, float], dict[str, str]]:
    """Probability of missing heat in every component, and the best spot of each.

    Every spot counts the same beforehand. As for sets of effects, evidence
    counts a share of what it says, and less the more a spot explains.

    Parameters
    ----------
    explanations : sequence of Explanation
        One for every spot in every recording; recordings add up.
    reported : mapping of spot to str
        Component of a spot, itself where absent.

    Examples
    --------
    >>> import numpy as np
    >>> none = np.zeros(0)
    >>> items = [Explanation(name, 0, evidence, none, none, none) for name, evidence in
    ...          (("left", 4.0), ("right", 0.0), ("top", 0.0))]
    >>> shares, spots = component_shares(items, {"right": "rest", "top": "rest"})
    >>> {name: round(value, 2) for name, value in shares.items()}, spots["rest"]
    ({'left': 0.88, 'rest': 0.12}, 'right')
    """
    evidence: dict[str, float] = {}
    for item in explanations:
        evidence[item.spot] = evidence.get(item.spot, 0.0) + item.log_evidence
    if not evidence:
        return {}, {}
    weighed = {spot: counted(gain) / tuned.GAIN_DIVISOR for spot, gain in evidence.items()}
    by_component: dict[str, float] = {}
    spots: dict[str, str] = {}
    for spot, share in shares(weighed).items():
        component = reported.get(spot, spot)
        by_component[component] = by_component.get(component, 0.0) + share
        if component not in spots or evidence[spot] > evidence[spots[component]]:
            spots[component] = spot
    return by_component, spots


def missing_heat(explanations: Sequence[Explanation], spot: str, predictor: Predictor) -> MissingHeat:
    """Mean over time and signed peak of the heat track at a spot, all recordings together.

    An isolated step, as where readings are missing, is no peak.
    """
    total, duration, peak = 0.0, 0.0, 0.0
    for item in explanations:
        if item.spot != spot:
            continue
        stop = float(predictor.drives[item.recording].grid[-1])
        lengths = np.diff(np.append(item.times, stop))
        total += float(item.heat @ lengths)
        duration += float(lengths.sum())
        steady = median_filter(item.heat, 3, mode="nearest")
        largest = float(steady[np.argmax(np.abs(steady))])
        peak = largest if abs(largest) > abs(peak) else peak
    return MissingHeat(total / duration if duration else 0.0, peak)


def heat_condition(explanations: Sequence[Explanation], spot: str, predictor: Predictor) -> str:
    """Operating condition while heat is missing at a spot; empty if it never clearly is.

    With several recordings, that in which it is missing for longest. Heat
    counts beyond three standard errors and a quarter of its peak.
    """
    words, longest = "", 0.0
    for item in explanations:
        if item.spot != spot:
            continue
        level = np.maximum(SIGNIFICANT_SIGMAS * item.sigma, tuned.SMEAR_SHARE * np.abs(item.heat).max())
        edges = np.append(item.times, predictor.drives[item.recording].grid[-1])
        active = np.abs(item.heat) > level
        duration = float(np.diff(edges)[active].sum())
        if duration > longest:
            recording = predictor.recordings[item.recording]
            owner = np.clip(np.searchsorted(edges, recording.times, side="right") - 1, 0, len(active) - 1)
            mask = active[owner]
            if mask.any():
                longest = duration
                limit = separating_temperature(recording, mask)
                condition_words = _words(operating_conditions(recording), mask)
                words = ", ".join(part for part in (condition_words, limit) if part)
    return words


def main_component(diagnosis: Diagnosis) -> str:
    """Component of the finding that changes the readings most: physics before parameters, sensors last."""
    candidates = diagnosis.final.candidates
    kind = kind_of(candidates)
    own = [c for c in candidates if c.kind == kind]
    if len(own) < 2:
        return own[0].component if own else ""
    change = {id(c): change_without(diagnosis.predictor, diagnosis.final, c) for c in own}
    return max(own, key=lambda c: change[id(c)]).component


def change_without(predictor: Predictor, fit: Fit, candidate: Candidate) -> float:
    """Root mean square change of all temperatures when one candidate of a fit is taken away, K."""
    rest = tuple(c for c in fit.candidates if c is not candidate)
    values = values_without(fit, candidate)
    total, number = 0.0, 0
    for recording, own in enumerate(predictor.recordings):
        whole = predictor.predict(recording, fit.values, fit.candidates).temperature
        part = predictor.predict(recording, values, rest).temperature
        # Displacements, in µm, come after them.
        change = (whole - part)[:, : own.temperature_count]
        total += float(np.sum(change**2))
        number += change.size
    return float(np.sqrt(total / max(number, 1)))


def values_without(fit: Fit, candidate: Candidate) -> dict[str, float]:
    """Values of a fit less those that only one of its candidates has."""
    own = {c.name for c in candidate_coordinates(candidate)}
    others = {c.name for item in fit.candidates if item is not candidate for c in candidate_coordinates(item)}
    return {name: value for name, value in fit.values.items() if name not in own - others}


# ----------------------------------------------------------------------- time
def significant_stretches(predictor: Predictor, fit: Fit) -> tuple[Stretch, ...]:
    """Times in which what a fit leaves is beyond three standard errors in some channel.

    Residuals are averaged over a window of at least 10 min; the standard error
    holds white noise and the slow error. Of a large mismatch, less than a
    quarter of its largest departure does not count. Stretches that nearly
    touch are one.

    Parameters
    ----------
    fit : Fit
        Nothing missing.
    """
    tracks = [_scores(predictor, fit, number) for number in range(len(predictor.recordings))]
    largest = max(
        (float(np.abs(score).max()) for track in tracks for _, score in track if score.size), default=0
    )
    limit = min(max(SIGNIFICANT_SIGMAS, tuned.SMEAR_SHARE * largest), tuned.NEAR_LARGEST * largest)
    if limit <= 0.0:
        return ()
    found: list[Stretch] = []
    for number, recording in enumerate(predictor.recordings):
        spans = []
        for times, score in tracks[number]:
            half = 0.5 * float(np.median(np.diff(times))) if len(times) > 1 else 0.0
            for start, end in stretches(np.abs(score) > limit, times):
                spans.append((max(start - half, 0.0), min(end + half, float(recording.times[-1]))))
        window = window_of(recording)
        joined = [span for span in join(spans, window) if span[1] - span[0] >= 0.5 * window]
        joined = joined or join(spans, window)
        words = conditions_in_words(recording, joined)
        found += [Stretch(start, end, word, number) for (start, end), word in zip(joined, words, strict=True)]
    return tuple(found)


def window_of(recording: Recording) -> float:
    """Time over which residuals are averaged before they are judged, s."""
    duration = float(recording.times[-1] - recording.times[0])
    return max(SHORTEST_WINDOW, duration / WINDOWS_A_RECORDING)


def join(spans: Sequence[tuple[float, float]], gap: float) -> list[tuple[float, float]]:
    """Union of intervals, those less than ``gap`` apart as one.

    >>> join([(5.0, 6.0), (0.0, 2.0), (2.5, 3.0)], 1.0)
    [(0.0, 3.0), (5.0, 6.0)]
    """
    found: list[tuple[float, float]] = []
    for start, end in sorted(spans):
        if found and start - found[-1][1] <= gap:
            found[-1] = (found[-1][0], max(found[-1][1], end))
        else:
            found.append((start, end))
    return found


def _scores(predictor: Predictor, fit: Fit, number: int) -> list[tuple[Array, Array]]:
    """Times and smoothed residuals in standard errors of every channel of a recording."""
    predicted = predictor.predict(number, fit.values, fit.candidates).temperature
    window = window_of(predictor.recordings[number])
    found = []
    for channel in range(predictor.recordings[number].temperature_count):
        own = [
            o
            for o in (*predictor.observations, *predictor.heldout)
            if (o.recording, o.channel) == (number, channel)
        ]
        if not own:
            continue
        times = np.concatenate([o.bins.times for o in own])
        order = np.argsort(times)
        residual = np.concatenate([o.values - o.at(predicted[:, channel]) for o in own])[order]
        variance = np.concatenate([o.bins.white**2 / o.bins.number for o in own])[order]
        slow = fit.slow.of(own[0].bins.key)
        found.append((times[order], smoothed_scores(times[order], residual, variance, slow, window)))
    return found


def smoothed_scores(times: Array, residual: Array, variance: Array, slow: SlowError, window: float) -> Array:
    """Running means of residuals in units of their standard error.

    Parameters
    ----------
    times : (n,) ndarray, [s]
        Increasing.
    residual : (n,) ndarray, [K]
    variance : (n,) ndarray, [K²]
        White, of each.
    slow : SlowError
        Its mean over a window keeps ``2 (x - 1 + e^-x) / x²`` of its variance,
        x the window in correlation times.
    window : float, [s]
    """
    first = np.searchsorted(times, times - 0.5 * window, side="left")
    last = np.searchsorted(times, times + 0.5 * window, side="right")
    number = last - first

    def total(values: Array) -> Array:
        summed = np.concatenate(([0.0], np.cumsum(values)))
        return summed[last] - summed[first]

    ratio = np.maximum(times[last - 1] - times[first], 1.0) / slow.time
    kept = 2.0 * (ratio + np.expm1(-ratio)) / ratio**2
    return total(residual) / number / np.sqrt(total(variance) / number**2 + slow.sigma**2 * kept)


# ------------------------------------------------------------------ condition
def conditions_in_words(recording: Recording, spans: Sequence[tuple[float, float]]) -> list[str]:
    """Operating condition in each of some stretches: speed band, heating or cooling, temperature."""
    if not spans:
        return []
    conditions = operating_conditions(recording)
    times = recording.times
    inside = np.zeros(times.size, dtype=bool)
    masks = []
    for start, end in spans:
        mask = (times >= start) & (times <= end)
        if not mask.any():
            mask[np.argmin(np.abs(times - 0.5 * (start + end)))] = True
        masks.append(mask)
        inside |= mask
    limit = separating_temperature(recording, inside)
    return [", ".join(part for part in (_words(conditions, mask), limit) if part) for mask in masks]


def _words(conditions: Conditions, mask: NDArray[np.bool_]) -> str:
    share = dict(zip(conditions.names, conditions.marks[mask].mean(axis=0), strict=True))
    trend = [name for name in ("heating", "cooling", "steady") if share.get(name, 0.0) >= tuned.MOSTLY]
    states = {name: value for name, value in share.items() if name not in ("heating", "cooling", "steady")}
    kept, covered = [], 0.0
    for name in sorted(states, key=lambda key: -states[key]):
        if covered >= tuned.SEPARATES:
            break
        kept.append(name)
        covered += states[name]
    words = [band_words([name for name in conditions.names if name in kept])]
    words += [{"steady": "steady temperature"}.get(name, name) for name in trend]
    return ", ".join(word for word in words if word)


def band_words(names: Sequence[str]) -> str:
    """Merge adjacent speed bands.

    >>> band_words(["standstill", "0-1000 rpm", "1000-2000 rpm", "4000-5000 rpm"])
    'standstill, 0-2000 rpm and 4000-5000 rpm'
    """
    found: list[str] = []
    for name in names:
        low, _, high = name.removesuffix(" rpm").partition("-")
        last = found[-1].removesuffix(" rpm").partition("-") if found and found[-1].endswith("rpm") else None
        if name.endswith("rpm") and last is not None and last[2] == low:
            found[-1] = f"{last[0]}-{high} rpm"
        else:
            found.append(name)
    return " and ".join([", ".join(found[:-1]), found[-1]]) if len(found) > 1 else "".join(found)


def separating_temperature(recording: Recording, inside: NDArray[np.bool_]) -> str:
    """``above 31 °C at SP01`` if that separates the stamps inside from those outside; else empty."""
    best, words = tuned.SEPARATES, ""
    for column, name in enumerate(recording.temperature_names[: recording.temperature_count]):
        usable = recording.usable[:, column]
        hot, cold = inside & usable, ~inside & usable
        if min(hot.sum(), cold.sum()) < 10:
            continue
        values = recording.temperature[:, column]
        levels = np.unique(np.quantile(values[usable], np.linspace(0.02, 0.98, 97)))
        above = np.array([0.5 * ((values[hot] > v).mean() + (values[cold] <= v).mean()) for v in levels])
        for score, word in ((above, "above"), (1.0 - above, "below")):
            at = int(np.argmax(score))
            if score[at] > best:
                best = float(score[at])
                words = f"{word} {levels[at] - ZERO_CELSIUS_K:.0f} °C at {name}"
    return words
