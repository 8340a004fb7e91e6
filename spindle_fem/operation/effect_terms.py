"""Evaluate the terms of effects at operating points and sensed temperatures, with exact derivatives.

The one evaluator of every model: mesh, reduced model and written network obtain from it the heat of each
place, the factor on each bearing's friction and the factor on each coefficient, at one instant or at
many. Heats of several terms in one place add up. Factors of several terms on one coefficient or one
bearing's friction multiply: two independent causes that each halve a conductance leave a quarter.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import FLOW, Term, TermContext
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]
Positions = slice | NDArray[np.int64]

COMPLEX_STEP = 1e-30


class Derivatives(Enum):
    """Derivatives to evaluate beside the values."""

    NONE = "none"
    STATE = "sensed temperatures and memories"
    ALL = "these and the requested parameters"


@dataclass(frozen=True, slots=True)
class Instants:
    """Instants at which terms are evaluated, and the inputs then.

    Attributes
    ----------
    times : (n,) ndarray, or float for one instant, [s]
    inputs : mapping of str to (n,) ndarray or float
        By the names that terms know, SI.
    """

    times: Array | float
    inputs: Mapping[str, Array | float]

    @property
    def number(self) -> int:
        """Number of instants."""
        return np.size(self.times)

    def at(self, rows: NDArray[np.int64]) -> Instants:
        """Some of many."""
        return Instants(self.times[rows], {name: values[rows] for name, values in self.inputs.items()})


@dataclass(frozen=True, slots=True)
class Quantities:
    """Quantities at many instants with their derivatives.

    Attributes
    ----------
    value : (n, q) ndarray
    by : (n, q, n_y + n_x + p) ndarray
        Derivatives by sensed temperatures, memories and requested parameters (by their logarithms if
        they are logarithmic), side by side; fewer columns if fewer were requested.
    """

    value: Array
    by: Array
    n_sensed: int
    n_states: int

    @property
    def by_sensed(self) -> Array:
        """Derivatives to the sensed temperatures, (n, q, n_y)."""
        return self.by[:, :, : self.n_sensed]

    @property
    def by_state(self) -> Array:
        """Derivatives to the memories, (n, q, n_x)."""
        return self.by[:, :, self.n_sensed : self.n_sensed + self.n_states]

    @property
    def by_parameter(self) -> Array:
        """Explicit derivatives by the requested parameters, (n, q, p)."""
        return self.by[:, :, self.n_sensed + self.n_states :]

    def copy(self) -> Quantities:
        """Copy with arrays of its own."""
        return Quantities(self.value.copy(), self.by.copy(), self.n_sensed, self.n_states)


@dataclass(frozen=True, slots=True)
class TermAnswers:
    """Sum of all terms.

    Attributes
    ----------
    heat : Quantities
        Heat into each of :attr:`EffectTerms.places`, W; K for fluids. A place may occur twice.
    friction : Quantities
        Factor on the friction heat of every one of :attr:`EffectTerms.bearings`.
    factor : Quantities
        Factor on every one of :attr:`EffectTerms.coefficients`.
    """

    heat: Quantities
    friction: Quantities
    factor: Quantities


@dataclass(frozen=True, slots=True)
class _Target:
    """Positions of one term's values among all quantities of a kind.

    Attributes
    ----------
    positions : slice or (k,) int ndarray
    fresh : bool
        Whether no earlier term has these quantities.
    """

    positions: Positions
    fresh: bool


@dataclass(frozen=True, slots=True)
class _Layout:
    """Complex columns in which one term is evaluated: the value, then one for each derivative.

    Attributes
    ----------
    reads, states : slice
        Its rows among the sensed temperatures and the memories.
    targets : tuple of int
        Asked parameter of each of the last columns.
    temperatures, state, parameters : complex perturbations, to which the values are added
    """

    reads: slice
    states: slice
    targets: tuple[int, ...]
    temperatures: NDArray[np.complex128]
    state: NDArray[np.complex128]
    parameters: Mapping[str, NDArray[np.complex128]]

    @classmethod
    def of(
        cls, term: Term, values: Mapping[str, float], reads: slice, states: slice, own: Mapping[str, int]
    ) -> _Layout:
        """Columns of a term; ``own`` maps its requested parameters to their positions among all."""
        n_reads, n_states = len(term.reads), term.n_states
        width = 1 + n_reads + n_states + len(own)
        temperatures = np.zeros((n_reads, width), dtype=complex)
        state = np.zeros((n_states, width), dtype=complex)
        temperatures[np.arange(n_reads), 1 + np.arange(n_reads)] = 1j * COMPLEX_STEP
        state[np.arange(n_states), 1 + n_reads + np.arange(n_states)] = 1j * COMPLEX_STEP
        parameters = {name: np.full(width, value, dtype=complex) for name, value in values.items()}
        logarithmic = {item.name: item.logarithmic for item in term.parameters}
        for column, name in enumerate(own, 1 + n_reads + n_states):
            parameters[name][column] += 1j * COMPLEX_STEP * (values[name] if logarithmic[name] else 1.0)
        return cls(reads, states, tuple(own.values()), temperatures, state, parameters)

    def width(self, derivatives: Derivatives) -> int:
        """Columns of one instant."""
        if derivatives is Derivatives.NONE:
            return 1
        return (
            1
            + len(self.temperatures)
            + len(self.state)
            + len(self.targets) * (derivatives is Derivatives.ALL)
        )

    def context(
        self, instants: Instants, sensed: Array, states: Array, derivatives: Derivatives
    ) -> TermContext:
        """Inputs of the term, the columns of each instant side by side."""
        width, number = self.width(derivatives), instants.number
        own = sensed[:, self.reads].T[:, :, None] + self.temperatures[:, None, :width]
        state = states[:, self.states].T[:, :, None] + self.state[:, None, :width]
        own, state = own.reshape(-1, number * width), state.reshape(-1, number * width)
        if np.ndim(instants.times) == 0:
            cut = self.parameters
            if width < self.width(Derivatives.ALL):
                cut = {name: values[:width] for name, values in cut.items()}
            return TermContext(instants.times, instants.inputs, own, state, cut)
        return TermContext(
            np.repeat(instants.times, width),
            {name: np.repeat(values, width) for name, values in instants.inputs.items()},
            own,
            state,
            {name: np.tile(values[:width], number) for name, values in self.parameters.items()},
        )


class EffectTerms:
    """Terms of effects with parameter values, ready to be evaluated.

    Parameters
    ----------
    parameters : mapping of str to float
        Values by outer name (``<term>.<parameter>``), nominal where absent.
    derivatives : sequence of str
        Asked parameters; those of no term have derivatives of zero.
    unread : int
        Sensed quantities beside those that terms read, behind them: derivatives to them are zero.

    Attributes
    ----------
    reads : tuple of str
        Place of each sensed temperature.
    places, sources : tuple of str
        Place of every heat and the name of the term that gives it.
    bearings, coefficients : tuple of str
        What the terms scale, each once.
    n_states : int
        Numbers that all terms remember.

    Raises
    ------
    SpecError
        Two terms of one name, or one that scales the same thing twice.
    """

    def __init__(
        self,
        terms: Sequence[Term],
        parameters: Mapping[str, float],
        derivatives: Sequence[str] = (),
        unread: int = 0,
    ) -> None:
        require_distinct(terms)
        self.terms, self.derivatives = tuple(terms), tuple(derivatives)
        self.values = [term.values(parameters) for term in terms]
        self.reads = tuple(name for term in terms for name in term.reads)
        self.n_sensed, self.n_states = len(self.reads) + unread, sum(term.n_states for term in terms)
        self.places = tuple(place for term in terms for place in term.heat_places)
        self.sources = tuple(term.name for term in terms for _ in term.heat_places)
        self.bearings, self._friction = _targets(terms, "bearings")
        self.coefficients, self._factor = _targets(terms, "coefficients")
        reads = itertools.accumulate((len(term.reads) for term in terms), initial=0)
        states = itertools.accumulate((term.n_states for term in terms), initial=0)
        heats = itertools.accumulate((len(term.heat_places) for term in terms), initial=0)
        self._heat = [slice(*ends) for ends in itertools.pairwise(heats)]
        rows = zip(itertools.pairwise(reads), itertools.pairwise(states), strict=True)
        self._layouts = []
        for term, values, (read, state) in zip(terms, self.values, rows, strict=True):
            names = term.names()
            own = {names[name].name: i for i, name in enumerate(self.derivatives) if name in names}
            self._layouts.append(_Layout.of(term, values, slice(*read), slice(*state), own))

    def depends(self, kind: str, name: str) -> list[slice]:
        """Derivatives of a quantity that are not always zero, as columns of :attr:`Quantities.by`.

        Parameters
        ----------
        kind : {"bearings", "coefficients"}
        name : str
            One of that kind.
        """
        found = []
        for term, layout in zip(self.terms, self._layouts, strict=True):
            if name in getattr(term, kind):
                first = self.n_sensed + layout.states.start
                found += [layout.reads, slice(first, first + len(layout.state))]
                first = self.n_sensed + self.n_states
                found += [slice(first + target, first + target + 1) for target in layout.targets]
        return [part for part in found if part.stop > part.start]

    def initial_states(self) -> Array:
        """Memories at time zero, (n_x,)."""
        parts = [term.initial_state(own) for term, own in zip(self.terms, self.values, strict=True)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def at(
        self, instants: Instants, sensed: Array, states: Array, derivatives: Derivatives = Derivatives.ALL
    ) -> TermAnswers:
        """Heat and factors of all terms together.

        Parameters
        ----------
        sensed : (n, n_y) ndarray, [K]
            Temperatures of :attr:`reads`.
        states : (n, n_x) ndarray
            Memories.
        """
        heat, friction, factor = (
            self._quantities(instants.number, len(names), fill, derivatives)
            for names, fill in ((self.places, 0.0), (self.bearings, 1.0), (self.coefficients, 1.0))
        )
        for number, term in enumerate(self.terms):
            layout = self._layouts[number]
            context = layout.context(instants, sensed, states, derivatives)
            if term.heat_places:
                self._put(heat, self._heat[number], layout, term.heat(context))
            if term.bearings:
                self._multiply(friction, self._friction[number], layout, term.friction(context))
            if term.coefficients:
                self._multiply(factor, self._factor[number], layout, term.factor(context))
        return TermAnswers(heat, friction, factor)

    def advance(
        self,
        instants: Instants,
        steps: Array | float,
        sensed: Array,
        states: Array,
        derivatives: Derivatives = Derivatives.ALL,
    ) -> Quantities:
        """Memories after steps from what holds at their starts.

        Parameters
        ----------
        instants : Instants
            Starts of the steps.
        steps : (n,) ndarray, or float for one instant, [s]
        sensed, states, derivatives
            As :meth:`at` takes them, at the starts.
        """
        found = self._quantities(instants.number, self.n_states, 0.0, derivatives)
        for term, layout in zip(self.terms, self._layouts, strict=True):
            if term.n_states:
                context = layout.context(instants, sensed, states, derivatives)
                each = steps if np.ndim(steps) == 0 else np.repeat(steps, layout.width(derivatives))
                self._put(found, layout.states, layout, term.advance(context, each))
        return found

    def _quantities(self, number: int, rows: int, fill: float, derivatives: Derivatives) -> Quantities:
        width = 0
        if derivatives is not Derivatives.NONE:
            width = self.n_sensed + self.n_states
        if derivatives is Derivatives.ALL:
            width += len(self.derivatives)
        value = np.full((number, rows), fill)
        return Quantities(value, np.zeros((number, rows, width)), self.n_sensed, self.n_states)

    def _put(self, found: Quantities, rows: slice, layout: _Layout, answers: NDArray) -> None:
        """Put a term's complex values (k, n · columns) into its own quantities, in place."""
        value, slopes = _split(answers, len(found.value))
        found.value[:, rows] = value
        self._spread(found, rows, layout, slopes)

    def _multiply(self, found: Quantities, target: _Target, layout: _Layout, answers: NDArray) -> None:
        """Multiply some quantities by a term's complex values, in place."""
        value, slopes = _split(answers, len(found.value))
        at = target.positions
        if target.fresh:
            found.value[:, at] = value
        else:
            before = found.value[:, at]
            slopes = before[:, :, None] * slopes
            found.by[:, at] *= value[:, :, None]
            found.value[:, at] = before * value
        self._spread(found, at, layout, slopes)

    def _spread(self, found: Quantities, at: Positions, layout: _Layout, slopes: Array) -> None:
        """Add derivatives (n, k, columns of the term) to the columns of all terms."""
        if not slopes.shape[2]:
            return
        n_reads, n_states = len(layout.temperatures), len(layout.state)
        if n_reads:
            found.by[:, at, layout.reads] += slopes[:, :, :n_reads]
        if n_states:
            first = self.n_sensed + layout.states.start
            found.by[:, at, first : first + n_states] += slopes[:, :, n_reads : n_reads + n_states]
        first = self.n_sensed + self.n_states
        for column, target in enumerate(
            layout.targets[: slopes.shape[2] - n_reads - n_states], n_reads + n_states
        ):
            found.by[:, at, first + target] += slopes[:, :, column]


