"""Coordinates that a watch follows: what wanders beside what is known, and what is forgotten again."""

import numpy as np
import pytest

from spindle_fem.inference import tuned
from spindle_fem.inference.belief import THETA_BOUND, Belief, Coordinate
from spindle_fem.inference.followed_coordinates import FollowedCoordinates

KNOWN = 0.1  # deviations of its prior to which a calibration determined each coordinate


def coordinate(name, sigma=0.5, logarithmic=True):
    return Coordinate(name, 1.0, sigma, logarithmic, -THETA_BOUND, THETA_BOUND)


@pytest.fixture
def followed():
    own = (coordinate("gain.a"), coordinate("capacity.a", 0.3), coordinate("start.0.a", 2.0, False))
    belief = Belief(own, np.array([0.4, -0.2, 0.0]), np.eye(3) / KNOWN)
    return FollowedCoordinates(belief, ["gain.a"])


def test_what_wanders_comes_on_top_of_what_is_known(followed):
    assert followed.names == ["gain.a", "capacity.a"]
    followed.begin([coordinate("start.0.a", 2.0, False), coordinate("other.0", 1.0)])
    assert followed.names == ["gain.a", "capacity.a", "start.0.a"]
    assert followed.position.tolist() == [0.4, -0.2, 0.0, 0.0]
    assert np.diag(followed.covariance) == pytest.approx([KNOWN**2, KNOWN**2, 1.0, 1.0])
    # kelvins a logarithm and a kelvin: of the gain, of the capacity, of the start
    slopes = np.array([[3.0, -1.0, 0.5]])
    wander = 3.0 * tuned.SOURCE_WANDER
    assert followed.by_number(slopes) == pytest.approx(np.array([[1.5, -0.3, wander, 1.0]]))
    moved = followed.move(np.array([0.0, 0.0, 1.0, 0.5]), np.diag(np.ones(5)), 0.0)
    assert moved == pytest.approx({"gain.a": tuned.SOURCE_WANDER, "capacity.a": 0.0, "start.0.a": 1.0})
    assert followed.values["gain.a"] == pytest.approx(np.exp(0.5 * 0.4 + tuned.SOURCE_WANDER))


def test_what_wanders_is_forgotten_sooner_and_nothing_becomes_surer_than_it_is(followed):
    followed.begin(())
    # Readings told all of them, and nothing but their sum.
    covariance = np.full((3, 3), 1e-4) + np.diag([1e-6, 1e-6, 1e-6])
    followed.move(np.array([0.0, 0.0, 1.0]), covariance, tuned.WANDER_TIME)
    assert followed.position[2] == pytest.approx(np.exp(-1.0))
    assert np.diag(followed.covariance)[2] == pytest.approx(1.0 - np.exp(-2.0), rel=1e-3)
    assert np.linalg.eigvalsh(followed.covariance).min() > 0.0
    for _ in range(400):
        followed.move(np.zeros(3), covariance, tuned.WANDER_TIME)
    assert followed.position == pytest.approx([0.4, -0.2, 0.0], abs=1e-6)
    assert followed.covariance == pytest.approx(np.diag([KNOWN**2, KNOWN**2, 1.0]), abs=1e-6)
