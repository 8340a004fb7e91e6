"""Which way a machine with a locked set tips over in time, on either side of the speed of its fold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import NoSteadyStateError
from spindle_fem.model.mesh.thermal_state import ThermalState
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.input_history import FIELD_OF
from spindle_fem.solvers.machine_transient import TransientOptions, simulate_full
from spindle_fem.solvers.prepared_machine import prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared

pytestmark = pytest.mark.slow

# The whole friction of flooded contacts: the fold then lies below the speed of the definition.
FLOODED = ("mesh.preset=coarse", "mesh.order=1", "operation.speed=2000rpm")
FLOODED += tuple(f"bearing_set.{name}.heat_factor=1" for name in ("front", "rear"))
HOUR = 3600.0


@pytest.fixture(scope="module")
def machine():
    return prepare_machine(load_machine("wu_tan_2016", FLOODED))


@pytest.fixture(scope="module")
def fold(machine):
    return solve_prepared(machine, find_fold=True).equilibrium.fold_speed


def run(machine, speed, begin, end, start=None):
    point = replace(OperatingPoint.of(machine.spec), speed=speed)
    inputs = InputHistory.constant(
        np.array([begin, end]), {name: getattr(point, own) for name, own in FIELD_OF.items()}
    )
    options = TransientOptions(error=0.2, coupling_tolerance=1e-4, trust_contraction=True)
    return simulate_full(machine, inputs, sample_times=np.array([begin, end]), start=start, options=options)


def test_below_the_fold_it_returns_from_far_beyond_it_and_above_it_runs_away(machine, fold):
    slower = replace(OperatingPoint.of(machine.spec), speed=0.9 * fold)
    below = solve_prepared(machine, slower, find_fold=False)
    settled = below.bearings["F3"].preload
    away = run(machine, 1.15 * fold, 0.0, 1.5 * HOUR)
    preload = away.steps.preload[:, 2]
    assert preload[-1] > 2.0 * settled
    with pytest.raises(NoSteadyStateError, match=r"after 2\.\d+ h: no loads"):
        run(machine, 1.15 * fold, 0.0, 4.0 * HOUR)
    # Slowed down below the fold it comes back to where a cold start leads.
    hot = ThermalState(away.state.time, away.state.temperature, away.state.lumped_temperature)
    back = run(machine, 0.9 * fold, hot.time, hot.time + 7.0 * HOUR, hot)
    assert back.steps.preload[-1, 2] == pytest.approx(settled, rel=0.02)
