"""How much a whitened residual counts: its square, and beyond some standard deviations less."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Whitened residuals beyond this count linearly.
OUTLIER_SIGMAS = 3.0


def huber(residual: Array) -> Array:
    """Square of a whitened residual, beyond ``OUTLIER_SIGMAS`` linear."""
    size = np.abs(residual)
    return np.where(size <= OUTLIER_SIGMAS, residual**2, 2.0 * OUTLIER_SIGMAS * size - OUTLIER_SIGMAS**2)


def outlier_weight(residual: Array) -> Array:
    """Weight with which the square of a whitened residual has the slope of :func:`huber`, at most 1."""
    return np.minimum(1.0, OUTLIER_SIGMAS / np.maximum(np.abs(residual), 1e-12))
