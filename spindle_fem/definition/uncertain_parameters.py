"""Uncertain parameters of a machine: priors of single values and shared factors as one list."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from pydantic import BaseModel

from spindle_fem.definition.machine_spec import BearingSet, ConstantFilm, JointGroup, MachineSpec
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.units import Uncertain


@dataclass(frozen=True, slots=True)
class UncertainParameter:
    """One value, or one common factor of several, that the definition gives with a prior.

    Attributes
    ----------
    name : str
        The coefficient (``film.outside``, ``joint.inner_ring_seats``,
        ``heat.front``, ``coolant.film_factor``), or the shared factor's name.
    applies_to : tuple of str
        The coefficients that it multiplies, as ``[[factor]]`` names them.
    keys : tuple of str
        Of those in the definition, as ``--set`` takes them.
    value : float
        Nominal value in ``unit``; 1 for a factor.
    unit : str
        SI unit, ``""`` for a pure number.
    sigma_log : float
        One standard deviation of the value's natural logarithm.
    """

    name: str
    applies_to: tuple[str, ...]
    keys: tuple[str, ...]
    value: float
    unit: str
    sigma_log: float


@dataclass(frozen=True, slots=True)
class _Coefficient:
    """A place in the machine that holds an uncertain value."""

    name: str
    key: str
    amount: Uncertain
    unit: str
    replaced: Callable[[MachineSpec, Uncertain], MachineSpec]


def _changed_entry(
    key: str, position: int, change: Callable[[BaseModel, Uncertain], BaseModel]
) -> Callable[[MachineSpec, Uncertain], MachineSpec]:
    def replaced(spec: MachineSpec, amount: Uncertain) -> MachineSpec:
        entries = getattr(spec, key)
        changed = change(entries[position], amount)
        return spec.model_copy(update={key: (*entries[:position], changed, *entries[position + 1 :])})

    return replaced


def _changed_table(key: str, field: str) -> Callable[[MachineSpec, Uncertain], MachineSpec]:
    def replaced(spec: MachineSpec, amount: Uncertain) -> MachineSpec:
        table = getattr(spec, key).model_copy(update={field: amount})
        return spec.model_copy(update={key: table})

    return replaced


def _field(name: str) -> Callable[[BaseModel, Uncertain], BaseModel]:
    return lambda table, amount: table.model_copy(update={name: amount})


def _ball_row(table: BearingSet, amount: Uncertain) -> BearingSet:
    return table.model_copy(update={"ball_row": table.ball_row.model_copy(update={"conductance": amount})})


def _coefficients(spec: MachineSpec) -> Iterator[_Coefficient]:
    own = "heat_capacity_factor"
    yield _Coefficient(own, own, spec.heat_capacity_factor, "", _field(own))
    for index, group in enumerate(spec.bearing_set):
        yield _Coefficient(
            f"heat.{group.name}",
            f"bearing_set.{group.name}.heat_factor",
            group.heat_factor,
            "",
            _changed_entry("bearing_set", index, _field("heat_factor")),
        )
        if group.ball_row.conductance is not None:
            yield _Coefficient(
                f"ball_row.{group.name}",
                f"bearing_set.{group.name}.ball_row.conductance",
                group.ball_row.conductance,
                "W/K",
                _changed_entry("bearing_set", index, _ball_row),
            )
    if spec.coolant is not None:
        own = "coolant.film_factor"
        yield _Coefficient(own, own, spec.coolant.film_factor, "", _changed_table("coolant", "film_factor"))
    own = "heat.inner_share"
    yield _Coefficient(own, own, spec.heat.inner_share, "", _changed_table("heat", "inner_share"))
    for index, joint in enumerate(spec.joint):
        if isinstance(joint, JointGroup) and isinstance(joint.conductance, Uncertain):
            yield _Coefficient(
                f"joint.{joint.name}",
                f"joint.{joint.name}.conductance",
                joint.conductance,
                "W/m**2/K",
                _changed_entry("joint", index, _field("conductance")),
            )
    for index, film in enumerate(spec.film):
        constant = isinstance(film, ConstantFilm)
        key = "coefficient" if constant else "factor"
        name = f"film.{film.name}" if film.name else f"film[{index + 1}]"
        yield _Coefficient(
            name,
            f"{name}.{key}",
            getattr(film, key),
            "W/m**2/K" if constant else "",
            _changed_entry("film", index, _field(key)),
        )
    for index, gap in enumerate(spec.gap):
        name = f"gap.{gap.name}"
        changed = _changed_entry("gap", index, _field("factor"))
        yield _Coefficient(name, f"{name}.factor", gap.factor, "", changed)


def uncertain_parameters(spec: MachineSpec) -> tuple[UncertainParameter, ...]:
    """Everything that the machine's definition calls uncertain.

    Inline priors come first, in the order of the tables, then the shared
    factors. A coefficient may carry both; its factors then multiply.

    >>> from spindle_fem.definition.load import load_machine
    >>> [parameter.name for parameter in uncertain_parameters(load_machine("recorded_spindle"))][:3]
    ['heat_capacity_factor', 'heat.front', 'heat.rear']
    """
    coefficients = {item.name: item for item in _coefficients(spec)}
    inline = [
        UncertainParameter(
            item.name, (item.name,), (item.key,), item.amount.value, item.unit, item.amount.sigma_log
        )
        for item in coefficients.values()
        if not item.amount.is_fixed
    ]
    shared = [
        UncertainParameter(
            item.name,
            item.applies_to,
            tuple(coefficients[name].key for name in item.applies_to),
            1.0,
            "",
            item.sigma_rel,
        )
        for item in spec.factor
    ]
    return tuple(inline + shared)


def coefficient_value(spec: MachineSpec, name: str) -> tuple[float, str]:
    """Value of a coefficient, as a parameter's ``applies_to`` names it, and its SI unit."""
    found = next(item for item in _coefficients(spec) if item.name == name)
    return found.amount.value, found.unit


