"""Heat or loss that no effect explains: what the two effects of it have in common.

It is on in intervals of time, or follows a recorded quantity by a simple law.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate, Reported, quantity, stated
from spindle_fem.effects.framework.interval_effect import IntervalEffect, Intervals
from spindle_fem.effects.framework.laws import Complex, linear, power, relaxed, rows, shape, switched
from spindle_fem.effects.framework.machine_view import MachineView, RecordedQuantity
from spindle_fem.effects.framework.spread import Spread
from spindle_fem.effects.framework.term import Term, TermContext, TermParameter

# Width of the edges where the lag is short: at most, s, and as a share of the shortest interval or pause.
EDGE_WIDTH, EDGE_SHARE = 20.0, 0.1
# 1 σ of an edge that a search found, s, at least, and of the factors that one interval has beside the common
# size: of intervals of one size, and of steps that each have their own.
EDGE_SIGMA = 300.0
JITTER, STEP_SIGMA = 0.1, 0.7
# Form of what is less in intervals than at other times, a link or a source, and how much of it at most.
LESS, MOST_LOST = "less", 0.95
# Courses over time that intervals may describe.
PULSES, STEPS, STATES = "pulses", "steps", "states"
# Intervals that are nearer than this touch, s.
TOUCHING = 1e-6
# Widths or lags after which an edge is over.
FAR = 40.0
FOLLOWING, ONSET = "following", "onset"
# 1 σ of the logarithm of the lag behind a followed quantity: a lip warms in seconds, a gearbox in an hour.
LAG_SIGMA = 1.2
# Onset of a followed law at most, as a share of the largest value that was recorded, and that from which a
# search begins too; one less than the least share is none in words.
HIGHEST_ONSET, BEGUN_ONSET, LEAST_ONSET = 0.95, 0.5, 0.05
# Share of its beginning at which a pulse after a change counts as over.
PULSE_ENDS = 0.05
Array = NDArray[np.float64]
# A quantity is followed where it varies by more than this share of its largest value.
SMALLEST_VARIATION = 0.05


class Share(Protocol):
    """Time course between off (0) and on (1).

    Attributes
    ----------
    follows : tuple of str
        Inputs.
    """

    parameters: tuple[TermParameter, ...]
    n_states: int
    follows: tuple[str, ...]

    def share(self, context: TermContext) -> Complex:
        """Share that is on, (k,)."""

    def mean_share(self, own: Mapping[str, float]) -> float:
        """Mean while it is on, from values by inner name."""

    def advance(self, context: TermContext, step: float | Array) -> Complex:
        """State after a step, (n_states, k)."""


def _lag(sigma: float = 0.7) -> TermParameter:
    return shape("lag", 200.0, sigma, "s", low=2.0, high=7200.0)


class InIntervals:
    """On in intervals, with a warm-up lag.

    An interval that begins where the one before it ends shares that edge with it.

    Parameters
    ----------
    intervals : sequence of (float, float), [s]
    course : str
        ``PULSES``: few intervals of about one size, edges free; ``STEPS``: as well, each of a size of its
        own; ``STATES``: any number at one size or a few, edges and shares of the sizes as they are.
    sizes : sequence of float
        Usual size of every interval beside the common one; 1 where empty.
    blurred, apart : float, [s]
        Least width of the edges, of a model with long steps; distance of the instants they were sought at.
    """

    n_states = 0
    follows = ()

    def __init__(
        self,
        intervals: Intervals,
        course: str = PULSES,
        sizes: Sequence[float] = (),
        blurred: float = 0.0,
        apart: float = 0.0,
    ) -> None:
        self._number = len(intervals)
        self._shared = {
            number
            for number in range(1, self._number)
            if intervals[number][0] <= intervals[number - 1][1] + TOUCHING
        }
        lengths = np.diff([value for _, value in self._named(intervals)])
        shortest = np.min(lengths, where=lengths > TOUCHING, initial=np.inf)
        self._width = max(blurred, min(EDGE_WIDTH, EDGE_SHARE * float(shortest)))
        if course == STATES:
            edges = [linear(name, value, 0.0, "s") for name, value in self._named(intervals)]
            levels = [shape(f"factor_{n}", size, 0.0) for n, size in enumerate(sizes, 1)]
            self.parameters = (shape("lag", self._width, 0.0, "s"), *edges, *levels)
            return
        jitter = STEP_SIGMA if course == STEPS else JITTER
        usual = sizes or (1.0,) * self._number
        factors = [shape(f"factor_{n}", size, jitter, low=0.01) for n, size in enumerate(usual, 1)]
        if self._number == 1:
            factors = []
        elif course == STEPS:
            # As many free numbers as levels: the first level is the common size itself.
            factors[0] = replace(factors[0], sigma=0.0)
        # A level that changes is another state of the machine, at once: its lag is that of the masses.
        lag = shape("lag", self._width, 0.0, "s") if course == STEPS else _lag()
        self.parameters = (lag, *self._free_edges(intervals, max(EDGE_SIGMA, 0.5 * apart)), *factors)

    def _named(self, intervals: Intervals) -> list[tuple[str, float]]:
        """Edges by name, each once."""
        found = []
        for number, (start, end) in enumerate(intervals, 1):
            found.append((f"start_{number}", start))
            if number not in self._shared:
                found.append((f"end_{number}", end))
        return found

    def _free_edges(self, intervals: Intervals, widest: float) -> list[TermParameter]:
        """Edges that stay nearer to their own interval than to what is beside it, 1 σ up to ``widest``."""
        names, values = zip(*self._named(intervals), strict=True)
        beside = [values[0] - 4.0 * widest, *values, values[-1] + 4.0 * widest]
        found = []
        for name, before, value, after in zip(names, beside, values, beside[2:], strict=False):
            sigma = min(widest, max(0.45 * min(value - before, after - value), self._width))
            low, high = value - 0.45 * (value - before), value + 0.45 * (after - value)
            found.append(linear(name, value, sigma, "s", low=low, high=high))
        return found

    def edges(self, own: Mapping[str, Any]) -> list[tuple[Any, Any]]:
        """Start and end of every interval, from values by inner name."""
        return [
            (own[f"start_{n}"], own[f"start_{n + 1}"] if n in self._shared else own[f"end_{n}"])
            for n in range(1, self._number + 1)
        ]

    def share(self, context: TermContext) -> Complex:
        """Share that is on, (k,)."""
        own, time = context.parameters, np.asarray(context.time, dtype=float)
        lag = own["lag"]
        width = max(time.size, np.size(lag))
        time = np.broadcast_to(time, (width,))
        found = np.zeros(width, dtype=complex)
        reach = FAR * max(self._width, float(np.max(np.real(lag))))
        for number, (start, end) in enumerate(self.edges(own), 1):
            # Far from an interval nothing is left of it.
            first, last = np.min(np.real(start)) - FAR * self._width, np.max(np.real(end)) + reach
            rows = np.flatnonzero((time > first) & (time < last))
            if rows.size == 0:
                continue
            begin, stop, slow, factor = (
                np.broadcast_to(value, (width,))[rows]
                for value in (start, end, lag, own.get(f"factor_{number}", 1.0))
            )
            found[rows] += factor * switched(time[rows], begin, stop, slow, self._width)
        return found

    def factors(self, own: Mapping[str, float]) -> list[float]:
        """Size of every interval beside the common one."""
        return [own.get(f"factor_{number}", 1.0) for number in range(1, self._number + 1)]

    def mean_share(self, own: Mapping[str, float]) -> float:
        """Mean of the share over the intervals, by their length."""
        return float(np.average(self.factors(own), weights=[end - start for start, end in self.edges(own)]))

    def advance(self, context: TermContext, step: float | Array) -> Complex:
        """State unchanged: there is no memory."""
        return context.state


class Followed:
    """In proportion to a power of a recorded quantity above an onset, or to its changes, with a lag.

    ``((q - q1) / (q0 - q1))^m``, nothing below ``q1``: a seal that touches, a seat that opens. Changes are
    those of the square: the energy that acceleration and braking convert. A recording starts with the
    quantity at its value at rest.
    """

    n_states = 1

    def __init__(self, quantity: RecordedQuantity) -> None:
        self.follows, self._changes = (quantity.input,), quantity.changes
        self._levels = np.array(quantity.levels)
        # Fixed: a definition keeps what its law refers to.
        highest = quantity.highest
        reference = TermParameter("reference", highest, 0.0, quantity.unit)
        law = (
            linear("exponent", 1.0, 0.3, low=0.2, high=4.0),
            linear(ONSET, 0.0, 0.3 * highest, quantity.unit, low=0.0, high=HIGHEST_ONSET * highest),
        )
        self.parameters = (_lag(LAG_SIGMA), *(() if quantity.changes else law), reference)

    def _target(self, context: TermContext) -> Complex:
        quantity, own = np.abs(context.inputs[self.follows[0]]), context.parameters
        if self._changes:
            return (quantity / own["reference"]) ** 2
        return power((quantity - own[ONSET]) / (own["reference"] - own[ONSET]), own["exponent"])

    def share(self, context: TermContext) -> Complex:
        """Share that is on, (k,)."""
        if not self._changes:
            return context.state[0]
        apart = self._target(context) - context.state[0]
        return np.where(apart.real < 0.0, -apart, apart)

    def mean_share(self, own: Mapping[str, float]) -> float:
        """Mean of the share while the quantity is on in the recording that it is known of.

        Of changes: while a pulse is above ``PULSE_ENDS`` of what it begins with.
        """
        if self._levels.size == 0:
            # Nothing that it follows ever happens: no mean but the size itself.
            return 1.0
        if self._changes:
            of_pulse = (1.0 - PULSE_ENDS) / np.log(1.0 / PULSE_ENDS)
            return float(of_pulse * np.mean(self._levels) / own["reference"] ** 2)
        above = np.maximum(self._levels - own[ONSET], 0.0) / (own["reference"] - own[ONSET])
        return float(np.mean(above ** own["exponent"]))

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
    """Heat added, or removed if ``sign`` is -1, independent of temperature."""

    def __init__(self, name: str, size: TermParameter, spread: Spread, on: Share, sign: float = 1.0) -> None:
        super().__init__(name, size, spread, on)
        self._sign = sign

    def heat(self, context: TermContext) -> Complex:
        """Heat of every place, (n, k) W."""
        return self.spread.heat(context, self._sign * context.parameters["heat"] * self.on.share(context))


class ScaledTerm(UnrecordedTerm):
    """A link or a source of a network that is larger, or smaller, by a size.

    Parameters
    ----------
    nominal : float, [W or W/K]
        What the definition gives it, of a source its mean heat while it is on; the size counts in units of
        what a fit makes of that.
    less : bool
        Whether it is smaller.
    """

    def __init__(self, name: str, size: TermParameter, on: Share, nominal: float, less: bool) -> None:
        limit = MOST_LOST * nominal if less else np.inf
        super().__init__(name, replace(size, high=limit), Spread(()), on)
        self.nominal, self.less = nominal, less

    def factor_of(self, context: TermContext) -> Complex:
        """Factor on it, (1, k)."""
        size = context.parameters[self.parameters[0].name] * self.on.share(context) / self.nominal
        return rows(context, 1.0 - size if self.less else 1.0 + size)


class SourceTerm(ScaledTerm):
    """A source of a network that heats more or less: ``1 ± Q / Q_0`` times as much."""

    def __init__(self, source: str, *more: Any) -> None:
        super().__init__(*more)
        self.bearings = (source,)

    def friction(self, context: TermContext) -> Complex:
        """Factor on the source's heat, (1, k)."""
        return self.factor_of(context)


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
    def term(
        self, machine: MachineView, name: str, spread: Spread, on: Share, form: str, scaled: str = ""
    ) -> UnrecordedTerm:
        """Term in one of :attr:`interval_forms`, on places, or by scaling a link or a source."""

    @abstractmethod
    def usual(self, machine: MachineView, form: str) -> float:
        """Usual size of the amplitude."""

    @abstractmethod
    def followed(self, machine: MachineView) -> Sequence[RecordedQuantity]:
        """Recorded quantities that it may follow."""

    def forms_at(self, machine: MachineView, spot: str) -> tuple[str, ...]:
        """Links and sources of a network may also be less than at other times."""
        scaled = self.link(machine, spot) or self.source(machine, spot)
        return (*self.interval_forms, LESS) if scaled else self.interval_forms

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
        self,
        machine: MachineView,
        component: str,
        intervals: Intervals,
        form: str | None = None,
        course: str = PULSES,
        sizes: Sequence[float] = (),
        blurred: float = 0.0,
        apart: float = 0.0,
    ) -> Candidate:
        """Candidate at a spot that begins from intervals, as :class:`InIntervals` has it."""
        on = InIntervals(tuple(intervals), course, sizes, blurred, apart)
        return self._candidate(machine, component, on, form or self.interval_forms[0], None)

    def likelihood_at(self, machine: MachineView, spot: str) -> float:
        """How likely it is at a spot before the data, beside the others."""
        return 1.0

    def _candidate(
        self, machine: MachineView, spot: str, on: Share, form: str, quantity: RecordedQuantity | None
    ) -> Candidate:
        own = "" if form == self.interval_forms[0] else form
        if quantity is not None:
            own = f"{own} {FOLLOWING} {quantity.name}".strip()
        spread = Spread(self.acts_on(machine, spot), machine.sides.get(spot, ()), machine.focal.get(spot, ""))
        link, source = self.link(machine, spot), self.source(machine, spot)
        term = self.term(machine, self.term_name(spot, own), spread, on, form, link or source)
        starts: tuple[dict[str, float], ...] = ({},)
        if quantity is not None and not quantity.changes:
            starts = ({}, {ONSET: BEGUN_ONSET * quantity.highest})
        nominal = machine.conductance[link] if link else machine.source_heat.get(source)
        found = self.candidate(
            machine.component(spot),
            term,
            amplitude=term.parameters[0].name,
            reference=self.usual(machine, form),
            form=machine.form(spot, own),
            starts=starts,
            constants={"nominal": nominal} if nominal else None,
            likelihood=self.likelihood_at(machine, spot),
        )
        parameter = f"gain.{source}" if source else ""
        parameter = next(
            (seat.parameter for seat in machine.seats if seat.coefficients == (link,)), parameter
        )
        sized = bool(term.coefficients or term.bearings) and parameter in machine.parameters
        return replace(found, sized_by=parameter) if sized else found

    def check_of(self, candidate: Candidate) -> str:
        """What to check: whatever runs in its intervals, or with the quantity it follows."""
        name = followed_name(candidate)
        return self.check_law.format(name.replace("_", " ")) if name else self.check

    def intervals(self, candidate: Candidate, values: Mapping[str, float]) -> list[tuple[float, float]]:
        """Fitted intervals, [s]; none where it follows a law."""
        term = candidate.terms[0]
        return term.on.edges(term.values(values)) if isinstance(term.on, InIntervals) else []

    def sizes(self, candidate: Candidate, values: Mapping[str, float]) -> list[float]:
        """Size in every interval, in the unit of the amplitude."""
        term = candidate.terms[0]
        own = term.values(values)
        return [own[term.parameters[0].name] * factor for factor in term.on.factors(own)]

    def report(self, candidate: Candidate, values: Mapping[str, float]) -> dict[str, Reported]:
        """Mean size while on, and the lag, with its power where it follows a law and how it lies about."""
        term = candidate.terms[0]
        own, size = term.values(values), term.parameters[0]
        mean = own[size.name] * term.on.mean_share(own)
        found = {size.name: Reported(mean, size.unit), "lag": Reported(own["lag"], "s")}
        for name in ("exponent", *(item.name for item in term.spread.parameters)):
            if name in own:
                found[name] = Reported(own[name], "")
        return found | {
            item.name: stated(item, own[item.name]) for item in term.parameters if item.name == ONSET
        }


