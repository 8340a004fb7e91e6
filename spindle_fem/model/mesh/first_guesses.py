"""First guesses of linear systems, from those solved before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.mesh.linear_solvers import multiply

# Corrections from which first guesses are combined.
CORRECTIONS = 8


class RecentCorrections:
    """Recent corrections of stages: the next one is nearly a combination of them.

    What they store and conduct together is kept too, and used on when a film has
    changed a little: they only make first guesses.
    """

    def __init__(self) -> None:
        self._fields: NDArray[np.float64] | None = None
        self._count = 0
        self._stored = np.zeros((CORRECTIONS, CORRECTIONS))
        self._conducted = np.zeros((CORRECTIONS, CORRECTIONS))

    def add(
        self, correction: NDArray[np.float64], storage: sparse.csr_array, conduction: sparse.csr_array
    ) -> None:
        """Remember a correction that is not zero, (n,) [K]; the oldest is forgotten."""
        if self._fields is None:
            self._fields = np.zeros((CORRECTIONS, len(correction)))
        place = self._count % CORRECTIONS
        self._count += 1
        scaled = correction / np.abs(correction).max()
        self._fields[place] = scaled
        for table, matrix in ((self._stored, storage), (self._conducted, conduction)):
            table[place] = table[:, place] = self._fields @ multiply(matrix, scaled)

    def combine(self, residual: NDArray[np.float64], shift: float) -> NDArray[np.float64]:
        """Galerkin solution of ``(M + shift K) x = residual`` among the recent corrections."""
        size = min(self._count, CORRECTIONS)
        if not size:
            return np.zeros_like(residual)
        fields = self._fields[:size]
        projected = self._stored[:size, :size] + shift * self._conducted[:size, :size]
        return np.linalg.lstsq(projected, fields @ residual, rcond=1e-9)[0] @ fields
