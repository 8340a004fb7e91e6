"""Distance between effects in the readings of a test, once everything else has explained what it can.

An effect of some size leaves a course in every channel. Only that part counts which the
machine's own uncertain numbers and the noise cannot explain (generalised least
squares) and, against another effect, which that effect, of any size and with a law
of any of its shapes, cannot explain either. To first order in the sizes.

Source of the information between two hypotheses: MacKay (2003), Information
Theory, Inference, and Learning Algorithms, chapter 8 (mutual information).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import chdtri, chndtr, ndtri

from spindle_fem.inference import tuned

Array = NDArray[np.float64]

# Probability with which an effect of a stated size is seen, and distinguished; and of a false alarm.
POWER, FALSE_ALARM = 0.90, tuned.SIGNIFICANT
# Sizes are stated that suffice for this share of the forms and shapes of an effect's law.
SHARE_OF_FORMS = 0.75
# Answers smaller than this share of what they were before the machine's numbers took theirs are rounding.
ROUNDING = 1e-9


@cache
def misfit_seen(freedom: int, trials: int) -> float:
    """Expected gain in misfit (χ²) of an effect that is seen with ``POWER`` at ``FALSE_ALARM``.

    The inverse of :func:`~spindle_fem.inference.p_value.detection_p_value`.

    Parameters
    ----------
    freedom : int
        Free parameters of the effect.
    trials : int
        Effects at places that a diagnosis tries.
    """
    single = -np.expm1(np.log1p(-FALSE_ALARM) / (1.0 + trials / tuned.CANDIDATES_A_TRIAL))
    limit = float(chdtri(freedom, single**tuned.CHANCE_DIVISOR))
    return float(brentq(lambda gain: 1.0 - chndtr(limit, freedom, gain) - POWER, 1e-3, 1e4))


def misfit_told() -> float:
    """Squared distance (χ²) at which one effect is distinguished from another with ``POWER``.

    The misfit of the other then exceeds the margin beyond which a diagnosis does not name both together.
    """
    width = ndtri(POWER)
    return float((width + np.sqrt(width**2 + tuned.NEAR_MISFIT)) ** 2)


def bits(squared: Array) -> Array:
    """Mutual information between two equally likely hypotheses and readings, bits.

    Parameters
    ----------
    squared : ndarray
        Squared distance of the two, in units of the noise (χ²).

    >>> bits(np.array([0.0, 4.0, 100.0])).round(2).tolist()
    [0.0, 0.49, 1.0]
    """
    return np.interp(np.sqrt(squared), *_bits_by_distance())


@cache
def _bits_by_distance() -> tuple[Array, Array]:
    """Bits at distances up to one beyond which nothing is lost."""
    distances = np.linspace(0.0, 15.0, 601)
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    ratio = 0.5 * distances[:, None] ** 2 + distances[:, None] * nodes
    lost = np.logaddexp(0.0, -ratio) / np.log(2.0)
    return distances, np.clip(1.0 - lost @ (weights / weights.sum()), 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class ChannelProducts:
    """Inner products, channel by channel, of whitened responses to the machine's coordinates and to effects.

    Attributes
    ----------
    precision : (p, p) ndarray
        What is known of the machine's coordinates before.
    own : (c, p, p) ndarray
    mixed : (c, p, m) ndarray
    effects : (c, m, m) ndarray
        Of the responses to every form of every effect at its usual size.
    """

    precision: Array
    own: Array
    mixed: Array
    effects: Array

    @classmethod
    def of(cls, precision: Array, jacobians: Sequence[Array], answers: Sequence[Array]) -> ChannelProducts:
        """Build from whitened columns (n, p) and (n, m) of each channel."""
        return cls(
            precision,
            np.array([j.T @ j for j in jacobians]),
            np.array([j.T @ a for j, a in zip(jacobians, answers, strict=True)]),
            np.array([a.T @ a for a in answers]),
        )

    def gram(self, channels: Sequence[int]) -> Array:
        """Inner products over some channels of what the machine's coordinates cannot take up, (m, m)."""
        chosen = list(channels)
        mixed = self.mixed[chosen].sum(axis=0)
        whole = self.effects[chosen].sum(axis=0)
        found = whole - mixed.T @ np.linalg.solve(self.precision + self.own[chosen].sum(axis=0), mixed)
        rounding = ROUNDING * np.sqrt(np.outer(np.diag(whole), np.diag(whole)))
        return np.where(np.abs(found) > rounding, found, 0.0)


