"""The fixed point of a stage: what its answers say about the next input and about what is left."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.mesh.linear_solvers import largest
from spindle_fem.model.mesh.threads import combined, dots

Array = NDArray[np.float64]

# Differences of answers that are mixed, those of earlier stages among them.
DIFFERENCES = 6
# Differences that are combinations of others but for this share (squared) say nothing of their own.
INDEPENDENT = 1e-4
# Share of a change that another answer leaves, while nothing is known of it.
UNKNOWN_CONTRACTION = 1.0
# Shares are of a change's largest entry, seen along the changes that there were: others may leave more.
CAUTION = 2.0
# A contraction that is better than in earlier stages is believed only so far.
SLOWEST_GAIN = 0.5


class StageIteration:
    """Anderson mixing over the stages of time steps, and a measured bound of its contraction.

    What the loads make of a change of the temperatures is nearly the same from one stage to the next:
    differences of inputs and answers that earlier stages left are mixed too.

    The contraction is read from the same differences: an answer that moves by a share of what its
    input moved by leaves at most that share of a change, whatever was mixed. The largest share of a
    stage counts, and that of earlier stages decays slowly. Longer steps weigh storage less: the share
    then grows at most as the step does.

    Sources: Walker & Ni (2011), SIAM J. Numer. Anal. 49, 1715-1735; differences kept over time steps:
    Degroote et al. (2009), Comput. Struct. 87, 793-801.

    >>> linear = lambda x: np.array([0.5, 0.2]) * x + 1.0
    >>> iteration, put = StageIteration(), np.zeros(2)
    >>> iteration.begin(size=1.0)
    >>> for _ in range(3):
    ...     change = iteration.answered(put, linear(put))
    ...     put = iteration.mixed()
    >>> put.round(9).tolist()
    [2.0, 1.25]
    >>> iteration.contraction
    1.0
    >>> iteration.begin(size=1.0)
    >>> iteration.answered(np.zeros(2), linear(np.zeros(2)))
    1.0
    >>> iteration.mixed().round(9).tolist()
    [2.0, 1.25]
    """

    def __init__(self) -> None:
        self._count = 0
        self._changes: Array | None = None
        self._turns: Array | None = None
        self._gram = np.zeros((DIFFERENCES, DIFFERENCES))
        self._last: tuple[Array, Array] | None = None
        self._size = 0.0
        self._expected = self._largest = UNKNOWN_CONTRACTION

    @property
    def contraction(self) -> float:
        """Share of a change that the next answer of this stage leaves, at most."""
        return min(CAUTION * self._share, UNKNOWN_CONTRACTION)

    @property
    def _share(self) -> float:
        return max(self._expected, self._largest)

    def begin(self, size: float) -> None:
        """Begin a stage of a step of this length, [s]."""
        longer = max(size / self._size, 1.0) if self._size else 1.0
        self._expected = min(longer * self._share, UNKNOWN_CONTRACTION)
        self._size, self._largest, self._last = size, 0.0, None

    def forget(self) -> None:
        """Forget what earlier stages found: other inputs, another coupling."""
        self._count, self._last, self._size = 0, None, 0.0
        self._expected = self._largest = UNKNOWN_CONTRACTION

    def answered(self, put: Array, answer: Array) -> float:
        """Change from an input of the fixed point to its answer, (n,) both, [K]; measures the contraction."""
        if self._last is not None:
            moved = largest(put - self._last[0])
            share = largest(answer - self._last[1]) / moved if moved > 0.0 else 0.0
            if self._largest == 0.0:
                self._expected *= SLOWEST_GAIN
            self._largest = max(self._largest, share)
            self._add(put - self._last[0], answer - self._last[1])
        self._last = (put, answer)
        return largest(answer - put)

    def mixed(self) -> Array:
        """Combination of answers whose distances from what was put in cancel best, (n,)."""
        put, answer = self._last
        known = min(self._count, DIFFERENCES)
        if not known:
            return answer
        along = dots(self._turns[:known], answer - put)
        weights = np.linalg.lstsq(self._gram[:known, :known], along, rcond=INDEPENDENT)[0]
        return answer - combined(weights, self._changes[:known])

    def _add(self, put: Array, answer: Array) -> None:
        """Keep the differences of two answers and of their distances, to one length; the oldest goes."""
        turn = answer - put
        length = float(np.sqrt(turn @ turn))
        if length == 0.0:
            return
        if self._turns is None:
            self._changes, self._turns = np.zeros((2, DIFFERENCES, len(turn)))
        place = self._count % DIFFERENCES
        self._count += 1
        self._changes[place], self._turns[place] = answer / length, turn / length
        self._gram[place] = self._gram[:, place] = dots(self._turns, self._turns[place])
