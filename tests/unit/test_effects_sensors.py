"""Sensors that lie: exact answers for ramps, steps and constants."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from spindle_fem.effects.catalogue.coolant_bypass import MixedOutlet
from spindle_fem.effects.catalogue.sensor_detached import DetachedReading
from spindle_fem.effects.framework.filters import delayed, first_order_lag, scan
from spindle_fem.effects.framework.spectrum import strongest_periods
from spindle_fem.effects.registry import catalogue

TIMES = np.array([0.0, 3.0, 10.0, 11.0, 40.0, 41.5, 90.0, 200.0, 201.0, 500.0])
RAMP = 293.15 + 0.05 * TIMES


def reading_of(effect, form="", duration=7200.0):
    kind = catalogue()[effect]

    class View:
        channels = ("T1",)
        probes = {"T1": "P1"}  # noqa: RUF012
        reference_temperature = 290.0

    View.duration = duration
    return next(c for c in kind.forms(View) if c.form == form)


def read(effect, values, *, form="", inputs=None, **parameters):
    candidate = reading_of(effect, form)
    own = {item.name: np.array([item.value + 0j]) for item in candidate.reading.parameters}
    own |= {name: np.array([value + 0j]) for name, value in parameters.items()}
    return candidate.reading.read(TIMES, values[:, None] + 0j, inputs or {}, own)[:, 0]


def test_each_reads_the_truth_where_it_does_nothing():
    for name in (
        "sensor_offset",
        "sensor_gain",
        "sensor_lag",
        "sensor_drift",
        "sensor_detached",
        "clock_shift",
    ):
        for form in {c.form for c in (reading_of(name),)}:
            told = read(name, RAMP, form=form, inputs={"ambient": np.full(TIMES.size, 280.0)})
            assert told.real == pytest.approx(RAMP, abs=1e-12), name


def test_offset_and_gain():
    assert read("sensor_offset", RAMP, offset=-0.7).real == pytest.approx(RAMP - 0.7)
    told = read("sensor_gain", RAMP, gain=1.2).real
    assert told - 293.15 == pytest.approx(1.2 * (RAMP - 293.15))


def test_lag_follows_a_ramp_and_a_step_exactly():
    tau = 25.0
    told = read("sensor_lag", RAMP, time_constant=tau).real
    assert told == pytest.approx(RAMP - 0.05 * tau * (1.0 - np.exp(-TIMES / tau)), abs=1e-10)
    # A step that the straight line between two stamps makes a ramp of one step.
    step = np.where(TIMES < 10.0, 300.0, 310.0)
    told = first_order_lag(TIMES, step[:, None], np.array([tau])).real[:, 0]
    begun = 310.0 - 10.0 * tau / 7.0 * (1.0 - np.exp(-7.0 / tau))
    assert told[2] == pytest.approx(begun)
    assert told[3:] == pytest.approx(310.0 - (310.0 - begun) * np.exp(-(TIMES[3:] - 10.0) / tau))


def test_a_vanishing_lag_follows_at_once_with_the_right_slope():
    told = first_order_lag(TIMES, RAMP[:, None] + 0j, np.array([1e-30j]))
    assert told[:, 0].real == pytest.approx(RAMP)
    # d/dτ of the reading is minus the slope, once the start has faded.
    assert told[1:, 0].imag / 1e-30 == pytest.approx(-0.05)


@settings(max_examples=30)
@given(
    steps=st.lists(st.floats(0.1, 500.0), min_size=2, max_size=40),
    tau=st.floats(0.5, 2000.0),
    seed=st.integers(0, 1000),
)
def test_lag_is_the_recursion_and_never_overshoots(steps, tau, seed):
    times = np.concatenate(([0.0], np.cumsum(steps)))
    values = 290.0 + 20.0 * np.random.default_rng(seed).random(times.size)
    told = first_order_lag(times, values[:, None], np.array([tau])).real[:, 0]
    by_hand = [values[0]]
    for i in range(1, times.size):
        step = times[i] - times[i - 1]
        slope, keep = (values[i] - values[i - 1]) / step, np.exp(-step / tau)
        by_hand.append(values[i] - tau * slope + keep * (by_hand[-1] - values[i - 1] + tau * slope))
    assert told == pytest.approx(np.array(by_hand), rel=1e-9)
    assert values.min() - 1e-6 <= told.min()
    assert told.max() <= values.max() + 1e-6


def test_scan_is_the_recursion():
    random = np.random.default_rng(3)
    keep, gain = random.random((100, 2)), random.normal(size=(100, 2))
    found = scan(keep, gain, np.array([1.0, -2.0]))
    value = np.array([1.0, -2.0])
    for i in range(100):
        value = keep[i] * value + gain[i]
        assert found[i] == pytest.approx(value)


def test_drift_grows_from_zero_or_from_an_instant():
    assert read("sensor_drift", RAMP, rate=1e-3).real == pytest.approx(RAMP + 1e-3 * TIMES)
    told = read("sensor_drift", RAMP, form="from a time on", rate=1e-3, start=-1.0e5).real
    assert told == pytest.approx(RAMP + 1e-3 * (TIMES + 1.0e5))
    told = read("sensor_drift", RAMP, form="from a time on", rate=1e-3, start=1.0e5).real
    assert told == pytest.approx(RAMP, abs=1e-9)


def test_clock_shift_is_late_when_positive():
    late = read("clock_shift", RAMP, shift=20.0).real
    assert late == pytest.approx(np.maximum(RAMP - 0.05 * 20.0, 293.15))
    early = read("clock_shift", RAMP, shift=-20.0).real
    assert early == pytest.approx(np.minimum(RAMP + 0.05 * 20.0, RAMP[-1]))


def test_clock_shift_has_the_slope_of_the_temperature():
    curve = 300.0 + 5.0 * np.sin(TIMES / 60.0)
    told = delayed(TIMES, np.repeat(curve[:, None], 2, axis=1) + 0j, np.array([7.3, 7.3 + 1e-30j]))
    ends = [delayed(TIMES, curve[:, None], np.array([7.3 + w])).real[:, 0] for w in (1e-4, -1e-4)]
    assert told[:, 1].imag / 1e-30 == pytest.approx((ends[0] - ends[1]) / 2e-4, abs=1e-8)
    assert told[:, 0] == pytest.approx(told[:, 1])


def test_clock_shift_has_one_slope_on_both_sides_of_a_whole_number_of_steps():
    """A fit would end there."""
    times = np.concatenate((np.arange(0.0, 600.0, 20.0), np.arange(600.0, 3601.0, 60.0)))
    curve = 300.0 + 5.0 * (1.0 - np.exp(-times / 200.0))

    def told(shift):
        return delayed(times, curve[:, None], np.array([shift])).real[:, 0]

    before, at, after = (told(60.0 + w) for w in (-1e-3, 0.0, 1e-3))
    inside = times > 61.0
    assert (at - before)[inside] == pytest.approx((after - at)[inside], abs=1e-7)
    # Between stamps a curve is met far better than by a straight line, which misses h² T''/8, 6 mK.
    late = 300.0 + 5.0 * (1.0 - np.exp(-np.maximum(times - 10.0, 0.0) / 200.0))
    assert np.abs(told(10.0) - late)[times > 20.0].max() < 2e-3


def test_a_detached_sensor_goes_to_the_mix_with_the_air():
    times = np.arange(0.0, 4000.0, 1.0)
    candidate = reading_of("sensor_detached")
    own = {"share_of_air": 0.4, "time": 1000.0, "coming_off": 12.0, "time_in_air": 250.0}
    reading = DetachedReading("T1", "x", candidate.reading.parameters, 280.0)
    given = {name: np.array([value + 0j]) for name, value in own.items()}
    values = np.full((times.size, 1), 310.0 + 0j)
    told = reading.read(times, values, {"ambient": np.full(times.size, 290.0)}, given).real[:, 0]
    assert told[times < 900.0] == pytest.approx(310.0, abs=0.01)
    assert told[-1] == pytest.approx(0.6 * 310.0 + 0.4 * 290.0, abs=1e-6)
    after = times > 1000.0 - 12.0 * own["coming_off"]
    # The lag of the place is that of the air times the share: (s 250 s) y' = 310 + s (290 - 310) - y.
    share = lambda t: 0.4 / (1.0 + np.exp(-(t - 1000.0) / own["coming_off"]))  # noqa: E731
    exact = solve_ivp(
        lambda t, y: (310.0 - 20.0 * share(t) - y) / (250.0 * share(t)),
        (times[after][0], times[-1]),
        [310.0],
        "Radau",
        times[after],
        rtol=1e-9,
        atol=1e-9,
    )
    assert told[after] == pytest.approx(exact.y[0], abs=2e-3)
    # Without a recorded ambient the machine's own surroundings stand for it.
    assert reading.read(times, values, {}, given).real[-1, 0] == pytest.approx(0.6 * 310.0 + 0.4 * 280.0)


@pytest.mark.parametrize(
    "effect", ["sensor_offset", "sensor_gain", "sensor_lag", "sensor_drift", "sensor_detached", "clock_shift"]
)
def test_readings_are_affine_and_differentiable(effect):
    inputs = {"ambient": np.full(TIMES.size, 291.0)}
    for candidate in [reading_of(effect)]:
        items = candidate.reading.parameters
        own = {item.name: item.value for item in items} | {
            name.rpartition(".")[2]: value for name, value in candidate.starts[0].items()
        }
        own[items[0].name] = candidate.reference
        # Not where a stamp meets another: straight lines have kinks there.
        own |= {"time": 100.0} if "time" in own else {"shift": 187.3} if "shift" in own else {}
        random = np.random.default_rng(1)
        columns = 295.0 + random.random((TIMES.size, 3))

        def told(values, own=own, candidate=candidate):
            given = {name: np.full(values.shape[1], value, dtype=complex) for name, value in own.items()}
            return candidate.reading.read(TIMES, values + 0j, inputs, given)

        mixed = 0.3 * columns[:, :1] + 0.7 * columns[:, 1:2]
        parts = told(columns)
        assert told(mixed) == pytest.approx(0.3 * parts[:, :1] + 0.7 * parts[:, 1:2])
        for item in items:
            width = 1e-5 * max(abs(own[item.name]), 1e-3)
            ends = [told(columns, own | {item.name: own[item.name] + s * width}).real for s in (1, -1)]
            slope = told(columns, own | {item.name: own[item.name] + 1e-30j}).imag / 1e-30
            difference = (ends[0] - ends[1]) / (2.0 * width)
            # Rounding of 300 K over the width of the difference.
            assert slope == pytest.approx(difference, rel=1e-5, abs=2e-13 * 300.0 / width), item.name


def test_a_mixed_outlet_reads_what_both_flows_bring():
    reading = MixedOutlet("COOLANT_OUT", "coolant_bypass.channel")
    told = reading.read(
        TIMES,
        np.full((TIMES.size, 1), 300.0 + 0j),
        {"coolant_inlet": np.full(TIMES.size, 290.0)},
        {"fraction": np.array([0.25 + 0j])},
    )
    assert told.real == pytest.approx(297.5)


# ------------------------------------------------------------------ periods
def test_the_strongest_periods_are_found_in_noise_and_gaps():
    random = np.random.default_rng(5)
    times = np.sort(random.uniform(0.0, 14400.0, 1500))
    signal = 0.2 * np.sin(2.0 * np.pi * times / 737.0 + 1.0)
    drift = 1e-4 * times
    residual = np.column_stack([signal + drift, 0.3 * signal]) + 0.1 * random.normal(size=(times.size, 2))
    residual[200:300, 0] = np.nan
    assert strongest_periods(times, residual, 100.0, 3000.0)[0] == pytest.approx(737.0, rel=0.02)


def test_a_recording_too_short_for_a_period_has_none():
    times = np.arange(0.0, 150.0, 10.0)
    assert strongest_periods(times, np.zeros((times.size, 1)), 100.0, 3000.0) == []
    assert strongest_periods(np.arange(0.0, 7200.0, 10.0), np.zeros((720, 1)), 100.0, 3000.0) == []


@pytest.mark.parametrize(
    ("effect", "sizes"),
    [("clock_shift", {-200.0, 800.0, -800.0}), ("sensor_lag", {800.0}), ("sensor_offset", set())],
)
def test_delays_are_sought_from_several_sizes(effect, sizes):
    times, nothing = np.zeros(0), np.zeros((0, 1))

    def sought(duration):
        candidate = reading_of(effect, duration=duration)
        starts = catalogue()[effect].starts_from(candidate, times, nothing)
        return {start[candidate.amplitude] for start in starts if start}

    assert sought(7200.0) == sizes
    # In a recording of months no more than an hour or so.
    assert max(map(abs, sought(1.0e7)), default=0.0) <= 3200.0
