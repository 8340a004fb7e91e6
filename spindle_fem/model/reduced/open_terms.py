"""Terms that do not look at temperatures: their heat is known before the march.

What follows only time, inputs and its own memory needs no solution within a
step. It is evaluated at all steps at once and joins the load inputs, with its
derivatives, so that the march is that of the linear model.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import COOLANT_INLET, FLUID_PREFIX, Term, TermContext
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.run_operators import RunOperators
from spindle_fem.model.reduced.term_layout import COMPLEX_STEP, Layout
from spindle_fem.model.reduced.term_memory import Moves, carried, moves_over, remembered

Array = NDArray[np.float64]


def is_open(term: Term) -> bool:
    """Whether a term adds heat that follows no temperature."""
    return term.is_dynamic and not term.reads and not term.coefficients


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
        derivatives : sequence of str

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
    inputs: tuple[Array, Array],
    inputs_by: tuple[Mapping[str, Array], Mapping[str, Array]],
    terms: Sequence[Term],
    parameters: Mapping[str, float],
    derivatives: Sequence[str],
) -> OpenLoads:
    """Load inputs with the heat of open terms.

    Parameters
    ----------
    fast : FastModel or NetworkFastModel
    drive : Drive
    built : RunOperators
    inputs : pair of (G, n_w) ndarray
        The machine's own, at the start and end of each step.
    inputs_by : pair of mapping of parameter to (G, <= n_w) ndarray
    terms : sequence of Term
        Open ones.
    parameters : mapping of str to float
        Values of the terms' parameters by outer name.
    derivatives : sequence of str

    Raises
    ------
    SpecError
        A place or bearing that the machine does not have.
    """
    columns = _Columns(fast, built, derivatives)
    for term in terms:
        columns.take(term)
    width = len(fast.load_names) + len(columns.names)
    found = [_widened(values, width) for values in inputs]
    found_by = [{name: _widened(values, width) for name, values in by.items()} for by in inputs_by]
    for term in terms:
        names = term.names()
        own = [name for name in derivatives if name in names]
        values = term.values(parameters)
        perturbed = _perturbed(term, values, own)
        memory = _memory(term, values, perturbed, drive)
        for end, (loads, by) in enumerate(zip(found, found_by, strict=True)):
            context = _context(drive, perturbed, memory, at_end=bool(end))
            shape = (-1, len(drive.steps), 1 + len(own))
            if term.heat_places:
                heat = np.asarray(term.heat(context), dtype=complex).reshape(shape)
                for row, place in enumerate(term.heat_places):
                    _add(loads, by, columns.of(place), heat[row], own)
            if term.bearings:
                factor = np.asarray(term.friction(context), dtype=complex).reshape(shape)
                for row, bearing in enumerate(term.bearings):
                    for position in fast.heat_rows(bearing):
                        # The machine's own, times what terms before this one make of it.
                        friction = loads[:, position].copy()
                        slopes = {name: slope[:, position].copy() for name, slope in by.items()}
                        _add(loads, by, position, (factor[row] - 1.0) * friction[:, None], own)
                        excess = factor[row, :, 0].real - 1.0
                        for name, slope in slopes.items():
                            by[name][:, position] += excess * slope
    return OpenLoads(columns.loads(), columns.loads_by(), *found, *found_by, columns.fluids())


class _Columns:
    """Load columns that open terms need beside the machine's own."""

    def __init__(self, fast: FastModel, built: RunOperators, derivatives: Sequence[str]) -> None:
        self.fast, self.built, self.derivatives = fast, built, tuple(derivatives)
        self.names: list[str] = []

    def take(self, term: Term) -> None:
        """Make room for a term's places."""
        model, fluids = self.fast.model, self.fast.fluid_places
        for place in term.heat_places:
            if place == COOLANT_INLET and self.fast.inlet_column is not None:
                continue
            known = place in model.place_names or place in fluids
            if not known:
                allowed = [*model.place_names, *fluids]
                raise SpecError(
                    f"term {term.name}", f'puts heat into "{place}".', did_you_mean(place, allowed)
                )
            if place not in self.names:
                self.names.append(place)
        for bearing in term.bearings:
            if bearing not in self.fast.bearings:
                raise SpecError(
                    f"term {term.name}",
                    f'scales the friction of "{bearing}".',
                    did_you_mean(bearing, self.fast.bearings),
                )

    def of(self, place: str) -> int:
        """Column of a place."""
        if place == COOLANT_INLET and self.fast.inlet_column is not None:
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


