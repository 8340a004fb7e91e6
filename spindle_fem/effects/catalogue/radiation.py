"""Radiation: surfaces lose heat faster than in proportion to their temperature."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.definition.machine_spec import MachineSpec, NaturalFilm
from spindle_fem.effects.catalogue.joint_conductance import JointConductance
from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Candidate, Reported, capital, place_words
from spindle_fem.effects.framework.laws import Complex, amplitude
from spindle_fem.effects.framework.outside_film_law import (
    REFERENCE_DIFFERENCE,
    REFERENCE_TEMPERATURE,
    OutsideFilmEffect,
    OutsideFilmTerm,
)
from spindle_fem.effects.framework.term import TermContext, TermParameter


def radiative(wall: Complex, fluid: Complex) -> Complex:
    """``(T⁴ - T_f⁴)/(T - T_f)``, [K³]."""
    return (wall**2 + fluid**2) * (wall + fluid)


NOMINAL = radiative(REFERENCE_TEMPERATURE + REFERENCE_DIFFERENCE, REFERENCE_TEMPERATURE)


class RadiationTerm(OutsideFilmTerm):
    """Growth of the radiative film by Stefan and Boltzmann."""

    def growth(self, wall: Complex, fluid: Complex, context: TermContext) -> Complex:
        """Relative to a wall of 303 K in a room of 293 K, (k,)."""
        return radiative(wall, fluid) / NOMINAL


class Radiation(OutsideFilmEffect):
    """Exchange with large surroundings by the fourth power.

    Source: Stefan-Boltzmann law; 5.7 W/(m²·K) for a black wall at 293 K, so
    about half of a usual outside film of 10 W/(m²·K).
    """

    name = "radiation"
    term_kind = RadiationTerm
    # On top of a link that carries none of it, and over a small range, it is a factor on the link.
    repeats = JointConductance.name
    title = "surfaces lose heat by radiation, faster than in proportion to their temperature"
    check = (
        "Paint and bare metal of the outside (emissivity), hot or cold bodies in sight (oven, window, "
        "coolant tank); compare a surface with and without a reflecting foil."
    )
    card = Card(
        group="Surroundings",
        law="the same with g = (T⁴ - T_air⁴)/(T - T_air) over its value at 303 and 293 K",
        size="a ± 0.6; c 0.5 ± 0.4, of a network 1 ± 0.5",
        acts_on="standing outside, boundary links",
        source="Stefan-Boltzmann",
    )

    def in_definition(self, spec: MachineSpec) -> bool:
        """A natural film has free convection and radiation."""
        return any(isinstance(film, NaturalFilm) for film in spec.film)

    def free_parameters(self) -> tuple[TermParameter, ...]:
        """Share of the nominal film at the reference difference."""
        return (amplitude("radiative_share", 0.6, high=5.0),)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the radiative share of the film."""
        return (
            f"{capital(place_words(candidate.component))}: heat is lost by radiation besides the "
            "constant film; "
            f"at 10 K it is {reported['radiative_share'].value:.2f} of that film and grows with the "
            "fourth power of the absolute temperature."
        )
