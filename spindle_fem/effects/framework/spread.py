"""Distribution of heat over places: even, stronger on one side, or concentrated on one spot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spindle_fem.effects.framework.laws import Complex, linear, rows
from spindle_fem.effects.framework.term import TermContext, TermParameter

# 1 σ of the first harmonic of heat around the axis, beside its mean: 2 is all of it along one line.
UNEVEN = 1.0
# Share of the heat that is usually at the spot, and 1 σ.
FOCUSED, FOCUSED_SIGMA = 0.3, 0.3


@dataclass(frozen=True, slots=True)
class Spread:
    """Places, and how unevenly heat lies there where the only one of them has sides, or they have a spot.

    With sides, heat lies as ``1 + 2 (up cos + across sin)`` of its mean, both
    free. With a spot, a free share ``focus`` of it is there and the rest
    spread evenly.

    Attributes
    ----------
    sides : tuple of str
        First harmonics around the axis, along y and along -x.
    spot : str
        A further place, within them or one of them; none when empty.
    """

    places: tuple[str, ...]
    sides: tuple[str, ...] = ()
    spot: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Everything that takes heat, or is read."""
        return (*self.places, *((self.spot,) if self.spot else ()), *self.sides)

    @property
    def parameters(self) -> tuple[TermParameter, ...]:
        """Free parameters of the distribution."""
        focus = (linear("focus", FOCUSED, FOCUSED_SIGMA, low=0.0, high=1.0),) if self.spot else ()
        names = ("up", "across") if self.sides else ()
        return focus + tuple(linear(name, 0.0, 0.5 * UNEVEN, low=-1.0, high=1.0) for name in names)

    def shares(self, context: TermContext) -> Complex:
        """Share of the heat at each place, the spot after them, (n, k); they sum to 1."""
        focus = context.parameters["focus"] if self.spot else 0.0
        even = [(1.0 - focus) / len(self.places)] * len(self.places)
        return rows(context, *even, *([focus] if self.spot else ()))

    def heat(self, context: TermContext, total: Complex) -> Complex:
        """Heat (k,) over the names, (n, k)."""
        own, parts = context.parameters, self.shares(context) * total
        if not self.sides:
            return parts
        return np.concatenate((parts, rows(context, 2.0 * own["up"] * total, 2.0 * own["across"] * total)))

    def temperature(self, context: TermContext) -> Complex:
        """Temperature that what is spread so meets, (k,), where the names are what a term reads."""
        own, shares = context.parameters, self.shares(context)
        mean = (shares * context.temperatures[: len(shares)]).sum(axis=0)
        if not self.sides:
            return mean
        up, across = context.temperatures[len(shares) :]
        return mean + 2.0 * (own["up"] * up + own["across"] * across)
