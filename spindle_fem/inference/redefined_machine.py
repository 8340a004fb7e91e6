"""A machine whose definition is wrong, made anew with the value that its recordings show.

To first order a fit says in which direction a definition is wrong. How far, and whether it is, is asked of
the machine with another value, until the recordings ask for no other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from spindle_fem.effects.framework.effect import capital
from spindle_fem.errors import SpindleFemError
from spindle_fem.inference import tuned
from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.opened_machine import DiagnosedMachine, with_definition
from spindle_fem.inference.set_odds import log_odds
from spindle_fem.inference.wrong_definition import (
    Redefined,
    WrongDirection,
    is_beyond_prior,
    with_wrong_definition,
    wrong_definition_words,
)

# Times that a machine is made anew at most; nine wrong numbers that were tried took one or two.
MOST_TIMES = 3


def with_definition_put_right(
    machine: DiagnosedMachine,
    diagnosis: Diagnosis,
    diagnosed: Callable[[DiagnosedMachine], Diagnosis],
    progress: Callable[[str], None] = lambda stage: None,
) -> tuple[DiagnosedMachine, Diagnosis]:
    """The machine with the definition that its recordings show, and its diagnosis; else both as they are.

    A machine is made anew with another number where one is suspected. That is told where its own calibration
    says so, or where it makes the recordings twenty times as likely.

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
    wrong = diagnosis.suspected
    if wrong is None:
        return machine, diagnosis
    item, opened, found, value = wrong.direction, machine, diagnosis, wrong.value
    for _ in range(MOST_TIMES):
        progress(f"definition put right: {item.key}")
        try:
            spec = item.change.redefined(opened.spec, value)
            other = replace(with_definition(opened, spec, progress), redefined=Redefined(machine.spec, wrong))
            again = diagnosed(other)
        except SpindleFemError as error:
            note = f"The machine could not be made anew with another {item.key}: {error}"
            found = replace(found, notes=(*found.notes, note))
            break
        if opened is machine and not _is_told(wrong, diagnosis, other, again):
            break
        opened, found = other, again
        value, width = _fitted(_telling(wrong, found), item)
        if abs(value) <= width:
            break
    if opened is machine:
        return machine, found
    judgement, notes = with_wrong_definition(found.judgement, wrong, opened), found.notes
    if found.judgement.verdict != "consistent":
        notes = (capital(wrong_definition_words(wrong, opened, found.final)), *notes)
    return opened, replace(
        found,
        judgement=judgement,
        wrong=wrong,
        notes=notes,
        unchanged=diagnosis.unchanged,
        null=diagnosis.null,
        explanations=diagnosis.explanations,
    )


def _is_told(wrong: WrongDirection, given: Diagnosis, other: DiagnosedMachine, again: Diagnosis) -> bool:
    """Whether a definition is wrong, by the machine made anew with another number."""
    if not is_beyond_prior(wrong, other, _telling(wrong, again)):
        return False
    if wrong.by_calibration:
        return True
    odds = log_odds(again.hypotheses, given.hypotheses, wrong.log_prior, given.coarseness)
    return odds >= tuned.LEAST_HELDOUT_GAIN


def _telling(wrong: WrongDirection, found: Diagnosis) -> Fit:
    """The fit that says where the number is."""
    calibrated = found.calibrated.fit if wrong.by_calibration else None
    return found.final if calibrated is None else calibrated


def _fitted(fit: Fit, item: Misdescription) -> tuple[float, float]:
    """Value of a direction in a fit, and its standard deviation as stated."""
    low, high = fit.interval(item.coordinate, 1.0, fit.stated_sigmas)
    return fit.values[item.coordinate], 0.5 * (high - low)
