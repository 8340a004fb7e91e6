"""Which readings are held out, and how far a prediction is from them."""

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.errors import SpecError
from spindle_fem.inference.heldout import heldout_stamps
from spindle_fem.inference.input_sampling import error_over_noise


@pytest.mark.parametrize("times", [np.arange(1000.0), np.sort(np.random.default_rng(0).uniform(0, 9e4, 700))])
def test_blocks_are_whole_stretches_of_time(times):
    held, how = heldout_stamps(SimpleNamespace(times=times))
    assert held.mean() == pytest.approx(0.25, abs=0.05)
    assert np.abs(np.diff(held.astype(int))).sum() == 10
    share = (times - times[0]) / np.ptp(times)
    assert not held[share < 0.1 - 1e-9].any()
    assert held[(share > 0.1001) & (share < 0.1499)].all()
    assert "stretches" in how


def test_the_last_part_is_the_last_part():
    times = np.array([0.0, 1.0, 5.0, 9.0, 9.5, 10.0]) + 100.0
    held, how = heldout_stamps(SimpleNamespace(times=times), "last:0.4")
    assert held.tolist() == [False, False, False, True, True, True]
    assert how == "the last 40 % of the time"


@pytest.mark.parametrize(
    "choice", ["last", "last:", "last:0", "last:0.9", "first:0.2", "last:x", "", "last:nan"]
)
def test_other_choices_are_refused(choice):
    with pytest.raises(SpecError, match=r'Allowed: "blocks", or "last:0.4"'):
        heldout_stamps(SimpleNamespace(times=np.arange(10.0)), choice)


def test_the_zero_of_a_displacement_is_no_error():
    read = np.array([0.0, 0.2, -0.2])

    def error(zero, is_relative):
        bins = SimpleNamespace(is_relative=is_relative, white=0.1)
        return error_over_noise([SimpleNamespace(bins=bins, values=read + zero)], [np.zeros(3)])

    assert error(0.0, is_relative=True) == pytest.approx(np.mean(read**2) / 0.1**2)
    assert error(250.0, is_relative=True) == pytest.approx(error(0.0, is_relative=True))
    assert error(250.0, is_relative=False) > 1e6
