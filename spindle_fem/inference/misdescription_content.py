"""Deviations of the machine from its definition, as ``misdescription`` of the diagnosis file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.misdescription import EVERY_CHANNEL, Misdescription
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.uncertain_numbers import UncertainNumber
from spindle_fem.inference.wrong_definition import (
    Rival,
    WrongDirection,
    defined_number,
    departure,
    stated_sigmas,
)
from spindle_fem.units import NORMAL_90_PERCENT

# Directions that are listed: those moved by this many standard deviations of their priors, so many at most.
MOVED, MOST_LISTED = 0.7, 8


def misdescription_content(diagnosis: Diagnosis, machine: DiagnosedMachine) -> dict[str, Any]:
    """Directions most moved, with what was found and with nothing missing; which one to measure.

    Parameters
    ----------
    machine : DiagnosedMachine
        The same.

    Returns
    -------
    dict
        ``directions`` (how many were open), ``left_open`` (rows of the chosen set's fit), ``instead`` (rows
        of the fit with nothing missing: what would have to hold if nothing of the found were there; empty
        when nothing was found), ``measure`` (the direction that is worth measuring most, and why; None where
        none moves), ``wrong`` (the row of a definition that is wrong, with ``defined`` where a number of the
        definition is: ``given``, ``value``, ``low``, ``high`` and ``unit``; with ``rivals``, rows of numbers
        that explain a calibration nearly as well: ``key``, ``name``, ``given``, ``value`` and ``unit``; None
        else), ``also_wrong`` (further such rows).
    """
    final, null = (diagnosis.predictor, diagnosis.stated_fit), (diagnosis.unchanged, diagnosis.null)
    found = bool(diagnosis.final.candidates)
    wrong = [
        _wrong_row(*final, item, machine) | {"rivals": [_rival_row(each) for each in item.rivals]}
        for item in diagnosis.wrong
    ]
    wrong.sort(key=lambda row: -abs(row["sigmas"]))
    followed = () if machine.redefined is None else machine.redefined.wrong
    return {
        "directions": len(diagnosis.predictor.misdescribed),
        "left_open": _rows(*final, [*(_wrong_row(*final, item, machine) for item in followed), *wrong]),
        "instead": _rows(*null) if found else [],
        "measure": _to_measure(*(null if found else final), wrong),
        "wrong": wrong[0] if wrong else None,
        "also_wrong": wrong[1:],
    }


def _rows(predictor: Predictor, fit: Fit, wrong: Sequence[dict[str, Any]] = ()) -> list[dict[str, Any]]:
    sigmas, known = fit.stated_sigmas, {row["name"]: row for row in wrong}
    rows = [known.get(item.name) or _row(predictor, fit, item, sigmas) for item in predictor.misdescribed]
    moved = [row for row in rows if abs(row["sigmas"]) >= MOVED]
    return sorted(moved, key=lambda row: -abs(row["sigmas"]))[:MOST_LISTED]


def _wrong_row(
    predictor: Predictor, fit: Fit, wrong: WrongDirection, machine: DiagnosedMachine
) -> dict[str, Any]:
    """The row of a direction whose prior was given up, about the definition that was given."""
    item = wrong.direction
    row = _row(predictor, fit, item, stated_sigmas(fit, {item.coordinate}))
    before = defined_number(item, machine.given)
    if before is None:
        return row
    fitted = {key: row[key] for key in ("value", "low", "high")}
    beyond = {key: departure(item, machine, value) for key, value in fitted.items()}
    for key in ("largest_K", "largest_um"):
        if key in row and fitted["value"]:
            row[key] *= abs(beyond["value"] / fitted["value"])
    row |= {key: item.told(value) for key, value in beyond.items()} | {"sigmas": beyond["value"] / item.sigma}
    row["defined"] = {"given": before.value, "unit": before.unit}
    for key, value in fitted.items():
        row["defined"][key] = defined_number(item, machine.spec, value).value
    return row


def _rival_row(rival: Rival) -> dict[str, Any]:
    return {
        "key": rival.direction.key,
        "name": rival.direction.name,
        "given": rival.given.value,
        "value": rival.value.value,
        "unit": rival.value.unit,
    }


def _row(predictor: Predictor, fit: Fit, item: Misdescription, sigmas: np.ndarray) -> dict[str, Any]:
    """One direction in one fit, whose standard deviations are stated as ``sigmas``."""
    late = _late_already(predictor, item)
    fitted = (fit.values[item.coordinate], *fit.interval(item.coordinate, NORMAL_90_PERCENT, sigmas))
    value, low, high = (item.amount(each) + late for each in fitted)
    largest, channel, swing, sensor = 0.0, "", 0.0, ""
    for number, recording in enumerate(predictor.recordings):
        column = _column(predictor, fit, item, number)
        if column is not None:
            kelvins = recording.temperature_count
            moved = np.abs(value * column[:, :kelvins]).max(axis=0)
            if moved.max() > largest:
                largest = float(moved.max())
                channel = recording.temperature_names[int(np.argmax(moved))]
            # The zero of a displacement is free.
            for name, own in zip(recording.temperature_names[kelvins:], column.T[kelvins:], strict=True):
                if abs(value) * np.ptp(own) > swing:
                    swing, sensor = float(abs(value) * np.ptp(own)), name
    several = item.recording is not None and len(predictor.recordings) > 1
    return {
        "name": item.name,
        "key": item.key,
        "statement": item.statement,
        "unit": item.unit,
        "prior_sigma": item.sigma,
        "value": value,
        "low": low,
        "high": high,
        "sigmas": value / item.sigma,
        "largest_K": largest,
        "channel": channel or sensor,
        **({"largest_um": swing} if sensor else {}),
        **({"recording": predictor.recordings[item.recording].name} if several else {}),
    }


def _column(predictor: Predictor, fit: Fit, item: Misdescription, number: int) -> np.ndarray | None:
    """What a direction changes of a recording's readings, (G + 1, c) per unit of it; None where nothing."""
    if not isinstance(item, UncertainNumber):
        return predictor.column_of(number, item.coordinate)
    name = (item.coordinate,)
    return predictor.predict(number, fit.values, fit.candidates, name).sensitivity[:, :, 0]


def _late_already(predictor: Predictor, item: Misdescription) -> float:
    """By how much the clock of a recording was found to be off before the fit, s."""
    return float(predictor.late[item.recording]) if item.delays == EVERY_CHANNEL else 0.0


def _to_measure(
    predictor: Predictor, fit: Fit, wrong: Sequence[dict[str, Any]] = ()
) -> dict[str, Any] | None:
    """The direction that readings hold farthest off the definition, in widths of its posterior.

    That in which the definition is wrong, if it is. None where none lies more than one width off.
    """
    if wrong:
        width = (wrong[0]["high"] - wrong[0]["low"]) / (2.0 * NORMAL_90_PERCENT)
        return _measured(wrong[0], abs(wrong[0]["value"]) / width)
    names = [c.name for c in fit.coordinates]
    best, most = None, 1.0
    for item in predictor.misdescribed:
        row = names.index(item.coordinate)
        late = _late_already(predictor, item) / item.sigma
        widths = abs(fit.position[row] + late) / np.sqrt(fit.covariance[row, row])
        if widths > most:
            best, most = item, float(widths)
    if best is None:
        return None
    return _measured(_row(predictor, fit, best, fit.stated_sigmas), most)


def _measured(row: dict[str, Any], widths: float) -> dict[str, Any]:
    why = f"the readings hold it {widths:.1f} standard deviations off the definition"
    return {"expected": row["value"], "why": why} | {key: row[key] for key in ("key", "name", "unit")}
