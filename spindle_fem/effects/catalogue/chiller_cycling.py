"""Inlet temperature that swings about its set point, unrecorded."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Array, Candidate, Effect, Reported
from spindle_fem.effects.framework.laws import Complex, amplitude, linear, repeated, shape
from spindle_fem.effects.framework.machine_view import MachineView, fluid_place
from spindle_fem.effects.framework.spectrum import strongest_periods
from spindle_fem.effects.framework.term import COOLANT_INLET, Term, TermContext

PERIODS = (100.0, 3000.0)
# Sharpness, r: what each overtone keeps of the one before it. 0 is a sine, towards 1 a sawtooth, below 0 one
# that rises slowly. 1 sigma, bounds, and below which it is a sine and one overtone to rounding.
SHARPNESS_SIGMA, SHARPEST, BLUNT = 0.4, 0.97, 1e-5
PHASES = (0.0, np.pi / 2.0, np.pi, -np.pi / 2.0)
# A controller's switching wanders with the load: 1 sigma by which each cycle's length differs from the
# others', independently of theirs, as a share of the period (judgement; some 3 to 5 %).
WANDER = 0.05
# Sines over the recording that the wandering phase is made of.
WAVES = 8


def wander_names() -> tuple[str, ...]:
    """Names of the parameters of a wandering phase."""
    return tuple(f"wander_{number}" for number in range(1, WAVES + 1))


def departures(share: Array | Complex, cycles: float | Complex) -> list[Array | Complex]:
    """Phase by each unit of wander after a share of the recording, [rad].

    Cycles whose lengths differ independently let the phase walk at random about that of their mean period;
    these are the first terms of such a walk between fixed ends.
    Source: Loève (1978), Probability Theory II, section 37 (expansion of the Brownian bridge).
    """
    share = np.where(np.real(share) < 1.0, share, 1.0)
    size = 2.0 * np.sqrt(2.0 * cycles)
    return [size / number * np.sin(np.pi * number * share) for number in range(1, WAVES + 1)]


class ChillerCyclingTerm(Term):
    """``A w(2π t / P + φ + ψ)`` on the inlet temperature, w from a sine to a sawtooth, of peak 1.

    ψ wanders and is 0 at both ends of the recording, so that P is the mean period.

    Parameters
    ----------
    places : tuple of str
        Fluids that swing.
    span : float, [s]
        Duration of the recording.
    """

    def __init__(self, name: str, places: tuple[str, ...], span: float) -> None:
        self.name, self.heat_places = name, places
        self.parameters = (
            amplitude("amplitude", 2.0, "K", high=20.0),
            shape("period", 600.0, 0.9, "s", low=20.0, high=20000.0),
            linear("phase", 0.0, np.pi, "rad", low=-3.0 * np.pi, high=3.0 * np.pi),
            linear("sharpness", 0.0, SHARPNESS_SIGMA, low=-SHARPEST, high=SHARPEST),
            *(linear(wander, 0.0, WANDER) for wander in wander_names()),
            shape("wander_span", span, 0.0, "s"),
        )

    def heat(self, context: TermContext) -> Complex:
        """Shift of the inlet, (n, k) K."""
        own = context.parameters
        span = own["wander_span"]
        angle = 2.0 * np.pi * context.time / own["period"] + own["phase"]
        for name, departure in zip(
            wander_names(), departures(context.time / span, span / own["period"]), strict=True
        ):
            angle = angle + own[name] * departure
        return repeated(context, own["amplitude"] * wave(angle, own["sharpness"]), len(self.heat_places))


def wave(angle: Complex, sharpness: Complex) -> Complex:
    """``Σ r^k sin(kx) / k = arctan(r sin x / (1 - r cos x))`` over its peak, arcsin r.

    >>> wave(np.array([0.5 * np.pi, 1.5 * np.pi]), np.zeros(2)).tolist()
    [1.0, -1.0]
    """
    is_blunt = np.abs(sharpness) < BLUNT
    share = np.where(is_blunt, BLUNT, sharpness)
    sharp = np.arctan(share * np.sin(angle) / (1.0 - share * np.cos(angle))) / np.arcsin(share)
    return np.where(is_blunt, np.sin(angle) + 0.5 * sharpness * np.sin(2.0 * angle), sharp)


class ChillerCycling(Effect):
    """A two-point controlled chiller.

    Its cycles are not all alike. The phase is fitted as one that wanders over the recording, which has one
    mean period.

    Source: hysteresis of 1 to 4 K and periods of minutes to an hour are usual
    of machine-tool chillers that switch their compressor (makers' data sheets).
    """

    name = "chiller_cycling"
    kind = "missing_physics"
    title = "the inlet temperature swings about its set point without being recorded"
    check = (
        "Chiller: log the inlet temperature every few seconds; hysteresis of its controller, tank volume, "
        "compressor starts per hour."
    )
    card = Card(
        group="Coolant",
        law=(
            "inlet + A w(2πt/P + φ + ψ(t)); w(x) = arctan(r sin x/(1 - r cos x)) / arcsin r; "
            "ψ = Σ b 2√(2T/P) sin(mπt/T) / m"
        ),
        size=(
            "A ± 2 K; P 600 s ×/÷ e^0.9; φ any; r ± 0.4 (0 a sine, ± 0.9 a sawtooth); b ± 0.05 (cycles of "
            "one length to 5 %), m up to 8; P from the spectrum of what is left over"
        ),
        acts_on="channel, coolants of a network",
        source="makers' data of two-point chillers",
        states={"period": "s", "amplitude": "K"},
    )
    # A controller's switching wanders with the load. Steps of a minute draw a swing of 600 s straight between
    # them, 3 % too flat.
    law_sigma = MappingProxyType({"period": 0.01, "amplitude": 0.02})

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """At the channel; coolants of a network."""
        places: dict[str, tuple[str, ...]] = {}
        if machine.channel is not None:
            places["channel"] = (COOLANT_INLET,)
        for boundary, links in machine.coolant_links.items():
            places[boundary] = tuple(fluid_place(link) for link in links)
        longest = max(2.0 * PERIODS[0], min(PERIODS[1], 0.5 * machine.duration))
        periods = np.geomspace(PERIODS[0], longest, 6)
        return tuple(
            self.candidate(
                machine.component(key),
                ChillerCyclingTerm(self.term_name(key), fluids, machine.duration),
                amplitude="amplitude",
                reference=2.0,
                starts=[{"period": float(p), "phase": q} for p in periods for q in PHASES[:2]],
            )
            for key, fluids in places.items()
        )

    def can_show(self, machine: MachineView, candidate: Candidate) -> bool:
        """Two periods are needed to distinguish a swing from a drift."""
        return machine.duration > 2.0 * PERIODS[0]

    def starts_from(
        self, candidate: Candidate, times: Array, residual: Array
    ) -> tuple[Mapping[str, float], ...]:
        """The strongest periods of what is left over, four phases each."""
        term = candidate.terms[0].name
        return (
            tuple(
                {f"{term}.period": period, f"{term}.phase": phase}
                for period in strongest_periods(times, residual, *PERIODS, number=3)
                for phase in PHASES
            )
            or candidate.starts
        )

    def report(self, candidate: Candidate, values: Mapping[str, float]) -> dict[str, Reported]:
        """Period, amplitude, phase and sharpness."""
        found = Effect.report(self, candidate, values)
        return {name: found[name] for name in ("period", "amplitude", "phase", "sharpness")}

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """Period, amplitude and how much of a cycle rises."""
        # From trough to peak: where cos x = r, half the rise to either side of 0.
        rising = 100.0 * np.arccos(reported["sharpness"].value) / np.pi
        return (
            f"Coolant: the inlet temperature swings by ±{reported['amplitude'].value:.2g} K with a mean "
            f"period of {reported['period'].value:.0f} s, rising for {rising:.0f} % of it, without being "
            "recorded."
        )
