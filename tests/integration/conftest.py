"""One mesh for all coupled tests: the recorded spindle, coarse."""

import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.solvers.coupled_steady import prepare_machine
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
    """The reference spindle prepared on its coarse mesh."""
    return prepare_machine(load_machine("wu_tan_2016", ["mesh.preset=coarse"]))


@pytest.fixture(scope="session")
def reference_result(reference):
    return solve_prepared(reference)
