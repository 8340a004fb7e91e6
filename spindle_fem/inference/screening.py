"""Select the few of many candidates that explain the residual, to first order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import BaseRun, Variant
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.linearised_fit import BoxedColumns, HeldColumns, LinearProblem
from spindle_fem.inference.worker_processes import Workers

Array = NDArray[np.float64]

# Number of pieces into which variants are divided to compute their responses in parallel.
PIECES = 2
# Rounds in which size and prior of a factor are brought together: where readings tell the size as well as the
# prior does, the last one changes it by less than a thousandth.
SIZE_ROUNDS = 6


@dataclass(frozen=True, slots=True)
class Screened:
    """Candidates compared with the residual of one fit.

    Attributes
    ----------
    gram : (m, m) ndarray
        Inner products of their responses, less what the machine's own coordinates absorb.
    data : (m,) ndarray
        With the data.
    total : float
        Inner product of the data with themselves.
    spread : (m,) ndarray
        Prior standard deviation of each amplitude in units of its reference.
    signs : (m,) ndarray
        1: the amplitude cannot be negative; 0: it can.
    log_prior : (m,) ndarray
    families : mapping of component to str
        Bearing set of a bearing: one effect is looked for once in each family.
    boxed : BoxedColumns or None
        Where bounds of the machine's own coordinates matter: gains of the most promising sets are then
        found within them.
    base : float
        Cost that these gains count from.
    """

    variants: tuple[Variant, ...]
    gram: Array
    data: Array
    total: float
    spread: Array
    signs: Array
    log_prior: Array
    families: Mapping[str, str] = field(default_factory=dict)
    boxed: BoxedColumns | None = None
    base: float = 0.0
    # Sets of each size that were evaluated, and their gains: used several times and slow within bounds.
    _known: dict[int, tuple[NDArray[np.int64], Array]] = field(default_factory=dict, repr=False)

    def singles(self) -> Array:
        """Logarithm of the evidence of every variant alone over nothing, priors included, (m,)."""
        return self._evaluated(1)[1]

    def _gain_within(self, sets: NDArray[np.int64]) -> Array:
        """Gain of sets (k, s) with the machine's coordinates between their bounds."""
        costs = self.boxed.costs(sets, self.spread, self.signs != 0.0)
        return 0.5 * (self.base - costs) - self._price(sets, self._scaled(sets))

    def _scaled(self, sets: NDArray[np.int64]) -> Array:
        """Posterior over prior precision of the amplitudes of sets, (k, s, s)."""
        spread = self.spread[sets]
        gram = self.gram[sets[:, :, None], sets[:, None, :]]
        return spread[:, :, None] * gram * spread[:, None, :] + np.eye(sets.shape[1])

    def _price(self, sets: NDArray[np.int64], scaled: Array) -> Array:
        """Complexity of sets: half the logarithm of the determinant, less that of the priors."""
        _, log_det = np.linalg.slogdet(scaled)
        return 0.5 * log_det - np.log(2.0) * self.signs[sets].sum(axis=1) - self.log_prior[sets].sum(axis=1)

    def _gain(self, sets: NDArray[np.int64]) -> Array:
        """Gain of sets (k, s) of equal size, the machine's coordinates free of their bounds."""
        scaled = self._scaled(sets)
        right = self.spread[sets] * self.data[sets]
        solution = np.linalg.solve(scaled, right[:, :, None])[:, :, 0]
        gain = 0.5 * np.sum(right * solution, axis=1) - self._price(sets, scaled)
        allowed = np.all((self.signs[sets] == 0.0) | (solution >= 0.0), axis=1)
        return np.where(allowed, gain, -np.inf)

    def amplitudes(self, members: Sequence[int]) -> dict[int, float]:
        """Most probable amplitudes of a set, in units of the references.

        Within bounds where those of the machine's own coordinates matter: free of them, a weak effect may be
        made fifty times too strong by what the machine cannot do.
        """
        sets = np.asarray(members)
        if self.boxed is not None:
            _, within = self.boxed.least(sets, self.spread, self.signs != 0.0)
            return dict(zip(members, within.tolist(), strict=True))
        matrix = self.gram[np.ix_(sets, sets)] + np.diag(1.0 / self.spread[sets] ** 2)
        found = np.linalg.solve(matrix, self.data[sets])
        return dict(zip(members, found.tolist(), strict=True))

    def best(self, size: int, number: int) -> list[tuple[tuple[int, ...], float]]:
        """Best sets of a size with their gains, each combination of effects and places once.

        Parameters
        ----------
        size : int
            1 to 3; triples extend the best pairs.
        """
        sets, gain = self._evaluated(size)
        found: dict[frozenset[tuple[str, str, int | None]], tuple[tuple[int, ...], float]] = {}
        places: dict[tuple[str, ...], int] = {}
        for index in np.argsort(-gain):
            if not np.isfinite(gain[index]):
                break
            members = tuple(int(i) for i in sets[index])
            key = frozenset(self.variants[i].candidate.key for i in members)
            effects = tuple(sorted(self.variants[i].candidate.effect for i in members))
            # One effect at many places must not crowd out the others.
            if key not in found and places.get(effects, 0) < tuned.PLACES_OF_ONE_EFFECT:
                found[key] = (members, float(gain[index]))
                places[effects] = places.get(effects, 0) + 1
            if len(found) == number:
                break
        return list(found.values())

    def _evaluated(self, size: int) -> tuple[NDArray[np.int64], Array]:
        """Sets of a size (k, s) and their gains (k,); the promising ones where bounds matter."""
        if size not in self._known:
            sets = self._sets(size)
            if self.boxed is None or size > 1:
                pieces = np.array_split(sets, 1 + len(sets) // 100_000)
                gain = np.concatenate([self._gain(piece) for piece in pieces])
            if self.boxed is not None:
                sets = sets if size == 1 else self._promising(sets, gain)
                gain = self._gain_within(sets)
            self._known[size] = sets, gain
        return self._known[size]

    def _sets(self, size: int) -> NDArray[np.int64]:
        """Every set of distinct variants, (k, s); triples of the best pairs."""
        count = len(self.variants)
        if size == 1:
            return np.arange(count)[:, None]
        if size == 2:
            sets = np.column_stack(np.triu_indices(count, 1))
        else:
            pairs = [members for members, _ in self.best(2, tuned.PAIRS_FOR_TRIPLES)]
            sets = np.array(
                [(*pair, third) for pair in pairs for third in range(count) if third not in pair], dtype=int
            ).reshape(-1, 3)
        return sets[self._distinct(sets)]

    def _promising(self, sets: NDArray[np.int64], gain: Array) -> NDArray[np.int64]:
        """Sets worth a bounded solution: the best without bounds, and those of good members."""
        good = np.zeros(len(self.variants), dtype=bool)
        good[np.argsort(-self.singles())[: tuned.SINGLES_WITHIN_BOUNDS]] = True
        chosen = np.zeros(len(sets), dtype=bool)
        chosen[np.argsort(-gain, kind="stable")[: tuned.SETS_WITHIN_BOUNDS]] = True
        if sets.shape[1] == 2:
            chosen |= good[sets].all(axis=1)
        return sets[chosen]

    def best_of(self, allowed: Callable[[Candidate], bool], number: int) -> list[int]:
        """Best variant of each effect and form at each place in each recording, among those allowed."""
        gain = self.singles()
        found: dict[tuple, int] = {}
        for index in np.argsort(-gain):
            candidate = self.variants[index].candidate
            if not np.isfinite(gain[index]) or len(found) == number:
                break
            if allowed(candidate):
                found.setdefault((*candidate.key, candidate.form), int(index))
        return list(found.values())

    def _distinct(self, sets: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Sets of different candidates, in no recording two of one effect at one place or in one family."""
        keys = [
            (effect, self.families.get(component, component))
            for effect, component in (v.key for v in self.variants)
        ]
        names = {key: i for i, key in enumerate(dict.fromkeys(keys))}
        label = np.array([names[key] for key in keys])[sets]
        own = np.array([-1 if (n := v.candidate.recording) is None else n for v in self.variants])[sets]
        keep = np.ones(len(sets), dtype=bool)
        for i in range(sets.shape[1]):
            for j in range(i):
                apart = (own[:, i] != own[:, j]) & (own[:, i] >= 0) & (own[:, j] >= 0)
                keep &= (label[:, i] != label[:, j]) | apart
        return keep


def log_priors(variants: Sequence[Variant], weights: Mapping[str, float]) -> Array:
    """Logarithm of the prior of each variant given that one effect more is there.

    Every effect has a weight, shared evenly by its places, their forms and
    starting shapes.
    """
    total = sum(weights.values())
    places: dict[str, set[str]] = {}
    shapes: dict[tuple[str, str], int] = {}
    for variant in variants:
        places.setdefault(variant.candidate.effect, set()).add(variant.candidate.component)
        shapes[variant.key] = shapes.get(variant.key, 0) + 1
    return np.array(
        [
            np.log(weights[v.candidate.effect] / total)
            - np.log(len(places[v.candidate.effect]))
            - np.log(shapes[v.key])
            for v in variants
        ]
    )


def screen(
    problem: Problem,
    fit: Fit,
    variants: Sequence[Variant],
    weights: Mapping[str, float],
    families: Mapping[str, str],
    trust: Fit | None = None,
    workers: Workers | None = None,
    linear: LinearProblem | None = None,
) -> Screened:
    """Responses of all variants about a fit, and their inner products.

    Parameters
    ----------
    fit : Fit
        What the model already holds.
    weights : mapping of effect to float
    families : mapping of component to str
        As :class:`Screened` has them.
    trust : Fit or None
        Fit without the variants that gains count from, and whose residuals show which readings are
        outliers; None for the first one.
    workers : Workers or None
        Processes that compute the responses; the result does not depend on it.
    linear : LinearProblem or None
        About the fit, where it is known.
    """
    # The same pieces with or without workers, so that the result is the same.
    pieces = [tuple(variants[first::PIECES]) for first in range(PIECES)]
    jobs = [partial(_answers, fit=fit, variants=piece) for piece in pieces]
    if linear is None:
        jobs.append(partial(LinearProblem.about, fit=fit, trust=trust))
    answers = (workers or Workers()).done(problem, jobs)
    linear = answers.pop() if linear is None else linear
    columns = np.empty((len(problem.data), len(variants)))
    for first, found in enumerate(answers):
        columns[:, first::PIECES] = found
    gram, data, total = linear.gram(columns)
    signs = np.array([is_one_sided(v) for v in variants])
    priors = log_priors(variants, weights)
    boxed = linear.boxed(columns) if linear.box.matters or trust is not None else None
    if boxed is None:
        spread = spreads_at_size(variants, gram, data)
    else:
        held = HeldColumns.of(boxed)
        spread = spreads_at_size(variants, held.with_columns, held.with_residual)
    base = linear.box.cost
    if trust is not None:
        base = float(np.sum((linear.weight * trust.residual) ** 2)) + trust.misfit_with_prior - trust.misfit
    return Screened(tuple(variants), gram, data, total, spread, signs, priors, families, boxed, base)


def _answers(problem: Problem, fit: Fit, variants: Sequence[Variant]) -> Array:
    """Whitened responses of all recordings to variants, (n, m)."""
    return problem.whitened(
        [
            BaseRun(problem.predictor, number, fit.values, fit.candidates).responses(variants)
            for number in range(len(problem.predictor.recordings))
        ]
    )


def amplitude_spread(variant: Variant) -> float:
    """Prior standard deviation of an amplitude, in units of its reference."""
    candidate = variant.candidate
    item = candidate.parameters[candidate.amplitude]
    if item.logarithmic:
        return item.sigma / abs(_size_of_reference(variant))
    return item.sigma / abs(variant.reference - candidate.null)


def spreads_at_size(variants: Sequence[Variant], gram: Array, data: Array) -> Array:
    """Prior standard deviations of amplitudes with which a square costs what their priors do, (m,).

    To first order readings answer to a factor ``f`` as to ``f - 1``, or as to ``1 / f - 1`` where it is one
    on a conductance in a row; its prior is normal in the logarithm. A size ``s``, where the data have it, so
    counts as ``log(1 + s)``: a contact that conducts a twentieth is three deviations off, not nineteen.

    Parameters
    ----------
    gram, data : (m, m) and (m,) ndarray
        Inner products as :class:`Screened` has them.
    """
    own = np.array([amplitude_spread(v) for v in variants])
    unit = np.array([_size_of_reference(v) for v in variants])
    spread = own
    for _ in range(SIZE_ROUNDS):
        size = np.abs(unit * data) / (np.diag(gram) + spread**-2.0)
        spread = own * np.divide(size, np.log1p(size), out=np.ones_like(size), where=size > 0.0)
    return spread


def _size_of_reference(variant: Variant) -> float:
    """Size of a factor at its reference, by which :func:`spreads_at_size` counts; 0 of what is none.

    Of an answer to first order its logarithm. What changes the machine itself is a conductance in a row with
    others, and its size what that changes: its resistance.
    """
    candidate = variant.candidate
    if not candidate.parameters[candidate.amplitude].logarithmic:
        return 0.0
    if variant.changes_the_machine:
        return 1.0 - candidate.null / variant.reference
    return float(np.log(variant.reference / candidate.null))


def is_one_sided(variant: Variant) -> float:
    """1 where an amplitude cannot be negative, 0 where it can."""
    candidate = variant.candidate
    item = candidate.parameters[candidate.amplitude]
    upwards = variant.reference > candidate.null
    bound = item.low if upwards else item.high
    return 1.0 if bound == candidate.null else 0.0


def amplitude_value(variant: Variant, scaled: float) -> float:
    """Amplitude from one in units of the reference."""
    candidate = variant.candidate
    item = candidate.parameters[candidate.amplitude]
    if item.logarithmic:
        value = candidate.null * float(np.exp(scaled * np.log(variant.reference / candidate.null)))
    else:
        value = candidate.null + scaled * (variant.reference - candidate.null)
    return float(np.clip(value, item.low, item.high))


def amplitude_to_begin_from(variant: Variant, scaled: float) -> float:
    """Amplitude that a fit begins from, where the linearised problem has it so many times the reference.

    A factor as far off as :func:`spreads_at_size` has it, and not farther than ``tuned.FARTHEST_START``: a
    conductance of nothing has no slope to return by.
    """
    candidate = variant.candidate
    item = candidate.parameters[candidate.amplitude]
    if not item.logarithmic:
        return amplitude_value(variant, scaled)
    farthest = tuned.FARTHEST_START
    value = candidate.null * np.exp(np.clip(_logarithm_at(variant, scaled), -farthest, farthest))
    return float(np.clip(value, item.low, item.high))


def is_far_off(variant: Variant, scaled: float) -> bool:
    """Whether an amplitude, in units of the reference, is a factor of which the first order says little."""
    item = variant.candidate.parameters[variant.candidate.amplitude]
    return item.logarithmic and abs(_logarithm_at(variant, scaled)) > tuned.FACTOR_FAR_OFF


def _logarithm_at(variant: Variant, scaled: float) -> float:
    """Logarithm of a factor so many times as far off as its reference to first order."""
    size = scaled * _size_of_reference(variant)
    return float(np.copysign(np.log1p(abs(size)), size))
