"""Rectangular ducts: laminar numbers by their aspect ratio."""

from __future__ import annotations

import numpy as np

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.coolant.ducts import DuctShape

# Polynomials in the aspect ratio of the section, short over long side.
_FRICTION = np.polynomial.Polynomial([1.0, -1.3553, 1.9467, -1.7012, 0.9564, -0.2537])
_NUSSELT = np.polynomial.Polynomial([1.0, -2.610, 4.970, -5.119, 2.702, -0.548])


def laminar_numbers(width: float, depth: float) -> tuple[float, float]:
    """Nusselt number at uniform wall temperature and Darcy friction factor times Reynolds number.

    Source: Shah & London (1978), Laminar Flow Forced Convection in Ducts, fits within 0.1 %.

    >>> nusselt, friction = laminar_numbers(8e-3, 8e-3)
    >>> round(nusselt, 2), round(friction, 1)
    (2.98, 56.9)
    """
    ratio = min(width, depth) / max(width, depth)
    return 7.541 * float(_NUSSELT(ratio)), 96.0 * float(_FRICTION(ratio))


def required(kind: str, shape: DuctShape, *names: str) -> None:
    """Refuse a shape that lacks what a kind needs.

    Raises
    ------
    OutOfValidityError
    """
    missing = [name for name in names if getattr(shape, name) is None]
    if missing:
        raise OutOfValidityError(kind, f"needs {', '.join(missing)}.", "Give them.")
