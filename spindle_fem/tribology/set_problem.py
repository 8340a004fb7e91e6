"""A set as one ball system with its load, and where its rings stand at rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from spindle_fem.errors import NoEquilibriumError
from spindle_fem.tribology.ball_system import BallSystem
from spindle_fem.tribology.hertz import mean_load_constant
from spindle_fem.tribology.mounting import BearingSet
from spindle_fem.tribology.preload import tandem_approach
from spindle_fem.tribology.race_control import static_evaluation

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SetProblem:
    """Ball rows of every bearing, joined, with the load on the displacements.

    ``ball_load`` is the size of the largest ball load at rest, N; ``spring``
    adds the floating outer rings as the last displacement; ``ring_growth`` is
    where the raceways of bearings with fits are looked for, m.
    """

    bearing_set: BearingSet
    rows: list[dict[str, FloatArray]]
    system: BallSystem
    load: FloatArray
    spring: bool
    ball_load: float
    ring_growth: FloatArray


def start_displacement(problem: SetProblem, where: str) -> FloatArray:
    """Displacements at rest under the axial part of the load."""
    system, load = problem.system, problem.load
    displacement = _unloaded(problem)
    axial = problem.spring or not problem.bearing_set.has_counter_bearings

    def approach_of(side: int, force: float) -> float:
        group = [b.geometry for b in problem.bearing_set.bearings if b.orientation == side]
        return tandem_approach(tuple(group), force) if len(group) else 0.0

    if axial:
        side = 1 if not problem.spring else None
        if problem.spring:
            front = problem.bearing_set.preload + load[0]
            if front < 0.0:
                raise NoEquilibriumError(
                    where, f"thrust {load[0]:g} N lifts the set off its spring of "
                    f"{problem.bearing_set.preload:g} N.", "Raise the preload or lower the thrust.",
                )  # fmt: skip
            offsets = system.start[:, 0] - _free_axial(problem)
            sides = _row_sides(problem)
            displacement[0] = approach_of(1, front) - float(offsets[sides > 0].mean())
            rear = approach_of(-1, problem.bearing_set.preload) - float(offsets[sides < 0].mean())
            displacement[-1] = rear + displacement[0]
        else:
            side = problem.bearing_set.bearings[0].orientation
            if side * load[0] < 0.0:
                raise NoEquilibriumError(
                    where, f"thrust {load[0]:g} N unloads bearings that all face the other way.",
                    "Turn the thrust round, or add a counter bearing.",
                )  # fmt: skip
            group = tuple(b.geometry for b in problem.bearing_set.bearings)
            alpha_free = load[0] == 0.0 and problem.ball_load > 0.0
            approach = -group[0].curvature_centre_distance * math.sin(group[0].contact_angle)
            displacement[0] = side * (approach if alpha_free else tandem_approach(group, abs(load[0])))
    else:
        displacement[0] = _balanced_shift(problem, load[0], where)
    if len(problem.rows[0]["weight"]) > 1 and load[1] != 0.0:
        geometry = problem.bearing_set.bearings[0].geometry
        count = float(system.weight.sum())
        share = 4.37 * abs(load[1]) / (count * math.cos(geometry.contact_angle))
        guess = (share / mean_load_constant(geometry)) ** (2.0 / 3.0)
        loosened = 0.0 if load[0] or problem.bearing_set.preload else 1.0
        displacement[1] = math.copysign(guess * (loosened or 0.3), load[1])
    return displacement


def _unloaded(problem: SetProblem) -> FloatArray:
    """No motion of the shaft; raceways grown as expected."""
    displacement = np.zeros(problem.system.axial_map.shape[1])
    if problem.system.rings is not None:
        displacement[problem.system.rings.columns] = problem.ring_growth
    return displacement


def _free_axial(problem: SetProblem) -> FloatArray:
    """BD sin α_0 of every row, m."""
    values = [b.geometry.curvature_centre_distance * math.sin(b.geometry.contact_angle)
              for b in problem.bearing_set.bearings]  # fmt: skip
    return np.repeat(values, [len(row["weight"]) for row in problem.rows])


def _row_sides(problem: SetProblem) -> NDArray[np.int64]:
    sides = [bearing.orientation for bearing in problem.bearing_set.bearings]
    return np.repeat(sides, [len(row["weight"]) for row in problem.rows])


def _balanced_shift(problem: SetProblem, thrust: float, where: str) -> float:
    """Shaft displacement of a rigid set that balances the thrust at rest, m."""
    system, base = problem.system, _unloaded(problem)
    direction = np.zeros_like(base)
    direction[0] = 1.0

    def excess(shift: float) -> float:
        axial, radial = system.groove_distances(base + direction * shift)
        force = static_evaluation(system, axial, radial).ring_force[:, 0]
        return float(system.axial_map[:, 0] @ (system.weight * force)) - thrust

    if excess(0.0) == 0.0:
        return 0.0
    reach = 1e-6
    largest = 20.0 * float(np.max(system.rest_length))
    while excess(-reach) * excess(reach) > 0.0:
        reach *= 2.0
        if reach > largest:
            raise NoEquilibriumError(
                where, f"thrust {thrust:g} N is more than the set can carry.", "Lower the thrust."
            )
    return float(brentq(excess, -reach, reach, xtol=1e-15, rtol=1e-13))
