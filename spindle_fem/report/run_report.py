"""The self-contained report of a finished run, from its other files."""

from __future__ import annotations

import json
import resource
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spindle_fem.errors import BadInputError
from spindle_fem.report import run_tables as tables
from spindle_fem.report.block_page import Illustration, illustration_of
from spindle_fem.report.definition_tables import input_groups
from spindle_fem.report.page_templates import render_page
from spindle_fem.results.output_folder import replace_text, require_complete
from spindle_fem.results.run_summary import SUMMARY_SCHEMA

if TYPE_CHECKING:
    import xarray as xr

FIGURE_FOLDER = "figures"

OVER_SPEED = "over_speed_"
CAPTIONS = {
    f"{OVER_SPEED}heat_terms": "Friction heat over speed, stacked by term.",
    f"{OVER_SPEED}heat_models": "The same bearings by every heat model: the spread a designer should expect.",
    f"{OVER_SPEED}film_thickness": (
        "Central film: flooded and isothermal (dashed), and as it is at this run's temperatures."
    ),
    f"{OVER_SPEED}film_ratio": "Film thickness over composite roughness; from 3 on the film carries alone.",
    f"{OVER_SPEED}thrust": "Axial load and displacement of the set that carries the thrust.",
    f"{OVER_SPEED}contacts": "Deformation, contact angle and ellipse: inner contact solid, outer dashed.",
    f"{OVER_SPEED}ball_speeds": "Orbit and spin of the balls, centrifugal force and gyroscopic moment.",
    "machine_definition": (
        "The machine as defined: parts by colour, contact lines of the bearings in red, oil in yellow, "
        "surfaces with a film as thick lines, probes as dots."
    ),
    "temperature_cut": "The machine cut open along the vertical plane through its axis.",
    "meridian_temperature": "Temperature in the vertical plane through the axis, dimensions in mm.",
    "axial_profiles": "Temperature along the machine on its main surfaces.",
    "radial_profiles": "Temperature from the bore to the outside through each bearing; steps are joints.",
    "heat_by_bearing": "Friction heat of each bearing by its terms, and the bodies that it enters.",
    "coolant": "Oil along the channel: temperatures, and the film coefficient with its low and high value.",
    "channel_walls": "Walls of the channel, seen without the housing.",
    "heat_balance": "Where the heat comes from and where it goes.",
    "mesh": "The mesh, opened along the vertical plane; colours are parts.",
}

_LIMITS = (
    "Steady state of one operating point; loads, speed and surroundings constant.",
    "Turning parts have one temperature all round in the time mean; standing parts are three-dimensional.",
    "Joints have the constant conductance of the definition, the least certain input of such a model; "
    "seats that close or open with temperature are not followed unless the definition says so.",
    "The balls of a bearing are one body with one temperature; they meet the races through the contact "
    "resistances of the definition.",
    "The film coefficient of the channel is a correlation; its low and high value show what the sources "
    "leave open. Pipes, filter and pump outside the machine are not part of the pressure drop.",
    "Heat of seals, drive, churning and cutting is included only where the definition names it.",
)


def rebuild_report(folder: str | Path) -> Path:
    """Write ``report.html`` of a finished run again, from its other files.

    Parameters
    ----------
    folder : str or Path
        With ``summary.json``, ``result.nc`` and ``figures``.

    Returns
    -------
    Path
        Of the report.

    Raises
    ------
    BadInputError
        The folder is missing or incomplete, or a file is missing or unknown.
    """
    from spindle_fem.report.interactive_view import SURFACE_GROUP
    from spindle_fem.results.dataset import read_dataset

    folder = require_complete(folder)
    summary = read_summary(folder / "summary.json")
    dataset = read_dataset(folder / "result.nc")
    surface = read_dataset(folder / "result.nc", group=SURFACE_GROUP)
    html = render_run_report(summary, dataset, surface, embedded_figures(folder / FIGURE_FOLDER))
    return replace_text(folder / "report.html", html)


def read_summary(path: Path) -> dict[str, Any]:
    """Content of ``summary.json``.

    Raises
    ------
    BadInputError
        No such file, no JSON, or another schema.
    """
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInputError(
            str(path), f"cannot be read ({error.strerror}).", "Give the folder of a run."
        ) from error
    except json.JSONDecodeError as error:
        raise BadInputError(
            str(path), f"is not valid JSON: {error}.", "Run again to write it anew."
        ) from error
    schema = summary.get("schema") if isinstance(summary, dict) else None
    if schema != SUMMARY_SCHEMA:
        raise BadInputError(str(path), f"schema is {schema!r}.", f'Known: "{SUMMARY_SCHEMA}".')
    return summary


