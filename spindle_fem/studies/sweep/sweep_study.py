"""Every design of a prepared study solved and kept as a row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from spindle_fem.errors import BadInputError
from spindle_fem.studies.sweep.designs import Design
from spindle_fem.studies.sweep.evaluate_design import DesignTask
from spindle_fem.studies.sweep.judge_designs import judged
from spindle_fem.studies.sweep.optimise import search_designs
from spindle_fem.studies.sweep.prepared_study import PreparedStudy
from spindle_fem.studies.sweep.results_table import RESULTS, ResultTable, Row
from spindle_fem.studies.sweep.run_tasks import run_tasks


def require_own_table(folder: Path, columns: Sequence[str]) -> None:
    """Refuse the folder of another study before it is touched."""
    path = folder / RESULTS
    if not path.is_file() or path.stat().st_size == 0:
        return
    with path.open(encoding="utf-8", errors="replace", newline="") as stream:
        heading = stream.readline()
    if heading.endswith("\n") and heading.strip() != ",".join(columns):
        raise BadInputError(
            str(path),
            "is the table of another study.",
            "Give a new folder, or the study that the folder belongs to.",
        )


def solve_study(
    prepared: PreparedStudy,
    table: ResultTable,
    tell: Callable[[int], None],
    *,
    jobs: int = 1,
    scheduler: str | None = None,
) -> tuple[list[DesignTask], list[Row]]:
    """Solve every design of a study that has no row yet, those of its search included.

    Parameters
    ----------
    table : ResultTable
        Rows so far; gets each new one as it comes.
    tell : callable
        Called with the number of further designs done.
    jobs, scheduler
        As of :func:`~spindle_fem.studies.sweep.run_tasks.run_tasks`.

    Returns
    -------
    list of DesignTask, list of Row
        In the order of the designs.
    """
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
    return tasks, table.finish(_heads(table, tasks, prepared))


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


def _heads(table: ResultTable, tasks: Sequence[DesignTask], prepared: PreparedStudy) -> list[Row]:
    """Columns of each row that follow the current study: number, design, verdict on the limits."""
    return [
        {
            "design": task.design.number,
            **task.design.values,
            "key": task.key,
            **judged(table.rows[task.key], prepared.limits),
        }
        for task in tasks
    ]
