"""Diagnose recordings and write what came of it: the function behind ``spindle-fem diagnose``."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from spindle_fem.inference.diagnosis import MOST_WORKERS, Diagnosis, diagnose_recordings
from spindle_fem.inference.findings import (
    channel_errors,
    findings_of,
    noise_level,
    predictions_at_stamps,
    rmse,
    states_of,
)
from spindle_fem.inference.full_model_check import AUTO, OFF, full_model_errors, nothing_run, require_choice
from spindle_fem.inference.improved_machine import improved_machine
from spindle_fem.inference.mismatch_place import where_of
from spindle_fem.inference.missing_heat import stretches
from spindle_fem.inference.next_measurement import next_measurement
from spindle_fem.inference.opened_machine import DiagnosedMachine, open_machine
from spindle_fem.inference.sufficiency import says_too_little
from spindle_fem.inference.worker_processes import Workers
from spindle_fem.parallel import thread_count
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.compare import write_simulated
from spindle_fem.results.output_folder import output_folder, replace_text
from spindle_fem.results.run_summary import package_versions

Progress = Callable[[str], None]

SCHEMA = "spindle-fem/diagnosis/1"
STATE_COLUMNS = ("start", "end", "effect", "component", "value", "unit")


def diagnose(
    machine: str | Path,
    recordings: Iterable[str | Path],
    folder: str | Path,
    calibrate: Iterable[str | Path] = (),
    overrides: Iterable[str] = (),
    *,
    heldout: str = "blocks",
    full_model: str = AUTO,
    report: bool = True,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Say where recordings and a machine differ, what was left out, and how well it fits with it.

    Parameters
    ----------
    machine : str or Path
        A definition or the name of one that ships; with geometry or a ``[network]``.
    recordings : iterable of str or Path
        To be explained; what is found acts in all of them.
    folder : str or Path
        Gets ``diagnosis.json``, ``improved_machine.toml``, ``states.csv``,
        ``before.csv`` and ``after.csv`` (predictions), the same of the full
        model as ``before_full_model.csv`` and ``after_full_model.csv``,
        ``diagnosis.nc``, ``figures/*.png`` and ``report.html``.
    calibrate : iterable of str or Path
        Recordings of the same machine with nothing missing.
    overrides : iterable of str
        ``path=value`` texts.
    heldout : str
        ``blocks`` or ``last:0.4``: readings that the fit does not see.
    full_model : {"auto", "off", "coarse", "own"}
        Mesh on which both fits are run again by the full model; ``auto`` is
        the coarse one unless that would take very many time steps.
    report : bool
        Whether to write figures and the report too.
    progress : callable, optional

    Returns
    -------
    dict
        The content of ``diagnosis.json``.

    Raises
    ------
    SpindleFemError
    """
    started = time.perf_counter()
    require_choice(full_model)
    tell = progress or (lambda stage: None)
    tell("reading")
    read = [read_recording(path) for path in recordings]
    earlier = [read_recording(path) for path in calibrate]
    opened = open_machine(machine, tuple(overrides), read, earlier, heldout=heldout, progress=tell)
    with output_folder(folder) as place:
        drawn = None
        reason = says_too_little(opened)
        if reason:
            content = _unexplained(opened, reason)
            content["fit"]["full_model"] = nothing_run(
                OFF if full_model == AUTO else full_model, "Nothing was fitted."
            )
        else:
            workers = Workers(min(thread_count(), MOST_WORKERS))
            workers.wake()
            diagnosis = diagnose_recordings(opened, heldout=heldout, progress=tell, workers=workers)
            tell("writing")
            proposed = workers.ahead(partial(next_measurement, diagnosis))
            content = _write(diagnosis, opened, place, report=report, progress=tell)
            if report:
                drawn = workers.ahead(partial(_draw, place, json.loads(json.dumps(_plain(content)))))
            content["fit"]["full_model"] = full_model_errors(
                diagnosis,
                opened,
                mesh=full_model,
                keep=lambda name, predicted: _write_predictions(
                    diagnosis, place, f"{name}_full_model", predicted
                ),
                progress=tell,
            )
            content["next_measurement"] = proposed()
        content["wall_time_s"] = time.perf_counter() - started
        replace_text(place / "diagnosis.json", json.dumps(_plain(content), indent=1) + "\n")
        if report:
            from spindle_fem.report.diagnosis_report import write_diagnosis_report

            tell("report")
            write_diagnosis_report(place, None if drawn is None else drawn())
        return content


def _draw(place: Path, content: Mapping[str, Any]) -> Mapping[str, list[Any]]:
    """Figures of a diagnosis, in whatever process."""
    from spindle_fem.report.diagnosis_report import draw_figures

    return draw_figures(place, content)


