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

SINE, SAWTOOTH = "sine", "sawtooth"
PERIODS = (100.0, 3000.0)
# The sawtooth's Fourier series: share that each overtone keeps, which rounds its tip.
SHARPNESS = 0.9
# Its peak, arcsin of the sharpness, where a sine has 1.
PEAK = float(np.arcsin(SHARPNESS))
PHASES = (0.0, np.pi / 2.0, np.pi, -np.pi / 2.0)


class ChillerCyclingTerm(Term):
    """``A w(2π t / P + φ)`` on the inlet temperature, w a sine or a rounded sawtooth of peak 1.

    Parameters
    ----------
    places : tuple of str
        Fluids that swing.
    """

    def __init__(self, name: str, places: tuple[str, ...], *, sawtooth: bool) -> None:
        self.name, self.heat_places, self._sawtooth = name, places, sawtooth
        self.parameters = (
            # A sawtooth of negative amplitude falls fast and rises slowly, or the other way round.
            amplitude("amplitude", 2.0, "K", low=-20.0 if sawtooth else 0.0, high=20.0),
            shape("period", 600.0, 0.9, "s", low=20.0, high=20000.0),
            linear("phase", 0.0, np.pi, "rad", low=-3.0 * np.pi, high=3.0 * np.pi),
        )

    def heat(self, context: TermContext) -> Complex:
        """Shift of the inlet, (n, k) K."""
        own = context.parameters
        angle = 2.0 * np.pi * context.time / own["period"] + own["phase"]
        if self._sawtooth:
            # Σ r^k sin(kx)/k = arctan(r sin x / (1 - r cos x))
            wave = np.arctan(SHARPNESS * np.sin(angle) / (1.0 - SHARPNESS * np.cos(angle))) / PEAK
        else:
            wave = np.sin(angle)
        return repeated(context, own["amplitude"] * wave, len(self.heat_places))


class ChillerCycling(Effect):
    """A two-point controlled chiller.

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
        law="inlet + A sin(2πt/P + φ), or a rounded sawtooth",
        size="A ± 2 K; P 600 s ×/÷ e^0.9; φ any; P from the spectrum of what is left over",
        acts_on="channel, coolants of a network",
        source="makers' data of two-point chillers",
        states={"period": "s", "amplitude": "K"},
    )
    # A controller's switching wanders with the load.
    law_sigma = MappingProxyType({"period": 0.01})

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Sine and sawtooth at the channel; coolants of a network."""
        places: dict[str, tuple[str, ...]] = {}
        if machine.channel is not None:
            places["channel"] = (COOLANT_INLET,)
        for boundary, links in machine.coolant_links.items():
            places[boundary] = tuple(fluid_place(link) for link in links)
        longest = max(2.0 * PERIODS[0], min(PERIODS[1], 0.5 * machine.duration))
        periods = np.geomspace(PERIODS[0], longest, 6)
        found = []
        for key, fluids in places.items():
            for form in (SINE, SAWTOOTH):
                term = ChillerCyclingTerm(self.term_name(key, form), fluids, sawtooth=form == SAWTOOTH)
                found.append(
                    self.candidate(
                        machine.component(key),
                        term,
                        amplitude="amplitude",
                        reference=2.0,
                        form=form,
                        starts=[{"period": float(p), "phase": q} for p in periods for q in PHASES[:2]],
                    )
                )
        return tuple(found)

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
        """Period, amplitude and phase."""
        found = Effect.report(self, candidate, values)
        size = found["amplitude"]
        return {
            "period": found["period"],
            "amplitude": Reported(abs(size.value), "K"),
            "phase": found["phase"],
        }

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """Period and amplitude."""
        return (
            f"Coolant: the inlet temperature swings by ±{reported['amplitude'].value:.2g} K with a period of "
            f"{reported['period'].value:.0f} s ({candidate.form}) without being recorded."
        )
