"""Extra loss at a place in intervals that no input explains."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.effects.base import Candidate, Intervals, Reported, place_words, quantity
from spindle_fem.effects.laws import Complex, amplitude, fluid_temperature
from spindle_fem.effects.spread import Spread
from spindle_fem.effects.term import Term, TermContext
from spindle_fem.effects.unrecorded import IntervalHeatTerm, IntervalTerm, UnrecordedEffect, interval_words
from spindle_fem.effects.view import MachineView


class CoolingTerm(IntervalTerm):
    """Conductance from places to the surroundings.

    Parameters
    ----------
    name : str
    spread : Spread
    fluid : str or float
        Input of the surroundings, or their temperature [K].
    usual : float, [W/K]
    intervals : sequence of (float, float), [s]
    """

    def __init__(
        self, name: str, spread: Spread, fluid: str | float, usual: float, intervals: Intervals
    ) -> None:
        super().__init__(name, amplitude("conductance", usual, "W/K"), spread, intervals)
        self.reads = self.heat_places
        self._fluid = fluid

    def heat(self, context: TermContext) -> Complex:
        """Of every place, (n, k) W."""
        size = context.parameters["conductance"] * self.share(context)
        fluid = fluid_temperature(context, self._fluid)
        if self.spread.sides:
            return self.spread.heat(context, -size * (self.spread.temperature(context) - fluid))
        # Each place by its own temperature.
        return -size / len(self.reads) * (context.temperatures - fluid)


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
        spread, usual, own = self.spread(machine, spot), self.usual(machine, form), tuple(intervals)
        if form == "heat":
            return IntervalHeatTerm(self.term_name(spot, form), spread, usual, own, sign=-1.0)
        fluid = "ambient" if "ambient" in machine.inputs else machine.reference_temperature
        return CoolingTerm(self.term_name(spot), spread, fluid, usual, own)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """How much, and how often."""
        size = reported.get("conductance") or reported["heat"]
        way = " to the surroundings" if size.unit == "W/K" else ""
        return (
            f"A further {quantity(size)}{way} is lost from {place_words(candidate.component)} in "
            f"{interval_words(candidate)} that no recorded input explains."
        )
