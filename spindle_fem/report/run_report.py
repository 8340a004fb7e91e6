"""The self-contained report of a finished run, from its other files."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from spindle_fem.report import run_tables as tables
from spindle_fem.report.block_page import (
    Bullets,
    Cards,
    Columns,
    Heading,
    Illustration,
    Interactive,
    Notice,
    Section,
    Table,
    Text,
    Warnings,
    illustration_of,
    render_document,
)
from spindle_fem.report.definition_tables import input_groups
from spindle_fem.report.run_figures import CAPTIONS, FIGURE_FOLDER, OVER_SPEED, caption_of, in_order
from spindle_fem.results.output_folder import read_content, replace_text, require_complete
from spindle_fem.results.run_summary import SUMMARY_SCHEMA
from spindle_fem.validity import CHANGES_RESULT

if TYPE_CHECKING:
    import xarray as xr

_ANSWERS = (
    Text(
        "The steady temperature of the whole machine at one speed, thrust, room and coolant: where it is "
        "hottest, how much warmer the inner rings are than the outer ones, how much of the bearings’ heat "
        "the coolant takes and how much leaves by other ways, what the probes should read, and what the "
        "channel costs in pressure."
    ),
    Text(
        Markup(
            "It does not answer how the machine warms up (that is <code>spindle-fem transient</code>) "
            "or how long grease and bearings last."
        )
    ),
)
_OVER_SPEED_TEXT = Text(
    "Contact mechanics, films and friction of every bearing at the temperatures of this run; dashed films "
    "are flooded and isothermal at 40 °C."
)
_MARKS_TEXT = Text(
    Markup(
        "Everything that went in, with the mark of its source: <strong>P</strong> paper, <strong>C</strong> "
        "catalogue, <strong>A</strong> assumed, <strong>U</strong> given without a source; no mark: a "
        "default of the program. “± 30 %” is one standard deviation of the logarithm."
    )
)
_LIMITS = (
    "Steady state of one operating point; loads, speed and surroundings constant.",
    "Rotating parts have one temperature around the axis, the mean over a turn; "
    "stationary parts are three-dimensional.",
    "Joints have the constant conductance of the definition, the least certain input of such a model; "
    "seats that close or open with temperature are not followed unless the definition says so.",
    "The balls or rollers of a bearing are one body with one temperature; they meet the races through the "
    "contact resistances of the definition.",
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
    summary = read_content(folder / "summary.json", SUMMARY_SCHEMA, "run")
    dataset = read_dataset(folder / "result.nc")
    surface = read_dataset(folder / "result.nc", group=SURFACE_GROUP)
    html = render_run_report(summary, dataset, surface, embedded_figures(folder / FIGURE_FOLDER))
    return replace_text(folder / "report.html", html)


def render_run_report(
    summary: Mapping[str, Any],
    dataset: xr.Dataset,
    surface: xr.Dataset | None,
    illustrations: Mapping[str, Illustration | None],
) -> str:
    """HTML of a run; everything it needs is inside."""
    definition = tomllib.loads(dataset.attrs["machine_definition_toml"])
    sections = [
        Section("headline", "Headline numbers", _headline(summary)),
        Section("answers", "What this answers", [*_ANSWERS, *_drawn(illustrations, "machine_definition")]),
        Section("temperature", "Temperature field", _temperature(surface, illustrations)),
    ]
    if summary["bearings"]:
        sections.append(Section("bearings", "Bearings", _bearings(summary, illustrations)))
    over_speed = _drawn(illustrations, *(name for name in CAPTIONS if name.startswith(OVER_SPEED)))
    if over_speed:
        sections.append(Section("over_speed", "Bearings over speed", [_OVER_SPEED_TEXT, *over_speed]))
    if "growth" in summary:
        nose = tables.nose_table(summary)
        read = tables.displacement_table(summary)
        shown = [
            *_drawn(illustrations, "deformed_machine", "deformed_section"),
            tables.growth_table(summary, _fitted(definition)),
            *(table for table in (tables.spacer_table(summary), nose, read) if table.rows),
            *_equilibrium(summary),
        ]
        sections.append(Section("growth", "Growth and fits", shown))
    coolant = summary.get("coolant")
    if coolant:
        state = [Text(tables.regime_words(coolant)), tables.coolant_table(coolant)]
        pictures = _drawn(illustrations, "coolant", "channel_walls")
        sections.append(Section("coolant", "Coolant", [*state, *pictures]))
    if summary.get("circuits"):
        sections.append(Section("circuits", "Circuits beside the channel", [tables.circuit_table(summary)]))
    balance = tables.balance_table(summary)
    sections += [
        Section("balance", "Energy balance", [balance, *_drawn(illustrations, "heat_balance")]),
        Section("probes", "Probes, joints and surfaces", [_places(summary, dataset)]),
        Section("checks", "Checks", _checks(summary, illustrations)),
        Section("inputs", "Inputs", _inputs(definition, dataset)),
        Section("limits", "Limits of validity", [Bullets(_LIMITS)]),
        Section("versions", "Versions and provenance", _versions(summary, dataset)),
    ]
    return render_document("Thermal run", dataset.attrs["title"], sections, _subtitle(definition))


def _fitted(definition: Mapping[str, Any]) -> set[str]:
    """Bearings of sets with a fit."""
    sets = definition.get("bearing_set", ())
    return {bearing["name"] for group in sets if "fit" in group for bearing in group["bearing"]}


def _equilibrium(summary: Mapping[str, Any]) -> list[Any]:
    """Margin between the operating point and the end of its thermal equilibria."""
    found = summary.get("equilibrium")
    if found is None:
        return []
    name = max(found["preload_ratio"], key=found["preload_ratio"].get)
    said = (
        f"The preload of {name} is {found['preload_ratio'][name]:.2f} times that of assembly (the most); "
        f"expansion is {'' if found['followed'] else 'not '}followed."
    )
    if found["fold_speed_rpm"] is not None:
        said += (
            f" Above {found['fold_speed_rpm']:.0f} rpm heat and preload feed each other without end: no "
            "steady state exists there. Films and joints are those of this run, so that the speed is "
            "found a little low."
        )
    elif found["searched_to_rpm"] is not None:
        said += (
            f" Followed up to {found['searched_to_rpm']:.0f} rpm, heat and preload do not run away: there is "
            "a steady state at every speed from here to there."
        )
    return [Text(said), *([Bullets(found["limits"])] if found["limits"] else [])]


def _drawn(illustrations: Mapping[str, Illustration | None], *names: str) -> list[Illustration]:
    """The named pictures, as far as they were made."""
    found = (illustrations.get(name) for name in names)
    return [picture for picture in found if picture is not None]


def _headline(summary: Mapping[str, Any]) -> list[Any]:
    checks = summary.get("checks", ())
    failed = [item["name"] for item in checks if not item["passed"]]
    if failed:
        first = Notice("The numbers below must not be used.", "bad", f"Failed: {', '.join(failed)}.")
    elif changed := [item["text"] for item in summary["warnings"] if item["code"] in CHANGES_RESULT]:
        first = Notice(changed[0], "", "The machine would not behave as computed.")
    else:
        imbalance = tables.significant(abs(summary["energy"]["imbalance_relative"]), 2)
        to = imbalance if imbalance != "0" else "round-off"
        first = Notice(f"All {len(checks)} checks of this run passed; heat in and out agree to {to}.", "good")
    return [first, Cards(tables.headline(summary)), Warnings(summary["warnings"])]


def _temperature(surface: xr.Dataset | None, illustrations: Mapping[str, Illustration | None]) -> list[Any]:
    from spindle_fem.report.interactive_view import viewer_payload

    view = [] if surface is None else [Interactive("viewer.html.j2", "viewer.js", viewer_payload(surface))]
    names = ("temperature_cut", "meridian_temperature", "axial_profiles", "radial_profiles")
    return [*view, *_drawn(illustrations, *names)]


def _bearings(summary: Mapping[str, Any], illustrations: Mapping[str, Illustration | None]) -> list[Any]:
    close_ups = [name for name in illustrations if name.startswith("bearings_")]
    return [
        tables.bearing_table(summary),
        tables.term_table(summary),
        *_drawn(illustrations, "heat_by_bearing", *close_ups),
    ]


def _places(summary: Mapping[str, Any], dataset: xr.Dataset) -> Columns:
    probes, joints = tables.probe_table(summary), tables.joint_table(summary)
    left = [*([probes] if probes.rows else []), tables.surface_table(dataset)]
    return Columns([left, [joints] if joints.rows else []])


def _checks(summary: Mapping[str, Any], illustrations: Mapping[str, Illustration | None]) -> list[Any]:
    return [
        Text("A failed check ends a run with an error; this table shows by how much each one held."),
        tables.check_table(summary),
        tables.mesh_table(summary),
        *_drawn(illustrations, "mesh"),
    ]


def _inputs(definition: Mapping[str, Any], dataset: xr.Dataset) -> list[Any]:
    groups = input_groups(definition, dataset.attrs.get("machine_defaults", "").split("\n"))
    folded = [
        Table(group["columns"], group["rows"], folded=group["title"], open=group["open"]) for group in groups
    ]
    return [_MARKS_TEXT, *folded]


def _versions(summary: Mapping[str, Any], dataset: xr.Dataset) -> list[Any]:
    sources = [line for line in str(dataset.attrs.get("sources", "")).split("\n") if line]
    listed = [Heading("Sources of the models"), Bullets(sources)] if sources else []
    return [tables.version_table(summary, dataset.attrs), *listed]


def embedded_figures(folder: Path) -> dict[str, Illustration | None]:
    """Figures of a folder for the page, by name; None for one that a run has and this one lacks."""
    return in_order(
        {path.stem: illustration_of(path, caption_of(path.stem)) for path in folder.glob("*.png")}
    )


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
