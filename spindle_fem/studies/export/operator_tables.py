"""Matrices of an exported model that follow inputs by tables; those over speed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import CHANNEL_FILM
from spindle_fem.model.reduced.class_operators import NO_CHANGES
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.studies.export.effect_export import ExportedEffects
from spindle_fem.studies.export.feedback_export import film_heat_of
from spindle_fem.studies.export.interpolation_axes import refined_axis, values_on

Array = NDArray[np.float64]

PARTS = ("conduction", "load", "output", "feedthrough")
# Relative error of coefficients between the points of a table.
TOLERANCE = 5e-5


@dataclass(frozen=True, slots=True)
class OperatorTable:
    """Matrices whose sum, weighted by a table over inputs, is added to those of the nominal point.

    Attributes
    ----------
    inputs : tuple of str
        The table's axes.
    axes : tuple of ndarray
    values : (n, ..., m) ndarray
        Weights.
    parts : mapping of str to (m, ., .) ndarray
        ``conduction``, ``load``, ``output``, ``feedthrough``, on the fast model's own unknowns and loads.
    """

    inputs: tuple[str, ...]
    axes: tuple[Array, ...]
    values: Array
    parts: dict[str, Array]


def changes_at(fast: FastModel, effects: ExportedEffects, point: OperatingPoint) -> dict[str, float]:
    """Factors on coefficients at a point: effects, and ball rows whose contacts follow speed and thrust."""
    film_heat = film_heat_of(fast)
    return effects.changes(point, NO_CHANGES if film_heat is None else film_heat.operating_factor(point, {}))


def speed_table(
    fast: FastModel, effects: ExportedEffects, nominal: OperatingPoint, highest: float
) -> OperatorTable:
    """Coefficients that follow the speed, ball rows also the thrust, each with its own matrices."""
    names = [name for name in fast.model.coefficient_names if name != CHANNEL_FILM]

    def at(speed: float, thrust: float = nominal.thrust) -> Array:
        point = replace(nominal, speed=speed, thrust=thrust)
        found = fast.coefficients(point, effects.factors, changes_at(fast, effects, point))
        return np.array([found[name] for name in names])

    inputs, axes = ("speed",), (refined_axis(at, 0.0, highest, TOLERANCE),)
    film_heat = film_heat_of(fast)
    if film_heat is not None and film_heat.friction_map.thrust.size > 1:
        ends = film_heat.friction_map.thrust[[0, -1]].tolist()
        inputs, axes = (
            ("speed", "thrust"),
            (*axes, refined_axis(lambda thrust: at(0.5 * highest, thrust), *ends, TOLERANCE)),
        )
    values = values_on(at, axes)
    base = at(nominal.speed)
    every = values.reshape(-1, len(names))
    moving = np.flatnonzero(np.any(every != base, axis=0))
    parts: dict[str, list[Array]] = {part: [] for part in PARTS}
    factors = effects.factors
    own = fast.coefficients(nominal, factors)
    for row in moving:
        # Twice the coefficient less once: its own share of the operators.
        point, value = nominal, own[names[row]]
        if value == 0.0:
            turning = float(axes[0][np.argmax(np.abs(every[:: every.shape[0] // axes[0].size, row]))])
            point = replace(nominal, speed=turning)
            value = fast.coefficients(point, factors)[names[row]]
        change = fast.change(point, factors, ({names[row]: 2.0}, {names[row]: 1.0}), ({}, {}))
        matrices = (change.conduction, change.loads, change.outputs, change.output_inputs)
        for part, matrix in zip(PARTS, matrices, strict=True):
            parts[part].append(matrix / value)
    stacked = {part: np.array(matrices) for part, matrices in parts.items()}
    return OperatorTable(inputs, axes, values[..., moving] - base[moving], stacked)
