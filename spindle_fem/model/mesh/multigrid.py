"""A symmetric multigrid cycle for conduction matrices, in single precision.

Quadratic temperatures are first restricted to the corner nodes, where the
linear elements of the same mesh are (p-multigrid); from there smoothed
aggregation (pyamg) makes the coarser levels. Chebyshev polynomials of the
Jacobi-scaled matrix smooth: they are symmetric, need only matrix products, and
single precision halves the memory that each product reads. The cycle only
preconditions conjugate gradients in double precision.

Sources: Adams, Brezina, Hu & Tuminaro (2003), J. Comput. Phys. 188, 593-610
(polynomial smoothing); Vanek, Mandel & Brezina (1996), Computing 56, 179-196
(smoothed aggregation).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from spindle_fem.model.mesh.threads import use_compiled

if TYPE_CHECKING:
    from spindle_fem.model.mesh.multigrid_compiled import CompiledHierarchy

SMOOTHING_DEGREE = 2
# The smoother damps eigenvalues from the largest down to this fraction of it.
SMOOTHED_FRACTION = 1.0 / 8.0
LANCZOS_STEPS = 12
EIGENVALUE_MARGIN = 1.08
COARSEST_SIZE = 400
PRECISION = np.float32


@dataclass(frozen=True, slots=True)
class Level:
    """One level of the hierarchy.

    Attributes
    ----------
    matrix : csr_array
    inverse_diagonal : (n,) ndarray
    largest : float
        Bound of the largest eigenvalue of the scaled matrix.
    prolongation, restriction : csr_array
        From and to the next coarser level.
    """

    matrix: sparse.csr_array
    inverse_diagonal: NDArray
    largest: float
    prolongation: sparse.csr_array
    restriction: sparse.csr_array


@dataclass(frozen=True, slots=True)
class Hierarchy:
    """Levels from fine to coarse and the factor of the coarsest matrix."""

    levels: tuple[Level, ...]
    coarsest: tuple[NDArray[np.float64], bool]

    def cycle(self, residual: NDArray[np.float64]) -> NDArray[np.float64]:
        """One V-cycle: approximate solution of ``K x = residual``.

        Parameters
        ----------
        residual : (n,) or (n, m) float64 ndarray
            Several columns cost far less than one after the other: each matrix
            is read once for all of them.
        """
        scale = np.abs(residual).max(axis=0, initial=0.0)
        scale = np.where(scale > 0.0, scale, 1.0)
        # scaled, so that small residuals stay inside the range of single precision
        return scale * self._descend(0, (residual / scale).astype(PRECISION)).astype(np.float64)

    def _descend(self, depth: int, residual: NDArray) -> NDArray:
        if depth == len(self.levels):
            return cho_solve(self.coarsest, residual.astype(np.float64)).astype(PRECISION)
        level = self.levels[depth]
        unknowns = _smooth(level, residual)
        unknowns += level.prolongation @ self._descend(
            depth + 1, level.restriction @ (residual - level.matrix @ unknowns)
        )
        unknowns += _smooth(level, residual - level.matrix @ unknowns)
        return unknowns


def build_hierarchy(
    matrix: sparse.csr_array, prolongation: sparse.csr_array | None
) -> Hierarchy | CompiledHierarchy:
    """Hierarchy of a symmetric positive definite matrix; in compiled loops where they are worth it.

    Parameters
    ----------
    matrix : (n, n) csr_array
    prolongation : (n, n_corners) csr_array or None
        From linear to quadratic temperatures; None when they are linear.
    """
    if use_compiled(matrix.shape[0]):
        from spindle_fem.model.mesh.multigrid_compiled import build_compiled_hierarchy

        return build_compiled_hierarchy(matrix, prolongation)
    import pyamg

    levels = []
    if prolongation is not None:
        levels.append(_make_level(matrix, prolongation))
        matrix = sparse.csr_array(prolongation.T @ (matrix @ prolongation))
    aggregated = pyamg.smoothed_aggregation_solver(
        sparse.csr_matrix(matrix),
        strength=("symmetric", {"theta": 0.0}),
        improve_candidates=None,
        max_coarse=COARSEST_SIZE,
        max_levels=12,
    )
    for level in aggregated.levels[:-1]:
        levels.append(_make_level(sparse.csr_array(level.A), sparse.csr_array(level.P)))
    return Hierarchy(tuple(levels), cho_factor(aggregated.levels[-1].A.toarray()))


def _make_level(matrix: sparse.csr_array, prolongation: sparse.csr_array) -> Level:
    diagonal = matrix.diagonal()
    return Level(
        matrix.astype(PRECISION),
        (1.0 / diagonal).astype(PRECISION),
        EIGENVALUE_MARGIN * largest_eigenvalue(matrix, diagonal),
        prolongation.astype(PRECISION),
        sparse.csr_array(prolongation.T).astype(PRECISION),
    )


def largest_eigenvalue(matrix: sparse.csr_array, diagonal: NDArray[np.float64]) -> float:
    """Largest eigenvalue of ``D^(-1/2) A D^(-1/2)`` by a few Lanczos steps, from below."""
    root = 1.0 / np.sqrt(diagonal)
    vector = np.random.default_rng(0).standard_normal(len(root))
    vector /= np.linalg.norm(vector)
    previous = np.zeros_like(vector)
    alphas, betas = [], []
    beta = 0.0
    for _ in range(min(LANCZOS_STEPS, len(root))):
        image = root * (matrix @ (root * vector)) - beta * previous
        alpha = float(vector @ image)
        image -= alpha * vector
        alphas.append(alpha)
        beta = float(np.linalg.norm(image))
        if beta < 1e-12 * abs(alpha):
            break
        betas.append(beta)
        previous, vector = vector, image / beta
    steps = len(alphas)
    off = np.array(betas[: steps - 1])
    return float(np.linalg.eigvalsh(np.diag(alphas) + np.diag(off, 1) + np.diag(off, -1))[-1])


def _smooth(level: Level, residual: NDArray) -> NDArray:
    """Chebyshev polynomial of the Jacobi-scaled matrix, applied to a residual."""
    high = level.largest
    low = high * SMOOTHED_FRACTION
    centre, half = 0.5 * (high + low), 0.5 * (high - low)
    ratio = centre / half
    rho = 1.0 / ratio
    inverse_diagonal = level.inverse_diagonal if residual.ndim == 1 else level.inverse_diagonal[:, None]
    step = inverse_diagonal * residual
    step *= PRECISION(1.0 / centre)
    unknowns = step.copy()
    for _ in range(SMOOTHING_DEGREE - 1):
        residual = residual - level.matrix @ step
        following = 1.0 / (2.0 * ratio - rho)
        step *= PRECISION(following * rho)
        step += PRECISION(2.0 * following / half) * (inverse_diagonal * residual)
        rho = following
        unknowns += step
    return unknowns
