"""Heat or loss in intervals that no input explains: what the two effects have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from spindle_fem.effects.base import Candidate, IntervalEffect, Intervals, Reported
from spindle_fem.effects.laws import Complex, amplitude, linear, shape, switched
from spindle_fem.effects.spread import Spread
from spindle_fem.effects.term import Term, TermContext, TermParameter
from spindle_fem.effects.view import MachineView

# Of the edges where the lag is short, s.
EDGE_WIDTH = 20.0
# 1 σ of an edge that a search found, s, and of the factors that one interval has beside the common size.
EDGE_SIGMA = 300.0
JITTER = 0.1


class IntervalTerm(Term):
    """Something that is on in intervals, with a warm-up lag and a common size.

    Parameters
    ----------
    name : str
    size : TermParameter
    spread : Spread
        Where it acts.
    intervals : sequence of (float, float), [s]
    """

    def __init__(self, name: str, size: TermParameter, spread: Spread, intervals: Intervals) -> None:
        self.name, self._number, self.spread = name, len(intervals), spread
        self.heat_places = spread.names
        # Edges stay nearer to their own interval than to what is beside it.
        edges: list[TermParameter] = []
        for number, (start, end) in enumerate(intervals, 1):
            room = 0.45 * (end - start)
            before = intervals[number - 2][1] if number > 1 else start - 4.0 * EDGE_SIGMA
            after = intervals[number][0] if number < len(intervals) else end + 4.0 * EDGE_SIGMA
            sigma = min(EDGE_SIGMA, max(room, EDGE_WIDTH))
            edges.append(
                linear(f"start_{number}", start, sigma, "s", low=0.5 * (before + start), high=start + room)
            )
            edges.append(linear(f"end_{number}", end, sigma, "s", low=end - room, high=0.5 * (end + after)))
        factors = (
            tuple(shape(f"factor_{number}", 1.0, JITTER, low=0.1) for number in range(1, len(intervals) + 1))
            if len(intervals) > 1
            else ()
        )
        self.parameters = (
            size,
            shape("lag", 200.0, 0.7, "s", low=2.0, high=7200.0),
            *spread.parameters,
            *edges,
            *factors,
        )

    def share(self, context: TermContext) -> Complex:
        """How far it is on, (k,)."""
        own = context.parameters
        found: Complex | float = 0.0
        for number in range(1, self._number + 1):
            on = switched(context.time, own[f"start_{number}"], own[f"end_{number}"], own["lag"], EDGE_WIDTH)
            found = found + (own[f"factor_{number}"] * on if self._number > 1 else on)
        return found


class IntervalHeatTerm(IntervalTerm):
    """Heat that comes, or goes whatever the temperature.

    Parameters
    ----------
    name : str
    spread : Spread
    usual : float, [W]
    intervals : sequence of (float, float), [s]
    sign : float
        -1 for heat that goes.
    """

    def __init__(
        self, name: str, spread: Spread, usual: float, intervals: Intervals, sign: float = 1.0
    ) -> None:
        super().__init__(name, amplitude("heat", usual, "W"), spread, intervals)
        self._sign = sign

    def heat(self, context: TermContext) -> Complex:
        """Of every place, (n, k) W."""
        return self.spread.heat(context, self._sign * context.parameters["heat"] * self.share(context))


class UnrecordedEffect(IntervalEffect):
    """Places, intervals and reports of both.

    Spots reach round the machine, what heats or cools them need not: a sensor
    near it sees up to twice the mean, one opposite half of it.
    """

    law_sigma = MappingProxyType({"heat": 0.45, "conductance": 0.45})

    def places(self, machine: MachineView) -> tuple[str, ...]:
        """Every spot of the view."""
        return tuple(machine.spots)

    @staticmethod
    def spread(machine: MachineView, spot: str) -> Spread:
        """Over a spot."""
        return Spread(machine.spots[spot], machine.sides.get(spot, ()))

    @abstractmethod
    def term(self, machine: MachineView, spot: str, intervals: Intervals, form: str) -> Term:
        """Term at a spot."""

    @abstractmethod
    def usual(self, machine: MachineView, form: str) -> float:
        """Usual size of the amplitude."""

    def over(
        self, machine: MachineView, component: str, intervals: Intervals, form: str | None = None
    ) -> Candidate:
        """Candidate at a spot that begins from intervals; their ends are free."""
        chosen = self.interval_forms[0] if form is None else form
        term = self.term(machine, component, intervals, chosen)
        other = chosen if chosen != self.interval_forms[0] else ""
        return self.candidate(
            machine.component(component),
            term,
            amplitude=term.parameters[0].name,
            reference=self.usual(machine, chosen),
            form=machine.form(component, other),
        )

    def intervals(self, candidate: Candidate, values: Mapping[str, float]) -> list[tuple[float, float]]:
        """Fitted intervals, [s]."""
        term = candidate.terms[0]
        own = term.values(values)
        count = sum(name.startswith("start_") for name in own)
        return [(own[f"start_{number}"], own[f"end_{number}"]) for number in range(1, count + 1)]

    def report(self, candidate: Candidate, values: Mapping[str, float]) -> dict[str, Reported]:
        """Size while on, the mean over the intervals by their length, and the lag."""
        term = candidate.terms[0]
        own, size = term.values(values), term.parameters[0]
        lengths = [end - start for start, end in self.intervals(candidate, values)]
        factors = [own.get(f"factor_{number}", 1.0) for number in range(1, len(lengths) + 1)]
        mean = float(np.average(factors, weights=lengths))
        return {size.name: Reported(own[size.name] * mean, size.unit), "lag": Reported(own["lag"], "s")}


def interval_words(candidate: Candidate) -> str:
    """How many intervals a candidate has."""
    count = sum(item.name.startswith("start_") for item in candidate.parameters.values())
    return "one interval" if count == 1 else f"{count} intervals"
