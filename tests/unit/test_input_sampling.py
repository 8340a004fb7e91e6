"""What rarely read inputs leave uncertain of a network's temperatures."""

import numpy as np
import pytest

from spindle_fem.inference.input_sampling import sampling_errors
from spindle_fem.model.lumped.thermal_network import ThermalNetwork


def halves(inputs, gains):
    """A plate in two halves of 450 J/K that hardly differ, each heated by its own source."""
    return ThermalNetwork(
        ("plate", "core"),
        [450.0, 450.0],
        [0, 1, 0],
        [2, 2, 1],
        [1.0, 1.0, 1e4],
        boundary_names=("room",),
        boundary_temperature=[293.15],
        source_node=[0, 1],
        source_input=inputs,
        source_gain=gains,
        source_exponent=[1.0, 1.0],
        source_names=("plate.load", "core.load"),
    )


def test_sources_that_follow_one_input_are_uncertain_together():
    power = np.full(2, 4000.0)
    whole = sampling_errors(halves(("load", "load"), [1.0, 0.0]), power)
    # A first-order filter of white noise: S / (2 C G).
    assert whole == pytest.approx(np.sqrt(4000.0 / (2.0 * 900.0 * 2.0)), rel=0.01)
    assert sampling_errors(halves(("load", "load"), [0.5, 0.5]), power) == pytest.approx(whole, rel=0.01)
    apart = sampling_errors(halves(("load", "other"), [0.5, 0.5]), power)
    assert apart == pytest.approx(whole / np.sqrt(2.0), rel=0.01)
