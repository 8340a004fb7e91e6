"""The report of a simulated recording, from the files of its folder alone."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spindle_fem.report.block_page import (
    Bullets,
    Cards,
    Section,
    Table,
    Text,
    illustration_of,
    render_document,
)
from spindle_fem.report.run_tables import column, number, rows_of, significant
from spindle_fem.results.output_folder import replace_text


def write_simulation_report(folder: Path) -> Path:
    """Write ``report.html`` of a folder that ``simulate`` filled.

    Parameters
    ----------
    folder : Path
        With ``simulation.json`` and the figures that it names.

    Returns
    -------
    Path
        The page.
    """
    content = json.loads((folder / "simulation.json").read_text(encoding="utf-8"))
    calibration = content["calibration"]
    sections = [
        Section("summary", "Summary", [Cards(_cards(content)), _channel_table(content)]),
        Section("course", "Course", [_picture(folder, name) for name in content["figures"]]),
        Section("conditions", "Errors by operating condition", [_condition_table(content)]),
    ]
    if calibration is not None:
        sections.append(Section("calibration", "Calibration", _calibration_blocks(calibration)))
    sections.append(
        Section("recording", "What was found in the recording", [Bullets(content["defects_text"])])
    )
    notes = [*content["notes"], *_model_notes(content["reduced_model"])]
    if notes:
        sections.append(Section("notes", "How it was simulated", [Bullets(notes)]))
    target = folder / "report.html"
    replace_text(target, render_document("Simulation", content["recording"], sections, content["machine"]))
    return target


def _cards(content: Mapping[str, Any]) -> list[dict[str, str]]:
    read = [item for item in content["channels"] if item["rmse_K"] is not None]
    if not read:
        return [{"value": "0", "name": "readings in use"}]
    worst = max(read, key=lambda item: item["rmse_K"] / item["noise_K"])
    readings = sum(item["readings"] for item in read)
    inside = sum(item["readings"] * item["inside_90_percent_interval"] for item in read) / readings
    return [
        {
            "value": f"{number(worst['rmse_K'], 2)} K",
            "name": f"error of {worst['channel']}, the worst for its noise",
        },
        {"value": number(worst["rmse_K"] / worst["noise_K"], 1), "name": "times its noise"},
        {"value": f"{number(100.0 * inside, 0)} %", "name": "of the readings inside their 90 % interval"},
        {"value": str(readings), "name": "readings in use"},
    ]


def _channel_table(content: Mapping[str, Any]) -> Table:
    rows = [
        [
            item["channel"],
            str(item["readings"]),
            *(number(item[key], 3) for key in ("rmse_K", "mean_K", "max_K", "noise_K")),
            number(item["interval_half_width_K"], 2),
            number(100.0 * item["inside_90_percent_interval"], 0),
        ]
        for item in content["channels"]
    ]
    columns = (
        column("channel"),
        *(
            column(title, number=True)
            for title in (
                "readings",
                "error / K",
                "mean / K",
                "largest / K",
                "noise / K",
                "90 % interval ± / K",
                "inside / %",
            )
        ),
    )
    return Table(columns, rows_of(rows), "Predicted less read; error: root mean square.")


def _condition_table(content: Mapping[str, Any]) -> Table:
    """Error of every channel in every condition."""
    channels = [item["channel"] for item in content["channels"]]
    found = {(item["condition"], item["channel"]): item["rmse_K"] for item in content["conditions"]}
    rows = [
        [name, *(number(found.get((name, channel)), 3) for channel in channels)]
        for name in dict.fromkeys(condition for condition, _ in found)
    ]
    columns = (column("condition"), *(column(f"{name} / K", number=True) for name in channels))
    return Table(columns, rows_of(rows), "Root mean square of predicted less read.")


def _picture(folder: Path, name: str) -> Any:
    title = Path(name).stem.removeprefix("residual_").replace("_", " ")
    return illustration_of(
        folder / name,
        f"{title}: read and predicted; below, read less predicted, and the 90 % interval of a reading.",
    )


def _calibration_blocks(calibration: Mapping[str, Any]) -> list[Any]:
    rows = [
        [
            item["name"],
            *(significant(item[key], 4) for key in ("prior", "value", "low", "high")),
            item["unit"],
            number(item["factor"], 3),
            number(item["sigma_log"] / item["prior_sigma_log"], 2),
        ]
        for item in calibration["parameters"]
    ]
    columns = (
        column("parameter"),
        *(column(title, number=True) for title in ("before", "calibrated", "low", "high")),
        column("unit"),
        *(column(title, number=True) for title in ("factor", "width over prior's")),
    )
    slow = calibration["slow_error"]
    words = [
        f"Slow error of the readings and of the model: {number(slow['sigma_K'], 3)} K over "
        f"{number(slow['time_s'], 0)} s; whitened squares {number(calibration['chi_square_per_value'], 2)} a "
        f"value, {number(100.0 * calibration['outlier_share'], 1)} % beyond the robust limit."
    ]
    words += [
        f"The data cannot tell {first} from {second} (correlation {number(value, 2)})."
        for first, second, value in calibration["cannot_tell_apart"]
    ]
    if calibration["not_learned"]:
        words.append(f"The data say no more than the prior about: {', '.join(calibration['not_learned'])}.")
    table = Table(columns, rows_of(rows), "Low and high: 90 % interval.")
    return [table, *(Text(text) for text in words)]


def _model_notes(model: Mapping[str, Any]) -> list[str]:
    if not model:
        return []
    return [
        f"{model['basis']} fields in place of {model['full_unknowns']} temperatures ({model['mesh_preset']} "
        f"mesh), checked against the full model to {significant(model['checked_error_K']['probes'], 2)} K at "
        "the probes"
    ]
