"""The designs of a study: every combination, or a sample that fills the space."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError
from scipy.stats import qmc

from spindle_fem.definition.field_types import QuantityRule
from spindle_fem.definition.inherit import PRIOR_KEYS, apply_overrides
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.schema import (
    Shape,
    annotation_of,
    fields_of,
    is_text,
    names_of,
    quantity_rule,
    shape_of,
    split_index,
    split_key,
    split_name,
    value_text,
)
from spindle_fem.errors import FaultsError, SpecError, SpindleFemError, UnitError
from spindle_fem.studies.sweep.study_file import LARGEST_STUDY, Study, StudyParameter
from spindle_fem.units import ZERO_CELSIUS_K, Uncertain

SPEED_PATH = "operation.speed"


@dataclass(frozen=True, slots=True)
class Choice:
    """One value of a parameter.

    Attributes
    ----------
    override : str
        ``path=value`` for the definition.
    shown : float, int or str
        For tables: SI, temperatures in °C, words as they are.
    """

    override: str
    shown: Any


@dataclass(frozen=True, slots=True)
class Axis:
    """One direction of the design space, with every value checked on its own.

    Attributes
    ----------
    choices : tuple of Choice
        The list or the grid values; empty for a range that is only sampled.
    low, high : float or None
        Ends of a range, SI.
    rule : QuantityRule or None
        What the machine's definition says of the value; None for words and whole numbers.
    sampled : bool
        Whether the sample has a coordinate for it.
    """

    path: str
    choices: tuple[Choice, ...]
    low: float | None
    high: float | None
    rule: QuantityRule | None
    sampled: bool

    def at(self, share: float) -> Choice:
        """Value at a share 0 to 1 of the range, or of the list."""
        if self.choices:
            return self.choices[min(int(share * len(self.choices)), len(self.choices) - 1)]
        if self.rule is None:  # whole numbers, each as likely
            count = int(self.high) - int(self.low) + 1
            return choice(self.path, int(self.low) + min(int(share * count), count - 1), None)
        return choice(self.path, self.low + share * (self.high - self.low), self.rule)

    @property
    def unit(self) -> str:
        """Unit of the shown numbers, for people."""
        if self.rule is None:
            return ""
        return "°C" if self.rule.kind == "temperature" else self.rule.unit


@dataclass(frozen=True, slots=True)
class Design:
    """One point of the design space: overrides for the definition, and the values shown in tables."""

    number: int
    overrides: tuple[str, ...]
    values: Mapping[str, Any]


def choice(path: str, value: Any, rule: QuantityRule | None) -> Choice:
    """Choice of an SI value, or of a word or whole number where there is no rule."""
    if rule is None:
        return Choice(f"{path}={_toml_text(value)}", value)
    value = float(f"{value:.13g}")
    return Choice(f"{path}={f'{value!r} {rule.unit}'.strip()}", _shown(value, rule))


def _toml_text(value: Any) -> str:
    if isinstance(value, str):
        return value
    return tomli_w.dumps({"value": value}, multiline_strings=False).partition("=")[2].strip()


def _shown(value: Any, rule: QuantityRule) -> Any:
    if isinstance(value, Uncertain):
        value = value.value
    if isinstance(value, float) and rule.kind == "temperature":
        return float(f"{value - ZERO_CELSIUS_K:.12g}")
    return value


def build_axes(study: Study, content: Mapping[str, Any], where: str) -> tuple[Axis, ...]:
    """Every parameter of a study against the machine it varies.

    Parameters
    ----------
    content : mapping
        Raw tables of the machine.
    where : str
        Name of the study file for the messages.

    Raises
    ------
    FaultsError
        Misspelt paths, values of the wrong dimension, ranges that end before
        they start: all of them.
    """
    axes: list[Axis] = []
    faults: list[SpindleFemError] = []
    for position, parameter in enumerate(study.parameter):
        place = f"{where}: parameter[{position + 1}]"
        try:
            axes.append(_axis(parameter, study, content, place))
        except FaultsError as error:
            faults += error.faults
        except SpecError as error:
            faults.append(error)
    if study.study.speeds:
        rule = annotation_rule(content, SPEED_PATH)
        choices = tuple(choice(SPEED_PATH, speed, rule) for speed in study.study.speeds)
        axes.append(Axis(SPEED_PATH, choices, None, None, rule, sampled=False))
    if faults:
        raise FaultsError(where, faults)
    return tuple(axes)


def _axis(parameter: StudyParameter, study: Study, content: Mapping[str, Any], place: str) -> Axis:
    path = parameter.path
    probe = parameter.values[0] if parameter.values else parameter.low
    try:
        apply_overrides(content, [f"{path}={_toml_text(probe)}"])
    except SpecError as error:
        raise type(error)(f"{place}.path", f'"{path}": {error.what}', error.how_to_fix) from error
    annotation = annotation_at(content, path)
    if annotation is None:
        raise SpecError(f"{place}.path", f'"{path}" is a whole table.', "Name one value of it.")
    rule = quantity_rule(annotation)
    sampled = study.study.design != "grid" or parameter.sample is not None
    if parameter.values is not None:
        choices, faults = [], []
        for number, value in enumerate(parameter.values):
            try:
                choices.append(_listed(path, value, annotation, f"{place}.values[{number + 1}]"))
            except SpecError as error:
                faults.append(error)
        if faults:
            raise FaultsError(place, faults)
        return Axis(path, tuple(choices), None, None, rule, sampled)
    low, high = (_end(getattr(parameter, key), annotation, f"{place}.{key}") for key in ("low", "high"))
    if not low < high:
        raise SpecError(
            f"{place}.high", f"{parameter.high} is not above low, {parameter.low}.", "Allowed: low < high."
        )
    choices: tuple[Choice, ...] = ()
    if parameter.number is not None and parameter.sample is None:
        steps = np.linspace(low, high, parameter.number).tolist()
        if rule is None:
            if any(step != round(step) for step in steps):
                raise SpecError(
                    f"{place}.number", f"{parameter.number} steps of {low} to {high} are not whole.",
                    f"Allowed: such as {int(high - low) + 1}.",
                )  # fmt: skip
            steps = [round(step) for step in steps]
        choices = tuple(choice(path, step, rule) for step in steps)
    return Axis(path, choices, low, high, rule, sampled)


def _listed(path: str, value: Any, annotation: Any, where: str) -> Choice:
    """A value of a list, kept as it is written; one of the wrong kind is refused."""
    rule = quantity_rule(annotation)
    if rule is not None:
        return Choice(f"{path}={_toml_text(value)}", _shown(_read(rule, value, where), rule))
    if is_text(annotation) and not isinstance(value, str):
        raise SpecError(where, f"{value!r} is no text.", f"Allowed: {value_text(annotation)}.")
    try:
        TypeAdapter(annotation).validate_python(value)
    except ValidationError as error:
        raise SpecError(where, f"{value!r} is not allowed.", f"Allowed: {value_text(annotation)}.") from error
    shown = value if isinstance(value, (str, int, float)) else _toml_text(value)
    return Choice(f"{path}={_toml_text(value)}", shown)


def _read(rule: QuantityRule, value: Any, where: str) -> Any:
    """SI value; beyond the limits of the definition it is read all the same, its design will be refused."""
    free = QuantityRule(rule.unit, rule.kind, words=rule.words, uncertain=rule.uncertain)
    try:
        return free.read(value)
    except PydanticCustomError as error:
        fault = error.context["faults"][0]
        raise UnitError(where, fault.what, fault.how_to_fix) from error


def _end(value: Any, annotation: Any, where: str) -> float:
    rule = quantity_rule(annotation)
    if rule is None:
        whole = isinstance(value, int) and not isinstance(value, bool)
        if not whole or "whole number" not in value_text(annotation):
            raise SpecError(
                where,
                f"{value!r} is no end of a range.",
                f"Allowed: {value_text(annotation)}; or list values.",
            )
        return value
    read = _read(rule, value, where)
    if isinstance(read, str):
        raise SpecError(where, f'"{read}" is no end of a range.', "Allowed: a quantity; or list values.")
    return read.value if isinstance(read, Uncertain) else read


def annotation_rule(content: Mapping[str, Any], path: str) -> QuantityRule | None:
    """Rule of the quantity at a path that is known to exist."""
    return quantity_rule(annotation_at(content, path))


def annotation_at(content: Mapping[str, Any], path: str) -> Any:
    """Annotation of the value at a path that overrides accept; None where it is a table or a list of them."""
    shape, node, rest = Shape("table", (MachineSpec,)), content, path
    while rest:
        if shape.kind == "table":
            key, rest = split_key(rest)
            shape = shape_of(annotation_of(fields_of(shape.models, node)[key]))
        elif shape.kind == "mapping":
            key, rest = split_name(rest, list(node or ())) or (rest, "")
            shape = shape_of(shape.inner)
        elif shape.kind == "list":
            by_index, found = split_index(rest), split_name(rest, names_of(node))
            if by_index is not None:
                key, rest = by_index
            else:
                key, rest = names_of(node).index(found[0]), found[1]
            shape = shape_of(shape.inner)
        elif rest in PRIOR_KEYS:
            # The value and the ends of a prior are quantities like the plain value.
            return float if rest == "sigma_rel" else shape.annotation
        else:
            return None
        if isinstance(node, Mapping):
            node = node.get(key)
        elif isinstance(node, Sequence) and not isinstance(node, str) and isinstance(key, int):
            node = node[key]
        else:
            node = None
    return shape.annotation if shape.kind == "value" else None


def plan_designs(study: Study, axes: Sequence[Axis], where: str = "study") -> tuple[Design, ...]:
    """Designs of a study in their order: the last axis varies fastest, samples slowest.

    Raises
    ------
    SpecError
        More designs than any study can mean.
    """
    sampled = [axis for axis in axes if axis.sampled]
    crossed = [axis for axis in axes if not axis.sampled]
    size = study.sample_size if sampled else 1
    number = size * int(np.prod([len(axis.choices) for axis in crossed], dtype=object) if crossed else 1)
    if number > LARGEST_STUDY:
        raise SpecError(
            f"{where}: study",
            f"makes {number} designs.",
            f"Allowed: at most {LARGEST_STUDY}; sample with a size.",
        )
    points: NDArray[np.float64] = (
        sample_points(study.sampling, len(sampled), size, study.study.seed) if sampled else np.zeros((1, 0))
    )
    designs = []
    for point in points:
        drawn = {axis.path: axis.at(float(share)) for axis, share in zip(sampled, point, strict=True)}
        for combination in itertools.product(*(axis.choices for axis in crossed)):
            chosen = drawn | {axis.path: one for axis, one in zip(crossed, combination, strict=True)}
            designs.append(make_design(len(designs) + 1, [chosen[axis.path] for axis in axes], axes))
    return tuple(designs)


def reference_designs(
    study: Study, axes: Sequence[Axis], content: Mapping[str, Any], where: str, first: int
) -> tuple[Design, ...]:
    """Designs of the ``[[reference]]`` tables, numbered from ``first``.

    Raises
    ------
    SpecError
        A value of the wrong kind.
    """
    designs = []
    for position, reference in enumerate(study.reference):
        place = f"{where}: reference[{position + 1}].values"
        choices = [
            _listed(
                axis.path,
                reference.values[axis.path],
                annotation_at(content, axis.path),
                f"{place}.{axis.path}",
            )
            for axis in axes
        ]
        designs.append(make_design(first + position, choices, axes))
    return tuple(designs)


def make_design(number: int, choices: Sequence[Choice], axes: Sequence[Axis]) -> Design:
    """Design of one choice an axis."""
    return Design(
        number,
        tuple(one.override for one in choices),
        {axis.path: one.shown for axis, one in zip(axes, choices, strict=True)},
    )


def sample_points(kind: str, dimensions: int, size: int, seed: int) -> NDArray[np.float64]:
    """Points of the unit cube, (size, dimensions); a scrambled Sobol sequence or a Latin hypercube.

    A Sobol sample of another size with the same seed starts with the same points.

    >>> sample_points("sobol", 2, 3, 1).shape
    (3, 2)
    """
    if kind == "latin_hypercube":
        return qmc.LatinHypercube(dimensions, rng=seed).random(size)
    exponent = max(0, (size - 1).bit_length())
    return qmc.Sobol(dimensions, scramble=True, rng=seed).random_base2(exponent)[:size]
