"""Fits run through the full model: terms and factors as the mesh takes them, and what every channel reads."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.term import COVARIATE
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX, FIRST_ORDER
from spindle_fem.inference.findings import at_stamps
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.parallel import one_thread
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.input_history import OperatingHistory
from spindle_fem.solvers.machine_transient import simulate_full, start_at
from spindle_fem.solvers.mesh_terms import Physics
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.solvers.transient_records import MachineTransient, TransientOptions
from spindle_fem.units import MICROMETRES

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FullFit:
    """One fit simulated by the full model.

    Attributes
    ----------
    predicted : tuple of (N, c) ndarray, [K]
        What every channel of every recording should read, at its stamps; of a displacement in µm, from the
        sensor's zero.
    steps : int
        Time steps over all recordings.
    seconds : float, [s]
        That it took.
    """

    predicted: tuple[Array, ...]
    steps: int
    seconds: float


@dataclass(frozen=True, slots=True)
class MeshRuns:
    """What channels see in runs of all recordings, before what the reduced model supplies and sensors do.

    Attributes
    ----------
    seen : tuple of (G + 1, c) ndarray, [K]
        On the reduced model's grid; of a displacement in µm.
    steps : int
        Time steps over all recordings.
    seconds : float, [s]
        That they took.
    """

    seen: tuple[Array, ...]
    steps: int
    seconds: float


def run_fit(machine: PreparedMachine, predictor: Predictor, fit: Fit, options: TransientOptions) -> FullFit:
    """Run all recordings through the full model with the parameters and candidates of a fit.

    Raises
    ------
    NoSteadyStateError, ConvergenceError, EnergyBalanceError
    """
    return finished(predictor, fit, mesh_runs(machine, predictor, fit, options))


def inputs_of_drive(drive: Drive, followed: Collection[str] = ()) -> InputHistory:
    """The inputs of a drive as the full model takes them, and of its covariates those that are followed.

    Inputs that are constant on every step are held, others joined by straight lines.
    """
    columns = [i for i, name in enumerate(drive.names) if not name.startswith(COVARIATE) or name in followed]
    start, end = drive.start[:, columns], drive.end[:, columns]
    names = tuple(drive.names[i] for i in columns)
    return InputHistory(drive.grid, names, np.vstack((start, end[-1:])), np.all(start == end, axis=0))


def physics_of_fit(predictor: Predictor, number: int, fit: Fit) -> Physics:
    """Terms and factors of a fit, those of the definition included, in one recording.

    Parameters
    ----------
    number : int
        Recording.
    """
    acting = _acting(fit.candidates, number)
    values = fit.values
    terms = [*predictor.effects.terms, *(term for item in acting for term in item.terms)]
    of_terms = {
        name: values.get(name, item.value)
        for candidate in acting
        for term in candidate.terms
        for name, item in term.names().items()
    }
    # Values that belong to a candidate are factors only if it declares so.
    of_candidates = {
        name for c in fit.candidates for name in c.parameters if name not in {item.name for item in c.factors}
    }
    scaled = {EFFECT_PREFIX + item.name: item.name for c in acting for item in c.factors}
    factors = dict(predictor.effects.factors)
    for name, value in values.items():
        own = scaled.get(name)
        if own is None and not (name in of_candidates or name.startswith((*FIRST_ORDER, EFFECT_PREFIX))):
            own = name
        if own is not None:
            factors[own] = factors.get(own, 1.0) * value
    return Physics(tuple(terms), of_terms, factors)


def alone(run: Callable[..., Any], *given: Any) -> Any:
    """A run with one thread, so that its last digits do not depend on where it runs."""
    with threadpool_limits(1), one_thread():
        return run(*given)


# -------------------------------------------------------------------- details
def _acting(candidates: Sequence[Candidate], number: int) -> tuple[Candidate, ...]:
    return tuple(item for item in candidates if item.recording in (None, number))


def mesh_runs(
    machine: PreparedMachine, predictor: Predictor, fit: Fit, options: TransientOptions
) -> MeshRuns:
    """Run all recordings through the full model, as :func:`run_fit` does, as far as the mesh goes."""
    began = time.perf_counter()
    seen, steps = [], 0
    for number, recording in enumerate(predictor.recordings):
        run = _run(machine, predictor, number, fit, options)
        count = recording.temperature_count
        temperatures = [run.reading(probe) for probe in recording.probes[:count]]
        displacements = [MICROMETRES * run.motion_of(sensor) for sensor in recording.probes[count:]]
        seen.append(np.column_stack([*temperatures, *displacements]))
        steps += len(run.steps.times)
    return MeshRuns(tuple(seen), steps, time.perf_counter() - began)


def finished(predictor: Predictor, fit: Fit, runs: MeshRuns) -> FullFit:
    """Readings at the stamps from what channels see."""
    predicted = tuple(
        at_stamps(predictor, number, _readings(predictor, number, fit, seen))
        for number, seen in enumerate(runs.seen)
    )
    return FullFit(predicted, runs.steps, runs.seconds)


def _run(
    machine: PreparedMachine, predictor: Predictor, number: int, fit: Fit, options: TransientOptions
) -> MachineTransient:
    physics = physics_of_fit(predictor, number, fit)
    inputs = inputs_of_drive(
        predictor.drives[number], {name for term in physics.terms for name in term.follows}
    )
    start = start_at(machine, OperatingHistory.of(machine.spec, inputs), predictor.start(number, fit.values))
    return simulate_full(machine, inputs, start=start, options=options, physics=physics)


def _readings(predictor: Predictor, number: int, fit: Fit, seen: Array) -> Array:
    """Readings of every channel in a full run, on the reduced model's grid, (G + 1, c) K or µm."""
    acting, own = _acting(fit.candidates, number), predictor.effects.candidates
    inlet = None
    if any(c.reading is not None and c.reading.mixes_inlet for c in (*acting, *own)):
        # What effects do to it follows no temperature: the reduced model knows it as the full one does.
        inlet = predictor.at_places(number, fit.values, fit.candidates).inlet
    predicted = predictor.read(number, own, {}, seen, inlet)
    predicted = predicted + _first_order(predictor, number, fit)
    return predictor.read(number, acting, fit.values, predicted, inlet)


def _first_order(predictor: Predictor, number: int, fit: Fit) -> Array | float:
    """First-order changes by probe positions and gaps, before the fit's sensor effects, (G + 1, c)."""
    if not any(name.startswith(FIRST_ORDER) for name in fit.values):
        return 0.0
    bare = [replace(item, reading=None) for item in fit.candidates]
    of_bare = {name for item in bare for name in item.parameters}
    of_readings = {name for item in fit.candidates for name in item.parameters} - of_bare
    values = {name: value for name, value in fit.values.items() if name not in of_readings}
    plain = {name: value for name, value in values.items() if not name.startswith(FIRST_ORDER)}
    moved, still = (predictor.predict(number, item, bare).temperature for item in (values, plain))
    return moved - still
