"""Heat that follows a power of the speed: what seals, windage and drives have in common."""

from __future__ import annotations

import numpy as np

from spindle_fem.effects.laws import Complex, amplitude, linear, power, relaxed, repeated, shape
from spindle_fem.effects.term import Term, TermContext


class SpeedHeatTerm(Term):
    """Heat ``P (n / n0)^m``, spread evenly over its places, lagging where asked.

    Parameters
    ----------
    name : str
    places : tuple of str
    speed : str
        Input.
    size : (str, float, float)
        Name of the heat at the reference speed, its usual size [W], the reference speed [rad/s].
    exponent : (float, float)
        Value and standard deviation; fixed where that is 0.
    lag : float
        Time constant before any data, [s]; none when 0.
    """

    def __init__(
        self,
        name: str,
        places: tuple[str, ...],
        speed: str,
        size: tuple[str, float, float],
        exponent: tuple[float, float],
        lag: float = 0.0,
    ) -> None:
        self.name, self.heat_places, self._speed = name, places, speed
        self._heat, usual, self._reference = size
        self.parameters = (
            amplitude(self._heat, usual, "W"),
            linear("exponent", *exponent, low=0.2, high=5.0),
        )
        if lag > 0.0:
            self.parameters += (shape("lag", lag, 0.8, "s", low=5.0, high=20000.0),)
            self.n_states = 1

    def _share(self, context: TermContext) -> Complex:
        relative = np.abs(context.inputs[self._speed]) / self._reference
        return power(relative, context.parameters["exponent"])

    def heat(self, context: TermContext) -> Complex:
        """Heat of every place, (n, k) W."""
        share = context.state[0] if self.n_states else self._share(context)
        each = context.parameters[self._heat] * share / len(self.heat_places)
        return repeated(context, each, len(self.heat_places))

    def advance(self, context: TermContext, step: float) -> Complex:
        """Lagged power of the speed, (1, k)."""
        if not self.n_states:
            return context.state
        return relaxed(context.state, self._share(context), step, context.parameters["lag"])
