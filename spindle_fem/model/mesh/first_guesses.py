"""First guesses of linear systems, from those solved before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.mesh.huge_pages import room
from spindle_fem.model.mesh.linear_solvers import multiply
from spindle_fem.model.mesh.threads import combined, dots

# Corrections from which first guesses are combined.
CORRECTIONS = 8


class RecentCorrections:
    """Recent corrections of solutions: the next one is nearly a combination of them.

    What they are to each other in the energies of some matrices is kept too, and used on when a film has
    changed a little: they only make first guesses.

    Parameters
    ----------
    number : int
        Of matrices whose sum is solved with.
    """

    def __init__(self, number: int) -> None:
        self._fields: NDArray[np.float64] | None = None
        self._count = 0
        self._energies = np.zeros((number, CORRECTIONS, CORRECTIONS))

    def add(self, correction: NDArray[np.float64], *matrices: sparse.csr_array) -> None:
        """Remember a correction that is not zero, (n,) [K]; the oldest is forgotten."""
        if self._fields is None:
            self._fields = room((CORRECTIONS, len(correction)))
            self._fields[:] = 0.0
        place = self._count % CORRECTIONS
        self._count += 1
        scaled = correction / np.abs(correction).max()
        self._fields[place] = scaled
        for table, matrix in zip(self._energies, matrices, strict=True):
            table[place] = table[:, place] = dots(self._fields, multiply(matrix, scaled))

    def combine(self, residual: NDArray[np.float64], *factors: float) -> NDArray[np.float64]:
        """Galerkin solution of ``Σ factor · matrix · x = residual`` among the recent corrections."""
        size = min(self._count, CORRECTIONS)
        if not size:
            return np.zeros_like(residual)
        fields = self._fields[:size]
        projected = np.tensordot(factors, self._energies[:, :size, :size], axes=1)
        return combined(np.linalg.lstsq(projected, dots(fields, residual), rcond=1e-9)[0], fields)
