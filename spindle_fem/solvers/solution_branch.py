"""A branch of fixed points followed in a parameter, to the fold where it turns back.

Fixed points x = G(x, p) of positive quantities are followed by pseudo-arclength continuation in
(ln x, p / p_end): the parameter may turn while the arc goes on, so that the fold is a regular point.

Source: Keller (1977), in Applications of Bifurcation Theory, Academic Press, 359-384;
Broyden (1965), Math. Comp. 19, 577-593.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpindleFemError

Array = NDArray[np.float64]
Respond = Callable[[Array, float], Array]
# Largest residual of ln x at a point of the branch.
TOLERANCE = 1.0e-6
# The same of points that only lead on.
ON_THE_WAY = 1.0e-4
DIFFERENCE = 1.0e-4
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.3, 1.0, 1.0e-3
# A first step that leads over the fold is taken again in quarters, down to this.
NEAREST_FOLD = 0.05
MOST_CORRECTIONS = 8
MOST_POINTS = 200
# A point that took so many corrections has its derivatives taken anew.
REFRESHED_FROM = 4
# Relative, of the parameter at the fold.
FOLD_TOLERANCE = 2.0e-5


@dataclass(frozen=True, slots=True)
class Branch:
    """A branch of solutions and where it ends.

    Attributes
    ----------
    parameter : (n,) ndarray
        Of every point, in their order.
    states : (n, k) ndarray
    end : {"fold", "end", "refused"}
        Whether it turned back, reached the end, or came where there is no response.
    limit : float
        Largest parameter reached.
    top : (k,) ndarray
        State there.
    reason : str
        Why there was no response; of a fold, why it is not that of its own state.
    """

    parameter: Array
    states: Array
    end: Literal["fold", "end", "refused"]
    limit: float
    top: Array
    reason: str = ""


def follow_branch(respond: Respond, state: Array, start: float, end: float, *, weak: int = 0) -> Branch:
    """Follow fixed points from a parameter towards a larger one.

    Parameters
    ----------
    respond : callable
        G(x (n, k), p) -> (n, k), positive, n states at once; a ``SpindleFemError`` says that there is no
        response.
    state : (k,) ndarray
        Near the fixed point at ``start``.
    weak : int
        So many of the last quantities move the response little: no differences are taken in them, their
        derivatives are learned on the way.

    Raises
    ------
    SpindleFemError
        No fixed point at ``start``.

    >>> # x = 1 + p x² turns at p = 1/4
    >>> branch = follow_branch(lambda x, p: 1.0 + p * x**2, np.array([1.0]), 0.01, 1.0)
    >>> branch.end, round(branch.limit, 4)
    ('fold', 0.25)
    """
    return _Walk(respond, end, weak).go(np.append(np.log(state), start / end))


class _NoPointError(Exception):
    """The correction did not reach the branch."""


class _Walk:
    def __init__(self, respond: Respond, end: float, weak: int) -> None:
        self.respond, self.end, self.weak = respond, end, weak
        self.jacobian: Array | None = None
        # of the last point reached
        self.left: Array = np.empty(0)

    def residual(self, point: Array) -> Array:
        """Residual of ln x = ln G, (k,)."""
        return self.residuals(point[None, :-1], point[-1])[0]

    def residuals(self, states: Array, parameter: float) -> Array:
        """Residuals of several states ln x (n, k) at one parameter."""
        return states - np.log(self.respond(np.exp(states), float(parameter) * self.end))

    def differentiate(self, point: Array, residual: Array) -> None:
        """Take the derivatives (k, k + 1) anew."""
        size = len(residual)
        if self.jacobian is None:
            self.jacobian = np.eye(size, size + 1)
        strong = size - self.weak
        moved = point[:-1] + DIFFERENCE * np.eye(strong, size)
        self.jacobian[:, :strong] = (self.residuals(moved, point[-1]) - residual).T / DIFFERENCE
        further = np.append(point[:-1], point[-1] + DIFFERENCE)
        self.jacobian[:, size] = (self.residual(further) - residual) / DIFFERENCE

    def correct(self, guess: Array, across: Array, tolerance: float = TOLERANCE) -> tuple[Array, int]:
        """The point of the branch in the plane through a guess, and how many corrections it took."""
        point, residual = guess, self.residual(guess)
        for count in range(MOST_CORRECTIONS):
            if np.abs(residual).max() < tolerance:
                self.left = residual
                return point, count
            if count == MOST_CORRECTIONS // 2:
                self.differentiate(point, residual)
            step = np.linalg.solve(
                np.vstack([self.jacobian, across]), -np.append(residual, across @ (point - guess))
            )
            point = point + step
            after = self.residual(point)
            change = after - residual - self.jacobian @ step
            self.jacobian = self.jacobian + np.outer(change, step) / (step @ step)
            residual = after
        raise _NoPointError

    def tangent(self, along: Array) -> Array:
        """Unit direction of the branch, on the side of ``along``."""
        last = np.zeros(len(along))
        last[-1] = 1.0
        direction = np.linalg.solve(np.vstack([self.jacobian, along]), last)
        return direction / np.linalg.norm(direction)

    def go(self, guess: Array) -> Branch:
        upwards = np.zeros(len(guess))
        upwards[-1] = 1.0
        self.differentiate(guess, self.residual(guess))
        try:
            point, _ = self.correct(guess, upwards)
        except _NoPointError:
            raise SpindleFemError(
                "fixed point", f"none found at {guess[-1] * self.end:g}.", "Start nearer to it."
            ) from None
        points, tangent, step, reason = [point], self.tangent(upwards), FIRST_STEP, "steps without end"
        turned = False
        while step > SHORTEST_STEP and len(points) < MOST_POINTS:
            if points[-1][-1] + step * tangent[-1] > 1.0 and tangent[-1] > 0.0:
                try:
                    last, _ = self.correct(
                        points[-1] + (1.0 - points[-1][-1]) / tangent[-1] * tangent, upwards
                    )
                    return self.branch([*points, last], "end", last)
                except (_NoPointError, SpindleFemError):
                    step *= 0.5
                    continue
            try:
                point, count = self.correct(points[-1] + step * tangent, tangent, ON_THE_WAY)
            except (_NoPointError, SpindleFemError) as error:
                reason, step = str(error), 0.5 * step
                continue
            points.append(point)
            if point[-1] < points[-2][-1]:
                if len(points) == 2 and not turned:
                    points.pop()
                    if step > NEAREST_FOLD:
                        # a start just below the fold: nearer points tell where it turns
                        step *= 0.25
                    else:
                        # near a fold small errors of the derivatives turn the tangent round
                        tangent, turned = (points[0] - point) / np.linalg.norm(points[0] - point), True
                    continue
                return self.branch(points, "fold", self.fold(points))
            if count >= REFRESHED_FROM:
                self.differentiate(point, self.left)
            tangent = self.tangent(points[-1] - points[-2])
            step = min(LONGEST_STEP, step * (1.5 if count <= 3 else 0.7))
        return self.branch(points, "refused", _highest(points), reason)

    def fold(self, points: list[Array]) -> Array:
        """Where the parameter is largest: points are added at the top of a parabola until it foretells."""
        near = [self.nearer(point, self.tangent(points[-1] - points[-2])) for point in points[-3:]]
        if len(near) == 2:
            along = near[1] - near[0]
            try:
                middle, _ = self.correct(0.5 * (near[0] + near[1]), along / np.linalg.norm(along))
            except (_NoPointError, SpindleFemError):
                return near[0]
            near.insert(1, middle)
        best = _highest(near)
        for _ in range(MOST_CORRECTIONS):
            along = near[-1] - near[0]
            along = along / np.linalg.norm(along)
            places = np.array([along @ (point - near[0]) for point in near])
            parabola = np.polyfit(places, [point[-1] for point in near], 2)
            if not parabola[0] < 0.0:
                break
            place = float(np.clip(-0.5 * parabola[1] / parabola[0], places[0], places[-1]))
            share = np.array([np.interp(place, places, column) for column in np.array(near).T])
            try:
                top, _ = self.correct(share + (place - along @ (share - near[0])) * along, along)
            except (_NoPointError, SpindleFemError):
                break
            best = _highest([best, top])
            near = sorted([*near, top], key=lambda point: float(along @ (point - near[0])))
            peak = int(np.clip(max(range(4), key=lambda i: near[i][-1]), 1, 2))
            near = near[peak - 1 : peak + 2]
            if abs(top[-1] - np.polyval(parabola, place)) < FOLD_TOLERANCE * best[-1]:
                break
        return best

    def nearer(self, point: Array, along: Array) -> Array:
        """A point that only led on, as near to the branch as others; itself where that fails."""
        try:
            return self.correct(point, along)[0]
        except (_NoPointError, SpindleFemError):
            return point

    def branch(
        self, points: list[Array], end: Literal["fold", "end", "refused"], top: Array, reason: str = ""
    ) -> Branch:
        rows = np.array([*points, top])
        parameter, states = rows[:, -1] * self.end, np.exp(rows[:, :-1])
        return Branch(parameter[:-1], states[:-1], end, float(parameter[-1]), states[-1], reason)


def _highest(points: Sequence[Array]) -> Array:
    return max(points, key=lambda point: point[-1])
