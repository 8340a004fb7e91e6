"""Heat at a place in intervals that no input explains."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.effects.base import Candidate, Intervals, Reported, capital, place_words, quantity
from spindle_fem.effects.unrecorded import IntervalHeatTerm, UnrecordedEffect, interval_words
from spindle_fem.effects.view import MachineView


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

    def term(self, machine: MachineView, spot: str, intervals: Intervals, form: str) -> IntervalHeatTerm:
        """Heat at a spot."""
        return IntervalHeatTerm(
            self.term_name(spot), self.spread(machine, spot), self.usual(machine, form), tuple(intervals)
        )

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """How much, and how often."""
        return (
            f"{capital(quantity(reported['heat']))} of heat enters {place_words(candidate.component)} in "
            f"{interval_words(candidate)} that no recorded input explains."
        )
