"""Thermally induced preload: a warmer inner ring loads the contacts, and friction grows with the load."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, capital, place_words
from spindle_fem.effects.framework.laws import Complex, amplitude, power, relaxed, repeated, shape, softplus
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Term, TermContext

NAME = "friction_increase_at_10K"
REFERENCE_DIFFERENCE = 10.0


class ThermalPreloadTerm(Term):
    """Friction of a set by the ring difference, ``1 + a (s(ΔT) / 10 K)^m``, smooth ramp ``s``, with a lag.

    The bearings of a set share one preload, hence one mean difference. The
    ramp is 0 where the outer rings are warmer and the set goes slack. The lag
    is that of spacers, housing and shaft, which follow the rings and give way.
    """

    n_states = 1

    def __init__(
        self, name: str, bearings: tuple[str, ...], inner: tuple[str, ...], outer: tuple[str, ...]
    ) -> None:
        self.name, self.bearings = name, bearings
        self.reads = (*inner, *outer)
        self.parameters = (
            amplitude(NAME, 0.25, high=20.0),
            shape("exponent", 1.45, 0.12, low=0.5, high=4.0),
            shape("lag", 600.0, 0.4, "s", low=1.0, high=20000.0),
            shape("width", 1.5, 0.4, "K", low=0.05, high=20.0),
        )

    def friction(self, context: TermContext) -> Complex:
        """Factor on every bearing, (n, k)."""
        own = context.parameters
        loaded = own["width"] * softplus(context.state[0] / own["width"]) / REFERENCE_DIFFERENCE
        return repeated(context, 1.0 + own[NAME] * power(loaded, own["exponent"]), len(self.bearings))

    def advance(self, context: TermContext, step: float) -> Complex:
        """The ring difference, lagged, (1, k) K."""
        half = len(self.reads) // 2
        difference = context.temperatures[:half].mean(axis=0) - context.temperatures[half:].mean(axis=0)
        return relaxed(context.state, difference[None], step, context.parameters["lag"])


class ThermalPreload(Effect):
    """Preload that follows the inner-outer temperature difference.

    Source: Hertz (1882), load with deflection^1.5; Bossmanns & Tu (1999), Int.
    J. Mach. Tools Manuf. 39, 1345-1366, thermally induced preload in spindles;
    friction with load^(2/3..4/3), SKF and Palmgren.
    """

    name = "thermal_preload"
    kind = "missing_physics"
    title = "friction rises as the inner rings become warmer than the outer ones (thermally induced preload)"
    check = (
        "Preload and fits of the set: measure the preload cold and warm (axial stiffness or drag torque), "
        "check spacer lengths, and whether the outer rings can still slide; compare cooling of housing "
        "and shaft."
    )
    card = Card(
        group="Bearings",
        law="friction × 1 + a (w s₊(x/w) / 10 K)^m; x: inner less outer rings of the set, lagged τ",
        size="a ± 0.25; m 1.45 ×/÷ e^0.12; τ 600 s ×/÷ e^0.4; w 1.5 K ×/÷ e^0.4",
        acts_on="each bearing set (its bearings share one preload)",
        source=(
            "Hertz, load with deflection^1.5; Bossmanns & Tu (1999), Int. J. Mach. Tools Manuf. 39, 1345"
        ),
        makes=Makes("warmer", probe="SP01", at="front_bearings"),
    )

    def in_definition(self, spec: MachineSpec) -> bool:
        """Where heat follows expansion."""
        return spec.heat.thermal_preload

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """One a bearing set."""
        found = []
        for group in machine.groups:
            bearings = tuple(b for b in machine.sets[group] if b in machine.inner and b in machine.outer)
            if not bearings or not machine.speeds(group):
                continue
            term = ThermalPreloadTerm(
                self.term_name(group),
                bearings,
                tuple(machine.inner[b] for b in bearings),
                tuple(machine.outer[b] for b in bearings),
            )
            found.append(
                self.candidate(
                    machine.component(group),
                    term,
                    amplitude=NAME,
                    reference=0.1,
                    form=machine.form(group),
                )
            )
        return tuple(found)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """How strongly friction follows."""
        return (
            f"{capital(place_words(candidate.component))}: the friction heat follows the inner-outer "
            "temperature difference (thermally induced preload); at 10 K it is "
            f"{100.0 * reported[NAME].value:.0f} % higher than modelled, growing with the power "
            f"{reported['exponent'].value:.1f} of the difference."
        )
