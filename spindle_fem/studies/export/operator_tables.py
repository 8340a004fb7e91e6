"""Matrices of an exported model that follow inputs by tables: samples on few directions, those over speed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import CHANNEL_FILM
from spindle_fem.model.reduced.class_operators import NO_CHANGES
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.film_heat import film_heat_of
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.studies.export.effect_export import ExportedEffects
from spindle_fem.studies.export.interpolation_axes import refined_axis, values_on

Array = NDArray[np.float64]

PARTS = ("conduction", "load", "output", "feedthrough")
# Relative error of coefficients between the points of a table.
TOLERANCE = 5e-5
# Directions of sampled operators are left out below this relative variation; rounding error of their squares.
LEFT_OUT, ROUND_OFF = 1e-7, 1e-15
# Samples that directions are taken from.
MOST_SAMPLES = 300


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


def operator_shapes(fast: FastModel) -> tuple[tuple[int, int], ...]:
    """Shapes of :data:`PARTS` on a model's own unknowns, loads and channels."""
    size, n_load, n_out = fast.model.size, len(fast.load_names), len(fast.channels)
    return (size, size), (size, n_load), (n_out, size), (n_out, n_load)


def in_a_row(matrices: Sequence[Array]) -> Array:
    """Operators as one row (n,): :data:`PARTS` one behind the other."""
    return np.concatenate([matrix.ravel() for matrix in matrices])


def _split(fast: FastModel, rows: Array) -> list[Array]:
    """Rows (..., n) divided at the ends of :data:`PARTS`."""
    ends = np.cumsum([np.prod(shape) for shape in operator_shapes(fast)])
    return np.split(rows, ends[:-1], axis=-1)


def operator_parts(fast: FastModel, rows: Array) -> dict[str, Array]:
    """Matrices (m, ., .) by part of rows (m, n)."""
    shapes = operator_shapes(fast)
    return {
        part: own.reshape(-1, *shape)
        for part, own, shape in zip(PARTS, _split(fast, rows), shapes, strict=True)
    }


def equal_weights(fast: FastModel, row: Array) -> Array:
    """Divisors of a row's entries (n,) that give heats, loads and temperatures equal weight."""
    return np.concatenate([np.full(part.shape, np.linalg.norm(part) or 1.0) for part in _split(fast, row)])


def directions_of(
    sample: Callable[[tuple[float, ...]], Array], places: list[tuple[float, ...]], left_out: float = LEFT_OUT
) -> tuple[Array, Array]:
    """Orthonormal directions (m, n) of samples (n,) at places, and each place's coordinates along them."""
    every = max(1, -(-len(places) // MOST_SAMPLES))
    chosen = np.array([sample(place) for place in places[::every]])
    squares, vectors = np.linalg.eigh(chosen @ chosen.T)
    kept = squares > max(left_out**2 * len(chosen), ROUND_OFF * squares[-1])
    basis = (vectors[:, kept].T @ chosen) / np.sqrt(squares[kept])[:, None]
    if every == 1:
        return basis, chosen @ basis.T
    return basis, np.array([basis @ sample(place) for place in places])


def sampled_table(
    fast: FastModel,
    inputs: tuple[str, ...],
    axes: tuple[Array, ...],
    change: Callable[..., Array],
    usual: Array,
) -> OperatorTable:
    """Operators of which every entry may follow the inputs, on the few directions in which they vary.

    Parameters
    ----------
    change : callable
        Of a place on the axes, to what is added there (n,), as :func:`in_a_row`.
    usual : (n,) ndarray
        By whose size heats, loads and temperatures are weighed against each other.
    """
    scale = equal_weights(fast, usual)
    basis, weights = directions_of(lambda place: change(*place) / scale, list(product(*axes)))
    values = weights.reshape(*(axis.size for axis in axes), -1)
    return OperatorTable(inputs, axes, values, operator_parts(fast, basis * scale))


def changes_at(fast: FastModel, effects: ExportedEffects, point: OperatingPoint) -> dict[str, float]:
    """Factors on coefficients at a point: effects, and ball rows whose contacts follow speed and thrust."""
    film_heat = film_heat_of(fast)
    return effects.changes(point, NO_CHANGES if film_heat is None else film_heat.operating_factor(point, {}))


def speed_table(
    fast: FastModel, effects: ExportedEffects, nominal: OperatingPoint, highest: float
) -> OperatorTable:
    """Coefficients that follow the speed, ball rows also the thrust, each with its own matrices.

    Those of circuits are left to :func:`circuit_table`.
    """
    apart = {CHANNEL_FILM, *_circuit_films(fast)}
    names = [name for name in fast.model.coefficient_names if name not in apart]

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


def _circuit_films(fast: FastModel) -> list[str]:
    """Coefficients of all walls of all circuits."""
    return [f"film.{surface}" for film in fast.spec.circuits for surface in film.surface]


def circuit_table(
    fast: FastModel, effects: ExportedEffects, nominal: OperatingPoint, highest: float
) -> OperatorTable | None:
    """Circuits whose films follow the speed, over the speed; None where none does.

    Their coolant warms along the walls, so that no entry is a straight line over a film.
    """
    names = _circuit_films(fast)

    def films(speed: float) -> Array:
        point = replace(nominal, speed=speed)
        found = fast.coefficients(point, effects.factors, changes_at(fast, effects, point))
        return np.array([found[name] for name in names])

    if not names or np.array_equal(films(0.0), films(highest)):
        return None
    # at the nominal speed without the changes that effects make, as factors are to it
    own = fast.coefficients(nominal, effects.factors)
    own = np.array([own[name] for name in names])
    usual = dict(zip(names, films(nominal.speed) / own, strict=True))

    def change(speed: float) -> Array:
        factors = dict(zip(names, films(speed) / own, strict=True))
        found = fast.change(nominal, effects.factors, (factors, usual), ({}, {}))
        return in_a_row((found.conduction, found.loads, found.outputs, found.output_inputs))

    base = fast.operators(nominal, effects.factors)
    whole = in_a_row((base.conduction, base.loads, base.outputs, base.output_inputs))
    return sampled_table(fast, ("speed",), (refined_axis(films, 0.0, highest, TOLERANCE),), change, whole)
