"""How heat lies over places: evenly, or on one of them more on one side than on the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spindle_fem.effects.laws import Complex, linear, repeated, rows
from spindle_fem.effects.term import TermContext, TermParameter

# 1 σ of the first harmonic of heat around the axis, beside its mean: 2 is all of it along one line.
UNEVEN = 1.0


@dataclass(frozen=True, slots=True)
class Spread:
    """Places and, where the only one of them has sides, its first harmonics around the axis.

    With sides, heat lies as ``1 + 2 (up cos + across sin)`` of its mean, both free.

    Attributes
    ----------
    places : tuple of str
    sides : tuple of str
        Along y and along -x.
    """

    places: tuple[str, ...]
    sides: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Everything that takes heat, or is read."""
        return (*self.places, *self.sides)

    @property
    def parameters(self) -> tuple[TermParameter, ...]:
        """What is free about it."""
        names = ("up", "across") if self.sides else ()
        return tuple(linear(name, 0.0, 0.5 * UNEVEN, low=-1.0, high=1.0) for name in names)

    def heat(self, context: TermContext, total: Complex) -> Complex:
        """Heat (k,) over the names, (n, k)."""
        even = repeated(context, total / len(self.places), len(self.places))
        if not self.sides:
            return even
        own = context.parameters
        return np.concatenate((even, rows(context, 2.0 * own["up"] * total, 2.0 * own["across"] * total)))

    def temperature(self, context: TermContext) -> Complex:
        """Temperature that what is spread so meets, (k,), where the names are what a term reads."""
        mean = context.temperatures[: len(self.places)].mean(axis=0)
        if not self.sides:
            return mean
        own, (up, across) = context.parameters, context.temperatures[len(self.places) :]
        return mean + 2.0 * (own["up"] * up + own["across"] * across)
