"""First guesses: exact where the answer lies in what is remembered."""

import numpy as np
import pytest
from scipy import sparse

from spindle_fem.model.mesh.first_guesses import CORRECTIONS, RecentCorrections

RNG = np.random.default_rng(0)


def positive(size):
    root = RNG.normal(size=(size, size))
    return sparse.csr_array(root @ root.T + np.eye(size))


STORAGE, CONDUCTION = positive(20), positive(20)


def test_what_lies_among_the_recent_corrections_is_found_at_any_step():
    recent = RecentCorrections(2)
    fields = RNG.normal(size=(5, 20)) * np.logspace(-6.0, 0.0, 5)[:, None]
    for field in fields:
        recent.add(field, STORAGE, CONDUCTION)
    wanted = np.array([3.0, -1.0, 2.0, 0.5, -4.0]) @ fields
    for shift in (1e-3, 1.0, 1e3):
        load = STORAGE @ wanted + shift * (CONDUCTION @ wanted)
        assert recent.combine(load, 1.0, shift) == pytest.approx(wanted, rel=1e-9, abs=1e-12)


def test_what_lies_outside_is_approached_in_energy():
    recent = RecentCorrections(2)
    fields = RNG.normal(size=(4, 20))
    for field in fields:
        recent.add(field, STORAGE, CONDUCTION)
    matrix = (STORAGE + 0.7 * CONDUCTION).toarray()
    load = RNG.normal(size=20)
    found = recent.combine(load, 1.0, 0.7)
    # Galerkin: what is left is orthogonal to all that is remembered.
    assert fields @ (load - matrix @ found) == pytest.approx(0.0, abs=1e-9)


def test_the_oldest_is_forgotten_and_nothing_known_gives_nothing():
    recent = RecentCorrections(2)
    assert not recent.combine(np.ones(20), 1.0, 1.0).any()
    fields = RNG.normal(size=(CORRECTIONS + 1, 20))
    for field in fields:
        recent.add(field, STORAGE, CONDUCTION)
    matrix = STORAGE + CONDUCTION
    assert recent.combine(matrix @ fields[1], 1.0, 1.0) == pytest.approx(fields[1], abs=1e-8)
    assert np.abs(recent.combine(matrix @ fields[0], 1.0, 1.0) - fields[0]).max() > 1e-3


def test_the_same_correction_twice_does_no_harm():
    recent = RecentCorrections(2)
    field = RNG.normal(size=20)
    recent.add(field, STORAGE, CONDUCTION)
    recent.add(field, STORAGE, CONDUCTION)
    load = 2.0 * ((STORAGE + CONDUCTION) @ field)
    assert recent.combine(load, 1.0, 1.0) == pytest.approx(2.0 * field, rel=1e-6)