def with_parameters(spec: MachineSpec, factors: Mapping[str, float]) -> MachineSpec:
    """The machine with uncertain values multiplied by factors.

    Parameters
    ----------
    factors : mapping of str to float
        Factor (1 leaves the value) by the name that
        :func:`uncertain_parameters` gives, or by the name of any coefficient
        that a shared factor may apply to, fixed ones included.

    Returns
    -------
    MachineSpec
        A new machine; priors keep their relative width around the new value.

    Raises
    ------
    SpecError
        An unknown name, a factor that is not positive and finite, or a value
        that leaves its range (an ``inner_share`` above 1).

    >>> from spindle_fem.definition.load import load_machine
    >>> nominal = load_machine("recorded_spindle")
    >>> with_parameters(nominal, {"shaft_end_films": 1.5}).film[2].factor.value
    1.5
    """
    coefficients = {item.name: item for item in _coefficients(spec)}
    shared = {factor.name: factor.applies_to for factor in spec.factor}
    combined: dict[str, float] = {}
    for name, factor in factors.items():
        if not (math.isfinite(factor) and factor > 0.0):
            raise SpecError(name, f"the factor is {factor!r}.", "Allowed: finite and above 0.")
        targets = shared.get(name, (name,))
        for target in targets:
            if target not in coefficients:
                raise SpecError(
                    name, "is no parameter of this machine.", did_you_mean(name, [*coefficients, *shared])
                )
            combined[target] = combined.get(target, 1.0) * factor
    changed = spec
    for target, factor in combined.items():
        coefficient = coefficients[target]
        amount = Uncertain(coefficient.amount.value * factor, coefficient.amount.sigma_log)
        if target == "heat.inner_share" and amount.value > 1.0:
            raise SpecError(target, f"the share becomes {amount.value:g}.", "Allowed: 0 to 1.")
        changed = coefficient.replaced(changed, amount)
    return changed
