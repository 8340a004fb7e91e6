"""Hypotheses made up for tests of what they amount to, with one coordinate for each candidate."""

import numpy as np

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.term import TermParameter
from spindle_fem.inference import tuned
from spindle_fem.inference.belief import Belief, Coordinate
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.reading_noise import SlowError
from spindle_fem.inference.verdict import judge

# Where a prior that is even in the logarithm has the density of the normal one.
AS_NORMAL = np.sqrt(2.0 * np.pi) / (2.0 * np.log(1.0 / tuned.SMALLEST_SIZE))
HEAT = Coordinate("heat.front", 1.0, 0.2, True, -4.0, 4.0)
DATA = 400


def candidate(effect, component="front_bearings", kind="missing_physics", form="", factor=None):
    factors = () if factor is None else (TermParameter(factor, 1.0, 0.6),)
    size = factor or f"{effect}.size"
    return Candidate(
        effect, component, form, kind, size, 1.0, 1.2, factors=factors, shift_of_prior=bool(factor)
    )


def hypothesis(*candidates, misfit, evidence=None, log_prior=0.0, position=(), reduced=1.0):
    """A fit with one coordinate for each candidate beside the machine's own."""
    own = [
        Coordinate(f"effect:{c.amplitude}" if c.factors else c.amplitude, 1.0, 0.6, True, -4.0, 4.0)
        for c in candidates
    ]
    coordinates = (HEAT, *own)
    where = np.full(len(coordinates), AS_NORMAL)
    where[0] = 0.0
    where[: len(position)] = position
    fit = Fit(
        tuple(candidates),
        coordinates,
        where,
        np.eye(len(coordinates)),
        -0.5 * misfit - 2.0 * len(candidates) if evidence is None else evidence,
        reduced * DATA,
        misfit,
        np.zeros(DATA),
        SlowError(),
        Belief.prior((HEAT,)),
    )
    return Hypothesis(fit, log_prior)


def verdict(*found, calibrated=False, trials=100, overlapping=None, **more):
    more.setdefault("left", lambda fit: 0.9 if fit.candidates else 1.0)
    return judge(list(found), trials=trials, calibrated=calibrated, overlapping=overlapping, **more)


PRELOAD = candidate("thermal_preload")
CHURNING = candidate("grease_churning")
SCALE = candidate("heat_scale", kind="parameter", factor="heat.front")
OFFSET = candidate("sensor_offset", "SP02", "sensor")
