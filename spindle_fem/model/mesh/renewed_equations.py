"""Equations of one problem after another on one mesh: what acts on facets is renewed, the rest stays.

Films, joints and contacts of lumped nodes change from one round of a coupled solution to the next, and
with them a small part of the matrix's entries. These are summed again as for a new matrix, to the last digit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.mesh.conduction_problem import ConductionProblem, conductivity_of_parts
from spindle_fem.model.mesh.equations import (
    FacetExchange,
    assemble_load,
    assemble_system,
    facet_exchange,
)
from spindle_fem.model.mesh.linear_system import ThermalSystem, rows_below


@dataclass(frozen=True, slots=True)
class Equations:
    """Equations of a problem before and after perfect joints are tied, and the tied ones as one matrix."""

    system: ThermalSystem
    tied: ThermalSystem
    matrix: sparse.csr_array

    @classmethod
    def of(cls, problem: ConductionProblem) -> Equations:
        """Assembled anew."""
        system = assemble_system(problem)
        tied = system.tied()
        return cls(system, tied, tied.full_matrix())


@dataclass(frozen=True, slots=True)
class _Places:
    """Entries that facets touch: upper ones, those of the matrix, of the full matrix and of its border.

    ``of_upper`` is the place of each entry of the matrix among the upper ones, ``films`` sums what facets
    give to their own upper entries from their coefficients.
    """

    upper: NDArray[np.int64]
    of_upper: NDArray[np.int64]
    matrix: NDArray[np.int64]
    full: NDArray[np.int64]
    border: NDArray[np.int64]
    films: sparse.csr_array

    @classmethod
    def of(cls, problem: ConductionProblem, exchange: FacetExchange) -> _Places:
        operators = problem.operators
        touched = np.zeros(operators.pattern.n_upper, dtype=bool)
        touched[operators.facet_slots] = True
        for slots in operators.joint_cross_slots.values():
            touched[slots.ravel()] = True
        pattern, border = operators.pattern, sparse.csr_array(exchange.columns)
        places = np.flatnonzero(touched[pattern.upper_of_full])
        row = np.searchsorted(pattern.indptr, places, side="right") - 1
        ends = np.repeat(pattern.indptr[1:], np.diff(border.indptr))
        number = np.cumsum(touched) - 1
        count, width = operators.facet_film.shape
        # in the order of facets, as they are summed for a new matrix
        facets = np.repeat(np.arange(count, dtype=np.int32), width)
        films = sparse.coo_array(
            (operators.facet_film.ravel(), (operators.facet_inverse.ravel(), facets)),
            shape=(len(operators.facet_slots), count),
        )
        return cls(
            np.flatnonzero(touched),
            number[pattern.upper_of_full[places]],
            places,
            places + border.indptr[row],
            ends + np.arange(border.nnz),
            films.tocsr(),
        )


class RenewedEquations:
    """Equations of problems that come one after the other; those given last share memory with the next.

    The matrices are made anew where conductivities change, and always with perfect joints.
    """

    def __init__(self) -> None:
        self._problem: ConductionProblem | None = None
        self._exchange: FacetExchange | None = None
        self._equations: Equations | None = None
        self._places: _Places | None = None
        self._upper: NDArray[np.float64] | None = None
        self._base: NDArray[np.float64] | None = None

    def of(self, problem: ConductionProblem) -> Equations:
        """Equations of the next problem, without film laws."""
        exchange = facet_exchange(problem)
        if not self._serves(problem, exchange):
            self._problem = self._equations = self._places = self._upper = None
            self._equations, self._problem, self._exchange = Equations.of(problem), problem, exchange
            return self._equations
        operators, kept = problem.operators, self._equations
        if self._places is None:
            self._places = _Places.of(problem, self._exchange)
            self._upper = operators.sum_conduction(conductivity_of_parts(problem))
            self._base = self._upper[self._places.upper]
        places, upper = self._places, self._upper
        upper[places.upper] = self._base
        for joint, conductance in exchange.joints.items():
            operators.add_joint(upper, joint, conductance)
        upper[operators.facet_slots] += places.films @ exchange.coefficient
        system, full = kept.system, kept.matrix
        values = upper[places.upper][places.of_upper]
        system.matrix.data[places.matrix] = values
        if full is not system.matrix:
            border = sparse.csr_array(exchange.columns)
            below = rows_below(-border, exchange.lumped_matrix)
            full.data[places.full] = values
            full.data[places.border] = -border.data
            full.data[len(full.data) - below.nnz :] = below.data
        reference = system.reference_temperature
        load, lumped_load = assemble_load(problem, reference)
        renewed = replace(
            system,
            load=load,
            exchange=exchange.columns,
            lumped_matrix=exchange.lumped_matrix,
            lumped_load=lumped_load,
        )
        self._problem, self._exchange = problem, exchange
        self._equations = Equations(renewed, renewed, full)
        return self._equations

    def _serves(self, problem: ConductionProblem, exchange: FacetExchange) -> bool:
        kept = self._problem
        if kept is None or exchange.ties or self._exchange.ties:
            return False
        own, other = exchange.columns, self._exchange.columns
        return (
            problem.operators is kept.operators
            and dict(problem.conductivity) == dict(kept.conductivity)
            and exchange.joints.keys() == self._exchange.joints.keys()
            and own.shape == other.shape
            and np.array_equal(own.indptr, other.indptr)
            and np.array_equal(own.indices, other.indices)
        )
