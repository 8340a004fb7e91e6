"""The swing of a coolant whose chiller cycles: its wave, and how it wanders."""

import numpy as np
import pytest

from spindle_fem.effects.catalogue.chiller_cycling import WANDER, WAVES, ChillerCyclingTerm, wave
from spindle_fem.effects.framework.term import TermContext


def inlet_swing(time, *, span=600.0, **given):
    term = ChillerCyclingTerm("t", ("fluid.coolant_inlet",), span)
    nothing = np.zeros((0, time.size), dtype=complex)
    own = {item.name: item.value for item in term.parameters} | given
    at = TermContext(time, {}, nothing, nothing, {name: complex(value) for name, value in own.items()})
    return term.heat(at)[0].real


def test_waves_have_their_amplitude_and_period():
    time = np.linspace(0.0, 600.0, 6001)
    steady = {"amplitude": 2.0, "period": 600.0}
    sine = inlet_swing(time, **steady)
    assert sine == pytest.approx(2.0 * np.sin(2.0 * np.pi * time / 600.0), abs=1e-12)
    for swing in (sine, *(inlet_swing(time, **steady, sharpness=own) for own in (-0.5, 0.3, 0.9))):
        assert swing.max() == pytest.approx(2.0, rel=1e-5)
        assert swing.min() == pytest.approx(-2.0, rel=1e-5)
        assert swing[-1] == pytest.approx(swing[0], abs=1e-9)
    # The sawtooth is its own Fourier series.
    terms = np.arange(1, 400)[:, None]
    series = (0.9**terms * np.sin(terms * 2.0 * np.pi * time / 600.0) / terms).sum(axis=0)
    assert swing == pytest.approx(2.0 * series / np.arcsin(0.9), abs=1e-9)
    # Of the other sign it falls as fast as that rises.
    mirrored = swing[(3000 - np.arange(6001)) % 6000]
    assert inlet_swing(time, **steady, sharpness=-0.9) == pytest.approx(mirrored, abs=1e-9)


@pytest.mark.parametrize("sharpness", [0.0, 0.9e-5, 1.1e-5, 0.3])
def test_a_sine_and_a_sawtooth_are_one_law(sharpness):
    angle = np.linspace(0.0, 2.0 * np.pi, 101)
    step = 1e-30
    slope = wave(angle, np.full(101, sharpness + step * 1j)).imag / step
    far = wave(angle, np.full(101, sharpness + 2e-3)) - wave(angle, np.full(101, sharpness - 2e-3))
    assert slope == pytest.approx(far / 4e-3, abs=1e-5)


def test_a_swing_wanders_between_the_ends_of_its_recording():
    time = np.linspace(0.0, 12000.0, 2401)
    steady = {"span": 12000.0, "amplitude": 2.0, "period": 600.0, "phase": 0.3}
    plain = inlet_swing(time, **steady)
    # In complex numbers, as terms are: the same to the last digit.
    assert np.array_equal(plain, (2.0 * np.sin(2.0 * np.pi * time / (600.0 + 0j) + (0.3 + 0j))).real)
    swing = inlet_swing(time, **steady, wander_1=0.02, wander_3=-0.05)
    share = time / 12000.0
    # Twenty cycles: 2 sqrt(2 * 20) rad for each unit of the first.
    ahead = 0.02 * np.sin(np.pi * share) - 0.05 / 3.0 * np.sin(3.0 * np.pi * share)
    phase = 2.0 * np.pi * time / 600.0 + 0.3 + 2.0 * np.sqrt(40.0) * ahead
    assert swing == pytest.approx(2.0 * np.sin(phase), abs=1e-12)
    after = np.linspace(12000.0, 15000.0, 301)
    assert inlet_swing(after, **steady, wander_1=0.02) == pytest.approx(
        inlet_swing(after, **steady), abs=1e-12
    )


def test_the_wander_is_that_of_cycles_whose_lengths_differ():
    """Phases half way through a recording against drawn cycles, about their mean period."""
    random = np.random.default_rng(3)
    cycles, draws = 400, 4000
    ends = np.cumsum(1.0 + WANDER * random.normal(size=(draws, cycles)), axis=1)
    walked = 2.0 * np.pi * (ends[:, cycles // 2 - 1] / ends[:, -1] - 0.5) * cycles
    by_waves = [WANDER * 2.0 * np.sqrt(2.0 * cycles) / m for m in range(1, WAVES + 1, 2)]
    # Eight sines are all but a twentieth of the variance there.
    assert np.hypot.reduce(by_waves) ** 2 == pytest.approx(walked.var() * 19.0 / 20.0, rel=0.06)
