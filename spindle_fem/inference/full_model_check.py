"""Recordings run again through the full finite-element model, with nothing missing and with what was found.

The search works on the reduced model. Here the same physics, sizes and
parameters drive the mesh itself, so that an improvement is not one of the
reduction.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.term import COVARIATE
from spindle_fem.errors import SpecError, SpindleFemError, WorkerDiedError
from spindle_fem.inference import tuned
from spindle_fem.inference.coordinate_names import EFFECT_PREFIX, FIRST_ORDER
from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.findings import (
    at_stamps,
    channel_errors,
    channel_noise,
    displacement_errors,
    predictions_at_stamps,
    rmse,
)
from spindle_fem.inference.full_model_confirmation import left_by_both
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.parallel import WorkerPool, one_thread, thread_count
from spindle_fem.recordings.displaced_readings import MICROMETRES
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.input_history import OperatingHistory
from spindle_fem.solvers.machine_transient import simulate_full, start_at
from spindle_fem.solvers.mesh_terms import Physics
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine
from spindle_fem.solvers.transient_records import MachineTransient, TransientOptions, balanced

Array = NDArray[np.float64]
Progress = Callable[[str], None]

OFF, AUTO, COARSE, OWN = "off", "auto", "coarse", "own"
CHOICES = (AUTO, OFF, COARSE, OWN)
COARSE_MESH = {"preset": "coarse", "order": 1, "size_factor": 1.0, "size": {}}
# Noise of the quietest channel [K] counts within these: a coarse mesh is not as good as the best sensors, and
# loads must follow the field even for the worst.
QUIETEST, LOUDEST = 0.02, 0.2
# First step of a run, s.
FIRST_STEP = 30.0
# Most time steps of a fit that is run unasked: it then takes about as long as the search.
MOST_STEPS = 800
# Further steps that a jump of an input costs.
STEPS_AFTER_JUMP = 3

FIRST_ORDER_NOTE = (
    "where probes sit within their holes, how the machine differs from its definition, and what happened "
    "within gaps, as the reduced model has them"
)
NETWORK_REASON = "The machine is a network: it has no finite-element model."

Keep = Callable[[str, tuple[Array, ...]], None]


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


def require_choice(choice: str) -> str:
    """Refuse what is none of the choices.

    Raises
    ------
    SpecError

    >>> require_choice("coarse")
    'coarse'
    """
    if choice not in CHOICES:
        raise SpecError("full_model", f"{choice!r}.", f"Allowed: {', '.join(CHOICES)}.")
    return choice


def nothing_run(mesh: str, reason: str) -> dict[str, Any]:
    """Content in place of errors if nothing was run."""
    return {"mesh": mesh, "reason": reason}


def full_model_errors(
    diagnosis: Diagnosis,
    machine: DiagnosedMachine,
    *,
    mesh: str = AUTO,
    options: TransientOptions | None = None,
    keep: Keep = lambda name, predicted: None,
    progress: Progress = lambda stage: None,
) -> dict[str, Any]:
    """Errors of the full model with nothing missing and with what was found.

    Parameters
    ----------
    machine : DiagnosedMachine
        The same.
    mesh : {"auto", "off", "coarse", "own"}
        ``coarse``: the coarse preset, linear temperatures; ``own``: the
        definition's mesh; ``auto``: coarse unless the machine is a network or
        the recordings need very many time steps.
    options : TransientOptions, optional
        How accurately time is followed; :func:`options_for` when absent.
    keep : callable
        Gets ``before`` or ``after`` and its predictions.

    Returns
    -------
    dict
        ``mesh`` (as requested or chosen), ``reason`` (why nothing was run, else
        None), and what was run: ``preset``, ``order``, ``unknowns``,
        ``step_error_K``, ``coupling_tolerance_K``, ``before`` and ``after`` (``train_rmse_K``,
        ``heldout_rmse_K``, ``channels``, ``displacements``, ``steps``, ``seconds``), ``left`` (of
        the readings over their errors: ``fast`` and ``full``, :func:`left_by_both`),
        ``differences`` (largest difference of full and reduced model at each
        channel: ``before_K``, ``after_K`` and, of what the fits differ by,
        ``change_K``), ``displacement_differences`` (the same in ``_um``, but for
        where the sensor was set), ``first_order`` (what the reduced model supplied).

    Raises
    ------
    SpecError
        Another ``mesh``.
    """
    require_choice(mesh)
    if mesh == OFF:
        return nothing_run(mesh, "It was not asked for.")
    if machine.is_network:
        return nothing_run(OFF if mesh == AUTO else mesh, NETWORK_REASON)
    predictor = diagnosis.predictor
    options = options_for(predictor) if options is None else options
    if mesh == AUTO:
        steps = expected_steps(predictor, options)
        if steps > MOST_STEPS:
            return nothing_run(
                mesh, f"It would take some {steps} time steps a fit; --full-model coarse runs them."
            )
        mesh = COARSE
    try:
        return balanced(lambda asked: _both_fits(diagnosis, machine, mesh, asked, keep, progress), options)
    except SpindleFemError as error:
        return nothing_run(mesh, f"It could not be run: {error}")


def options_for(predictor: Predictor) -> TransientOptions:
    """Accuracy of the time integration: as accurate as the quietest channel can resolve."""
    levels = [
        channel_noise(predictor, recording, channel)
        for recording in predictor.recordings
        for channel in range(recording.temperature_count)
    ]
    noise = float(np.clip(min(levels), QUIETEST, LOUDEST))
    return TransientOptions(
        error=tuned.STEP_ERROR * noise,
        coupling_tolerance=tuned.COUPLING_ERROR * noise,
        input_resolution=tuned.INPUT_RESOLUTION * noise,
        first_step=FIRST_STEP,
        trust_contraction=True,
        method="multigrid",
    )


def expected_steps(predictor: Predictor, options: TransientOptions) -> int:
    """Lower bound of the time steps that the inputs require, over all recordings."""
    steps = 0
    for drive in predictor.drives:
        history = OperatingHistory.of(predictor.fast.spec, inputs_of_drive(drive))
        steps += len(history.breakpoints(options.input_resolution))
        steps += STEPS_AFTER_JUMP * len(history.restarts())
    return steps


def _both_fits(
    diagnosis: Diagnosis,
    machine: DiagnosedMachine,
    mesh: str,
    options: TransientOptions,
    keep: Keep,
    progress: Progress,
) -> dict[str, Any]:
    predictor = diagnosis.predictor
    progress("full model: mesh")
    prepared = prepare_machine(spec_on(machine.spec, mesh))
    fits = {"before": diagnosis.null, "after": diagnosis.final}
    if _is_same(*fits.values()):
        progress("full model: before, which is after")
        runs = dict.fromkeys(fits, run_fit(prepared, predictor, diagnosis.null, options))
    elif mesh == COARSE and thread_count() > 1:
        runs = _side_by_side(prepared, predictor, fits, options, progress)
    else:
        runs = _one_by_one(prepared, predictor, fits, options, progress)
    found: dict[str, dict[str, Any]] = {}
    apart: dict[str, list[Array]] = {}
    reduced: dict[str, list[Array]] = {}
    for name, full in runs.items():
        keep(name, full.predicted)
        found[name] = {
            "train_rmse_K": rmse(predictor, full.predicted, heldout=False),
            "heldout_rmse_K": rmse(predictor, full.predicted, heldout=True),
            "channels": channel_errors(predictor, full.predicted),
            "displacements": displacement_errors(predictor, full.predicted),
            "steps": full.steps,
            "seconds": full.seconds,
        }
        reduced[name] = predictions_at_stamps(predictor, fits[name])
        apart[name] = [a - b for a, b in zip(full.predicted, reduced[name], strict=True)]
    left = left_by_both(predictor, reduced, {name: full.predicted for name, full in runs.items()})
    supplied = any(n.startswith(FIRST_ORDER) for fit in fits.values() for n in fit.values)
    return {
        "mesh": mesh,
        "reason": None,
        "preset": prepared.spec.mesh.preset,
        "order": prepared.spec.mesh.order,
        "unknowns": int(prepared.operators.n_unknowns),
        "step_error_K": options.error,
        "coupling_tolerance_K": options.coupling_tolerance,
        **found,
        "left": dict(zip(("fast", "full"), left, strict=True)),
        "differences": _differences(predictor, apart, "K"),
        "displacement_differences": _differences(predictor, apart, "um"),
        "first_order": FIRST_ORDER_NOTE if supplied else None,
    }


def spec_on(spec: MachineSpec, mesh: str) -> MachineSpec:
    """A machine with its own mesh or the coarse one."""
    if mesh == OWN:
        return spec
    return spec.model_copy(update={"mesh": spec.mesh.model_copy(update=COARSE_MESH)})


def run_fit(machine: PreparedMachine, predictor: Predictor, fit: Fit, options: TransientOptions) -> FullFit:
    """Run all recordings through the full model with the parameters and candidates of a fit.

    Raises
    ------
    NoSteadyStateError, ConvergenceError, EnergyBalanceError
    """
    began = time.perf_counter()
    predicted, steps = [], 0
    for number in range(len(predictor.recordings)):
        run = _run(machine, predictor, number, fit, options)
        steps += len(run.steps.times)
        predicted.append(at_stamps(predictor, number, _readings(predictor, number, fit, run)))
    return FullFit(tuple(predicted), steps, time.perf_counter() - began)


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


# -------------------------------------------------------------------- details
def _one_by_one(
    machine: PreparedMachine,
    predictor: Predictor,
    fits: Mapping[str, Fit],
    options: TransientOptions,
    progress: Progress,
) -> dict[str, FullFit]:
    found = {}
    for name, fit in fits.items():
        progress(f"full model: {name}")
        found[name] = run_fit(machine, predictor, fit, options)
    return found


def _side_by_side(
    machine: PreparedMachine,
    predictor: Predictor,
    fits: Mapping[str, Fit],
    options: TransientOptions,
    progress: Progress,
) -> dict[str, FullFit]:
    """Each fit in its own process; in this one, with a warning, if a process ends prematurely."""
    progress(f"full model: {' and '.join(fits)}")
    jobs = [partial(_run_alone, machine.spec, predictor, fit, options) for fit in fits.values()]
    try:
        answers = WorkerPool(len(fits)).map(jobs, [f"full model: {name}" for name in fits])
    except WorkerDiedError as error:
        progress(f"{error.where}: {error.what}")
        return _one_by_one(machine, predictor, fits, options, progress)
    return dict(zip(fits, answers, strict=True))


def _run_alone(spec: MachineSpec, predictor: Predictor, fit: Fit, options: TransientOptions) -> FullFit:
    with threadpool_limits(1), one_thread():
        return run_fit(prepare_machine(spec), predictor, fit, options)


def _is_same(one: Fit, other: Fit) -> bool:
    return one.candidates == other.candidates and one.values == other.values


def _acting(candidates: Sequence[Candidate], number: int) -> tuple[Candidate, ...]:
    return tuple(item for item in candidates if item.recording in (None, number))


def _run(
    machine: PreparedMachine, predictor: Predictor, number: int, fit: Fit, options: TransientOptions
) -> MachineTransient:
    physics = physics_of_fit(predictor, number, fit)
    inputs = inputs_of_drive(
        predictor.drives[number], {name for term in physics.terms for name in term.follows}
    )
    start = start_at(machine, OperatingHistory.of(machine.spec, inputs), predictor.start(number, fit.values))
    return simulate_full(machine, inputs, start=start, options=options, physics=physics)


def _readings(predictor: Predictor, number: int, fit: Fit, run: MachineTransient) -> Array:
    """Readings of every channel in a full run, on the reduced model's grid, (G + 1, c) K or µm."""
    recording = predictor.recordings[number]
    count = recording.temperature_count
    temperatures = [run.reading(probe) for probe in recording.probes[:count]]
    displacements = [MICROMETRES * run.motion_of(sensor) for sensor in recording.probes[count:]]
    predicted = np.column_stack([*temperatures, *displacements])
    predicted = predictor.read(number, predictor.effects.candidates, {}, predicted)
    predicted = predicted + _first_order(predictor, number, fit)
    return predictor.read(number, _acting(fit.candidates, number), fit.values, predicted)


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


def _differences(
    predictor: Predictor, apart: Mapping[str, Sequence[Array]], unit: str
) -> list[Mapping[str, Any]]:
    """Largest difference of full and reduced model at each channel, and of how much the fits differ.

    Of temperatures with the unit ``K``, of displacements with ``um``.
    """
    several = len(predictor.recordings) > 1
    change = [after - before for before, after in zip(apart["before"], apart["after"], strict=True)]
    return [
        {
            "channel": name,
            **({"recording": recording.name} if several else {}),
            **{
                f"{key}_{unit}": float(np.abs(values[number][:, column]).max())
                for key, values in {**apart, "change": change}.items()
            },
        }
        for number, recording in enumerate(predictor.recordings)
        for column, name in enumerate(recording.temperature_names)
        if (column < recording.temperature_count) == (unit == "K")
    ]
