"""The recorded spindle with one unknown per part: definition, fast model, and a drive through speeds."""

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from tests.support.diagnosed_spindle import HEAT, Case
from tests.support.lumped_spindle import drive_of, lumped_model


@pytest.fixture(scope="session")
def spec():
    return load_machine("recorded_spindle")


@pytest.fixture(scope="session")
def fast(spec):
    return fast_spindle(lumped_model(spec), spec)


def driven_for(seconds):
    times = np.arange(0.0, seconds, 60.0)
    share = times / seconds
    speed = np.select([share < 1 / 12, share < 5 / 12, share < 3 / 4], [0.0, 3000.0, 1500.0], 4000.0)
    return drive_of(
        times, speed, ambient=293.0 + np.sin(times / 900.0), inlet=289.0 + 0.5 * np.cos(times / 500.0)
    )


@pytest.fixture(scope="session")
def steps():
    return driven_for(7200.0)


@pytest.fixture(scope="session")
def short_drive():
    """Through the same speeds in a third of the time, where a run is marched dozens of times."""
    return driven_for(2400.0)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """A lumped spindle that is made to differ in known ways."""
    return Case(tmp_path_factory.mktemp("lumped"))


@pytest.fixture(scope="module")
def heated(case):
    """Front bearings get heat for a while that nobody wrote down; thermal preload may be it too."""
    return case.diagnosis(
        ("unrecorded_heat_source", "front_bearings"),
        HEAT,
        "ambiguous",
        (("thermal_preload", "front_bearings"),),
    )
