"""Balls between rings: the rings' stiffness against differences of the forces."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.physics.bearings.ball_system import BallSystem, build_ball_rows, join_rows, solve_bordered
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.hertz import OUTER
from spindle_fem.physics.bearings.race_control import race_control_evaluation, static_centres

SPEED = 300.0
MOVED = np.array([4e-6, 3e-6, -2e-6, 2e-5, -1e-5, 5e-6])


@pytest.fixture(scope="module")
def system() -> BallSystem:
    """Two opposed bearings on one shaft, of 9 and 7 balls of unequal weights; the rear's outer ring
    floats on a spring."""
    geometry = BearingGeometry(14e-3, 9, 90e-3, math.radians(15.0), 0.52, 0.53)
    rows = []
    for balls, side in ((9, 1), (7, -1)):
        azimuth = 2.0 * np.pi * np.arange(balls) / balls
        rows.append(build_ball_rows(geometry, azimuth, 1.0, axial_offset=2e-5, place=(side, 0.04 * side)))
    joined = join_rows(rows, [0, 1, 2, 3, 4])
    floating = np.repeat([[0.0], [1.0]], (9, 7), axis=0)
    return replace(
        joined,
        weight=np.linspace(1.0, 3.0, joined.number),
        axial_map=np.hstack([joined.axial_map, floating]),
        radial_map=np.hstack([joined.radial_map, 0.0 * floating]),
        stiffness=np.array([0.0, 0.0, 0.0, 0.0, 0.0, 3e7]),
    )


def test_stiffness_of_the_rings_is_that_of_differences_of_their_forces(system: BallSystem) -> None:
    speeds = np.full(system.number, SPEED)

    def evaluate(centre, axial, radial):
        return race_control_evaluation(system, speeds, OUTER, centre, axial, radial)

    def solve(displacement, load, maps):
        """With the rings at a displacement; they stay there if the maps are empty."""
        axial, radial = system.groove_distances(displacement)
        moving = maps[0].shape[1]
        held = replace(
            system,
            start=system.start if moving else np.column_stack([axial, radial]),
            axial_map=maps[0],
            radial_map=maps[1],
            stiffness=system.stiffness if moving else None,
        )
        return solve_bordered(
            held, evaluate, static_centres(system, axial, radial), displacement[:moving], load,
            scales=(np.full((system.number, 2), 100.0), np.full(moving, 1000.0)),
            step_limit=1e-3, tolerance=1e-12,
        )  # fmt: skip

    def force(displacement):
        nothing = np.zeros((system.number, 0))
        balls = solve(displacement, np.zeros(0), (nothing, nothing))
        assert balls.converged
        ball = evaluate(balls.unknowns, *system.groove_distances(displacement)).ring_force
        weighted = system.weight[:, None] * ball
        total = system.axial_map.T @ weighted[:, 0] + system.radial_map.T @ weighted[:, 1]
        return total + system.stiffness * displacement

    load = force(MOVED)
    found = solve(MOVED, load, (system.axial_map, system.radial_map))
    assert found.converged
    assert found.displacement == pytest.approx(MOVED, rel=1e-9)
    steps = np.array([1e-8, 1e-8, 1e-8, 2e-7, 2e-7, 1e-8]) * np.eye(6)
    differences = np.array(
        [(force(MOVED + step) - force(MOVED - step)) / (2.0 * step.sum()) for step in steps]
    )
    size = np.sqrt(np.diag(found.tangent))
    assert np.all(np.abs(found.tangent - differences.T) < 1e-6 * np.outer(size, size))
