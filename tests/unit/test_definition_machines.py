"""The reference spindle as its page fixes it: dimensions, marks, heat table, conventions."""

from __future__ import annotations

import math

import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.units import Uncertain

WU_TAN = load_machine("wu_tan_2016")
RECORDED = load_machine("recorded_spindle")

# part, segment: z from, z to, inner Ø, outer Ø in mm
SECTIONS = {
    ("shaft", "nose"): (0, 45, 60, 180),
    ("shaft", "front_seat"): (45, 137, 60, 140),
    ("shaft", "front_locknut"): (137, 157, 60, 165),
    ("shaft", "middle"): (157, 430, 60, 130),
    ("shaft", "rear_seat"): (430, 484, 60, 120),
    ("shaft", "rear_locknut"): (484, 500, 60, 140),
    ("shaft", "drive_end"): (500, 560, 60, 110),
    ("front_inner_spacer", "ring"): (93, 113, 140, 154),
    ("front_outer_spacer", "ring"): (93, 113, 176, 190),
    ("rear_inner_spacer", "ring"): (452, 462, 120, 132),
    ("rear_outer_spacer", "ring"): (452, 462, 153, 165),
    ("housing", "flange"): (40, 65, 190, 380),
    ("housing", "front_body"): (65, 180, 190, 300),
    ("housing", "shoulder"): (137, 150, 178, 190),
    ("housing", "middle_body"): (180, 410, 180, 300),
    ("housing", "rear_body"): (410, 490, 165, 260),
    ("cover", "ring"): (25, 40, 182, 300),
}

BEARINGS = {
    "F1": ("front", 45, 69, "towards_rear"),
    "F2": ("front", 69, 93, "towards_rear"),
    "F3": ("front", 113, 137, "towards_nose"),
    "R1": ("rear", 430, 452, "towards_rear"),
    "R2": ("rear", 462, 484, "towards_nose"),
}


@pytest.mark.parametrize("spec", [WU_TAN, RECORDED], ids=lambda spec: spec.name)
def test_every_part_has_its_dimensions(spec):
    sections = {
        (part.name, segment.name): (*segment.z, segment.inner_diameter, segment.outer_diameter)
        for part in spec.part
        for segment in part.segment
    }
    assert sections.keys() == SECTIONS.keys()
    for key, section in sections.items():
        assert section == pytest.approx([1e-3 * value for value in SECTIONS[key]], abs=1e-12), key


def test_parts_turn_and_are_made_as_stated():
    assert [part.name for part in WU_TAN.part if part.rotating] == [
        "shaft",
        "front_inner_spacer",
        "rear_inner_spacer",
    ]
    assert {part.name: part.material for part in WU_TAN.part} == {
        "shaft": "steel_42CrMo4",
        "front_inner_spacer": "steel_42CrMo4",
        "rear_inner_spacer": "steel_42CrMo4",
        "front_outer_spacer": "steel_42CrMo4",
        "rear_outer_spacer": "steel_42CrMo4",
        "housing": "cast_iron",
        "cover": "cast_iron",
    }
    properties = {
        name: (item.thermal_conductivity, item.density, item.specific_heat_capacity)
        for name, item in WU_TAN.materials.items()
    }
    assert properties == {
        "steel_42CrMo4": (42.0, 7850.0, 470.0),
        "steel_100Cr6": (46.0, 7810.0, 475.0),
        "cast_iron": (50.0, 7200.0, 500.0),
    }


def test_bearings_stand_and_carry_as_stated():
    found = {
        bearing.name: (group.name, *(round(1e3 * z, 9) for z in bearing.z), bearing.takes_thrust)
        for group, bearing in WU_TAN.bearings
    }
    assert found == BEARINGS
    assert [group.preload for group in WU_TAN.bearing_set] == [1137.2, 1137.2]
    assert [group.carries_thrust for group in WU_TAN.bearing_set] == [True, False]


