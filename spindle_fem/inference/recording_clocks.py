"""Clocks of recordings: temperatures are read on the clock of the inputs.

Readings follow a clock that is off to first order only, and where an input steps they bend: half a minute of
it leaves several times the noise of a quiet sensor, which single channels that are late would explain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference import tuned
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.misdescription import EVERY_CHANNEL, Misdescription, delays_in
from spindle_fem.inference.misdescription_columns import with_misdescriptions
from spindle_fem.inference.predictor import Predictor

Array = NDArray[np.float64]

# What is late by less is followed to first order; and how often a clock is worked out anew.
LEAST_LATE, ROUNDS = tuned.RESPONSE_SIGMA, 3


def restamped(predictor: Predictor, fit: Fit) -> tuple[Predictor, dict[str, float]]:
    """A predictor with temperatures on the clock of inputs, and values of a fit without what that was off.

    By the fit's clock and what channels, each late by itself, have in common; where the fit leaves much a
    clock may be taken for what is missing, and both stay as they are.
    """
    seconds, values = np.zeros(len(predictor.recordings)), dict(fit.values)
    for number in range(len(predictor.recordings)):
        delays = delays_in(number, predictor.misdescribed)
        clock = next((name for name, late in delays.items() if late == EVERY_CHANNEL), None)
        if clock is not None:
            of_channels = [fit.values.get(name, 0.0) for name in delays if name != clock]
            common = float(np.median([*of_channels, 0.0]))
            # Channels keep what they are late by themselves.
            seconds[number], values[clock] = values[clock] + common, -common
    if fit.reduced_misfit > tuned.DISTORTED**2 or np.abs(seconds).max(initial=0.0) < LEAST_LATE:
        return predictor, dict(fit.values)
    return predictor.on_clocks(predictor.late + seconds), values


def on_clock_of_inputs(
    predictor: Predictor, problem: Problem, fit: Fit, directions: Sequence[Misdescription]
) -> tuple[Predictor, Problem, Fit]:
    """A predictor, and the problem of a smaller one like it, about a fit of nothing missing, and that fit.

    With temperatures on the clock of the inputs, as far as that fit knows it: where much is missing a clock
    may be taken for that.
    """
    for _ in range(ROUNDS):
        again, begin = restamped(predictor, fit)
        settled, small = again is predictor, problem.predictor.on_clocks(again.late)
        predictor = with_misdescriptions(again, directions, begin)
        problem = replace(
            problem, predictor=small.misdescribed_like(predictor), observations=small.observations
        )
        fit = problem.fit((), begin)
        if settled:
            break
    return predictor, problem, fit
