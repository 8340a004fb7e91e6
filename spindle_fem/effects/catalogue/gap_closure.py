"""A clearance seat that closes, and conducts better, as the outer ring expands into it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spindle_fem.effects.catalogue.joint_conductance import JointConductance
from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, capital, place_words, quantity
from spindle_fem.effects.framework.laws import Complex, amplitude, linear, relaxed, rows, shape, smooth_step
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Term, TermContext

OVER_HOUSING, OVER_START = "ring over housing", "ring over start"
# Differences at which fits begin to close, K, and what they are wide beside that: a ring is a few kelvin over
# the housing, but tens over its own start, or a wall over the air.
CLOSED_OVER_HOUSING, CLOSED_OVER_START = (2.0, 4.0, 8.0, 15.0), (4.0, 8.0, 15.0)
WIDTH_OVER_HOUSING = 0.5
# Lags at which fits begin there, s: a gap that closes at once and one that follows the ring's mean slowly are
# two answers of one fit, which ends at the one near which it begins.
LAGS_OVER_HOUSING = (600.0, 120.0)


class GapClosureTerm(Term):
    """Factor ``b (1 - a (1 - s))`` on seats; s follows ``S((x - x0)/w)`` with a lag, x is the ring's excess.

    Parameters
    ----------
    seats : tuple of str
        Coefficients.
    rings : tuple of str
        Places that expand.
    around : tuple of str
        Places that they expand into; none counts from the rings' own temperature at the start.
    closed_by : tuple of tuple of int, optional
        Positions of the rings whose mean closes each seat; all of them when absent.
    """

    def __init__(
        self,
        name: str,
        seats: tuple[str, ...],
        rings: tuple[str, ...],
        around: tuple[str, ...],
        closed_by: tuple[tuple[int, ...], ...] | None = None,
    ) -> None:
        self.name, self.coefficients = name, seats
        self.reads = (*rings, *around)
        self._rings = len(rings)
        # Rings whose expansion is followed: each, or the mean of all; and the rings that close each seat.
        self._followed = len(rings) if closed_by else 1
        self._closed_by = [list(own) for own in closed_by or ((0,),) * len(seats)]
        # How far each has closed; the temperatures that they count from, 0 until the first step knows them.
        self.n_states = self._followed * (1 if around else 2)
        self.parameters = (
            amplitude("opening", 1.0, high=0.995),
            linear("closing_difference", 8.0, 5.0, "K", low=-5.0, high=60.0),
            shape("width", 5.0, 0.5, "K", low=0.3, high=40.0),
            shape("lag", 600.0, 0.4, "s", low=5.0, high=10000.0),
            shape("closed", 1.0, 0.7, "", low=0.02, high=10.0),
        )

    def factor(self, context: TermContext) -> Complex:
        """Factor on the conductance of every seat, (n, k)."""
        closed = np.array([context.state[rings].mean(axis=0) for rings in self._closed_by])
        own = context.parameters
        return rows(context, *(own["closed"] * (1.0 - own["opening"] * (1.0 - closed))))

    def advance(self, context: TermContext, step: float) -> Complex:
        """Closure of each seat, then reference excesses if counted from the start, (n or 2 n, k)."""
        own, number = context.parameters, self._followed
        rings = context.temperatures[: self._rings]
        rings = rings if number > 1 else rings.mean(axis=0, keepdims=True)
        if self.n_states == number:
            base = context.temperatures[self._rings :].mean(axis=0)
        else:
            known = context.state[number:]
            base = np.where(known.real == 0.0, rings, known)
        target = smooth_step((rings - base - own["closing_difference"]) / own["width"])
        closed = relaxed(context.state[:number], target, step, own["lag"])
        return closed if self.n_states == number else np.concatenate((closed, base))


class GapClosure(Effect):
    """A loose seat conducts through air and few contact spots; closed, through metal.

    Source: 5 µm of air conduct 0.026/5e-6 = 5000 W/(m²·K) at the most, and a
    loose ring touches on a small part; rings of 190 mm close 5 µm of
    clearance on the diameter with 2 to 3 K (12e-6 1/K). What has closed by expanding
    presses otherwise than the seat that was known before: it conducts b times as well.
    """

    name = "gap_closure"
    kind = "missing_physics"
    repeats = JointConductance.name
    title = "the loose outer-ring seats conduct better as the rings expand into the bores"
    check = (
        "Outer-ring fits and bore roundness: measure clearance cold; look for fretting rust; compare ring "
        "and housing temperatures during warm-up, where the difference must rise first and then fall."
    )
    card = Card(
        group="Contacts and capacity",
        law=(
            "conductance × b (1 - a (1 - s)), s follows S((x - x₀)/w) with a lag τ; x: each seat's outer ring"
            " over the housing (a spacer's: the mean of their s), or all of them over their start"
        ),
        size="a ± 1 (at most 0.995); x₀ 8 ± 5 K; w 5 K ×/÷ e^0.5; τ 600 s ×/÷ e^0.4; b 1 ×/÷ e^0.7",
        acts_on="outer seats of a set with their spacers, links between nodes",
        source="5 µm of air conduct 5000 W/(m²·K); 190 mm of steel close it with 2 to 3 K",
    )

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Outer seats of a set, one by one over the housing, together over the start; links of a network."""
        found = []
        for key, rings, around, seats in self._seats(machine):
            for form, reads in ((OVER_HOUSING, around), (OVER_START, ())):
                closed_by = self._closed_by(machine, key, seats) if reads else None
                term = GapClosureTerm(self.term_name(key, form), seats, rings, reads, closed_by)
                found.append(
                    self.candidate(
                        machine.component(key),
                        term,
                        amplitude="opening",
                        reference=0.8,
                        form=machine.form(key, form),
                        starts=self._starts(bool(reads) and machine.kind != "network"),
                    )
                )
        return tuple(found)

    @staticmethod
    def _starts(over_housing: bool) -> list[dict[str, float]]:
        if over_housing:
            return [
                {"closing_difference": k, "width": WIDTH_OVER_HOUSING * k, "lag": lag}
                for lag in LAGS_OVER_HOUSING
                for k in CLOSED_OVER_HOUSING
            ]
        return [{"closing_difference": k} for k in CLOSED_OVER_START]

    @staticmethod
    def _closed_by(machine: MachineView, key: str, seats: tuple[str, ...]) -> tuple[tuple[int, ...], ...]:
        """Positions of the rings that close each seat: its bearing's own; all of them for a spacer."""
        bearings = machine.sets.get(key, (key,))
        own = {
            seat: (position,)
            for position, bearing in enumerate(bearings)
            for seat in machine.joint_coefficients.get(bearing, ())
        }
        return tuple(own.get(seat, tuple(range(len(bearings)))) for seat in seats)

    @staticmethod
    def _seats(
        machine: MachineView,
    ) -> list[tuple[str, tuple[str, ...], tuple[str, ...], tuple[str, ...]]]:
        """Component, what expands, what holds it, and coefficients."""
        if machine.kind == "network":
            return [
                (link, (machine.walls[seats[0]],), (str(machine.fluids[seats[0]]),), seats)
                for link, seats in machine.joint_coefficients.items()
            ]
        return [
            (
                group,
                tuple(machine.outer[b] for b in machine.sets[group]),
                machine.heat["housing"][:1],
                machine.joint_coefficients[group],
            )
            for group in machine.groups
            if machine.joint_coefficients.get(group) and "housing" in machine.heat
        ]

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State how far the seats are open and at which difference they close."""
        over = "the housing" if OVER_HOUSING in candidate.form else "their temperature at the start"
        closed = reported["closed"].value
        cold = closed * (1.0 - reported["opening"].value)
        return (
            f"{capital(place_words(candidate.component))}: cold, the outer seats conduct {cold:.2f} of "
            f"nominal, closed {closed:.2f}; they close where the outer rings are "
            f"{quantity(reported['closing_difference'])} above {over}."
        )
