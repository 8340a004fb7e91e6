"""Outside films that follow the temperature: what natural convection and radiation have in common."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from spindle_fem.effects.framework.effect import Candidate, Effect
from spindle_fem.effects.framework.laws import Complex, columns, fluid_temperature, linear
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Term, TermContext, TermParameter

# Usual basis of the constant film: a wall this much warmer than room air, K.
REFERENCE_DIFFERENCE = 10.0
REFERENCE_TEMPERATURE = 293.15


class OutsideFilmTerm(Term):
    """Films times ``(1 + a g) / (1 + a c)``.

    g is the law's growth, 1 at the reference difference; c is how much of it
    the nominal film already carries: all (1, the film is right at the
    reference difference), more (right at a larger one) or nothing (0, the
    law comes on top).

    Parameters
    ----------
    walls : tuple of str
        Place that drives each film.
    fluids : tuple of (str or float)
    parameters : tuple of TermParameter
        The amplitude first.
    """

    def __init__(
        self,
        name: str,
        films: tuple[str, ...],
        walls: tuple[str, ...],
        fluids: tuple[str | float, ...],
        parameters: tuple[TermParameter, ...],
    ) -> None:
        self.name, self.coefficients, self.reads, self._fluids = name, films, walls, fluids
        self.parameters = parameters

    @abstractmethod
    def growth(self, wall: Complex, fluid: Complex, context: TermContext) -> Complex:
        """The law relative to the reference difference, (k,)."""

    def factor(self, context: TermContext) -> Complex:
        """Factor on every film, (n, k)."""
        size = context.parameters[self.parameters[0].name]
        carried = context.parameters["carried_share"]
        found = np.ones((len(self.coefficients), columns(context)), dtype=complex)
        for i, fluid in enumerate(self._fluids):
            growth = self.growth(context.temperatures[i], fluid_temperature(context, fluid), context)
            found[i] = (1.0 + size * growth) / (1.0 + size * carried)
        return found


class OutsideFilmEffect(Effect):
    """One candidate for the stationary outside, and for every boundary link of a network.

    Attributes
    ----------
    term_kind : type of OutsideFilmTerm
    """

    kind = "missing_physics"
    term_kind: type[OutsideFilmTerm]

    @abstractmethod
    def free_parameters(self) -> tuple[TermParameter, ...]:
        """The amplitude, at whose size responses are screened, and the shape."""

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """The standing outside; boundary links of a network."""
        if machine.kind == "network":
            places = {key: films for key, films in machine.films.items() if films}
        else:
            places = {"housing": machine.films["housing"]} if machine.films.get("housing") else {}
        carried, starts = linear("carried_share", 0.5, 0.4, low=0.0, high=1.0), ({},)
        if machine.kind == "network":
            # A conductance between bodies is right at the differences that they had when it was found out,
            # some kelvins to some tens of kelvins: which side of them a recording is on decides the sign.
            carried = linear("carried_share", 1.0, 0.5, low=0.0, high=3.0)
            starts = tuple({"carried_share": share} for share in (1.0, 1.6))
        found = []
        for key, films in places.items():
            parameters = (*self.free_parameters(), carried)
            walls, fluids = (
                tuple(known[film] for film in films) for known in (machine.walls, machine.fluids)
            )
            term = self.term_kind(self.term_name(key), films, walls, fluids, parameters)
            found.append(
                self.candidate(
                    machine.component(key),
                    term,
                    amplitude=parameters[0].name,
                    reference=parameters[0].sigma,
                    starts=starts,
                )
            )
        return tuple(found)
