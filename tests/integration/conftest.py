"""Machines prepared once for all coupled tests, on their coarse meshes."""

import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.model.reduced.build_reduced import reduced_model_of
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.solvers.prepared_machine import prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared


@pytest.fixture(scope="session")
def recorded():
    """The recorded spindle prepared on its coarse mesh."""
    return prepare_machine(load_machine("recorded_spindle", ["mesh.preset=coarse"]))


@pytest.fixture(scope="session")
def recorded_result(recorded):
    return solve_prepared(recorded)


@pytest.fixture(scope="session")
def reference():
    """The reference spindle with linear temperatures on its coarse mesh."""
    return prepare_machine(load_machine("wu_tan_2016", ["mesh.preset=coarse", "mesh.order=1"]))


@pytest.fixture(scope="session")
def reference_result(reference):
    return solve_prepared(reference)


@pytest.fixture(scope="session")
def small():
    """The recorded spindle with linear temperatures on its coarse mesh: small enough for direct solves."""
    return prepare_machine(load_machine("recorded_spindle", ["mesh.preset=coarse", "mesh.order=1"]))


@pytest.fixture(scope="session")
def small_result(small):
    return solve_prepared(small)


@pytest.fixture(scope="session")
def small_fast(small):
    """Its reduced model, which the cache keeps between workers and runs."""
    return fast_spindle(reduced_model_of(small.spec), small.spec)
