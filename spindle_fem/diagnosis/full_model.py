"""Recordings run again through the full finite-element model, with nothing missing and with what was found.

The search works on the reduced model. Here the same physics, sizes and
parameters drive the mesh itself, so that an improvement is not one of the
reduction.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.coupling import PreparedMachine, prepare_machine
from spindle_fem.diagnosis.core import Diagnosis
from spindle_fem.diagnosis.findings import predictions_at_stamps, rmse
from spindle_fem.diagnosis.inference import Fit
from spindle_fem.diagnosis.machines import DiagnosedMachine
from spindle_fem.diagnosis.plant import EFFECT_PREFIX, GAP_PREFIX, JUMP_PREFIX, PROBE_PREFIX, STEP, Plant
from spindle_fem.effects.base import Candidate
from spindle_fem.errors import ConvergenceError, EnergyBalanceError, NoSteadyStateError, SpecError
from spindle_fem.network.history import InputHistory
from spindle_fem.reduced.drive import Drive
from spindle_fem.spec.model import MachineSpec
from spindle_fem.transients.history import OperatingHistory
from spindle_fem.transients.run import MachineTransient, TransientOptions, simulate_full, start_at
from spindle_fem.transients.terms import Physics

Array = NDArray[np.float64]
Progress = Callable[[str], None]

OFF, COARSE, OWN = "off", "coarse", "own"
CHOICES = (OFF, COARSE, OWN)
COARSE_MESH = {"preset": "coarse", "order": 1, "size_factor": 1.0, "size": {}}
# Steps of the reduced model's length share their matrix; probes read within 0.003 K of what steps of at
# most 0.05 K error give at a quarter of the time (recorded spindle, start and stop).
OPTIONS = TransientOptions(fixed_step=STEP, coupling_tolerance=1.0e-6, coefficient_tolerance=5.0e-3)

#: What the reduced model adds to its readings to first order: places of probes, and what gaps hide.
FIRST_ORDER = (PROBE_PREFIX, JUMP_PREFIX, GAP_PREFIX)
FIRST_ORDER_NOTE = (
    "where probes sit within their holes, and what happened within gaps, as the reduced model has them"
)
NETWORK_REASON = "The machine is a network: it has no finite-element model."


@dataclass(frozen=True, slots=True)
class FullFit:
    """One fit run through the full model.

    Attributes
    ----------
    predicted : tuple of (N, c) ndarray, [K]
        What every channel of every recording should read, at its stamps.
    steps : int
        Time steps over all recordings.
    """

    predicted: tuple[Array, ...]
    steps: int


def require_choice(choice: str) -> str:
    """Refuse what is none of the choices of a mesh.

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
    """What stands in the place of errors where there are none."""
    return {"mesh": mesh, "reason": reason}


def full_model_errors(
    diagnosis: Diagnosis,
    machine: DiagnosedMachine,
    *,
    mesh: str = COARSE,
    options: TransientOptions = OPTIONS,
    progress: Progress = lambda stage: None,
) -> dict[str, Any]:
    """Errors of the full model with nothing missing and with what was found.

    Parameters
    ----------
    diagnosis : Diagnosis
    machine : DiagnosedMachine
        The same.
    mesh : {"off", "coarse", "own"}
        ``coarse``: the coarse preset, linear temperatures; ``own``: the
        definition's mesh.
    options : TransientOptions
        How accurately time is followed.
    progress : callable

    Returns
    -------
    dict
        ``mesh`` (as asked), ``reason`` (why nothing was run, else None), and
        what was run: ``preset``, ``order``, ``unknowns``, ``before`` and
        ``after`` (``train_rmse_K``, ``heldout_rmse_K``, ``steps``,
        ``seconds``), ``differences`` (largest difference of full and reduced
        model at each channel), ``first_order`` (what the reduced model supplied).

    Raises
    ------
    SpecError
        Another ``mesh``.
    """
    require_choice(mesh)
    if mesh == OFF:
        return nothing_run(mesh, "It was not asked for.")
    if machine.is_network:
        return nothing_run(mesh, NETWORK_REASON)
    plant = diagnosis.plant
    heated = sorted({n for drive in plant.drives for n in drive.names if n.startswith("heat.")})
    if heated:
        return nothing_run(
            mesh, f"The recording gives {', '.join(heated)}, which the full model does not take."
        )
    progress("full model: mesh")
    prepared = prepare_machine(spec_on(machine.spec, mesh))
    found: dict[str, Any] = {}
    differences: list[dict[str, Any]] = []
    fits = {"before": diagnosis.null, "after": diagnosis.final}
    for name, fit in fits.items():
        if name == "after" and fit.candidates == () and fit.values == diagnosis.null.values:
            found[name] = dict(found["before"])
            differences = [row | {"after_K": row["before_K"]} for row in differences]
            break
        progress(f"full model: {name}")
        began = time.perf_counter()
        try:
            full = run_fit(prepared, plant, fit, options)
        except (NoSteadyStateError, ConvergenceError, EnergyBalanceError) as error:
            return nothing_run(mesh, f"The run {name} did not end: {error}")
        found[name] = {
            "train_rmse_K": rmse(plant, full.predicted, heldout=False),
            "heldout_rmse_K": rmse(plant, full.predicted, heldout=True),
            "steps": full.steps,
            "seconds": time.perf_counter() - began,
        }
        own = _differences(plant, full.predicted, predictions_at_stamps(plant, fit), f"{name}_K")
        differences = [a | b for a, b in zip(differences, own, strict=True)] if differences else own
    supplied = any(n.startswith(FIRST_ORDER) for fit in fits.values() for n in fit.values)
    return {
        "mesh": mesh,
        "reason": None,
        "preset": prepared.spec.mesh.preset,
        "order": prepared.spec.mesh.order,
        "unknowns": int(prepared.operators.n_unknowns),
        **found,
        "differences": differences,
        "first_order": FIRST_ORDER_NOTE if supplied else None,
    }


