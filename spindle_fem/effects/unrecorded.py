"""Heat or loss that no effect explains: what the two effects of it have in common.

It is on in intervals of time, or follows a recorded quantity by a simple law.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Protocol

import numpy as np

from spindle_fem.effects.base import Candidate, IntervalEffect, Intervals, Reported
from spindle_fem.effects.laws import Complex, linear, power, relaxed, shape, switched
from spindle_fem.effects.spread import Spread
from spindle_fem.effects.term import Term, TermContext, TermParameter
from spindle_fem.effects.view import MachineView, RecordedQuantity

# Of the edges where the lag is short, s.
EDGE_WIDTH = 20.0
# 1 σ of an edge that a search found, s, and of the factors that one interval has beside the common size.
EDGE_SIGMA = 300.0
JITTER = 0.1
FOLLOWING = "following"
# A quantity is followed where it varies by more than this share of its largest value.
SMALLEST_VARIATION = 0.05


class Share(Protocol):
    """How far something is on over time.

    Attributes
    ----------
    parameters : tuple of TermParameter
    n_states : int
    follows : tuple of str
        Inputs.
    """

    parameters: tuple[TermParameter, ...]
    n_states: int
    follows: tuple[str, ...]

    def share(self, context: TermContext) -> Complex:
        """How far it is on, (k,)."""

    def advance(self, context: TermContext, step: float) -> Complex:
        """State after a step, (n_states, k)."""


def _lag() -> TermParameter:
    return shape("lag", 200.0, 0.7, "s", low=2.0, high=7200.0)


class InIntervals:
    """On in intervals, with a warm-up lag.

    Parameters
    ----------
    intervals : sequence of (float, float), [s]
    """

    n_states = 0
    follows = ()

    def __init__(self, intervals: Intervals) -> None:
        self._number = len(intervals)
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
        self.parameters = (_lag(), *edges, *factors)

    def share(self, context: TermContext) -> Complex:
        """How far it is on, (k,)."""
        own = context.parameters
        found: Complex | float = 0.0
        for number in range(1, self._number + 1):
            on = switched(context.time, own[f"start_{number}"], own[f"end_{number}"], own["lag"], EDGE_WIDTH)
            found = found + (own[f"factor_{number}"] * on if self._number > 1 else on)
        return found

    def advance(self, context: TermContext, step: float) -> Complex:
        """Nothing is remembered."""
        return context.state


class Followed:
    """As large as a power of a recorded quantity, ``(q / q0)^m``, or as its changes, with a lag.

    Changes are those of the square: the energy that acceleration and braking
    turn over. A recording begins with what it was at rest.

    Parameters
    ----------
    quantity : RecordedQuantity
    """

    n_states = 1

    def __init__(self, quantity: RecordedQuantity) -> None:
        self.follows, self._changes = (quantity.input,), quantity.changes
        # Fixed: a definition keeps what its law refers to.
        reference = TermParameter("reference", quantity.highest, 0.0, quantity.unit)
        exponent = () if quantity.changes else (linear("exponent", 1.0, 0.3, low=0.2, high=4.0),)
        self.parameters = (_lag(), *exponent, reference)

    def _target(self, context: TermContext) -> Complex:
        relative = np.abs(context.inputs[self.follows[0]]) / context.parameters["reference"]
        return relative**2 if self._changes else power(relative, context.parameters["exponent"])

    def share(self, context: TermContext) -> Complex:
        """How far it is on, (k,)."""
        if not self._changes:
            return context.state[0]
        apart = self._target(context) - context.state[0]
        return np.where(apart.real < 0.0, -apart, apart)

    def advance(self, context: TermContext, step: float) -> Complex:
        """Lagging quantity, (1, k)."""
        return relaxed(context.state, self._target(context), step, context.parameters["lag"])


class UnrecordedTerm(Term):
    """Something of a common size that is more or less on over time.

    Parameters
    ----------
    name : str
    size : TermParameter
    spread : Spread
        Where it acts.
    on : Share
    """

    def __init__(self, name: str, size: TermParameter, spread: Spread, on: Share) -> None:
        self.name, self.spread, self.on = name, spread, on
        self.heat_places = spread.names
        self.n_states, self.follows = on.n_states, on.follows
        self.parameters = (size, *spread.parameters, *on.parameters)

    def advance(self, context: TermContext, step: float) -> Complex:
        """State after a step, (n_states, k)."""
        return self.on.advance(context, step)


class UnrecordedHeatTerm(UnrecordedTerm):
    """Heat that comes, or goes whatever the temperature; ``sign`` -1 where it goes."""

    def __init__(self, name: str, size: TermParameter, spread: Spread, on: Share, sign: float = 1.0) -> None:
        super().__init__(name, size, spread, on)
        self._sign = sign

    def heat(self, context: TermContext) -> Complex:
        """Of every place, (n, k) W."""
        return self.spread.heat(context, self._sign * context.parameters["heat"] * self.on.share(context))


class UnrecordedEffect(IntervalEffect):
    """Places, intervals, laws and reports of both.

    Spots reach round the machine, what heats or cools them need not: a sensor
    near it sees up to twice the mean, one opposite half of it.

    Attributes
    ----------
    check_law : str
        What to look at where it follows a recorded quantity.
    """

    law_sigma = MappingProxyType({"heat": 0.45, "conductance": 0.45})
    check_law: str

    def places(self, machine: MachineView) -> tuple[str, ...]:
        """Every spot of the view."""
        return tuple(machine.spots)

    @abstractmethod
    def term(self, machine: MachineView, name: str, spread: Spread, on: Share, form: str) -> UnrecordedTerm:
        """Term in one of :attr:`interval_forms`."""

    @abstractmethod
    def usual(self, machine: MachineView, form: str) -> float:
        """Usual size of the amplitude."""

    @abstractmethod
    def followed(self, machine: MachineView) -> Sequence[RecordedQuantity]:
        """Recorded quantities that it may follow."""

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Laws of recorded quantities, each at every spot, in the first form."""
        quantities = self.followed(machine)
        return tuple(
            self._candidate(machine, spot, Followed(quantity), self.interval_forms[0], quantity)
            for spot in self.places(machine)
            for quantity in quantities
        )

    def can_show(self, machine: MachineView, candidate: Candidate) -> bool:
        """Whether the quantity that a law follows varies in the recording."""
        quantity = quantity_followed(machine, candidate)
        return quantity is None or quantity.varies > SMALLEST_VARIATION

    def over(
        self, machine: MachineView, component: str, intervals: Intervals, form: str | None = None
    ) -> Candidate:
        """Candidate at a spot that begins from intervals; their ends are free."""
        chosen = self.interval_forms[0] if form is None else form
        return self._candidate(machine, component, InIntervals(tuple(intervals)), chosen, None)

    def _candidate(
        self, machine: MachineView, spot: str, on: Share, form: str, quantity: RecordedQuantity | None
    ) -> Candidate:
        own = "" if form == self.interval_forms[0] else form
        if quantity is not None:
            own = f"{own} {FOLLOWING} {quantity.name}".strip()
        spread = Spread(machine.spots[spot], machine.sides.get(spot, ()))
        term = self.term(machine, self.term_name(spot, own), spread, on, form)
        return self.candidate(
            machine.component(spot),
            term,
            amplitude=term.parameters[0].name,
            reference=self.usual(machine, form),
            form=machine.form(spot, own),
        )

    def check_of(self, candidate: Candidate) -> str:
        """What runs in its intervals, or with what it follows."""
        name = followed_name(candidate)
        return self.check_law.format(name.replace("_", " ")) if name else self.check

    def intervals(self, candidate: Candidate, values: Mapping[str, float]) -> list[tuple[float, float]]:
        """Fitted intervals, [s]; none where it follows a law."""
        own = candidate.terms[0].values(values)
        count = sum(name.startswith("start_") for name in own)
        return [(own[f"start_{number}"], own[f"end_{number}"]) for number in range(1, count + 1)]

    def report(self, candidate: Candidate, values: Mapping[str, float]) -> dict[str, Reported]:
        """Size and lag; over intervals the mean by their length, with its power where it follows a law."""
        term = candidate.terms[0]
        own, size = term.values(values), term.parameters[0]
        lengths = [end - start for start, end in self.intervals(candidate, values)]
        mean = 1.0
        if lengths:
            factors = [own.get(f"factor_{number}", 1.0) for number in range(1, len(lengths) + 1)]
            mean = float(np.average(factors, weights=lengths))
        found = {size.name: Reported(own[size.name] * mean, size.unit), "lag": Reported(own["lag"], "s")}
        if "exponent" in own:
            found["exponent"] = Reported(own["exponent"], "")
        return found


