"""Lengths with a tolerance, and how far a machine is from its drawing where the definition does not say."""

from __future__ import annotations

from typing import Any

# One standard deviation where a definition gives none: what drawings of other states, castings and mounting
# leave open on a machine that nobody has measured, far more than a machinist's tolerance.
DIAMETER_SHARE = 0.02
"""Of an exposed diameter."""
PLACE = 1.0e-3
"""Of the place and the section of a cooling channel, and of the thickness of a flange or cover, m."""


class TolerancedLength(float):
    """A length in m with one standard deviation.

    Attributes
    ----------
    sigma : float, [m]
        0 for a length that was measured.
    """

    sigma: float

    def __new__(cls, value: float, sigma: float) -> TolerancedLength:
        """A float that carries its standard deviation."""
        found = super().__new__(cls, value)
        found.sigma = sigma
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        return TolerancedLength, (float(self), self.sigma)


def sigma_of(length: float, otherwise: float) -> float:
    """One standard deviation of a length [m]: what the definition says, or else another.

    >>> sigma_of(TolerancedLength(0.28, 1e-3), 5e-3), sigma_of(0.28, 5e-3)
    (0.001, 0.005)
    """
    return length.sigma if isinstance(length, TolerancedLength) else otherwise
