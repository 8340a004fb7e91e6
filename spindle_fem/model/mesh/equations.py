"""The equations of a conduction problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from spindle_fem.errors import SpecError
from spindle_fem.model.mesh.conduction_problem import (
    ConductionProblem,
    conductivity_of_parts,
    heat_flux,
    reference_temperature,
)
from spindle_fem.model.mesh.linear_system import ThermalSystem
from spindle_fem.model.mesh.mesh_operators import ThermalOperators, spread


def assemble_system(problem: ConductionProblem, reference: float | None = None) -> ThermalSystem:
    """Equations of a problem; the unit integrals are only re-summed.

    Parameters
    ----------
    problem : ConductionProblem
        Without film laws: these are linearised first.
    reference : float, optional, [K]
        Temperature that unknowns count from; the mean of the surroundings
        when absent.
    """
    if problem.film_laws:
        raise SpecError("problem", "film laws must be linearised before assembly.", "Use linearise_films.")
    operators, exchange = problem.operators, facet_exchange(problem)
    upper = assemble_upper(problem, exchange)
    if reference is None:
        reference = reference_temperature(problem)
    load, lumped_load = assemble_load(problem, reference)
    return ThermalSystem(
        operators.matrix(upper),
        load,
        exchange.columns,
        exchange.lumped_matrix,
        lumped_load,
        reference,
        _tie_matrix(operators, exchange.ties),
        operators.prolongation,
    )


def assemble_upper(problem: ConductionProblem, exchange: FacetExchange) -> NDArray[np.float64]:
    """Upper entries of a problem's matrix, (n_upper,) [W/K]."""
    operators = problem.operators
    upper = operators.sum_conduction(conductivity_of_parts(problem))
    for joint, conductance in exchange.joints.items():
        operators.add_joint(upper, joint, conductance)
    operators.add_films(upper, exchange.coefficient)
    return upper


@dataclass(frozen=True, slots=True)
class FacetExchange:
    """What films, joints and lumped nodes of a problem exchange over facets.

    Attributes
    ----------
    coefficient : (n_facets,) ndarray, [W/(m²·K)]
        Of all that a facet gives heat to.
    joints : mapping of str to (n,) ndarray, [W/(m²·K)]
        Of each pair of facets; perfect ones are in ``ties``.
    columns : (n, m) csc_array, [W/K]
        Between unknowns and lumped nodes.
    lumped_matrix : (m, m) ndarray, [W/K]
    """

    coefficient: NDArray[np.float64]
    joints: Mapping[str, NDArray[np.float64]]
    ties: tuple[str, ...]
    columns: sparse.csc_array
    lumped_matrix: NDArray[np.float64]


def facet_exchange(problem: ConductionProblem) -> FacetExchange:
    """Exchange of a problem without film laws."""
    operators = problem.operators
    coefficient = np.zeros(len(operators.facet_area))
    for film in problem.films:
        coefficient[operators.surface_rows[film.surface]] += np.asarray(film.coefficient)
    columns, diagonal = [], []
    for node in problem.lumped_nodes:
        column = np.zeros(operators.n_unknowns)
        total = 0.0
        for surface, value in node.connections:
            rows = operators.surface_rows[surface]
            values = operators.per_facet(surface, value, node.name)
            coefficient[rows] += values
            column += operators.facet_vector(values, rows)
            total += float(values @ operators.facet_area[rows])
        columns.append(column)
        diagonal.append(total)
    ties, joints = [], {}
    for joint, value in problem.joint_conductance.items():
        side_a, side_b = operators.joint_rows[joint]
        if np.ndim(value) == 0 and np.isinf(value):
            ties.append(joint)
            continue
        conductance = spread(value, side_a.stop - side_a.start, joint)
        coefficient[side_a] += conductance
        coefficient[side_b] += conductance
        joints[joint] = conductance
    return FacetExchange(
        coefficient,
        joints,
        tuple(ties),
        _as_columns(columns, operators.n_unknowns),
        _lumped_matrix(problem, diagonal),
    )


