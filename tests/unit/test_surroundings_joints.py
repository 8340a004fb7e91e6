import numpy as np
import pytest

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.surroundings.joint_conductance_laws import (
    gap_conductance,
    harmonic_conductivity,
    interference_fit,
    joint_conductance_mikic_elastic,
    joint_conductance_yovanovich,
    mean_plane_separation,
    seat_conductance,
)

STEEL = {"young_modulus": 206e9, "poisson_ratio": 0.3, "density": 7850.0, "expansion_coefficient": 12e-6}
SEAT = (0.060, 0.140, 0.158)


def lame_pressure(interference, bore, seat, outside, young_modulus, poisson_ratio):
    """Fit pressure from the radial displacement of each cylinder under pressure alone."""
    inner, middle, outer = bore / 2, seat / 2, outside / 2
    ring = middle / young_modulus * ((outer**2 + middle**2) / (outer**2 - middle**2) + poisson_ratio)
    shaft = middle / young_modulus * ((middle**2 + inner**2) / (middle**2 - inner**2) - poisson_ratio)
    return interference / 2 / (ring + shaft)


def disc_growth(radius, inner, outer, speed):
    """Radial growth of a turning annulus at ``radius``, plane stress."""
    nu, young, density = STEEL["poisson_ratio"], STEEL["young_modulus"], STEEL["density"]
    factor = density * speed**2 * (3 + nu) / 8
    radial = factor * (inner**2 + outer**2 - (inner * outer / radius) ** 2 - radius**2)
    hoop = factor * (
        inner**2 + outer**2 + (inner * outer / radius) ** 2 - (1 + 3 * nu) / (3 + nu) * radius**2
    )
    return radius / young * (hoop - nu * radial)


@pytest.mark.parametrize("bore", [0.0, 0.060, 0.120])
def test_fit_pressure_is_lames(bore):
    fit = interference_fit(20e-6, bore, 0.140, 0.158, **STEEL)
    assert float(fit.pressure) == pytest.approx(
        lame_pressure(20e-6, bore, 0.140, 0.158, 206e9, 0.3), rel=1e-12
    )
    assert float(fit.radial_gap) == 0.0


def test_a_warmer_ring_loosens_and_a_warmer_shaft_tightens():
    rises = {"shaft_rise": np.array([0.0, 10.0, 0.0]), "ring_rise": np.array([0.0, 0.0, 5.0])}
    fit = interference_fit(20e-6, *SEAT, **STEEL, **rises)
    expected = 20e-6 + 12e-6 * 0.140 * np.array([0.0, 10.0, -5.0])
    np.testing.assert_allclose(fit.interference, expected, rtol=1e-12)
    assert fit.pressure[1] > fit.pressure[0] > fit.pressure[2] > 0.0
    # Both warm alike: nothing changes.
    alike = interference_fit(20e-6, *SEAT, **STEEL, shaft_rise=30.0, ring_rise=30.0)
    assert float(alike.pressure) == pytest.approx(float(fit.pressure[0]), rel=1e-12)


def test_speed_loosens_by_the_growth_of_ring_less_shaft():
    speed = 471.2
    fit = interference_fit(20e-6, *SEAT, **STEEL, angular_speed=speed)
    ring = disc_growth(0.070, 0.070, 0.079, speed)
    shaft = disc_growth(0.070, 0.030, 0.070, speed)
    assert float(fit.interference) == pytest.approx(20e-6 - 2 * (ring - shaft), rel=1e-9)


def test_a_loose_ring_has_a_gap_and_no_pressure():
    fit = interference_fit([-5e-6, 0.0], *SEAT, **STEEL)
    np.testing.assert_allclose(fit.pressure, 0.0)
    np.testing.assert_allclose(fit.radial_gap, [2.5e-6, 0.0])


def test_yovanovich_by_hand():
    # 1.25·43.9·(0.1/1e-6)·(10/3000)^0.95
    assert float(joint_conductance_yovanovich(10e6, 43.9, 1e-6, 0.1, 3e9)) == pytest.approx(24334.0, rel=1e-3)
    assert float(joint_conductance_yovanovich(0.0, 43.9, 1e-6, 0.1, 3e9)) == 0.0


