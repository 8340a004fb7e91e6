"""Operators of every operating class of one run, with the terms' steady changes and all derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import FLOW, Term, TermParameter
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.model.reduced.fast_model import ClassOperators, FastModel
from spindle_fem.operation.effect_terms import multiplied, operating_factors
from spindle_fem.operation.operating_point import OperatingPoint

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
    owner : (n_classes,) int64 ndarray
        Class whose operators each class has: its own, or that of one that hardly differs.
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
    owner: NDArray[np.int64]
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
    *,
    same_within: float = 0.0,
) -> RunOperators:
    """Operators of the classes of a drive.

    Parameters
    ----------
    points : sequence of OperatingPoint
        Of each class.
    parameters : mapping of str to float
        Factors of the machine's parameters and values of the terms'.
    same_within : float
        Classes none of whose coefficients, flows and what terms do to them differ by more than this share
        have the operators of one of them.

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
    changes = SteadyChanges(fast, terms)
    parts = [changes.parts(point, parameters) for point in points]
    scaled = [multiplied(own) for own in parts]
    added = changes.conductances(parameters)
    storage = fast.storage(factors, changes.capacities(parameters))
    storage_by = fast.storage_by(factors, asked)
    coefficients = tuple(
        fast.coefficients(point, factors, own) for point, own in zip(points, scaled, strict=True)
    )
    steady = [
        _SteadyChange.of(changes, parts, points, parameters, name, *owned[name])
        for name in derivatives
        if name in owned and owned[name][0].is_steady
    ]
    owner = np.arange(len(points))
    if same_within > 0.0:
        flows = np.array([p.coolant_flow * own.get(FLOW, 1.0) for p, own in zip(points, scaled, strict=True)])
        values = np.array([list(found.values()) for found in coefficients])
        slopes = np.hstack([np.zeros((len(points), 0)), *(change.slopes() for change in steady)])
        owner = _owners(np.column_stack((values, flows)), slopes, same_within)
    classes = {
        int(number): fast.operators(
            points[number], factors, asked, changes=scaled[number], conductances=added
        )
        for number in np.unique(owner)
    }
    for change in steady:
        upper, lower = change.capacities
        if upper != lower:
            storage_by[change.name] = change.scale * (
                fast.storage(factors, upper) - fast.storage(factors, lower)
            )
        for number in classes:
            ends = change.ends[number]
            if ends[0] != ends[1] or change.conductances[0] != change.conductances[1]:
                found = fast.change(points[number], factors, ends, change.conductances)
                classes[number] = _with_change(classes[number], change.name, found, change.scale)
    targets = {i: set(fast.table.targets(n)) for i, n in enumerate(derivatives) if n not in owned}
    touched = {
        coefficient: tuple(
            i for i, own in targets.items() if not own.isdisjoint(fast.table.groups[coefficient])
        )
        for coefficient in fast.model.coefficient_names
    }
    return RunOperators(
        factors,
        asked,
        tuple(classes[number] for number in owner.tolist()),
        owner,
        coefficients,
        touched,
        storage,
        storage_by,
    )


def _owners(values: Array, slopes: Array, within: float) -> NDArray[np.int64]:
    """Class that each class is taken for.

    Parameters
    ----------
    values : (n_classes, n) ndarray
        Compared by their ratios.
    slopes : (n_classes, m) ndarray
        Compared by their differences.
    >>> _owners(np.array([[1.0], [1.001], [2.0], [0.999]]), np.zeros((4, 0)), 0.01).tolist()
    [0, 0, 2, 0]
    """
    owner = np.full(len(values), -1)
    for number in range(len(values)):
        if owner[number] >= 0:
            continue
        near = np.all(np.abs(values - values[number]) <= within * np.abs(values[number]), axis=1)
        near &= np.all(np.abs(slopes - slopes[number]) <= within, axis=1)
        alike = np.flatnonzero(near & (owner < 0))
        # The one amid them is nearest to all.
        place = np.argsort(values[alike].sum(axis=1), kind="stable")[len(alike) // 2]
        owner[alike] = alike[place]
    return owner


@dataclass(frozen=True, slots=True)
class _SteadyChange:
    """A term's steady changes slightly above and below the value of one of its parameters.

    Attributes
    ----------
    scale : float
        From the difference of both to the derivative.
    ends : list of pair of mapping of str to float
        Factors on coefficients, of each class.
    capacities, conductances : pair of mapping of str to float
    """

    name: str
    scale: float
    ends: list[tuple[dict[str, float], dict[str, float]]]
    capacities: tuple[dict[str, float], dict[str, float]]
    conductances: tuple[dict[str, float], dict[str, float]]

    @classmethod
    def of(
        cls,
        changes: SteadyChanges,
        parts: Sequence[Sequence[dict[str, float]]],
        points: Sequence[OperatingPoint],
        parameters: Mapping[str, float],
        name: str,
        term: Term,
        item: TermParameter,
    ) -> _SteadyChange:
        value = parameters.get(name, item.value)
        step = DIFFERENCE * (abs(value) if item.logarithmic or value != 0.0 else 1.0)
        above, below = ({**parameters, name: value + sign * step} for sign in (1.0, -1.0))
        return cls(
            name,
            # To the logarithm: d/d ln x = x d/dx.
            (value if item.logarithmic else 1.0) / (2.0 * step),
            [
                tuple(multiplied(changes.with_part(own, term, point, end)) for end in (above, below))
                for own, point in zip(parts, points, strict=True)
            ],
            (changes.capacities(above), changes.capacities(below)),
            (changes.conductances(above), changes.conductances(below)),
        )

    def slopes(self) -> Array:
        """Derivatives of all factors in each class, (n_classes, n)."""
        names = sorted({name for ends in self.ends for end in ends for name in end})
        upper, lower = (
            np.array([[ends[side].get(name, 1.0) for name in names] for ends in self.ends]) for side in (0, 1)
        )
        return self.scale * (upper - lower)


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


class SteadyChanges:
    """Steady changes of all terms together."""

    def __init__(self, fast: FastModel, terms: Sequence[Term]) -> None:
        self.fast, self.terms = fast, tuple(terms)
        self.known = {*fast.table.groups, FLOW}

    def parts(self, point: OperatingPoint, values: Mapping[str, float]) -> list[dict[str, float]]:
        """Factors that each term puts on coefficients at an operating point."""
        return self._parts(self.terms, point, values)

    def with_part(
        self,
        parts: Sequence[dict[str, float]],
        term: Term,
        point: OperatingPoint,
        values: Mapping[str, float],
    ) -> list[dict[str, float]]:
        """The factors of all terms with those of one of them at other values."""
        if any(FLOW in part for part in parts):
            # What one leaves of the flow, others follow.
            return self.parts(point, values)
        (moved,) = self._parts((term,), point, values)
        return [moved if own is term else part for own, part in zip(self.terms, parts, strict=True)]

    def _parts(
        self, terms: Sequence[Term], point: OperatingPoint, values: Mapping[str, float]
    ) -> list[dict[str, float]]:
        found = operating_factors(terms, [term.values(values) for term in terms], point)
        for term, part in zip(terms, found, strict=True):
            for name in part:
                if name not in self.known:
                    raise SpecError(f"term {term.name}", f'scales "{name}".', did_you_mean(name, self.known))
        return found

    def capacities(self, values: Mapping[str, float]) -> dict[str, float]:
        """Heat capacity that terms add to places, J/K."""
        return self._at_places("place_capacity", values)

    def conductances(self, values: Mapping[str, float]) -> dict[str, float]:
        """Conductance that terms add from places to the ambient, W/K."""
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
