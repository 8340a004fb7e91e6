"""Recordings run again through the full finite-element model, with nothing missing and with what was found.

The search works on the reduced model. Here the same physics, sizes and
parameters drive the mesh itself, so that an improvement is not one of the
reduction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.errors import SpecError, SpindleFemError, WorkerDiedError
from spindle_fem.inference import tuned
from spindle_fem.inference.coordinate_names import FIRST_ORDER
from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.findings import (
    channel_errors,
    channel_noise,
    displacement_errors,
    fitted_and_heldout_errors,
    predictions_at_stamps,
)
from spindle_fem.inference.full_model_confirmation import (
    CONFIRMED,
    LINEAR_SHARE,
    confirmed_share,
    left_by_both,
)
from spindle_fem.inference.full_model_runs import (
    FullFit,
    MeshRuns,
    alone,
    finished,
    inputs_of_drive,
    mesh_runs,
    run_fit,
)
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.parallel import in_copies, start_copy, thread_count
from spindle_fem.solvers.input_history import OperatingHistory
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine
from spindle_fem.solvers.transient_records import TransientOptions, balanced

Array = NDArray[np.float64]
Progress = Callable[[str], None]

OFF, AUTO, COARSE, OWN = "off", "auto", "coarse", "own"
CHOICES = (AUTO, OFF, COARSE, OWN)
COARSE_MESH = {"preset": "coarse", "order": 1, "size_factor": 1.0, "size": {}}
# Noise of the quietest channel [K] counts within these: a coarse mesh is not as good as the best sensors, and
# loads must follow the field even for the worst.
QUIETEST, LOUDEST = 0.02, 0.2
# First step of a run and after a jump, s: about what its error allows there.
FIRST_STEP = 60.0
# Share of the heat that may be missing in a run, for each kelvin of that noise: a fifth of what so coarse a
# coupling may leave. (Seven recordings leave a hundredth to four fifths of it.)
IMBALANCE_PER_KELVIN = 0.01
# Most time steps of a fit that is run unasked: it then takes about as long as the search.
MOST_STEPS = 800
# Further steps that a jump of an input costs.
STEPS_AFTER_JUMP = 3

FIRST_ORDER_NOTE = (
    "where probes sit within their holes, how the machine differs from its definition, and what happened "
    "within gaps, as the reduced model has them"
)
# What a run is called of the machine that a set belongs to, with nothing missing.
WITHOUT_SET = "after, without what was found"
NETWORK_REASON = "The machine is a network: it has no finite-element model."

Keep = Callable[[str, tuple[Array, ...]], None]


@dataclass(frozen=True, slots=True)
class BegunFit:
    """A fit whose runs on the coarse mesh were begun in another process, before it was asked for.

    Attributes
    ----------
    options : TransientOptions
    wait : callable
        Gives the runs.
    """

    fit: Fit
    options: TransientOptions
    wait: Callable[[], MeshRuns]

    def serves(self, fit: Fit, mesh: str, options: TransientOptions) -> bool:
        """Whether its runs are those of a fit: what the reduced model supplies is none of theirs."""
        return mesh == COARSE and options == self.options and _on_mesh(fit) == _on_mesh(self.fit)


def _on_mesh(fit: Fit) -> tuple[tuple[Candidate, ...], dict[str, float]]:
    """Candidates of a fit, and its values that a run on the mesh depends on."""
    return fit.candidates, {n: value for n, value in fit.values.items() if not n.startswith(FIRST_ORDER)}


class BegunRuns:
    """Runs of a diagnosis on the coarse mesh that begin before :func:`full_model_errors` asks for them.

    None begins where they will hardly be needed, or where there is no other process for them.

    Parameters
    ----------
    mesh : {"auto", "off", "coarse", "own"}
        As :func:`full_model_errors` takes it.
    """

    def __init__(self, machine: DiagnosedMachine, mesh: str = AUTO) -> None:
        self.machine, self._mesh = machine, mesh
        self._needed = mesh in (AUTO, COARSE) and not machine.is_network and thread_count() > 1
        self._prepared: dict[str, PreparedMachine] = {}
        self.fits: list[BegunFit] = []

    def prepare(self) -> None:
        """Mesh the machine, if it will be needed: all runs share it."""
        if self._needed:
            try:
                self.machine_on(COARSE)
            except SpindleFemError:
                # Who asks for the errors is told why.
                self._needed = False

    def begin(self, predictor: Predictor, fit: Fit) -> None:
        """Begin the run of a fit."""
        options = options_for(predictor)
        if not self._needed or (self._mesh == AUTO and expected_steps(predictor, options) > MOST_STEPS):
            return
        self.prepare()
        if self._needed:
            prepared = self.machine_on(COARSE)
            runs = start_copy(partial(alone, mesh_runs, prepared, predictor, fit, options))
            self.fits.append(BegunFit(fit, options, runs))

    def machine_on(self, mesh: str) -> PreparedMachine:
        """The machine on the coarse mesh or its own, made once."""
        if mesh not in self._prepared:
            self._prepared[mesh] = prepare_machine(spec_on(self.machine.spec, mesh))
        return self._prepared[mesh]


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
    begun: Sequence[BegunRuns] = (),
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
    begun : sequence of BegunRuns
        Which serve where a fit is the same: of the machine as its definition was given first, which is
        ``machine`` unless that was put right.
    keep : callable
        Gets ``before`` or ``after`` and its predictions.

    Returns
    -------
    dict
        ``mesh`` (as requested or chosen), ``reason`` (why nothing was run, else
        None), and what was run: ``preset``, ``order``, ``unknowns``,
        ``step_error_K``, ``coupling_tolerance_K``, ``before`` and ``after`` (``train_rmse_K``,
        ``heldout_rmse_K``, ``channels``, ``displacements``, ``steps``, ``seconds``), ``left`` (by
        a set of the readings over their errors: ``fast`` and ``full``, :func:`left_by_both`; None where
        nothing was found),
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
    begun = begun or (BegunRuns(machine, OFF),)
    own = next(item for item in begun if item.machine is machine)
    if mesh == AUTO:
        steps = expected_steps(predictor, options)
        if steps > MOST_STEPS:
            return nothing_run(
                mesh, f"It would take some {steps} time steps a fit; --full-model coarse runs them."
            )
        mesh = COARSE
    try:
        return balanced(
            lambda asked: _both_fits(diagnosis, mesh, asked, (begun[0], own), keep, progress), options
        )
    except SpindleFemError as error:
        return nothing_run(mesh, f"It could not be run: {error}")


def options_for(predictor: Predictor) -> TransientOptions:
    """Accuracy of the time integration: as accurate as the quietest channel can resolve."""
    levels = [
        channel_noise(predictor, recording, channel)
        for recording in predictor.recordings
        for channel in range(recording.temperature_count)
    ]
    return options_to_read(float(np.clip(min(levels), QUIETEST, LOUDEST)))


def options_to_read(noise: float) -> TransientOptions:
    """Accuracy of the time integration for readings of some noise [K]."""
    return TransientOptions(
        error=tuned.STEP_ERROR * noise,
        error_norm="mean",
        coupling_tolerance=tuned.COUPLING_ERROR * noise,
        input_resolution=tuned.INPUT_RESOLUTION * noise,
        first_step=FIRST_STEP,
        trust_contraction=True,
        method="multigrid",
        imbalance=IMBALANCE_PER_KELVIN * noise,
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
    mesh: str,
    options: TransientOptions,
    begun: tuple[BegunRuns, BegunRuns],
    keep: Keep,
    progress: Progress,
) -> dict[str, Any]:
    progress("full model: mesh")
    prepared = begun[1].machine_on(mesh)
    before, after = (diagnosis.unchanged, diagnosis.null), (diagnosis.predictor, diagnosis.stated_fit)
    fits = {"before": before, "after": after}
    same = begun[0] is begun[1] and _is_same(diagnosis.null, diagnosis.stated_fit)
    different = {"before, which is after": before} if same else fits
    runs = _runs(different, dict(zip(different, begun, strict=False)), options, mesh, progress)
    if same:
        (run,) = runs.values()
        runs = dict.fromkeys(fits, run)
    found: dict[str, dict[str, Any]] = {}
    apart: dict[str, list[Array]] = {}
    reduced: dict[str, list[Array]] = {}
    for name, full in runs.items():
        predictor, fit = fits[name]
        keep(name, full.predicted)
        found[name] = {
            **fitted_and_heldout_errors(predictor, full.predicted),
            "channels": channel_errors(predictor, full.predicted),
            "displacements": displacement_errors(predictor, full.predicted),
            "steps": full.steps,
            "seconds": full.seconds,
        }
        reduced[name] = predictions_at_stamps(predictor, fit)
        apart[name] = [a - b for a, b in zip(full.predicted, reduced[name], strict=True)]
    predictor = diagnosis.predictor
    left = None
    if diagnosis.stated_fit.candidates:
        least_share = LINEAR_SHARE if prepared.spec.mesh.order == 1 else 0.0
        meshed = {name: full.predicted for name, full in runs.items()}
        left = left_by_both(predictor, reduced, meshed, least_share)
        if confirmed_share(*left) < CONFIRMED:
            # Both fits read alike by other parameters: a mesh may be apart from the fast model by more of one
            # of them. Of the machine with the set it is asked what the set alone changes.
            fit = diagnosis.stated_fit.without_candidates
            bare = _runs({WITHOUT_SET: (predictor, fit)}, {WITHOUT_SET: begun[1]}, options, mesh, progress)
            reduced["before"] = predictions_at_stamps(predictor, fit)
            meshed["before"] = bare[WITHOUT_SET].predicted
            left = left_by_both(predictor, reduced, meshed, least_share)
    supplied = any(n.startswith(FIRST_ORDER) for _, fit in fits.values() for n in fit.values)
    return {
        "mesh": mesh,
        "reason": None,
        "preset": prepared.spec.mesh.preset,
        "order": prepared.spec.mesh.order,
        "unknowns": int(prepared.operators.n_unknowns),
        "step_error_K": options.error,
        "coupling_tolerance_K": options.coupling_tolerance,
        **found,
        "left": None if left is None else dict(zip(("fast", "full"), left, strict=True)),
        "differences": _differences(predictor, apart, "K"),
        "displacement_differences": _differences(predictor, apart, "um"),
        "first_order": FIRST_ORDER_NOTE if supplied else None,
    }


def spec_on(spec: MachineSpec, mesh: str) -> MachineSpec:
    """A machine with its own mesh or the coarse one."""
    if mesh == OWN:
        return spec
    return spec.model_copy(update={"mesh": spec.mesh.model_copy(update=COARSE_MESH)})


# -------------------------------------------------------------------- details
def _runs(
    fits: Mapping[str, tuple[Predictor, Fit]],
    begun: Mapping[str, BegunRuns],
    options: TransientOptions,
    mesh: str,
    progress: Progress,
) -> dict[str, FullFit]:
    """Every fit run once: those that were begun waited for, others on the coarse mesh side by side.

    Each on the machine of its own begun runs; in this process, with a warning, where another one ends
    prematurely.
    """
    served = {
        name: item
        for name, (_, fit) in fits.items()
        for item in begun[name].fits
        if item.serves(fit, mesh, options)
    }
    machines = {name: begun[name].machine_on(mesh) for name in fits}
    jobs = {
        name: partial(alone, run_fit, machines[name], *fit, options)
        if mesh == COARSE
        else partial(run_fit, machines[name], *fit, options)
        for name, fit in fits.items()
    }
    if mesh != COARSE or thread_count() == 1:
        return _one_by_one(jobs, progress)
    progress(f"full model: {' and '.join(fits)}")
    own = [name for name in fits if name not in served]
    try:
        found = dict(zip(own, in_copies([jobs[name] for name in own], len(own)), strict=True))
        found |= {name: finished(*fits[name], item.wait()) for name, item in served.items()}
        return {name: found[name] for name in fits}
    except WorkerDiedError as error:
        progress(f"{error.where}: {error.what}")
        return _one_by_one(jobs, progress)


def _one_by_one(jobs: Mapping[str, Callable[[], FullFit]], progress: Progress) -> dict[str, FullFit]:
    found = {}
    for name, job in jobs.items():
        progress(f"full model: {name}")
        found[name] = job()
    return found


def _is_same(one: Fit, other: Fit) -> bool:
    return one.candidates == other.candidates and one.values == other.values


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
