"""A study from its files to its table and report: the function behind ``spindle-fem sweep``."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from spindle_fem.definition.load import (
    write_machine,
)
from spindle_fem.errors import BadInputError
from spindle_fem.report.sweep_report import BEST_PICTURE, FIGURE_FOLDER, write_sweep_report
from spindle_fem.results.output_folder import output_folder, replace_text
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.studies.sweep.designs import Design
from spindle_fem.studies.sweep.evaluate_design import DesignTask, solve_task
from spindle_fem.studies.sweep.file_names import MACHINE_FILE, STUDY_FILE, SUMMARY_FILE
from spindle_fem.studies.sweep.judge_designs import judged
from spindle_fem.studies.sweep.optimise import search_designs
from spindle_fem.studies.sweep.prepared_study import PreparedStudy, prepare_study
from spindle_fem.studies.sweep.results_table import RESULTS, ResultTable, Row
from spindle_fem.studies.sweep.run_tasks import run_tasks
from spindle_fem.studies.sweep.study_lock import folder_lock
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
    """Solve every design of a study and report what they say.

    A study that was stopped goes on where it ended; rows that are in the
    folder's table already are not solved again.

    Parameters
    ----------
    machine : str or Path
        A definition file, or the name of a machine that ships.
    study : str or Path
        A study file.
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
    started = time.perf_counter()
    prepared = prepare_study(machine, study, overrides)
    _require_own_table(Path(folder), prepared.columns)
    with (
        folder_lock(folder),
        output_folder(folder) as place,
        _progress(progress, prepared.size) as tell,
    ):
        replace_text(place / MACHINE_FILE, write_machine(prepared.spec))
        replace_text(place / STUDY_FILE, Path(study).read_text(encoding="utf-8"))
        table = ResultTable(place, prepared.columns)
        before = set(table.rows)
        tasks = list(prepared.tasks)

        def solve(batch: Sequence[DesignTask]) -> list[Row]:
            _solve_missing(batch, prepared, table, tell, jobs=jobs, scheduler=scheduler)
            return [
                table.rows[task.key] | head
                for task, head in zip(batch, _heads(table, batch, prepared), strict=True)
            ]

        rows = solve(tasks)
        if prepared.study.search is not None:

            def attempt(designs: Sequence[Design]) -> list[Row]:
                batch = [prepared.builder.task(design) for design in designs]
                tasks.extend(batch)
                return solve(batch)

            search_designs(prepared.study, prepared.axes, prepared.limits, rows, attempt)
        rows = table.finish(_heads(table, tasks, prepared))
        reused = len({task.key for task in tasks} & before)
        summary = summarise(prepared, rows, reused=reused)
        results = _pictured(place, summary, tasks, solved_now=len(table.rows) > len(before))
        summary["wall_time_s"] = time.perf_counter() - started
        replace_text(
            place / SUMMARY_FILE, json.dumps(summary, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        )
        write_sweep_report(place, summary, rows, prepared.spec, results)
    return summary


def _require_own_table(folder: Path, columns: Sequence[str]) -> None:
    """Refuse the folder of another study before it is touched."""
    path = folder / RESULTS
    if not path.is_file() or path.stat().st_size == 0:
        return
    with path.open(encoding="utf-8", newline="") as stream:
        heading = stream.readline()
    if heading.endswith("\n") and heading.strip() != ",".join(columns):
        raise BadInputError(
            str(path),
            "is the table of another study.",
            "Give a new folder, or the study that the folder belongs to.",
        )


def _solve_missing(
    tasks: Sequence[DesignTask],
    prepared: PreparedStudy,
    table: ResultTable,
    tell: Callable[[int], None],
    *,
    jobs: int,
    scheduler: str | None,
) -> None:
    """Solve the tasks that have no row yet, each machine once."""
    missing: dict[str, DesignTask] = {}
    for task in tasks:
        if task.key not in table:
            missing.setdefault(task.key, task)
    tell(len(tasks) - len(missing))

    def land(row: Row) -> None:
        table.append({**row, **judged(row, prepared.limits)})
        tell(1)

    run_tasks(
        list(missing.values()), prepared.question, land, plan=prepared.tasks, jobs=jobs, scheduler=scheduler
    )


def _pictured(
    place: Path, summary: Mapping[str, Any], tasks: Sequence[DesignTask], *, solved_now: bool
) -> dict[int, ThermalResult]:
    """Fields of the designs to picture; none where the folder has their picture already."""
    picture = place / FIGURE_FOLDER / BEST_PICTURE
    old = place / SUMMARY_FILE
    if not solved_now and picture.is_file() and old.is_file():
        with contextlib.suppress(ValueError):
            if json.loads(old.read_text(encoding="utf-8")).get("pictured") == summary["pictured"]:
                return {}
    return {number: solve_task(tasks[number - 1]) for number in summary["pictured"]}


def _heads(table: ResultTable, tasks: Sequence[DesignTask], prepared: PreparedStudy) -> list[Row]:
    """What each row gets from the study as it is now: its place, its design, the verdict of the limits."""
    return [
        {
            "design": task.design.number,
            **task.design.values,
            "key": task.key,
            **judged(table.rows[task.key], prepared.limits),
        }
        for task in tasks
    ]


@contextlib.contextmanager
def _progress(show: bool, total: int) -> Iterator[Callable[[int], None]]:
    """Rows done and time left on the terminal; the callable takes how many more are done."""
    if not show:
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("designs"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(elapsed_when_finished=False),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("designs", total=total)
        yield lambda done: bar.advance(task, done)
