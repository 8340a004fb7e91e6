"""Heat or loss that no effect explains: what the two effects of it have in common.

It is on in intervals of time, or follows a recorded quantity by a simple law.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate, IntervalEffect, Intervals, Reported
from spindle_fem.effects.framework.laws import Complex, linear, power, relaxed, shape, switched
from spindle_fem.effects.framework.machine_view import MachineView, RecordedQuantity
from spindle_fem.effects.framework.spread import Spread
from spindle_fem.effects.framework.term import Term, TermContext, TermParameter

# Width of the edges where the lag is short, s.
EDGE_WIDTH = 20.0
# 1 σ of an edge that a search found, s, and of the factors that one interval has beside the common size.
EDGE_SIGMA = 300.0
JITTER = 0.1
FOLLOWING = "following"
# Share of its beginning at which a pulse after a change counts as over.
PULSE_ENDS = 0.05
Array = NDArray[np.float64]
# A quantity is followed where it varies by more than this share of its largest value.
SMALLEST_VARIATION = 0.05


class Share(Protocol):
    """How far something is on over time.

    Attributes
    ----------
    follows : tuple of str
        Inputs.
    """

    parameters: tuple[TermParameter, ...]
    n_states: int
    follows: tuple[str, ...]

    def share(self, context: TermContext) -> Complex:
        """How far it is on, (k,)."""

    def mean_share(self, own: Mapping[str, float]) -> float:
        """Mean while it is on, from values by inner name."""

    def advance(self, context: TermContext, step: float | Array) -> Complex:
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

    def mean_share(self, own: Mapping[str, float]) -> float:
        """Mean of the share over the intervals, by their length."""
        numbers = range(1, self._number + 1)
        lengths = [own[f"end_{number}"] - own[f"start_{number}"] for number in numbers]
        return float(np.average([own.get(f"factor_{number}", 1.0) for number in numbers], weights=lengths))

    def advance(self, context: TermContext, step: float | Array) -> Complex:
        """Nothing is remembered."""
        return context.state


class Followed:
    """As large as a power of a recorded quantity, ``(q / q0)^m``, or as its changes, with a lag.

    Changes are those of the square: the energy that acceleration and braking
    turn over. A recording begins with what it was at rest.
    """

    n_states = 1

    def __init__(self, quantity: RecordedQuantity) -> None:
        self.follows, self._changes = (quantity.input,), quantity.changes
        self._levels = np.array(quantity.levels)
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

    def mean_share(self, own: Mapping[str, float]) -> float:
        """Mean of the share while it is on in the recording that the quantity is known of.

        Of changes: while a pulse is above ``PULSE_ENDS`` of what it begins with.
        """
        if self._levels.size == 0:
            # Nothing that it follows ever happens: no mean but the size itself.
            return 1.0
        if self._changes:
            of_pulse = (1.0 - PULSE_ENDS) / np.log(1.0 / PULSE_ENDS)
            return float(of_pulse * np.mean(self._levels) / own["reference"] ** 2)
        return float(np.mean((self._levels / own["reference"]) ** own["exponent"]))

    def advance(self, context: TermContext, step: float | Array) -> Complex:
        """Lagging quantity, (1, k)."""
        return relaxed(context.state, self._target(context), step, context.parameters["lag"])


class UnrecordedTerm(Term):
    """Something of a common size that is more or less on over time.

    Parameters
    ----------
    spread : Spread
        Where it acts.
    """

    def __init__(self, name: str, size: TermParameter, spread: Spread, on: Share) -> None:
        self.name, self.spread, self.on = name, spread, on
        self.heat_places = spread.names
        self.n_states, self.follows = on.n_states, on.follows
        self.parameters = (size, *spread.parameters, *on.parameters)

    def advance(self, context: TermContext, step: float | Array) -> Complex:
        """State after a step, (n_states, k)."""
        return self.on.advance(context, step)


class UnrecordedHeatTerm(UnrecordedTerm):
    """Heat that comes, or goes whatever the temperature; ``sign`` -1 where it goes."""

    def __init__(self, name: str, size: TermParameter, spread: Spread, on: Share, sign: float = 1.0) -> None:
        super().__init__(name, size, spread, on)
        self._sign = sign

    def heat(self, context: TermContext) -> Complex:
        """Heat of every place, (n, k) W."""
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
        """Laws of recorded quantities, each at every spot, in the first form.

        Not where a source of a network follows the same input already: that is a matter of its size.
        """
        driven = {(machine.inner[source], name) for source, name in machine.source_inputs.items()}
        return tuple(
            self._candidate(machine, spot, Followed(quantity), self.interval_forms[0], quantity)
            for spot in self.places(machine)
            for quantity in self.followed(machine)
            if quantity.changes or (spot, quantity.input) not in driven
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
        spread = Spread(machine.spots[spot], machine.sides.get(spot, ()), machine.focal.get(spot, ""))
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
        """Mean size while on, and the lag, with its power where it follows a law and how it lies about."""
        term = candidate.terms[0]
        own, size = term.values(values), term.parameters[0]
        mean = own[size.name] * term.on.mean_share(own)
        found = {size.name: Reported(mean, size.unit), "lag": Reported(own["lag"], "s")}
        for name in ("exponent", *(item.name for item in term.spread.parameters)):
            if name in own:
                found[name] = Reported(own[name], "")
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
        law = f"the {name.replace('_', ' ')}"
        if "exponent" in reported:
            law += f" with the power {reported['exponent'].value:.1f}"
        return f" on average while on, following {law} as no effect of the catalogue does"
    count = sum(item.name.startswith("start_") for item in candidate.parameters.values())
    return f" in {'one interval' if count == 1 else f'{count} intervals'} that no recorded input explains"