def _split(answers: NDArray, number: int) -> tuple[Array, Array]:
    """Values (n, k) and derivatives (n, k, columns) of complex values (k, n · columns)."""
    found = np.asarray(answers, dtype=complex)
    found = found.reshape(len(found), number, -1).transpose(1, 0, 2)
    return found[:, :, 0].real, found[:, :, 1:].imag * (1.0 / COMPLEX_STEP)


def _targets(terms: Sequence[Term], kind: str) -> tuple[tuple[str, ...], list[_Target]]:
    """All names of a kind used by terms, each once, and the positions of each term's values."""
    known: dict[str, int] = {}
    found = []
    for term in terms:
        names = getattr(term, kind)
        if len(set(names)) != len(names):
            raise SpecError(f"term {term.name}", f"names one of its {kind} twice.", "Name each once.")
        fresh = not any(name in known for name in names)
        at = np.array([known.setdefault(name, len(known)) for name in names], dtype=np.int64)
        if at.size and np.array_equal(at, np.arange(at[0], at[0] + at.size)):
            found.append(_Target(slice(int(at[0]), int(at[0]) + at.size), fresh))
        else:
            found.append(_Target(at, fresh))
    return tuple(known), found


def require_distinct(terms: Sequence[Term]) -> None:
    """Refuse two terms of one name.

    Raises
    ------
    SpecError
    """
    if len({term.name for term in terms}) != len(terms):
        raise SpecError("terms", "two of them have the same name.", "Give each a name of its own.")