@pytest.mark.parametrize(
    ("name", "bore", "outside", "width", "inner_ring", "outer_ring", "pitch", "ball", "count"),
    [
        ("71928_CD", 140, 190, 24, 158, 172, 165, 14.2875, 30),
        ("71924_CD", 120, 165, 22, 135, 150, 142.5, 13.494, 27),
    ],
)
def test_bearing_types(name, bore, outside, width, inner_ring, outer_ring, pitch, ball, count):
    kind = WU_TAN.bearing_types[name]
    lengths = (
        kind.bore_diameter,
        kind.outer_diameter,
        kind.width,
        kind.inner_ring_outer_diameter,
        kind.outer_ring_inner_diameter,
        kind.pitch,
        kind.ball_diameter,
    )
    expected = (bore, outside, width, inner_ring, outer_ring, pitch, ball)
    assert lengths == pytest.approx([1e-3 * value for value in expected], rel=1e-12)
    assert kind.ball_count == count
    assert (kind.groove_curvature_inner, kind.groove_curvature_outer) == (0.52, 0.52)
    assert kind.contact_angle == pytest.approx(math.radians(15.0), rel=1e-12)
    assert (kind.roughness_raceway, kind.roughness_ball) == pytest.approx((0.05e-6, 0.01e-6))


def test_channel_and_operation():
    channel, coolant, operation = WU_TAN.channel, WU_TAN.coolant, WU_TAN.operation
    assert (channel.inner_radius, channel.depth, channel.width, channel.pitch, channel.z_start) == (
        0.108,
        0.010,
        0.012,
        0.024,
        0.048,
    )
    assert (channel.turns, channel.starts, channel.hand, channel.ports.diameter) == (5.0, 1, "right", 0.010)
    assert operation.speed == pytest.approx(100.0 * math.pi, rel=1e-12)
    assert (operation.thrust, operation.ambient_temperature) == pytest.approx((1750.0, 290.75))
    assert (coolant.inlet_temperature, coolant.flow) == pytest.approx((288.15, 20e-3 / 60.0), rel=1e-12)


MARKS = {
    "P": [
        *(("operation", key) for key in ("speed", "thrust", "ambient_temperature")),
        ("bearing_set.front", "preload"),
        ("bearing_set.rear", "preload"),
        ("bearing_types.71928_CD", "pitch_diameter"),
        ("grease", "kinematic_viscosity_40"),
        ("grease", "kinematic_viscosity_100"),
        ("heat", "ball_share"),
        ("channel", "depth"),
        ("coolant", "fluid"),
        ("coolant", "inlet_temperature"),
    ],
    "C": [
        *(
            ("bearing_types.71928_CD", key)
            for key in ("bore_diameter", "outer_diameter", "width", "contact_angle")
        ),
        *(("bearing_types.71924_CD", key) for key in ("ball_diameter", "ball_count", "contact_angle")),
        ("part.shaft.segment.front_seat", "outer_diameter"),
        ("part.shaft.segment.rear_seat", "outer_diameter"),
    ],
    "A": [
        ("coolant", "flow"),
        ("coolant", "film_model"),
        ("channel", "width"),
        ("channel", "turns"),
        ("heat", "inner_share"),
        ("heat", "model"),
        ("grease", "path_fill"),
        ("grease", "base_oil_density"),
        ("bearing_types.71928_CD", "ball_diameter"),
        ("bearing_types.71928_CD", "ball_count"),
        ("bearing_types.71928_CD", "groove_curvature_inner"),
        ("part.shaft.segment.front_seat", "z"),
        ("part.shaft.segment.nose", "outer_diameter"),
    ],
}


def table_at(spec, path):
    table = spec
    for key in path.split("."):
        if isinstance(table, tuple):
            table = next(item for item in table if item.name == key)
        else:
            table = table[key] if isinstance(table, dict) else getattr(table, key)
    return table


@pytest.mark.parametrize("mark", MARKS)
def test_values_carry_the_mark_of_where_they_come_from(mark):
    assert {(path, key): table_at(WU_TAN, path).mark_of(key) for path, key in MARKS[mark]} == dict.fromkeys(
        MARKS[mark], mark
    )


