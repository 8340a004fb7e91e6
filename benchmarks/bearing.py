"""Bearing equilibrium against a plain per-ball scipy loop, as ratios within one run.

The plain solver is the textbook way: an outer ``scipy.optimize.root`` over the
ring's displacements, an inner one for each ball, and the friction of each
contact summed on a 41 x 21 midpoint grid. Both must agree before a ratio is
printed.

Run: ``python benchmarks/bearing.py``
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import root
from scipy.special import ellipe, ellipk

from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_set import (
    BearingSet,
    MountedBearing,
    solve_bearing,
    solve_bearing_set,
    uniform_temperatures,
)
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.hertz import INNER
from spindle_fem.physics.bearings.mounting import ExternalLoad

FRONT = BearingGeometry(
    14.2875e-3, 30, 165e-3, math.radians(15.0), 0.52, 0.52, bore_diameter=0.14, outer_diameter=0.19
)
REAR = replace(
    FRONT,
    ball_diameter=13.494e-3,
    ball_count=27,
    pitch_diameter=142.5e-3,
    bore_diameter=0.12,
    outer_diameter=0.165,
)
GREASE = Lubricant(21e-6, 4.7e-6)
SPEED = 3000.0 * math.pi / 30.0
AXIAL, RADIAL = 1137.2, 300.0
LOAD = ExternalLoad(AXIAL, RADIAL)
WARM = 313.15


def main() -> None:
    """Measure, compare, print one JSON object."""
    timings = {
        "without_friction_s": best(lambda: solve_bearing(FRONT, SPEED, LOAD, control="outer")),
        "with_friction_s": best(
            lambda: solve_bearing(FRONT, SPEED, LOAD, lubricant=GREASE, temperature=WARM)
        ),
        "axial_load_only_s": best(lambda: solve_bearing(FRONT, SPEED, AXIAL, lubricant=GREASE)),
        "five_bearings_ten_speeds_s": best(sweep, repeats=3),
    }
    plain = PlainBearing(FRONT)
    begin = time.perf_counter()
    displacement, loads = plain.solve(AXIAL, RADIAL, SPEED)
    timings["plain_without_friction_s"] = time.perf_counter() - begin
    begin = time.perf_counter()
    plain.friction(displacement, SPEED)
    timings["plain_friction_of_one_state_s"] = time.perf_counter() - begin

    ours = solve_bearing(FRONT, SPEED, LOAD, control="outer")
    difference = float(np.max(np.abs(ours.balls.load[:, INNER] / loads - 1.0)))
    if difference > 5e-3:
        raise SystemExit(f"the two solvers differ by {difference:.2g} of the inner load: no ratio")
    # six unknowns a ball: the plain loop needs at least seven friction integrals for one Newton step
    newton_step = 7.0 * timings["plain_friction_of_one_state_s"]
    report = {
        **timings,
        "load_difference": difference,
        "speedup_without_friction": timings["plain_without_friction_s"] / timings["without_friction_s"],
        "speedup_with_friction_at_least": (timings["plain_without_friction_s"] + newton_step)
        / timings["with_friction_s"],
    }
    print(json.dumps(report, indent=2))


def best(action: Callable[[], object], repeats: int = 15) -> float:
    """Shortest of several warm runs, s."""
    action()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        action()
        times.append(time.perf_counter() - begin)
    return min(times)


def sweep() -> None:
    """The five bearings of the reference spindle at ten speeds."""
    front = BearingSet(
        (
            MountedBearing("F1", FRONT, 1, 0.057),
            MountedBearing("F2", FRONT, 1, 0.081),
            MountedBearing("F3", FRONT, -1, 0.125),
        ),
        preload=1137.2,
    )
    rear = BearingSet(
        (MountedBearing("R1", REAR, 1, 0.441), MountedBearing("R2", REAR, -1, 0.473)), preload=1137.2
    )
    for rpm in range(0, 4501, 500):
        speed = rpm * math.pi / 30.0
        solve_bearing_set(front, speed, 1750.0, uniform_temperatures(3, WARM), lubricant=GREASE)
        solve_bearing_set(rear, speed, 0.0, uniform_temperatures(2, WARM), lubricant=GREASE)


class PlainBearing:
    """Ball by ball with scalar mathematics and ``scipy.optimize.root``."""

    def __init__(self, geometry: BearingGeometry) -> None:
        self.geometry = geometry
        self.contacts = [self._contact(side) for side in (0, 1)]

    def _contact(self, side: int) -> tuple[float, float, float]:
        """Load constant and ellipse constants at the free contact angle."""
        g = self.geometry
        curvature = (g.groove_curvature_inner, g.groove_curvature_outer)[side]
        gamma = g.diameter_ratio * math.cos(g.contact_angle)
        rolling = 2 * gamma / (1 - gamma) if side == 0 else -2 * gamma / (1 + gamma)
        total = (4 - 1 / curvature + rolling) / g.ball_diameter
        target = (1 / curvature + rolling) / (g.ball_diameter * total)

        def excess(kappa: float) -> float:
            m = 1 - 1 / kappa**2
            first, second = ellipk(m), ellipe(m)
            return float(((kappa**2 + 1) * second - 2 * first) / ((kappa**2 - 1) * second) - target)

        kappa = float(root(lambda x: [excess(float(x[0]))], [7.0]).x[0])
        m = 1 - 1 / kappa**2
        first, second = float(ellipk(m)), float(ellipe(m))
        major = (2 * kappa**2 * second / math.pi) ** (1 / 3)
        approach = 2 * first / math.pi * (math.pi / (2 * kappa**2 * second)) ** (1 / 3)
        scale = 1.5 * g.contact_compliance / total
        length = scale ** (1 / 3)
        return (approach * length**2 * total / 2) ** -1.5, major * length, major / kappa * length

    def _ball(self, a1: float, a2: float, speed: float) -> tuple[float, float, list[float], float]:
        """Axial and radial force on the ring, centre, and inner load of one ball."""
        g = self.geometry
        rest = [(f - 0.5) * g.ball_diameter for f in (g.groove_curvature_inner, g.groove_curvature_outer)]

        def state(x: np.ndarray) -> tuple[float, ...]:
            li, lo = math.hypot(a1 - x[0], a2 - x[1]), math.hypot(x[0], x[1])
            si, ci, so, co = (a1 - x[0]) / li, (a2 - x[1]) / li, x[0] / lo, x[1] / lo
            qi = self.contacts[0][0] * max(li - rest[0], 0.0) ** 1.5
            qo = self.contacts[1][0] * max(lo - rest[1], 0.0) ** 1.5
            ratio = g.diameter_ratio
            tangent = so / (co + ratio)
            beta = math.atan(tangent)
            orbital = (1 - ratio * ci) / (1 + ci * co + si * so) * speed
            sums = (co + tangent * so) / (1 + ratio * co) + (ci + tangent * si) / (1 - ratio * ci)
            spin = speed / (ratio * math.cos(beta) * sums)
            moment = g.ball_inertia * orbital * spin * math.sin(beta)
            centrifugal = 0.5 * g.ball_mass * g.pitch_diameter * orbital**2
            friction = 2 * moment / g.ball_diameter
            radial = qo * co - friction * so - qi * ci - centrifugal
            axial = qo * so + friction * co - qi * si
            return radial, axial, qi * si, qi * ci, qi

        guess = np.array([a1, a2]) * (rest[1] / (rest[0] + rest[1]))
        scaled = root(lambda y: [v / 100.0 for v in state(guess + 1e-5 * y)[:2]], np.zeros(2), tol=1e-12)
        place = guess + 1e-5 * scaled.x
        _, _, axial, radial, load = state(place)
        return axial, radial, list(place), load

    def solve(self, axial: float, radial: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (axial and radial in µm, tilt in 10 µrad) and inner loads."""
        g = self.geometry
        azimuth = 2 * math.pi * np.arange(g.ball_count) / g.ball_count
        lever = g.inner_groove_centre_radius

        def forces(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            total, loads = np.zeros(3), np.empty(g.ball_count)
            for ball, angle in enumerate(azimuth):
                a1, a2 = self._distances(q, angle)
                push, pull, _, loads[ball] = self._ball(a1, a2, speed)
                total += [push, pull * math.cos(angle), push * lever * math.cos(angle)]
            return total, loads

        goal = np.array([axial, radial, 0.0])
        scale = np.array([axial, axial, axial * lever])
        # the inner solutions carry rounding, so the differences need a step above it
        solution = root(
            lambda q: (forces(q)[0] - goal) / scale,
            np.array([15.0, 8.0, -40.0]),
            tol=1e-8,
            options={"eps": 1e-4},
        )
        return solution.x, forces(solution.x)[1]

    def _distances(self, q: np.ndarray, angle: float) -> tuple[float, float]:
        g = self.geometry
        distance = g.curvature_centre_distance
        lever = g.inner_groove_centre_radius
        a1 = distance * math.sin(g.contact_angle) + 1e-6 * (q[0] + lever * 10.0 * q[2] * math.cos(angle))
        return a1, distance * math.cos(g.contact_angle) + 1e-6 * q[1] * math.cos(angle)

    def friction(self, q: np.ndarray, speed: float) -> float:
        """Sliding power of all contacts at race-control speeds, point by point, W."""
        g = self.geometry
        viscosity = float(GREASE.dynamic_viscosity(WARM))
        power = 0.0
        for ball in range(g.ball_count):
            a1, a2 = self._distances(q, 2 * math.pi * ball / g.ball_count)
            _, _, _, load = self._ball(a1, a2, speed)
            for side in (0, 1):
                major = self.contacts[side][1] * load ** (1 / 3)
                minor = self.contacts[side][2] * load ** (1 / 3)
                peak = 1.5 * load / (math.pi * major * minor)
                for i in range(41):
                    q_node = -1 + (2 * i + 1) / 41
                    slide = abs(0.2 * q_node) + 1e-6
                    for j in range(21):
                        t_node = -1 + (2 * j + 1) / 21
                        inside = 1 - q_node**2 - t_node**2
                        if inside <= 0:
                            continue
                        pressure = peak * math.sqrt(inside)
                        rise = (1 + 5.1e-9 * pressure) ** 0.68
                        thick = math.exp(-9.67 + (math.log(viscosity) + 9.67) * rise)
                        stress = 1 / (0.9e-6 / (thick * slide) + 1 / (0.07 * pressure))
                        power += stress * slide * major * minor * (2 / 41) * (2 / 21)
        return power


if __name__ == "__main__":
    main()
