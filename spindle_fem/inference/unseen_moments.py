"""Moments of changes, of a set's and of inputs, that fell into held-out stretches, from all readings.

No fitted reading shows when within such a stretch something changed. What a set predicts there is judged by
its sizes and laws, not by the guess of a moment that only the held-out readings themselves can tell.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear, minimize_scalar

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference.hypothesis_fit import NOT_SIMULATED, Fit
from spindle_fem.inference.missing_heat import stretches
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.robust_size import huber

# Names of parameters that are moments: of intervals and levels, of a drift, of a sensor that came off.
OF_INTERVALS, OF_SENSORS = ("start_", "end_"), ("start", "time")
# Moments tried over a stretch before the best of them is refined, and how closely, as a share of the stretch.
TRIED, CLOSENESS = 9, 0.01
# Share of its distance from the moments beside it, of the same set's member, that a moment keeps.
KEPT_APART = 0.1
# A moment may lie in a stretch beside it if, at its near end, the readings are this little less likely.
FLAT = 10.0
# What an input that changed earlier does is bent over the time: rounds about the values found before.
ROUNDS = 3


def unseen_moments(predictor: Predictor, fit: Fit) -> dict[str, float]:
    """Values of the moments that may lie in held-out stretches, by name [s]; all else as it was fitted.

    In the stretch in which the fit has it, and in those next to it up to which fitted readings do not tell.
    Moments of one member stay in their order: none begins after it ends.
    """
    found: dict[str, float] = {}
    for candidate, name, others in _moments(fit):
        number = candidate.recording or 0
        held = stretches(~predictor.use[number], predictor.stamps(number))
        values = fit.values | found
        misfit = _MomentMisfit(predictor, fit, values, name)
        low, high = _room(misfit.moment, [values[other] for other in others])
        best = misfit.moment
        for first, last in _beside(held, misfit.moment):
            begin, end = max(first, low), min(last, high)
            if begin >= end:
                continue
            inside = begin <= misfit.moment <= end
            if inside or misfit.cost_at(min(max(misfit.moment, begin), end)) < misfit.cost + FLAT:
                best = min(best, misfit.best_within(begin, end), key=misfit.cost_at)
        if best != misfit.moment:
            found[name] = best
    return found


def unread_changes(predictor: Predictor, fit: Fit) -> dict[str, float]:
    """What inputs did between the rows of held-out stretches, from all readings: values by name.

    Within the bounds of what rows leave open, as far from what was fitted as that is uncertain; all else as
    it was fitted. Fitted readings have told what they know by the fit: those held out are left to tell.
    """
    known = {c.name: c for c in fit.coordinates}
    deviation = dict(zip(known, np.sqrt(np.diag(fit.covariance)), strict=True))
    found: dict[str, float] = {}
    for number, use in enumerate(predictor.use):
        held = stretches(~use, predictor.stamps(number))
        values = {
            name: fit.values[name] for name in predictor.unread_within(number, held, {}) if name in known
        }
        # The constant of a displacement is free: temperatures tell.
        seen = [
            (item, np.hypot(item.bins.white, fit.slow.sigma))
            for item in predictor.heldout
            if item.recording == number and not item.bins.is_relative
        ]
        if not (values and seen):
            continue
        predicted = predictor.predict(number, fit.values, fit.candidates).temperature
        coordinates = [known[name] for name in values]
        fitted = np.array([c.of(v) for c, v in zip(coordinates, values.values(), strict=True)])
        known_to = np.array([deviation[name] for name in values])
        without = predicted - sum(c for c, _ in _opened(predictor, number, held, values))
        for _ in range(ROUNDS):
            changes, slopes = zip(*_opened(predictor, number, held, values), strict=True)
            now = np.array([c.of(v) for c, v in zip(coordinates, values.values(), strict=True)])
            columns = np.stack([c.sigma * s for c, s in zip(coordinates, slopes, strict=True)], axis=2)
            own = [item.at(columns[:, item.channel]) / noise for item, noise in seen]
            rest = [
                (item.values - item.at((without + sum(changes))[:, item.channel])) / noise
                for item, noise in seen
            ]
            matrix = np.vstack(own)
            moved = lsq_linear(
                np.vstack((matrix, np.diag(1.0 / known_to))),
                np.concatenate((np.concatenate(rest) + matrix @ now, fitted / known_to)),
                ([c.low for c in coordinates], [c.high for c in coordinates]),
            ).x
            values = {c.name: c.at(u) for c, u in zip(coordinates, moved, strict=True)}
        found |= values
    return found


def _opened(
    predictor: Predictor, number: int, held: Sequence[tuple[float, float]], values: Mapping[str, float]
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Changes of the channels by the values of what rows of some stretches leave open, and with each unit."""
    opened = predictor.unread_within(number, held, values)
    return [opened[name] for name in values]


