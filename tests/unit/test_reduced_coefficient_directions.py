"""Directions in which a contact conducts, against its whole matrix."""

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.model.reduced.coefficient_directions import FLOW_TOLERANCE, ConductingDirections


@pytest.fixture(scope="module")
def contact():
    """A contact of ten degrees of freedom among forty coordinates."""
    factor = np.random.default_rng(2).normal(size=(40, 10))
    return factor @ factor.T


def directions_of(contact, spread=None):
    model = SimpleNamespace(coefficient_names=("joint.a",), operators=(contact,))
    return ConductingDirections(model, spread).of("joint.a")


def test_every_direction_together_is_the_contact(contact):
    vectors, spectrum = directions_of(contact)
    assert vectors.shape == (40, 10)
    assert vectors * spectrum @ vectors.T == pytest.approx(contact, abs=1e-10 * np.abs(contact).max())


def test_states_that_spread_little_need_few_directions(contact):
    spread = 10.0 ** -np.linspace(0.0, 15.0, 40)
    vectors, spectrum = directions_of(contact, spread)
    assert vectors.shape[1] < 8
    states = spread[:, None] * np.random.default_rng(3).normal(size=(40, 200))
    flow, told = contact @ states, vectors * spectrum @ (vectors.T @ states)
    root = np.linalg.cholesky(contact + 1e-9 * np.eye(40))
    apart = np.linalg.norm(np.linalg.solve(root, told - flow), axis=0)
    usual = np.linalg.norm(np.linalg.solve(root, flow), axis=0)
    # Of the largest flow; a few directions that were left out add up.
    assert apart.max() < 5.0 * FLOW_TOLERANCE * usual.max()
    assert apart.max() > 0.0


def test_states_that_spread_alike_need_all(contact):
    vectors, spectrum = directions_of(contact, np.ones(40))
    assert vectors * spectrum @ vectors.T == pytest.approx(contact, abs=1e-10 * np.abs(contact).max())
