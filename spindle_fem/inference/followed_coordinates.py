"""What a watch knows of a machine's coordinates: where they are, how surely, and what it forgets again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from spindle_fem.inference import tuned
from spindle_fem.inference.belief import Belief, Coordinate
from spindle_fem.inference.coordinate_names import MISDESCRIBED_IN_PREFIX, OF_ONE_RECORDING, START_PREFIX

Array = NDArray[np.float64]

# Coordinates of the recording itself that are followed: temperatures at its start, its clocks.
_OWN_HERE = (START_PREFIX, MISDESCRIBED_IN_PREFIX)


class FollowedCoordinates:
    """The machine's own coordinates, wanderings of some of them, and those of where a recording begins.

    Numbers are in units of the coordinates' standard deviations; what wanders comes on top of a coordinate.

    Parameters
    ----------
    belief : Belief
        Only the machine's own coordinates count.
    wandering : sequence of str
        Coordinates that are others from hour to hour beside what is known of them: factors on the heat of
        what switches within rows.

    Attributes
    ----------
    coordinates : tuple of n Coordinate
    position : (p,) ndarray
        Of the machine's own, of what wanders, of the start.
    covariance : (p, p) ndarray
    """

    def __init__(self, belief: Belief, wandering: Sequence[str] = ()) -> None:
        chosen = [i for i, c in enumerate(belief.coordinates) if not c.name.startswith(OF_ONE_RECORDING)]
        self.coordinates: tuple[Coordinate, ...] = tuple(belief.coordinates[i] for i in chosen)
        own = np.linalg.inv(belief.root.T @ belief.root)[np.ix_(chosen, chosen)]
        wanders = [i for i, c in enumerate(self.coordinates) if c.name in wandering]
        size = len(chosen)
        # What a coordinate is with what wanders on top of it, (n, p).
        self._sums = np.zeros((size, size + len(wanders)))
        self._sums[:, :size] = np.eye(size)
        for place, index in enumerate(wanders, size):
            self._sums[index, place] = tuned.SOURCE_WANDER / self.coordinates[index].sigma
        self._own, self._lasting = size, size + len(wanders)
        self._usual = np.append(belief.mean[chosen], np.zeros(len(wanders)))
        self._prior = block_diag(own, np.eye(len(wanders)))
        times = [tuned.FORGETTING_TIME] * size + [tuned.WANDER_TIME] * len(wanders)
        self._forgotten = np.array(times)
        self.position, self.covariance = self._usual.copy(), self._prior.copy()

    @property
    def names(self) -> list[str]:
        """Names of the coordinates, (n,)."""
        return [c.name for c in self.coordinates]

    @property
    def values(self) -> dict[str, float]:
        """Values of the coordinates where they are now, by name."""
        now = self._sums @ self.position
        return {c.name: c.at(u) for c, u in zip(self.coordinates, now, strict=True)}

    def by_number(self, slopes: Array) -> Array:
        """Derivatives to the numbers (..., p) from those to the values of the coordinates (..., n)."""
        sigma = np.array([c.sigma for c in self.coordinates])
        return (slopes * sigma) @ self._sums

    def begin(self, coordinates: Sequence[Coordinate]) -> None:
        """Begin with a recording, of whose own coordinates some are followed."""
        starts = tuple(c for c in coordinates if c.name.startswith(_OWN_HERE))
        self.coordinates = (*self.coordinates[: self._own], *starts)
        lasting = slice(self._lasting)
        self.position = np.append(self.position[lasting], np.zeros(len(starts)))
        self.covariance = block_diag(self.covariance[lasting, lasting], np.eye(len(starts)))
        self._sums = block_diag(self._sums[: self._own, lasting], np.eye(len(starts)))

    def move(self, by: Array, covariance: Array, elapsed: float) -> dict[str, float]:
        """Take what readings taught over some time, s, and forget a little of it.

        Parameters
        ----------
        by : (p,) ndarray
        covariance : (q, q) ndarray
            Of the numbers, then of whatever else the readings depend on; what is forgotten is, in place.

        Returns
        -------
        mapping of str to float
            By how much the value of each coordinate changed.
        """
        lasting, kept = slice(self._lasting), np.exp(-elapsed / self._forgotten)
        before, after = self.position, self.position + by
        after[lasting] = self._usual + kept * (after[lasting] - self._usual)
        lowest, highest = (np.array([getattr(c, end) for c in self.coordinates]) for end in ("low", "high"))
        free = np.full(self._lasting - self._own, np.inf)
        bounds = (np.insert(ends, self._own, sign * free) for ends, sign in ((lowest, -1.0), (highest, 1.0)))
        self.position = np.clip(after, *bounds)
        covariance[lasting] *= kept[:, None]
        covariance[:, lasting] *= kept
        # Own coordinates and what wanders are forgotten at different rates, but know nothing of each other.
        covariance[lasting, lasting] += self._prior * (1.0 - np.outer(kept, kept))
        size = len(self.position)
        self.covariance = covariance[:size, :size]
        moved = self._sums @ (self.position - before)
        return {c.name: c.sigma * u for c, u in zip(self.coordinates, moved.tolist(), strict=True)}