def _beside(held: list[tuple[float, float]], moment: float) -> list[tuple[float, float]]:
    """The stretch that a moment lies in, the last before it and the first after it."""
    inside = [pair for pair in held if pair[0] <= moment <= pair[1]]
    before = [pair for pair in held if pair[1] < moment]
    return [*inside, *before[-1:], *[pair for pair in held if pair[0] > moment][:1]]


def _room(moment: float, others: Sequence[float]) -> tuple[float, float]:
    """Times to which a moment may move between others [s]."""
    share = 1.0 - KEPT_APART
    before = max((other for other in others if other < moment), default=-np.inf)
    after = min((other for other in others if other > moment), default=np.inf)
    return moment + share * (before - moment), moment + share * (after - moment)


def _moments(fit: Fit) -> Iterator[tuple[Candidate, str, list[str]]]:
    """Candidates with the name of each of their free moments, and those of the others."""
    known = {c.name for c in fit.coordinates}
    for candidate in fit.candidates:
        own = [
            name
            for name, item in candidate.free.items()
            if (item.name.startswith(OF_INTERVALS) or item.name in OF_SENSORS)
            and item.unit == "s"
            and name in known
        ]
        for name in own:
            yield candidate, name, [other for other in own if other != name]


class _MomentMisfit:
    """Misfit of all readings over one moment."""

    def __init__(self, predictor: Predictor, fit: Fit, values: Mapping[str, float], name: str) -> None:
        self._predictor, self._fit, self._values, self._name = predictor, fit, values, name
        self._known: dict[float, float] = {}
        self.moment = values[name]
        self.cost = self.cost_at(self.moment)

    def cost_at(self, moment: float) -> float:
        """Robust sum of squares over the white noise; infinite where the set cannot be simulated."""
        if moment not in self._known:
            self._known[moment] = self._cost(moment)
        return self._known[moment]

    def _cost(self, moment: float) -> float:
        predictor, values = self._predictor, {**self._values, self._name: moment}
        try:
            predicted = [
                predictor.predict(number, values, self._fit.candidates).temperature
                for number in range(len(predictor.recordings))
            ]
        except NOT_SIMULATED:
            return np.inf
        left: dict[tuple[int, int, bool], list[NDArray[np.float64]]] = {}
        for item in (*predictor.observations, *predictor.heldout):
            own = left.setdefault((item.recording, item.channel, item.bins.is_relative), [])
            apart = item.at(predicted[item.recording][:, item.channel]) - item.values
            own.append(apart / item.bins.white)
        # The constant of a displacement is free, and the same for all of its readings.
        whole = [(np.concatenate(own), relative) for (*_, relative), own in left.items()]
        return sum(float(np.sum(huber(own - relative * own.mean()))) for own, relative in whole)

    def best_within(self, begin: float, end: float) -> float:
        """The best moment between two."""
        tried = [float(moment) for moment in np.linspace(begin, end, TRIED)]
        best = min(tried, key=self.cost_at)
        step = (end - begin) / (TRIED - 1)
        closer = minimize_scalar(
            self.cost_at,
            bounds=(max(begin, best - step), min(end, best + step)),
            method="bounded",
            options={"xatol": CLOSENESS * (end - begin)},
        )
        return min(best, float(closer.x), key=self.cost_at)
