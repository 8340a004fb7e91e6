"""The function behind ``spindle-fem report``."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from spindle_fem.errors import BadInputError
from spindle_fem.results.output_folder import reading_results, require_complete

# File that identifies a command's folder, and the function that writes its page again: module and name.
_WRITERS = {
    "crosscheck.json": ("crosscheck_report", "write_crosscheck_report"),
    "diagnosis.json": ("diagnosis_report", "write_diagnosis_report"),
    "diagnoses.json": ("diagnoses_report", "write_diagnoses_report"),
    "plan.json": ("plan_report", "write_plan_report"),
    "simulation.json": ("simulation_report", "write_simulation_report"),
    "sweep.json": ("sweep_report", "rebuild_sweep_report"),
    "transient.json": ("transient_report", "write_transient_report"),
    "heat.json": ("heat_report", "write_heat_report"),
    "summary.json": ("run_report", "rebuild_report"),
}


def rebuild(folder: Path) -> Path:
    """Rebuild the report of an output folder, of whichever command, from its files.

    Raises
    ------
    BadInputError
        The folder holds no results, or is marked incomplete.
    """
    place = require_complete(folder)
    for file, (module, write) in _WRITERS.items():
        if (place / file).is_file():
            with reading_results(place):
                return getattr(import_module(f"spindle_fem.report.{module}"), write)(place)
    raise BadInputError(
        str(folder),
        f"holds no results: none of {', '.join(_WRITERS)}.",
        "Give the folder of a finished command.",
    )
