"""Deviations of the machine from its definition, as ``misdescription`` of the diagnosis file."""

from __future__ import annotations

from typing import Any

import numpy as np

from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.misdescription import EVERY_CHANNEL, Misdescription
from spindle_fem.inference.predictor import Predictor
from spindle_fem.units import NORMAL_90_PERCENT

# Directions that are listed: those moved by this many standard deviations of their priors, so many at most.
MOVED, MOST_LISTED = 0.7, 8


def misdescription_content(diagnosis: Diagnosis) -> dict[str, Any]:
    """Directions most moved, with what was found and with nothing missing; which one to measure.

    Returns
    -------
    dict
        ``directions`` (how many were open), ``left_open`` (rows of the chosen set's fit), ``instead`` (rows
        of the fit with nothing missing: what would have to hold if nothing of the found were there; empty
        when nothing was found), ``measure`` (the direction that is worth measuring most, and why; None where
        none moves), ``wrong`` (the row of a definition that is wrong; None else).
    """
    final, null = (diagnosis.predictor, diagnosis.stated_fit), (diagnosis.unchanged, diagnosis.null)
    found = bool(diagnosis.final.candidates)
    wrong = diagnosis.wrong.direction if diagnosis.judgement.verdict == "parameter" and not found else None
    return {
        "directions": len(diagnosis.predictor.misdescribed),
        "left_open": _rows(*final),
        "instead": _rows(*null) if found else [],
        "measure": _to_measure(*(null if found else final)),
        "wrong": None if wrong is None else _row(*final, wrong, final[1].stated_sigmas),
    }


def _rows(predictor: Predictor, fit: Fit) -> list[dict[str, Any]]:
    sigmas = fit.stated_sigmas
    rows = [_row(predictor, fit, item, sigmas) for item in predictor.misdescribed]
    moved = [row for row in rows if abs(row["sigmas"]) >= MOVED]
    return sorted(moved, key=lambda row: -abs(row["sigmas"]))[:MOST_LISTED]


def _row(predictor: Predictor, fit: Fit, item: Misdescription, sigmas: np.ndarray) -> dict[str, Any]:
    """One direction in one fit, whose standard deviations are stated as ``sigmas``."""
    late = _late_already(predictor, item)
    value = fit.values[item.coordinate] + late
    low, high = fit.interval(item.coordinate, NORMAL_90_PERCENT, sigmas)
    largest, channel, swing, sensor = 0.0, "", 0.0, ""
    for number, recording in enumerate(predictor.recordings):
        column = predictor.column_of(number, item.coordinate)
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
        "low": low + late,
        "high": high + late,
        "sigmas": value / item.sigma,
        "largest_K": largest,
        "channel": channel or sensor,
        **({"largest_um": swing} if sensor else {}),
        **({"recording": predictor.recordings[item.recording].name} if several else {}),
    }


def _late_already(predictor: Predictor, item: Misdescription) -> float:
    """By how much the clock of a recording was found to be off before the fit, s."""
    return float(predictor.late[item.recording]) if item.delays == EVERY_CHANNEL else 0.0


def _to_measure(predictor: Predictor, fit: Fit) -> dict[str, Any] | None:
    """The direction that readings hold farthest off the definition, in widths of its posterior.

    None where none lies more than one width off.
    """
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
    row = _row(predictor, fit, best, fit.stated_sigmas)
    why = f"the readings hold it {most:.1f} standard deviations off the definition"
    return {"key": best.key, "name": best.name, "expected": row["value"], "unit": best.unit, "why": why}
