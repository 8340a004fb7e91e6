"""``diagnosis.json``: a diagnosis as plain data with units in the keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from spindle_fem.effects.framework.effect import capital
from spindle_fem.inference.coordinate_names import MISDESCRIBED_IN_PREFIX, MISDESCRIBED_PREFIX
from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.findings import (
    channel_errors,
    displacement_errors,
    findings_of,
    fitted_and_heldout_errors,
    noise_level,
    predictions_at_stamps,
    rmse,
)
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.misdescription_content import misdescription_content
from spindle_fem.inference.mismatch_place import where_of
from spindle_fem.inference.missing_heat import stretches
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.verdict import Judgement
from spindle_fem.inference.wrong_definition import numbers_far_off, stated_sigmas
from spindle_fem.results.run_summary import package_versions
from spindle_fem.units import NORMAL_90_PERCENT

SCHEMA = "spindle-fem/diagnosis/1"
STATES_ARE_TOLD = "; readings there tell when hidden states were on, and nothing else of the fit"


def diagnosis_content(
    diagnosis: Diagnosis, opened: DiagnosedMachine, before: Sequence[np.ndarray], after: Sequence[np.ndarray]
) -> dict[str, Any]:
    """Everything that a diagnosis found, except the full model's check and the next measurement.

    Parameters
    ----------
    before, after : sequence of (N, c) ndarray, [K]
        Predictions of both fits at the stamps of every recording.
    """
    judgement, predictor = diagnosis.judgement, diagnosis.predictor
    findings = findings_of(diagnosis, judgement.chosen, split=True)
    alternatives = [
        {"findings": findings_of(diagnosis, item, split=False), "probability": item.probability}
        for item in judgement.alternatives
    ]
    where = where_of(diagnosis)
    return {
        "schema": SCHEMA,
        "machine": opened.name,
        "recordings": [recording.name for recording in predictor.recordings],
        "verdict": judgement.verdict,
        "reason": " ".join(filter(None, _reasons(opened, judgement))),
        "machine_too_coarse": None if opened.too_coarse is None else asdict(opened.too_coarse),
        "mismatch": {
            "detected": judgement.verdict != "consistent",
            "p_value": judgement.p_value,
            "channels": channel_errors(predictor, before),
            "displacements": displacement_errors(predictor, before),
            **where.to_json(),
        },
        "findings": findings,
        "set_probability": judgement.chosen.probability,
        "alternatives": alternatives,
        "something_else_probability": judgement.other,
        "evidence": {
            "probability": judgement.evidence,
            "share_of_last": judgement.share_of_last,
            "gain_of_more": judgement.gain_of_more,
        },
        "fit": {
            "before": fitted_and_heldout_errors(predictor, before),
            "after": fitted_and_heldout_errors(predictor, after) | _by_what_is_told(diagnosis),
            "noise_K": noise_level(predictor),
            "heldout": diagnosis.heldout + (STATES_ARE_TOLD if diagnosis.states else ""),
            "heldout_s": [
                [list(ends) for ends in stretches(~use, recording.times)]
                for recording, use in zip(predictor.recordings, predictor.use, strict=True)
            ],
            "channels_after": channel_errors(predictor, after),
            "displacements_after": displacement_errors(predictor, after),
        },
        "improved_model": "improved_machine.toml",
        "machine_parameters": _machine_parameters(diagnosis),
        "misdescription": misdescription_content(diagnosis, opened),
        "slow_error": {"sigma_K": diagnosis.final.slow.sigma, "time_s": diagnosis.final.slow.time},
        "candidates_tried": diagnosis.candidates_tried,
        "hypotheses_fitted": len(diagnosis.hypotheses),
        "seconds": dict(diagnosis.seconds),
        "notes": [
            *opened.notes,
            *diagnosis.notes,
            *numbers_far_off(diagnosis.stated_fit, opened, diagnosis.wrong),
            *dict.fromkeys(note for drive in predictor.drives for note in drive.notes),
        ],
        "defects": [recording.defects.to_json() for recording in predictor.recordings],
        "versions": package_versions(),
    }


def _by_what_is_told(diagnosis: Diagnosis) -> dict[str, float]:
    """Held-out errors with states and moments from all readings, sizes and laws without held-out ones.

    And, where states are followed, without any of them. Nothing found is the same fit as before.
    """
    found = diagnosis.final.candidates and diagnosis.followed is not None
    if not found or diagnosis.followed.fit is diagnosis.final:
        return {}

    def heldout_error(fit: Fit) -> float:
        predicted = predictions_at_stamps(diagnosis.predictor, fit)
        return rmse(diagnosis.predictor, predicted, heldout=True)

    told = {"heldout_states_told_rmse_K": heldout_error(diagnosis.followed.fit)}
    if diagnosis.states:
        told["heldout_states_untold_rmse_K"] = heldout_error(diagnosis.final)
    return told


def _reasons(opened: DiagnosedMachine, judgement: Judgement) -> tuple[str, ...]:
    """Why the verdict is what it is, sentence by sentence."""
    coarse = opened.too_coarse
    if coarse is None:
        return (judgement.reason,)
    unexplained = judgement.verdict == "unexplained" and not judgement.chosen.fit.candidates
    if not unexplained or judgement.left > coarse.left_with_them:
        return coarse.statement, capital(judgement.reason)
    return (
        coarse.statement,
        f"{capital(judgement.reason)}.",
        f"Its calibration leaves {coarse.left_with_them:.1f} times: nothing says that the machine has "
        "changed since.",
    )


def _machine_parameters(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The machine's own parameters before and after, those apart that no key of the definition has.

    What was put right counts from the definition as given.
    """
    fit, rows = diagnosis.stated_fit, []
    sigmas = stated_sigmas(fit, diagnosis.without_prior)
    for coordinate in diagnosis.machine_coordinates:
        if coordinate.name.startswith((MISDESCRIBED_PREFIX, MISDESCRIBED_IN_PREFIX)):
            continue
        low, high = fit.interval(coordinate.name, NORMAL_90_PERCENT, sigmas)
        times = float(np.exp(coordinate.sigma * diagnosis.put_right.get(coordinate.name, 0.0)))
        rows.append(
            {
                "name": coordinate.name,
                "prior": coordinate.value,
                "prior_sigma": coordinate.sigma,
                "logarithmic": coordinate.logarithmic,
                "value": times * fit.values[coordinate.name],
                "low": times * low,
                "high": times * high,
                "unit": coordinate.unit,
            }
        )
    return rows


