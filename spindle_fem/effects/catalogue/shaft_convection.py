"""Air that the turning shaft stirs takes more heat from it than modelled."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, place_words, quantity
from spindle_fem.effects.framework.laws import RPM, Complex, amplitude, fluid_temperature, linear, power, rows
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Operating, Term, TermContext

REFERENCE = 3000.0 * RPM


class ShaftFilmTerm(Term):
    """Films of the shaft times ``1 + a (n / 3000 rpm)^m``.

    Parameters
    ----------
    films : tuple of str
        Coefficients.
    """

    def __init__(self, name: str, films: tuple[str, ...]) -> None:
        self.name, self._films = name, films
        self.parameters = (
            amplitude("film_increase_at_3000rpm", 1.0, high=20.0),
            linear("exponent", 0.8, 0.2, low=0.2, high=3.0),
        )

    def operating_factor(self, point: Operating, parameters: Mapping[str, float]) -> dict[str, float]:
        """Factor on every film."""
        share = float(power(abs(point.speed) / REFERENCE, parameters["exponent"]).real)
        found = 1.0 + parameters["film_increase_at_3000rpm"] * share
        return dict.fromkeys(self._films, found)


class ShaftLossTerm(Term):
    """Heat from a place to the surroundings, ``-G (n / 3000 rpm)^m (T - T_fluid)``.

    Parameters
    ----------
    fluid : str or float
        Input that gives the fluid's temperature, or that temperature [K].
    usual : float, [W/K]
    """

    def __init__(self, name: str, place: str, speed: str, fluid: str | float, usual: float) -> None:
        self.name, self._speed, self._fluid = name, speed, fluid
        self.heat_places = self.reads = (place,)
        self.parameters = (
            amplitude("conductance_at_3000rpm", usual, "W/K"),
            linear("exponent", 0.8, 0.2, low=0.2, high=3.0),
        )

    def heat(self, context: TermContext) -> Complex:
        """Heat of the place, (1, k) W."""
        own = context.parameters
        share = power(np.abs(context.inputs[self._speed]) / REFERENCE, own["exponent"])
        difference = context.temperatures[0] - fluid_temperature(context, self._fluid)
        return rows(context, -own["conductance_at_3000rpm"] * share * difference)


class ShaftConvection(Effect):
    """Convection from rotating surfaces.

    Source: Becker (1963), Int. J. Heat Mass Transfer 6, 1053-1062: Nusselt
    number of turning cylinders with Re^(2/3); discs with Re^0.8 where turbulent.
    """

    name = "shaft_convection"
    kind = "missing_physics"
    title = "the turning shaft loses heat to the air, growing with speed"
    check = (
        "Draught at the shaft ends, open guards, air through the hollow shaft (drawbar bore, purge air); "
        "measure the shaft end's temperature at two speeds."
    )
    card = Card(
        group="Surroundings",
        law=(
            "films of the shaft ends × 1 + a (n/3000 rpm)^m, or loss G (n/3000 rpm)^m (T - T_air) of the "
            "whole shaft"
        ),
        size="a ± 1; G ± 0.1 Q / usual rise; m 0.8 ± 0.2",
        acts_on="shaft, boundary links",
        source="Becker (1963), Int. J. Heat Mass Transfer 6, 1053",
        makes=Makes("colder", probe="SP04", at="shaft"),
    )

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """The films of the shaft ends, and the shaft as a whole; links to boundaries of a network."""
        found = []
        if machine.kind == "geometry":
            films = machine.films.get("shaft", ())
            if films:
                term = ShaftFilmTerm(self.term_name("shaft", "ends"), films)
                found.append(
                    self.candidate(
                        "shaft", term, amplitude="film_increase_at_3000rpm", reference=1.0, form="ends"
                    )
                )
        for key, place, fluid in self._ways(machine):
            speeds = machine.speeds(key)
            for speed in speeds:
                own = speed if len(speeds) > 1 else ""
                usual = 0.1 * machine.typical_heat / machine.typical_rise
                form = "whole shaft" if machine.kind == "geometry" else own
                term = ShaftLossTerm(self.term_name(key, form), place, speed, fluid, usual)
                found.append(
                    self.candidate(
                        machine.component(key),
                        term,
                        amplitude="conductance_at_3000rpm",
                        reference=usual,
                        form=form,
                    )
                )
        return tuple(found)

    @staticmethod
    def _ways(machine: MachineView) -> list[tuple[str, str, str | float]]:
        """Component, place and fluid of every way that heat may leave."""
        if machine.kind == "geometry":
            return [("shaft", machine.heat["shaft"][0], "ambient")] if "shaft" in machine.heat else []
        return [
            (key, machine.walls[coefficient], machine.fluids[coefficient])
            for key, coefficients in machine.films.items()
            for coefficient in coefficients
        ]

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the additional film or conductance at 3000 rpm."""
        size = next(iter(reported.values()))
        amount = (
            f"its film at 3000 rpm is {1.0 + size.value:.1f} times the modelled one"
            if not size.unit
            else f"a further {quantity(size)} at 3000 rpm"
        )
        return f"Turning, {place_words(candidate.component)} loses more heat to the air: {amount}."
