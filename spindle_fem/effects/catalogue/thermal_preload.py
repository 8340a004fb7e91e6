"""Thermally induced preload: a warmer inner ring loads the contacts, and friction grows with the load."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, capital, place_words
from spindle_fem.effects.framework.laws import (
    Complex,
    amplitude,
    linear,
    power,
    relaxed,
    repeated,
    shape,
    softplus,
)
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.preload_response import PreloadResponse
from spindle_fem.effects.framework.term import Term, TermContext

NAME = "friction_increase_at_10K"
REFERENCE_DIFFERENCE = 10.0
MECHANICS = "bearing mechanics"
# Standard deviation of the share of friction that follows the load; about half of it does
# in greased bearings (Palmgren's load-dependent moment beside the viscous one).
LOAD_SHARE_SIGMA = 0.5
# Largest share: friction that follows its load more than this does not come from rings.
MOST_LOAD_SHARE = 3.0
# Standard deviation of the logarithm of the exponent of friction over the ring difference, which depends
# on the state of the grease (load^(0.54..4/3)): of the power law, of what the mechanics has for one state.
EXPONENT_SIGMA, STATE_SIGMA = 0.12, 0.3
# Standard deviation of the logarithm of the housing's growth over what elasticity says of its temperatures:
# expansion of cast iron is known to a twentieth, and a channel's lands and a frame hold it otherwise.
HOUSING_SIGMA = 0.15
# Standard deviation and largest value of the unevenness within a set: spacers ground to fit share the load
# otherwise. Half the exponent of the mechanics evens out what up to 2 restores; twice the deviation is left.
UNEVENNESS_SIGMA = 0.5
MOST_UNEVENNESS = 2.0 + 2.0 * UNEVENNESS_SIGMA
# In standard deviations of the clearance, from what is ordered: its ends and root mean square. A fit looser
# than ordered is likelier than a tighter one, as rings are made smaller than their size and bores larger.
CLEARANCES, CLEARANCE_WIDTH = (-2.0, 4.0), 1.6
# Standard deviation of the power of the speed by which the share of friction that follows the load falls
# otherwise than by mechanics: between contacts that rub and Palmgren's viscous moment lie 2/3.
SPEED_SIGMA = 0.3
# Of the reference speed; below it that power says nothing more.
SLOWEST = 0.05
# In standard deviations of the clearance from what is ordered, where searches begin: rings that meet the
# housing early, late, and hardly ever explain friction each in a way of its own.
BEGIN_AT = (0.0, 1.5, 3.0)


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
            shape("exponent", 1.45, EXPONENT_SIGMA, low=0.5, high=4.0),
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


class PreloadMechanicsTerm(Term):
    """Friction of every bearing of a set from bearing mechanics, ``1 + a ((m - 1) / m₁₀)^e``.

    ``m`` is friction over that without temperature differences at the same speed and thrust: by the mean ring
    difference of the set, and by the gap that outer rings, warmer than the housing, close. The differences
    between the bearings scale with the unevenness: 1 as the mechanics predicts, 0 all equal. ``m₁₀`` is the
    mean increase at 10 K as assembled, so that ``a / m₁₀`` is the share of the friction that follows the
    load at the reference speed; with the speed it falls as the mechanics has it and by a power beside. A set
    that goes slack loses that share as a power of its friction, which stays above 0. The lag is that of what
    lies between the places read and the raceways.
    """

    n_states = 2

    def __init__(
        self, name: str, inner: tuple[str, ...], outer: tuple[str, ...], response: PreloadResponse
    ) -> None:
        self.name, self.bearings, self.response = name, response.bearings, response
        self.ends = np.cumsum([len(inner), len(outer), len(response.shaft)])
        self.reads = (*inner, *outer, *response.shaft, *response.housing)
        self.increase = response.increase(REFERENCE_DIFFERENCE)
        nominal, sigma = response.clearance, response.clearance_sigma
        low, high = (nominal + side * sigma for side in CLEARANCES)
        self.parameters = (
            amplitude(NAME, LOAD_SHARE_SIGMA * self.increase, high=MOST_LOAD_SHARE * self.increase),
            linear("outer_clearance", nominal, CLEARANCE_WIDTH * sigma, "m", low=low, high=high),
            linear("unevenness", 1.0, UNEVENNESS_SIGMA, low=0.0, high=MOST_UNEVENNESS),
            shape("exponent_factor", 1.0, STATE_SIGMA, low=0.5, high=2.0),
            shape("housing_share", 1.0, HOUSING_SIGMA, low=0.2, high=3.0),
            linear("speed_exponent", 0.0, SPEED_SIGMA, low=-1.0, high=1.0),
            shape("lag", 60.0, 1.0, "s", low=1.0, high=20000.0),
        )

    def friction(self, context: TermContext) -> Complex:
        """Factor on every bearing, (n, k)."""
        own = context.parameters
        each = self.response.log_ratio(
            context.state[0],
            context.state[1],
            own["outer_clearance"],
            np.abs(context.inputs["speed"]),
            context.inputs["thrust"],
        )
        middle = each.mean(axis=0)
        ratio = np.exp(middle + own["unevenness"] * (each - middle))
        loaded = power((ratio - 1.0) / self.increase, own["exponent_factor"])
        turning = np.maximum(np.abs(context.inputs["speed"]) / self.response.reference_speed, SLOWEST)
        increase = own[NAME] * np.exp(-own["speed_exponent"] * np.log(turning))
        return np.where(ratio.real > 1.0, 1.0 + increase * loaded, ratio ** (increase / self.increase))

    def advance(self, context: TermContext, step: float) -> Complex:
        """Ring difference, inner rings as the shaft spreads them, and closing of the fit, lagged, (2, k)."""
        inner, outer, shaft, housing = np.split(context.temperatures, self.ends)
        outer = outer.mean(axis=0)
        spreading = self.response.spreading(inner.mean(axis=0), shaft)
        closing = self.response.closing(outer, housing, context.parameters["housing_share"])
        target = np.array([spreading - outer, closing])
        return relaxed(context.state, target, step, context.parameters["lag"])


class ThermalPreload(Effect):
    """Preload that follows the inner-outer temperature difference.

    If a definition has fits and preload, the mechanics of its bearings gives the form and the size
    for each bearing. Otherwise, and for bearings mounted differently from the definition, friction follows
    a power of the difference, the same for the whole set.

    Source: Hertz (1882), load with deflection^1.5; Bossmanns & Tu (1999), Int.
    J. Mach. Tools Manuf. 39, 1345-1366, thermally induced preload in spindles;
    friction with load^0.54 (rolling) to load^(4/3) (sliding), SKF; load^(2/3..1), Palmgren.
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
        law=(
            "friction × 1 + a ((m - 1)/m₁₀)^e, m(x, gap of the outer rings, speed, thrust) by bearing "
            "mechanics, x: inner rings, as the shaft spreads them, less outer rings of the set, lagged τ; "
            "or, as without fits, × 1 + a (w s₊(x/w) / 10 K)^m"
        ),
        size=(
            "a ± m₁₀/2, clearance ± 0.5 IT6, unevenness 1 ± 0.5, e 1 ×/÷ e^0.3, "
            "housing's share 1 ×/÷ e^0.15, power of the speed 0 ± 0.3, τ 60 s ×/÷ e; "
            "without fits a ± 0.25; m 1.45 ×/÷ e^0.12; τ 600 s ×/÷ e^0.4; w 1.5 K ×/÷ e^0.4"
        ),
        acts_on="each bearing set (its bearings share one preload)",
        source=(
            "Hertz, load with deflection^1.5; Bossmanns & Tu (1999), Int. J. Mach. Tools Manuf. 39, 1345"
        ),
        makes=Makes("warmer", probe="SP01", at="front_bearings"),
    )

    # Tight and loose rings each explain friction in a way of their own.
    starts_are_answers = True
    # µm; 2 K between an outer ring of 190 mm and its seat, neither of which is read, close as much.
    law_shift = MappingProxyType({"outer_clearance": 5.0})

    def in_definition(self, spec: MachineSpec) -> bool:
        """Machines whose heat follows thermal expansion."""
        return spec.follows_preload

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """For each bearing set, the power law and, where there are fits, the mechanics."""
        found = []
        for group in machine.groups:
            bearings = tuple(b for b in machine.sets[group] if b in machine.inner and b in machine.outer)
            if not bearings or not machine.speeds(group):
                continue
            inner, outer = (tuple(side[b] for b in bearings) for side in (machine.inner, machine.outer))
            terms: dict[str, Term] = {"": ThermalPreloadTerm(self.term_name(group), bearings, inner, outer)}
            response = machine.preload(group)
            starts: dict[str, list[dict[str, float]]] = {}
            if response is not None:
                name = self.term_name(group, MECHANICS)
                terms[MECHANICS] = PreloadMechanicsTerm(name, inner, outer, response)
                sigma = response.clearance_sigma
                wider = [response.clearance + side * sigma for side in BEGIN_AT]
                starts[MECHANICS] = [{"outer_clearance": clearance} for clearance in wider]
            found += [
                self.candidate(
                    machine.component(group),
                    term,
                    amplitude=NAME,
                    reference=0.1,
                    form=machine.form(group, form),
                    starts=starts.get(form, ({},)),
                    constants={}
                    if response is None
                    else {"exponent": response.exponent(REFERENCE_DIFFERENCE)},
                )
                for form, term in terms.items()
            ]
        return tuple(found)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State how strongly friction follows."""
        by_mechanics = "exponent" not in reported
        exponent = (
            candidate.constants["exponent"] * reported["exponent_factor"].value
            if by_mechanics
            else reported["exponent"].value
        )
        return (
            f"{capital(place_words(candidate.component))}: the friction heat follows the inner-outer "
            "temperature difference (thermally induced preload); at 10 K it is "
            f"{100.0 * reported[NAME].value:.0f} % higher than modelled, growing with the power "
            f"{exponent:.1f} of the difference"
            + (" there, as the mechanics of bearings and fits has it." if by_mechanics else ".")
        )
