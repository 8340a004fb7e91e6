"""Coolant of a network that warms from link to link."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, capital, place_words
from spindle_fem.effects.framework.laws import Complex, amplitude, fluid_temperature, rows
from spindle_fem.effects.framework.machine_view import MachineView, fluid_place
from spindle_fem.effects.framework.term import Term, TermContext

NAME = "warming_per_watt"


class CoolantHeatingTerm(Term):
    """The coolant at a link is warmer by what the links before it gave off, over its capacity rate.

    Parameters
    ----------
    links : tuple of str
        Coefficients in the order in which the coolant passes.
    conductance : tuple of float, [W/K]
        Nominal, of each link.
    """

    def __init__(
        self,
        name: str,
        links: tuple[str, ...],
        walls: tuple[str, ...],
        fluid: str | float,
        conductance: tuple[float, ...],
    ) -> None:
        self.name, self.reads = name, walls[:-1]
        self.heat_places = tuple(fluid_place(link) for link in links[1:])
        self._fluid, self._conductance = fluid, conductance
        usual = 0.3 / sum(conductance)
        self.parameters = (amplitude(NAME, usual, "K/W", high=1.0 / max(conductance)),)

    def heat(self, context: TermContext) -> Complex:
        """Shift of the coolant at every link but the first, (n, k) K."""
        size = context.parameters[NAME]
        inlet = fluid_temperature(context, self._fluid)
        shift, found = 0.0 * size, []
        for wall, conductance in zip(context.temperatures, self._conductance, strict=False):
            shift = shift + size * conductance * (wall - inlet - shift)
            found.append(shift)
        return rows(context, *found)


class CoolantHeating(Effect):
    """Enthalpy balance of the coolant; a machine with a channel always has it."""

    name = "coolant_heating"
    kind = "missing_physics"
    title = "the coolant warms on its way, so that what it passes last is cooled less"
    check = "Coolant flow and its rise from inlet to outlet: heat taken up over flow times heat capacity."
    card = Card(
        group="Coolant",
        law="a link's coolant is warmer by what earlier links gave off, over the capacity rate",
        size="± 0.3 K/W over the sum of conductances",
        acts_on="networks only: a channel always has it",
        source="enthalpy balance",
    )

    def in_definition(self, spec: MachineSpec) -> bool:
        """Every channel with a flow warms its coolant."""
        return spec.channel is not None

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Coolants of a network that pass several nodes, in both directions."""
        found = []
        for boundary, links in machine.coolant_links.items():
            for form, order in (("", links), ("reverse", links[::-1])) if len(links) > 1 else ():
                conductance = tuple(machine.conductance[link] for link in order)
                term = CoolantHeatingTerm(
                    self.term_name(boundary, form),
                    order,
                    tuple(machine.walls[link] for link in order),
                    machine.fluids[links[0]],
                    conductance,
                )
                found.append(
                    self.candidate(
                        machine.component(boundary),
                        term,
                        amplitude=NAME,
                        reference=term.parameters[0].sigma,
                        form=form,
                    )
                )
        return tuple(found)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """The capacity rate."""
        rate = 1.0 / max(reported[NAME].value, 1e-12)
        return (
            f"{capital(place_words(candidate.component))}: the coolant warms as it passes; its capacity "
            f"rate is {rate:.3g} W/K."
        )
