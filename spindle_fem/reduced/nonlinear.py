"""Transients with terms: each step solves for the few quantities that the terms add.

Heat of the terms, and the heat that a changed coefficient moves, are unknowns
``q`` of small number; the linear model answers to them by precomputed columns,
so that Newton's method works on ``q`` alone and the step stays implicit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from spindle_fem.errors import ConvergenceError, SpecError, did_you_mean
from spindle_fem.reduced.drive import Drive
from spindle_fem.reduced.fast_model import FastModel
from spindle_fem.reduced.terms import COOLANT_INLET, FLUID_PREFIX, Term, TermContext

Array = NDArray[np.float64]

COMPLEX_STEP = 1e-30
# In the energy-orthonormal basis an eigenvalue is a share of the stored energy's dissipation.
RANK_TOLERANCE = 1e-3
# Newton's last change; its square, in relative terms, is the error that is left.
TEMPERATURE_TOLERANCE = 1e-4
MOST_ITERATIONS = 25


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Added quantities at one instant and their derivatives.

    Attributes
    ----------
    value : (m,) ndarray
    by_sensed : (m, n_y) ndarray
    by_state : (m, n_x) ndarray
    by_parameter : (m, p) ndarray
        Explicit part, to the coordinates of the asked parameters.
    """

    value: Array
    by_sensed: Array
    by_state: Array
    by_parameter: Array


@dataclass(frozen=True, slots=True)
class _Layout:
    """Which complex columns of a term's answer belong to which derivative."""

    reads: slice
    states: slice
    n_reads: int
    n_states: int
    targets: list[int]

    def spread(self, answer: NDArray, rows: slice, scale: Array, slopes: tuple[Array, Array, Array]) -> None:
        """Add one complex answer, times what it multiplies in each row, to the derivatives."""
        by_sensed, by_state, by_parameter = slopes
        found = np.imag(answer) / COMPLEX_STEP
        split = 1 + self.n_reads
        by_sensed[rows, self.reads] += np.outer(scale, found[1:split])
        by_state[rows, self.states] += np.outer(scale, found[split : split + self.n_states])
        for i, target in enumerate(self.targets):
            by_parameter[rows, target] += scale * found[split + self.n_states + i]