HEAT = {
    "F1": (0, 15, 35, 60, 88, 120, 155, 192, 232, 274),
    "F2": (0, 15, 35, 60, 88, 120, 155, 192, 232, 274),
    "F3": (0, 14, 31, 54, 80, 108, 140, 174, 209, 247),
    "R1": (0, 8, 19, 33, 48, 66, 85, 105, 127, 150),
    "R2": (0, 8, 19, 33, 48, 66, 85, 105, 127, 150),
}


def test_the_recorded_spindle_takes_its_heat_from_the_table():
    heat = RECORDED.heat
    assert (heat.model, heat.ball_share, heat.inner_share) == ("table", 0.0, Uncertain(0.5, 0.1))
    assert heat.table.heat == HEAT
    assert heat.table.speed == pytest.approx([500.0 * step * math.pi / 30.0 for step in range(10)], rel=1e-12)
    assert heat.table.thrust_coefficient == {"F1": 0.10, "F2": 0.10, "F3": -0.04}
    assert heat.table.reference_thrust == 1750.0


def test_the_recorded_spindle_joins_lumped_balls_by_constants():
    rows = {group.name: group.ball_row for group in RECORDED.bearing_set}
    assert {name: (row.kind, row.conductance.value, row.capacity) for name, row in rows.items()} == {
        "front": ("constant", 4.0, 170.0),
        "rear": ("constant", 3.0, 119.0),
    }


def test_the_recorded_spindle_is_cooled_and_exchanges_as_stated():
    coolant = RECORDED.coolant
    assert (coolant.film_model, coolant.properties_at, coolant.pumping_heat) == (
        "sieder_tate",
        "inlet",
        False,
    )
    assert coolant.flow == pytest.approx(20e-3 / 60.0, rel=1e-12)
    assert RECORDED.channel.ports is None
    assert RECORDED.channel == WU_TAN.channel.model_copy(
        update={"ports": None, "marks": RECORDED.channel.marks}
    )
    films = {film.name: film for film in RECORDED.film}
    assert films["outside"].coefficient == Uncertain(10.0, 0.3)
    assert films["flange_back"].coefficient == Uncertain(200.0, 0.5)
    assert (films["nose_end"].diameter, films["nose_end"].minimum) == (0.18, 10.0)
    assert (films["drive_end"].diameter, films["drive_end"].minimum) == (0.11, 10.0)
    air_gap, labyrinth = RECORDED.gap
    assert (air_gap.at_rest, air_gap.rise, air_gap.exponent) == (8.0, 12.0, 0.75)
    assert air_gap.reference_speed == pytest.approx(100.0 * math.pi, rel=1e-12)
    assert (labyrinth.at_rest, labyrinth.rise) == (30.0, 0.0)
    joints = {joint.name: joint.conductance.value for joint in RECORDED.joint}
    assert joints == {
        "inner_ring_seats": 10000.0,
        "front_outer_ring_seats": 4000.0,
        "rear_outer_ring_seats": 4000.0,
        "axial_contacts": 8000.0,
        "nose_clearance": 0.0,
    }
    assert RECORDED.initial == "ambient"


def test_the_recorded_spindle_is_the_reference_spindle_otherwise():
    for field in (
        "operation",
        "materials",
        "part",
        "bearing_types",
        "joint",
        "surface",
        "gap",
        "probe",
    ):
        assert getattr(RECORDED, field) == getattr(WU_TAN, field)


def test_probes_stand_where_stated():
    points = {probe.name: (probe.part, probe.r, probe.z, probe.angle) for probe in WU_TAN.probe[:-1]}
    assert points == {
        "SP01": ("housing", 0.096, 0.057, 0.0),
        "SP02": ("housing", 0.096, 0.081, 0.0),
        "SP03": ("housing", 0.096, 0.125, 0.0),
        "SP04": ("housing", 0.091, 0.290, 0.0),
        "SP05": ("housing", 0.0835, 0.457, 0.0),
    }
    assert WU_TAN.probe[-1].kind == "coolant_outlet"
