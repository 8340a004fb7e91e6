"""Study file: designs of a machine to solve, and outputs to report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from spindle_fem.definition.faults import validation_faults
from spindle_fem.definition.field_types import Fault, Flag, RotationalSpeed, SpecModel, raise_faults
from spindle_fem.definition.load import read_toml
from spindle_fem.errors import FaultsError, SpecError, SpindleFemError

STUDY_SCHEMA = "spindle-fem/study/1"
# More designs than this are a slip in a grid, not a study.
LARGEST_STUDY = 200_000

Sampling = Literal["sobol", "latin_hypercube"]
Seed = Annotated[int, Field(ge=0, strict=True)]


class StudyParameter(SpecModel):
    """One value of the machine that varies.

    Either a list of ``values``, or a range from ``low`` to ``high`` with a
    ``number`` of equal steps for a grid or a ``sample`` drawn from it.
    """

    path: str
    """As for ``--set``: `channel.depth`, `bearing_set.front.preload`."""
    values: tuple[Any, ...] | None = None
    """A list, with units."""
    low: Any = None
    """Lower end of a range, with its unit."""
    high: Any = None
    """Upper end."""
    number: Annotated[int, Field(ge=2, strict=True)] | None = None
    """Equally spaced values of the range, ends included."""
    sample: Sampling | None = None
    """Draw from the range even where the design is a grid of the others."""

    @model_validator(mode="after")
    def _check(self) -> StudyParameter:
        faults = []
        if not self.path.strip():
            faults.append(Fault("path", "is empty.", "For example channel.depth."))
        ends = (self.low is not None, self.high is not None)
        if self.values is not None:
            if any(ends) or self.number is not None or self.sample is not None:
                faults.append(
                    Fault("values", "is given together with a range.", "Allowed: values, or low and high.")
                )
            if not self.values:
                faults.append(Fault("values", "is empty.", "Allowed: at least one value."))
            seen: list[Any] = []
            for value in self.values:
                if value in seen:
                    faults.append(Fault("values", f"holds {value!r} twice.", "Allowed: each once."))
                seen.append(value)
        elif not any(ends):
            faults.append(Fault("", "has neither values nor a range.", "Allowed: values, or low and high."))
        else:
            faults += [
                Fault(key, "is missing.", "A range needs low and high.")
                for key, given in zip(("low", "high"), ends, strict=True)
                if not given
            ]
        raise_faults(faults)
        return self

    @property
    def is_range(self) -> bool:
        """Whether the values come from a range."""
        return self.values is None


class StudySettings(SpecModel):
    """Selection of designs and of outputs."""

    design: Literal["grid", "sobol", "latin_hypercube"] = "grid"
    """Every combination, or a sample that fills the space evenly."""
    size: Annotated[int, Field(ge=1, strict=True)] | None = None
    """Number of sampled designs."""
    seed: Seed = 1
    """Of the sample; the same seed gives the same designs."""
    outputs: Annotated[tuple[str, ...], Field(min_length=1)]
    """Dotted paths into the summary of a run, or `derived` ones."""
    speeds: tuple[RotationalSpeed, ...] = ()
    """Every design is solved at each of them."""
    backend: Literal["auto", "full", "reduced"] = "auto"
    """What answers designs that share a mesh: a solve of each, or one projected model of all with an
    error estimate; "auto" takes it where enough designs share it."""
    mesh: Literal["moved", "new"] = "moved"
    """How designs whose channel has another depth, width or pitch get their mesh: moved from that of the
    nearest point of a fixed lattice of these three where that keeps areas, volumes and elements, or new."""
    film_uncertainty: Flag = False
    """Solve each design also at the low and the high film coefficient of the channel."""

    @model_validator(mode="after")
    def _check(self) -> StudySettings:
        raise_faults(
            Fault("outputs", f'names "{path}" twice.', "Allowed: each once.")
            for path in sorted(set(self.outputs))
            if self.outputs.count(path) > 1
        )
        return self


class Constraint(SpecModel):
    """A limit on an output."""

    output: str
    """A path, as in ``outputs``."""
    min: Any = None
    """Least value allowed, with its unit."""
    max: Any = None
    """Largest value allowed, with its unit."""

    @model_validator(mode="after")
    def _check(self) -> Constraint:
        if self.min is None and self.max is None:
            raise_faults([Fault("", "has no limit.", "Allowed: min, max or both.")])
        return self


class Objective(SpecModel):
    """An output that the designs are judged by; several make a Pareto front."""

    output: str
    """A path, as in ``outputs``."""
    direction: Literal["minimize", "maximize"] = "minimize"
    """What is better."""


class Reference(SpecModel):
    """A design to compare with, solved besides those of the plan."""

    name: str
    """For the report."""
    values: dict[str, Any]
    """A value for every parameter of the study, by path, with its unit."""


class Search(SpecModel):
    """Further designs inside the ranges, chosen from what the first ones gave."""

    trials: Annotated[int, Field(ge=1, strict=True)]
    """Number of them."""
    batch: Annotated[int, Field(ge=1, le=64, strict=True)] = 4
    """Chosen together and solved in parallel; part of the result, unlike the number of workers."""
    seed: Seed = 1
    """The same seed gives the same search."""


class Study(SpecModel):
    """A study file."""

    schema_: Annotated[str, Field(alias="schema")]
    """The version of this format."""
    name: str = ""
    """For the report; the file's name where none is given."""
    parameter: Annotated[tuple[StudyParameter, ...], Field(min_length=1)]
    """What varies."""
    study: StudySettings
    """How."""
    constraint: tuple[Constraint, ...] = ()
    """Limits that a design must keep."""
    objective: tuple[Objective, ...] = ()
    """What the designs are judged by."""
    reference: tuple[Reference, ...] = ()
    """Designs to compare with."""
    search: Search | None = None
    """Further designs; needs an objective."""

    @model_validator(mode="after")
    def _check(self) -> Study:
        faults: list[Fault] = []
        paths = [parameter.path for parameter in self.parameter]
        faults += [
            Fault(f"parameter[{position + 1}].path", f'names "{path}" again.', "Allowed: each path once.")
            for position, path in enumerate(paths)
            if path in paths[:position]
        ]
        faults += self._range_faults()
        if self.study.speeds and "operation.speed" in paths:
            faults.append(
                Fault(
                    "study.speeds", "is given, and operation.speed is a parameter.", "Allowed: one of them."
                )
            )
        if self.search is not None and not self.objective:
            faults.append(Fault("search", "has nothing to search for.", "Add an [[objective]]."))
        if self.search is not None and self.study.speeds:
            faults.append(Fault("search", "is given together with study.speeds.", "Search at one speed."))
        wanted = {*paths, *(("operation.speed",) if self.study.speeds else ())}
        for position, reference in enumerate(self.reference):
            odd = wanted ^ set(reference.values)
            if odd:
                faults.append(
                    Fault(
                        f"reference[{position + 1}].values",
                        f"and the parameters differ in {', '.join(sorted(odd))}.",
                        "Give a value for every parameter, and no other.",
                    )
                )
        if self.search is not None and not any(item.is_range for item in self.parameter):
            faults.append(Fault("search", "has no range to search in.", "Give low and high of a parameter."))
        raise_faults(faults)
        return self

    def _range_faults(self) -> list[Fault]:
        faults = []
        sampled = self.study.design != "grid"
        kinds = {item.sample for item in self.parameter if item.sample is not None}
        odd = min(kinds - {self.study.design}, default="") if sampled else ""
        if odd:
            what = f'asks for sample = "{odd}" in design = "{self.study.design}".'
            faults.append(Fault("parameter", what, "Leave sample out, or let both agree."))
        if not sampled and len(kinds) > 1:
            faults.append(
                Fault("parameter", "asks for two kinds of sample.", "Allowed: one kind in a study.")
            )
        for position, item in enumerate(self.parameter):
            if not sampled and item.is_range and item.number is None and item.sample is None:
                faults.append(
                    Fault(
                        f"parameter[{position + 1}].number",
                        "is missing.",
                        "A grid needs it, such as number = 7.",
                    )
                )
        if self.sampling is not None and self.sample_size is None:
            faults.append(Fault("study.size", "is missing.", "A sample needs it, such as size = 64."))
        return faults

    @property
    def sampling(self) -> str | None:
        """Kind of the sample, None for a pure grid."""
        if self.study.design != "grid":
            return self.study.design
        return next((item.sample for item in self.parameter if item.sample is not None), None)

    @property
    def sample_size(self) -> int | None:
        """Number of sampled points: ``size``, else the ``number`` of a sampled parameter."""
        if self.study.size is not None:
            return self.study.size
        numbers = [item.number for item in self.parameter if item.sample is not None and item.number]
        return max(numbers, default=None)

    @property
    def judged(self) -> tuple[str, ...]:
        """All outputs needed, each once, requested ones first."""
        named = (
            *self.study.outputs,
            *(c.output for c in self.constraint),
            *(o.output for o in self.objective),
        )
        return tuple(dict.fromkeys(named))


def load_study(path: str | Path) -> Study:
    """Read a study file.

    Raises
    ------
    SpecError
        It cannot be read.
    FaultsError
        Every fault at once, with file, key, value and what is allowed.
    """
    path = Path(path)
    content = read_toml(path)
    faults: list[SpindleFemError] = []
    if content.get("schema") != STUDY_SCHEMA:
        given = content.get("schema")
        what = "is missing." if given is None else f"{given!r} is not known."
        faults.append(SpecError(f"{path.name}: schema", what, f'Allowed: "{STUDY_SCHEMA}".'))
        content = {**content, "schema": STUDY_SCHEMA}
    try:
        study = Study.model_validate(content)
    except ValidationError as error:
        raise FaultsError(
            path.name, [*faults, *validation_faults(error, path.name, Study, content)]
        ) from error
    if faults:
        raise FaultsError(path.name, faults)
    return study
