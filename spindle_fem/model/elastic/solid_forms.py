"""The weak forms of elasticity in three dimensions, for isotropic solids.

The displacement u of a body that is warmer by T − T0, turns about z at ω and bears a traction t satisfies,
for every test function v,

    ∫ [Λ div u div v + 2μ ε(u):ε(v)] dV
        = ∫ (3Λ + 2μ) α (T − T0) div v dV + ω² ∫ ρ (x v_x + y v_y) dV + ∫ t·v dA

with Lamé's constants Λ and μ. Each is a form of scikit-fem and assembles by itself, on
``Basis(mesh, ElementVector(ElementTetP2()))``. :mod:`spindle_fem.model.elastic.solid_body` integrates the
same with kernels.

Source: Zienkiewicz, Taylor, The Finite Element Method, vol. 1, chapter on linear elasticity.
"""

from __future__ import annotations

from typing import Any

from skfem import BilinearForm, LinearForm
from skfem.helpers import ddot, div, dot, sym_grad


@BilinearForm
def stiffness(u: Any, v: Any, w: Any) -> Any:
    """Work of the stresses, [N/m] on nodes; ``first_lame`` Λ and ``shear`` μ in Pa."""
    return w.first_lame * div(u) * div(v) + 2.0 * w.shear * ddot(sym_grad(u), sym_grad(v))


@LinearForm
def expansion(v: Any, w: Any) -> Any:
    """Load of a rise of temperature ``rise`` [K], [N]; ``thermal`` is (3Λ + 2μ) α, Pa/K."""
    return w.thermal * w.rise * div(v)


@LinearForm
def rotation(v: Any, w: Any) -> Any:
    """Centrifugal load of 1 rad/s about z, [kg m]; ``density`` in kg/m³."""
    return w.density * (w.x[0] * v[0] + w.x[1] * v[1])


@LinearForm
def traction(v: Any, w: Any) -> Any:
    """Load of a traction ``w.traction`` (three components, Pa) on facets, [N]."""
    return dot(w.traction, v)