def followed_name(candidate: Candidate) -> str:
    """Recorded quantity that a candidate follows by a law; empty where it follows none.

    >>> from types import SimpleNamespace
    >>> followed_name(SimpleNamespace(form="housing.front following change of speed"))
    'change of speed'
    """
    _, found, name = f" {candidate.form}".partition(f" {FOLLOWING} ")
    return name if found else ""


def quantity_followed(machine: MachineView, candidate: Candidate) -> RecordedQuantity | None:
    """The recorded quantity that a candidate follows; None if it follows none."""
    name = followed_name(candidate)
    return next((item for item in machine.quantities if item.name == name), None)


def when_words(candidate: Candidate, reported: Mapping[str, Reported]) -> str:
    """When it is on, to the end of a sentence that begins with its place."""
    name = followed_name(candidate)
    if name:
        law = f"the {name.replace('_', ' ')}"
        if "exponent" in reported:
            law += f" with the power {reported['exponent'].value:.1f}"
        onset = reported.get(ONSET)
        reference = next((p for p in candidate.parameters.values() if p.name == "reference"), None)
        if onset is not None and onset.value > LEAST_ONSET * stated(reference, reference.value).value:
            law += f" above {quantity(onset)}"
        return f" on average while on, following {law} as no effect of the catalogue does"
    count = sum(item.name.startswith("start_") for item in candidate.parameters.values())
    when = "one interval" if count == 1 else f"{count} intervals"
    return f" in {when}{_level_words(candidate, reported)} that no recorded input explains"


def _level_words(candidate: Candidate, reported: Mapping[str, Reported]) -> str:
    """Sizes of what is on at a few levels; empty where it has one size, or each interval its own."""
    term = candidate.terms[0]
    own = {item.name: item for item in term.on.parameters}
    factors = [item for name, item in own.items() if name.startswith("factor_")]
    levels = sorted({item.value for item in factors})
    if len(levels) < 2 or any(item.sigma for item in factors):
        return ""
    mean = reported[term.parameters[0].name]
    usual = term.on.mean_share({name: item.value for name, item in own.items()})
    sizes = [quantity(replace(mean, value=mean.value * level / usual)) for level in levels]
    return f" at {len(levels)} levels ({', '.join(sizes)})"
