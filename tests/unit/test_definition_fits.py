"""Fits, expansion and assembly temperature in a machine definition."""

import math

import pytest

from spindle_fem.commands.checked_machine import load_buildable
from spindle_fem.definition.bearing_seats import followed_joint_faults, seat_diameter
from spindle_fem.definition.exchange_tables import SeatSurface
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import BadInputError, FaultsError, SpecError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.operation.bearing_heat import BearingMechanics, BearingTemperatures
from spindle_fem.operation.operating_point import OperatingPoint


def mechanics(*settings: str) -> tuple[BearingMechanics, OperatingPoint]:
    spec = load_machine("wu_tan_2016", settings)
    return BearingMechanics(spec), OperatingPoint.of(spec)


def everywhere(machine: BearingMechanics, celsius: float) -> dict[str, BearingTemperatures]:
    kelvin = celsius + 273.15
    return {bearing.name: BearingTemperatures(*(kelvin,) * 5) for _, bearing in machine.spec.bearings}


def test_fits_of_the_reference_spindle_find_their_parts() -> None:
    spec = load_machine("wu_tan_2016")
    kind = spec.bearing_types["71928_CD"]
    front = spec.bearing_set[0]
    assert [seat_diameter(spec, kind, bearing, "outer") for bearing in front.bearing] == [
        ("housing", 0.380), ("housing", 0.300), ("housing", 0.300),
    ]  # fmt: skip
    assert seat_diameter(spec, kind, front.bearing[0], "inner") == ("shaft", 0.060)
    fits = BearingMechanics(spec).sets["front"].bearings[1].fits
    assert (fits.inner_interference, fits.outer_clearance) == pytest.approx((8e-6, 15e-6))
    assert (fits.housing.young_modulus, fits.housing.thermal_expansion) == pytest.approx((110e9, 10.5e-6))
    assert fits.shaft.young_modulus == pytest.approx(206e9)


def test_fits_act_with_thermal_preload_only() -> None:
    with_fit, point = mechanics()
    without, _ = mechanics("bearing_set.front.fit=none", "bearing_set.rear.fit=none")
    warm = everywhere(with_fit, 30.0)
    angle = {
        (fit, expand): machine.states(point, warm, expand=expand)["F1"].contact_angle_inner
        for fit, machine in (("fit", with_fit), ("none", without))
        for expand in (True, False)
    }
    assert angle["fit", False] == angle["none", False]
    assert angle["fit", True] < angle["none", True] - math.radians(0.2)


def test_assembly_temperature_moves_the_neutral_state() -> None:
    """Steel shaft in iron housing: what is assembled warm loosens the housing less when warm."""
    near = "bearing_set.front.fit.outer_clearance=5 um"
    cold, point = mechanics(near)
    warm, _ = mechanics(near, "bearing_set.front.assembly_temperature=30 degC")
    state = {
        name: machine.states(point, everywhere(cold, 30.0), expand=True)["F3"].preload
        for name, machine in (("cold", cold), ("warm", warm))
    }
    # 10 K above assembly the steel rings have grown 2e-6/K more than the iron around them
    assert state["cold"] > state["warm"]


def test_wetted_share_sets_the_way_of_heat_through_the_grease() -> None:
    paths = {}
    for share in ("none", "0", "0.3", "0.6"):
        machine, point = mechanics(f"grease.wetted_share={share}")
        paths[share] = machine(point, everywhere(machine, 30.0))[0]["F1"].conductance_inner
    assert paths["none"] == paths["0.3"]
    assert paths["0.6"] - paths["0.3"] == pytest.approx(paths["0.3"] - paths["0"])
    assert 0.5 < paths["0"] < 2.0


