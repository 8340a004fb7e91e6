"""Friction that changes above a speed where the grease can no longer refill the tracks."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from spindle_fem.effects.catalogue.heat_scale import HeatScale
from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, capital, place_words, quantity
from spindle_fem.effects.framework.laws import (
    RPM,
    Complex,
    amplitude,
    linear,
    relaxed,
    repeated,
    shape,
    smooth_step,
    softplus,
)
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Term, TermContext

ONSETS = 8
# Growth of the friction change with the speed beyond the onset before any data: value and 1 σ.
GROWTH = (0.0, 0.2)
# Where a recording is all standstill.
USUAL_SPEED = 3000.0 * RPM


class StarvationTerm(Term):
    """Factor ``1 + a s`` on friction; s follows ``S((n - n0)/w) (1 + g r)`` with a lag.

    S is a smooth step, r the speed beyond the onset, a smooth ramp, in units of
    1000 rpm: the faster, the less comes back before the next ball. The lag is
    that of the tracks, which run dry and refill over many turns.

    Parameters
    ----------
    speed : str
        Input.
    highest, lowest : float, [rad/s]
        Of it, for the prior of the onset. One below nearly all speeds would be a factor on all friction.
    """

    n_states = 1

    def __init__(
        self, name: str, bearings: tuple[str, ...], speed: str, highest: float, lowest: float = 0.0
    ) -> None:
        self.name, self.bearings, self._speed = name, bearings, speed
        self.parameters = (
            amplitude("friction_change", 0.4, low=-0.9, high=5.0),
            linear("onset_speed", 0.6 * highest, 0.3 * highest, "rad/s", low=lowest, high=1.3 * highest),
            shape("width", 120.0 * RPM, 0.7, "rad/s", low=5.0 * RPM, high=1500.0 * RPM),
            linear("growth_per_1000rpm", *GROWTH, low=-0.5, high=5.0),
            shape("lag", 100.0, 1.0, "s", low=1.0, high=5000.0),
        )

    def friction(self, context: TermContext) -> Complex:
        """Factor on every bearing, (n, k)."""
        factor = 1.0 + context.parameters["friction_change"] * context.state[0]
        return repeated(context, factor, len(self.bearings))

    def advance(self, context: TermContext, step: float) -> Complex:
        """Starved share, (1, k)."""
        own = context.parameters
        speed = np.abs(context.inputs[self._speed])
        beyond = (speed - own["onset_speed"]) / own["width"]
        ramp = own["width"] * softplus(beyond) / (1000.0 * RPM)
        target = smooth_step(beyond) * (1.0 + own["growth_per_1000rpm"] * ramp)
        return relaxed(context.state, (target + 0.0 * own["lag"])[None], step, own["lag"])


class Starvation(Effect):
    """Replenishment fails above a speed.

    Source: Cann, Damiens & Lubrecht (2004), Tribol. Int. 37, 859-864: film of
    grease-lubricated contacts against the starvation number, which grows with speed.
    """

    name = "starvation"
    kind = "missing_physics"
    repeats = HeatScale.name
    title = "friction changes above a certain speed, where the grease no longer refills the tracks"
    check = (
        "Grease quantity, age and bleeding; ramp the speed slowly through the onset and watch drag torque, "
        "temperature and noise; compare with freshly greased bearings."
    )
    card = Card(
        group="Bearings",
        law="friction × 1 + a s, s follows S((n - n₀)/w)·(1 + g (n - n₀)₊) with a lag",
        size=(
            "a ± 0.4 (above -0.9); n₀ 0.6 ± 0.3 of the highest speed, above the slowest tenth; w 120 rpm "
            "×/÷ e^0.7; g 0 ± 0.2 per 1000 rpm; lag 100 s ×/÷ e"
        ),
        acts_on="set, bearing, source with a speed",
        source="Cann et al. (2004), Tribol. Int. 37, 859",
        states={"onset_speed": "rpm"},
        makes=Makes("warmer", probe="SP01", at="front_bearings"),
    )
    # Replenishment fails over a range of speeds.
    law_sigma = MappingProxyType({"onset_speed": 0.06})

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Sets, single bearings and sources."""
        found = []
        for key, bearings in machine.sets.items():
            for speed in machine.speeds(key)[:1]:
                highest = machine.highest(speed) or USUAL_SPEED
                lowest = min(max(machine.lowest_speed, 0.15 * highest), 0.8 * highest)
                term = StarvationTerm(self.term_name(key), bearings, speed, highest, lowest)
                onsets = np.linspace(lowest, highest, ONSETS + 1)
                starts = [{"onset_speed": float(n)} for n in 0.5 * (onsets[1:] + onsets[:-1])]
                found.append(
                    self.candidate(
                        machine.component(key),
                        term,
                        amplitude="friction_change",
                        reference=0.4,
                        form=machine.form(key),
                        starts=starts,
                    )
                )
        return tuple(found)

    def statement(self, candidate: Candidate, reported: dict[str, Reported]) -> str:
        """State the change of friction and the speed above which it occurs."""
        change = 100.0 * reported["friction_change"].value
        word = "more" if change >= 0.0 else "less"
        return (
            f"{capital(place_words(candidate.component))}: above {quantity(reported['onset_speed'])} the "
            "friction "
            f"heat is {abs(change):.0f} % {word} than modelled, as when the grease no longer refills the "
            "tracks."
        )
