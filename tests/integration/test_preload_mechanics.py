"""What bearing sets of the recorded spindle answer to warm rings, against independent figures."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.machine.view.machine_names import MachineNames
from spindle_fem.operation.preload_mechanics import PreloadMechanics

SPEED, THRUST = 3000.0 * np.pi / 30.0, 1750.0
# K; of the outer rings over what the housing's growth stands for, as in the run the figures are of.
OVER_HOUSING = 4.0


@pytest.fixture(scope="module")
def mechanics():
    spec = load_machine("recorded_spindle")
    return PreloadMechanics(spec, frozenset(MachineNames.of(spec).place_names))


def ratio(response, difference, over_housing, clearance, thrust=THRUST):
    found = response.log_ratio([difference], [over_housing], [clearance], [SPEED], [thrust])
    return np.exp(found.real[:, 0])


@pytest.mark.slow
def test_friction_at_ten_kelvin(mechanics):
    """Another program's balls, rings and seats on the same spindle: F3 twice F1, half of it at 30 µm."""
    response = mechanics("front_bearings")
    assert response.bearings == ("F1", "F2", "F3")
    tight, loose = (ratio(response, 10.0, OVER_HOUSING, c) for c in (5e-6, 30e-6))
    assert tight - 1.0 == pytest.approx([1.08, 1.17, 2.34], rel=0.2)
    assert loose - 1.0 == pytest.approx([0.52, 0.63, 1.18], rel=0.2)
    already = ratio(response, 0.0, OVER_HOUSING, 5e-6) - 1.0
    assert np.all((already > 0.1) & (already < 0.6))


@pytest.mark.slow
def test_the_housing_opens_what_the_rings_close(mechanics):
    """A housing as warm as its rings leaves the gap of assembly, but for iron growing less than steel."""
    response = mechanics("front_bearings")
    assert response.closing(
        np.array([303.15]), np.array([[303.15]] * len(response.housing))
    ) == pytest.approx(10.0 * (1.0 - 10.5 / 12.5), abs=0.05)
    assert set(response.housing) == {f"growth.{name}.housing" for name in response.bearings}


@pytest.mark.slow
def test_thrust_and_the_shaft(mechanics):
    """The concealed study's own balls and rings, at 5 µm and an even spread of 14 K: loads, to the power 0.5.

    ``validation.ball_set`` without thrust and at 3.5 kN. The shaft carries the inner rings' bore.
    """
    response = mechanics("front_bearings")
    none, heavy = (ratio(response, 10.0, OVER_HOUSING, 5e-6, thrust) for thrust in (0.0, 3500.0))
    assert none == pytest.approx([2.55, 2.66, 2.50], rel=0.3)
    assert heavy == pytest.approx([1.65, 1.72, 5.6], rel=0.3)
    assert set(response.shaft) == {f"growth.{name}.shaft" for name in response.bearings}
    # 65 of the 82.5 mm that close the raceways: bore of the ring less what it gives, of groove and balls
    assert sum(response.shaft.values()) == pytest.approx(0.8, abs=0.06)
    assert len(mechanics("rear_bearings").thrust) == 1


def test_no_answer_without_fit_or_preload(mechanics):
    spec = mechanics.spec
    assert mechanics("shaft") is None
    for change in ({"fit": None}, {"preload": 0.0}):
        sets = [group.model_copy(update=change) for group in spec.bearing_set]
        bare = spec.model_copy(update={"bearing_set": sets})
        assert PreloadMechanics(bare, mechanics.places)("front_bearings") is None
