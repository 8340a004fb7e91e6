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
from spindle_fem.report.table_rows import fixed, number, rounded, significant, table_of, whole, words
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
        Section("summary", "Summary", [Cards(_cards(content)), *_tables(content)]),
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
    fields = (
        words("channel", "channel"),
        whole("readings", "readings"),
        fixed("error / K", "rmse_K", 3),
        fixed("mean / K", "mean_K", 3),
        fixed("largest / K", "max_K", 3),
        fixed("noise / K", "noise_K", 3),
        fixed("90 % interval ± / K", "interval_half_width_K", 2),
        fixed("inside / %", _inside_percent, 0),
    )
    return table_of(
        fields, content["channels"], "Read minus predicted, as in the pictures; error: root mean square."
    )


def _tables(content: Mapping[str, Any]) -> list[Table]:
    """Errors by channel; displacements and preload where there are any."""
    found = [_channel_table(content)]
    if grown := content.get("displacements"):
        fields = (
            words("displacement", "channel"),
            fixed("error / µm", "rmse_um", 2),
            fixed("largest / µm", "max_um", 2),
        )
        found.append(table_of(fields, grown, "Read minus predicted, both from the first reading."))
    if preload := content.get("preload_N"):
        fields = (
            words("bearing", lambda item: item[0]),
            *(
                fixed(f"{words_} / N", lambda item, key=key: item[1][key], 0)
                for key, words_ in (("least", "least"), ("most", "most"), ("last", "at the end"))
            ),
        )
        found.append(
            table_of(fields, preload.items(), "Preload along the recording: it follows the temperatures.")
        )
    return found


def _inside_percent(item: Mapping[str, Any]) -> float | None:
    share = item["inside_90_percent_interval"]
    return None if share is None else 100.0 * share


def _condition_table(content: Mapping[str, Any]) -> Table:
    """Error of every channel in every condition."""
    found: dict[str, dict[str, float | None]] = {}
    for item in content["conditions"]:
        found.setdefault(item["condition"], {})[item["channel"]] = item["rmse_K"]
    fields = (
        words("condition", lambda row: row[0]),
        *(
            fixed(f"{name} / K", lambda row, name=name: row[1].get(name), 3)
            for name in (item["channel"] for item in content["channels"])
        ),
    )
    return table_of(fields, found.items(), "Root mean square of read minus predicted.")


def _picture(folder: Path, name: str) -> Any:
    stem = Path(name).stem
    if stem.startswith("displacement_"):
        shown = stem.removeprefix("displacement_").replace("_", " ")
        caption = f"{shown}: read and predicted displacement; below, read minus predicted."
        return illustration_of(folder / name, caption)
    title = Path(name).stem.removeprefix("residual_").replace("_", " ")
    return illustration_of(
        folder / name,
        f"{title}: read and predicted; below, read minus predicted, and the 90 % interval of a reading.",
    )


def _calibration_blocks(calibration: Mapping[str, Any]) -> list[Any]:
    fields = (
        words("parameter", "name"),
        rounded("before", "prior", 4),
        rounded("calibrated", "value", 4),
        rounded("low", "low", 4),
        rounded("high", "high", 4),
        words("unit", "unit"),
        fixed("factor", "factor", 3),
        fixed("width over prior's", lambda item: item["sigma_log"] / item["prior_sigma_log"], 2),
    )
    slow = calibration["slow_error"]
    sentences = [
        f"Slow error of the readings and of the model: {number(slow['sigma_K'], 3)} K over "
        f"{number(slow['time_s'], 0)} s; whitened squares {number(calibration['chi_square_per_value'], 2)} a "
        f"value, {number(100.0 * calibration['outlier_share'], 1)} % beyond the robust limit."
    ]
    sentences += [
        f"The data cannot tell {first} from {second} (correlation {number(value, 2)})."
        for first, second, value in calibration["cannot_tell_apart"]
    ]
    if calibration["not_learned"]:
        sentences.append(
            f"The data say no more than the prior about: {', '.join(calibration['not_learned'])}."
        )
    table = table_of(fields, calibration["parameters"], "Low and high: 90 % interval.")
    return [table, *(Text(text) for text in sentences)]


def _model_notes(model: Mapping[str, Any]) -> list[str]:
    if not model:
        return []
    return [
        f"{model['basis']} fields in place of {model['full_unknowns']} temperatures ({model['mesh_preset']} "
        f"mesh), checked against the full model to {significant(model['checked_error_K']['probes'], 2)} K at "
        "the probes"
    ]
