"""Directions in which a coefficient of a model conducts anything."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from spindle_fem.model.thermal_model import ThermalModel

Array = NDArray[np.float64]

# In the energy-orthonormal basis an eigenvalue is a share of the stored energy's dissipation.
RANK_TOLERANCE = 1e-3
# Relative to the largest flow in any direction, if the spread of a model's states is known.
FLOW_TOLERANCE = 5e-3


class ConductingDirections:
    """``K_i = Q D Qᵀ`` of every coefficient of a model, each computed on first use.

    Parameters
    ----------
    spread : (r,) ndarray, optional
        How large each coordinate of the states is. The directions are then those in which
        such states flow, far fewer: ``Q = L W`` with ``K_i = L Lᵀ`` and the first columns
        of ``W`` in ``Lᵀ diag(spread) = W S Zᵀ``.
    """

    def __init__(self, model: ThermalModel, spread: Array | None = None) -> None:
        self._model, self._spread = model, spread
        self._known: dict[str, tuple[Array, Array]] = {}

    def of(self, coefficient: str) -> tuple[Array, Array]:
        """Directions ``Q`` (r, k) and what the unit coefficient conducts in each, (k,)."""
        if coefficient not in self._known:
            position = self._model.coefficient_names.index(coefficient)
            spectrum, vectors = eigh(self._model.operators[position])
            if self._spread is None:
                kept = spectrum > RANK_TOLERANCE * spectrum[-1]
                found = vectors[:, kept], spectrum[kept]
            else:
                root = vectors * np.sqrt(np.maximum(spectrum, 0.0))
                turned, flows, _ = np.linalg.svd(root.T * self._spread)
                kept = flows > FLOW_TOLERANCE * flows[0]
                found = root @ turned[:, kept], np.ones(int(kept.sum()))
            for array in found:
                array.setflags(write=False)
            self._known[coefficient] = found
        return self._known[coefficient]
