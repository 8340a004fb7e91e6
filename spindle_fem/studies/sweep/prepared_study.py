"""A study read and checked against its machine: its axes, limits, question and planned designs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spindle_fem.definition.load import find_machine, load_machine, read_definition
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.overridden import overridden, with_ruled_value
from spindle_fem.errors import FaultsError, SpecError, SpindleFemError, UnknownKeyError
from spindle_fem.studies.sweep.designs import Axis, build_axes, plan_designs, reference_designs
from spindle_fem.studies.sweep.evaluate_design import DesignTask, Question, TaskBuilder
from spindle_fem.studies.sweep.judge_designs import Limit, limits_of
from spindle_fem.studies.sweep.outputs import WORDS, only_full, output_fault
from spindle_fem.studies.sweep.study_file import Study, load_study

# Leading columns of the table, besides parameters and outputs.
_HEAD = ("design",)
_TAIL = ("status", "reason", "feasible", "backend", "error_estimate_K", "mesh", "geometry", "key")


@dataclass(frozen=True, slots=True)
class PreparedStudy:
    """A study that was checked against its machine.

    Attributes
    ----------
    spec : MachineSpec
        The machine as defined, before any design.
    content : mapping
        Its raw tables.
    tasks : tuple of DesignTask
        The planned designs in order, then those to compare with.
    references : mapping of str to int
        Number of each design to compare with, by its name.
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
    content = overridden(read_definition(find_machine(machine)), *overrides)
    read = load_study(study)
    where = Path(study).name
    faults: list[SpindleFemError] = []
    axes: tuple[Axis, ...] = ()
    limits: tuple[Limit, ...] = ()
    try:
        for parameter in read.parameter:
            content = with_ruled_value(content, parameter.path)
        axes = build_axes(read, content, where)
    except UnknownKeyError as error:
        faults.append(error)
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
    whole = sorted(filter(only_full, set(study.judged)))
    if study.study.backend == "reduced" and whole:
        faults.append(
            SpecError(
                f"{where}: study.backend",
                f'is "reduced", but only full solves have {", ".join(whole)}.',
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
