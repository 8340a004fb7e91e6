"""Extra friction after a start or a refill, which fades while the machine turns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.catalogue.heat_scale import HeatScale
from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Effect
from spindle_fem.effects.framework.laws import (
    RPM,
    Complex,
    amplitude,
    linear,
    power,
    relaxed,
    repeated,
    shape,
)
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Term, TermContext

# Below this share of the highest speed nothing churns.
TURNING_SHARE = 1e-3
RESTARTS = "after every rest"
# At which the time constant is stated, rad/s.
RUN_IN_SPEED = 3000.0 * RPM
Array = NDArray[np.float64]


class GreaseChurningTerm(Term):
    """Factor ``1 + a exp(-x^s)`` on friction; x counts how far the grease is run in.

    While the machine turns x grows by ``(n / 3000 rpm)^m`` in a time constant:
    with time alone (m = 0) or with revolutions (m = 1). At rest it stays, or
    goes back.

    Parameters
    ----------
    speed : str
        Input that shows whether the machine turns.
    threshold : float
        Magnitude of it above which it does.
    restarts : bool
        Whether grease flows back at rest, so that every start begins anew.
    revolutions : bool
        Whether the input is a speed, with which it may run in the faster.
    """

    n_states = 1

    def __init__(
        self,
        name: str,
        bearings: tuple[str, ...],
        speed: str,
        threshold: float,
        *,
        restarts: bool,
        revolutions: bool = False,
    ) -> None:
        self.name, self.bearings = name, bearings
        self._speed, self._threshold = speed, threshold
        self._restarts, self._revolutions = restarts, revolutions
        self.parameters = (
            amplitude("extra_friction", 0.4, high=10.0),
            shape("time_constant", 1800.0, 0.9, "s", low=30.0, high=50000.0),
            shape("stretch", 1.0, 0.15, low=0.4, high=2.0),
        )
        if revolutions:
            self.parameters += (linear("speed_exponent", 0.5, 0.5, low=0.0, high=1.5),)
        if restarts:
            self.parameters += (shape("settling_time", 300.0, 1.0, "s", low=1.0, high=20000.0),)

    def friction(self, context: TermContext) -> Complex:
        """Factor on every bearing, (n, k)."""
        own = context.parameters
        fresh = np.exp(-power(context.state[0], own["stretch"]))
        return repeated(context, 1.0 + own["extra_friction"] * fresh, len(self.bearings))

    def advance(self, context: TermContext, step: float | Array) -> Complex:
        """Progress of the grease's run-in, (1, k)."""
        own = context.parameters
        speed = np.abs(context.inputs[self._speed])
        turning = speed > self._threshold
        faster = power(speed / RUN_IN_SPEED, own["speed_exponent"]) if self._revolutions else 1.0
        run = context.state + step * faster / own["time_constant"]
        rest = relaxed(context.state, 0.0, step, own["settling_time"]) if self._restarts else context.state
        return np.where(turning, run, rest)


class GreaseChurning(Effect):
    """Churning until the grease is pushed out of the balls' path.

    Source: Lugt (2009), Tribol. Trans. 52, 470-480, churning phase of grease
    lubrication; its duration is taken from run-in instructions of spindle
    bearings (minutes to hours), which count time at rising speeds.
    """

    name = "grease_churning"
    kind = "missing_physics"
    repeats = HeatScale.name
    title = "extra friction that fades with running time, as of grease not yet distributed"
    check = (
        "Lubrication record: was the set refilled, overfilled or long at rest? Run the grease in step by "
        "step and repeat the test; the extra heat must not come back."
    )
    card = Card(
        group="Bearings",
        law=(
            "friction × 1 + a e^(-x^s); x grows while turning by (n/3000 rpm)^m in τ; in a second form it"
            " goes back at rest"
        ),
        size="a ± 0.4; τ 1800 s ×/÷ e^0.9; s 1 ×/÷ e^0.15; m 0.5 ± 0.5 (0 to 1.5); at rest 300 s ×/÷ e^1",
        acts_on="set, bearing, source",
        source="Lugt (2009), Tribol. Trans. 52, 470",
        makes=Makes("warmer", probe="SP01", at="front_bearings"),
    )

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Once, or at every start; sets, single bearings and sources."""
        found = []
        for key, bearings in machine.sets.items():
            if machine.oiled and set(bearings) <= set(machine.oiled):
                continue
            # Every start of a single bearing anew is left to its set: grease rests in all of them.
            forms = (("", False), (RESTARTS, True)) if key in machine.groups else (("", False),)
            for speed in machine.running(key):
                for form, restarts in forms:
                    term = GreaseChurningTerm(
                        self.term_name(key, form),
                        bearings,
                        speed,
                        TURNING_SHARE * machine.highest(speed),
                        restarts=restarts,
                        revolutions=speed in machine.speeds(key),
                    )
                    times = [600.0, 1800.0, 5000.0]
                    found.append(
                        self.candidate(
                            machine.component(key),
                            term,
                            amplitude="extra_friction",
                            reference=0.4,
                            form=machine.form(key, form),
                            starts=[{"time_constant": time} for time in times],
                        )
                    )
        return tuple(found)
