"""What a term sees and answers: complex columns, one for each direction of a derivative."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import Term, TermContext

Array = NDArray[np.float64]

COMPLEX_STEP = 1e-30


class OneInstant:
    """Mark of terms that can be evaluated at one instant only, not at many side by side."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Added quantities at one instant and their derivatives.

    Attributes
    ----------
    value : (m,) ndarray
    by_sensed : (m, n_y) ndarray
    by_state : (m, n_x) ndarray
    by_parameter : (m, p) ndarray
        Explicit part, to the coordinates of the asked parameters.
    """

    value: Array
    by_sensed: Array
    by_state: Array
    by_parameter: Array


@dataclass(frozen=True, slots=True)
class Layout:
    """Complex columns of a term: the value first, then one for each direction of a derivative.

    Attributes
    ----------
    reads, states : slice
        Rows of the sensed temperatures and of the states.
    split, end : int
        Columns of the states' and of the parameters' directions begin here.
    targets : list of int
        Derivative that each of the latter belongs to.
    temperatures, state : ndarray
        Perturbations, to which the values are added.
    parameters : mapping of str to ndarray
    """

    reads: slice
    states: slice
    split: int
    end: int
    targets: list[int]
    temperatures: NDArray[np.complex128]
    state: NDArray[np.complex128]
    parameters: Mapping[str, NDArray[np.complex128]]

    @classmethod
    def of(
        cls, term: Term, values: Mapping[str, float], reads: slice, states: slice, own: Mapping[str, int]
    ) -> Layout:
        """Layout of a term with parameter values; ``own`` maps its asked parameters to derivatives."""
        n_reads, n_states = len(term.reads), term.n_states
        split, end = 1 + n_reads, 1 + n_reads + n_states
        width = end + len(own)
        temperatures = np.zeros((n_reads, width), dtype=complex)
        state = np.zeros((n_states, width), dtype=complex)
        temperatures[np.arange(n_reads), 1 + np.arange(n_reads)] = 1j * COMPLEX_STEP
        state[np.arange(n_states), split + np.arange(n_states)] = 1j * COMPLEX_STEP
        parameters = {name: np.full(width, value, dtype=complex) for name, value in values.items()}
        kinds = {item.name: item.logarithmic for item in term.parameters}
        for i, name in enumerate(own):
            parameters[name][end + i] += 1j * COMPLEX_STEP * (values[name] if kinds[name] else 1.0)
        return cls(reads, states, split, end, list(own.values()), temperatures, state, parameters)

    def context(self, time: float, inputs: Mapping[str, float], sensed: Array, states: Array) -> TermContext:
        """What the term sees."""
        return TermContext(
            time,
            inputs,
            self.temperatures + sensed[self.reads, None],
            self.state + states[self.states, None] if self.state.size else self.state,
            self.parameters,
        )

    def context_over(
        self, times: Array, inputs: Mapping[str, Array], sensed: Array, states: Array, *, slopes: bool
    ) -> TermContext:
        """What the term sees at many instants, those of one instant side by side.

        Parameters
        ----------
        times : (n,) ndarray, [s]
        inputs : mapping of str to (n,) ndarray
        sensed : (n, n_y) ndarray
        states : (n, n_x) ndarray
        slopes : bool
            Whether the columns of the parameters' directions are there too.
        """
        width, number = self.width(slopes=slopes), len(times)
        temperatures = sensed[:, self.reads].T[:, :, None] + self.temperatures[:, None, :width]
        state = states[:, self.states].T[:, :, None] + self.state[:, None, :width]
        return TermContext(
            np.repeat(times, width),
            {name: np.repeat(values, width) for name, values in inputs.items()},
            temperatures.reshape(-1, number * width),
            state.reshape(-1, number * width),
            {name: np.tile(values[:width], number) for name, values in self.parameters.items()},
        )

    def width(self, *, slopes: bool) -> int:
        """Columns of one instant."""
        return self.end + len(self.targets) if slopes else self.end

    def spread_over(
        self, answers: NDArray, rows: slice, scale: Array | float, slopes: tuple[Array, Array, Array]
    ) -> None:
        """As :meth:`spread`, of answers (rows, n, columns) at many instants to slopes (n, m, ...)."""
        by_sensed, by_state, by_parameter = slopes
        found = (answers.imag * (scale / COMPLEX_STEP)).transpose(1, 0, 2)
        if self.split > 1:
            by_sensed[:, rows, self.reads] += found[:, :, 1 : self.split]
        if self.end > self.split:
            by_state[:, rows, self.states] += found[:, :, self.split : self.end]
        for column, target in enumerate(self.targets[: found.shape[2] - self.end], self.end):
            by_parameter[:, rows, target] += found[:, :, column]

    def spread(
        self, answers: NDArray, rows: slice, scale: Array | float, slopes: tuple[Array, Array, Array]
    ) -> None:
        """Add complex answers, times what they multiply in each row, to the derivatives."""
        by_sensed, by_state, by_parameter = slopes
        found = answers.imag * (scale / COMPLEX_STEP)
        if self.split > 1:
            by_sensed[rows, self.reads] += found[:, 1 : self.split]
        if self.end > self.split:
            by_state[rows, self.states] += found[:, self.split : self.end]
        for i, target in enumerate(self.targets):
            by_parameter[rows, target] += found[:, self.end + i]
