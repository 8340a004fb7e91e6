"""Limits, symmetry, energy and scaling laws that every bearing state obeys."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_set import (
    BearingSet,
    BearingTemperatures,
    ExternalLoad,
    MountedBearing,
    SetTemperatures,
    solve_bearing,
    solve_bearing_set,
    uniform_temperatures,
)
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.heat_model import HeatOptions
from spindle_fem.physics.bearings.heat_models.palmgren import palmgren_moment
from spindle_fem.physics.bearings.hertz import INNER, OUTER, bearing_contact_constants, contact_polynomials
from spindle_fem.physics.bearings.preload import axial_state

GREASE = Lubricant(21e-6, 4.7e-6, density=990.0)
BEARING = BearingGeometry(14.2875e-3, 30, 165e-3, math.radians(15.0), 0.52, 0.52)
QUICK = settings(max_examples=20, derandomize=True)


def turn(rpm: float) -> float:
    return rpm * math.pi / 30.0


bearings = st.builds(
    lambda ball, filling, pitch_ratio, angle, f_inner, f_outer: BearingGeometry(
        ball, int(filling * math.pi / math.asin(1.0 / pitch_ratio)), ball * pitch_ratio, math.radians(angle),
        f_inner, f_outer,
    ),
    st.floats(5e-3, 25e-3), st.floats(0.6, 0.95), st.floats(5.0, 12.0), st.floats(12.0, 40.0),
    st.floats(0.515, 0.54), st.floats(0.515, 0.54),
)  # fmt: skip


def moderate_load(bearing: BearingGeometry) -> float:
    """Axial load that presses the balls like a medium preload, N."""
    return 2.0e6 * bearing.ball_count * bearing.ball_diameter**2 * math.sin(bearing.contact_angle)


def moderate_speed(bearing: BearingGeometry) -> float:
    """Speed at which the centrifugal force is about a quarter of the ball load, rad/s."""
    load = moderate_load(bearing) / (bearing.ball_count * math.sin(bearing.contact_angle))
    return math.sqrt(0.25 * load / (0.5 * bearing.ball_mass * bearing.pitch_diameter)) / 0.45


@QUICK
@given(bearings)
def test_contact_polynomials_reproduce_the_elliptic_integrals(bearing: BearingGeometry) -> None:
    cosine = np.cos(np.linspace(0.0, math.radians(75.0), 40))
    for side in (INNER, OUTER):
        exact = bearing_contact_constants(bearing, np.arccos(cosine), side)
        rows = contact_polynomials(bearing)[side]
        fitted = [np.polynomial.polynomial.polyval(2 * cosine - 1, row) for row in rows]
        for logarithm, values in zip(
            fitted, (exact.load_constant, exact.semi_major, exact.semi_minor, exact.ellipticity), strict=True
        ):
            assert np.exp(logarithm) == pytest.approx(values, rel=1e-9)


@QUICK
@given(bearings)
def test_heat_is_drag_torque_times_speed(bearing: BearingGeometry) -> None:
    """The moment that the shaft must supply, from the tractions on the inner ring, does all the work."""
    from spindle_fem.physics.bearings.ball_system import build_ball_rows, join_rows
    from spindle_fem.physics.bearings.equilibrium import solve_equilibrium
    from spindle_fem.physics.bearings.state_records import lubricant_state
    from spindle_fem.physics.bearings.traction import (
        TractionOptions,
        ball_drag,
        build_patch,
        integrate_traction,
    )

    load, speed, options = moderate_load(bearing), moderate_speed(bearing), TractionOptions()
    system = join_rows([build_ball_rows(bearing, np.zeros(1), float(bearing.ball_count))], [0])
    film = lubricant_state(GREASE, np.array([313.15]), None)
    solved = solve_equilibrium(
        system, speed, np.array([load]), "equilibrium",
        at_rest=(
            np.array([axial_state(bearing, load).approach]),
            load / bearing.ball_count / math.sin(bearing.contact_angle),
        ),
        lubricant=film, options=options,
    )  # fmt: skip
    patch = build_patch(system, solved.contacts, film, options)
    integrals = integrate_traction(system, patch, film, options, np.array([speed]), solved.ball_speeds)
    orbital = solved.ball_speeds[0, 0]
    drag = ball_drag(system, film, options, solved.ball_speeds[:, 0])[0]
    heat = float((integrals.power_rolling + integrals.power_across).sum())
    heat += float(0.5 * bearing.pitch_diameter * orbital * drag)
    torque = float(
        0.5 * bearing.pitch_diameter * integrals.force_rolling[0, INNER] - integrals.moment_axis[0, INNER]
    )
    assert heat > 0.0
    assert heat == pytest.approx(torque * speed, rel=1e-6)
    assert solved.residual < 1e-7


@QUICK
@given(bearings, st.floats(0.2, 3.0))
def test_state_carries_the_load(bearing: BearingGeometry, share: float) -> None:
    load = share * moderate_load(bearing)
    for control in ("outer", "inner", "equilibrium"):
        state = solve_bearing(bearing, 0.5 * moderate_speed(bearing), load, lubricant=GREASE, control=control)
        assert state.axial_force == pytest.approx(load, rel=1e-6)


@QUICK
@given(bearings)
def test_zero_speed_has_no_film_no_heat_and_one_contact_line(bearing: BearingGeometry) -> None:
    state = solve_bearing(bearing, 0.0, moderate_load(bearing), lubricant=GREASE)
    assert state.heat_W == 0.0
    assert math.isnan(state.film_central)
    assert state.contact_angle_inner == pytest.approx(state.contact_angle_outer, abs=1e-12)
    assert state.balls.centrifugal_force[0] == 0.0
    slow = solve_bearing(bearing, turn(1e-3), moderate_load(bearing), control="outer")
    assert slow.contact_angle_inner == pytest.approx(state.contact_angle_inner, abs=1e-8)


@QUICK
@given(bearings)
def test_zero_load_limit(bearing: BearingGeometry) -> None:
    touching = solve_bearing(bearing, 0.0, 0.0, control="outer")
    assert touching.axial_displacement == pytest.approx(0.0, abs=1e-15)
    assert touching.balls.load == pytest.approx(np.zeros((1, 2)), abs=1e-9)
    assert touching.contact_angle_inner == pytest.approx(bearing.contact_angle)
    light = solve_bearing(bearing, 0.0, 1e-6 * moderate_load(bearing), control="outer")
    assert light.contact_angle_inner == pytest.approx(bearing.contact_angle, abs=1e-4)


def test_hertz_two_thirds_power() -> None:
    constants = bearing_contact_constants(BEARING, BEARING.contact_angle, INNER)
    assert (800.0 / constants.load_constant) ** (2 / 3) / (100.0 / constants.load_constant) ** (2 / 3) == (
        pytest.approx(4.0)
    )
    # the bearing follows it while its angle holds: small loads
    low, high = axial_state(BEARING, 0.01), axial_state(BEARING, 0.08)
    assert high.approach / low.approach == pytest.approx(4.0, rel=5e-3)


@settings(max_examples=10, derandomize=True)
@given(st.floats(0.0, 1.0))
def test_symmetry_about_the_radial_load(share: float) -> None:
    state = solve_bearing(BEARING, turn(3000), ExternalLoad(1137.2, 500.0 * share + 1.0), control="outer")
    load = state.balls.load
    # ball j and ball Z - j mirror one another
    assert load[1:] == pytest.approx(load[1:][::-1], rel=1e-8)
    assert load[0, INNER] == pytest.approx(load[:, INNER].max(), rel=1e-12)
    assert state.radial_force == pytest.approx(500.0 * share + 1.0, rel=1e-6)


def test_axial_load_alone_equals_all_balls_solved() -> None:
    one = solve_bearing(BEARING, turn(3000), 1137.2, lubricant=GREASE)
    all_balls = solve_bearing(BEARING, turn(3000), ExternalLoad(1137.2, 1e-9), lubricant=GREASE)
    assert len(all_balls.balls.weight) == 30
    assert all_balls.balls.load == pytest.approx(np.repeat(one.balls.load, 30, axis=0), rel=1e-8)
    assert all_balls.heat_W == pytest.approx(one.heat_W, rel=1e-8)


def test_back_to_back_pair_is_symmetric_and_turns_with_the_thrust() -> None:
    pair = BearingSet(
        (MountedBearing("A", BEARING, 1, 0.0), MountedBearing("B", BEARING, -1, 0.03)), preload=1000.0
    )
    temperatures = uniform_temperatures(2, 313.15)
    a, b = solve_bearing_set(pair, turn(3000), 0.0, temperatures, lubricant=GREASE)
    assert a.axial_force == pytest.approx(b.axial_force, rel=1e-8)
    assert a.heat_W == pytest.approx(b.heat_W, rel=1e-8)
    forward = solve_bearing_set(pair, turn(3000), 400.0, temperatures, lubricant=GREASE)
    back = solve_bearing_set(pair, turn(3000), -400.0, temperatures, lubricant=GREASE)
    assert forward[0].axial_force == pytest.approx(back[1].axial_force, rel=1e-8)
    assert forward[0].axial_force - forward[1].axial_force == pytest.approx(400.0, rel=1e-8)


@settings(max_examples=8, derandomize=True)
@given(st.floats(500.0, 4000.0), st.floats(1.05, 1.3))
def test_film_and_heat_grow_with_speed(rpm: float, factor: float) -> None:
    slow = solve_bearing(BEARING, turn(rpm), 1137.2, lubricant=GREASE)
    fast = solve_bearing(BEARING, turn(rpm * factor), 1137.2, lubricant=GREASE)
    assert np.all(fast.balls.film_isothermal > slow.balls.film_isothermal)
    assert fast.heat_W > slow.heat_W
    # the film follows the 0.67 power of speed, the loads change little
    exponent = np.log(fast.balls.film_isothermal / slow.balls.film_isothermal) / math.log(factor)
    assert exponent == pytest.approx(0.67 * np.ones((1, 2)), abs=0.06)


def test_palmgren_scaling_with_speed() -> None:
    moments = [palmgren_moment(BEARING, turn(rpm), 21e-6, 0.0).parts["viscous"] for rpm in (1000, 8000)]
    assert moments[1] / moments[0] == pytest.approx(8.0 ** (2.0 / 3.0))


def test_warmer_grease_thins_film_and_heat() -> None:
    states = [
        solve_bearing(BEARING, turn(3000), 1137.2, lubricant=GREASE, temperature=celsius + 273.15)
        for celsius in (20.0, 40.0, 60.0, 80.0)
    ]
    films = [state.film_central for state in states]
    heats = [state.heat_W for state in states]
    assert films == sorted(films, reverse=True)
    assert heats == sorted(heats, reverse=True)


def test_hotter_inner_ring_raises_a_rigid_preload_and_not_a_spring() -> None:
    bearings_ = (MountedBearing("A", BEARING, 1, 0.0), MountedBearing("B", BEARING, -1, 0.03))
    rigid = BearingSet(bearings_, preload=1000.0)
    spring = replace(rigid, preload_kind="spring")
    cold = uniform_temperatures(2, 293.15)
    hot_ring = BearingTemperatures(303.15, 298.15, 300.65, lubricant=293.15)
    hot = SetTemperatures((hot_ring, hot_ring), 303.15, 298.15, 293.15)
    speed = turn(1500)
    rigid_loads = [solve_bearing_set(rigid, speed, 0.0, t, lubricant=GREASE)[0].preload for t in (cold, hot)]
    spring_loads = [
        solve_bearing_set(spring, speed, 0.0, t, lubricant=GREASE)[0].preload for t in (cold, hot)
    ]
    assert rigid_loads[1] > 1.3 * rigid_loads[0]
    assert spring_loads == pytest.approx([1000.0, 1000.0], rel=1e-6)


def test_uniform_warming_changes_no_load() -> None:
    """Everything of one material at one temperature only scales the bearing."""
    pair = BearingSet(
        (MountedBearing("A", BEARING, 1, 0.0), MountedBearing("B", BEARING, -1, 0.03)), preload=1000.0
    )
    one = BearingTemperatures(333.15, 333.15, 333.15)
    warm = SetTemperatures((one, one), 333.15, 333.15, 293.15)
    states = solve_bearing_set(pair, 0.0, 0.0, warm, control="outer")
    # lengths grow by 5e-4 and with them the approach; loads go as its 3/2 power
    assert states[0].axial_force == pytest.approx(1000.0, rel=5e-3)


@QUICK
@given(st.floats(0.0, 1200.0), st.floats(-30.0, 30.0))
def test_ring_forces_balance_external_loads(radial: float, moment: float) -> None:
    load = ExternalLoad(1137.2, radial, moment)
    single = BearingSet((MountedBearing("A", BEARING),))
    (state,) = solve_bearing_set(single, turn(3000), load, uniform_temperatures(1, 313.15), control="outer")
    balls = state.balls
    axial = balls.load[:, INNER] * np.sin(balls.contact_angle[:, INNER])
    assert float(balls.weight @ axial) == pytest.approx(1137.2, rel=1e-6)
    if radial or moment:
        lever = BEARING.inner_groove_centre_radius
        assert float(axial @ np.cos(balls.azimuth)) * lever == pytest.approx(moment, abs=1e-5)


def test_separate_stress_limits_let_the_resultant_exceed_the_limit() -> None:
    from spindle_fem.physics.bearings.traction import TractionOptions

    totals = {
        limit: solve_bearing(
            BEARING, turn(3000), 1137.2, lubricant=GREASE, heat=HeatOptions("paper"),
            options=TractionOptions(limit=limit),
        ).heat_W
        for limit in ("vector", "separate")
    }  # fmt: skip
    assert totals["separate"] != pytest.approx(totals["vector"], rel=1e-4)
    assert totals["separate"] == pytest.approx(totals["vector"], rel=0.3)
