"""A predictor in which everything about the optimum is known: a straight line over each recording."""

from types import SimpleNamespace

import numpy as np

from spindle_fem.inference.observations import observe
from spindle_fem.inference.prediction import Prediction
from spindle_fem.inference.priors import Prior

NAMES = ("level", "slope")


class Line:
    """Level and slope of every channel; ``stretch`` times the derivatives are told."""

    def __init__(self, recordings, *, slope_sigma=0.4, offsets=(290.0,), stretch=1.0, highest=np.inf):
        self.recordings = tuple(recordings)
        nothing = [None] * len(self.recordings)
        self.observations = observe(self.recordings, nothing, nothing, nothing)
        self.priors = (Prior("level", 1.0, 0.5, "K", highest), Prior("slope", 1.0, slope_sigma, "K"))
        self.effects = SimpleNamespace(readings=())
        self.offsets, self.stretch = np.array(offsets), stretch

    def uncertain(self):
        return self.priors

    def starts(self):
        return ()

    def directions_of(self, number):
        return [], np.zeros((0, 0, 0))

    def shapes(self, number):
        times = self.recordings[number].times
        return np.stack([np.ones(times.size), times / times[-1]], axis=1)

    def predict(self, number, values, candidates=(), derivatives=(), near=None):
        shapes = self.shapes(number)
        factors = np.log([values.get(name, 1.0) for name in NAMES])
        told = (shapes @ factors)[:, None] + self.offsets
        by = np.repeat(self.stretch * shapes[:, None], len(self.offsets), axis=1)
        return Prediction(told, by[:, :, [NAMES.index(name) for name in derivatives]], np.zeros(0))
