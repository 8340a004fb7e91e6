"""Inputs over time: samples that are held or joined by straight lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import RecordingError, did_you_mean

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class InputHistory:
    """Inputs that drive a machine, at strictly increasing times.

    Attributes
    ----------
    times : (N,) float64 ndarray, [s]
    values : (N, m) float64 ndarray
        SI. Finite.
    held : (m,) bool ndarray
        True: the value holds until the next time; False: straight line.
    """

    times: Array
    names: tuple[str, ...]
    values: Array
    held: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name, kind in (("times", np.float64), ("values", np.float64), ("held", np.bool_)):
            array = np.array(getattr(self, name), dtype=kind)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.values.shape != (self.times.size, len(self.names)) or self.held.shape != (len(self.names),):
            raise RecordingError(
                "inputs", f"shape {self.values.shape} does not fit {self.times.size} times of {self.names}."
            )
        if np.any(np.diff(self.times) <= 0.0) or not np.all(np.isfinite(self.times)):
            raise RecordingError("inputs", "times must increase strictly.")
        if not np.all(np.isfinite(self.values)):
            raise RecordingError("inputs", "an input value is missing.", "Bridge or cut the gap first.")

    @classmethod
    def constant(cls, times: Array, inputs: Mapping[str, float]) -> InputHistory:
        """Inputs that do not change."""
        values = np.tile(np.array(list(inputs.values()), dtype=float), (len(times), 1))
        return cls(times, tuple(inputs), values, np.ones(len(inputs), dtype=bool))

    def column(self, name: str) -> int:
        """Position of an input; an unknown name is refused."""
        if name not in self.names:
            raise RecordingError(
                "inputs",
                f'the machine needs the input "{name}", which nothing drives.',
                did_you_mean(name, self.names),
            )
        return self.names.index(name)

    def cut(self, start: int, stop: int) -> InputHistory:
        """The samples ``start <= k < stop``."""
        return InputHistory(self.times[start:stop], self.names, self.values[start:stop], self.held)

    def ends(self) -> tuple[Array, Array]:
        """Values at the start and at the end of each interval, both ``(N - 1, m)``."""
        start = self.values[:-1]
        return start, np.where(self.held, start, self.values[1:])

    def at_first(self) -> dict[str, float]:
        """Inputs at the first time."""
        return dict(zip(self.names, self.values[0].tolist(), strict=True))
