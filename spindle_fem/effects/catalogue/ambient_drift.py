"""A room that warms or cools without being recorded."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported
from spindle_fem.effects.framework.laws import (
    Complex,
    amplitude,
    linear,
    repeated,
    shape,
    smooth_step,
    softplus,
)
from spindle_fem.effects.framework.machine_view import MachineView, fluid_place
from spindle_fem.effects.framework.term import Term, TermContext, TermParameter

STEADY, RAMP, STEP, HUMP, WAVE = "steady drift", "ramp", "step", "hump", "wave"
DAILY, YEARLY = "daily", "yearly"
CYCLES = {DAILY: 86400.0, YEARLY: 365.25 * 86400.0}
# Width of a ramp's bends, s.
BEND = 60.0


class DriftTerm(Term):
    """Shift of the surroundings' temperature by a law of time.

    Parameters
    ----------
    films : tuple of str
        Whose fluid it is.
    form : str
        steady drift, ramp (from one instant to another), step, hump (there and back) or wave.
    """

    def __init__(
        self, name: str, films: tuple[str, ...], form: str, parameters: tuple[TermParameter, ...]
    ) -> None:
        self.name, self._form, self.parameters = name, form, parameters
        self.heat_places = tuple(fluid_place(film) for film in films)

    def heat(self, context: TermContext) -> Complex:
        """Shift of the surroundings, the same for every film, (n, k) K."""
        own, time = context.parameters, context.time
        if self._form == STEADY:
            shift = own["rate"] * time
        elif self._form == RAMP:
            since = (time - own["start"]) / BEND
            passed = softplus(since) - softplus(since - own["ramp_time"] / BEND)
            shift = own["change"] * BEND * passed / own["ramp_time"]
        elif self._form == STEP:
            shift = own["change"] * smooth_step((time - own["time"]) / own["width"])
        elif self._form == HUMP:
            shift = own["change"] * np.exp(-0.5 * ((time - own["middle"]) / own["spread"]) ** 2)
        else:
            shift = own["amplitude"] * np.sin(2.0 * np.pi * time / own["period"] + own["phase"])
        return repeated(context, shift, len(self.heat_places))


class AmbientDrift(Effect):
    """The air at the machine differs from the reading of the ambient sensor.

    Source: machine halls drift by 0.5 to 2 K/h and step with doors and heating
    (ISO 230-3, environmental temperature variation error).
    """

    name = "ambient_drift"
    kind = "missing_physics"
    title = "the room at the machine warms or cools without being recorded"
    check = (
        "Place and shielding of the ambient sensor, doors, heating, neighbouring machines; log the air "
        "temperature beside the spindle at three heights."
    )
    card = Card(
        group="Surroundings",
        law=(
            "air shifted by: a steady drift; a ramp between two instants; a step; a hump "
            "e^(-((t-t₀)/w)²/2); a sine, free, daily or yearly"
        ),
        size=(
            "± 8 K over the span; change ± 5 K (ramp), ± 3 K (step, hump); amplitude ± 2 K; instants, "
            "widths and periods wide over the span"
        ),
        acts_on="all films to the ambient, or of one boundary",
        source="ISO 230-3",
    )

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Drift, ramp, step, hump and slow wave of the ambient, or of every boundary of a network."""
        found = []
        span = machine.duration
        for key, films in machine.surroundings.items():
            laws = {
                STEADY: (
                    (linear("rate", 0.0, 8.0 / span, "K/s"),),
                    "rate",
                    4.0 / span,
                    ({},),
                ),
                RAMP: (
                    (
                        linear("change", 0.0, 5.0, "K", low=-40.0, high=40.0),
                        linear("start", 0.3 * span, 0.4 * span, "s", low=-0.5 * span, high=span),
                        shape("ramp_time", 0.4 * span, 0.7, "s", low=4.0 * BEND, high=5.0 * span),
                    ),
                    "change",
                    3.0,
                    [
                        {"start": start * span, "ramp_time": max(5.0 * BEND, length * span)}
                        for start, length in ((0.0, 0.25), (0.0, 0.6), (0.25, 0.25), (0.25, 0.6), (0.55, 0.3))
                    ],
                ),
                STEP: (
                    (
                        linear("change", 0.0, 3.0, "K", low=-40.0, high=40.0),
                        linear("time", 0.5 * span, 0.35 * span, "s", low=-0.1 * span, high=1.1 * span),
                        shape("width", 300.0, 0.8, "s", low=10.0, high=20000.0),
                    ),
                    "change",
                    3.0,
                    [{"time": share * span} for share in (0.1, 0.25, 0.4, 0.55, 0.7, 0.85)],
                ),
                HUMP: (
                    (
                        linear("change", 0.0, 3.0, "K", low=-40.0, high=40.0),
                        linear("middle", 0.5 * span, 0.3 * span, "s", low=-0.1 * span, high=1.1 * span),
                        shape("spread", 0.15 * span, 0.5, "s", low=5.0 * BEND, high=span),
                    ),
                    "change",
                    3.0,
                    [
                        {"middle": middle * span, "spread": spread * span}
                        for middle in (0.25, 0.5, 0.75)
                        for spread in (0.08, 0.16)
                    ],
                ),
                WAVE: (
                    (
                        amplitude("amplitude", 2.0, "K", high=40.0),
                        shape("period", span, 0.6, "s", low=0.05 * span),
                        linear("phase", 0.0, np.pi, "rad", low=-3.0 * np.pi, high=3.0 * np.pi),
                    ),
                    "amplitude",
                    2.0,
                    [
                        {"period": share * span, "phase": phase}
                        for share in (0.4, 0.8, 1.6)
                        for phase in (0.0, np.pi / 2.0, np.pi, -np.pi / 2.0)
                    ],
                ),
            }
            for form, period in CYCLES.items():
                laws[form] = (
                    (
                        amplitude("amplitude", 3.0, "K", high=40.0),
                        linear("period", period, 0.0, "s"),
                        linear("phase", 0.0, np.pi, "rad", low=-3.0 * np.pi, high=3.0 * np.pi),
                    ),
                    "amplitude",
                    2.0,
                    [{"phase": phase} for phase in (0.0, np.pi / 2.0, np.pi, -np.pi / 2.0)],
                )
            for form, (parameters, size, reference, starts) in laws.items():
                term = DriftTerm(self.term_name(key, form), films, form, parameters)
                found.append(
                    self.candidate(
                        machine.component(key),
                        term,
                        amplitude=size,
                        reference=reference,
                        form=form,
                        starts=starts,
                    )
                )
        return tuple(found)

    def can_show(self, machine: MachineView, candidate: Candidate) -> bool:
        """A day's or a year's swing needs half of it at least."""
        return machine.duration > 0.5 * CYCLES.get(candidate.form, 0.0)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State rate or size and time of the drift."""
        subject = (
            "The room at the machine"
            if candidate.component == "ambient"
            else f"The temperature of {candidate.component}"
        )
        if candidate.form == STEADY:
            rate = reported["rate"].value
            word = "warms" if rate >= 0.0 else "cools"
            return f"{subject} {word} by {abs(rate):.2g} K/h more than recorded."
        if candidate.form == RAMP:
            change, begin = reported["change"].value, reported["start"].value
            word = "warms" if change >= 0.0 else "cools"
            return (
                f"{subject} {word} by {abs(change):.2g} K more than recorded from {begin / 60.0:.0f} min to "
                f"{(begin + reported['ramp_time'].value) / 60.0:.0f} min after the start."
            )
        if candidate.form == STEP:
            change = reported["change"].value
            word = "warmer" if change >= 0.0 else "colder"
            return (
                f"{subject} becomes {abs(change):.2g} K {word} than recorded about "
                f"{reported['time'].value / 60.0:.0f} min after the start."
            )
        if candidate.form == HUMP:
            change = reported["change"].value
            word = "warmer" if change >= 0.0 else "colder"
            return (
                f"{subject} becomes up to {abs(change):.2g} K {word} than recorded, most about "
                f"{reported['middle'].value / 60.0:.0f} min after the start, and comes back."
            )
        if candidate.form in CYCLES:
            size = reported["amplitude"].value
            return f"{subject} swings {candidate.form} by ±{size:.2g} K without being recorded."
        return (
            f"{subject} swings by ±{reported['amplitude'].value:.2g} K with a period of "
            f"{reported['period'].value / 3600.0:.1f} h without being recorded."
        )
