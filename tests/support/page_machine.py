# ruff: noqa: E501  (a mistake a line)
"""A machine in a page, as a designer writes it who reads docs/machine_definition.md, and drafts of it with mistakes.

A milling spindle with 7014 and 7012 hybrid bearings, a built-in motor and a jacket of water and glycol around it.
"""

from collections.abc import Iterable

PAGE = """\
schema = "spindle-fem/machine/1"
name = "milling_spindle"
title = "Milling spindle 7014/7012, hybrid, built-in motor, water-glycol jacket"
surroundings = "workshop"
grease = {catalogue = "high_speed_grease"}
heat = {model = "palmgren", palmgren_f0 = 1.5}
operation = {speed = "12000 rpm", thrust = "500 N", ambient_temperature = "22 degC"}
source = [
    {name = "stator_losses", part = "stator", heat = "900 W"},
    {name = "rotor_losses", part = "rotor", heat = {speed = ["0 rpm", "12000 rpm"], heat = ["20 W", "120 W"]}},
]
film = [
    {kind = "circuit", name = "jacket", duct = "annulus", part = "housing", diameter = "176 mm", outer_diameter = "182 mm", z = ["130 mm", "330 mm"], fluid = "ethylene_glycol_30", inlet_temperature = "20 degC", flow = "12 L/min"},
]
probe = [
    {name = "FRONT", part = "housing", r = "57 mm", z = "55 mm"},
    {name = "WINDING", part = "stator", r = "60 mm", z = "230 mm"},
    {name = "GLYCOL_OUT", kind = "circuit_outlet", circuit = "jacket"},
]

[[part]]
name = "shaft"
material = "case_hardening_steel"
rotating = true
segment = [
    {name = "nose", z = ["0 mm", "45 mm"], inner_diameter = "32 mm", outer_diameter = "85 mm"},
    {name = "front_seat", z = ["45 mm", "120 mm"], inner_diameter = "32 mm", outer_diameter = "70 mm"},
    {name = "rotor_seat", z = ["120 mm", "340 mm"], inner_diameter = "32 mm", outer_diameter = "68 mm"},
    {name = "rear_seat", z = ["340 mm", "386 mm"], inner_diameter = "32 mm", outer_diameter = "60 mm"},
    {name = "end", z = ["386 mm", "420 mm"], inner_diameter = "32 mm", outer_diameter = "55 mm"},
]
[[part]]
name = "rotor"
material = "electrical_steel"
rotating = true
segment = [{name = "stack", z = ["150 mm", "310 mm"], inner_diameter = "68 mm", outer_diameter = "99 mm"}]
[[part]]
name = "stator"
material = "electrical_steel"
segment = [{name = "stack", z = ["150 mm", "310 mm"], inner_diameter = "100 mm", outer_diameter = "160 mm"}]
[[part]]
name = "housing"
material = "steel"
segment = [
    {name = "front", z = ["45 mm", "120 mm"], inner_diameter = "110 mm", outer_diameter = "230 mm"},
    {name = "stop", z = ["120 mm", "130 mm"], inner_diameter = "95 mm", outer_diameter = "230 mm"},
    {name = "sleeve", z = ["130 mm", "330 mm"], inner_diameter = "160 mm", outer_diameter = "176 mm"},
    {name = "body", z = ["130 mm", "330 mm"], inner_diameter = "182 mm", outer_diameter = "230 mm"},
    {name = "wall", z = ["330 mm", "340 mm"], inner_diameter = "85 mm", outer_diameter = "230 mm"},
    {name = "rear", z = ["340 mm", "386 mm"], inner_diameter = "95 mm", outer_diameter = "230 mm"},
]
[[bearing_set]]
name = "front"
bearing_type = "7014 C HC"
preload = "medium"
carries_thrust = true
spacers = "steel"
bearing = [
    {name = "F1", z = "45 mm", takes_thrust = "towards_rear"},
    {name = "F2", z = "100 mm", takes_thrust = "towards_nose"},
]
[[bearing_set]]
name = "rear"
bearing_type = "7012 C HC"
preload = "light"
preload_kind = "spring"
spacers = "steel"
bearing = [{name = "R1", z = "340 mm", takes_thrust = "towards_rear"}, {name = "R2", z = "368 mm", takes_thrust = "towards_nose"}]
"""

