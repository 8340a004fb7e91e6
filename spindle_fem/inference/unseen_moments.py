"""Moments of changes that fell into held-out stretches, from all readings.

No fitted reading shows when within such a stretch something changed. What a set predicts there is judged by
its sizes and laws, not by the guess of a moment that only the held-out readings themselves can tell.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from scipy.optimize import minimize_scalar

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.errors import ConvergenceError
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.missing_heat import stretches
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.robust_size import huber

# Names of parameters that are moments: of intervals and levels, of a drift, of a sensor that came off.
OF_INTERVALS, OF_SENSORS = ("start_", "end_"), ("start", "time")
# Moments tried over a stretch before the best of them is refined, and how closely, as a share of the stretch.
TRIED, CLOSENESS = 9, 0.01


def unseen_moments(predictor: Predictor, fit: Fit) -> dict[str, float]:
    """Values of the moments that lie in held-out stretches, by name [s]; everything else as it was fitted."""
    found: dict[str, float] = {}
    values = fit.values
    for candidate, name in _moments(fit):
        number = candidate.recording or 0
        use, times = predictor.use[number], predictor.recordings[number].times
        for begin, end in stretches(~use, times):
            if begin <= values[name] <= end:
                found[name] = _best(predictor, fit, values | found, name, (begin, end))
    return found


def _moments(fit: Fit) -> Iterator[tuple[Candidate, str]]:
    """Candidates with the names of their free moments."""
    known = {c.name for c in fit.coordinates}
    for candidate in fit.candidates:
        for name, item in candidate.free.items():
            is_moment = item.name.startswith(OF_INTERVALS) or item.name in OF_SENSORS
            if is_moment and item.unit == "s" and name in known:
                yield candidate, name


def _best(
    predictor: Predictor, fit: Fit, values: Mapping[str, float], name: str, within: tuple[float, float]
) -> float:
    """The moment with the least misfit of all readings, where the set can be simulated with it."""
    seen = (*predictor.observations, *predictor.heldout)

    def misfit(moment: float) -> float:
        moved = {**values, name: moment}
        try:
            told = [
                predictor.predict(number, moved, fit.candidates).temperature
                for number in range(len(predictor.recordings))
            ]
        except ConvergenceError:
            return np.inf
        return sum(
            float(
                np.sum(
                    huber((item.at(told[item.recording][:, item.channel]) - item.values) / item.bins.white)
                )
            )
            for item in seen
        )

    tried = [*np.linspace(*within, TRIED), values[name]]
    costs = [misfit(moment) for moment in tried]
    best = tried[int(np.argmin(costs))]
    step = (within[1] - within[0]) / (TRIED - 1)
    bounds = max(within[0], best - step), min(within[1], best + step)
    closer = minimize_scalar(
        misfit, bounds=bounds, method="bounded", options={"xatol": CLOSENESS * (within[1] - within[0])}
    )
    return float(closer.x) if closer.fun < min(costs) else float(best)