def unexplained_content(opened: DiagnosedMachine, reason: str) -> dict[str, Any]:
    """Content for a recording that is sound but has too little information."""
    channels = [
        {"channel": name, "rmse_K": None, "noise_K": float(sigma), "max_K": None}
        for recording in opened.recordings
        for name, sigma in list(zip(recording.temperature_names, recording.sigma, strict=True))[
            : recording.temperature_count
        ]
    ]
    nothing = {"train_rmse_K": None, "heldout_rmse_K": None}
    return {
        "schema": SCHEMA,
        "machine": opened.name,
        "recordings": [recording.name for recording in opened.recordings],
        "verdict": "unexplained",
        "reason": reason,
        "mismatch": {
            "detected": False,
            "p_value": 1.0,
            "channels": channels,
            "where": {"component": None, "r_mm": None, "z_mm": None, "credible": []},
            "when": [],
            "missing_heat_W": {},
        },
        "findings": [],
        "set_probability": 0.0,
        "alternatives": [],
        "something_else_probability": 1.0,
        "fit": {"before": nothing, "after": dict(nothing), "noise_K": None, "heldout": "nothing was fitted"},
        "next_measurement": {
            "where": "all channels",
            "quantity": "temperature",
            "condition": "a speed step from standstill, held until the temperatures settle, then a cool-down",
            "why": reason,
        },
        "improved_model": None,
        "versions": package_versions(),
    }


def plain_data(value: Any) -> Any:
    """Data as JSON allows it; numbers that are not finite become null."""
    if isinstance(value, dict):
        return {key: plain_data(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain_data(item) for item in value]
    if isinstance(value, (np.floating, float)):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, np.bool_):
        return bool(value)
    return value
