"""Intervals of delays that are found: what a sensor answers late by itself is in them."""

import numpy as np
import pytest

from spindle_fem.inference import tuned
from spindle_fem.inference.findings import reported_parameters
from spindle_fem.inference.hypothesis_fit import amplitude_name
from tests.support.diagnosed_spindle import Case


@pytest.mark.parametrize(("effect", "name"), [("clock_shift", "shift"), ("sensor_lag", "time_constant")])
def test_an_interval_of_a_delay_holds_the_sensor_s_own_and_no_lag_is_negative(tmp_path, effect, name):
    diagnosis = Case(tmp_path).diagnosis((effect, "SP02"), 12.0, "sensor", ())
    (found,) = diagnosis.final.candidates
    told = reported_parameters(diagnosis.final, found)[name]
    low, high = diagnosis.final.interval(amplitude_name(found), 1.0)
    # 90 % of a normal distribution are within 1.64 standard deviations, here of the sensor and of the fit as
    # intervals have it.
    apart = 1.64 * np.hypot(tuned.RESPONSE_SIGMA, 0.5 * tuned.INTERVAL_WIDENING * (high - low))
    least = told["value"] - apart
    assert told["high"] == pytest.approx(told["value"] + apart, abs=2.0)
    assert told["low"] == pytest.approx(max(0.0, least) if effect == "sensor_lag" else least, abs=2.0)
    assert (told["low"] >= 0.0) is (effect == "sensor_lag")
