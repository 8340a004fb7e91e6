"""A study from its files to its table and report: the function behind ``spindle-fem sweep``."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spindle_fem.definition.load import (
    apply_overrides,
    find_machine,
    load_machine,
    read_definition,
    write_machine,
)
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import BadInputError, FaultsError, SpecError, SpindleFemError
from spindle_fem.report.sweep_report import BEST_PICTURE, FIGURE_FOLDER, write_sweep_report
from spindle_fem.results.output_folder import output_folder, replace_text
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.studies.sweep.designs import Axis, Design, build_axes, plan_designs, reference_designs
from spindle_fem.studies.sweep.evaluate_design import DesignTask, Question, TaskBuilder, solve_task
from spindle_fem.studies.sweep.fast_outputs import ONLY_FULL
from spindle_fem.studies.sweep.file_names import MACHINE_FILE, STUDY_FILE, SUMMARY_FILE
from spindle_fem.studies.sweep.judge_designs import Limit, judged, limits_of
from spindle_fem.studies.sweep.optimise import search_designs
from spindle_fem.studies.sweep.outputs import WORDS, output_fault
from spindle_fem.studies.sweep.results_table import RESULTS, ResultTable, Row
from spindle_fem.studies.sweep.run_tasks import run_tasks
from spindle_fem.studies.sweep.study_file import Study, load_study
from spindle_fem.studies.sweep.study_lock import folder_lock
from spindle_fem.studies.sweep.sweep_summary import summarise

# Rows that stand in the table for designs of a study, besides parameters and outputs.
_HEAD = ("design",)
_TAIL = ("status", "reason", "feasible", "backend", "error_estimate_K", "mesh", "geometry", "key")


@dataclass(frozen=True, slots=True)
class PreparedStudy:
    """A study that was checked against its machine.

    Attributes
    ----------
    name : str
    study : Study
    spec : MachineSpec
        The machine as defined, before any design.
    content : mapping
        Its raw tables.
    axes : tuple of Axis
    limits : tuple of Limit
    question : Question
    tasks : tuple of DesignTask
        The planned designs in order, then those to compare with.
    references : mapping of str to int
        Number of each design to compare with, by its name.
    builder : TaskBuilder
    """

    name: str
    study: Study
    spec: MachineSpec
    content: Mapping[str, Any]
    axes: tuple[Axis, ...]
    limits: tuple[Limit, ...]
    question: Question
    tasks: tuple[DesignTask, ...]
    references: Mapping[str, int]
    builder: TaskBuilder

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the table."""
        return (*_HEAD, *(axis.path for axis in self.axes), *self.question.columns, *_TAIL)

    @property
    def size(self) -> int:
        """Number of designs, those of a search included."""
        return len(self.tasks) + (self.study.search.trials if self.study.search is not None else 0)


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


def prepare_study(machine: str | Path, study: str | Path, overrides: Iterable[str] = ()) -> PreparedStudy:
    """Read a machine and a study and check each against the other, without solving.

    Raises
    ------
    SpecError
        Everything that is wrong with either file, at once for each of them; or
        no design of the study is possible.
    """
    overrides = tuple(overrides)
    spec = load_machine(machine, overrides)
    content = apply_overrides(read_definition(find_machine(machine)), overrides)
    read = load_study(study)
    where = Path(study).name
    faults: list[SpindleFemError] = []
    axes: tuple[Axis, ...] = ()
    limits: tuple[Limit, ...] = ()
    try:
        axes = build_axes(read, content, where)
    except FaultsError as error:
        faults += error.faults
    faults += _output_faults(read, spec, where)
    if not faults:
        limits = limits_of(read, where)
    if faults:
        raise FaultsError(where, faults)
    question = Question(read.judged, read.study.film_uncertainty, read.study.backend, read.study.mesh)
    builder = TaskBuilder(content, question)
    designs = plan_designs(read, axes, where)
    compared = reference_designs(read, axes, content, where, len(designs) + 1)
    tasks = tuple(builder.task(design) for design in (*designs, *compared))
    if all(task.spec is None for task in tasks):
        reasons = "; ".join(dict.fromkeys(task.reason for task in tasks[:3]))
        raise SpecError(
            where, f"none of its {len(tasks)} designs is possible: {reasons}", "Change the parameters."
        )
    name = read.name or Path(study).stem
    references = {item.name: one.number for item, one in zip(read.reference, compared, strict=True)}
    return PreparedStudy(name, read, spec, content, axes, limits, question, tasks, references, builder)


def _output_faults(study: Study, spec: MachineSpec, where: str) -> list[SpindleFemError]:
    named = [(f"study.outputs[{i + 1}]", path) for i, path in enumerate(study.study.outputs)]
    numeric = [(f"constraint[{i + 1}].output", item.output) for i, item in enumerate(study.constraint)]
    numeric += [(f"objective[{i + 1}].output", item.output) for i, item in enumerate(study.objective)]
    faults: list[SpindleFemError] = []
    for key, path in (*named, *numeric):
        fault = output_fault(path, spec, f"{where}: {key}")
        if fault is not None:
            faults.append(fault)
    faults += [
        SpecError(f"{where}: {key}", f'"{path}" is a word.', "Allowed: an output that is a number.")
        for key, path in numeric
        if path in WORDS
    ]
    only_full = sorted(ONLY_FULL & set(study.judged))
    if study.study.backend == "reduced" and only_full:
        faults.append(
            SpecError(
                f"{where}: study.backend",
                f'is "reduced", but only full solves have {", ".join(only_full)}.',
                'Allowed: "auto" or "full" with it.',
            )
        )
    if study.study.film_uncertainty and spec.channel is None:
        faults.append(
            SpecError(
                f"{where}: study.film_uncertainty",
                "is asked for, but the machine has no channel.",
                "Leave it out.",
            )
        )
    return faults


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


__all__ = ["Design", "PreparedStudy", "prepare_study", "sweep_machine"]