def _write(
    diagnosis: Diagnosis, opened: DiagnosedMachine, place: Path, *, report: bool, progress: Progress
) -> dict[str, Any]:
    judgement, plant = diagnosis.judgement, diagnosis.plant
    before, after = (predictions_at_stamps(plant, fit) for fit in (diagnosis.null, diagnosis.final))
    _write_predictions(diagnosis, place, "before", before)
    _write_predictions(diagnosis, place, "after", after)
    findings = findings_of(diagnosis, judgement.chosen, split=True)
    alternatives = [
        {"findings": findings_of(diagnosis, item, split=False), "probability": item.probability}
        for item in judgement.alternatives
    ]
    where = where_of(diagnosis)
    content = {
        "schema": SCHEMA,
        "machine": opened.name,
        "recordings": [recording.name for recording in plant.recordings],
        "verdict": judgement.verdict,
        "reason": judgement.reason,
        "mismatch": {
            "detected": judgement.verdict != "consistent",
            "p_value": judgement.p_value,
            "channels": channel_errors(plant, before),
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
            "before": _errors(diagnosis, before),
            "after": _errors(diagnosis, after),
            "noise_K": noise_level(plant),
            "heldout": diagnosis.heldout,
            "heldout_s": [
                [list(ends) for ends in stretches(~use, recording.times)]
                for recording, use in zip(plant.recordings, plant.use, strict=True)
            ],
            "channels_after": channel_errors(plant, after),
        },
        "improved_model": "improved_machine.toml",
        "machine_parameters": _machine_parameters(diagnosis),
        "slow_error": {"sigma_K": diagnosis.final.slow.sigma, "time_s": diagnosis.final.slow.time},
        "candidates_tried": diagnosis.candidates_tried,
        "hypotheses_fitted": len(diagnosis.hypotheses),
        "seconds": dict(diagnosis.seconds),
        "notes": [*opened.notes, *dict.fromkeys(note for drive in plant.drives for note in drive.notes)],
        "defects": [recording.defects.to_json() for recording in plant.recordings],
        "versions": package_versions(),
    }
    replace_text(place / "improved_machine.toml", improved_machine(diagnosis, opened))
    rows = states_of(findings)
    if rows:
        with (place / "states.csv").open("w", newline="", encoding="utf-8") as stream:
            columns = (
                (*STATE_COLUMNS, "recording") if any("recording" in row for row in rows) else STATE_COLUMNS
            )
            writer = csv.DictWriter(stream, columns, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    if report:
        from spindle_fem.report.diagnosis_data import diagnosis_dataset

        diagnosis_dataset(diagnosis, before, after).to_netcdf(place / "diagnosis.nc")
    return content


def _write_predictions(diagnosis: Diagnosis, place: Path, name: str, predicted: Sequence[np.ndarray]) -> None:
    """What every channel should read beside what it read, a file a recording."""
    recordings = diagnosis.plant.recordings
    for number, recording in enumerate(recordings):
        label = f"_{number + 1}" if len(recordings) > 1 else ""
        write_simulated(place / f"{name}{label}.csv", recording, predicted[number])


def _errors(diagnosis: Diagnosis, predicted: Sequence[np.ndarray]) -> dict[str, float]:
    return {
        "train_rmse_K": rmse(diagnosis.plant, predicted, heldout=False),
        "heldout_rmse_K": rmse(diagnosis.plant, predicted, heldout=True),
    }


def _machine_parameters(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The machine's own parameters before and after."""
    rows = []
    for coordinate in diagnosis.plant_coordinates:
        low, high = diagnosis.final.interval(coordinate.name, 1.645)
        rows.append(
            {
                "name": coordinate.name,
                "prior": coordinate.value,
                "prior_sigma": coordinate.sigma,
                "logarithmic": coordinate.logarithmic,
                "value": diagnosis.final.values[coordinate.name],
                "low": low,
                "high": high,
                "unit": coordinate.unit,
            }
        )
    return rows


def _unexplained(opened: DiagnosedMachine, reason: str) -> dict[str, Any]:
    """A recording that is sound but says too little."""
    channels = [
        {"channel": name, "rmse_K": None, "noise_K": float(sigma), "max_K": None}
        for recording in opened.recordings
        for name, sigma in zip(recording.temperature_names, recording.sigma, strict=True)
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


def _plain(value: Any) -> Any:
    """Numbers as JSON knows them; what is not finite becomes null."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (np.floating, float)):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, np.bool_):
        return bool(value)
    return value
