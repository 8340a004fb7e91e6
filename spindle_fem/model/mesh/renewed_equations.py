"""Equations of one problem after another on one mesh: what acts on facets is renewed, the rest stays.

Films, joints and contacts of lumped nodes change from one round of a coupled solution to the next, and
with them a small part of the matrix's entries. These are summed again as for a new matrix, to the last digit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.mesh.conduction_problem import ConductionProblem
from spindle_fem.model.mesh.equations import (
    FacetExchange,
    assemble_load,
    assemble_system,
    assemble_upper,
    facet_exchange,
)
from spindle_fem.model.mesh.linear_system import ThermalSystem, rows_below


@dataclass(frozen=True, slots=True)
class Equations:
    """Equations of a problem before and after perfect joints are tied, and the tied ones as one matrix.

    Renewed ones have that matrix alone: ``system.matrix`` and ``tied.matrix`` are None.
    """

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
    """Entries of the full matrix that facets touch, the upper entry that each equals, those of its border."""

    full: NDArray[np.int32]
    upper: NDArray[np.int32]
    border: NDArray[np.int32]

    @classmethod
    def of(cls, problem: ConductionProblem, exchange: FacetExchange) -> _Places:
        operators = problem.operators
        touched = np.zeros(operators.pattern.n_upper, dtype=bool)
        touched[operators.facet_slots] = True
        for slots in operators.joint_cross_slots.values():
            touched[slots.ravel()] = True
        pattern, border = operators.pattern, sparse.csr_array(exchange.columns)
        full = np.flatnonzero(touched[pattern.upper_of_full]).astype(np.int32)
        upper = pattern.upper_of_full[full]
        # entries of the border follow those of the matrix in each row
        full += border.indptr[np.searchsorted(pattern.indptr, full, side="right") - 1]
        ends = np.repeat(pattern.indptr[1:], np.diff(border.indptr))
        return cls(full, upper, ends + np.arange(border.nnz, dtype=np.int32))


class RenewedEquations:
    """Equations of problems that come one after the other; those given last share memory with the next.

    They are made anew where conductivities change, and always with perfect joints.
    """

    def __init__(self) -> None:
        self._problem: ConductionProblem | None = None
        self._exchange: FacetExchange | None = None
        self._equations: Equations | None = None
        self._places: _Places | None = None

    def of(self, problem: ConductionProblem) -> Equations:
        """Equations of the next problem, without film laws."""
        exchange = facet_exchange(problem)
        if self._serves(problem, exchange):
            self._equations = self._renewed(problem, exchange)
        else:
            self._equations = self._places = None  # their memory serves the next ones
            self._equations = Equations.of(problem)
        self._problem, self._exchange = problem, exchange
        return self._equations

    def _renewed(self, problem: ConductionProblem, exchange: FacetExchange) -> Equations:
        if self._places is None:
            self._places = _Places.of(problem, exchange)
        places, system, matrix = self._places, self._equations.system, self._equations.matrix
        self._equations = None
        load, lumped_load = assemble_load(problem, system.reference_temperature)
        system = replace(
            system,
            matrix=None,
            load=load,
            exchange=exchange.columns,
            lumped_matrix=exchange.lumped_matrix,
            lumped_load=lumped_load,
        )
        matrix.data[places.full] = assemble_upper(problem, exchange)[places.upper]
        if system.n_lumped:
            border = -sparse.csr_array(exchange.columns)
            below = rows_below(border, exchange.lumped_matrix)
            matrix.data[places.border] = border.data
            matrix.data[len(matrix.data) - below.nnz :] = below.data
        return Equations(system, system, matrix)

    def _serves(self, problem: ConductionProblem, exchange: FacetExchange) -> bool:
        kept, before = self._problem, self._exchange
        if kept is None or exchange.ties or before.ties:
            return False
        own, other = exchange.columns, before.columns
        return (
            problem.operators is kept.operators
            and dict(problem.conductivity) == dict(kept.conductivity)
            and exchange.joints.keys() == before.joints.keys()
            and own.shape == other.shape
            and np.array_equal(own.indptr, other.indptr)
            and np.array_equal(own.indices, other.indices)
        )
