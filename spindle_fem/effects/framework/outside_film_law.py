"""Outside films that follow the temperature: what natural convection and radiation have in common."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from spindle_fem.effects.framework.laws import Complex, columns, fluid_temperature
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Term, TermContext, TermParameter

# What the constant film is usually taken for: a wall this much warmer than room air.
REFERENCE_DIFFERENCE = 10.0
REFERENCE_TEMPERATURE = 293.15


class OutsideFilmTerm(Term):
    """Films times ``(1 + a g) / (1 + a c)``.

    g is the law's growth, 1 at the reference difference; c is how much of it
    the nominal film already carries: all (1, the film is right at the
    reference difference) to nothing (0, the law comes on top).

    Parameters
    ----------
    name : str
    films : tuple of str
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


def outside_films(machine: MachineView) -> dict[str, tuple[str, ...]]:
    """Films by component: those of the standing outside; every boundary link of a network."""
    if machine.kind == "network":
        return {key: films for key, films in machine.films.items() if films}
    return {"housing": machine.films["housing"]} if machine.films.get("housing") else {}


def of_films(machine: MachineView, films: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """Films, their walls and fluids."""
    return films, tuple(machine.walls[f] for f in films), tuple(machine.fluids[f] for f in films)
