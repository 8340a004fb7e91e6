"""A machine whose definition is wrong, made anew with the value that its recordings show.

To first order a fit says in which direction a definition is wrong. How far, and whether it is, is asked of
the machine with another value, until the recordings ask for no other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import SpindleFemError
from spindle_fem.inference import tuned
from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.misdescription import Factored, Misdescription
from spindle_fem.inference.opened_machine import DiagnosedMachine, with_definition
from spindle_fem.inference.set_odds import log_odds
from spindle_fem.inference.wrong_definition import (
    Redefined,
    WrongDirection,
    departure,
    is_beyond_prior,
    with_wrong_definition,
)

# Times that a machine is made anew at most; nine wrong numbers that were tried took one or two.
MOST_TIMES = 3
# Shares of a foreseen change that are tried: to first order a channel may go through the wall.
SHARES = (1.0, 0.5, 0.25)
# Wrong numbers of one definition at most: a material that is another one has two.
MOST_NUMBERS = 3


def with_definition_put_right(
    machine: DiagnosedMachine,
    diagnosis: Diagnosis,
    diagnosed: Callable[[DiagnosedMachine], Diagnosis],
    progress: Callable[[str], None] = lambda stage: None,
) -> tuple[DiagnosedMachine, Diagnosis]:
    """The machine with the definition that its recordings show, and its diagnosis; else both as they are.

    A machine is made anew with another number where one is suspected. That is told where its own calibration
    or the number's own interval says so, or where it makes the recordings twenty times as likely.

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
    opened, found, told = machine, diagnosis, ()
    while found.suspected is not None:
        new = (found.suspected, *_of_its_material(found))
        if len(told) + len(new) > MOST_NUMBERS:
            break
        other, again = _followed(machine.spec, opened, found, told, new, diagnosed, progress)
        if other is opened:
            found = again
            break
        told = (*told, *new)
        opened, found = other, again
    # The first may have stood for one that was found after it.
    wrong = tuple(item for item in told if is_beyond_prior(item, opened, _telling(item, found)))
    if not wrong:
        return machine, found if opened is machine else diagnosis
    return opened, replace(
        found,
        judgement=with_wrong_definition(found.judgement, wrong, opened),
        wrong=wrong,
        put_right={
            item.coordinate: departure(item, opened, 0.0) / item.sigma
            for item in (each.direction for each in told)
        },
        unchanged=diagnosis.unchanged,
        null=diagnosis.null,
        explanations=diagnosis.explanations,
    )


def _of_its_material(found: Diagnosis) -> tuple[WrongDirection, ...]:
    """Other numbers of the material one of whose numbers is suspected: another material has others."""
    suspected = found.suspected
    material = _material_of(suspected.direction)
    return tuple(
        replace(suspected, direction=item, value=0.0, rivals=())
        for item in found.predictor.misdescribed
        if material and _material_of(item) == material and item.name != suspected.direction.name
    )


def _material_of(item: Misdescription) -> str:
    """The material a number of which a direction is; empty where it is none."""
    return getattr(item.change, "material", "") if isinstance(item.change, Factored) else ""


def _followed(
    given: MachineSpec,
    opened: DiagnosedMachine,
    found: Diagnosis,
    told: tuple[WrongDirection, ...],
    new: tuple[WrongDirection, ...],
    diagnosed: Callable[[DiagnosedMachine], Diagnosis],
    progress: Callable[[str], None],
) -> tuple[DiagnosedMachine, Diagnosis]:
    """The machine with new wrong numbers followed beside those that are told, and its diagnosis.

    As they are where the first new one is not told, or no machine can be made with it.
    """
    suspected, wrong, before = new[0], (*told, *new), (opened, found)
    values = [_fitted(_telling(item, found), item.direction)[0] for item in told]
    values += [item.value for item in new]
    for _ in range(MOST_TIMES):
        progress(f"definition put right: {', '.join(item.direction.key for item in wrong)}")
        try:
            other = replace(_made(opened, wrong, values, progress), redefined=Redefined(given, wrong))
            again = diagnosed(other)
        except SpindleFemError as error:
            note = f"The machine could not be made anew with another {suspected.direction.key}: {error}"
            return opened, replace(found, notes=(*found.notes, note))
        if opened is before[0] and not _is_told(suspected, found, other, again):
            return before
        opened, found = other, again
        fitted = [_fitted(_telling(item, found), item.direction) for item in wrong]
        values = [value for value, _ in fitted]
        if all(abs(value) <= width for value, width in fitted):
            break
    return opened, found


def _made(
    opened: DiagnosedMachine,
    wrong: Sequence[WrongDirection],
    values: Sequence[float],
    progress: Callable[[str], None],
) -> DiagnosedMachine:
    """The machine with wrong numbers changed as foreseen; by less where no machine is like that."""
    refused: SpindleFemError | None = None
    for share in SHARES:
        spec = opened.spec
        for item, value in zip(wrong, values, strict=True):
            spec = item.direction.change.redefined(spec, share * value)
        try:
            return with_definition(opened, spec, progress)
        except SpindleFemError as error:
            refused = refused or error
    raise refused


def _is_told(wrong: WrongDirection, given: Diagnosis, other: DiagnosedMachine, again: Diagnosis) -> bool:
    """Whether a definition is wrong, by the machine made anew with another number."""
    if not is_beyond_prior(wrong, other, _telling(wrong, again)):
        return False
    if wrong.by_calibration or wrong.by_interval:
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
    return item.amount(fit.values[item.coordinate]), 0.5 * (item.amount(high) - item.amount(low))
