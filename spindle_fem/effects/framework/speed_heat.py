"""Heat that follows a power of the speed: what seals, windage and drives have in common."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spindle_fem.effects.framework.laws import Complex, amplitude, linear, power, relaxed, repeated, shape
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Term, TermContext

# Before any data: value and standard deviation.
SHARE_BESIDE = (0.15, 0.15)
# Running in: heat of a new part beyond the lasting heat (relative), and its time constant, s; deviations.
RUN_IN, RUN_IN_TIME = (0.3, 0.3), (5000.0, 0.8)


def turning_places(machine: MachineView, places: tuple[str, ...]) -> Iterator[tuple[str, str, str]]:
    """Places where heat may follow a speed, that speed, and the form that distinguishes it from others there.

    Parameters
    ----------
    places : tuple of str
        Of a machine with geometry; in a network every node with something turning.
    """
    for key in machine.spots if machine.kind == "network" else places:
        speeds = machine.speeds(key)
        for speed in speeds if key in machine.heat else ():
            yield key, speed, speed if len(speeds) > 1 else ""


class SpeedHeatTerm(Term):
    """Heat ``P (n / n0)^m``, spread evenly over its places, optionally with a lag.

    Parameters
    ----------
    speed : str
        Input.
    size : (str, float, float)
        Name of the heat at the reference speed, its usual size [W], the reference speed [rad/s].
    exponent : (float, float)
        Value and standard deviation; fixed where that is 0.
    lag : float
        Time constant before any data, [s]; none when 0.
    beside : tuple of str
        Places that take an unknown share of the heat; none of it where there are none.
    runs_in : bool
        Whether there is more of it at first, ``1 + a e^(-t/τ)`` with the time since the recording began.
    """

    def __init__(
        self,
        name: str,
        places: tuple[str, ...],
        speed: str,
        size: tuple[str, float, float],
        exponent: tuple[float, float],
        lag: float = 0.0,
        beside: tuple[str, ...] = (),
        runs_in: bool = False,
    ) -> None:
        self.name, self.heat_places, self._speed = name, (*places, *beside), speed
        self._own, self._beside, self._runs_in = len(places), len(beside), runs_in
        self._heat, usual, self._reference = size
        self.parameters = (
            amplitude(self._heat, usual, "W"),
            linear("exponent", *exponent, low=0.2, high=5.0),
        )
        if lag > 0.0:
            self.parameters += (shape("lag", lag, 0.8, "s", low=5.0, high=20000.0),)
            self.n_states = 1
        if beside:
            self.parameters += (linear("share_beside", *SHARE_BESIDE, low=0.0, high=0.9),)
        if runs_in:
            value, sigma = RUN_IN_TIME
            self.parameters += (
                linear("more_when_new", *RUN_IN, low=0.0, high=5.0),
                shape("run_in_time", value, sigma, "s", low=300.0, high=100000.0),
            )

    def _share(self, context: TermContext) -> Complex:
        relative = np.abs(context.inputs[self._speed]) / self._reference
        return power(relative, context.parameters["exponent"])

    def heat(self, context: TermContext) -> Complex:
        """Heat of every place, (n, k) W."""
        share = context.state[0] if self.n_states else self._share(context)
        total = context.parameters[self._heat] * share
        if self._runs_in:
            own = context.parameters
            total = total * (1.0 + own["more_when_new"] * np.exp(-context.time / own["run_in_time"]))
        if not self._beside:
            return repeated(context, total / self._own, self._own)
        away = context.parameters["share_beside"]
        return np.concatenate(
            (
                repeated(context, (1.0 - away) * total / self._own, self._own),
                repeated(context, away * total / self._beside, self._beside),
            )
        )

    def advance(self, context: TermContext, step: float) -> Complex:
        """Lagged power of the speed, (1, k)."""
        if not self.n_states:
            return context.state
        return relaxed(context.state, self._share(context), step, context.parameters["lag"])
