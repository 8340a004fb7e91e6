"""Heat at a place in intervals that no input explains."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.effects.base import Candidate, Intervals, Reported, capital, place_words, quantity
from spindle_fem.effects.laws import Complex, amplitude
from spindle_fem.effects.term import TermContext
from spindle_fem.effects.unrecorded import IntervalTerm, UnrecordedEffect, interval_words
from spindle_fem.effects.view import MachineView


class HeatSourceTerm(IntervalTerm):
    """Heat spread over places.

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
        return self.spread(context, context.parameters["heat"] * self.share(context))


class UnrecordedHeatSource(UnrecordedEffect):
    """The way out for heat that nothing else explains."""

    name = "unrecorded_heat_source"
    kind = "missing_physics"
    title = "something heats this place in intervals that no recorded input explains"
    check = (
        "What runs in these intervals: cutting, hydraulic clamping, chip heap, lamp, neighbouring drive; "
        "compare the intervals with the machine's programme and record the suspect."
    )
    interval_forms = ("heat",)

    def usual(self, machine: MachineView, form: str) -> float:
        """A fifth of all heat."""
        return 0.2 * machine.typical_heat

    def term(self, machine: MachineView, spot: str, intervals: Intervals, form: str) -> HeatSourceTerm:
        """Heat at a spot."""
        return HeatSourceTerm(
            self.term_name(spot),
            machine.spots[spot],
            self.usual(machine, form),
            tuple(intervals),
            machine.sides.get(spot, ()),
        )

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """How much, and how often."""
        return (
            f"{capital(quantity(reported['heat']))} of heat enters {place_words(candidate.component)} in "
            f"{interval_words(candidate)} that no recorded input explains."
        )
