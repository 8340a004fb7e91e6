"""Film of the cooling channel: fouled, or another law of the Reynolds number."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np

from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, capital
from spindle_fem.effects.framework.laws import amplitude, factor, linear, shape, smooth_step
from spindle_fem.effects.framework.machine_view import ChannelFlow, MachineView
from spindle_fem.effects.framework.term import CHANNEL_FILM, Operating, Term

FILM_FACTOR = "coolant.film_factor"
FOULING, TRANSITION, CURVATURE = "fouling", "transition", "curvature"
ONSETS = 8
# A law of the Reynolds number needs this ratio of its ends to show.
LEAST_RANGE = 1.1


class ReynoldsFilmTerm(Term, ABC):
    """Factor on the channel's film by the Reynolds number."""

    def __init__(self, name: str, channel: ChannelFlow) -> None:
        self.name, self._channel = name, channel

    @abstractmethod
    def law(self, reynolds: float, parameters: Mapping[str, float]) -> float:
        """Factor at a Reynolds number."""

    def operating_factor(self, point: Operating, parameters: Mapping[str, float]) -> dict[str, float]:
        """Film factor at an operating point; none without flow."""
        if point.coolant_flow <= 0.0:
            return {}
        reynolds = self._channel.reynolds_number(point.coolant_flow, point.coolant_inlet_temperature)
        return {CHANNEL_FILM: self.law(reynolds, parameters)}


class TransitionTerm(ReynoldsFilmTerm):
    """``1 + a S((Re - Re0)/w)`` with a smooth step S."""

    def __init__(self, name: str, channel: ChannelFlow, reynolds: tuple[float, float]) -> None:
        super().__init__(name, channel)
        middle, span = 0.5 * (reynolds[0] + reynolds[1]), max(reynolds[1] - reynolds[0], 0.1 * reynolds[1])
        self.parameters = (
            amplitude("film_increase", 3.0, low=-0.9, high=20.0),
            linear("onset_reynolds", middle, 0.5 * span, low=0.3 * reynolds[0], high=3.0 * reynolds[1]),
            shape("width", 80.0, 0.7, low=2.0, high=2000.0),
        )

    def law(self, reynolds: float, parameters: Mapping[str, float]) -> float:
        """Factor at a Reynolds number."""
        step = smooth_step((reynolds - parameters["onset_reynolds"]) / parameters["width"])
        return 1.0 + parameters["film_increase"] * float(step.real)


class CurvatureTerm(ReynoldsFilmTerm):
    """``(Re / Re_m)^m``, m above what the definition's own law has."""

    def __init__(self, name: str, channel: ChannelFlow, middle: float) -> None:
        super().__init__(name, channel)
        self.parameters = (
            amplitude("further_exponent", 0.3, low=-1.0, high=2.0),
            linear("reference_reynolds", middle, 0.0),
        )

    def law(self, reynolds: float, parameters: Mapping[str, float]) -> float:
        """Factor at a Reynolds number."""
        return float((reynolds / parameters["reference_reynolds"]) ** parameters["further_exponent"])


class CoolantFilm(Effect):
    """The channel's film differs by a factor, or by the Reynolds number.

    Source: secondary flow in curved ducts, Dravid et al. (1971), AIChE J. 17,
    1114-1122 (Nu with Dean^(1/2)); transition in ducts with bends and inserts
    from Re of some hundreds on; fouling factors of oils, TEMA.
    """

    name = "coolant_film"
    kind = "missing_physics"
    title = "the film coefficient in the cooling channel is not the modelled one"
    check = (
        "Channel for deposits, air pockets and the right flow (pressure drop against flow); where the "
        "film changes "
        "with the Reynolds number, step the coolant temperature and watch the housing beside the channel."
    )
    card = Card(
        group="Coolant",
        law="fouling: film × factor; transition: × 1 + a S((Re - Re₀)/w); curvature: × (Re/Re_m)^p",
        size="factor ×/÷ e^0.6; a ± 3, Re₀ searched over the range that occurs, w 80 ×/÷ e^0.7; p ± 0.3",
        acts_on="channel, circuits",
        source="Dravid et al. (1971), AIChE J. 17, 1114; TEMA",
        makes=Makes("colder", probe="SP04", at="channel"),
    )

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Fouling, transition and curvature of the channel; fouling of every circuit beside it."""
        fouled = tuple(
            self.factor_candidate(
                name,
                (factor(f"film.{name}", machine.parameters.get(f"film.{name}"), 0.6),),
                FOULING,
                0.6,
                shift=f"film.{name}" in machine.parameters,
            )
            for name in machine.circuits
        )
        if machine.channel is None:
            return fouled
        own = machine.parameters.get(FILM_FACTOR)
        found = [
            self.factor_candidate(
                "channel", (factor(FILM_FACTOR, own, 0.6),), FOULING, 0.6, shift=own is not None
            )
        ]
        low, high = machine.reynolds
        if low > 0.0:
            term = TransitionTerm(self.term_name("channel", TRANSITION), machine.channel, machine.reynolds)
            onsets = np.linspace(low, high, ONSETS + 1)
            found.append(
                self.candidate(
                    "channel",
                    term,
                    amplitude="film_increase",
                    reference=2.0,
                    form=TRANSITION,
                    starts=[
                        {"onset_reynolds": float(x), "width": max(20.0, 0.1 * (high - low))}
                        for x in 0.5 * (onsets[1:] + onsets[:-1])
                    ],
                )
            )
            curved = CurvatureTerm(
                self.term_name("channel", CURVATURE), machine.channel, float(np.sqrt(low * high))
            )
            found.append(
                self.candidate("channel", curved, amplitude="further_exponent", reference=0.3, form=CURVATURE)
            )
        return (*found, *fouled)

    def can_show(self, machine: MachineView, candidate: Candidate) -> bool:
        """A law of the Reynolds number needs a range of it."""
        low, high = machine.reynolds
        return candidate.form == FOULING or high > LEAST_RANGE * low

    def report(self, candidate: Candidate, values: Mapping[str, float]) -> dict[str, Reported]:
        """``factor`` where it is constant; above the onset where it is not."""
        if candidate.form == FOULING:
            return {"factor": Reported(values.get(candidate.amplitude, 1.0), "")}
        found = Effect.report(self, candidate, values)
        if candidate.form == TRANSITION:
            increase = found.pop("film_increase")
            found = {"factor_above": Reported(1.0 + increase.value, ""), **found}
        return found

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the factor on the film and from where it applies."""
        if candidate.form == FOULING:
            return (
                f"{capital(candidate.component.replace('_', ' '))}: the film coefficient is "
                f"{reported['factor'].value:.2f} times the modelled one "
                "at every flow (fouling, where below 1)."
            )
        if candidate.form == TRANSITION:
            return (
                f"Channel: above a Reynolds number of about {reported['onset_reynolds'].value:.0f} the film "
                f"coefficient is {reported['factor_above'].value:.1f} times the modelled one (transition)."
            )
        return (
            "Channel: the film coefficient grows with a further power "
            f"{reported['further_exponent'].value:.2f} of "
            "the Reynolds number (secondary flow in the curved channel)."
        )