def test_rings_that_nothing_touches_are_told_once_and_with_the_face_that_is_nearest() -> None:
    with pytest.raises(FaultsError) as caught:
        load_machine(
            "wu_tan_2016",
            ["part.shaft.segment.front_seat.outer_diameter=139 mm"],
            checks=(build_assembly,),
        )
    (text,) = map(str, caught.value.faults)
    assert 'sit on nothing: part "shaft" ends at r 69.5 mm there, the seat is at r 70 mm' in text
    assert '"F1.inner_ring", "F2.inner_ring"' in text


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["bearing_set.front.fit.inner_interference=2 mm"], "Allowed: -0.001 to 0.001 m."),
        (["bearing_set.front.fit.outer_clearance=5 N"], "5 N"),
        (["bearing_set.front.fit.play=5 um"], "bearing_set.front.fit.play"),
        (
            ["part.shaft.rotating=false"],
            "bearing_set.front.fit: the inner ring of F1 sits on no part: none that turns has a face",
        ),
        # a spacer of the seat's diameter reaches under F2, whose seat itself is off
        (
            [
                "part.shaft.segment.front_seat.outer_diameter=139.8 mm",
                "part.front_inner_spacer.segment.ring.z=['92 mm', '113 mm']",
            ],
            "part.shaft.segment.front_seat.outer_diameter: the inner ring of F2 sits on no part: this face "
            "has 139.8 mm, its seat 140 mm. Allowed: 140 mm.",
        ),
        (["materials.cast_iron.thermal_expansion=12 K"], "thermal_expansion"),
        (
            ["bearing_set.front.fit.outer_clearance=60 um"],
            "front.fit.outer_clearance: the ring has 60 µm of clearance on its seat, more than the play "
            "of the bearing itself (39 µm on the diameter)",
        ),
        (
            ["bearing_set.rear.fit.inner_interference=-60 um"],
            "rear.fit.inner_interference: the ring has 60 µm",
        ),
        (
            ["bearing_set.front.fit.inner_interference=300 um"],
            "bearing_set.front.fit.inner_interference: the ring has 300 µm of interference on its seat of "
            "140 mm, which makes it yield. Allowed: up to 280 µm on the diameter.",
        ),
        (
            ["bearing_set.rear.fit.outer_clearance=-400 um"],
            "bearing_set.rear.fit.outer_clearance: the ring has 400 µm of interference",
        ),
        (
            ["heat.thermal_preload=true", "materials.cast_iron.thermal_expansion=0 1/K"],
            "materials.cast_iron.thermal_expansion: it is 0, but heat.thermal_preload follows",
        ),
        (
            [
                "joint.inner_ring_seats.seat.slope=0.1",
                *(f"bearing_set.{s}.fit=none" for s in ("front", "rear")),
            ],
            "joint.inner_ring_seats.seat: no bearing set has a fit.",
        ),
    ],
)
def test_bad_fits_are_refused(settings: list[str], message: str) -> None:
    with pytest.raises(BadInputError) as caught:
        load_machine("wu_tan_2016", settings)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            "front.fit.inner_interference=60 um",
            "front.fit.inner_interference: the fits bring the raceways of F1 51 µm together, all of "
            "the play of the bearing .39 µm on the diameter.",
        ),
        ("rear.fit.outer_clearance=-80 um", "rear.fit.outer_clearance: the fits bring the raceways of R1"),
        (
            "front.preload=400 kN",
            r"front.preload: it presses the balls of F3 on with 4.26 GPa.*up to 4.2 GPa",
        ),
    ],
)
def test_fits_and_preload_that_do_not_go_together_are_refused(setting: str, message: str) -> None:
    with pytest.raises(SpecError, match="bearing_set." + message):
        mechanics("bearing_set." + setting)


def test_a_clearance_beyond_the_play_is_one_fault() -> None:
    with pytest.raises(BadInputError) as told:
        load_buildable("wu_tan_2016", ["bearing_set.front.fit.outer_clearance=500 um"])
    assert "front.fit.outer_clearance: the ring has 500 µm of clearance on its seat" in str(told.value)
    assert str(told.value).count("outer_clearance") == 1


def test_a_perfect_joint_cannot_follow_its_fit() -> None:
    spec = load_machine("wu_tan_2016")
    perfect = spec.joint[0].model_copy(update={"conductance": "perfect", "seat": SeatSurface()})
    (fault,) = followed_joint_faults(spec.model_copy(update={"joint": (perfect,)}))
    assert 'its conductance is "perfect"' in str(fault)