def require_known(
    terms: Iterable[Term],
    *,
    places: Collection[str],
    fluids: Collection[str],
    bearings: Collection[str],
    coefficients: Collection[str],
) -> None:
    """Refuse terms that read, heat or scale what a model does not have.

    Parameters
    ----------
    places : collection of str
        Whose temperatures can be read, and that can be heated.
    fluids : collection of str
        Whose temperatures can be shifted.
    bearings, coefficients : collection of str

    Raises
    ------
    SpecError
    """
    for term in terms:
        for names, verb, known in (
            ([name for name in term.reads if name not in term.combined], "reads", places),
            (term.heat_places, "puts heat into", (*places, *fluids)),
            (term.bearings, "scales the friction of", bearings),
            (term.coefficients, "scales", coefficients),
        ):
            for name in names:
                if name not in known:
                    raise SpecError(f"term {term.name}", f'{verb} "{name}".', did_you_mean(name, known))


def multiplied(parts: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Factors of all terms together, by what they scale."""
    found: dict[str, float] = {}
    for part in parts:
        for name, factor in part.items():
            found[name] = found.get(name, 1.0) * factor
    return found


def operating_factors(
    terms: Sequence[Term], values: Sequence[Mapping[str, float]], point: OperatingPoint
) -> list[dict[str, float]]:
    """Factors that each term puts on coefficients at an operating point.

    Laws of the coolant see the flow that other terms leave of the recorded one.

    Parameters
    ----------
    values : sequence of mapping of str to float
        Parameters of each term by inner name.
    """
    found = [term.operating_factor(point, own) for term, own in zip(terms, values, strict=True)]
    left = multiplied(found).get(FLOW, 1.0)
    if left == 1.0:
        return found
    throttled = replace(point, coolant_flow=left * point.coolant_flow)
    return [
        part if FLOW in part else term.operating_factor(throttled, own)
        for term, own, part in zip(terms, values, found, strict=True)
    ]
