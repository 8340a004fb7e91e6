"""Extra loss at a place in intervals that no input explains."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.effects.base import Candidate, Intervals, Reported, place_words, quantity
from spindle_fem.effects.laws import Complex, amplitude, fluid_temperature
from spindle_fem.effects.term import Term, TermContext
from spindle_fem.effects.unrecorded import IntervalTerm, UnrecordedEffect, interval_words
from spindle_fem.effects.view import MachineView


class CoolingTerm(IntervalTerm):
    """Conductance from places to the surroundings.

    Parameters
    ----------
    name : str
    places : tuple of str
    fluid : str or float
        Input of the surroundings, or their temperature [K].
    usual : float, [W/K]
    intervals : sequence of (float, float), [s]
    sides : tuple of str
    """

    def __init__(
        self,
        name: str,
        places: tuple[str, ...],
        fluid: str | float,
        usual: float,
        intervals: Intervals,
        sides: tuple[str, ...] = (),
    ) -> None:
        super().__init__(name, amplitude("conductance", usual, "W/K"), places, sides, intervals)
        self.reads = self.heat_places
        self._fluid, self._places = fluid, len(places)

    def heat(self, context: TermContext) -> Complex:
        """Of every place, (n, k) W."""
        size = context.parameters["conductance"] * self.share(context)
        fluid = fluid_temperature(context, self._fluid)
        if len(self.heat_places) == self._places:
            return -size / self._places * (context.temperatures - fluid)
        own, (mean, up, across) = context.parameters, context.temperatures
        here = mean + 2.0 * (own["up"] * up + own["across"] * across)
        return self.spread(context, -size * (here - fluid))


class LossTerm(IntervalTerm):
    """Heat taken from places whatever their temperature.

    Parameters
    ----------
    name : str
    places : tuple of str
    usual : float, [W]
    intervals : sequence of (float, float), [s]
    sides : tuple of str
    """

    def __init__(
        self,
        name: str,
        places: tuple[str, ...],
        usual: float,
        intervals: Intervals,
        sides: tuple[str, ...] = (),
    ) -> None:
        super().__init__(name, amplitude("heat", usual, "W"), places, sides, intervals)

    def heat(self, context: TermContext) -> Complex:
        """Of every place, (n, k) W."""
        return self.spread(context, -context.parameters["heat"] * self.share(context))


class UnrecordedCooling(UnrecordedEffect):
    """The way out for a loss that nothing else explains."""

    name = "unrecorded_cooling"
    kind = "missing_physics"
    title = "something cools this place in intervals that no recorded input explains"
    check = (
        "What runs in these intervals: cutting fluid, air blast, an open door or guard, a second coolant "
        "circuit; compare the intervals with the machine's programme and record the suspect."
    )
    interval_forms = ("conductance", "heat")

    def usual(self, machine: MachineView, form: str) -> float:
        """A fifth of all heat, or what carries it at the usual rise."""
        heat = 0.2 * machine.typical_heat
        return heat if form == "heat" else heat / machine.typical_rise

    def term(self, machine: MachineView, spot: str, intervals: Intervals, form: str) -> Term:
        """Loss at a spot."""
        places, sides = machine.spots[spot], machine.sides.get(spot, ())
        usual, own = self.usual(machine, form), tuple(intervals)
        if form == "heat":
            return LossTerm(self.term_name(spot, form), places, usual, own, sides)
        fluid = "ambient" if "ambient" in machine.inputs else machine.reference_temperature
        return CoolingTerm(self.term_name(spot), places, fluid, usual, own, sides)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """How much, and how often."""
        size = reported.get("conductance") or reported["heat"]
        way = " to the surroundings" if size.unit == "W/K" else ""
        return (
            f"A further {quantity(size)}{way} is lost from {place_words(candidate.component)} in "
            f"{interval_words(candidate)} that no recorded input explains."
        )
