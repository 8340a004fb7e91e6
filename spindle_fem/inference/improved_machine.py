"""The machine definition with the physics that was found."""

from __future__ import annotations

import numpy as np

from spindle_fem.definition import network_load as network_spec
from spindle_fem.definition.effect_entries import EffectEntry
from spindle_fem.definition.load import write_machine
from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.effects.registry import definition_entry
from spindle_fem.inference.belief import Belief
from spindle_fem.inference.coordinate_names import (
    FIRST_ORDER,
    MISDESCRIBED_IN_PREFIX,
    MISDESCRIBED_PREFIX,
    OF_ONE_RECORDING,
)
from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.findings import candidate_values
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.prepared_problem import slow_error_of
from spindle_fem.model.lumped.written_network import value_in_definition
from spindle_fem.units import Uncertain


def _without_directions(diagnosis: Diagnosis) -> Fit:
    """The chosen set on the machine as its definition can be written."""
    if not diagnosis.predictor.misdescribed:
        return diagnosis.stated_fit
    predictor, belief = diagnosis.predictor.misdescribed_by((), {}), diagnosis.stated_fit.known
    of_directions = (MISDESCRIBED_PREFIX, MISDESCRIBED_IN_PREFIX)
    kept = [i for i, item in enumerate(belief.coordinates) if not item.name.startswith(of_directions)]
    covariance = np.linalg.inv(belief.root.T @ belief.root)[np.ix_(kept, kept)]
    root = np.linalg.cholesky(np.linalg.inv(covariance)).T
    known = Belief(tuple(belief.coordinates[i] for i in kept), belief.mean[kept], root)
    slow, fit = diagnosis.calibrated.slow, diagnosis.stated_fit
    # The part explained by directions is slow error now: the second fit knows its size.
    for _ in range(2):
        problem = Problem(predictor, known, slow, predictor.observations)
        fit = problem.fit(fit.candidates, fit.values)
        slow = slow_error_of(problem, fit)
    return fit


def improved_machine(diagnosis: Diagnosis, machine: DiagnosedMachine) -> str:
    """Text of the definition with the fitted parameters and an ``[[effect]]`` for each finding.

    Parameters keep their remaining uncertainty. Directions of misdescription
    that correspond to a key of the definition are corrected; the position of a probe
    in its hole is left as defined. No key corresponds to those of
    a network: its parameters are fitted once more, without them.
    """
    fit = _without_directions(diagnosis) if machine.is_network else diagnosis.stated_fit
    values = fit.values
    told = {name: state.candidate for name, state in diagnosis.states.items()}
    candidates = [told.get(item.amplitude, item) for item in fit.candidates]
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
        for item in diagnosis.predictor.misdescribed:
            if hasattr(item.change, "corrected"):
                spec = item.change.corrected(spec, values[item.coordinate])
        return write_machine(spec.model_copy(update={"effects": (*machine.spec.effects, *entries)}))
    moved = {}
    for name, (factor, _) in own.items():
        index = next(i for i, c in enumerate(fit.coordinates) if c.name == name)
        sigma = fit.coordinates[index].sigma * float(np.sqrt(fit.covariance[index, index]))
        moved[name] = Uncertain(value_in_definition(machine.spec, machine.fast.network, name, factor), sigma)
    spec = network_spec.with_parameters(machine.spec, moved)
    return network_spec.write_network_machine(
        spec.model_copy(update={"effects": (*machine.spec.effects, *entries)})
    )
