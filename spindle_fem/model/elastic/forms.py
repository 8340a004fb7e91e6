"""The weak forms of elasticity in a body of revolution, one harmonic of the angle at a time.

A displacement (u_z, u_r, u_θ) = (a cos mθ, b cos mθ, c sin mθ) of a body whose stiffness D does not
depend on θ satisfies, for every test function v of the same harmonic m,

    ∫ ε(u)ᵀ D ε(v) dV = ∫ (T − T0) τᵀ ε(v) dV + ∫ ρ ω² r v_r dV + ∫ p v·n dA

with strains (zz, rr, θθ, zr, rθ, zθ), τ the thermal stress of one kelvin. For m = 0 there is no u_θ
and the angle integrates to 2π, else to π. Meshes lie in the plane (z, r).

Source: Zienkiewicz, Taylor, The Finite Element Method, vol. 2, chapter on semi-analytical methods.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from skfem import Basis, BilinearForm, LinearForm


def strains(u: Any, r: Any, harmonic: int) -> tuple[Any, ...]:
    """Amplitudes of the strains zz, rr, θθ, zr; of rθ and zθ as well where there is a harmonic."""
    along, out, across = u.grad[0, 0], u.grad[1, 1], u.grad[0, 1] + u.grad[1, 0]
    if not harmonic:
        return along, out, u[1] / r, across
    around = (u[1] + harmonic * u[2]) / r
    out_around = u.grad[2, 1] - (u[2] + harmonic * u[1]) / r
    along_around = u.grad[2, 0] - harmonic * u[0] / r
    return along, out, around, across, out_around, along_around


def turn(harmonic: int) -> float:
    """Integral of cos² mθ over the angle, rad."""
    return math.pi if harmonic else 2.0 * math.pi


def stiffness_matrix(
    basis: Basis, harmonic: int, normal: NDArray[np.float64], shear: NDArray[np.float64]
) -> sparse.csr_matrix:
    """``∫ ε(u)ᵀ D ε(v) dV``, [N/m] on nodes.

    The strains of every shape function are worked out once, not once a pair.

    Parameters
    ----------
    normal : (3, 3, n_elements) ndarray, [Pa]
    shear : (3, n_elements) ndarray, [Pa]
    """
    r = basis.default_parameters()["x"][1]
    of = np.stack([np.stack(strains(own[0], r, harmonic)) for own in basis.basis])
    count = of.shape[1]
    law = np.zeros((count, count, normal.shape[-1]))
    law[:3, :3] = normal
    diagonal = np.arange(3, count)
    law[diagonal, diagonal] = shear[: count - 3]
    weight = turn(harmonic) * r * basis.dx
    stress = np.einsum("ste,itep,ep->isep", law, of, weight, optimize=True)
    local = np.einsum("isep,jsep->ije", stress, of, optimize=True)
    places = basis.element_dofs
    rows = np.broadcast_to(places[:, None], local.shape).ravel()
    columns = np.broadcast_to(places[None], local.shape).ravel()
    return sparse.coo_matrix((local.ravel(), (rows, columns)), shape=(basis.N, basis.N)).tocsr()


@BilinearForm
def expansion(rise: Any, v: Any, w: Any) -> Any:
    """``∫ (T − T0) τᵀ ε(v) dV`` of the amplitude of a temperature rise, [N/K] on nodes."""
    r, harmonic = w.x[1], w.harmonic
    along, out, around = strains(v, r, harmonic)[:3]
    stress = w.thermal[0] * along + w.thermal[1] * out + w.thermal[2] * around
    return turn(harmonic) * r * rise * stress


@LinearForm
def rotation(v: Any, w: Any) -> Any:
    """``∫ ρ r v_r dV``: centrifugal load of 1 rad/s, [kg m]."""
    return turn(0) * w.x[1] ** 2 * w.density * v[1]


@LinearForm
def mean_shift(v: Any, w: Any) -> Any:
    """``∫ v·d dA / 2π`` over a face: its shift along ``d`` by its area; times the radius for a ``lever``."""
    return w.x[1] ** (1 + w.lever) * sum(w.direction[i] * v[i] for i in range(len(w.direction)))
