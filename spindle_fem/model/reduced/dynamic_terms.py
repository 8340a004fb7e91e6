"""Transients with terms: each step solves for the few quantities that the terms add.

Heat of the terms, and the heat that a changed coefficient moves, are unknowns
``q`` of small number; the linear model answers to them by precomputed columns,
so that Newton's method works on ``q`` alone and the step stays implicit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgesv

from spindle_fem.effects.framework.term import COOLANT_INLET, Term
from spindle_fem.errors import ConvergenceError, SpecError, did_you_mean
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.term_layout import Evaluation, Layout

Array = NDArray[np.float64]

# Newton's last change; its square, in relative terms, is the error that is left.
TEMPERATURE_TOLERANCE = 1e-4
MOST_ITERATIONS = 25
NO_SHIFTS: Mapping[str, tuple[float, Array]] = MappingProxyType({})
NO_SHIFT = (0.0, None)


@dataclass(frozen=True, slots=True)
class Moved:
    """Heat that a term moves by scaling one coefficient.

    Attributes
    ----------
    coefficient : str
    sensed, columns : slice
        Its directions among the sensed temperatures, and among what is added.
    spectrum : (k,) ndarray
        What the unit coefficient conducts in each direction.
    uniform : (k,) ndarray
        Coordinates of the uniform field of 1 K.
    fluid_scale : float
        Product of the factors on its fluid's temperature.
    fluid_targets : list of int
        Asked parameters among these factors.
    fluid_rows : list of int
        Added quantities that shift its fluid.
    diagonal : slice
        Derivatives of its columns to its own directions, among all of them row by row.
    """

    coefficient: str
    sensed: slice
    columns: slice
    spectrum: Array
    uniform: Array
    fluid_scale: float
    fluid_targets: list[int]
    fluid_rows: list[int]
    diagonal: slice


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
        self.read_rows: list[slice] = []
        for term in terms:
            start = len(rows)
            for name in term.reads:
                if name not in model.place_names:
                    raise SpecError(
                        f"term {term.name}", f'reads "{name}".', did_you_mean(name, model.place_names)
                    )
                rows.append(model.place(name))
            self.read_rows.append(slice(start, len(rows)))
        self.heat_rows: list[slice] = []
        self.place_columns: list[tuple[int, str]] = []
        scaled_coefficients: list[list[tuple[str, slice, slice, Array]]] = []
        count = 0
        for term in terms:
            self.heat_rows.append(slice(count, count + len(term.heat_places)))
            for place in term.heat_places:
                self._require_place(term, place)
                self.place_columns.append((count, place))
                count += 1
        # Friction: columns of the places that a bearing heats, and their positions among the heat places.
        # A term scales what those before it made of the same friction: their columns, by place in its own.
        self.friction_rows: list[list[tuple[slice, list[int], list[tuple[int, int]]]]] = []
        made: dict[int, list[int]] = {}
        for term in terms:
            scaled = []
            for bearing in term.bearings:
                positions = self._heat_rows(term, bearing)
                before = [(i, row) for i, position in enumerate(positions) for row in made.get(position, ())]
                scaled.append((slice(count, count + len(positions)), positions, before))
                for i, position in enumerate(positions):
                    made.setdefault(position, []).append(count + i)
                for position in positions:
                    self.place_columns.append((count, fast.heat_places[position]))
                    count += 1
            self.friction_rows.append(scaled)
        self._moved_columns: list[tuple[slice, Array]] = []
        for term in terms:
            moved = []
            for coefficient in term.coefficients:
                vectors, spectrum = self._directions(term, coefficient)
                sensed = slice(len(rows), len(rows) + vectors.shape[1])
                columns = slice(count, count + vectors.shape[1])
                rows.extend(vectors.T)
                self._moved_columns.append((columns, vectors))
                moved.append((coefficient, sensed, columns, spectrum))
                count += vectors.shape[1]
            scaled_coefficients.append(moved)
        self.n_added = count
        self.sense = np.array(rows).reshape(-1, model.size)
        sizes = [term.n_states for term in terms]
        ends = np.cumsum([0, *sizes])
        self.state_rows = [slice(ends[i], ends[i + 1]) for i in range(len(terms))]
        self.n_states = int(ends[-1])
        self.layouts = []
        self.shifted: list[list[tuple[int, str]]] = []
        for number, term in enumerate(terms):
            names = term.names()
            own = {names[name].name: i for i, name in enumerate(self.derivatives) if name in names}
            self.layouts.append(
                Layout.of(term, self.values[number], self.read_rows[number], self.state_rows[number], own)
            )
            fluids = fast.fluid_places
            self.shifted.append(
                [(i, fluids[place]) for i, place in enumerate(term.heat_places) if place in fluids]
            )
        self.moved = [[self._moved_by(*item, values) for item in items] for items in scaled_coefficients]
        self._strengths: dict[tuple[str, float], Array] = {}

    def _moved_by(
        self, coefficient: str, sensed: slice, columns: slice, spectrum: Array, values: Mapping[str, float]
    ) -> Moved:
        fast, n_sensed = self.fast, len(self.sense)
        own = fast.fluid_parameters(coefficient)
        first = columns.start * n_sensed + sensed.start
        return Moved(
            coefficient,
            sensed,
            columns,
            spectrum,
            self.sense[sensed] @ fast.model.one,
            float(np.prod([values.get(name, 1.0) for name in own])),
            [i for i, name in enumerate(self.derivatives) if name in own],
            [row for row, place in self.place_columns if fast.fluid_places.get(place) == coefficient],
            slice(first, first + len(spectrum) * n_sensed, n_sensed + 1),
        )

    def _strength(self, item: Moved, value: float) -> Array:
        """What a coefficient of some value conducts in each direction, (k,) W/K."""
        key = (item.coefficient, value)
        found = self._strengths.get(key)
        if found is None:
            found = self._strengths[key] = value * item.spectrum
        return found

    def _require_place(self, term: Term, place: str) -> None:
        model = self.fast.model
        fluids = list(self.fast.fluid_places)
        if self.fast.inlet_column is not None:
            fluids.append(COOLANT_INLET)
        if place not in model.place_names and place not in fluids:
            raise SpecError(
                f"term {term.name}",
                f'puts heat into "{place}".',
                did_you_mean(place, [*model.place_names, *fluids]),
            )

    def _heat_rows(self, term: Term, bearing: str) -> list[int]:
        if bearing not in self.fast.bearings:
            raise SpecError(
                f"term {term.name}",
                f'scales the friction of "{bearing}".',
                did_you_mean(bearing, self.fast.bearings),
            )
        return list(self.fast.heat_rows(bearing))

    def _directions(self, term: Term, coefficient: str) -> tuple[Array, Array]:
        model = self.fast.model
        if coefficient not in model.coefficient_names:
            raise SpecError(
                f"term {term.name}",
                f'scales "{coefficient}" by temperature.',
                did_you_mean(coefficient, model.coefficient_names),
            )
        return self.fast.directions.of(coefficient)

    def columns(self, inlet_load: Array) -> Array:
        """What every added quantity puts in, (r, m); ``inlet_load`` is that of 1 K of the coolant's inlet."""
        model = self.fast.model
        found = np.zeros((model.size, self.n_added))
        for column, place in self.place_columns:
            if place == COOLANT_INLET:
                found[:, column] = inlet_load
            elif place in self.fast.fluid_places:
                film = self.fast.fluid_places[place]
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

    def evaluate(
        self,
        time: float,
        inputs: Mapping[str, float],
        coefficients: Mapping[str, float],
        touched: Mapping[str, Sequence[int]],
        sensed: Array,
        states: Array,
        friction: Array,
        friction_by: Array,
        shifts: Mapping[str, tuple[float, Array]] = NO_SHIFTS,
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
        friction : (n_heat_places,) ndarray, [W]
            Heat that the machine itself gives to its heat places.
        friction_by : (n_heat_places, p) ndarray, [W]
            Its derivatives to the coordinates of the asked parameters.
        shifts : mapping of coefficient to (float, (p,) ndarray), [K]
            What shifts fluids beside these terms, and derivatives.
        """
        n_sensed, n_derivatives = len(self.sense), len(self.derivatives)
        value = np.zeros(self.n_added)
        by_sensed = np.zeros((self.n_added, n_sensed))
        by_state = np.zeros((self.n_added, self.n_states))
        by_parameter = np.zeros((self.n_added, n_derivatives))
        slopes = (by_sensed, by_state, by_parameter)
        contexts = [layout.context(time, inputs, sensed, states) for layout in self.layouts]
        for number, term in enumerate(self.terms):
            layout, context = self.layouts[number], contexts[number]
            if term.heat_places:
                answers = np.asarray(term.heat(context), dtype=complex)
                rows = self.heat_rows[number]
                value[rows] = answers[:, 0].real
                scale: Array | float = 1.0
                if self.shifted[number]:
                    scale = np.ones((len(answers), 1))
                    for i, film in self.shifted[number]:
                        scale[i] = coefficients[film]
                    value[rows] *= scale[:, 0]
                layout.spread(answers, rows, scale, slopes)
                for i, film in self.shifted[number]:
                    for target in touched.get(film, ()):
                        by_parameter[rows.start + i, target] += value[rows.start + i]
            if term.bearings:
                answers = np.asarray(term.friction(context), dtype=complex)
                for i, (columns, positions, before) in enumerate(self.friction_rows[number]):
                    excess = answers[i, 0].real - 1.0
                    scaled = friction[positions]
                    for own, row in before:
                        scaled[own] += value[row]
                        for slope in slopes:
                            slope[columns.start + own] += excess * slope[row]
                    value[columns] = excess * scaled
                    layout.spread(answers[i : i + 1], columns, scaled[:, None], slopes)
                    by_parameter[columns] += excess * friction_by[positions]
        # What shifts fluids is known: heat that a changed film moves counts from where they are now.
        for number, term in enumerate(self.terms):
            if not term.coefficients:
                continue
            layout = self.layouts[number]
            answers = np.asarray(term.factor(contexts[number]), dtype=complex)
            for i, item in enumerate(self.moved[number]):
                coefficient, columns = item.coefficient, item.columns
                strength, uniform = self._strength(item, coefficients[coefficient]), item.uniform
                fluid = item.fluid_scale * self.fast.fluid_temperature(coefficient, inputs)
                shift, shift_by = shifts.get(coefficient, NO_SHIFT)
                flow = strength * ((fluid + shift) * uniform - sensed[item.sensed])
                excess = answers[i, 0].real - 1.0
                value[columns] = excess * flow
                by_sensed.reshape(-1)[item.diagonal] -= excess * strength
                for target in touched.get(coefficient, ()):
                    by_parameter[columns, target] += value[columns]
                for target in item.fluid_targets:
                    by_parameter[columns, target] += excess * strength * fluid * uniform
                if shift_by is not None:
                    by_parameter[columns] += np.outer(excess * strength * uniform, shift_by)
                for row in item.fluid_rows:
                    # These rows are shifts times the coefficient, and so are their derivatives.
                    share = item.spectrum * uniform
                    flow = flow + share * value[row]
                    value[columns] += excess * share * value[row]
                    moved = (excess * share)[:, None]
                    for slope in slopes:
                        slope[columns] += moved * slope[row]
                layout.spread(answers[i : i + 1], columns, flow[:, None], slopes)
        return Evaluation(value, by_sensed, by_state, by_parameter)

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
            layout = self.layouts[number]
            answer = np.asarray(
                term.advance(layout.context(time, inputs, sensed, states), step), dtype=complex
            )
            after[layout.states] = answer[:, 0].real
            layout.spread(answer, layout.states, 1.0, (by_sensed, by_state, by_parameter))
        return after, by_sensed, by_state, by_parameter


def solve_added(
    evaluate: Callable[[Array], Evaluation], base: Array, response: Array, guess: Array, time: float
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
    time : float, [s]
        For the message.

    Raises
    ------
    ConvergenceError
    """
    added = guess
    diagonal = slice(None, None, len(guess) + 1)
    for _ in range(MOST_ITERATIONS):
        found = evaluate(base + response @ added)
        matrix = found.by_sensed @ response
        np.negative(matrix, out=matrix)
        matrix.reshape(-1)[diagonal] += 1.0
        # Straight to the factorisation: numpy's checks would cost more than these few unknowns.
        *_, change, singular = dgesv(matrix, found.value - added, overwrite_a=True)
        if singular:
            break
        added = added + change
        moved = float(np.abs(response @ change).max()) if response.size else 0.0
        if not math.isfinite(moved):
            break
        if moved <= TEMPERATURE_TOLERANCE:
            return added, found
    raise ConvergenceError(
        f"t = {time:.0f} s",
        "the terms of the fast model find no common state.",
        "Their heat may rise faster with temperature than it can flow away; take smaller steps.",
    )
