"""A problem on the matrix of another: what the coefficients differ by acts as heat.

Films, joints and contacts of balls change a little from one stage of a time step to the next. Their
heat with the coefficients of now, at the temperatures at which these were evaluated, is that with the
coefficients of the matrix plus a load. Where loads and temperatures agree it is the same problem.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, LumpedLink, LumpedNode
from spindle_fem.model.mesh.mesh_operators import ThermalOperators, spread

Array = NDArray[np.float64]

# Conductivities within this share of those of the matrix are taken for the same: they act on no surface.
SAME_CONDUCTIVITY = 5.0e-4
# What the heat of the difference is called in the balance.
DIFFERENCE = "coefficients"


def near(fresh: ConductionProblem, kept: ConductionProblem, tolerance: float) -> bool:
    """Whether no coefficient differs by more than this share of the largest of its surface."""
    if fresh.operators is not kept.operators or fresh.lumped_names != kept.lumped_names:
        return False
    shares = (
        _within(fresh.conductivity[part], value, min(tolerance, SAME_CONDUCTIVITY))
        for part, value in kept.conductivity.items()
    )
    return (
        [*map(_conducts, fresh.lumped_links)] == [*map(_conducts, kept.lumped_links)]
        and fresh.conductivity.keys() == kept.conductivity.keys()
        and all(shares)
        and [film.surface for film in fresh.films] == [film.surface for film in kept.films]
        and [_surfaces(node) for node in fresh.lumped_nodes]
        == [_surfaces(node) for node in kept.lumped_nodes]
        and fresh.joint_conductance.keys() == kept.joint_conductance.keys()
        and all(_within(one, other, tolerance) for one, other in _pairs(fresh, kept))
    )


def on_matrix_of(
    kept: ConductionProblem, fresh: ConductionProblem, temperature: Array, lumped: Array
) -> ConductionProblem:
    """The fresh problem with the coefficients of another that is :func:`near`.

    Parameters
    ----------
    temperature, lumped : (n_unknowns,), (m,) ndarray, [K]
        At which the fresh coefficients were evaluated.
    """
    operators = fresh.operators
    every = slice(0, len(operators.facet_area))
    walls = operators.facet_integral(temperature, every) / operators.facet_area
    flux = np.zeros(len(walls))
    films = tuple(
        _film(film, other, walls[operators.surface_rows[film.surface]])
        for film, other in zip(fresh.films, kept.films, strict=True)
    )
    nodes = []
    for node, other, warmth in zip(fresh.lumped_nodes, kept.lumped_nodes, lumped, strict=True):
        heat = node.heat
        for (surface, value), (_, before) in zip(node.connections, other.connections, strict=True):
            rows = operators.surface_rows[surface]
            own = (np.asarray(value) - np.asarray(before)) * (warmth - walls[rows])
            flux[rows] += own
            heat -= float(own @ operators.facet_area[rows])
        nodes.append(replace(node, connections=other.connections, heat=heat))
    for joint, value in fresh.joint_conductance.items():
        _add_joint(operators, joint, value, kept.joint_conductance[joint], walls, flux)
    nodal = dict(fresh.nodal_heat)
    if flux.any():
        nodal[DIFFERENCE] = operators.facet_vector(flux, every)
    return fresh.altered(
        conductivity=kept.conductivity,
        films=films,
        lumped_nodes=tuple(nodes),
        joint_conductance=kept.joint_conductance,
        nodal_heat=nodal,
    )


def _surfaces(node: LumpedNode) -> list[str]:
    return [surface for surface, _ in node.connections]


def _conducts(link: LumpedLink) -> tuple[str, str | None, str, float]:
    """What a link conducts between: all of it but the temperature that it may lead to."""
    return link.node, link.other, link.name, link.conductance


def _pairs(fresh: ConductionProblem, kept: ConductionProblem) -> Iterator[tuple[ArrayLike, ArrayLike]]:
    """Coefficients of both, surface by surface and joint by joint."""
    for film, other in zip(fresh.films, kept.films, strict=True):
        yield film.coefficient, other.coefficient
    for node, other in zip(fresh.lumped_nodes, kept.lumped_nodes, strict=True):
        for (_, value), (_, before) in zip(node.connections, other.connections, strict=True):
            yield value, before
    for joint, value in fresh.joint_conductance.items():
        yield value, kept.joint_conductance[joint]


def _within(one: ArrayLike, other: ArrayLike, tolerance: float) -> bool:
    one, other = np.asarray(one), np.asarray(other)
    if one is other or np.array_equal(one, other):
        return True
    if not (np.isfinite(one).all() and np.isfinite(other).all()):
        return False
    # a facet without exchange in the matrix has no wall to take it from
    return bool(
        np.all((other != 0.0) | (one == 0.0))
        and np.max(np.abs(one - other)) <= tolerance * np.max(np.abs(other), initial=0.0)
    )


def _film(fresh: Film, kept: Film, wall: Array) -> Film:
    """A film of the kept coefficient that gives the heat of the fresh one at these walls."""
    if fresh.coefficient is kept.coefficient:
        return fresh
    value, before = np.asarray(fresh.coefficient, dtype=float), np.asarray(kept.coefficient, dtype=float)
    share = np.divide(value, before, out=np.ones(np.broadcast(value, before).shape), where=before != 0.0)
    surroundings = wall + share * (np.asarray(fresh.ambient_temperature) - wall)
    return replace(fresh, coefficient=kept.coefficient, ambient_temperature=surroundings)


def _add_joint(
    operators: ThermalOperators, joint: str, value: ArrayLike, before: ArrayLike, walls: Array, flux: Array
) -> None:
    """Add what a joint conducts more than with the kept conductance to the flux into its two sides."""
    if value is before or np.array_equal(np.asarray(value), np.asarray(before)):
        return
    side_a, side_b = operators.joint_rows[joint]
    number = side_a.stop - side_a.start
    more = spread(value, number, joint) - spread(before, number, joint)
    own = more * (walls[side_b] - walls[side_a])
    flux[side_a] += own
    flux[side_b] -= own