def _perturbed(term: Term, values: Mapping[str, float], own: Sequence[str]) -> dict[str, NDArray]:
    """Parameters with one complex column for each derivative."""
    found = {name: np.full(1 + len(own), value, dtype=complex) for name, value in values.items()}
    names = term.names()
    for column, outer in enumerate(own, 1):
        item = names[outer]
        found[item.name][column] += 1j * COMPLEX_STEP * (values[item.name] if item.logarithmic else 1.0)
    return found


def _memory(
    term: Term, values: Mapping[str, float], perturbed: Mapping[str, NDArray], drive: Drive
) -> NDArray:
    """State before each step and after the last, (n_states, G + 1, columns)."""
    steps = len(drive.steps)
    width = len(next(iter(perturbed.values()))) if perturbed else 1
    memory = np.zeros((term.n_states, steps + 1, width), dtype=complex)
    if not term.n_states:
        return memory
    own = tuple(item.name for item in term.parameters if np.any(perturbed[item.name].imag))
    layout = Layout.of(term, values, slice(0, 0), slice(0, term.n_states), _targets(perturbed, own))
    inputs = {name: drive.start[:, i] for i, name in enumerate(drive.names)}
    nothing = np.zeros((steps, 0))
    gaps = np.array(drive.restarts, dtype=np.int64) - 1

    def tell(states: Array) -> Moves:
        moves = moves_over(
            [(term, layout)],
            (term.n_states, 0, width - 1),
            lambda layout, states: layout.context_over(drive.grid[:-1], inputs, nothing, states, slopes=True),
            drive.steps,
            states,
        )
        moves.hold(gaps, states)
        return moves

    found, moves = remembered(tell, term.initial_state(values), steps)
    memory += found.T[:, :, None]
    slopes = carried(moves.by_state, moves.by_parameter)
    memory[:, :, 1:] += 1j * COMPLEX_STEP * slopes.transpose(1, 0, 2)
    return memory


def _targets(perturbed: Mapping[str, NDArray], names: Sequence[str]) -> dict[str, int]:
    """Derivative that each perturbed parameter belongs to."""
    return {name: int(np.flatnonzero(perturbed[name].imag)[0]) - 1 for name in names}


def _context(drive: Drive, perturbed: Mapping[str, NDArray], memory: NDArray, *, at_end: bool) -> TermContext:
    """All instants and complex columns side by side."""
    width, steps = memory.shape[2], len(drive.steps)
    at = slice(1, steps + 1) if at_end else slice(0, steps)
    inputs = drive.end if at_end else drive.start
    return TermContext(
        np.repeat(drive.grid[at], width),
        {name: np.repeat(inputs[:, i], width) for i, name in enumerate(drive.names)},
        np.zeros((0, steps * width), dtype=complex),
        memory[:, at].reshape(len(memory), steps * width),
        {name: np.tile(column, steps) for name, column in perturbed.items()},
    )


def _add(
    loads: Array,
    by: dict[str, Array],
    column: int,
    values: NDArray,
    own: Sequence[str],
) -> None:
    """Add values (G, 1 + derivatives) to a load input and its derivatives."""
    loads[:, column] += values[:, 0].real
    for position, name in enumerate(own, 1):
        if name not in by:
            by[name] = np.zeros_like(loads)
        by[name][:, column] += values[:, position].imag / COMPLEX_STEP
