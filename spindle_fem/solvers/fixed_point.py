"""One fixed-point iteration for every steady state of coupled heat, films and temperature.

Far from the fixed point the iteration is relaxed, near it Anderson's
combination of the last iterates takes over.

Source: Walker & Ni (2011), SIAM J. Numer. Anal. 49, 1715-1735.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import ConvergenceError, NoEquilibriumError, OutOfValidityError

Array = NDArray[np.float64]
REFUSED = (NoEquilibriumError, OutOfValidityError)


@dataclass(frozen=True, slots=True)
class Iteration:
    """Settings of a fixed-point iteration.

    Attributes
    ----------
    relaxation : float
        Share of the way that a step goes while the change is above ``mixing_below``.
    mixing_below : float
        Largest change from which iterates are combined; 0 never combines them.
    depth : int
        Differences of iterates that are combined.
    most : int
        Steps until the iteration is given up.
    retreats : int
        How often a refused state is left by going half the way back.
    """

    relaxation: float
    mixing_below: float
    depth: int = 5
    most: int = 100
    retreats: int = 0


@dataclass(slots=True)
class Mixing:
    """The next iterate from those so far.

    >>> mixing = Mixing(Iteration(relaxation=1.0, mixing_below=np.inf))
    >>> x = np.array([0.0])
    >>> for _ in range(3):
    ...     x = mixing.next(x, 3.0 + 0.5 * x)
    >>> float(x[0])
    6.0
    """

    iteration: Iteration
    inputs: list[Array] = field(default_factory=list)
    outputs: list[Array] = field(default_factory=list)

    def restart(self) -> None:
        """Forget the iterates so far."""
        self.inputs, self.outputs = [], []

    def next(self, given: Array, found: Array) -> Array:
        """Next iterate, from an iterate and its image."""
        if float(np.abs(found - given).max(initial=0.0)) > self.iteration.mixing_below:
            self.restart()
            return given + self.iteration.relaxation * (found - given)
        kept = self.iteration.depth + 1
        self.inputs = [*self.inputs, given][-kept:]
        self.outputs = [*self.outputs, found][-kept:]
        if len(self.inputs) == 1:
            return found
        outputs = np.array(self.outputs)
        residuals = outputs - np.array(self.inputs)
        weights, *_ = np.linalg.lstsq(np.diff(residuals, axis=0).T, residuals[-1], rcond=1.0e-10)
        return found - np.diff(outputs, axis=0).T @ weights


def fixed_point(
    respond: Callable[[Array], Array],
    settled: Callable[[Array, Array], bool],
    start: Array,
    iteration: Iteration,
    name: str,
) -> tuple[Array, int]:
    """The state that is its own image.

    Parameters
    ----------
    respond : callable
        Image of a state (n,); may raise one of ``REFUSED`` for a state that has none.
    settled : callable
        Whether a state and its image are near enough; may raise where the iteration leads nowhere.
    start : (n,) ndarray
    name : str
        What is solved, for messages.

    Returns
    -------
    state : (n,) ndarray
        The last one that was given to ``respond``.

    Raises
    ------
    ConvergenceError
        Not settled within the steps.
    NoEquilibriumError, OutOfValidityError
        The start is refused, or too many states are.
    """
    mixing, retreats = Mixing(iteration), 0
    state, before, change = start, None, np.inf
    for step in range(1, iteration.most + 1):
        try:
            found = respond(state)
        except REFUSED:
            if before is None or retreats == iteration.retreats:
                raise
            retreats += 1
            mixing.restart()
            state = 0.5 * (before + state)
            continue
        if settled(state, found):
            return state, step
        change = float(np.abs(found - state).max(initial=0.0))
        before, state = state, mixing.next(state, found)
    raise ConvergenceError(
        name,
        f"heat, films and temperatures still change by {change:.2g} after {iteration.most} iterations.",
        "Friction heat may rise with temperature faster than it is carried away; lower speed or preload.",
    )
