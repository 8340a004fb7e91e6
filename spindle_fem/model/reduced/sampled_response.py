"""Quantities known at some states, between them by kriging: a straight line and what is correlated beside it.

The states of a machine lie near few directions of the many in which they could differ: these are found first.

Source: Sacks et al. (1989), Statist. Sci. 4, 409-423; Matérn's correlation with ν = 5/2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Array = NDArray[np.float64]

# Directions in which states spread less than this, in scaled units, are left out; of the others so many.
LEAST_SPREAD = 0.01
MOST_DIRECTIONS = 8
# Of the correlation, in scaled units: the likeliest is taken.
LENGTHS = (2.0, 4.0, 8.0, 16.0, 32.0)
# Added to the correlation of a state with itself, against rounding.
NUGGET = 1.0e-9
# Share of a quantity's span (and one more) that it may go beyond what is sampled: a run that would leave the
# samples by more is stopped there, and sampled there next.
BEYOND = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class SampledResponse:
    """Quantities as functions of states, through all samples.

    Attributes
    ----------
    middle : (d,) ndarray
    directions : (d, q) ndarray
        Coordinates of a state ``x`` are ``(x - middle) @ directions``.
    fixed : (k,) int64 ndarray
        Inputs beside the states that differ between the samples.
    samples : (n, q + k) ndarray
    length : float
        Of the correlation.
    weights : (n, m) ndarray
    line : (1 + q + k, m) ndarray
    ends : (2, m) ndarray
        Smallest and largest sampled value.
    """

    middle: Array
    directions: Array
    fixed: NDArray[np.int64]
    samples: Array
    length: float
    weights: Array
    line: Array
    ends: Array

    @classmethod
    def through(cls, states: Array, inputs: Array, values: Array) -> SampledResponse:
        """Response through samples.

        Parameters
        ----------
        states : (n, d) ndarray
            Scaled: a unit in any of them matters about as much.
        inputs : (n, k) ndarray
            Beside the states, scaled alike; never perturbed.
        values : (n, m) ndarray
        """
        middle = states.mean(axis=0)
        _, spread, turned = np.linalg.svd(states - middle, full_matrices=False)
        kept = np.flatnonzero(spread > LEAST_SPREAD * np.sqrt(len(states)))[:MOST_DIRECTIONS]
        directions = turned[kept].T
        fixed = np.flatnonzero(np.ptp(inputs, axis=0) > 0.0)
        samples = np.hstack(((states - middle) @ directions, inputs[:, fixed]))
        straight = np.hstack((np.ones((len(samples), 1)), samples))
        if len(samples) <= straight.shape[1]:
            straight[:, 1:] = 0.0
        fits = [_fitted(samples, straight, values, length) for length in LENGTHS]
        ends = np.array([values.min(axis=0), values.max(axis=0)])
        best = min(range(len(fits)), key=lambda number: fits[number][0])
        return cls(middle, directions, fixed, samples, LENGTHS[best], *fits[best][1:], ends)

    def at(self, coordinates: Array, inputs: Array) -> tuple[Array, Array]:
        """Quantities (g, m), and their derivatives by the coordinates (g, m, q).

        Parameters
        ----------
        coordinates : (g, q) ndarray
        inputs : (g, k) ndarray
        """
        count = coordinates.shape[1]
        where = np.hstack((coordinates, inputs[:, self.fixed]))
        apart = where[:, None, :] - self.samples
        scaled = np.sqrt(5.0) / self.length * np.sqrt(np.einsum("gnc,gnc->gn", apart, apart))
        fading = np.exp(-scaled)
        value = (
            (1.0 + scaled + scaled**2 / 3.0) * fading @ self.weights + self.line[0] + where @ self.line[1:]
        )
        falling = (-5.0 / (3.0 * self.length**2)) * (1.0 + scaled) * fading
        slope = np.einsum("gn,gnc,nm->gmc", falling, apart[:, :, :count], self.weights, optimize=True)
        return value, slope + self.line[1 : 1 + count].T

    def limits(self) -> Array:
        """Smallest and largest value that the response gives, (2, m): somewhat beyond the samples."""
        reach = BEYOND * (1.0 + np.ptp(self.ends, axis=0))
        return self.ends + np.array([[-1.0], [1.0]]) * reach

    def within(self, coordinates: Array, inputs: Array) -> tuple[Array, Array]:
        """As :meth:`at`, but within :meth:`limits`; a value held there does not change with coordinates."""
        value, slope = self.at(coordinates, inputs)
        held = np.clip(value, *self.limits())
        return held, np.where((held == value)[:, :, None], slope, 0.0)


def _fitted(samples: Array, straight: Array, values: Array, length: float) -> tuple[float, Array, Array]:
    """Twice the negative logarithm of the likelihood, weights and line for one length of the correlation."""
    apart = np.linalg.norm(samples[:, None, :] - samples, axis=2)
    scaled = np.sqrt(5.0) / length * apart
    correlation = (1.0 + scaled + scaled**2 / 3.0) * np.exp(-scaled)
    correlation[np.diag_indices(len(samples))] += NUGGET
    factor = cho_factor(correlation, lower=True)
    solved = cho_solve(factor, np.hstack((straight, values)))
    known, own = solved[:, : straight.shape[1]], solved[:, straight.shape[1] :]
    line = np.linalg.lstsq(straight.T @ known, straight.T @ own, rcond=None)[0]
    weights = own - known @ line
    left = np.einsum("nm,nm->m", values - straight @ line, weights) / len(samples)
    determinant = 2.0 * np.log(np.diag(factor[0])).sum()
    size = np.log(np.maximum(left, 1.0e-16)).sum() * len(samples)
    return float(size + values.shape[1] * determinant), weights, line
