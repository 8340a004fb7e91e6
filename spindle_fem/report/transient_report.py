"""Charts and report of a transient study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from spindle_fem.report.block_page import Cards, Section, Table, Text, illustration_of, render_document
from spindle_fem.report.figure_style import save_png
from spindle_fem.report.table_rows import (
    YES_OR_NO,
    fixed,
    number,
    rounded,
    significant,
    table_of,
    whole,
    words,
)
from spindle_fem.report.transient_charts import (
    bearing_history,
    growth_history,
    heat_history,
    probe_history,
    step_history,
)
from spindle_fem.results.output_folder import read_content, replace_text
from spindle_fem.studies.transient_study import StudyResult
from spindle_fem.studies.transient_summary import SCHEMA

# Every figure in the order of the page.
CAPTIONS = {
    "probes": "Every probe, and the speed; dotted, where the last phase tends to.",
    "bearings": "Raceway means of every bearing and how much hotter the inner ring is.",
    "heat": "Friction heat follows speed and grease temperature; "
    "the difference to the coolant is stored or lost to the air.",
    "growth": "How far the nose has moved since assembly, and what displacement sensors read.",
    "steps": "Steps grow as the temperatures come to rest; the dashed line is the error asked for.",
}


def write_transient_figures(summary: Mapping[str, Any], result: StudyResult, folder: Path) -> None:
    """Write ``figures/*.png`` of a transient study.

    Parameters
    ----------
    summary : mapping
        Of ``transient.json``.
    folder : Path
        An existing folder.
    """
    figures = {
        "probes": probe_history(result, summary["equilibrium"].get("steady_degC")),
        "bearings": bearing_history(result),
        "heat": heat_history(result),
        "growth": growth_history(result),
        "steps": step_history(result),
    }
    place = folder / "figures"
    place.mkdir(exist_ok=True)
    for name, figure in figures.items():
        (place / f"{name}.png").unlink(missing_ok=True)  # of an earlier run, with bearings
        if figure is not None:
            save_png(figure, place / f"{name}.png")


def write_transient_report(folder: Path) -> Path:
    """Write ``report.html`` of a folder that holds ``transient.json`` and ``figures``.

    Raises
    ------
    BadInputError
        The file is missing or of a version that this program does not know.
    """
    summary = read_content(folder / "transient.json", SCHEMA, "transient")
    drawn = {name: folder / "figures" / f"{name}.png" for name in CAPTIONS}
    pictures = [illustration_of(path, CAPTIONS[name]) for name, path in drawn.items() if path.is_file()]
    return replace_text(folder / "report.html", _report(summary, pictures))


def _report(summary: Mapping[str, Any], pictures: Sequence[Any]) -> str:
    phases, equilibrium = summary["phases"], summary["equilibrium"]
    total = phases[-1]["end_s"] - phases[0]["start_s"]
    worst = max(phase["energy"]["imbalance_relative"] for phase in phases)
    cards = [
        {"value": f"{number(total / 3600.0, 2)} h", "name": "simulated"},
        {"value": f"{number(phases[-1]['hottest_degC'])} °C", "name": "hottest place at the end"},
        {"value": significant(worst, 2), "name": "relative imbalance of the heat"},
        {"value": str(sum(phase["steps"] for phase in phases)), "name": "time steps"},
    ]
    sections = [
        Section("summary", "Summary", [Cards(cards), Text(equilibrium_text(equilibrium))]),
        Section("course", "Course", pictures),
        Section("phases", "Phases", [_phase_table(phases), _energy_table(phases)]),
    ]
    subtitle = f"{summary['machine']}, {summary['mesh_preset']} mesh, {summary['unknowns']} temperatures"
    return render_document("Transient", summary["study"], sections, subtitle)


def equilibrium_text(equilibrium: dict[str, Any]) -> str:
    """Approach of a transient to the steady state of its last phase, in words."""
    if equilibrium["exists"] is None:
        return f"The steady state of the last phase is not known: {equilibrium['reason']}"
    if not equilibrium["exists"]:
        return f"The last phase tends to no steady state: {equilibrium['reason']}"

    def hours(value: float | None) -> str:
        return "not within this run" if value is None else f"after {value / 3600.0:.2f} h"

    shares, bands = equilibrium["shares_s"], equilibrium["bands_s"]
    return (
        f"At the end the probes are within {equilibrium['left_K']:.2f} K of the steady state of the last "
        f"phase. Counted from its start, every probe has gone 95 % of the way: {hours(shares['0.95'])}; "
        f"99 %: {hours(shares['0.99'])}. All probes stay within 0.5 K: {hours(bands['0.5'])}; "
        f"within 0.1 K: {hours(bands['0.1'])}."
    )


def _phase_table(phases: list[dict[str, Any]]) -> Table:
    fields = (
        words("phase", "name"),
        fixed("h", lambda phase: (phase["end_s"] - phase["start_s"]) / 3600.0, 2),
        whole("settled", lambda phase: YES_OR_NO[phase["settled"]]),
        fixed("heat W", "heat_W"),
        fixed("hottest °C", "hottest_degC", 2),
        *(
            fixed(name, lambda phase, name=name: phase["probes_degC"][name], 2)
            for name in phases[0]["probes_degC"]
        ),
    )
    return table_of(fields, phases, "At the end of each phase; probes in °C.")


def _energy_table(phases: list[dict[str, Any]]) -> Table:
    fields = (
        words("phase", "name"),
        fixed("heat in", lambda phase: phase["energy"]["heat_in_J"] / 1.0e3),
        fixed("stored", lambda phase: phase["energy"]["stored_J"] / 1.0e3),
        *(
            fixed(name, lambda phase, name=name: phase["energy"]["heat_out_J"][name] / 1.0e3)
            for name in phases[0]["energy"]["heat_out_J"]
        ),
        rounded("imbalance", lambda phase: phase["energy"]["imbalance_relative"], 2),
    )
    return table_of(fields, phases, "Heat in kJ; the imbalance relative to the heat moved.")