def _as_columns(vectors: list[NDArray[np.float64]], n_rows: int) -> sparse.csc_array:
    """Sparse matrix of columns that are mostly zero."""
    places = [np.flatnonzero(vector) for vector in vectors]
    indptr = np.cumsum([0, *(len(own) for own in places)])
    indices = np.concatenate([np.empty(0, dtype=np.intp), *places])
    data = np.concatenate([np.empty(0), *(vector[own] for vector, own in zip(vectors, places, strict=True))])
    return sparse.csc_array((data, indices, indptr), shape=(n_rows, len(vectors)))


def assemble_load(
    problem: ConductionProblem, reference: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Right-hand sides of the mesh's unknowns (n,) and of the lumped nodes (m,), [W].

    Parameters
    ----------
    reference : float, [K]
        Temperature that unknowns count from.
    """
    operators = problem.operators
    flux = np.zeros(len(operators.facet_area))
    for film in problem.films:
        rows = operators.surface_rows[film.surface]
        flux[rows] += np.asarray(film.coefficient) * (np.asarray(film.ambient_temperature) - reference)
    for surface, heat in problem.surface_heat.items():
        flux[operators.surface_rows[surface]] += heat_flux(operators, surface, heat)
    load = operators.facet_vector(flux, slice(0, len(flux)))
    for part, heat in problem.part_heat.items():
        own = operators.part_of_unknown == operators.part_index(part, "part_heat")
        load[own] += heat / operators.part_volume[part] * operators.part_load[own]
    for heat in problem.nodal_heat.values():
        load += heat
    lumped_load = np.array([node.heat for node in problem.lumped_nodes], dtype=float)
    for link in problem.lumped_links:
        if link.other is None:
            rise = link.temperature - reference
            lumped_load[problem.lumped_names.index(link.node)] += link.conductance * rise
    return load, lumped_load


def assemble_capacity(problem: ConductionProblem) -> tuple[sparse.csr_array, NDArray[np.float64]]:
    """Capacity matrix (n, n) and capacities of the lumped nodes (m,), [J/K].

    Raises
    ------
    SpecError
        A part without volumetric capacity.
    """
    operators = problem.operators
    missing = [part for part in operators.mesh.part_names if part not in problem.volumetric_capacity]
    if missing:
        raise SpecError("volumetric_capacity", f"no value for {', '.join(missing)}.", "Name every part.")
    capacity = np.array([problem.volumetric_capacity[part] for part in operators.mesh.part_names])
    matrix = operators.matrix(operators.sum_storage(capacity))
    if problem.capacity_scale is not None:
        root = sparse.diags_array(np.sqrt(problem.capacity_scale))
        matrix = sparse.csr_array(root @ matrix @ root)
    return matrix, np.array([node.capacity for node in problem.lumped_nodes])


def _lumped_matrix(problem: ConductionProblem, diagonal: list[float]) -> NDArray[np.float64]:
    names = problem.lumped_names
    matrix = np.diag(np.array(diagonal, dtype=float)) if diagonal else np.zeros((0, 0))
    for link in problem.lumped_links:
        i = names.index(link.node)
        matrix[i, i] += link.conductance
        if link.other is not None:
            j = names.index(link.other)
            matrix[j, j] += link.conductance
            matrix[i, j] -= link.conductance
            matrix[j, i] -= link.conductance
    return matrix


def _tie_matrix(operators: ThermalOperators, joints: Sequence[str]) -> sparse.csr_array | None:
    if not joints:
        return None
    sides = [operators.joint_rows[joint] for joint in joints]
    nodes_a = np.concatenate([operators.facet_nodes[a].ravel() for a, _ in sides])
    nodes_b = np.concatenate([operators.facet_nodes[b].ravel() for _, b in sides])
    n = operators.n_unknowns
    graph = sparse.coo_array((np.ones(len(nodes_a)), (nodes_a, nodes_b)), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    starts = np.arange(n + 1, dtype=np.int32)
    return sparse.csr_array((np.ones(n), label.astype(np.int32, copy=False), starts), shape=(n, count))
