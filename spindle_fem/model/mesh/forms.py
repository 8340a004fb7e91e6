"""The weak forms of heat conduction, one small function each.

``elements`` evaluates the same integrals in bulk; the tests hold the two
equal to round-off.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from skfem import BilinearForm, LinearForm
from skfem.helpers import dot, grad


@BilinearForm
def conduction(u: Any, v: Any, w: Any) -> Any:
    """``∫ ∇u·∇v dV``: conduction with unit conductivity."""
    return dot(grad(u), grad(v))


@BilinearForm
def circumferential_conduction(u: Any, v: Any, w: Any) -> Any:
    """``∫ (∂u/∂s)(∂v/∂s) dV`` with s along the circumference around z."""
    x, y = w.x[0], w.x[1]
    radius = np.hypot(x, y)
    along_u = (-y * grad(u)[0] + x * grad(u)[1]) / radius
    along_v = (-y * grad(v)[0] + x * grad(v)[1]) / radius
    return along_u * along_v


@BilinearForm
def storage(u: Any, v: Any, w: Any) -> Any:
    """``∫ u v dV``: heat storage with unit volumetric capacity."""
    return u * v


@BilinearForm
def film(u: Any, v: Any, w: Any) -> Any:
    """``∫ u v dA``: film with unit coefficient, on facets."""
    return u * v


@LinearForm
def source(v: Any, w: Any) -> Any:
    """``∫ v dV`` or ``∫ v dA``: unit heat over a part or a surface."""
    return 1.0 * v
