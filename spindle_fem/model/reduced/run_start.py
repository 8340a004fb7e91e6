"""Initial states of a run of the fast model: at time zero, and again after every long gap of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Start:
    """States that are given rather than computed.

    Attributes
    ----------
    points : (S,) int64 ndarray
        Positions in the drive's grid, 0 first, increasing. The step before one
        of the others bridges a gap: what it would give is not used.
    states : (S, r) ndarray
        Unknowns there.
    by : mapping of parameter to (S, r) ndarray
        Derivatives to the coordinates of the parameters; absent where zero.
    """

    points: NDArray[np.int64]
    states: Array
    by: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.points.size == 0 or self.points[0] != 0 or np.any(np.diff(self.points) <= 0):
            raise SpecError("start", f"at {self.points.tolist()[:5]}.", "Allowed: 0 first, then increasing.")
        if self.states.shape[0] != self.points.size:
            raise SpecError("start", f"{self.states.shape[0]} states at {self.points.size} points.")

    @classmethod
    def of(cls, given: float | Array | Start, one: Array) -> Start:
        """A start from a uniform temperature [K], one state, or itself.

        Parameters
        ----------
        given : float, (r,) ndarray or Start
        one : (r,) ndarray
            The uniform field of 1 K.
        """
        if isinstance(given, Start):
            if given.states.shape[1] != one.size:
                raise SpecError("start", f"{given.states.shape[1]} unknowns for a model of {one.size}.")
            return given
        state = np.asarray(given, dtype=float)
        if state.shape not in ((), one.shape):
            raise SpecError("start", f"a state of shape {state.shape} for a model of {one.size} unknowns.")
        return cls(np.zeros(1, dtype=np.int64), (state * one if state.ndim == 0 else state)[None, :])

    def derivatives(self, parameters: tuple[str, ...]) -> Array:
        """Derivatives to some parameters, (S, r, p)."""
        found = np.zeros((*self.states.shape, len(parameters)))
        for column, name in enumerate(parameters):
            if name in self.by:
                found[:, :, column] = self.by[name]
        return found

    def rows(self) -> dict[int, int]:
        """Row of each point of the grid at which a state is given."""
        return {int(point): row for row, point in enumerate(self.points)}
