"""Geometry, preload and lubricant: what they compute and what they refuse."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from spindle_fem.errors import GeometryError, NoEquilibriumError, OutOfValidityError, SpecError
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry, select_orientations
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.preload import (
    axial_force,
    axial_state,
    tandem_approach,
    unloading_thrust,
)

GOOD = {
    "ball_diameter": 14.2875e-3,
    "ball_count": 30,
    "pitch_diameter": 165e-3,
    "contact_angle": math.radians(15.0),
    "groove_curvature_inner": 0.52,
    "groove_curvature_outer": 0.52,
}
BEARING = BearingGeometry(**GOOD)
OIL = Lubricant(21e-6, 4.7e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"ball_count": 37},
            "37 balls of 14.2875 mm do not fit on a pitch circle of 165 mm. At most 36 balls fit.",
        ),
        ({"ball_count": 2}, "ball_count is 2. It must be a whole number from 3."),
        ({"pitch_diameter": 14e-3}, "the ball (14.2875 mm) is not smaller than the pitch circle (14 mm)"),
        ({"contact_angle": math.radians(70.0)}, "a contact angle of 70° lies over any shoulder (65°)"),
        (
            {"contact_angle": math.radians(35.0), "shoulder_angle": math.radians(30.0)},
            "a contact angle of 35° lies over the shoulder (30°)",
        ),
        ({"contact_angle": -0.1}, "or below 0"),
        ({"groove_curvature_inner": 0.49}, "It must be above 0.5 (the ball must enter the groove)"),
        ({"groove_curvature_outer": 0.9}, "at most 0.7"),
        ({"ball_diameter": -1e-3}, "ball_diameter is -0.001. It must be above 0."),
        ({"poisson_ratio": 0.5}, "Allowed: 0 to below 0.5."),
        ({"bore_diameter": 0.16}, "160 mm leaves no inner ring under balls that reach in to 150.713 mm"),
        ({"outer_diameter": 0.17}, "170 mm leaves no outer ring over balls that reach out to 179.288 mm"),
    ],
)
def test_geometry_that_cannot_be_assembled(change: dict, message: str) -> None:
    with pytest.raises(GeometryError) as caught:
        BearingGeometry(**(GOOD | change))
    assert message in str(caught.value)


def test_36_balls_just_fit() -> None:
    assert BearingGeometry(**(GOOD | {"ball_count": 36})).ball_count == 36


def test_arrangements() -> None:
    assert select_orientations("QBC") == (1, 1, -1, -1)
    assert select_orientations("DF") == (-1, 1)
    assert select_orientations([1, -1, -1]) == (1, -1, -1)
    with pytest.raises(SpecError, match='Did you mean "back_to_back"'):
        select_orientations("back-to-back")
    with pytest.raises(SpecError, match="Allowed: a list of 1 and -1"):
        select_orientations([1, 0])


def test_negative_preload_is_refused() -> None:
    with pytest.raises(SpecError, match=r"preload is -5 N. It must not be negative."):
        tandem_approach((BEARING,), -5.0)


def test_too_much_thrust_climbs_the_shoulder() -> None:
    low_shoulder = replace(BEARING, shoulder_angle=math.radians(25.0))
    limit = axial_force(low_shoulder, axial_state(low_shoulder, 5000.0).approach)
    assert limit == pytest.approx(5000.0)
    with pytest.raises(
        NoEquilibriumError, match=r"lifts the balls over the shoulder at 25.0°. Allowed: up to"
    ):
        axial_state(low_shoulder, 1e6)


def test_tandem_shares_by_common_displacement() -> None:
    smaller = replace(BEARING, ball_count=20)
    approach = tandem_approach((BEARING, smaller), 1000.0)
    assert axial_force(BEARING, approach) + axial_force(smaller, approach) == pytest.approx(1000.0)
    assert axial_force(smaller, approach) / axial_force(BEARING, approach) == pytest.approx(20 / 30)


def test_unloading_needs_a_counter_bearing() -> None:
    assert unloading_thrust((BEARING, BEARING), (1, 1), 500.0) == math.inf
    both = unloading_thrust((BEARING,) * 3, (1, 1, -1), 1137.2)
    other = unloading_thrust((BEARING,) * 3, (1, 1, -1), 1137.2, direction=-1)
    # two bearings carry twice the force of one at the same approach
    assert both == pytest.approx(2.0 * other)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kinematic_viscosity_100": 30e-6}, "Viscosity must fall with temperature"),
        ({"viscosity_law": "vogel"}, "Allowed: walther, roelands."),
        ({"path_fill": 0.5}, "path_fill is 0.5. Allowed: 0 to 0.3."),
        ({"film_starvation": 0.0}, "Allowed: 0.05 to 1."),
        ({"pressure_viscosity": 1.0}, "Allowed: 1e-9 to 1e-7 1/Pa."),
    ],
)
def test_what_is_no_lubricant(change: dict, message: str) -> None:
    with pytest.raises(SpecError) as caught:
        replace(OIL, **change)
    assert message in str(caught.value)


@pytest.mark.parametrize(("celsius", "message"), [(-60.0, "-60.0 °C lies outside"), (199.0, "mm²/s")])
def test_temperature_outside_the_viscosity_fit(celsius: float, message: str) -> None:
    with pytest.raises(OutOfValidityError) as caught:
        OIL.kinematic_viscosity(celsius + 273.15)
    assert message in str(caught.value)


@pytest.mark.parametrize("law", ["walther", "roelands"])
def test_both_laws_meet_both_points(law: str) -> None:
    oil = replace(OIL, viscosity_law=law)
    assert oil.kinematic_viscosity([313.15, 373.15]) == pytest.approx([21e-6, 4.7e-6], rel=1e-9)
    assert float(oil.viscosity_slope(313.15)) > 0.0


def test_temperature_warnings() -> None:
    assert OIL.temperature_warnings(313.15) == ()
    codes = [warning.code for warning in OIL.temperature_warnings(400.0)]
    assert codes == ["grease_temperature", "viscosity_fit_extrapolated"]
    assert "126.9 °C is above the grease's limit of 120.0 °C" in OIL.temperature_warnings(400.0)[0].text


def test_given_pressure_viscosity_is_met_at_40_degc() -> None:
    oil = replace(OIL, pressure_viscosity=1.8e-8)
    assert float(oil.pressure_viscosity_coefficient(313.15)) == pytest.approx(1.8e-8)
    assert float(oil.pressure_viscosity_coefficient(353.15)) < 1.8e-8
