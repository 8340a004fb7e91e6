"""Directions in which a coefficient of a model conducts anything."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from spindle_fem.reduced.model import ReducedModel

Array = NDArray[np.float64]

# In the energy-orthonormal basis an eigenvalue is a share of the stored energy's dissipation.
RANK_TOLERANCE = 1e-3


class ConductingDirections:
    """``K_i = Q D Qᵀ`` of every coefficient of a model, each found when first asked for.

    Parameters
    ----------
    model : ReducedModel
    """

    def __init__(self, model: ReducedModel) -> None:
        self._model = model
        self._known: dict[str, tuple[Array, Array]] = {}

    def of(self, coefficient: str) -> tuple[Array, Array]:
        """Directions ``Q`` (r, k) and what the unit coefficient conducts in each, (k,)."""
        if coefficient not in self._known:
            position = self._model.coefficient_names.index(coefficient)
            spectrum, vectors = eigh(self._model.operators[position])
            kept = spectrum > RANK_TOLERANCE * spectrum[-1]
            found = vectors[:, kept], spectrum[kept]
            for array in found:
                array.setflags(write=False)
            self._known[coefficient] = found
        return self._known[coefficient]
