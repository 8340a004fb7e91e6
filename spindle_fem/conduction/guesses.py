"""First guesses of linear systems and of fixed points, from those solved before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

# Earlier iterates that are mixed into the next.
EARLIER_ITERATES = 2
# Corrections from which first guesses are combined.
CORRECTIONS = 8


class RecentCorrections:
    """Recent corrections of stages: the next one is nearly a combination of them.

    Their products with storage and conduction are kept too, and used on when a
    film has changed a little: they only make first guesses.
    """

    def __init__(self) -> None:
        self._fields: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]] = []

    def add(
        self, correction: NDArray[np.float64], storage: sparse.csr_array, conduction: sparse.csr_array
    ) -> None:
        """Remember a correction that is not zero, (n,) [K]; the oldest is forgotten."""
        scaled = correction / np.abs(correction).max()
        self._fields = [
            *self._fields[1 - CORRECTIONS :],
            (scaled, storage @ scaled, conduction @ scaled),
        ]

    def combine(self, residual: NDArray[np.float64], shift: float) -> NDArray[np.float64]:
        """Galerkin solution of ``(M + shift K) x = residual`` among the recent corrections."""
        if not self._fields:
            return np.zeros_like(residual)
        size = len(self._fields)
        projected, load = np.empty((size, size)), np.empty(size)
        for row, (one, _, _) in enumerate(self._fields):
            load[row] = one @ residual
            for column, (_, stored, conducted) in enumerate(self._fields):
                projected[row, column] = one @ stored + shift * (one @ conducted)
        weights = np.linalg.lstsq(projected, load, rcond=1e-9)[0]
        return sum(weight * one for weight, (one, _, _) in zip(weights, self._fields, strict=True))


def mixed(past: list[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> NDArray[np.float64]:
    """Anderson mixing: the combination of past iterates whose defects cancel best.

    Parameters
    ----------
    past : list of ((n,) ndarray, (n,) ndarray)
        Answers of a fixed-point map and their distance from what was put in, latest last.

    Source: Walker & Ni (2011), SIAM J. Numer. Anal. 49, 1715-1735.

    >>> linear = lambda x: np.array([0.5, 0.2]) * x + 1.0
    >>> put = [np.zeros(2), np.ones(2), np.array([1.5, 1.2])]
    >>> mixed([(linear(x), linear(x) - x) for x in put]).round(9).tolist()
    [2.0, 1.25]
    """
    answer, defect = past[-1]
    if len(past) == 1:
        return answer
    turns = np.array([defect - other for _, other in past[:-1]])
    weights = np.linalg.lstsq(turns @ turns.T, turns @ defect, rcond=1e-10)[0]
    return answer - sum(
        weight * (answer - other) for weight, (other, _) in zip(weights, past[:-1], strict=True)
    )