def test_mikic_by_hand_and_exponent():
    one = joint_conductance_mikic_elastic(10e6, 43.9, 1e-6, 0.1, 113.2e9)
    # 1.55·43.9e5·(1.2493e-3)^0.94
    assert float(one) == pytest.approx(12697.0, rel=1e-3)
    two = joint_conductance_mikic_elastic(20e6, 43.9, 1e-6, 0.1, 113.2e9)
    assert float(two / one) == pytest.approx(2.0**0.94, rel=1e-12)


def test_gap_conducts_as_a_layer_of_gas_with_its_jump():
    assert float(gap_conductance(1e-3)) == pytest.approx(26.0, rel=1e-3)
    assert float(gap_conductance(0.0)) == pytest.approx(0.026 / 0.37e-6)
    assert float(gap_conductance(5e-6, 0.14, 0.0)) == pytest.approx(28000.0)


def test_separation_falls_with_pressure():
    y = mean_plane_separation([1e6, 1e7], 1e-6, 3e9)
    assert y[0] > y[1] > 1e-6
    assert y[0] / y[1] == pytest.approx(10.0**0.097)


def test_seat_conductance_has_no_jump_where_the_ring_comes_loose():
    fit = interference_fit([-1e-12, 0.0, 1e-12], *SEAT, **STEEL)
    found = seat_conductance(fit, 43.9, 1e-6, 0.1, 3e9)
    np.testing.assert_allclose(found, found[1], rtol=1e-4)


def test_seat_conductance_grows_with_interference():
    fit = interference_fit(np.linspace(-20e-6, 40e-6, 61), *SEAT, **STEEL)
    assert (np.diff(seat_conductance(fit, 43.9, 1e-6, 0.1, 3e9)) > 0.0).all()


def test_seats_of_the_reference_spindle_are_of_the_assumed_size():
    # Inner rings 10 000 W/(m²K) with 30 %, outer rings (5 µm clearance) 4000 with 40 %;
    # ground surfaces, 1 µm rms together.
    inner = seat_conductance(interference_fit(10e-6, *SEAT, **STEEL), 43.9, 1e-6, 0.1, 3e9)
    assert 6e3 < float(inner) < 16e3
    outer = seat_conductance(interference_fit(-5e-6, 0.140, 0.190, 0.300, **STEEL), 46.0, 1e-6, 0.1, 3e9)
    assert 2e3 < float(outer) < 8e3


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: harmonic_conductivity(0.0, 40.0), "conductivity_a is 0, allowed above 0"),
        (lambda: joint_conductance_yovanovich(-1.0, 40.0, 1e-6, 0.1, 3e9), "pressure_over_hardness is"),
        (lambda: joint_conductance_yovanovich(1e9, 40.0, 1e-6, 0.1, 3e9), "treat the joint as perfect"),
        (lambda: joint_conductance_yovanovich(1e6, 40.0, 0.0, 0.1, 3e9), "roughness is 0"),
        (lambda: joint_conductance_mikic_elastic(1e6, 40.0, 1e-6, 0.1, -1.0), "contact_modulus is -1"),
        (lambda: mean_plane_separation(0.0, 1e-6, 3e9), "give the clearance as separation"),
        (lambda: gap_conductance(-1e-6), "separation is -1e-06, allowed at least 0"),
        (lambda: gap_conductance(0.0, 0.026, 0.0), "heat_path is 0, allowed above 0"),
        (lambda: interference_fit(1e-5, 0.14, 0.14, 0.16, young_modulus=206e9), "shaft_bore is 0.14"),
        (
            lambda: interference_fit(1e-5, 0.06, 0.16, 0.15, young_modulus=206e9),
            "ring_outer_diameter is 0.15",
        ),
        (
            lambda: interference_fit(1e-5, 0.06, 0.14, 0.16, young_modulus=206e9, poisson_ratio=0.7),
            "poisson_ratio is 0.7, allowed 0 to 0.5",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(OutOfValidityError) as caught:
        call()
    assert message in str(caught.value)
