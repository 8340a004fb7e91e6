"""The function behind ``spindle-fem report``."""

from __future__ import annotations

from pathlib import Path

from spindle_fem.results.output_folder import require_complete


def rebuild(folder: Path) -> Path:
    """Rebuild the report of an output folder, of whichever command, from its files.

    Raises
    ------
    BadInputError
        The folder holds no results, or is marked incomplete.
    """
    place = require_complete(folder)
    if (place / "crosscheck.json").is_file():
        from spindle_fem.report.crosscheck_report import write_crosscheck_report

        return write_crosscheck_report(place)
    if (place / "diagnosis.json").is_file():
        from spindle_fem.report.diagnosis_report import write_diagnosis_report

        return write_diagnosis_report(place)
    if (place / "diagnoses.json").is_file():
        from spindle_fem.report.diagnoses_report import write_diagnoses_report

        return write_diagnoses_report(place)
    if (place / "plan.json").is_file():
        from spindle_fem.report.plan_report import write_plan_report

        return write_plan_report(place)
    if (place / "simulation.json").is_file():
        from spindle_fem.report.simulation_report import write_simulation_report

        return write_simulation_report(place)
    if (place / "sweep.json").is_file():
        from spindle_fem.report.sweep_report import rebuild_sweep_report

        return rebuild_sweep_report(place)
    from spindle_fem.report.run_report import rebuild_report

    return rebuild_report(place)