def spec_on(spec: MachineSpec, mesh: str) -> MachineSpec:
    """A machine with its own mesh or the coarse one."""
    if mesh == OWN:
        return spec
    return spec.model_copy(update={"mesh": spec.mesh.model_copy(update=COARSE_MESH)})


def run_fit(machine: PreparedMachine, plant: Plant, fit: Fit, options: TransientOptions = OPTIONS) -> FullFit:
    """Run all recordings through the full model with the parameters and candidates of a fit.

    Raises
    ------
    NoSteadyStateError, ConvergenceError, EnergyBalanceError
    """
    predicted, steps = [], 0
    for number, recording in enumerate(plant.recordings):
        run = _run(machine, plant, number, fit, options)
        steps += len(run.steps.times)
        on_grid = _readings(plant, number, fit, run)
        grid = plant.drives[number].grid
        predicted.append(np.array([np.interp(recording.times, grid, column) for column in on_grid.T]).T)
    return FullFit(tuple(predicted), steps)


def inputs_of_drive(drive: Drive) -> InputHistory:
    """The inputs of a drive as the full model takes them.

    Inputs that are constant on every step are held, others joined by straight lines.
    """
    values = np.vstack((drive.start, drive.end[-1:]))
    return InputHistory(drive.grid, drive.names, values, np.all(drive.start == drive.end, axis=0))


def physics_of_fit(plant: Plant, number: int, fit: Fit) -> Physics:
    """Terms and factors of a fit, those of the definition included, in one recording.

    Parameters
    ----------
    plant : Plant
    number : int
        Of the recording.
    fit : Fit
    """
    acting = _acting(fit.candidates, number)
    values = fit.values
    terms = [*plant.effects.terms, *(term for item in acting for term in item.terms)]
    of_terms = {
        name: values.get(name, item.value)
        for candidate in acting
        for term in candidate.terms
        for name, item in term.names().items()
    }
    # What belongs to a candidate is a factor only where it says so.
    of_candidates = {
        name for c in fit.candidates for name in c.parameters if name not in {item.name for item in c.factors}
    }
    scaled = {EFFECT_PREFIX + item.name: item.name for c in acting for item in c.factors}
    factors = dict(plant.effects.factors)
    for name, value in values.items():
        own = scaled.get(name)
        if own is None and not (name in of_candidates or name.startswith((*FIRST_ORDER, EFFECT_PREFIX))):
            own = name
        if own is not None:
            factors[own] = factors.get(own, 1.0) * value
    return Physics(tuple(terms), of_terms, factors)


# -------------------------------------------------------------------- details
def _acting(candidates: Sequence[Candidate], number: int) -> tuple[Candidate, ...]:
    return tuple(item for item in candidates if item.recording in (None, number))


def _run(
    machine: PreparedMachine, plant: Plant, number: int, fit: Fit, options: TransientOptions
) -> MachineTransient:
    inputs = inputs_of_drive(plant.drives[number])
    start = start_at(machine, OperatingHistory.of(machine.spec, inputs), plant.start(number, fit.values))
    physics = physics_of_fit(plant, number, fit)
    return simulate_full(machine, inputs, start=start, options=options, physics=physics)


def _readings(plant: Plant, number: int, fit: Fit, run: MachineTransient) -> Array:
    """What the channels tell of a full run, on the grid of the reduced model, (G + 1, c) K."""
    told = np.column_stack([run.reading(probe) for probe in plant.recordings[number].probes])
    told = plant.read(number, plant.effects.candidates, {}, told) + _first_order(plant, number, fit)
    return plant.read(number, _acting(fit.candidates, number), fit.values, told)


def _first_order(plant: Plant, number: int, fit: Fit) -> Array | float:
    """What the places of the probes and the gaps change, before the fit's own sensor effects, K."""
    if not any(name.startswith(FIRST_ORDER) for name in fit.values):
        return 0.0
    bare = [replace(item, reading=None) for item in fit.candidates]
    of_bare = {name for item in bare for name in item.parameters}
    of_readings = {name for item in fit.candidates for name in item.parameters} - of_bare
    values = {name: value for name, value in fit.values.items() if name not in of_readings}
    plain = {name: value for name, value in values.items() if not name.startswith(FIRST_ORDER)}
    moved, still = (plant.predict(number, item, bare).temperature for item in (values, plain))
    return moved - still


def _differences(
    plant: Plant, full: Sequence[Array], reduced: Sequence[Array], key: str
) -> list[Mapping[str, Any]]:
    several = len(plant.recordings) > 1
    return [
        {
            "channel": name,
            **({"recording": recording.name} if several else {}),
            key: float(np.abs(a[:, column] - b[:, column]).max()),
        }
        for recording, a, b in zip(plant.recordings, full, reduced, strict=True)
        for column, name in enumerate(recording.temperature_names)
    ]