def followed_name(candidate: Candidate) -> str:
    """Recorded quantity that a candidate follows by a law; empty where it follows none.

    >>> from types import SimpleNamespace
    >>> followed_name(SimpleNamespace(form="housing.front following change of speed"))
    'change of speed'
    """
    _, found, name = f" {candidate.form}".partition(f" {FOLLOWING} ")
    return name if found else ""


def quantity_followed(machine: MachineView, candidate: Candidate) -> RecordedQuantity | None:
    """The same with what is known of it; None where it follows none."""
    name = followed_name(candidate)
    return next((item for item in machine.quantities if item.name == name), None)


def when_words(candidate: Candidate, reported: Mapping[str, Reported]) -> str:
    """When it is on, to the end of a sentence that begins with its place."""
    name = followed_name(candidate)
    if name:
        power_of = f" with the power {reported['exponent'].value:.1f}" if "exponent" in reported else ""
        return f", following the {name.replace('_', ' ')}{power_of} as no effect of the catalogue does"
    count = sum(item.name.startswith("start_") for item in candidate.parameters.values())
    return f" in {'one interval' if count == 1 else f'{count} intervals'} that no recorded input explains"


def up_to(candidate: Candidate) -> str:
    """What stands before a size: it is the largest where a law is followed."""
    return "up to " if followed_name(candidate) else ""
