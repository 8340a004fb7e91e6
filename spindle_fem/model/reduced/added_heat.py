"""Contribution of temperature-dependent terms to a linear model, as few heats with their derivatives.

Heat of the terms, and the heat that a changed coefficient moves, are unknowns ``q`` of small number; the
linear model responds to them by precomputed columns, so that Newton's method works on ``q`` alone and a
step stays implicit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgesv

from spindle_fem.effects.framework.term import COOLANT_INLET, Term
from spindle_fem.errors import ConvergenceError
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.operation.effect_terms import (
    Derivatives,
    EffectTerms,
    Instants,
    Quantities,
    TermAnswers,
    require_known,
)

Array = NDArray[np.float64]

# Newton's last change; its square, in relative terms, is the error that is left.
TEMPERATURE_TOLERANCE = 1e-4
MOST_ITERATIONS = 25


@dataclass(frozen=True, slots=True)
class RunInstants:
    """Quantities of the model itself at some instants of a run.

    Attributes
    ----------
    coefficients : mapping of str to (n,) ndarray
        Those that terms scale or whose fluids they shift.
    friction : (n, n_heat_places) ndarray, [W]
        Heat that the machine itself gives to its heat places.
    friction_by : (n, n_heat_places, p) ndarray, [W]
        Its derivatives by the requested parameters.
    shifts : mapping of coefficient to ((n,) ndarray, (n, p) ndarray), [K]
        What shifts fluids beside these terms, and derivatives.
    """

    instants: Instants
    coefficients: Mapping[str, Array]
    friction: Array
    friction_by: Array
    shifts: Mapping[str, tuple[Array, Array]]

    def at(self, rows: NDArray[np.int64]) -> RunInstants:
        """Some of them."""
        return self._with(self.instants.at(rows), rows)

    def one(self, row: int) -> RunInstants:
        """One of the instants, with inputs as plain numbers."""
        inputs = {name: float(values[row]) for name, values in self.instants.inputs.items()}
        return self._with(Instants(float(self.instants.times[row]), inputs), slice(row, row + 1))

    def _with(self, instants: Instants, rows: slice | NDArray[np.int64]) -> RunInstants:
        return RunInstants(
            instants,
            {name: values[rows] for name, values in self.coefficients.items()},
            self.friction[rows],
            self.friction_by[rows],
            {name: (shift[rows], by[rows]) for name, (shift, by) in self.shifts.items()},
        )


@dataclass(frozen=True, slots=True)
class _Moved:
    """Heat that terms move by scaling one coefficient.

    Attributes
    ----------
    sensed, columns : slice
        Its directions among the sensed temperatures, and among what is added.
    vectors : (r, k) ndarray
        Its directions.
    spectrum : (k,) ndarray
        What the unit coefficient conducts in each.
    uniform : (k,) ndarray
        Coordinates of the uniform field of 1 K.
    fluid_scale : float
        Product of the factors on its fluid's temperature.
    fluid_targets : list of int
        Asked parameters among these factors.
    shifts : list of int
        Heats of the terms that are shifts of its fluid, K.
    depends : list of slice
        Derivatives of its factor that are not always zero.
    """

    coefficient: str
    sensed: slice
    columns: slice
    vectors: Array
    spectrum: Array
    uniform: Array
    fluid_scale: float
    fluid_targets: list[int]
    shifts: list[int]
    depends: list[slice]


class AddedHeat:
    """Temperature-dependent terms on one model: columns, sensed temperatures, evaluation.

    Added are every heat that terms put into places, then the heat of every heat place of every bearing whose
    friction they scale, then what every coefficient that they scale conducts more in each direction.

    Parameters
    ----------
    parameters : mapping of str to float
        Factors of the machine's parameters, and values of the terms' by outer name.
    derivatives : sequence of str
        Asked parameters, of terms or of the machine.

    Attributes
    ----------
    sense : (n_y, r) ndarray
        Sensed temperatures from the unknowns: what the terms read, then each direction of the
        coefficients that they scale.

    Raises
    ------
    SpecError
        A place, bearing or coefficient that the model does not have.
    """

    def __init__(
        self,
        fast: FastModel,
        terms: Sequence[Term],
        parameters: Mapping[str, float],
        derivatives: Sequence[str],
    ) -> None:
        self.fast, self.derivatives = fast, tuple(derivatives)
        model = fast.model
        require_terms(fast, terms)
        scaled = dict.fromkeys(name for term in terms for name in term.coefficients)
        directions = [fast.directions.of(name) for name in scaled]
        self.terms = EffectTerms(
            terms, parameters, derivatives, sum(len(spectrum) for _, spectrum in directions)
        )
        rows = [term.read_row(model, name) for term in terms for name in term.reads]
        rows += [vector for vectors, _ in directions for vector in vectors.T]
        self.sense = np.array(rows).reshape(-1, model.size)
        # Places whose heat is a shift of a film's fluid, in K: position and film.
        fluids = fast.fluid_places
        places = self.terms.places
        self._fluids = [(row, fluids[place]) for row, place in enumerate(places) if place in fluids]
        count = len(places)
        self._friction: list[tuple[slice, list[int], list[slice]]] = []
        for bearing in self.terms.bearings:
            positions = list(fast.heat_rows(bearing))
            depends = self.terms.depends("bearings", bearing)
            self._friction.append((slice(count, count + len(positions)), positions, depends))
            count += len(positions)
        self._moved: list[_Moved] = []
        first = len(self.terms.reads)
        for name, (vectors, spectrum) in zip(scaled, directions, strict=True):
            own, width = fast.fluid_parameters(name), len(spectrum)
            self._moved.append(
                _Moved(
                    name,
                    slice(first, first + width),
                    slice(count, count + width),
                    vectors,
                    spectrum,
                    vectors.T @ model.one,
                    float(np.prod([parameters.get(item, 1.0) for item in own])),
                    [i for i, item in enumerate(self.derivatives) if item in own],
                    [row for row, film in self._fluids if film == name],
                    self.terms.depends("coefficients", name),
                )
            )
            first, count = first + width, count + width
        self.n_added = count

    @property
    def wanted_coefficients(self) -> set[str]:
        """Coefficients whose values are needed."""
        return {item.coefficient for item in self._moved} | {film for _, film in self._fluids}

    def columns(self, inlet_load: Array) -> Array:
        """Load of every added quantity, (r, m); ``inlet_load`` is that of 1 K of the coolant's inlet."""
        fast, model = self.fast, self.fast.model
        found = np.empty((model.size, self.n_added))
        fluids = dict(self._fluids)
        for row, place in enumerate(self.terms.places):
            if row in fluids:
                found[:, row] = model.fluid_load[model.fluid_names.index(fluids[row])]
            else:
                found[:, row] = inlet_load if place == COOLANT_INLET else model.place(place)
        for columns, positions, _ in self._friction:
            found[:, columns] = np.column_stack([model.place(fast.heat_places[i]) for i in positions])
        for item in self._moved:
            found[:, item.columns] = item.vectors
        return found

    def inlet_columns(self) -> list[int]:
        """Columns that shift the coolant's inlet."""
        return [row for row, place in enumerate(self.terms.places) if place == COOLANT_INLET]

    def at(
        self,
        where: RunInstants,
        touched: Mapping[str, Sequence[int]],
        sensed: Array,
        states: Array,
        derivatives: Derivatives = Derivatives.ALL,
    ) -> Quantities:
        """Added quantities with derivatives, at one instant or many.

        Parameters
        ----------
        touched : mapping of coefficient to sequence of int
            Indices of the requested parameters that scale it.
        sensed : (n, n_y) ndarray, [K]
        states : (n, n_x) ndarray
            Memories of the terms.
        """
        answers = self.terms.at(where.instants, sensed, states, derivatives)
        width = answers.heat.by.shape[2]
        found = Quantities(
            np.empty((len(sensed), self.n_added)),
            np.zeros((len(sensed), self.n_added, width)),
            answers.heat.n_sensed,
            answers.heat.n_states,
        )
        self._put_heat(found, answers, where, touched)
        self._put_friction(found, answers, where)
        for number, item in enumerate(self._moved):
            self._put_moved(found, answers, where, touched, sensed, item, number)
        return found

    def _put_heat(
        self,
        found: Quantities,
        answers: TermAnswers,
        where: RunInstants,
        touched: Mapping[str, Sequence[int]],
    ) -> None:
        heat, number = answers.heat, len(self.terms.places)
        found.value[:, :number], found.by[:, :number] = heat.value, heat.by
        for row, film in self._fluids:
            coefficient = where.coefficients[film]
            found.value[:, row] *= coefficient
            found.by[:, row] *= coefficient[:, None]
            self._scaled_by(found, slice(row, row + 1), touched.get(film, ()))

    def _put_friction(self, found: Quantities, answers: TermAnswers, where: RunInstants) -> None:
        asked = found.by_parameter.shape[2]
        for number, (columns, positions, depends) in enumerate(self._friction):
            excess, own = answers.friction.value[:, number] - 1.0, where.friction[:, positions]
            found.value[:, columns] = excess[:, None] * own
            for part in depends:
                found.by[:, columns, part] = own[:, :, None] * answers.friction.by[:, number, None, part]
            if asked:
                found.by_parameter[:, columns] += excess[:, None, None] * where.friction_by[:, positions]

    def _put_moved(
        self,
        found: Quantities,
        answers: TermAnswers,
        where: RunInstants,
        touched: Mapping[str, Sequence[int]],
        sensed: Array,
        item: _Moved,
        number: int,
    ) -> None:
        """Heat that a scaled coefficient moves beyond what the operators hold."""
        columns, uniform, name = item.columns, item.uniform, item.coefficient
        strength = where.coefficients[name][:, None] * item.spectrum
        own = item.fluid_scale * self.fast.fluid_temperature(name, where.instants.inputs)
        shift, shift_by = where.shifts.get(name, (0.0, None))
        fluid = np.broadcast_to(own + shift, len(sensed))
        for row in item.shifts:
            fluid = fluid + answers.heat.value[:, row]
        flow = strength * (fluid[:, None] * uniform - sensed[:, item.sensed])
        excess = (answers.factor.value[:, number] - 1.0)[:, None]
        moved, by_fluid = excess * strength, excess * strength * uniform
        found.value[:, columns] = excess * flow
        for part in item.depends:
            found.by[:, columns, part] = flow[:, :, None] * answers.factor.by[:, number, None, part]
        width = found.by.shape[2]
        first = columns.start * width + item.sensed.start
        if width:
            # The derivative of each direction's column to that direction itself.
            diagonal = slice(first, first + len(uniform) * width, width + 1)
            found.by.reshape(len(sensed), -1)[:, diagonal] -= moved
        for row in item.shifts:
            found.by[:, columns] += by_fluid[:, :, None] * answers.heat.by[:, row, None]
        by_parameter = found.by_parameter
        if by_parameter.shape[2]:
            self._scaled_by(found, columns, touched.get(name, ()))
            for target in item.fluid_targets:
                by_parameter[:, columns, target] += by_fluid * np.reshape(own, (-1, 1))
            if shift_by is not None:
                by_parameter[:, columns] += by_fluid[:, :, None] * shift_by[:, None, :]

    @staticmethod
    def _scaled_by(found: Quantities, columns: slice, targets: Sequence[int]) -> None:
        """Add derivatives of quantities proportional to requested parameters, by their logarithms."""
        if found.by_parameter.shape[2]:
            for target in targets:
                found.by_parameter[:, columns, target] += found.value[:, columns]


def require_terms(fast: FastModel, terms: Sequence[Term]) -> None:
    """Refuse terms that name what a model does not have.

    Raises
    ------
    SpecError
    """
    inlet = () if fast.inlet_column is None else (COOLANT_INLET,)
    require_known(
        terms,
        places=fast.model.place_names,
        fluids=(*fast.fluid_places, *inlet),
        bearings=fast.bearings,
        coefficients=fast.model.coefficient_names,
    )


def solve_added(
    evaluate: Callable[[Array], Quantities], base: Array, response: Array, guess: Array, time: float
) -> tuple[Array, Quantities]:
    """Added quantities ``q = N(base + response q)`` of one instant by Newton's method.

    Parameters
    ----------
    evaluate : callable
        Sensed temperatures (1, n_y) to the added quantities.
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
        found = evaluate((base + response @ added)[None])
        matrix = found.by_sensed[0] @ response
        np.negative(matrix, out=matrix)
        matrix.reshape(-1)[diagonal] += 1.0
        # Straight to the factorisation: numpy's checks would cost more than these few unknowns.
        *_, change, singular = dgesv(matrix, found.value[0] - added, overwrite_a=True)
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
