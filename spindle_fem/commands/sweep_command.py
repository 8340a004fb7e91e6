"""The function behind ``spindle-fem sweep``."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from spindle_fem.commands.console import designs_done
from spindle_fem.definition.load import write_machine
from spindle_fem.report.sweep_report import BEST_PICTURE, FIGURE_FOLDER, write_sweep_report
from spindle_fem.results.output_folder import output_folder, replace_text
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.studies.shipped_files import find_study
from spindle_fem.studies.sweep.evaluate_design import DesignTask, solve_task
from spindle_fem.studies.sweep.file_names import MACHINE_FILE, STUDY_FILE, SUMMARY_FILE
from spindle_fem.studies.sweep.prepared_study import prepare_study
from spindle_fem.studies.sweep.results_table import ResultTable
from spindle_fem.studies.sweep.study_lock import folder_lock
from spindle_fem.studies.sweep.sweep_study import require_own_table, solve_study
from spindle_fem.studies.sweep.sweep_summary import summarise


def sweep_machine(
    machine: str | Path,
    study: str | Path,
    folder: str | Path,
    overrides: Iterable[str] = (),
    jobs: int = 1,
    scheduler: str | None = None,
    progress: bool = False,
) -> dict[str, Any]:
    """Solve every design of a study and report the results.

    A study that was stopped resumes where it ended; rows that are in the
    folder's table already are not solved again.

    Parameters
    ----------
    machine : str or Path
        A definition file, or the name of a machine that ships.
    study : str or Path
        A study file, or the name of one that ships.
    folder : str or Path
        Gets ``results.csv``, ``results.parquet``, ``sweep.json``, ``figures``,
        ``report.html``, and the machine and study that made them.
    overrides : iterable of str
        ``path=value`` texts for the machine, under those of the designs.
    jobs : int
        Worker processes; below 1 for one a core. The results do not depend on it.
    scheduler : str, optional
        Address of a Dask scheduler, in place of ``jobs``.
    progress : bool
        Show rows done and time left on the terminal.

    Returns
    -------
    dict
        The content of ``sweep.json``.

    Raises
    ------
    SpindleFemError
        Bad input, before anything runs; or a cluster that fails. A design
        that fails is a row.
    """
    started, study = time.perf_counter(), find_study(study)
    prepared = prepare_study(machine, study, overrides)
    require_own_table(Path(folder), prepared.columns)
    with (
        folder_lock(folder),
        output_folder(folder) as place,
        designs_done(progress, prepared.size) as tell,
    ):
        replace_text(place / MACHINE_FILE, write_machine(prepared.spec))
        replace_text(place / STUDY_FILE, study.read_text(encoding="utf-8"))
        table = ResultTable(place, prepared.columns)
        before = set(table.rows)
        tasks, rows = solve_study(prepared, table, tell, jobs=jobs, scheduler=scheduler)
        reused = len({task.key for task in tasks} & before)
        summary = summarise(prepared, rows, reused=reused)
        results = _pictured(place, summary, tasks, solved_now=len(table.rows) > len(before))
        summary["wall_time_s"] = time.perf_counter() - started
        replace_text(
            place / SUMMARY_FILE, json.dumps(summary, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        )
        write_sweep_report(place, summary, rows, prepared.spec, results)
    return summary


def _pictured(
    place: Path, summary: Mapping[str, Any], tasks: Sequence[DesignTask], *, solved_now: bool
) -> dict[int, ThermalResult]:
    """Fields of the designs to picture; none if the folder has their picture already."""
    picture = place / FIGURE_FOLDER / BEST_PICTURE
    old = place / SUMMARY_FILE
    if not solved_now and picture.is_file() and old.is_file():
        with contextlib.suppress(ValueError, AttributeError, RecursionError):
            if json.loads(old.read_text(encoding="utf-8")).get("pictured") == summary["pictured"]:
                return {}
    return {number: solve_task(tasks[number - 1]) for number in summary["pictured"]}