@dataclass(frozen=True, slots=True)
class EffectForms:
    """Forms of effects at places, and which belong together.

    Attributes
    ----------
    owner : (m,) int ndarray
        Effect at a place that each form belongs to, 0 to k - 1.
    candidate : (m,) int ndarray
        Candidate of each: its shapes differ only by parameters that are free.
    freedom : (m,) int ndarray
        Free parameters.
    spread : (m,) ndarray
        Prior standard deviation of the size, over the usual one.
    one_sided : (m,) bool ndarray
        Sizes that cannot be negative.
    share : (m,) ndarray
        How likely each form is, given its effect and place.
    """

    owner: NDArray[np.int64]
    candidate: NDArray[np.int64]
    freedom: NDArray[np.int64]
    spread: Array
    one_sided: NDArray[np.bool_]
    share: Array

    @property
    def number(self) -> int:
        """Effects at places, k."""
        return int(self.owner.max(initial=-1)) + 1

    def distances(self, gram: Array) -> tuple[Array, Array]:
        """Squared distance of every form at its usual size from nothing (m,), and from effects (m, k)."""
        size = np.clip(np.diag(gram), 0.0, None)
        stiff = size + self.spread**-2.0
        least = self._gain_of_one(gram, stiff)
        taken = np.zeros((len(size), self.number))
        for index in range(len(size)):
            of = self.owner[index]
            np.maximum(taken[:, of], least[:, index], out=taken[:, of])
        for first, second in self._pairs():
            of = self.owner[first]
            np.maximum(taken[:, of], self._gain_of_two(gram, stiff, first, second), out=taken[:, of])
        left = size[:, None] - taken
        return size, np.where(left > ROUNDING * size[:, None], left, 0.0)

    def _gain_of_one(self, gram: Array, stiff: Array) -> Array:
        along = np.where(self.one_sided[None, :], np.clip(gram, 0.0, None), gram)
        return along**2 / stiff

    def _gain_of_two(self, gram: Array, stiff: Array, first: int, second: int) -> Array:
        """Part absorbed by a mixture of two shapes of one law; both of one sign."""
        one, two, across = gram[:, first], gram[:, second], gram[first, second]
        determinant = stiff[first] * stiff[second] - across**2
        if determinant <= ROUNDING * stiff[first] * stiff[second]:
            return np.zeros(len(one))
        sizes = (stiff[second] * one - across * two, stiff[first] * two - across * one)
        allowed = sizes[0] * sizes[1] >= 0.0
        if self.one_sided[first]:
            allowed &= (sizes[0] >= 0.0) & (sizes[1] >= 0.0)
        return np.where(allowed, (one * sizes[0] + two * sizes[1]) / determinant, 0.0)

    def _pairs(self) -> list[tuple[int, int]]:
        found = []
        for candidate in np.unique(self.candidate):
            members = np.flatnonzero(self.candidate == candidate).tolist()
            found += itertools.combinations(members, 2)
        return found

    def judged(self, gram: Array) -> Separation:
        """Separation from readings with these inner products."""
        from_nothing, between = self.distances(gram)
        seen = np.array([misfit_seen(int(f), self.number) for f in self.freedom])
        with np.errstate(divide="ignore"):
            seen_from = np.sqrt(seen / from_nothing)
            told_from = np.sqrt(misfit_told() / between)
        information = bits(np.column_stack((from_nothing, between)) / tuned.GAIN_DIVISOR)
        k = self.number
        found = Separation(np.zeros(k), np.zeros((k, k)), np.zeros(k), np.zeros((k, k)))
        for own in range(k):
            rows = np.flatnonzero(self.owner == own)
            share = self.share[rows]
            found.seen_from[own] = _quantile(seen_from[rows, None], share)[0]
            found.told_from[own] = _quantile(told_from[rows], share)
            mean = share @ information[rows] / share.sum()
            found.information_seen[own], found.information[own] = mean[0], mean[1:]
        # An effect that is not seen cannot be distinguished from anything either.
        np.maximum(found.told_from, found.seen_from[:, None], out=found.told_from)
        return found


def _quantile(values: Array, share: Array) -> Array:
    """Values (n, k) that ``SHARE_OF_FORMS`` of the rows do not exceed, (k,)."""
    order = np.argsort(values, axis=0)
    passed = np.cumsum(share[order], axis=0) / share.sum()
    at = np.argmax(passed >= SHARE_OF_FORMS - 1e-9, axis=0)
    return np.take_along_axis(values, np.take_along_axis(order, at[None, :], axis=0), axis=0)[0]


@dataclass(frozen=True, slots=True)
class Separation:
    """Separability of k effects at places from some readings; sizes over the usual ones.

    Attributes
    ----------
    seen_from : (k,) ndarray
        Size from which each is seen; infinite where none is.
    told_from : (k, k) ndarray
        Size of the effect in the row from which it is distinguishable from that in the column.
    information_seen : (k,) ndarray, [bit]
        Between each at its usual size and nothing.
    information : (k, k) ndarray, [bit]
        Between each at its usual size and the other as like it as it can be.
    """

    seen_from: Array
    told_from: Array
    information_seen: Array
    information: Array

    def mean_information(self, weights: Array, nothing: float) -> float:
        """Mean over all pairs, nothing missing among them, weighted with what is likely before, bits.

        Parameters
        ----------
        weights : (k,) ndarray
            Prior of every effect at its place, sum 1.
        nothing : float
            Prior of nothing missing over that of something.
        """
        beside = np.outer(weights, weights) * (1.0 - np.eye(len(weights)))
        total = nothing * float(weights.sum()) + float(beside.sum())
        seen, apart = weights @ self.information_seen, np.sum(beside * self.information)
        return (nothing * float(seen) + float(apart)) / total
