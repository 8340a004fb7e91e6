"""A machine whose definition is wrong, made anew with the value that its recordings show.

To first order a fit says in which direction a definition is wrong. How far is asked of the machine with
another value, until the recordings ask for no other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from spindle_fem.errors import SpindleFemError
from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.opened_machine import DiagnosedMachine, with_definition
from spindle_fem.inference.verdict import PRIOR_SIGMAS
from spindle_fem.inference.wrong_definition import Redefined, defined_number, definition_is_wrong

# Times that a machine is made anew at most: the second value is within a few per cent of the third.
MOST_TIMES = 3


def with_definition_put_right(
    machine: DiagnosedMachine,
    diagnosis: Diagnosis,
    diagnosed: Callable[[DiagnosedMachine], Diagnosis],
    progress: Callable[[str], None] = lambda stage: None,
) -> tuple[DiagnosedMachine, Diagnosis]:
    """The machine with the definition that its recordings show, and its diagnosis; else both as they are.

    A machine is made anew where the prior of a number of its definition was given up and what was found
    needs it to be elsewhere. That is told if then nothing is missing.

    Parameters
    ----------
    machine, diagnosis
        As its definition was given.
    diagnosed : callable
        Diagnoses a machine.

    Returns
    -------
    (DiagnosedMachine, Diagnosis)
        ``unchanged``, ``null`` and ``explanations`` are those of the definition as it was given.
    """
    wrong = diagnosis.wrong
    if wrong is None or defined_number(wrong.direction, machine.spec) is None:
        return machine, diagnosis
    item, opened, found = wrong.direction, machine, diagnosis
    value, width = _fitted(diagnosis.final, item)
    if abs(value) <= PRIOR_SIGMAS * item.sigma:
        return machine, diagnosis
    redefined = Redefined(machine.spec, wrong)
    for _ in range(MOST_TIMES):
        progress(f"definition put right: {item.key}")
        try:
            other = with_definition(opened, item.change.redefined(opened.spec, value), progress)
            other = replace(other, redefined=redefined)
            again = diagnosed(other)
        except SpindleFemError as error:
            note = f"The machine could not be made anew with another {item.key}: {error}"
            found = replace(found, notes=(*found.notes, note))
            break
        if not definition_is_wrong(again.judgement):
            break
        opened, found = other, again
        value, width = _fitted(found.final, item)
        if abs(value) <= width:
            break
    if opened is machine:
        return machine, found
    as_given = {"unchanged": diagnosis.unchanged, "explanations": diagnosis.explanations}
    return opened, replace(found, **as_given, null=wrong.within or diagnosis.null)


def _fitted(fit: Fit, item: Misdescription) -> tuple[float, float]:
    """Value of a direction in a fit, and its standard deviation as stated."""
    low, high = fit.interval(item.coordinate, 1.0, fit.stated_sigmas)
    return fit.values[item.coordinate], 0.5 * (high - low)
