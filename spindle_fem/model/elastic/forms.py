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
from skfem import BilinearForm, LinearForm


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


@BilinearForm
def stiffness(u: Any, v: Any, w: Any) -> Any:
    """``∫ ε(u)ᵀ D ε(v) dV``, [N/m] on nodes.

    ``w`` carries ``harmonic`` and, on each element, ``normal`` (3, 3, ...) and ``shear`` (3, ...).
    """
    r, harmonic = w.x[1], w.harmonic
    of_u, of_v = strains(u, r, harmonic), strains(v, r, harmonic)
    normal, shear = np.asarray(w.normal), np.asarray(w.shear)
    energy = sum(of_v[i] * sum(normal[i, j] * of_u[j] for j in range(3)) for i in range(3))
    energy = energy + sum(modulus * a * b for modulus, a, b in zip(shear, of_u[3:], of_v[3:], strict=False))
    return turn(harmonic) * r * energy


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
