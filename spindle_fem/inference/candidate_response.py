"""First-order response of every channel to every candidate, about one common run.

A candidate's law is evaluated along the temperatures of that run, at all
instants at once; the heat that it would add is marched through the linear
model for hundreds of candidates together. Large effects act back on their own
cause: the short list is fitted with the full terms afterwards.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.term import COOLANT_INLET, FLUID_PREFIX, Term
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.reduced_transient import TransientRun
from spindle_fem.operation.effect_terms import Derivatives, EffectTerms, Instants
from spindle_fem.operation.term_memory import remembered

Array = NDArray[np.float64]

# Candidates whose responses are marched together, which bounds the memory of one march.
CHUNK = 256


@dataclass(frozen=True, slots=True)
class Variant:
    """A candidate with starting values of its shape.

    Attributes
    ----------
    shape : mapping of outer name to float
        Values of parameters other than the amplitude; of that one the size at which the candidate's answer is
        taken, where that is not its reference.
    """

    candidate: Candidate
    shape: Mapping[str, float]

    @property
    def key(self) -> tuple[str, str]:
        """Effect and place."""
        return self.candidate.effect, self.candidate.component

    @property
    def reference(self) -> float:
        """Amplitude at which its answer is taken: one unit of it."""
        return self.shape.get(self.candidate.amplitude, self.candidate.reference)

    @property
    def changes_the_machine(self) -> bool:
        """Whether its answer is that of the machine changed so far, not to first order."""
        steady = any(term.is_steady for term in self.candidate.terms)
        return steady and self.candidate.amplitude in self.shape

    def values(self, amplitude: float) -> dict[str, float]:
        """Every parameter with the amplitude given."""
        values = {name: item.value for name, item in self.candidate.parameters.items()}
        return values | dict(self.shape) | {self.candidate.amplitude: amplitude}


def variants_of(candidates: Sequence[Candidate]) -> list[Variant]:
    """Every candidate from each of its starting shapes."""
    return [Variant(candidate, start) for candidate in candidates for start in candidate.starts]


class BaseRun:
    """One recording simulated with the current estimates, about which candidates are judged.

    Parameters
    ----------
    number : int
        Recording.
    values : mapping of str to float
    candidates : sequence of Candidate
        Already in the model.
    places : (k, r) ndarray, optional
        Means over places that answer as further channels do.
    """

    def __init__(
        self,
        predictor: Predictor,
        number: int,
        values: Mapping[str, float],
        candidates: Sequence[Candidate] = (),
        places: Array | None = None,
    ) -> None:
        self.predictor, self.number, self.values, self.candidates = (
            predictor,
            number,
            dict(values),
            tuple(candidates),
        )
        self.run: TransientRun = predictor.transient(number, values, candidates)
        self.states, self.tracks = self.run.march(predictor.start(number, values))
        drive = self.run.drive
        self.drive = drive
        self.start_inputs = {name: drive.start[:, i] for i, name in enumerate(drive.names)}
        self.end_inputs = {name: drive.end[:, i] for i, name in enumerate(drive.names)}
        self.columns = predictor.columns[number]
        self.places = np.zeros((0, predictor.fast.model.size)) if places is None else places
        self.channels = len(self.columns) + len(self.places)
        self._coefficient: dict[str, Array] = {}
        self._told: tuple[Array, Array] | None = None
        self._inlet: Array | None = None

    # ------------------------------------------------------------------ answers
    def outputs(self, tangent: Array, inlet: Array | None = None) -> Array:
        """Channels' response (G + 1, c, m) to changes of states (G + 1, r, m) and coolant inlet."""
        owner = np.append(self.run.step_class, self.run.step_class[-1])
        column = self.predictor.fast.inlet_column if inlet is not None else None
        read = len(self.columns)
        found = np.zeros((tangent.shape[0], self.channels, tangent.shape[2]))
        found[:, read:] = self.places @ tangent
        for number in np.unique(owner):
            operators, rows = self.run.operators[number], np.flatnonzero(owner == number)
            found[rows, :read] = operators.outputs[self.columns] @ tangent[rows]
            if inlet is not None:
                direct = operators.output_inputs[self.columns, column]
                found[rows, :read] += direct[None, :, None] * inlet[rows, None, :]
        return found

    def march(self, start: Array, end: Array, inlet: Array | None = None) -> Array:
        """Channels' response to loads (G, r, m) at both ends of the steps."""
        return self.outputs(self.state_changes(start, end), inlet)

    def state_changes(self, start: Array, end: Array) -> Array:
        """Changes of the states (G + 1, r, m) that follow from loads (G, r, m) at both ends of the steps."""
        return self.run.tangents(self.forcing(start, end), self.tracks)

    def forcing(self, start: Array, end: Array) -> Array:
        """Changes of the states within each step (G, r, m) by loads (G, r, m) at both its ends."""
        found = np.empty_like(start)
        for key, rows in self.run.groups.items():
            propagator = self.run.propagators[key]
            found[rows] = propagator.from_start @ start[rows] + propagator.from_end @ end[rows]
        return found

    def place_temperature(self, place: str) -> Array:
        """Mean temperature of a place at the grid, (G + 1,) K."""
        return self.states @ self.predictor.fast.model.place(place)

    # ------------------------------------------------------------------ candidates
    def responses(self, variants: Sequence[Variant]) -> Array:
        """Answer of the channels to every variant at its reference amplitude, (G + 1, c, m)."""
        size = (self.drive.grid.size, self.channels)
        found = np.zeros((*size, len(variants)))
        dynamic, steady = [], []
        for position, variant in enumerate(variants):
            candidate = variant.candidate
            if candidate.recording not in (None, self.number):
                continue
            if candidate.reading is not None:
                found[:, : len(self.columns), position] += self._reading(variant)
            if any(term.is_dynamic for term in candidate.terms):
                dynamic.append(position)
            if variant.changes_the_machine:
                found[:, :, position] += self._changed(variant)
            elif candidate.factors or any(term.is_steady for term in candidate.terms):
                steady.append(position)
        for first in range(0, len(dynamic), CHUNK):
            chosen = dynamic[first : first + CHUNK]
            found[:, :, chosen] += self._dynamic([variants[i] for i in chosen])
        if steady:
            found[:, :, steady] += self._steady([variants[i] for i in steady])
        return found

    def _dynamic(self, variants: Sequence[Variant]) -> Array:
        steps, size = len(self.drive.steps), self.predictor.fast.model.size
        start, end = np.zeros((steps, size, len(variants))), np.zeros((steps, size, len(variants)))
        inlet = np.zeros((steps + 1, len(variants)))
        for position, variant in enumerate(variants):
            values = variant.values(variant.reference)
            for term in variant.candidate.terms:
                if term.is_dynamic:
                    terms = EffectTerms((term,), values)
                    memory = self._memory(terms)
                    for loads, before in ((start, True), (end, False)):
                        added, shift = self._load(terms, memory, before)
                        loads[:, :, position] += added
                        if shift is not None:
                            rows = slice(0, steps) if before else slice(steps, steps + 1)
                            inlet[rows, position] += shift if before else shift[-1:]
        return self.march(start, end, inlet if np.any(inlet) else None)

    def _memory(self, terms: EffectTerms) -> Array:
        """Memory of a term before every step and after the last, (G + 1, n_states)."""
        drive, sensed = self.drive, self._sensed(terms)
        memory, _ = remembered(
            terms,
            Instants(drive.grid[:-1], self.start_inputs),
            drive.steps,
            sensed[:-1],
            Derivatives.STATE,
            held=np.zeros(0, dtype=np.int64),
        )
        return memory

    def _sensed(self, terms: EffectTerms) -> Array:
        """Sensed temperatures of a term at the grid, (G + 1, n_reads) K."""
        reads = [self.place_temperature(place) for place in terms.reads]
        return np.array(reads).reshape(-1, len(self.states)).T

    def _load(self, terms: EffectTerms, memory: Array, before: bool) -> tuple[Array, Array | None]:
        """Load that a term adds at one end of every step, (G, r), and its shift of the inlet."""
        fast, run = self.predictor.fast, self.run
        model, steps = fast.model, len(self.drive.steps)
        at = slice(0, steps) if before else slice(1, steps + 1)
        instants = Instants(self.drive.grid[at], self.start_inputs if before else self.end_inputs)
        answers = terms.at(instants, self._sensed(terms)[at], memory[at], Derivatives.NONE)
        added = np.zeros((steps, model.size))
        shift = None
        for place, heat in zip(terms.places, answers.heat.value.T, strict=True):
            if place == COOLANT_INLET:
                shift = heat
                loads = np.array([operators.loads[:, fast.inlet_column] for operators in run.operators])
                added += shift[:, None] * loads[self.drive.step_class]
            elif place.startswith(FLUID_PREFIX) and place not in model.place_names:
                film = fast.fluid_places[place]
                strength = self.strength(film) * heat
                added += strength[:, None] * model.fluid_load[model.fluid_names.index(film)]
            else:
                added += heat[:, None] * model.place(place)
        friction = run.friction_start if before else run.friction_end
        for bearing, factor in zip(terms.bearings, answers.friction.value.T, strict=True):
            for position in fast.heat_rows(bearing):
                heat = (factor - 1.0) * friction[:, position]
                added += heat[:, None] * model.place(fast.heat_places[position])
        for coefficient, factor in zip(terms.coefficients, answers.factor.value.T, strict=True):
            excess = (factor - 1.0) * self.strength(coefficient)
            added -= excess[:, None] * self.flow(coefficient, before)
        return added, shift

    def strength(self, coefficient: str) -> Array:
        """A coefficient in every step, (G,)."""
        if coefficient not in self._coefficient:
            by_class = np.array([found[coefficient] for found in self.run.built.coefficients])
            self._coefficient[coefficient] = by_class[self.drive.step_class]
        return self._coefficient[coefficient]

    def flow(self, coefficient: str, before: bool) -> Array:
        """Heat flow removed by a unit coefficient at one end of every step, (G, r)."""
        model = self.predictor.fast.model
        steps = len(self.drive.steps)
        states = self.states[:steps] if before else self.states[1:]
        operator = model.operators[model.coefficient_names.index(coefficient)]
        flow = states @ operator
        if coefficient in model.fluid_names:
            inputs = self.start_inputs if before else self.end_inputs
            fluid = self.predictor.fast.fluid_temperature(coefficient, inputs)
            flow -= np.outer(
                np.broadcast_to(fluid, steps), model.fluid_load[model.fluid_names.index(coefficient)]
            )
        return flow

    def predicted(self) -> Array:
        """Readings of the channels in this run, (G + 1, c) K."""
        return self._passed_on()[1]

    def before_sensors(self) -> Array:
        """What the sensors feel, late as they are, (G + 1, c) K, before what they do wrong."""
        return self._passed_on()[0]

    def _passed_on(self) -> tuple[Array, Array]:
        if self._told is None:
            about = self.values, self.candidates
            at_places = self.predictor.at_places(self.number, *about)
            felt = self.predictor.pass_on(self.number, at_places, *about)
            self._told, self._inlet = (felt, at_places.temperature), at_places.inlet
        return self._told

    def _reading(self, variant: Variant) -> Array:
        """Difference of one channel that a sensor effect makes, (G + 1, c)."""
        values = self.values | variant.values(variant.reference)
        predicted = self.predicted()
        shown = self.predictor.read(self.number, [variant.candidate], values, predicted, self._inlet)
        return shown - predicted

    def _changed(self, variant: Variant) -> Array:
        """Change of the channels where a coefficient is another from the start, (G + 1, c)."""
        values = self.values | variant.values(variant.reference)
        changed = self.predictor.predict(self.number, values, (*self.candidates, variant.candidate))
        at_places = (changed.states - self.states) @ self.places.T
        return np.concatenate((changed.temperature - self.predicted(), at_places), axis=1)

    def _steady(self, variants: Sequence[Variant]) -> Array:
        """Constant changes of the operators, by their derivatives where they do nothing."""
        terms: list[Term] = []
        names: list[list[tuple[str, float]]] = []
        values = dict(self.values)
        for number, variant in enumerate(variants):
            candidate = variant.candidate
            own: list[tuple[str, float]] = []
            for factor in candidate.factors:
                step = float(np.log(variant.reference)) if factor.logarithmic else variant.reference - 1.0
                own.append((factor.name, step))
            steady = [term for term in candidate.terms if term.is_steady]
            if steady:
                # Each variant's own copy under a name of its own, at rest.
                for term in steady:
                    copy = _renamed(term, f"{term.name}#{number}")
                    inner = candidate.amplitude.removeprefix(f"{term.name}.")
                    given = term.values(variant.values(candidate.null))
                    values |= {f"{copy.name}.{key}": value for key, value in given.items()}
                    terms.append(copy)
                    item = next(p for p in term.parameters if p.name == inner)
                    difference = variant.reference - candidate.null
                    own.append(
                        (
                            f"{copy.name}.{inner}",
                            float(np.log(variant.reference / candidate.null))
                            if item.logarithmic
                            else difference,
                        )
                    )
            names.append(own)
        asked = tuple(dict.fromkeys(name for own in names for name, _ in own))
        holder = Candidate("", "", "", "parameter", "", 0.0, 0.0, terms=tuple(terms))
        prediction = self.predictor.predict(self.number, values, (*self.candidates, holder), asked)
        slopes = np.concatenate((prediction.sensitivity, prediction.slopes_at(self.places)), axis=1)
        found = np.zeros((*slopes.shape[:2], len(variants)))
        for position, own in enumerate(names):
            for name, step in own:
                found[:, :, position] += step * slopes[:, :, asked.index(name)]
        return found


def _renamed(term: Term, name: str) -> Term:
    found = copy.copy(term)
    found.name = name
    return found
