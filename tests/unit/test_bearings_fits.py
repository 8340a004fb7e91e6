"""Rings on shaft and in housing: Lamé's relations, the rotating disc, and the mounted bearing."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spindle_fem.errors import GeometryError, SpecError
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_set import (
    BearingSet,
    BearingTemperatures,
    MountedBearing,
    SetTemperatures,
    solve_bearing_set,
    uniform_temperatures,
)
from spindle_fem.physics.bearings.fits import FitTemperatures, RingFits, mounted_state, seated_rings
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.mounting import rotation_growth
from spindle_fem.physics.bearings.preload import axial_state
from spindle_fem.physics.bearings.rings import Annulus, SeatMaterial

BEARING = BearingGeometry(
    14.2875e-3, 30, 165e-3, math.radians(15.0), 0.52, 0.52,
    bore_diameter=0.140, outer_diameter=0.190, width=0.024,
)  # fmt: skip
FITS = RingFits(8e-6, 5e-6, 0.300, 0.060, 0.158, 0.172)
COLD = FitTemperatures()
GREASE = Lubricant(21e-6, 4.7e-6, pressure_viscosity=1.8e-8)


def turn(rpm: float) -> float:
    return rpm * math.pi / 30.0


def tbt(fits: RingFits | None, preload: float = 1137.2) -> BearingSet:
    places = ((1, 0.057), (1, 0.081), (-1, 0.125))
    return BearingSet(
        tuple(MountedBearing(f"F{i + 1}", BEARING, s, z, fits) for i, (s, z) in enumerate(places)), preload
    )


# ---------------------------------------------------------------- cylinder walls
def test_annulus_in_limits_that_have_closed_forms() -> None:
    steel = SeatMaterial(206e9, 0.3)
    thin = Annulus(0.0999, 0.1001, steel)
    # thin ring: growth p r²/(E t) for pressure in the bore, the same for pressure outside
    hoop = 0.1**2 / (206e9 * 0.2e-3)
    assert thin.bore_by_bore_pressure == pytest.approx(hoop, rel=5e-3)
    assert thin.outside_by_outside_pressure == pytest.approx(hoop, rel=5e-3)
    assert thin.outside_by_bore_pressure == pytest.approx(hoop, rel=5e-3)
    # solid shaft under pressure: r (1 - ν)/E
    assert Annulus(0.0, 0.05, steel).outside_by_outside_pressure == pytest.approx(0.05 * 0.7 / 206e9)
    # bore of a large body: r (1 + ν)/E
    assert Annulus(0.01, 100.0, steel).bore_by_bore_pressure == pytest.approx(0.01 * 1.3 / 206e9, rel=1e-6)
    # reciprocity (Betti): work of either pressure on the other's displacement
    wall = Annulus(0.07, 0.079, steel)
    assert 0.07 * wall.bore_by_outside_pressure == pytest.approx(0.079 * wall.outside_by_bore_pressure)


def test_compliances_of_the_71928_by_hand() -> None:
    """Outer ring alone 3.34e-10 m/N, inner ring with its shaft as one body 3.34e-11 m/N."""
    law = seated_rings(BEARING, FITS).law(COLD)
    per_force = 1.0 / (2.0 * math.pi * 0.024 * 206e9)
    outer_loose = per_force * ((0.086**2 + 0.095**2) / (0.095**2 - 0.086**2) + 0.3)
    inner_tight = per_force * ((0.030**2 + 0.079**2) / (0.079**2 - 0.030**2) - 0.3)
    assert outer_loose == pytest.approx(3.34e-10, rel=5e-3)
    assert inner_tight == pytest.approx(3.34e-11, rel=5e-3)
    assert -np.diff([law.growth(0.0), law.growth(1.0)])[0] == pytest.approx(outer_loose + inner_tight)


def lame_pressure(interference, bore, seat, outside, young_modulus, poisson_ratio):
    """Fit pressure from the radial displacement of each cylinder under pressure alone, Pa."""
    inner, middle, outer = bore / 2, seat / 2, outside / 2
    ring = middle / young_modulus * ((outer**2 + middle**2) / (outer**2 - middle**2) + poisson_ratio)
    shaft = middle / young_modulus * ((middle**2 + inner**2) / (middle**2 - inner**2) - poisson_ratio)
    return interference / 2 / (ring + shaft)


def disc_growth(radius, inner, outer, speed, density=7800.0, young=206e9, nu=0.3):
    """Radial growth of a turning annulus at ``radius``, plane stress."""
    factor = density * speed**2 * (3 + nu) / 8
    radial = factor * (inner**2 + outer**2 - (inner * outer / radius) ** 2 - radius**2)
    hoop = factor * (
        inner**2 + outer**2 + (inner * outer / radius) ** 2 - (1 + 3 * nu) / (3 + nu) * radius**2
    )
    return radius / young * (hoop - nu * radial)


def test_fit_pressure_is_that_of_lame_cylinders() -> None:
    """Another way to the pressure of a ring on a hollow shaft, cold and hot and turning."""
    one_steel = replace(FITS, ring_density=7800.0)
    for rise, speed in ((COLD, 0.0), (FitTemperatures(3.0, 0.0, 1.5), turn(3000))):
        overlap = 8e-6 + 12.5e-6 * 0.140 * (rise.shaft - rise.inner_ring)
        overlap -= 2.0 * (disc_growth(0.070, 0.070, 0.079, speed) - disc_growth(0.070, 0.030, 0.070, speed))
        state = seated_rings(BEARING, one_steel).state(0.0, rise, speed)
        expected = lame_pressure(overlap, 0.060, 0.140, 0.158, 206e9, 0.3)
        assert state.inner_pressure == pytest.approx(expected, rel=1e-9)
        assert state.inner_pressure > 0.0


def test_tight_ring_turns_like_one_body() -> None:
    """Ring and shaft of one steel with a fit: rotation grows the raceway as if there were no joint."""
    rings = seated_rings(BEARING, replace(FITS, inner_interference=60e-6, ring_density=7800.0))
    still, fast = (rings.state(0.0, COLD, speed).inner_growth for speed in (0.0, turn(4500)))
    raceway = replace(BEARING, pitch_diameter=0.158 + BEARING.ball_diameter * math.cos(math.radians(15.0)))
    assert fast - still == pytest.approx(rotation_growth(raceway, turn(4500), 0.060), rel=1e-12)


def test_interference_is_shared_as_harris_says() -> None:
    """Raceway growth by a fit on a solid shaft of the same steel: Δ_s = I (d/d_h) (the ring's outside)."""
    solid = replace(FITS, shaft_bore_diameter=0.0)
    growth = seated_rings(BEARING, solid).state(0.0, COLD).inner_growth
    # Harris & Kotzalas, table of diametral change by interference: I (d_bore/d_outside) for a solid shaft
    assert 2.0 * growth == pytest.approx(8e-6 * 140.0 / 158.0, rel=1e-12)


def test_press_fit_in_a_housing_as_harris_says() -> None:
    """Outer raceway shrinkage in a very thick housing of other material, against the two-ring formula."""
    iron = SeatMaterial(110e9, 0.26)
    fits = replace(FITS, outer_clearance=-10e-6, housing=iron)
    shrink = -seated_rings(BEARING, fits).state(0.0, COLD).outer_growth
    ring, wall = (95.0**2 + 86.0**2) / (95.0**2 - 86.0**2), (150.0**2 + 95.0**2) / (150.0**2 - 95.0**2)
    pressure_radius = 5e-6 / ((ring - 0.3) / 206e9 + (wall + 0.26) / 110e9)
    expected = pressure_radius * 2.0 * 95.0 * 86.0 / (95.0**2 - 86.0**2) / 206e9
    assert shrink == pytest.approx(expected, rel=1e-12)


def test_seats_open_and_close() -> None:
    rings = seated_rings(BEARING, FITS)
    loose = rings.state(0.0, COLD)
    assert loose.outer_pressure == 0.0
    assert loose.outer_gap == pytest.approx(2.5e-6)
    # ball load presses the outer ring into its housing, the inner one onto its shaft
    loaded = rings.state(30e3, COLD)
    assert loaded.outer_pressure > 0.0 == loaded.outer_gap
    assert loaded.inner_pressure > loose.inner_pressure
    # a hot ring on a cold shaft at speed lets go
    assert rings.state(0.0, FitTemperatures(inner_ring=8.0), turn(4500)).inner_gap > 0.0


@settings(max_examples=60)
@given(
    st.floats(-20e-6, 30e-6), st.floats(-20e-6, 30e-6), st.floats(-20.0, 60.0), st.floats(-20.0, 60.0),
    st.floats(0.0, 700.0), st.floats(0.0, 5e4),
)  # fmt: skip
def test_law_is_the_state_and_inverts(inner, outer, inner_rise, outer_rise, speed, force) -> None:
    rings = seated_rings(BEARING, replace(FITS, inner_interference=inner, outer_clearance=outer))
    rise = FitTemperatures(inner_rise, outer_rise, 0.7 * inner_rise, 0.5 * outer_rise)
    law = rings.law(rise, speed, 600.0)
    state = rings.state(force, rise, speed, 600.0)
    assert law.growth(force) == pytest.approx(state.inner_growth - state.outer_growth, abs=1e-15)
    assert law.force(law.growth(force)) == pytest.approx(force, abs=1e-6)
    assert law.growth(force + 10.0) < law.growth(force)


# ---------------------------------------------------------------- mounted bearings
def test_rings_that_hardly_give_way_are_the_rigid_bearing() -> None:
    stiff = replace(BEARING, width=1e4)
    fits = RingFits(0.0, 1e-9, 0.300, 0.060, 0.158, 0.172)
    state, rigid = mounted_state(stiff, fits, 568.6), axial_state(BEARING, 568.6)
    assert state.approach == pytest.approx(rigid.approach, rel=1e-4)
    assert state.contact_angle == pytest.approx(rigid.contact_angle, rel=1e-5)


def test_interference_closes_and_load_opens_the_contact_angle() -> None:
    angles = [mounted_state(BEARING, replace(FITS, inner_interference=fit), 568.6).contact_angle
              for fit in (0.0, 8e-6, 16e-6)]  # fmt: skip
    assert angles[0] > angles[1] > angles[2]
    # first order: d(cos α) = growth/BD with half the interference times the seat over the outside
    slope = (math.cos(angles[1]) - math.cos(angles[0])) * BEARING.curvature_centre_distance
    assert slope == pytest.approx(0.5 * 8e-6 * 0.8, rel=0.25)
    state = mounted_state(BEARING, FITS, 568.6)
    assert 30 * state.ball_load * math.sin(state.contact_angle) == pytest.approx(568.6)
    # Unloaded balls just touch: the fits alone set the angle.
    free = mounted_state(BEARING, FITS, 0.0)
    assert free.ball_load == 0.0
    radial = BEARING.curvature_centre_distance * (
        math.cos(free.contact_angle) - math.cos(BEARING.contact_angle)
    )
    assert radial == pytest.approx(seated_rings(BEARING, FITS).law(FitTemperatures()).growth(0.0), rel=1e-9)
    with pytest.raises(SpecError, match="must not be negative"):
        mounted_state(BEARING, FITS, -1.0)


def test_set_keeps_its_preload_at_assembly_whatever_the_fits() -> None:
    states = solve_bearing_set(tbt(FITS), 0.0, 0.0, uniform_temperatures(3, 293.15), control="outer")
    assert [state.axial_force for state in states] == pytest.approx([568.6, 568.6, 1137.2], rel=1e-7)
    mounted = mounted_state(BEARING, FITS, 568.6)
    assert states[0].contact_angle_inner == pytest.approx(mounted.contact_angle, rel=1e-7)
    rigid = solve_bearing_set(tbt(None), 0.0, 0.0, uniform_temperatures(3, 293.15), control="outer")
    assert states[0].axial_stiffness < 0.9 * rigid[0].axial_stiffness


def test_forces_balance_with_thrust_speed_and_heat() -> None:
    rings = BearingTemperatures(305.0, 299.0, 303.0, shaft_seat=304.0, housing_seat=297.0)
    hot = SetTemperatures((rings,) * 3, 304.0, 297.0)
    states = solve_bearing_set(tbt(FITS), turn(3000), 1750.0, hot, lubricant=GREASE)
    axial = [state.axial_force for state in states]
    assert axial[0] + axial[1] - axial[2] == pytest.approx(1750.0, rel=1e-8)
    assert all(state.residual < 1e-7 for state in states)


def test_raceways_stand_where_lame_puts_them() -> None:
    """Radial distance of the groove centres from the balls, against the rings' growth at those loads."""
    rings = BearingTemperatures(305.0, 299.0, 303.0, shaft_seat=304.0, housing_seat=297.0)
    hot = SetTemperatures((rings,) * 3, 304.0, 297.0)
    states = solve_bearing_set(tbt(FITS), 0.0, 1000.0, hot, control="outer")
    rise = FitTemperatures(*(value - 293.15 for value in (305.0, 299.0, 304.0, 297.0)))
    steel = BEARING.thermal_expansion
    for state in states:
        balls, diameter = state.balls, BEARING.ball_diameter
        free = 0.52 * diameter * (1.0 + steel * np.array([rise.inner_ring, rise.outer_ring]))
        rest = free - 0.5 * diameter * (1.0 + steel * (303.0 - 293.15))
        apart = float(((rest + balls.deformation[0]) * np.cos(balls.contact_angle[0])).sum())
        thermal = steel * (
            BEARING.inner_groove_centre_radius * rise.inner_ring
            - BEARING.outer_groove_centre_radius * rise.outer_ring
        )
        assembled = BEARING.curvature_centre_distance * math.cos(BEARING.contact_angle)
        radial = float(balls.weight @ (balls.load[:, 0] * np.cos(balls.contact_angle[:, 0])))
        seats = seated_rings(BEARING, FITS).state(radial, rise)
        assert apart - assembled - thermal == pytest.approx(
            seats.inner_growth - seats.outer_growth, abs=1e-11
        )
    rigid = solve_bearing_set(tbt(None), 0.0, 1000.0, hot, control="outer")
    assert states[2].preload < 0.9 * rigid[2].preload


def test_looser_housing_and_hot_housing_lower_the_preload() -> None:
    rings = BearingTemperatures(305.0, 299.0, 303.0)

    def preload(fits: RingFits, housing: float) -> float:
        hot = SetTemperatures((rings,) * 3, 304.0, housing)
        return solve_bearing_set(tbt(fits), 0.0, 0.0, hot, control="outer")[2].preload

    base = preload(FITS, 296.0)
    assert preload(replace(FITS, outer_clearance=30e-6), 296.0) < base
    assert preload(FITS, 303.0) < base
    # once loose the clearance no longer matters
    assert preload(replace(FITS, outer_clearance=30e-6), 296.0) == pytest.approx(
        preload(replace(FITS, outer_clearance=60e-6), 296.0)
    )


@pytest.mark.parametrize(
    ("geometry", "fits", "message"),
    [
        (replace(BEARING, bore_diameter=None), FITS, "bore_diameter: it is missing, but a fit needs it"),
        (BEARING, replace(FITS, housing_outer_diameter=0.18), "180 mm does not exceed outer_diameter 190 mm"),
        (
            BEARING,
            replace(FITS, shaft_bore_diameter=0.15),
            "140 mm does not exceed shaft_bore_diameter 150 mm",
        ),
        (BEARING, replace(FITS, shaft_bore_diameter=-0.01), "shaft_bore_diameter: it is -10 mm"),
        (BEARING, replace(FITS, inner_interference=1e-3), "1000 µm on 140 mm is no fit. Allowed: ± 280 µm"),
        (BEARING, replace(FITS, outer_clearance=math.nan), "nan µm on 190 mm is no fit"),
        (BEARING, replace(FITS, inner_ring_outer_diameter=0.18), "172 mm does not exceed inner_ring_outer"),
    ],
)
def test_fits_that_cannot_be_are_refused(geometry, fits, message: str) -> None:
    with pytest.raises(GeometryError) as caught:
        MountedBearing("A", geometry, 1, 0.0, fits)
    assert message in str(caught.value)
