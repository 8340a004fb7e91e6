"""Natural convection: the outside film grows with the temperature difference."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.definition.machine_spec import MachineSpec, NaturalFilm
from spindle_fem.effects.catalogue.joint_conductance import JointConductance
from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Candidate, Reported, capital, place_words
from spindle_fem.effects.framework.laws import Complex, amplitude, linear, power
from spindle_fem.effects.framework.outside_film_law import (
    REFERENCE_DIFFERENCE,
    OutsideFilmEffect,
    OutsideFilmTerm,
)
from spindle_fem.effects.framework.term import TermContext, TermParameter

# Rounds the law off where wall and air have one temperature, K.
ROUNDING = 0.5


class NaturalConvectionTerm(OutsideFilmTerm):
    """Growth ``(|T - T_fluid| / 10 K)^m``."""

    def growth(self, wall: Complex, fluid: Complex, context: TermContext) -> Complex:
        """Relative to 10 K, (k,)."""
        square = ((wall - fluid) ** 2 + ROUNDING**2) / REFERENCE_DIFFERENCE**2
        return power(square, 0.5 * context.parameters["exponent"])


class NaturalConvection(OutsideFilmEffect):
    """Nusselt number with the power 1/4 (laminar) to 1/3 (turbulent) of the difference.

    Source: Churchill & Chu (1975), Int. J. Heat Mass Transfer 18, 1049-1053, 1323-1329.
    """

    name = "natural_convection"
    term_kind = NaturalConvectionTerm
    # On top of a link that carries none of it, and over a small range, it is a factor on the link.
    repeats = JointConductance.name
    title = "the outside film grows with the temperature difference to the room"
    check = (
        "Outside surfaces for covers, draught and dirt; measure wall and air temperature at two steady "
        "states of different heat."
    )
    card = Card(
        group="Surroundings",
        law="film × (1 + a g)/(1 + a c), g = (ΔT/10 K)^m",
        size="a ± 0.7; m 0.3 ± 0.08; c 0.5 ± 0.4, of a network 1 ± 0.5",
        acts_on="standing outside, boundary links",
        source="Churchill & Chu (1975), Int. J. Heat Mass Transfer 18, 1049, 1323",
    )

    def in_definition(self, spec: MachineSpec) -> bool:
        """A natural film has free convection and radiation."""
        return any(isinstance(film, NaturalFilm) for film in spec.film)

    def free_parameters(self) -> tuple[TermParameter, ...]:
        """Share of the nominal film at the reference difference, and its power."""
        return (
            amplitude("convective_share", 0.7, high=5.0),
            linear("exponent", 0.3, 0.08, low=0.1, high=1.0),
        )

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State exponent and share of the convective film."""
        return (
            f"{capital(place_words(candidate.component))}: the film to the air is not constant but "
            f"grows with the power {reported['exponent'].value:.2f} of the temperature difference (natural "
            "convection); that "
            f"part is {reported['convective_share'].value:.2f} of the constant film at 10 K."
        )