# Ten mistakes of ten kinds: old text, new text, and what the fault must say.
TEN = (
    (
        'speed = "12000 rpm", thrust',
        'speed = "12000 Hz", thrust',
        ("operation.speed", "wrong dimension", "3000 rpm"),
    ),
    (
        'preload_kind = "spring"',
        'preloading = "spring"',
        ("bearing_set.rear.preloading", "unknown key", '"preload"'),
    ),
    (
        'outer_diameter = "99 mm"',
        "outer_diameter = 99",
        ("part.rotor.segment.stack.outer_diameter", "a unit is needed"),
    ),
    (
        '"stator"\nmaterial = "electrical_steel"',
        '"stator"\nmaterial = "dynamo_steel"',
        ("part.stator.material", "electrical_steel"),
    ),
    (
        'inner_diameter = "32 mm", outer_diameter = "68 mm"',
        'inner_diameter = "32 mm", outer_diameter = "69 mm"',
        ('part "rotor"', 'overlaps part "shaft"'),
    ),
    (
        '{name = "F2", z = "100 mm"',
        '{name = "F2", z = "104 mm"',
        ('part "F2.outer_ring"', 'overlaps part "housing"'),
    ),
    ('fluid = "ethylene_glycol_30", ', "", ("film.jacket.fluid", "is missing", "ethylene_glycol_30")),
    (
        '"rotor_losses", part = "rotor"',
        '"rotor_losses", surface = "rotor.outside"',
        ("source.rotor_losses.surface", "no surface"),
    ),
    ('preload = "medium"\n', "", ("bearing_set.front.preload", "is missing", "light, medium or heavy")),
    (
        'outer_diameter = "182 mm", z',
        'outer_diameter = "190 mm", z',
        ("film.jacket.outer_diameter: facing", "r 95 mm matches no", "r 91 mm, z 130 to 330 mm"),
    ),
)
# Ten of other kinds.
TEN_OTHERS = (
    ('thrust = "500 N"', 'thrust = "50 kg"', ("operation.thrust", "wrong dimension")),
    ('"high_speed_grease"', '"speed_grease"', ("grease.catalogue", "high_speed_grease")),
    (
        'inner_diameter = "32 mm", outer_diameter = "70 mm"',
        'inner_diameter = "32 mm", outer_diameter = "69 mm"',
        ('parts "F1.inner_ring", "F2.inner_ring"', "ends at r 34.5 mm", "seat is at r 35 mm"),
    ),
    ('r = "57 mm", z = "55 mm"', 'r = "50 mm", z = "55 mm"', ("probe.FRONT", "lies outside", "r 55-115 mm")),
    ('"7012 C HC"', '"7012 D"', ("bearing_set.rear.bearing_type", "no bearing type", "7014 C")),
    ('heat = ["20 W", "120 W"]', 'heat = ["20 W"]', ("source.rotor_losses.heat.heat", "has 1 entries")),
    ('name = "stop"', 'name = "front"', ("part.housing.segment", "used 2 times")),
    ('"20 degC", flow', '"20 C", flow', ("film.jacket.inlet_temperature", "15 degC")),
    (
        'takes_thrust = "towards_nose"',
        'takes_thrust = "forward"',
        ("bearing.F2.takes_thrust", "towards_rear, towards_nose"),
    ),
    (
        "probe = [",
        """channel = {part = "housing", inner_radius = "108 mm", depth = "10 mm", width = "8 mm", pitch = "16 mm", turns = 3, z_start = "60 mm"}
coolant = {fluid = "water", inlet_temperature = "20 degC", flow = "10 L/min"}
probe = [""",
        ("channel.depth", "breaks through the outer wall", "at least 2 mm"),
    ),
)


def draft(mistakes: Iterable[tuple[str, str, tuple[str, ...]]]) -> str:
    """The page with mistakes, each at the first place where its old text stands."""
    text = PAGE
    for old, new, _ in mistakes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text
