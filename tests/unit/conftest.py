"""The recorded spindle with one unknown per part: definition, fast model, and a drive through speeds."""

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from tests.support.lumped_spindle import drive_of, lumped_model


@pytest.fixture(scope="session")
def spec():
    return load_machine("recorded_spindle")


@pytest.fixture(scope="session")
def fast(spec):
    return fast_spindle(lumped_model(spec), spec)


@pytest.fixture(scope="session")
def steps():
    times = np.arange(0.0, 7200.0, 60.0)
    speed = np.select([times < 600, times < 3000, times < 5400], [0.0, 3000.0, 1500.0], 4000.0)
    return drive_of(
        times, speed, ambient=293.0 + np.sin(times / 900.0), inlet=289.0 + 0.5 * np.cos(times / 500.0)
    )