def render_run_report(
    summary: Mapping[str, Any],
    dataset: xr.Dataset,
    surface: xr.Dataset | None,
    illustrations: Mapping[str, Illustration | None],
) -> str:
    """HTML of a run; everything it needs is inside."""
    from spindle_fem.report.interactive_view import viewer_payload

    definition = tomllib.loads(dataset.attrs["machine_definition_toml"])
    view = None if surface is None else json.dumps(viewer_payload(surface)).replace("</", "<\\/")
    failed = [item["name"] for item in summary.get("checks", ()) if not item["passed"]]
    has_bearings, coolant = bool(summary["bearings"]), tables.coolant_table(summary)
    over_speed = any(drawn and name.startswith(OVER_SPEED) for name, drawn in illustrations.items())
    sections = [
        ("headline", "Headline numbers", True),
        ("answers", "What this answers", True),
        ("temperature", "Temperature field", True),
        ("bearings", "Bearings", has_bearings),
        ("over_speed", "Bearings over speed", over_speed),
        ("coolant", "Coolant", coolant is not None),
        ("balance", "Energy balance", True),
        ("probes", "Probes, joints and surfaces", True),
        ("checks", "Checks", True),
        ("inputs", "Inputs", True),
        ("limits", "Limits of validity", True),
        ("versions", "Versions", True),
    ]
    return render_page(
        "run.html.j2",
        kind="Thermal run",
        title=dataset.attrs["title"],
        subtitle=_subtitle(definition),
        sections=[{"id": key, "title": title} for key, title, shown in sections if shown],
        headline=tables.headline(summary),
        warnings=summary["warnings"],
        failed_checks=failed,
        imbalance=tables.significant(abs(summary["energy"]["imbalance_relative"]), 2),
        figures=illustrations,
        over_speed_captions=tuple(name for name in CAPTIONS if name.startswith(OVER_SPEED)),
        view3d=view,
        bearings=tables.bearing_table(summary),
        terms=tables.term_table(summary),
        coolant=coolant,
        balance=tables.balance_table(summary),
        probes=tables.probe_table(summary),
        joints=tables.joint_table(summary),
        surfaces=tables.surface_table(dataset),
        checks=tables.check_table(summary),
        mesh=tables.mesh_table(summary),
        inputs=input_groups(definition, dataset.attrs.get("machine_defaults", "").split("\n")),
        limits=_LIMITS,
        versions=tables.version_table(summary, dataset.attrs),
        sources=[line for line in str(dataset.attrs.get("sources", "")).split("\n") if line],
    )


def embedded_figures(folder: Path) -> dict[str, Illustration | None]:
    """Figures of a folder for the page, by name; None for one that a run has and this one lacks."""
    return in_order(
        {path.stem: illustration_of(path, caption_of(path.stem)) for path in folder.glob("*.png")}
    )


def in_order(drawn: Mapping[str, Illustration]) -> dict[str, Illustration | None]:
    """Illustrations in the order of the captions, others by name after them; None for those that lack."""
    return {**dict.fromkeys(CAPTIONS), **{name: drawn[name] for name in sorted(drawn)}}


def caption_of(stem: str) -> str:
    """Caption of a figure by the name of its file."""
    if stem in CAPTIONS:
        return CAPTIONS[stem]
    kind, _, name = stem.partition("_")
    if kind == "bearings" and name:
        return f"Bearing set {name}: where its heat goes, and the temperatures of races and balls."
    return stem.replace("_", " ").capitalize() + "."


def peak_memory_MB() -> float:  # noqa: N802 - the unit belongs to the name
    """Largest resident memory of this process so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024.0**2 if sys.platform == "darwin" else 1024.0)


def _subtitle(definition: Mapping[str, Any]) -> str:
    from spindle_fem.report.definition_tables import customary

    operation = definition["operation"]
    parts = [customary(operation["speed"]), f"thrust {customary(operation['thrust'])}"]
    parts.append(f"ambient {customary(operation['ambient_temperature'])}")
    coolant = definition.get("coolant")
    if coolant:
        parts.append(f"coolant {customary(coolant['flow'])} at {customary(coolant['inlet_temperature'])}")
    parts.append(f"heat model “{definition['heat']['model']}”")
    return ", ".join(parts) + "."
