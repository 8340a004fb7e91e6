"""Terms that do not look at temperatures: their heat is known before the march.

What follows only time, inputs and its own memory needs no solution within a
step. It is evaluated at all steps at once and joins the load inputs, with its
derivatives, so that the march is that of the linear model.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import COOLANT_INLET, FLUID_PREFIX, Term
from spindle_fem.model.reduced.added_heat import require_terms
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.run_operators import RunOperators
from spindle_fem.operation.effect_terms import Derivatives, EffectTerms, Instants, Quantities, TermAnswers
from spindle_fem.operation.term_memory import carried, remembered

Array = NDArray[np.float64]


def is_open(term: Term) -> bool:
    """Whether a term adds heat that follows no temperature."""
    return term.is_dynamic and not term.reads and not term.coefficients


class MachineInputs(NamedTuple):
    """Load inputs of the machine itself, at the start and the end of every step, and derivatives.

    Attributes
    ----------
    start, end : (G, n_w) ndarray
    start_by, end_by : mapping of parameter to (G, n_w) ndarray
    """

    start: Array
    end: Array
    start_by: Mapping[str, Array]
    end_by: Mapping[str, Array]


@dataclass(slots=True)
class OpenLoads:
    """Load inputs of a run with those of its open terms beside and in them.

    Attributes
    ----------
    loads : list of (r, n_w) ndarray
        Of each class.
    loads_by : list of mapping of parameter to (r, n_w) ndarray
    start, end : (G, n_w) ndarray
    start_by, end_by : mapping of parameter to (G, n_w) ndarray
    fluids : mapping of coefficient to int
        Load input that shifts the fluid of a film, K.
    """

    loads: list[Array]
    loads_by: list[dict[str, Array]]
    start: Array
    end: Array
    start_by: dict[str, Array]
    end_by: dict[str, Array]
    fluids: dict[str, int]

    def shifts(
        self, coefficients: Collection[str], derivatives: Sequence[str]
    ) -> tuple[dict[str, tuple[Array, Array]], dict[str, tuple[Array, Array]]]:
        """Shift of the fluids of some films at the start and at the end of every step.

        Parameters
        ----------
        coefficients : collection of str

        Returns
        -------
        mapping of coefficient to (G,) and (G, p) ndarray, [K]
            Only those that open terms shift; with derivatives.
        """
        found: tuple[dict[str, tuple[Array, Array]], ...] = ({}, {})
        for film, column in self.fluids.items():
            if film not in coefficients:
                continue
            for ends, values, by in zip(
                found, (self.start, self.end), (self.start_by, self.end_by), strict=True
            ):
                slopes = np.zeros((len(values), len(derivatives)))
                for position, name in enumerate(derivatives):
                    if name in by:
                        slopes[:, position] = by[name][:, column]
                ends[film] = (values[:, column], slopes)
        return found


def with_open_terms(
    fast: FastModel,
    drive: Drive,
    built: RunOperators,
    machine: MachineInputs,
    terms: Sequence[Term],
    parameters: Mapping[str, float],
    derivatives: Sequence[str],
) -> OpenLoads:
    """Load inputs with the heat of open terms.

    Parameters
    ----------
    machine : MachineInputs
        The machine's own.
    terms : sequence of Term
        Open ones.
    parameters : mapping of str to float
        Values of the terms' parameters by outer name.

    Raises
    ------
    SpecError
        A place or bearing that the machine does not have.
    """
    require_terms(fast, terms)
    owned = {name for term in terms for name in term.names()}
    open_terms = EffectTerms(terms, parameters, [name for name in derivatives if name in owned])
    columns = _Columns(fast, built, derivatives, open_terms.places)
    width = len(fast.load_names) + len(columns.names)
    found = [_widened(values, width) for values in (machine.start, machine.end)]
    found_by = [
        {name: _widened(values, width) for name, values in by.items()}
        for by in (machine.start_by, machine.end_by)
    ]
    for loads, by, answers in zip(found, found_by, _at_both_ends(open_terms, drive), strict=True):
        for name in open_terms.derivatives:
            by.setdefault(name, np.zeros_like(loads))
        for row, place in enumerate(open_terms.places):
            column = columns.of(place)
            loads[:, column] += answers.heat.value[:, row]
            for target, name in enumerate(open_terms.derivatives):
                by[name][:, column] += answers.heat.by[:, row, target]
        for row, bearing in enumerate(open_terms.bearings):
            factor, slopes = answers.friction.value[:, row], answers.friction.by[:, row]
            for position in fast.heat_rows(bearing):
                own = loads[:, position].copy()
                loads[:, position] *= factor
                for slope in by.values():
                    slope[:, position] *= factor
                for target, name in enumerate(open_terms.derivatives):
                    by[name][:, position] += slopes[:, target] * own
    return OpenLoads(columns.loads(), columns.loads_by(), *found, *found_by, columns.fluids())


def _at_both_ends(terms: EffectTerms, drive: Drive) -> list[TermAnswers]:
    """Values of open terms just after the start and just before the end of every step.

    Derivatives by the requested parameters are total, (G, q, p), memory included.
    """
    steps = len(drive.steps)
    inputs = [
        {name: values[:, i] for i, name in enumerate(drive.names)} for values in (drive.start, drive.end)
    ]
    nothing = np.zeros((steps, 0))
    begin, end = Instants(drive.grid[:-1], inputs[0]), Instants(drive.grid[1:], inputs[1])
    memory, moves = remembered(
        terms,
        begin,
        drive.steps,
        nothing,
        Derivatives.ALL,
        held=np.array(drive.restarts, dtype=np.int64) - 1,
    )
    memory_by = carried(moves.by_state, moves.by_parameter)
    found = []
    for instants, at in ((begin, slice(0, steps)), (end, slice(1, steps + 1))):
        answers = terms.at(instants, nothing, memory[at])
        parts = (
            Quantities(item.value, item.by_parameter + item.by_state @ memory_by[at], 0, 0)
            for item in (answers.heat, answers.friction, answers.factor)
        )
        found.append(TermAnswers(*parts))
    return found


class _Columns:
    """Load columns that open terms need beside the machine's own."""

    def __init__(
        self, fast: FastModel, built: RunOperators, derivatives: Sequence[str], places: Sequence[str]
    ) -> None:
        self.fast, self.built, self.derivatives = fast, built, tuple(derivatives)
        self.names = [place for place in dict.fromkeys(places) if place != COOLANT_INLET]

    def of(self, place: str) -> int:
        """Column of a place."""
        if place == COOLANT_INLET:
            return self.fast.inlet_column
        return len(self.fast.load_names) + self.names.index(place)

    def fluids(self) -> dict[str, int]:
        """Column of the fluid of each film."""
        films = {place: self._film(place) for place in self.names}
        return {film: self.of(place) for place, film in films.items() if film is not None}

    def _film(self, place: str) -> str | None:
        """Coefficient of the film whose fluid a place is."""
        is_fluid = place.startswith(FLUID_PREFIX) and place not in self.fast.model.place_names
        return self.fast.fluid_places[place] if is_fluid else None

    def _vector(self, place: str, coefficients: Mapping[str, float]) -> Array:
        model, film = self.fast.model, self._film(place)
        if film is None:
            return model.place(place)
        return coefficients[film] * model.fluid_load[model.fluid_names.index(film)]

    def loads(self) -> list[Array]:
        """Load matrix of each class with the added columns."""
        return [
            np.column_stack((operators.loads, *(self._vector(place, values) for place in self.names)))
            for operators, values in zip(self.built.classes, self.built.coefficients, strict=True)
        ]

    def loads_by(self) -> list[dict[str, Array]]:
        """Derivatives of the load matrices; a film's factor scales what its fluid's shift does."""
        found = []
        first = len(self.fast.load_names)
        for operators, values in zip(self.built.classes, self.built.coefficients, strict=True):
            by = {
                name: _widened(matrix, first + len(self.names)) for name, matrix in operators.loads_by.items()
            }
            for position, place in enumerate(self.names):
                film = self._film(place)
                for index in self.built.touched.get(film, ()) if film is not None else ():
                    name = self.derivatives[index]
                    if name not in by:
                        by[name] = np.zeros((self.fast.model.size, first + len(self.names)))
                    by[name][:, first + position] += self._vector(place, values)
            found.append(by)
        return found


def _widened(values: Array, width: int) -> Array:
    found = np.zeros((len(values), width))
    found[:, : values.shape[1]] = values
    return found
