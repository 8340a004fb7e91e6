"""Sets of bearings: sharing, unloading, springs, warnings, refusals, resistances."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.errors import NoEquilibriumError, OutOfValidityError, SpecError
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_set import (
    BearingSet,
    BearingTemperatures,
    ExternalLoad,
    MountedBearing,
    SetTemperatures,
    gross_sliding_onset,
    solve_bearing,
    solve_bearing_set,
    uniform_temperatures,
)
from spindle_fem.physics.bearings.cage_guidance import CageGuidance
from spindle_fem.physics.bearings.contact_conduction import (
    ball_conductance,
    constriction_resistance,
    contact_resistance,
    film_conductance,
    renewal_resistance,
)
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.heat_model import HeatOptions
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.mounting import rotation_growth
from spindle_fem.physics.bearings.preload import unloading_thrust
from spindle_fem.physics.bearings.traction import TractionOptions

BEARING = BearingGeometry(
    14.2875e-3,
    30,
    165e-3,
    math.radians(15.0),
    0.52,
    0.52,
    bore_diameter=0.14,
    outer_diameter=0.19,
    width=0.024,
)
GREASE = Lubricant(21e-6, 4.7e-6, density=990.0)
TBT = BearingSet(
    (
        MountedBearing("F1", BEARING, 1, 0.057),
        MountedBearing("F2", BEARING, 1, 0.081),
        MountedBearing("F3", BEARING, -1, 0.125),
    ),
    preload=1137.2,
)
WARM = uniform_temperatures(3, 313.15)


def turn(rpm: float) -> float:
    return rpm * math.pi / 30.0


def codes(states) -> set[str]:
    return {warning.code for state in states for warning in state.warnings}


def test_tandem_bearings_share_the_force_through_the_set() -> None:
    states = solve_bearing_set(TBT, 0.0, 0.0, WARM, control="outer")
    assert [state.axial_force for state in states] == pytest.approx([568.6, 568.6, 1137.2], rel=1e-6)
    assert [state.preload for state in states] == pytest.approx([568.6, 568.6, 1137.2], rel=1e-6)


def test_thrust_goes_to_the_tandem_side() -> None:
    states = solve_bearing_set(TBT, turn(3000), 1750.0, WARM, lubricant=GREASE)
    forces = np.array([state.axial_force for state in states])
    assert forces[0] + forces[1] - forces[2] == pytest.approx(1750.0, rel=1e-8)
    assert forces[0] > 568.6 > 0.0
    assert forces[2] < states[2].preload
    # the state without thrust carries no net force
    preloads = [state.preload for state in states]
    assert preloads[0] + preloads[1] == pytest.approx(preloads[2], rel=1e-8)


def test_unloading_of_the_counter_bearing_is_said() -> None:
    limit = unloading_thrust((BEARING,) * 3, (1, 1, -1), 1137.2)
    below = solve_bearing_set(TBT, 0.0, 0.99 * limit, WARM, control="outer")
    beyond = solve_bearing_set(TBT, 0.0, 1.01 * limit, WARM, control="outer")
    assert "counter_bearing_unloaded" not in codes(below)
    assert "counter_bearing_unloaded" in codes(beyond)
    assert beyond[2].axial_force == 0.0
    assert beyond[0].axial_force == pytest.approx(1.01 * limit / 2, rel=1e-8)
    turning = solve_bearing_set(TBT, turn(1000), 1.2 * limit, WARM, lubricant=GREASE)
    assert "counter_bearing_unloaded" in {warning.code for warning in turning[2].warnings}
    assert "counter_bearing_unloaded" not in codes(turning[:2])


@pytest.mark.parametrize("rpm", [5.0, 50.0, 1000.0])
@pytest.mark.parametrize("thrust", [0.0, 1750.0, -1750.0])
def test_a_loose_set_still_turns(rpm: float, thrust: float) -> None:
    """A cold inner ring loosens the set: its free balls are held by centrifugal force alone."""
    rings = BearingTemperatures(300.0, 310.0, 306.0)
    cold = SetTemperatures((rings,) * 3, 300.0, 310.0, 293.15)
    states = solve_bearing_set(TBT, turn(rpm), thrust, cold, lubricant=GREASE)
    forces = [state.axial_force for state in states]
    assert forces[0] + forces[1] - forces[2] == pytest.approx(thrust, abs=1e-2)
    assert "counter_bearing_unloaded" in codes(states)


def test_gross_sliding_is_said_and_its_onset_found() -> None:
    heavy = BearingGeometry(22.225e-3, 16, 125.26e-3, math.radians(40.0), 0.5232, 0.5232)
    single = BearingSet((MountedBearing("A", heavy),))
    one = uniform_temperatures(1, 313.15)
    rolling = solve_bearing(heavy, turn(1000), 50.0, lubricant=GREASE)
    assert abs(rolling.cage_slip) < 0.1
    assert "gross_sliding" not in codes([rolling])
    sliding = solve_bearing(heavy, turn(10_000), 50.0, lubricant=GREASE)
    assert sliding.cage_slip > 0.3
    assert "gross_sliding" in codes([sliding])
    onset = gross_sliding_onset(single, turn(10_000), 50.0, one, GREASE)
    (text,) = (note.text for note in sliding.warnings if note.code == "gross_sliding")
    said = float(text.split("begins at about ")[1].split(" rpm")[0])
    assert turn(said) == pytest.approx(onset, rel=0.05)
    assert turn(1000) < onset < turn(10_000)
    assert solve_bearing(heavy, 0.95 * onset, 50.0, lubricant=GREASE).cage_slip < 0.1
    assert solve_bearing(heavy, 1.05 * onset, 50.0, lubricant=GREASE).cage_slip > 0.1
    assert gross_sliding_onset(single, turn(500), 50.0, one, GREASE) == math.inf


def test_spring_preload_keeps_its_force() -> None:
    spring = replace(TBT, preload_kind="spring")
    states = solve_bearing_set(spring, turn(3000), 1000.0, WARM, lubricant=GREASE)
    assert states[2].axial_force == pytest.approx(1137.2, rel=1e-8)
    assert states[0].axial_force + states[1].axial_force == pytest.approx(2137.2, rel=1e-8)
    with pytest.raises(NoEquilibriumError, match=r"lifts the set off its spring of 1137\.2 N"):
        solve_bearing_set(spring, 0.0, -1200.0, WARM, control="outer")


def test_spring_set_is_softer_than_a_rigid_one() -> None:
    rigid = solve_bearing_set(TBT, 0.0, 0.0, WARM, control="outer")[0].axial_stiffness
    spring = solve_bearing_set(replace(TBT, preload_kind="spring"), 0.0, 0.0, WARM, control="outer")[0]
    assert spring.axial_stiffness < rigid
    # F1 and F2 alone carry: twice the stiffness of one bearing at 568.6 N
    assert spring.axial_stiffness * 1e-6 == pytest.approx(2 * 79.20, rel=1e-3)


def test_longer_spacing_lowers_the_preload_of_a_hot_shaft_back_to_back() -> None:
    """A longer hot shaft unloads a back-to-back pair and loads a face-to-face one."""

    def preload(spacing: float, first: int) -> float:
        pair = BearingSet(
            (MountedBearing("A", BEARING, first, 0.0), MountedBearing("B", BEARING, -first, spacing)),
            preload=1000.0,
        )
        rings = BearingTemperatures(298.15, 293.15, 295.65)
        temperatures = SetTemperatures((rings, rings), 298.15, 293.15, 293.15)
        return solve_bearing_set(pair, 0.0, 0.0, temperatures, control="outer")[0].preload

    assert preload(0.03, 1) > 1000.0
    assert preload(0.30, 1) < preload(0.03, 1)
    assert preload(0.30, -1) > preload(0.03, -1)


def test_thermal_preload_to_first_order() -> None:
    """Interference across the contact: cos α times the radial growth, for small temperature rises."""
    pair = BearingSet(
        (MountedBearing("A", BEARING, 1, 0.0), MountedBearing("B", BEARING, -1, 0.0)), preload=1000.0
    )
    rise = 0.05
    rings = BearingTemperatures(293.15 + rise, 293.15, 293.15)
    hot = SetTemperatures((rings, rings), 293.15, 293.15, 293.15)
    states = [
        solve_bearing_set(pair, 0.0, 0.0, t, control="outer")[0]
        for t in (uniform_temperatures(2, 293.15), hot)
    ]
    deformation = [float(state.balls.deformation[0].sum()) for state in states]
    angle = states[0].contact_angle_inner
    # the groove's own growth takes a little of the radial growth of its centre circle
    radial = BEARING.thermal_expansion * rise * BEARING.inner_groove_centre_radius
    groove = BEARING.thermal_expansion * rise * 0.52 * BEARING.ball_diameter
    # and its centre moves by (f - ½)D sin α_0 ... negligible: both bearings sit at z = 0
    expected = radial * math.cos(angle) - groove
    assert deformation[1] - deformation[0] == pytest.approx(expected, rel=0.02)


def test_rotation_growth_of_a_solid_and_a_hollow_shaft() -> None:
    solid, hollow = (rotation_growth(BEARING, turn(4500), bore) for bore in (0.0, 0.06))
    radius = 0.5 * (0.165 - 14.2875e-3 * math.cos(math.radians(15.0)))
    # solid disc: ρω²b³(1-ν)/(4E)
    assert solid == pytest.approx(7800 * turn(4500) ** 2 * radius**3 * 0.7 / (4 * 206e9))
    assert hollow > solid
    with pytest.raises(SpecError, match=r"it is 170 mm\. It must lie inside the ring"):
        rotation_growth(BEARING, turn(100), 0.17)
    growing = solve_bearing_set(
        replace(TBT, shaft_bore_diameter=0.06), turn(4500), 0.0, WARM, lubricant=GREASE
    )
    stiff = solve_bearing_set(TBT, turn(4500), 0.0, WARM, lubricant=GREASE)
    assert growing[2].axial_force > stiff[2].axial_force


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: BearingSet(()), "the set has no bearing"),
        (lambda: replace(TBT, preload=-1.0), "preload is -1 N. It must not be negative."),
        (lambda: replace(TBT, preload_kind="glued"), "Allowed: rigid, spring."),
        (
            lambda: BearingSet((MountedBearing("A", BEARING), MountedBearing("B", BEARING)), preload=100.0),
            "Preload needs a counter bearing",
        ),
        (lambda: MountedBearing("A", BEARING, 0), "A.orientation: it is 0. Allowed: 1, -1."),
        (lambda: replace(TBT, raceway_roughness=0.0), "raceway_roughness"),
        (
            lambda: solve_bearing_set(TBT, 1.0, 0.0, uniform_temperatures(2, 313.15)),
            "2 entries for 3 bearings",
        ),
        (lambda: solve_bearing_set(TBT, 1.0, 0.0, WARM), "no lubricant is given"),
        (
            lambda: solve_bearing_set(TBT, 1.0, 0.0, WARM, control="free"),
            "Allowed: outer, inner, equilibrium.",
        ),
        (lambda: HeatOptions("skff"), 'Did you mean "skf"'),
        (lambda: HeatOptions(rolling_surfaces=3), "Allowed: 1, 2."),
        (lambda: CageGuidance(0.1, 0.01, 0.0), "cage.clearance"),
    ],
)
def test_bad_sets_are_refused(build, message: str) -> None:
    with pytest.raises(SpecError) as caught:
        build()
    assert message in str(caught.value)


def test_states_that_do_not_exist() -> None:
    with pytest.raises(NoEquilibriumError, match="nothing seats its balls"):
        solve_bearing(BEARING, turn(1000), 0.0, control="outer")
    with pytest.raises(NoEquilibriumError, match="unloads bearings that all face the other way"):
        solve_bearing(BEARING, turn(1000), -50.0, control="outer")
    with pytest.raises(
        NoEquilibriumError, match=r"no quasi-static equilibrium at 30000 rpm: .* from about \d+ rpm on"
    ):
        solve_bearing(BEARING, turn(30_000), 500.0, control="inner")
    with pytest.raises(NoEquilibriumError, match=r"with 500 N along the shaft and 40 N across\. .* radial"):
        solve_bearing(BEARING, turn(30_000), ExternalLoad(500.0, 40.0), control="inner")
    low = replace(BEARING, shoulder_angle=math.radians(18.0))
    with pytest.raises(NoEquilibriumError, match=r"climbs the shoulder at 18.0° \(1[89].\d° at 3000 rpm\)"):
        solve_bearing(low, turn(3000), 1137.2, control="outer")
    with pytest.raises(OutOfValidityError, match=r"250\.0 °C lies outside the viscosity fit"):
        solve_bearing(BEARING, turn(3000), 1137.2, lubricant=GREASE, temperature=523.15)


def test_onset_of_inner_control_loss_is_the_speed_it_names() -> None:
    with pytest.raises(NoEquilibriumError) as caught:
        solve_bearing(BEARING, turn(30_000), 500.0, control="inner")
    onset = float(caught.value.what.split("from about ")[1].split(" rpm")[0])
    assert solve_bearing(BEARING, turn(0.93 * onset), 500.0, control="inner").axial_force == pytest.approx(
        500.0
    )
    with pytest.raises(NoEquilibriumError):
        solve_bearing(BEARING, turn(1.07 * onset), 500.0, control="inner")


def test_doubtful_raceway_control_is_said() -> None:
    fast = solve_bearing(BEARING, turn(4500), 568.6, control="outer")
    assert "race_control_doubtful" in codes([fast])
    slow = solve_bearing(BEARING, turn(500), 1137.2, control="inner")
    assert "race_control_doubtful" not in codes([slow])


def test_warnings_of_film_and_grease() -> None:
    state = solve_bearing(BEARING, turn(3000), 1137.2, lubricant=GREASE)
    assert {"film_fit_extrapolated", "cage_seal_not_given"} <= codes([state])
    hot = solve_bearing(BEARING, turn(20), 1137.2, lubricant=GREASE, temperature=398.15)
    assert {"grease_temperature", "film_not_separating"} <= codes([hot])
    assert hot.film_thickness_ratio < 3.0
    bare = replace(BEARING, bore_diameter=None)
    assert "boundary_dimensions_assumed" in codes([solve_bearing(bare, turn(3000), 1137.2, lubricant=GREASE)])


def test_heat_terms_of_cage_seal_and_one_rolling_surface() -> None:
    cage = CageGuidance(0.158, 0.004, 0.2e-3)
    both = solve_bearing(
        replace(BEARING, cage=cage, seal_moment=0.05),
        turn(3000),
        1137.2,
        lubricant=GREASE,
        heat=HeatOptions(rolling_surfaces=1),
    )
    plain = solve_bearing(BEARING, turn(3000), 1137.2, lubricant=GREASE)
    assert both.terms_W["seal"] == pytest.approx(0.05 * turn(3000))
    viscosity, orbital = float(GREASE.dynamic_viscosity(313.15)), float(both.balls.orbital_speed[0])
    petroff = viscosity * math.pi * 0.004 * 0.158**3 * orbital**2 / (4 * 0.2e-3)
    assert both.terms_W["cage"] == pytest.approx(petroff)
    assert both.terms_W["inner_rolling"] == pytest.approx(0.5 * plain.terms_W["inner_rolling"])
    assert both.friction_moment * turn(3000) == pytest.approx(both.heat_W)
    assert "cage_seal_not_given" not in codes([both])


def test_terms_add_up_ball_by_ball() -> None:
    state = solve_bearing(BEARING, turn(3000), ExternalLoad(1137.2, 400.0), lubricant=GREASE)
    assert sum(state.terms_W.values()) == pytest.approx(state.heat_W)
    for label in ("sliding", "transverse", "rolling", "hysteresis"):
        for side, ring in ((INNER, "inner"), (OUTER, "outer")):
            total = float(state.heat.per_contact[label][:, side].sum())
            assert state.terms_W[f"{ring}_{label}"] == pytest.approx(total)


def test_quadrature_is_fine_enough() -> None:
    def sliding(load: float, **nodes: int) -> float:
        options = TractionOptions(**nodes)
        state = solve_bearing(
            BEARING, turn(3000), load, lubricant=GREASE, heat=HeatOptions("paper"), options=options
        )
        return state.heat_W - state.terms_W["ball_drag"]

    for load, tolerance in ((1137.2, 1e-3), (4000.0, 1e-2)):
        assert sliding(load) == pytest.approx(sliding(load, nodes_across=161, nodes_along=40), rel=tolerance)


def test_radial_load_on_a_set_with_all_displacements() -> None:
    load = ExternalLoad(500.0, 400.0, 10.0)
    states = solve_bearing_set(TBT, turn(2000), load, WARM, control="outer")
    radial = sum(
        float(
            state.balls.weight
            @ (
                state.balls.load[:, INNER]
                * np.cos(state.balls.contact_angle[:, INNER])
                * np.cos(state.balls.azimuth)
            )
        )
        for state in states
    )
    axial = [state.axial_force for state in states]
    assert radial == pytest.approx(400.0, rel=1e-8)
    assert axial[0] + axial[1] - axial[2] == pytest.approx(500.0, rel=1e-8)


@pytest.mark.parametrize("control", ["outer", "equilibrium"])
@pytest.mark.parametrize("rpm", [0.0, 3000.0])
def test_balls_press_the_raceways_with_their_groove_forces_too(rpm: float, control: str) -> None:
    """The axial force of a ball tells the friction across each groove; what is radial follows from both."""
    for state in solve_bearing_set(TBT, turn(rpm), 1750.0, WARM, lubricant=GREASE, control=control):
        balls = state.balls
        sine, cosine = np.sin(balls.contact_angle[0]), np.cos(balls.contact_angle[0])
        across = (state.axial_force / 30.0 - balls.load[0] * sine) / cosine
        assert state.ball_forces == pytest.approx(30.0 * (balls.load[0] * cosine - across * sine), rel=1e-6)
        plain = state.axial_force * cosine / sine
        assert (plain[OUTER] / state.ball_forces[OUTER] > 1.03) == (rpm > 0.0)
    loaded = solve_bearing_set(TBT, turn(rpm), ExternalLoad(1750.0, 1000.0), WARM, control="outer")[0]
    each = loaded.balls.load[:, INNER] * np.cos(loaded.balls.contact_angle[:, INNER])
    assert loaded.ball_forces[INNER] == pytest.approx(each.sum(), rel=1e-9)


def test_contact_resistance() -> None:
    state = solve_bearing(BEARING, turn(3000), 1137.2, lubricant=GREASE)
    inner, outer = contact_resistance(state, ring_conductivity=46.0, ball_conductivity=46.0)
    balls = state.balls
    one = 2.0 * float(constriction_resistance(balls.semi_major[0, INNER], balls.semi_minor[0, INNER], 46.0))
    half_ball = 1.0 / (math.pi * 46.0 * BEARING.ball_diameter)
    at_rest = replace(state, balls=replace(balls, entrainment_speed=np.full((1, 2), np.nan)))
    still = contact_resistance(at_rest, ring_conductivity=46.0, ball_conductivity=46.0)
    assert still[0] == pytest.approx((one + half_ball) / 30)
    # surfaces that are renewed at a Péclet number of 95 take ten times as much
    assert 8.0 < still[0] / inner < 20.0
    assert outer < inner
    # a narrow ellipse conducts worse than a circle of its length, better than one of its width
    major, minor = balls.semi_major[0, INNER], balls.semi_minor[0, INNER]
    assert 1 / (4 * 46.0 * major) < one / 2 < 1 / (4 * 46.0 * minor)
    assert ball_conductance(state).inner == pytest.approx(1.0 / inner)
    wet = ball_conductance(state, GREASE)
    assert wet.inner == pytest.approx(wet.inner_contact + wet.lubricant)
    assert wet.lubricant > 0.0
    # the film is in the way: 1.2 W/K of it, 0.7 W/K of the oil around it
    film = 30.0 * film_conductance(state, GREASE.thermal_conductivity)[0, INNER]
    assert wet.inner_contact == pytest.approx(1.0 / (inner + 1.0 / film))
    assert 1.2 < wet.inner_contact < 2.5
    with pytest.raises(SpecError, match="Give a >= b"):
        constriction_resistance(1.0, 2.0, 46.0)


def test_renewed_surface_takes_what_a_fast_band_source_does() -> None:
    """Strips of an ellipse along the motion, each with 4/3 q √(L α/(π u))/k as mean (Carslaw & Jaeger)."""
    major, minor, speed, k, capacity = 0.8e-3, 0.09e-3, 12.0, 46.0, 7810.0 * 475.0
    across = np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, 4001))
    lengths = 2.0 * minor * np.sqrt(1.0 - across**2)
    rise = 4.0 / 3.0 * np.sqrt(lengths * k / capacity / (np.pi * speed)) / k
    area = np.pi * major * minor
    mean = np.trapezoid(rise * lengths, across) / np.trapezoid(lengths, across)
    assert float(renewal_resistance(major, minor, speed, k, capacity)) == pytest.approx(mean / area, rel=1e-4)


def test_contact_resistance_without_contact_is_infinite() -> None:
    state = solve_bearing(BEARING, 0.0, 0.0, control="outer")
    empty = replace(
        state, balls=replace(state.balls, semi_major=np.zeros((1, 2)), semi_minor=np.zeros((1, 2)))
    )
    assert contact_resistance(empty) == (math.inf, math.inf)


def test_unloaded_balls_keep_the_wedge_of_oil_at_rest_and_just_above() -> None:
    """F3 under 6500 N carries nothing: 30 k 2π √(R_x R_y) ln 2, with no jump where the speed begins."""

    def paths(rpm: float, thrust: float):
        states = solve_bearing_set(TBT, turn(rpm), thrust, WARM, lubricant=GREASE, control="outer")
        return ball_conductance(states[2], GREASE)

    still, barely, loaded = paths(0.0, 6500.0), paths(1e-4, 6500.0), paths(0.0, 1750.0)
    ball = 0.5 * BEARING.ball_diameter
    # at the contact angle of about 15°; the inner raceway rolls on a smaller radius than the outer
    across = ball / (1.0 - 0.5 / BEARING.groove_curvature_inner)
    along = ball * (1.0 - BEARING.diameter_ratio * math.cos(math.radians(15.0)))
    wedge = 30 * GREASE.thermal_conductivity * 2.0 * math.pi * math.sqrt(along * across) * math.log(2.0)
    assert still.inner == pytest.approx(wedge, rel=0.01)
    assert (still.inner, still.outer) == pytest.approx((barely.inner, barely.outer), rel=0.01)
    assert still.inner < loaded.inner < 2.0 * still.inner


@pytest.mark.parametrize("rpm", [0.0, 3000.0])
def test_other_heat_models_of_the_same_equilibrium_come_beside(rpm: float) -> None:
    def states(heat: HeatOptions):
        return solve_bearing_set(TBT, turn(rpm), 1750.0, WARM, lubricant=GREASE, control="outer", heat=heat)

    both, alone = states(HeatOptions("palmgren", beside=("skf",))), states(HeatOptions("skf"))
    assert [state.heat.model for state in both] == ["palmgren"] * 3
    beside = [state.heat_beside["skf"] for state in both]
    assert beside == pytest.approx([state.heat.total for state in alone], rel=1e-12)
    assert (beside[0] > 0.0) == (rpm > 0.0)
