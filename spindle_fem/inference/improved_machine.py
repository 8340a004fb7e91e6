"""The machine definition with the physics that was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from spindle_fem.definition import network_load as network_spec
from spindle_fem.definition.effect_entries import EffectEntry
from spindle_fem.definition.load import write_machine
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.effects.registry import definition_entry
from spindle_fem.inference.belief import Belief
from spindle_fem.inference.coordinate_names import (
    FIRST_ORDER,
    MISDESCRIBED_IN_PREFIX,
    MISDESCRIBED_PREFIX,
    OF_ONE_RECORDING,
    PROBE_PREFIX,
)
from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.findings import (
    candidate_values,
    fitted_and_heldout_errors,
    predictions_at_stamps,
)
from spindle_fem.inference.hypothesis_fit import NOT_SIMULATED, Fit, Problem
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.misdescription_columns import with_misdescriptions
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import slow_error_of
from spindle_fem.model.lumped.written_network import value_in_definition
from spindle_fem.units import Uncertain


def _has_its_place(item: Misdescription, spec: MachineSpec) -> bool:
    """Whether a direction belongs to recording or sensor, or is one that a definition can hold."""
    if item.recording is not None or item.of_sensor:
        return True
    return hasattr(item.change, "corrected") and item.change.corrected(spec, item.sigma) is not spec


def _as_defined(belief: Belief, kept: list[int]) -> Belief:
    """What is known of the kept coordinates if the others are as the definition says."""
    dropped = np.setdiff1d(np.arange(len(belief.coordinates)), kept)
    precision = belief.root.T @ belief.root
    own = precision[np.ix_(kept, kept)]
    moved = np.linalg.solve(own, precision[np.ix_(kept, dropped)] @ belief.mean[dropped])
    return replace(
        belief,
        coordinates=tuple(belief.coordinates[i] for i in kept),
        mean=belief.mean[kept] + moved,
        root=np.linalg.cholesky(own).T,
        begin=None if belief.begin is None else belief.begin[kept],
    )


def _as_written(diagnosis: Diagnosis, machine: DiagnosedMachine) -> tuple[Predictor, Fit, list[str]]:
    """The chosen set on the machine as its definition can be written, fitted once more, and what that lacks.

    Of a network that is without directions of misdescription. Of a machine with geometry those remain that
    have a key to be corrected, or that belong to a recording or a sensor; lengths, films along the channel
    and places of probes are as defined, and the parameters take what they can of them. Where that cannot be
    simulated the fit stands as it is.
    """
    predictor, fit = diagnosis.predictor, diagnosis.stated_fit
    if not predictor.misdescribed:
        return predictor, fit, []
    directions: tuple[Misdescription, ...] = ()
    if not machine.is_network:
        directions = tuple(d for d in predictor.misdescribed if _has_its_place(d, machine.spec))
    written = {item.coordinate for item in directions}
    closed = (MISDESCRIBED_PREFIX, MISDESCRIBED_IN_PREFIX, PROBE_PREFIX)
    kept = [
        index
        for index, item in enumerate(fit.known.coordinates)
        if item.name in written or not item.name.startswith(closed)
    ]
    known, slow = _as_defined(fit.known, kept), diagnosis.calibrated.slow
    try:
        predictor = with_misdescriptions(predictor, directions, fit.values, fit.candidates)
        # The part explained by directions is slow error now: the second fit knows its size.
        for _ in range(2):
            problem = Problem(predictor, known, slow, predictor.observations)
            fit = problem.fit(fit.candidates, fit.values)
            slow = slow_error_of(problem, fit)
    except NOT_SIMULATED as error:
        return (
            diagnosis.predictor,
            diagnosis.stated_fit,
            [f"what its definition cannot hold of the fit: {error}"],
        )
    return predictor, fit, []


@dataclass(frozen=True, slots=True)
class ImprovedMachine:
    """A definition with what was found, and how far it is from the readings.

    Attributes
    ----------
    text : str
        TOML.
    errors : mapping of str to float, [K]
        ``train_rmse_K`` and ``heldout_rmse_K`` of what it holds, without what is of a recording or a sensor
        alone; empty where it lacks something that was found.
    lacks : tuple of str
        What it does not hold, in words.
    """

    text: str
    errors: Mapping[str, float]
    lacks: tuple[str, ...]


def improved_machine(diagnosis: Diagnosis, machine: DiagnosedMachine) -> ImprovedMachine:
    """The definition with the fitted parameters and an ``[[effect]]`` for each finding.

    Parameters keep their remaining uncertainty. Directions of misdescription that correspond to a key of the
    definition are corrected; what no key corresponds to, and the position of a probe in its hole, is left as
    defined, and the parameters are fitted once more without it. A finding that belongs to one of several
    recordings, whose intervals count from its first row, is left out.
    """
    predictor, fit, lacks = _as_written(diagnosis, machine)
    values = fit.values
    told = {name: state.candidate for name, state in diagnosis.states.items()}
    candidates = [told.get(item.amplitude, item) for item in fit.candidates]
    # An entry of a definition acts in whatever is simulated.
    several = len(predictor.recordings) > 1
    left_out = [item for item in candidates if several and item.recording is not None]
    runs = predictor.recordings
    lacks += [f"{item.label}, which acts in {runs[item.recording].name} only" for item in left_out]
    candidates = [item for item in candidates if not several or item.recording is None]
    errors = {} if left_out else _errors(predictor, fit)
    entries = tuple(
        EffectEntry.model_validate(definition_entry(item, candidate_values(item, values)))
        for item in candidates
    )
    own = {
        coordinate.name: (values[coordinate.name], coordinate.sigma)
        for coordinate in diagnosis.machine_coordinates
        if not coordinate.name.startswith((*FIRST_ORDER, *OF_ONE_RECORDING))
    }
    if not machine.is_network:
        spec = with_parameters(machine.spec, {name: value for name, (value, _) in own.items()})
        for item in predictor.misdescribed:
            if hasattr(item.change, "corrected"):
                spec = item.change.corrected(spec, values[item.coordinate])
        spec = spec.model_copy(update={"effects": (*machine.spec.effects, *entries)})
        return ImprovedMachine(write_machine(spec), errors, tuple(lacks))
    moved = {}
    for name, (factor, _) in own.items():
        index = next(i for i, c in enumerate(fit.coordinates) if c.name == name)
        sigma = fit.coordinates[index].sigma * float(np.sqrt(fit.covariance[index, index]))
        moved[name] = Uncertain(value_in_definition(machine.spec, machine.fast.network, name, factor), sigma)
    spec = network_spec.with_parameters(machine.spec, moved)
    spec = spec.model_copy(update={"effects": (*machine.spec.effects, *entries)})
    return ImprovedMachine(network_spec.write_network_machine(spec), errors, tuple(lacks))


def _errors(predictor: Predictor, fit: Fit) -> dict[str, float]:
    """Errors of what a definition can hold of a fit, K."""
    held = {item.coordinate for item in predictor.misdescribed if hasattr(item.change, "corrected")}
    rows = [i for i, c in enumerate(fit.coordinates) if c.name in held or not c.name.startswith(FIRST_ORDER)]
    written = replace(fit, coordinates=tuple(fit.coordinates[i] for i in rows), position=fit.position[rows])
    return fitted_and_heldout_errors(predictor, predictions_at_stamps(predictor, written))
