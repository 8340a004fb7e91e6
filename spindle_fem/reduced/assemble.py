"""Operators of every operating class of one run, with the terms' steady changes and all derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.term import FLOW, Term
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.loads.operating_point import OperatingPoint
from spindle_fem.reduced.fast_model import ClassOperators, FastModel

Array = NDArray[np.float64]

# Central differences of the terms' steady changes: smooth, cheap functions.
DIFFERENCE = 1e-5


@dataclass(frozen=True, slots=True)
class RunOperators:
    """Everything of a run that does not change from step to step.

    Attributes
    ----------
    factors : mapping of str to float
        Of the machine's coefficients.
    machine_derivatives : tuple of str
        Asked parameters that are the machine's.
    classes : tuple of ClassOperators
    coefficients : tuple of mapping of str to float
        Of each class.
    touched : mapping of coefficient to tuple of int
        Asked parameters that scale it.
    storage : (r, r) ndarray, [J/K]
    storage_by : mapping of parameter to (r, r) ndarray
    """

    factors: Mapping[str, float]
    machine_derivatives: tuple[str, ...]
    classes: tuple[ClassOperators, ...]
    coefficients: tuple[Mapping[str, float], ...]
    touched: Mapping[str, tuple[int, ...]]
    storage: Array
    storage_by: Mapping[str, Array]


def run_operators(
    fast: FastModel,
    points: Sequence[OperatingPoint],
    parameters: Mapping[str, float],
    derivatives: Sequence[str],
    terms: Sequence[Term],
) -> RunOperators:
    """Operators of the classes of a drive.

    Parameters
    ----------
    fast : FastModel
    points : sequence of OperatingPoint
        Of each class.
    parameters : mapping of str to float
        Factors of the machine's parameters and values of the terms'.
    derivatives : sequence of str
    terms : sequence of Term

    Raises
    ------
    SpecError
        A parameter of neither the machine nor a term, two terms of one name, a
        change of something that does not exist.
    """
    if len({term.name for term in terms}) != len(terms):
        raise SpecError("terms", "two of them have the same name.", "Give each a name of its own.")
    owned = {name: (term, item) for term in terms for name, item in term.names().items()}
    machine = {name: value for name, value in parameters.items() if name not in owned}
    factors = fast.table.factors(machine)
    asked = tuple(name for name in derivatives if name not in owned)
    changes = _Changes(fast, terms)
    parts = [changes.parts(point, parameters) for point in points]
    scaled = [changes.together(own) for own in parts]
    added = changes.conductances(parameters)
    classes = [
        fast.operators(point, factors, asked, changes=own, conductances=added)
        for point, own in zip(points, scaled, strict=True)
    ]
    storage = fast.storage(factors, changes.capacities(parameters))
    storage_by = fast.storage_by(factors, asked)
    for name in derivatives:
        if name in owned and changes.is_steady(owned[name][0]):
            value = parameters.get(name, owned[name][1].value)
            step = DIFFERENCE * (abs(value) if owned[name][1].logarithmic or value != 0.0 else 1.0)
            # To the logarithm: d/d ln x = x d/dx.
            scale = (value if owned[name][1].logarithmic else 1.0) / (2.0 * step)
            upper, lower = ({**parameters, name: value + sign * step} for sign in (1.0, -1.0))
            capacities = [changes.capacities(end) for end in (upper, lower)]
            if capacities[0] != capacities[1]:
                storage_by[name] = scale * (
                    fast.storage(factors, capacities[0]) - fast.storage(factors, capacities[1])
                )
            conductances = (changes.conductances(upper), changes.conductances(lower))
            for number, point in enumerate(points):
                ends = tuple(
                    changes.together(changes.with_part(parts[number], owned[name][0], point, values))
                    for values in (upper, lower)
                )
                if ends[0] != ends[1] or conductances[0] != conductances[1]:
                    change = fast.change(point, factors, ends, conductances)
                    classes[number] = _with_change(classes[number], name, change, scale)
    coefficients = tuple(
        fast.coefficients(point, factors, own) for point, own in zip(points, scaled, strict=True)
    )
    targets = {i: set(fast.table.targets(n)) for i, n in enumerate(derivatives) if n not in owned}
    touched = {
        coefficient: tuple(
            i for i, own in targets.items() if not own.isdisjoint(fast.table.groups[coefficient])
        )
        for coefficient in fast.model.coefficient_names
    }
    return RunOperators(factors, asked, tuple(classes), coefficients, touched, storage, storage_by)


def _with_change(
    operators: ClassOperators, name: str, change: ClassOperators, scale: float
) -> ClassOperators:
    return replace(
        operators,
        conduction_by={**operators.conduction_by, name: scale * change.conduction},
        loads_by={**operators.loads_by, name: scale * change.loads},
        outputs_by={**operators.outputs_by, name: scale * change.outputs},
        output_inputs_by={**operators.output_inputs_by, name: scale * change.output_inputs},
    )


class _Changes:
    """Steady changes of all terms together."""

    def __init__(self, fast: FastModel, terms: Sequence[Term]) -> None:
        self.fast, self.terms = fast, tuple(terms)
        self.known = {*fast.table.groups, FLOW}

    @staticmethod
    def is_steady(term: Term) -> bool:
        """Whether a term changes anything but heat and factors over time."""
        own = type(term)
        return any(
            getattr(own, name) is not getattr(Term, name)
            for name in ("operating_factor", "place_capacity", "place_conductance")
        )

    def parts(self, point: OperatingPoint, values: Mapping[str, float]) -> list[dict[str, float]]:
        """Factors that each term puts on coefficients at an operating point."""
        return [self._part(term, point, values) for term in self.terms]

    def with_part(
        self,
        parts: Sequence[dict[str, float]],
        term: Term,
        point: OperatingPoint,
        values: Mapping[str, float],
    ) -> list[dict[str, float]]:
        """The factors of all terms with those of one of them at other values."""
        return [
            self._part(own, point, values) if own is term else part
            for own, part in zip(self.terms, parts, strict=True)
        ]

    @staticmethod
    def together(parts: Sequence[Mapping[str, float]]) -> dict[str, float]:
        """Factors of all terms by coefficient."""
        found: dict[str, float] = {}
        for part in parts:
            for name, factor in part.items():
                found[name] = found.get(name, 1.0) * factor
        return found

    def _part(self, term: Term, point: OperatingPoint, values: Mapping[str, float]) -> dict[str, float]:
        found = term.operating_factor(point, term.values(values))
        for name in found:
            if name not in self.known:
                raise SpecError(f"term {term.name}", f'scales "{name}".', did_you_mean(name, self.known))
        return found

    def capacities(self, values: Mapping[str, float]) -> dict[str, float]:
        return self._at_places("place_capacity", values)

    def conductances(self, values: Mapping[str, float]) -> dict[str, float]:
        return self._at_places("place_conductance", values)

    def _at_places(self, method: str, values: Mapping[str, float]) -> dict[str, float]:
        found: dict[str, float] = {}
        for term in self.terms:
            for place, amount in getattr(term, method)(term.values(values)).items():
                if place not in self.fast.model.place_names:
                    raise SpecError(
                        f"term {term.name}",
                        f'names "{place}".',
                        did_you_mean(place, self.fast.model.place_names),
                    )
                found[place] = found.get(place, 0.0) + amount
        return found
