"""The weak forms of heat conduction, each with its coefficient 1.

The temperature of a machine satisfies, for every test function v,

    Σ_parts k ∫ ∇u·∇v dV + Σ_parts ρc ∫ u̇ v dV + Σ_films h ∫ (u − u_amb) v dA + Σ_joints h ∫ [u] [v] dA
        = Σ_parts q ∫ v dV + Σ_surfaces q ∫ v dA

with the jump [u] across a joint. Coefficients are constant on a part, or on each facet of a film
or joint, so the package integrates the forms once (:mod:`spindle_fem.model.mesh.element_integrals`)
and sums their integrals with the coefficients of a problem (:mod:`spindle_fem.model.mesh.equations`).

Each is a form of scikit-fem and assembles by itself: ``conduction.assemble(basis)``.
"""

from __future__ import annotations

from typing import Any

from skfem import BilinearForm, LinearForm
from skfem.helpers import dot, grad, jump


@BilinearForm
def conduction(u: Any, v: Any, w: Any) -> Any:
    """``∫ ∇u·∇v dV``: conduction through parts, [m] on nodes."""
    return dot(grad(u), grad(v))


@BilinearForm
def capacity(u: Any, v: Any, w: Any) -> Any:
    """``∫ u v dV``: heat stored in parts, [m³]."""
    return u * v


@BilinearForm
def film(u: Any, v: Any, w: Any) -> Any:
    """``∫ u v dA``: heat through a film on facets, [m²]."""
    return u * v


@BilinearForm
def joint(u: Any, v: Any, w: Any) -> Any:
    """``∫ [u] [v] dA``: heat across a joint, [m²]; ``asm(joint, [side_a, side_b], [side_a, side_b])``."""
    jump_u, jump_v = jump(w, u, v)
    return jump_u * jump_v


@LinearForm
def source(v: Any, w: Any) -> Any:
    """``∫ v dV`` or ``∫ v dA``: even heat in a part or on a surface, [m³] or [m²]."""
    return 1.0 * v
