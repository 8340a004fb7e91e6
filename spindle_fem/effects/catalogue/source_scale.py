"""Heat of a source that differs from the definition's by a constant factor."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spindle_fem.definition.machine_spec import HeatSource
from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, capital, place_words
from spindle_fem.effects.framework.laws import Complex, amplitude, repeated
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Term, TermContext
from spindle_fem.recordings.source_heat import source_heat

NAME = "factor"


class SourceScaleTerm(Term):
    """What a source gives beyond its own heat, at its place."""

    def __init__(self, name: str, source: HeatSource) -> None:
        self.name, self.source, self.heat_places = name, source, (source.place,)
        self.parameters = (amplitude(NAME, 0.4, null=1.0),)

    def heat(self, context: TermContext) -> Complex:
        """Further heat, (1, k) W; negative where the source gives less."""
        own = np.asarray(source_heat(self.source, context.inputs))
        return repeated(context, (context.parameters[NAME] - 1.0) * own, 1)


class SourceScale(Effect):
    """Constant factor on the heat of a ``[[source]]``: a motor's losses, a belt's, a seal's."""

    name = "source_scale"
    kind = "parameter"
    title = "a source gives other heat than the definition by a constant factor"
    check = (
        "Losses of the motor at this load (data sheet, power in less power out), tension of the belt, drag "
        "of the seal; where the heat follows a recorded quantity, the calibration of that measurement."
    )
    card = Card(
        group="Heat by speed",
        law="heat of the source × factor",
        size="factor ± 0.4",
        acts_on="[[source]] of a machine with geometry",
        states={NAME: ""},
    )

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Every source of a machine with geometry; those of a network are ``heat_scale``'s."""
        return tuple(
            self.candidate(
                source.name,
                SourceScaleTerm(self.term_name(source.name), source),
                amplitude=NAME,
                reference=1.2,
            )
            for source in machine.sources
        )

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the factor on the heat."""
        return (
            f"{capital(place_words(candidate.component))}: the heat is {reported[NAME].value:.2f} times that "
            "of the definition at every speed."
        )
