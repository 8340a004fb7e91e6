"""Terms at many instants at once, which costs little more than at one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import TermContext
from spindle_fem.model.reduced.dynamic_terms import DynamicTerms
from spindle_fem.model.reduced.term_layout import Layout

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Instants:
    """What terms are told at some instants beside temperatures and states.

    Attributes
    ----------
    times : (n,) ndarray, [s]
    inputs : mapping of str to (n,) ndarray
    coefficients : mapping of str to (n,) ndarray
        Those that terms scale or whose fluids they shift.
    friction : (n, n_heat_places) ndarray, [W]
        Heat that the machine itself gives to its heat places.
    friction_by : (n, n_heat_places, p) ndarray, [W]
    shifts : mapping of coefficient to ((n,) ndarray, (n, p) ndarray), [K]
        What shifts fluids beside these terms, and derivatives.
    """

    times: Array
    inputs: Mapping[str, Array]
    coefficients: Mapping[str, Array]
    friction: Array
    friction_by: Array
    shifts: Mapping[str, tuple[Array, Array]]

    def at(self, rows: NDArray[np.int64]) -> Instants:
        """Some of them."""
        return Instants(
            self.times[rows],
            {name: values[rows] for name, values in self.inputs.items()},
            {name: values[rows] for name, values in self.coefficients.items()},
            self.friction[rows],
            self.friction_by[rows],
            {name: (shift[rows], by[rows]) for name, (shift, by) in self.shifts.items()},
        )


@dataclass(frozen=True, slots=True)
class EvaluationOver:
    """Added quantities at many instants and their derivatives.

    Attributes
    ----------
    value : (n, m) ndarray
    by_sensed : (n, m, n_y) ndarray
    by_state : (n, m, n_x) ndarray
    by_parameter : (n, m, p) ndarray
        Explicit part, to the coordinates of the asked parameters.
    """

    value: Array
    by_sensed: Array
    by_state: Array
    by_parameter: Array

    def put(self, rows: NDArray[np.int64], other: EvaluationOver) -> None:
        """Take some instants from another evaluation, in place."""
        for name in EvaluationOver.__slots__:
            getattr(self, name)[rows] = getattr(other, name)


def evaluate_over(
    dynamic: DynamicTerms,
    instants: Instants,
    touched: Mapping[str, Sequence[int]],
    sensed: Array,
    states: Array,
    *,
    slopes: bool,
) -> EvaluationOver:
    """What :meth:`DynamicTerms.evaluate` tells, at many instants.

    Parameters
    ----------
    dynamic : DynamicTerms
    instants : Instants
    touched : mapping of coefficient to sequence of int
        Which of the derivatives scale it.
    sensed : (n, n_y) ndarray
    states : (n, n_x) ndarray
    slopes : bool
        Whether derivatives to the asked parameters are wanted; else they are zero.
    """
    number, n_added = len(instants.times), dynamic.n_added
    asked = len(dynamic.derivatives) if slopes else 0
    found = EvaluationOver(
        np.zeros((number, n_added)),
        np.zeros((number, n_added, len(dynamic.sense))),
        np.zeros((number, n_added, dynamic.n_states)),
        np.zeros((number, n_added, asked)),
    )
    contexts = [
        layout.context_over(instants.times, instants.inputs, sensed, states, slopes=slopes)
        for layout in dynamic.layouts
    ]
    for index, (layout, context) in enumerate(zip(dynamic.layouts, contexts, strict=True)):
        if dynamic.terms[index].heat_places:
            _heat(dynamic, index, layout, context, instants, touched, found)
        if dynamic.terms[index].bearings:
            _friction(dynamic, index, layout, context, instants, found)
    # What shifts fluids is known: heat that a changed film moves counts from where they are now.
    for index, (layout, context) in enumerate(zip(dynamic.layouts, contexts, strict=True)):
        if dynamic.terms[index].coefficients:
            _moved(dynamic, index, layout, context, instants, touched, sensed, found)
    return found


def _answers(answers: NDArray, number: int) -> NDArray[np.complex128]:
    """By row, instant and column."""
    found = np.asarray(answers, dtype=complex)
    return found.reshape(len(found), number, -1)


def _slopes(found: EvaluationOver) -> tuple[Array, Array, Array]:
    return found.by_sensed, found.by_state, found.by_parameter


def _heat(
    dynamic: DynamicTerms,
    index: int,
    layout: Layout,
    context: TermContext,
    instants: Instants,
    touched: Mapping[str, Sequence[int]],
    found: EvaluationOver,
) -> None:
    answers = _answers(dynamic.terms[index].heat(context), len(instants.times))
    rows, shifted = dynamic.heat_rows[index], dynamic.shifted[index]
    scale = np.ones((len(answers), len(instants.times)))
    for i, film in shifted:
        scale[i] = instants.coefficients[film]
    found.value[:, rows] = (answers[:, :, 0].real * scale).T
    layout.spread_over(answers, rows, scale[:, :, None], _slopes(found))
    if found.by_parameter.shape[2]:
        for i, film in shifted:
            for target in touched.get(film, ()):
                found.by_parameter[:, rows.start + i, target] += found.value[:, rows.start + i]


def _friction(
    dynamic: DynamicTerms,
    index: int,
    layout: Layout,
    context: TermContext,
    instants: Instants,
    found: EvaluationOver,
) -> None:
    answers = _answers(dynamic.terms[index].friction(context), len(instants.times))
    asked = found.by_parameter.shape[2]
    for i, (columns, positions, before) in enumerate(dynamic.friction_rows[index]):
        excess = answers[i, :, 0].real - 1.0
        scaled = instants.friction[:, positions]
        for own, row in before:
            scaled[:, own] += found.value[:, row]
            for slope in _slopes(found):
                slope[:, columns.start + own] += excess[:, None] * slope[:, row]
        found.value[:, columns] = excess[:, None] * scaled
        layout.spread_over(answers[i : i + 1], columns, scaled.T[:, :, None], _slopes(found))
        if asked:
            found.by_parameter[:, columns] += excess[:, None, None] * instants.friction_by[:, positions]


def _moved(
    dynamic: DynamicTerms,
    index: int,
    layout: Layout,
    context: TermContext,
    instants: Instants,
    touched: Mapping[str, Sequence[int]],
    sensed: Array,
    found: EvaluationOver,
) -> None:
    answers = _answers(dynamic.terms[index].factor(context), len(instants.times))
    asked = found.by_parameter.shape[2]
    value, by_parameter = found.value, found.by_parameter
    for i, item in enumerate(dynamic.moved[index]):
        coefficient, columns, uniform = item.coefficient, item.columns, item.uniform
        strength = instants.coefficients[coefficient][:, None] * item.spectrum
        fluid = item.fluid_scale * dynamic.fast.fluid_temperature(coefficient, instants.inputs)
        fluid = np.broadcast_to(fluid, len(instants.times))
        shift, shift_by = instants.shifts.get(coefficient, (np.zeros(1), None))
        flow = strength * ((fluid + shift)[:, None] * uniform - sensed[:, item.sensed])
        excess = (answers[i, :, 0].real - 1.0)[:, None]
        value[:, columns] = excess * flow
        found.by_sensed.reshape(len(value), -1)[:, item.diagonal] -= excess * strength
        if asked:
            for target in touched.get(coefficient, ()):
                by_parameter[:, columns, target] += value[:, columns]
            for target in item.fluid_targets:
                by_parameter[:, columns, target] += excess * strength * fluid[:, None] * uniform
            if shift_by is not None:
                by_parameter[:, columns] += (excess * strength * uniform)[:, :, None] * shift_by[:, None, :]
        for row in item.fluid_rows:
            # These rows are shifts times the coefficient, and so are their derivatives.
            share = item.spectrum * uniform
            flow = flow + share * value[:, row, None]
            value[:, columns] += excess * share * value[:, row, None]
            moved = (excess * share)[:, :, None]
            for slope in _slopes(found):
                slope[:, columns] += moved * slope[:, None, row]
        layout.spread_over(answers[i : i + 1], columns, flow.T[:, :, None], _slopes(found))