class DynamicTerms:
    """The dynamic terms of a model on one drive: columns, sensed temperatures, evaluation.

    Parameters
    ----------
    fast : FastModel
    drive : Drive
    terms : sequence of Term
        Those that are dynamic.
    values : mapping of str to float
        Term parameters by outer name.
    derivatives : sequence of str
        Parameters to differentiate by, of terms or of the machine.
    """

    def __init__(
        self,
        fast: FastModel,
        drive: Drive,
        terms: Sequence[Term],
        values: Mapping[str, float],
        derivatives: Sequence[str],
    ) -> None:
        self.fast, self.drive, self.terms, self.derivatives = fast, drive, tuple(terms), tuple(derivatives)
        self.values = [term.values(values) for term in terms]
        model = fast.model
        rows: list[Array] = []
        self._reads: list[slice] = []
        for term in terms:
            start = len(rows)
            for name in term.reads:
                if name not in model.place_names:
                    raise SpecError(
                        f"term {term.name}", f'reads "{name}".', did_you_mean(name, model.place_names)
                    )
                rows.append(model.place(name))
            self._reads.append(slice(start, len(rows)))
        self._heat: list[slice] = []
        self.place_columns: list[tuple[int, str]] = []
        self._moved: list[list[tuple[str, slice, slice]]] = []
        self._spectra: dict[str, Array] = {}
        count = 0
        for term in terms:
            self._heat.append(slice(count, count + len(term.heat_places)))
            for place in term.heat_places:
                self._require_place(term, place)
                self.place_columns.append((count, place))
                count += 1
        self._moved_columns: list[tuple[slice, Array]] = []
        for term in terms:
            moved = []
            for coefficient in term.coefficients:
                vectors, spectrum = self._factorised(term, coefficient)
                sensed = slice(len(rows), len(rows) + vectors.shape[1])
                columns = slice(count, count + vectors.shape[1])
                rows.extend(vectors.T)
                self._spectra[coefficient] = spectrum
                self._moved_columns.append((columns, vectors))
                moved.append((coefficient, sensed, columns))
                count += vectors.shape[1]
            self._moved.append(moved)
        self.n_added = count
        self.sense = np.array(rows).reshape(-1, model.size)
        sizes = [term.n_states for term in terms]
        ends = np.cumsum([0, *sizes])
        self._states = [slice(ends[i], ends[i + 1]) for i in range(len(terms))]
        self.n_states = int(ends[-1])
        self._own: list[dict[str, int]] = [
            {term.names()[name].name: i for i, name in enumerate(self.derivatives) if name in term.names()}
            for term in terms
        ]

    def _require_place(self, term: Term, place: str) -> None:
        model = self.fast.model
        fluids = [f"{FLUID_PREFIX}{name.removeprefix('film.')}" for name in model.fluid_names] + [
            COOLANT_INLET
        ]
        if place not in model.place_names and place not in fluids:
            raise SpecError(
                f"term {term.name}",
                f'puts heat into "{place}".',
                did_you_mean(place, [*model.place_names, *fluids]),
            )

    def _factorised(self, term: Term, coefficient: str) -> tuple[Array, Array]:
        """``K_i = Q D Qᵀ`` with the directions in which it conducts anything."""
        model = self.fast.model
        if coefficient not in model.coefficient_names:
            raise SpecError(
                f"term {term.name}",
                f'scales "{coefficient}" by temperature.',
                did_you_mean(coefficient, model.coefficient_names),
            )
        matrix = model.operators[model.coefficient_names.index(coefficient)]
        spectrum, vectors = eigh(matrix)
        kept = spectrum > RANK_TOLERANCE * spectrum[-1]
        return vectors[:, kept], spectrum[kept]

    def columns(self, inlet_load: Array) -> Array:
        """What every added quantity puts in, (r, m); ``inlet_load`` is that of 1 K of the coolant's inlet."""
        model = self.fast.model
        found = np.zeros((model.size, self.n_added))
        for column, place in self.place_columns:
            if place == COOLANT_INLET:
                found[:, column] = inlet_load
            elif place.startswith(FLUID_PREFIX) and place not in model.place_names:
                film = "film." + place.removeprefix(FLUID_PREFIX)
                found[:, column] = model.fluid_load[model.fluid_names.index(film)]
            else:
                found[:, column] = model.place(place)
        for columns, vectors in self._moved_columns:
            found[:, columns] = vectors
        return found

    def inlet_columns(self) -> list[int]:
        """Columns that shift the coolant's inlet."""
        return [column for column, place in self.place_columns if place == COOLANT_INLET]

    def initial_states(self) -> Array:
        """States of all terms at time zero."""
        parts = [term.initial_state(values) for term, values in zip(self.terms, self.values, strict=True)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def _context(
        self, number: int, time: float, inputs: Mapping[str, float], sensed: Array, states: Array
    ) -> tuple[TermContext, int, int, list[int]]:
        """Context of a term with one column unperturbed and one for each direction."""
        term = self.terms[number]
        n_reads, n_states = len(term.reads), term.n_states
        own = self._own[number]
        width = 1 + n_reads + n_states + len(own)
        temperatures = np.repeat(sensed[self._reads[number], None], width, axis=1).astype(complex)
        state = np.repeat(states[self._states[number], None], width, axis=1).astype(complex)
        for i in range(n_reads):
            temperatures[i, 1 + i] += 1j * COMPLEX_STEP
        for i in range(n_states):
            state[i, 1 + n_reads + i] += 1j * COMPLEX_STEP
        parameters, targets = {}, []
        kinds = {item.name: item.logarithmic for item in term.parameters}
        for name, value in self.values[number].items():
            parameters[name] = np.full(width, value, dtype=complex)
        for i, (name, target) in enumerate(own.items()):
            scale = parameters[name][0].real if kinds[name] else 1.0
            parameters[name][1 + n_reads + n_states + i] += 1j * COMPLEX_STEP * scale
            targets.append(target)
        return TermContext(time, inputs, temperatures, state, parameters), n_reads, n_states, targets

    def evaluate(
        self,
        time: float,
        inputs: Mapping[str, float],
        coefficients: Mapping[str, float],
        touched: Mapping[str, Sequence[int]],
        sensed: Array,
        states: Array,
    ) -> Evaluation:
        """Added quantities where the sensed temperatures are given.

        Parameters
        ----------
        time : float, [s]
        inputs : mapping of str to float
        coefficients : mapping of str to float
            Of the class.
        touched : mapping of coefficient to sequence of int
            Which of the derivatives scale it.
        sensed : (n_y,) ndarray
        states : (n_x,) ndarray
        """
        n_sensed, n_derivatives = len(self.sense), len(self.derivatives)
        value = np.zeros(self.n_added)
        by_sensed = np.zeros((self.n_added, n_sensed))
        by_state = np.zeros((self.n_added, self.n_states))
        by_parameter = np.zeros((self.n_added, n_derivatives))
        for number, term in enumerate(self.terms):
            context, n_reads, n_states, targets = self._context(number, time, inputs, sensed, states)
            layout = _Layout(self._reads[number], self._states[number], n_reads, n_states, targets)
            slopes = (by_sensed, by_state, by_parameter)
            if term.heat_places:
                answers = term.heat(context)
                for i, place in enumerate(term.heat_places):
                    row = self._heat[number].start + i
                    film = "film." + place.removeprefix(FLUID_PREFIX)
                    shifts_film = place.startswith(FLUID_PREFIX) and film in coefficients
                    scale = coefficients[film] if shifts_film else 1.0
                    value[row] = scale * answers[i, 0].real
                    layout.spread(answers[i], slice(row, row + 1), np.array([scale]), slopes)
                    for target in touched.get(film, ()) if shifts_film else ():
                        by_parameter[row, target] += value[row]
            if term.coefficients:
                answers = term.factor(context)
                for i, (coefficient, own_sensed, columns) in enumerate(self._moved[number]):
                    strength = coefficients[coefficient] * self._spectra[coefficient]
                    fluid = self._fluid_temperature(coefficient, inputs)
                    difference = sensed[own_sensed] - fluid * (self.sense[own_sensed] @ self.fast.model.one)
                    excess = answers[i, 0].real - 1.0
                    value[columns] = -excess * strength * difference
                    by_sensed[columns, own_sensed] -= np.diag(excess * strength)
                    layout.spread(answers[i], columns, -strength * difference, slopes)
                    for target in touched.get(coefficient, ()):
                        by_parameter[columns, target] += value[columns]
        return Evaluation(value, by_sensed, by_state, by_parameter)

    def _fluid_temperature(self, coefficient: str, inputs: Mapping[str, float]) -> float:
        """Temperature that a film's heat counts from; 0 for what conducts between solids."""
        if coefficient not in self.fast.model.fluid_names:
            return 0.0
        surface = coefficient.removeprefix("film.")
        film = next(f for f in self.fast.spec.film if surface in f.surface)
        return inputs["ambient"] if film.temperature == "ambient" else film.temperature

    def advance(
        self, time: float, step: float, inputs: Mapping[str, float], sensed: Array, states: Array
    ) -> tuple[Array, Array, Array, Array]:
        """States after a step, and their derivatives to sensed temperatures, states and parameters."""
        after = states.copy()
        by_sensed = np.zeros((self.n_states, len(self.sense)))
        by_state = np.zeros((self.n_states, self.n_states))
        by_parameter = np.zeros((self.n_states, len(self.derivatives)))
        for number, term in enumerate(self.terms):
            if not term.n_states:
                continue
            context, n_reads, n_states, targets = self._context(number, time, inputs, sensed, states)
            answer = term.advance(context, step)
            own = self._states[number]
            after[own] = answer[:, 0].real
            slopes = np.imag(answer) / COMPLEX_STEP
            by_sensed[own, self._reads[number]] = slopes[:, 1 : 1 + n_reads]
            by_state[own, own] = slopes[:, 1 + n_reads : 1 + n_reads + n_states]
            for i, target in enumerate(targets):
                by_parameter[own, target] = slopes[:, 1 + n_reads + n_states + i]
        return after, by_sensed, by_state, by_parameter


def solve_added(
    evaluate: object, base: Array, response: Array, guess: Array, where: str
) -> tuple[Array, Evaluation]:
    """Added quantities ``q = N(base + response q)`` by Newton's method.

    Parameters
    ----------
    evaluate : callable
        Sensed temperatures to :class:`Evaluation`.
    base : (n_y,) ndarray, [K]
        Sensed temperatures without them.
    response : (n_y, m) ndarray
    guess : (m,) ndarray
    where : str
        For the message.

    Raises
    ------
    ConvergenceError
    """
    added = guess
    identity = np.eye(len(guess))
    for _ in range(MOST_ITERATIONS):
        found = evaluate(base + response @ added)
        change = np.linalg.solve(identity - found.by_sensed @ response, found.value - added)
        added = added + change
        moved = float(np.abs(response @ change).max()) if response.size else 0.0
        if not np.isfinite(moved):
            break
        if moved <= TEMPERATURE_TOLERANCE:
            return added, found
    raise ConvergenceError(
        where,
        "the terms of the fast model find no common state.",
        "Their heat may rise faster with temperature than it can flow away; take smaller steps.",
    )
