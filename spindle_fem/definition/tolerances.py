"""Lengths with a tolerance, and default deviations of a machine from its drawing."""

from __future__ import annotations

from typing import Any

from spindle_fem.errors import UnitError
from spindle_fem.units import LARGEST_SIGMA_REL, to_si

# Default standard deviations: other states of drawings, castings and mounting of a machine that nobody
# has measured, far more than a machinist's tolerance.
DIAMETER_SHARE = 0.02
"""Standard deviation of an exposed diameter, relative."""
PLACE = 1.0e-3
"""Standard deviation of place and section of a cooling channel and of a flange or cover's thickness, m."""


class TolerancedLength(float):
    """A length in m with one standard deviation.

    Attributes
    ----------
    sigma : float or None, [m]
        0 for a length that was measured, None where the definition does not say.
    """

    sigma: float | None

    def __new__(cls, value: float, sigma: float | None = None) -> TolerancedLength:
        """A float that carries its standard deviation."""
        found = super().__new__(cls, value)
        found.sigma = sigma
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        return TolerancedLength, (float(self), self.sigma)


def sigma_of(length: float, otherwise: float) -> float:
    """One standard deviation of a length [m]: from the definition, or else the given one.

    >>> sigma_of(TolerancedLength(0.28, 1e-3), 5e-3), sigma_of(0.28, 5e-3)
    (0.001, 0.005)
    """
    own = getattr(length, "sigma", None)
    return otherwise if own is None else own


def toleranced_to_si(value: Any, unit: str = "m") -> TolerancedLength:
    """Read a length, ``{value, sigma}`` or ``{value, sigma_rel}``.

    Raises
    ------
    UnitError
        Other keys, a length that :func:`spindle_fem.units.to_si` refuses, or a deviation below 0.

    >>> toleranced_to_si({"value": "280 mm", "sigma": "1 mm"}).sigma
    0.001
    """
    if isinstance(value, TolerancedLength):
        return value
    if not isinstance(value, dict):
        return TolerancedLength(to_si(value, unit, where=""))
    keys = set(value)
    if keys not in ({"value", "sigma"}, {"value", "sigma_rel"}):
        raise UnitError(
            "",
            f"{value!r} is not a quantity.",
            'Allowed: a length, {value = "280 mm", sigma = "1 mm"} or {value = "280 mm", sigma_rel = 0.01}.',
        )
    length = to_si(value["value"], unit, where="value")
    if "sigma" in keys:
        sigma = to_si(value["sigma"], unit, where="sigma")
    else:
        share = to_si(value["sigma_rel"], "", where="sigma_rel")
        if share > LARGEST_SIGMA_REL:
            raise UnitError("sigma_rel", f"is {share:g}.", f"Allowed: 0 to {LARGEST_SIGMA_REL:g}.")
        sigma = share * abs(length)
    if sigma < 0.0:
        raise UnitError("sigma", f"is {sigma:g} {unit}.", "Allowed: 0 or more.")
    return TolerancedLength(length, sigma)
