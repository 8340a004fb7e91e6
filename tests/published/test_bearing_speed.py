"""Quasi-static ball equilibrium at speed against Harris/Jones and independent recomputation.

Sources: Harris & Kotzalas, Rolling Bearing Analysis, vol. 2 (218 bearing);
example LE-7 of the OpenJones repository (inputs); values R recomputed with an
independent solver, outer race control, contact constants at the running
angle. Tolerance 0.05° and 0.3 % as the values are rounded.
"""

from __future__ import annotations

import math

import pytest

from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_set import solve_bearing
from spindle_fem.physics.bearings.bearing_state import BearingState
from spindle_fem.physics.bearings.hertz import INNER, OUTER

ANGLE = 0.05
REL = 3e-3
BEARING_71928 = BearingGeometry(14.2875e-3, 30, 165e-3, math.radians(15.0), 0.52, 0.52)
BEARING_LE7 = BearingGeometry(7.938e-3, 10, 38.5e-3, math.radians(20.0), 0.56, 0.52, 199.948e9, 0.25, 7750.37)


def bearing_218(density: float = 7800.0) -> BearingGeometry:
    return BearingGeometry(
        22.225e-3, 16, 125.26e-3, math.radians(40.0), 0.5232, 0.5232, 206.8e9, 0.29, density
    )


def angles(state: BearingState) -> tuple[float, float]:
    return math.degrees(state.contact_angle_inner), math.degrees(state.contact_angle_outer)


def turn(rpm: float) -> float:
    return rpm * math.pi / 30.0


@pytest.mark.parametrize(
    ("rpm", "inner", "outer", "q_inner", "q_outer", "centrifugal", "moment", "orbit", "spin", "deflection"),
    [
        (6_000, 44.722, 38.044, 1581.0, 1738.1, 213.1, 0.5838, 0.43845, 2.8293, 33.13),
        (10_000, 49.954, 31.341, 1453.2, 1921.3, 637.0, 1.4727, 0.45482, 2.9613, 14.96),
    ],
)
def test_218_outer_race_control(
    rpm, inner, outer, q_inner, q_outer, centrifugal, moment, orbit, spin, deflection
) -> None:
    state = solve_bearing(bearing_218(), turn(rpm), 17_800.0, control="outer")
    balls = state.balls
    assert angles(state) == pytest.approx((inner, outer), abs=ANGLE)
    assert balls.load[0] == pytest.approx((q_inner, q_outer), rel=REL)
    assert balls.centrifugal_force[0] == pytest.approx(centrifugal, rel=REL)
    assert balls.gyroscopic_moment[0] == pytest.approx(moment, rel=REL)
    assert balls.orbital_speed[0] / turn(rpm) == pytest.approx(orbit, rel=REL)
    assert balls.spin_speed[0] / turn(rpm) == pytest.approx(spin, rel=REL)
    assert state.axial_displacement * 1e6 == pytest.approx(deflection, rel=REL)


def test_218_gyroscopic_sign() -> None:
    # with the gyroscopic moment reversed the angles would be 45.408/37.416
    inner, outer = angles(solve_bearing(bearing_218(), turn(10_000), 17_800.0, control="outer"))
    assert abs(inner - 45.408) > 4.0
    assert abs(outer - 37.416) > 5.0


@pytest.mark.parametrize(
    ("density", "load", "inner", "outer"),
    [(7750.37, 17_800.0, 49.907, 31.410), (7800.0, 22_250.0, 48.709, 33.624)],
)
def test_218_density_and_load(density: float, load: float, inner: float, outer: float) -> None:
    state = solve_bearing(bearing_218(density), turn(10_000), load, control="outer")
    assert angles(state) == pytest.approx((inner, outer), abs=ANGLE)


def test_le7_static_and_50000_rpm() -> None:
    rest = solve_bearing(BEARING_LE7, 0.0, 2670.0, control="outer")
    assert math.degrees(rest.contact_angle_inner) == pytest.approx(24.384, abs=ANGLE)
    assert rest.axial_displacement * 1e6 == pytest.approx(53.30, rel=REL)
    state = solve_bearing(BEARING_LE7, turn(50_000), 2670.0, control="outer")
    assert angles(state) == pytest.approx((26.233, 18.605), abs=ANGLE)
    assert state.balls.load[0] == pytest.approx((604.05, 768.82), rel=REL)
    assert state.balls.centrifugal_force[0] == pytest.approx(179.5, rel=REL)
    assert state.axial_displacement * 1e6 == pytest.approx(51.93, rel=REL)


@pytest.mark.parametrize(
    ("load", "rpm", "inner", "outer", "q_inner", "q_outer", "centrifugal", "deflection", "orbital"),
    [
        (568.6, 3000, 18.935, 12.710, 58.41, 78.12, 20.56, 8.513, 144.64),
        (1137.2, 3000, 18.345, 14.850, 120.44, 139.99, 20.46, 16.618, 144.30),
        (1137.2, 4500, 19.989, 12.628, 110.89, 155.27, 46.42, 13.563, 217.34),
    ],
)
def test_71928_at_speed(load, rpm, inner, outer, q_inner, q_outer, centrifugal, deflection, orbital) -> None:
    state = solve_bearing(BEARING_71928, turn(rpm), load, control="outer")
    assert angles(state) == pytest.approx((inner, outer), abs=ANGLE)
    assert state.balls.load[0] == pytest.approx((q_inner, q_outer), rel=REL)
    assert state.balls.centrifugal_force[0] == pytest.approx(centrifugal, rel=REL)
    assert state.axial_displacement * 1e6 == pytest.approx(deflection, rel=REL)
    assert state.balls.orbital_speed[0] == pytest.approx(orbital, rel=REL)


def test_71928_ellipses() -> None:
    balls = solve_bearing(BEARING_71928, turn(3000), 1137.2, control="outer").balls
    assert balls.semi_major[0, INNER] * 1e6 == pytest.approx(784.4, rel=REL)
    assert balls.semi_minor[0, INNER] * 1e6 == pytest.approx(91.5, rel=REL)
    assert balls.pressure[0] / 1e6 == pytest.approx((801.0, 781.0), rel=REL)
    kappa = balls.semi_major[0] / balls.semi_minor[0]
    assert kappa == pytest.approx((8.57, 7.75), rel=REL)
    gamma = BEARING_71928.diameter_ratio * math.cos(balls.contact_angle[0, INNER])
    assert 0.5 * BEARING_71928.ball_diameter * (1 - gamma) * 1e3 == pytest.approx(6.557, rel=REL)
    gamma = BEARING_71928.diameter_ratio * math.cos(balls.contact_angle[0, OUTER])
    assert 0.5 * BEARING_71928.ball_diameter * (1 + gamma) * 1e3 == pytest.approx(7.742, rel=REL)
