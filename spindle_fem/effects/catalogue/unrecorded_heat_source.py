"""Heat at a place that no effect explains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Reported, capital, place_words, quantity
from spindle_fem.effects.framework.laws import amplitude
from spindle_fem.effects.framework.machine_view import MachineView, RecordedQuantity
from spindle_fem.effects.framework.spread import Spread
from spindle_fem.effects.framework.unrecorded import (
    LESS,
    Share,
    SourceTerm,
    UnrecordedEffect,
    UnrecordedHeatTerm,
    UnrecordedTerm,
    when_words,
)


class UnrecordedHeatSource(UnrecordedEffect):
    """The way out for heat that nothing else explains."""

    name = "unrecorded_heat_source"
    kind = "missing_physics"
    # It can take almost any course over time, hence less probable a priori than a law.
    prior_weight = 0.5
    title = "something heats this place that no recorded input explains"
    check = (
        "What runs in these intervals: cutting, hydraulic clamping, chip heap, lamp, neighbouring drive; "
        "compare the intervals with the machine's programme and record the suspect."
    )
    card = Card(
        group="Way out",
        law=(
            "heat u(t - b) - u(t - e) with first-order edges in intervals, or heat with a power m of a "
            "recorded quantity above an onset q₁"
        ),
        size=(
            "heat ± 0.2 Q; τ 200 s ×/÷ e^0.7, behind a quantity e^1.2; edges ± 300 s; m 1 ± 0.3; q₁ 0 + 0.3 "
            "of the largest q"
        ),
        acts_on="every place heat may come from",
        states={"heat": "W"},
        makes=Makes("warmer", probe="SP04", at="housing"),
    )
    check_law = (
        "What rubs, brakes or is driven at this place with the {}; vary it alone and watch this place."
    )
    interval_forms = ("heat",)

    def usual(self, machine: MachineView, form: str) -> float:
        """A fifth of all heat."""
        return 0.2 * machine.typical_heat

    def followed(self, machine: MachineView) -> Sequence[RecordedQuantity]:
        """All recorded quantities, speeds only by their changes: laws cover heat that grows with speed."""
        return machine.quantities

    def level_places(self, machine: MachineView) -> tuple[str, ...]:
        """Every spot, and the sources of a network that follow an input."""
        return (*self.places(machine), *machine.source_heat)

    def acts_on(self, machine: MachineView, spot: str) -> tuple[str, ...]:
        """Places of a spot; the node heated by a source."""
        return (machine.inner[spot],) if self.source(machine, spot) else super().acts_on(machine, spot)

    def source(self, machine: MachineView, spot: str) -> str:
        """The source that a spot is."""
        return spot if spot in machine.source_heat and spot not in machine.spots else ""

    def term(
        self, machine: MachineView, name: str, spread: Spread, on: Share, form: str, scaled: str = ""
    ) -> UnrecordedTerm:
        """Heat over a spot, or of a source."""
        usual = self.usual(machine, form)
        if scaled:
            nominal = machine.source_heat[scaled]
            size = amplitude("heat", max(usual, nominal), "W")
            return SourceTerm(scaled, name, size, on, nominal, form == LESS)
        return UnrecordedHeatTerm(name, amplitude("heat", usual, "W"), spread, on)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State size and intervals of the heat."""
        source = next(iter(candidate.terms[0].bearings), "")
        if source:
            more = reported["heat"].value / candidate.constants["nominal"]
            times = 1.0 - more if candidate.terms[0].less else 1.0 + more
            return (
                f"{source.replace('_', ' ')} heats {times:.2f} times as much while on"
                f"{when_words(candidate, reported)}."
            )
        return (
            f"{capital(quantity(reported['heat']))} of heat enters "
            f"{place_words(candidate.component)}{when_words(candidate, reported)}."
        )
