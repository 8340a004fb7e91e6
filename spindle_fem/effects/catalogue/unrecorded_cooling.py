"""Extra loss at a place that no effect explains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Reported, capital, place_words, quantity
from spindle_fem.effects.framework.laws import Complex, amplitude, fluid_temperature
from spindle_fem.effects.framework.machine_view import MachineView, RecordedQuantity
from spindle_fem.effects.framework.spread import Spread
from spindle_fem.effects.framework.term import TermContext, TermParameter
from spindle_fem.effects.framework.unrecorded import (
    LESS,
    ScaledTerm,
    Share,
    UnrecordedEffect,
    UnrecordedHeatTerm,
    UnrecordedTerm,
    when_words,
)

# How likely a loss from within greased bearings is, beside places that air or a fluid reaches. (Judgement.)
CLOSED = 0.1


class CoolingTerm(UnrecordedTerm):
    """Conductance from places to the surroundings.

    Parameters
    ----------
    fluid : str or float
        Input of the surroundings, or their temperature [K].
    """

    def __init__(self, name: str, size: TermParameter, spread: Spread, on: Share, fluid: str | float) -> None:
        super().__init__(name, size, spread, on)
        self.reads = self.heat_places
        self._fluid = fluid

    def heat(self, context: TermContext) -> Complex:
        """Heat of every place, negative where it is taken away, (n, k) W."""
        size = context.parameters["conductance"] * self.on.share(context)
        fluid = fluid_temperature(context, self._fluid)
        if self.spread.sides:
            return self.spread.heat(context, -size * (self.spread.temperature(context) - fluid))
        # Each place by its own temperature.
        return -size * self.spread.shares(context) * (context.temperatures - fluid)


class LinkTerm(ScaledTerm):
    """A link that conducts better or worse: ``1 ± G / G_0`` times as well."""

    def __init__(self, coefficient: str, *more: Any) -> None:
        super().__init__(*more)
        self.coefficients = (coefficient,)

    def factor(self, context: TermContext) -> Complex:
        """Factor on the link, (1, k)."""
        return self.factor_of(context)


class UnrecordedCooling(UnrecordedEffect):
    """The way out for a loss that nothing else explains."""

    name = "unrecorded_cooling"
    kind = "missing_physics"
    # It can take almost any course over time, hence less probable a priori than a law.
    prior_weight = 0.5
    title = "something cools this place that no recorded input explains"
    check = (
        "What runs in these intervals: cutting fluid, air blast, an open door or guard, a second coolant "
        "circuit; compare the intervals with the machine's programme and record the suspect."
    )
    card = Card(
        group="Way out",
        law=(
            "conductance to the surroundings (or heat taken away) in intervals, or following a recorded "
            "quantity"
        ),
        size="conductance 0.2 Q over the usual rise, heat ± 0.2 Q; the rest as above",
        acts_on="every place heat may come from",
        makes=Makes("colder", probe="SP04", at="housing"),
    )
    check_law = "What blows or flows at this place with the {}; vary it alone and watch this place."
    interval_forms = ("conductance", "heat")
    takes_heat_away = True

    def usual(self, machine: MachineView, form: str) -> float:
        """A fifth of all heat, or what carries it at the usual rise."""
        heat = 0.2 * machine.typical_heat
        return heat if form == "heat" else heat / machine.typical_rise

    def followed(self, machine: MachineView) -> Sequence[RecordedQuantity]:
        """Quantities recorded beside the inputs; inputs that cool have laws of their own."""
        return tuple(item for item in machine.quantities if item.beside and not item.changes)

    def places(self, machine: MachineView) -> tuple[str, ...]:
        """Links of a network to its surroundings, and spots that have none."""
        if machine.kind != "network":
            return super().places(machine)
        joined = {machine.walls[film] for films in machine.films.values() for film in films}
        return (*(spot for spot in super().places(machine) if spot not in joined), *machine.films)

    def level_places(self, machine: MachineView) -> tuple[str, ...]:
        """Links between nodes as well: what holds them may have come loose."""
        return (*self.places(machine), *(machine.joint_coefficients if machine.kind == "network" else ()))

    def acts_on(self, machine: MachineView, spot: str) -> tuple[str, ...]:
        """Places of a spot; the wall end of a link."""
        link = self.link(machine, spot)
        return (machine.walls[link],) if link else super().acts_on(machine, spot)

    def link(self, machine: MachineView, spot: str) -> str:
        """Coefficient of a network's link."""
        if machine.kind != "network" or spot in machine.spots:
            return ""
        return next(iter(machine.films.get(spot) or machine.joint_coefficients.get(spot, ())), "")

    def term(
        self, machine: MachineView, name: str, spread: Spread, on: Share, form: str, scaled: str = ""
    ) -> UnrecordedTerm:
        """Loss over a spot."""
        usual = self.usual(machine, form)
        if form == "heat":
            return UnrecordedHeatTerm(name, amplitude("heat", usual, "W"), spread, on, sign=-1.0)
        if scaled:
            nominal = machine.conductance[scaled]
            size = amplitude("conductance", max(usual, nominal), "W/K")
            return LinkTerm(scaled, name, size, on, nominal, form == LESS)
        fluid = "ambient" if "ambient" in machine.inputs else machine.reference_temperature
        return CoolingTerm(name, amplitude("conductance", usual, "W/K"), spread, on, fluid)

    def likelihood_at(self, machine: MachineView, spot: str) -> float:
        """What is lost hardly leaves a greased bearing itself."""
        bearings = set(machine.sets.get(spot, ()))
        closed = machine.kind != "network" and bearings and not bearings & set(machine.oiled)
        return CLOSED if closed else 1.0

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State size and intervals of the cooling."""
        size = reported.get("conductance") or reported["heat"]
        term = candidate.terms[0]
        if term.coefficients:
            amount = f"{quantity(size)} less" if term.less else f"a further {quantity(size)}"
            return (
                f"{capital(place_words(candidate.component))} conducts {amount}"
                f"{when_words(candidate, reported)}."
            )
        way = " to the surroundings" if size.unit == "W/K" else ""
        return (
            f"A further {quantity(size)}{way} is lost from "
            f"{place_words(candidate.component)}{when_words(candidate, reported)}."
        )
