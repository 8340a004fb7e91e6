# ruff: noqa: E501  (a case a line)
"""Broken machine definitions: each is refused with file, key, value and what is allowed.

Every case is a valid definition with one small edit (old text, new text); the
expected parts must all stand in one fault of their own, and there must be no
other faults: one mistake must not bring up a crowd.
"""

from __future__ import annotations

import re

import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import (
    FaultsError,
    GeometryError,
    SpecError,
    SpindleFemError,
    UnitError,
    UnknownKeyError,
)
from spindle_fem.machine.geometry.assembly import build_assembly
from tests.support.valid_definition import VALID

NOSE = '{name = "nose", z = ["0 mm", "24 mm"], inner_diameter = "16 mm", outer_diameter = "70 mm"}'


HEAT = VALID[VALID.index('model = "palmgren"') : VALID.index("[channel]")]


def replaced(old: str, new: str) -> str:
    assert VALID.count(old) == 1, f"{old!r} stands {VALID.count(old)} times in the definition"
    return VALID.replace(old, new)


def faults_of(tmp_path, text: str | bytes, overrides: tuple[str, ...] = ()) -> tuple[SpindleFemError, ...]:
    path = tmp_path / "broken.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(SpecError) as caught:
        load_machine(path, overrides)
    assert caught.value.exit_status == 2
    return caught.value.faults if isinstance(caught.value, FaultsError) else (caught.value,)


def require(faults: tuple[SpindleFemError, ...], *expected: tuple[str, ...]) -> None:
    messages = [str(fault) for fault in faults]
    listing = "\n".join(messages)
    assert len(messages) == len(expected), listing
    for parts in expected:
        assert any(all(part in message for part in parts) for message in messages), (
            f"{parts} not in\n{listing}"
        )


def test_the_definition_that_the_cases_break_is_valid(tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(VALID)
    assert build_assembly(load_machine(path)).channel is not None


# (old text, new text, error class, parts of the message)
VALUES = {
    # quantities
    "bare number for a length": ('depth = "6 mm"', "depth = 6", UnitError, "channel.depth", "bare number 6", "19 mm"),
    "bare number as text": ('depth = "6 mm"', 'depth = "6"', UnitError, "channel.depth", '"6"', "a unit is needed"),
    "bare speed": ('speed = "3000 rpm"', "speed = 3000", UnitError, "operation.speed", "3000", '"3000 rpm"'),
    "bare number inside a list": (
        '["0 W", "24 W", "74 W"]', '["0 W", 24, "74 W"]', UnitError, "heat.table.heat.B1[2]", "bare number 24",
    ),
    "bare end of a range": (
        'z = ["24 mm", "40 mm"]', 'z = ["24 mm", 40]', UnitError, "bearing_set.pair.bearing.B1.z[2]", "bare number 40",
    ),
    "wrong dimension": ('depth = "6 mm"', 'depth = "6 kg"', UnitError, "channel.depth", '"6 kg"', "wrong dimension", "units of m"),
    "a flow in kilograms": ('flow = "6 L/min"', 'flow = "6 kg/min"', UnitError, "coolant.flow", "6 kg/min", "m**3/s"),
    "hertz for a speed": ('speed = "3000 rpm"', 'speed = "50 Hz"', UnitError, "operation.speed", "50 Hz", "rad/s"),
    "unknown unit": ('depth = "6 mm"', 'depth = "6 mmm"', UnitError, "channel.depth", '"mmm"', "unknown unit"),
    "arithmetic in a quantity": ('depth = "6 mm"', 'depth = "5 mm + 1 mm"', UnitError, "channel.depth", "5 mm + 1 mm", "unknown unit"),
    "decimal comma": ('depth = "6 mm"', 'depth = "6,5 mm"', UnitError, "channel.depth", "6,5 mm", "unknown unit"),
    "no number": ('depth = "6 mm"', 'depth = "deep"', UnitError, "channel.depth", '"deep"', "one number and its unit"),
    "a table for a quantity": ('depth = "6 mm"', 'depth = {value = "6 mm"}', UnitError, "channel.depth", "is not a quantity"),
    "a truth value for a quantity": ('depth = "6 mm"', "depth = true", UnitError, "channel.depth", "True is not a quantity"),
    "not a number": ("turns = 2", "turns = nan", UnitError, "channel.turns", "nan", "not finite"),
    "infinite": ("turns = 2", "turns = inf", UnitError, "channel.turns", "inf", "not finite"),
    "overflowing": ('depth = "6 mm"', 'depth = "1e999 mm"', UnitError, "channel.depth", "1e999 mm", "not finite"),
    "difference for a temperature": (
        'inlet_temperature = "20 degC"', 'inlet_temperature = "20 delta_degC"', UnitError,
        "coolant.inlet_temperature", "20 delta_degC", "a temperature is needed",
    ),
    "below absolute zero": (
        'ambient_temperature = "20 degC"', 'ambient_temperature = "-300 degC"', UnitError,
        "operation.ambient_temperature", "-300 degC", "below absolute zero", "-273.15 degC",
    ),
    "temperature for a length": ('depth = "6 mm"', 'depth = "6 degC"', UnitError, "channel.depth", "6 degC", "units of m"),
    "surroundings misspelt": (
        'temperature = "22 degC"', 'temperature = "ambiant"', SpecError, "film.rear.temperature", '"ambiant"', 'Did you mean "ambient"',
    ),
    # limits
    "negative depth": ('depth = "6 mm"', 'depth = "-6 mm"', SpecError, "channel.depth", '"-6 mm"', "Allowed: above 0 m"),
    "no flow": ('flow = "6 L/min"', 'flow = "0 L/min"', SpecError, "coolant.flow", '"0 L/min"', "above 0"),
    "negative speed": ('speed = "3000 rpm"', 'speed = "-5 rpm"', SpecError, "operation.speed", '"-5 rpm"', "at least 0"),
    "negative preload": ('preload = "250 N"', 'preload = "-250 N"', SpecError, "bearing_set.pair.preload", '"-250 N"', "at least 0 N"),
    "negative density": ('density = "7800 kg/m**3"', 'density = "-1 kg/m**3"', SpecError, "materials.steel.density", "above 0"),
    "negative film": (
        'coefficient = "200 W/m**2/K"', 'coefficient = "-200 W/m**2/K"', SpecError, "film.rear.coefficient", "at least 0",
    ),
    "negative heat": ('"22 W", "69 W"', '"-22 W", "69 W"', SpecError, "heat.table.heat.B2[2]", '"-22 W"', "at least 0 W"),
    "emissivity above one": ("emissivity = 0.6", "emissivity = 60", SpecError, "film.outside.emissivity", "60", "0 to 1"),
    "share above one": ("value = 0.5, sigma_rel = 0.1", "value = 1.5, sigma_rel = 0.1", SpecError, "heat.inner_share", "1.5", "0 to 1"),
    "open groove": ("groove_curvature_inner = 0.52", "groove_curvature_inner = 0.5", SpecError, "groove_curvature_inner", "0.5", "0.505 to 0.6"),
    "two balls": ("ball_count = 19", "ball_count = 2", SpecError, "bearing_types.7010_C.ball_count", "2", "3 to 200"),
    "five starts": ("starts = 2", "starts = 5", SpecError, "channel.starts", "5", "1 to 4"),
    "zero thickness": (
        '"72 mm", outer_diameter = "80 mm"', '"80 mm", outer_diameter = "80 mm"', SpecError,
        "part.outer_spacer.segment.ring.outer_diameter", "80 mm leaves no wall", "above 80 mm",
    ),
    "hair of a bore": (
        '"72 mm", outer_diameter = "80 mm"', '"0.1 mm", outer_diameter = "80 mm"', SpecError,
        "part.outer_spacer.segment.ring.inner_diameter", "0.1 mm is no bore", "0.8 mm and more",
    ),
    "no length": ('z = ["92 mm", "104 mm"]', 'z = ["92 mm", "92 mm"]', SpecError, "part.housing.segment.shoulder.z", "92 mm to 92 mm", "beyond the start"),
    "turned range": (NOSE, NOSE.replace('["0 mm", "24 mm"]', '["24 mm", "0 mm"]'), SpecError, "part.shaft.segment.nose.z", "24 mm to 0 mm"),
    # priors
    "prior without a width": ('{value = "2 W/K", sigma_rel = 0.3}', '{value = "2 W/K"}', UnitError, "bearing_set.pair.ball_row.conductance", "sigma_rel"),
    "prior of both forms": ('{value = "2 W/K", sigma_rel = 0.3}', '{value = "2 W/K", low = "1 W/K"}', UnitError, "ball_row.conductance", "low", "high"),
    "percent as a width": ("value = 0.5, sigma_rel = 0.1", "value = 0.5, sigma_rel = 10", UnitError, "heat.inner_share.sigma_rel", "10", "30 % is 0.3"),
    "negative width": ("value = 0.5, sigma_rel = 0.1", "value = 0.5, sigma_rel = -0.1", UnitError, "heat.inner_share.sigma_rel", "-0.1"),
    "low above high": ('low = "4000 W/m**2/K"', 'low = "40000 W/m**2/K"', UnitError, "joint.seats.conductance", "40000", "low < high"),
    "bare low": ('low = "4000 W/m**2/K"', "low = 4000", UnitError, "joint.seats.conductance.low", "bare number 4000"),
    "word for a conductance": ('conductance = "perfect"', 'conductance = "perfekt"', SpecError, "joint.faces.conductance", '"perfekt"', 'Did you mean "perfect"'),
    "factor without width": ("sigma_rel = 0.3\napplies_to", "sigma_rel = 0\napplies_to", SpecError, "factor.air.sigma_rel", "above 0"),
    # keys
    "unknown table": ("[mesh]", "[messh]", UnknownKeyError, "messh", "unknown key", 'Did you mean "mesh"'),
    "unknown key in a table": ('hand = "left"', 'hnad = "left"', UnknownKeyError, "channel.hnad", 'Did you mean "hand"', "starts"),
    "unknown key at the top": ('name = "bench"', 'name = "bench"\nspeed = "3 rpm"', UnknownKeyError, "speed: unknown key", "operation"),
    "unknown key in a nested table": ('ports = {diameter = "6 mm"}', 'ports = {diameter = "6 mm", depth = "1 mm"}', UnknownKeyError, "channel.ports.depth", "diameter, wetted"),
    "unknown key in a list": ('name = "B1", ', 'name = "B1", angle = "3 deg", ', UnknownKeyError, "bearing_set.pair.bearing.B1.angle", "takes_thrust"),
    "unknown key in a segment": ('{name = "ring", z = ["40 mm", "76 mm"], inner_diameter = "50 mm"', '{name = "ring", z = ["40 mm", "76 mm"], inner_radius = "25 mm", inner_diameter = "50 mm"', UnknownKeyError, "part.inner_spacer.segment.ring.inner_radius", 'Did you mean "inner_diameter"'),
    "unknown key in a film": ("emissivity = 0.6", "emisivity = 0.6", UnknownKeyError, "film.outside.emisivity", 'Did you mean "emissivity"'),
    "key of another kind of film": ("emissivity = 0.6", 'coefficient = "3 W/m**2/K"', UnknownKeyError, "film.outside.coefficient", "characteristic_length"),
    "unknown key in a face": ('{facing = "rear", z = "104 mm"}', '{facing = "rear", x = "104 mm"}', UnknownKeyError, "surface.housing.rear.where[1].x", "facing, z, r"),
    "unknown key in a material": ('density = "7800 kg/m**3"', 'density = "7800 kg/m**3"\ncolour = "grey"', UnknownKeyError, "materials.steel.colour", "specific_heat_capacity"),
    "missing key": ('depth = "6 mm"\n', "", SpecError, "channel.depth", "is missing", "19 mm"),
    "missing key in a list": (', takes_thrust = "towards_nose"', "", SpecError, "bearing_set.pair.bearing.B2.takes_thrust", "is missing", "towards_rear, towards_nose"),
    "missing kind": ('kind = "rotating"\n', "", SpecError, "film.nose.kind", "is missing", "constant"),
    "missing table": ('[operation]\nspeed = "3000 rpm"\nthrust = "300 N"\nambient_temperature = "20 degC"', "", SpecError, "operation", "is missing", "ambient_temperature"),
    "missing conductance": ('{kind = "constant", conductance = {value = "2 W/K", sigma_rel = 0.3}}', '{kind = "constant"}', SpecError, "bearing_set.pair.ball_row.conductance", "is missing", "W/K"),
    "conductance of another kind": ('{kind = "constant", conductance', '{kind = "contact", conductance', SpecError, "bearing_set.pair.ball_row.conductance", 'kind = "contact"'),
    "gap without a film": ('at_rest = "8 W/m**2/K"\n', "", SpecError, "gap.spacers.at_rest", "is missing", "power_law"),
    "heat table missing": (HEAT, 'model = "table"\n', SpecError, "heat.table", "is missing", "needs a [heat.table]"),
    # types and words
    "unknown word": ('hand = "left"', 'hand = "lefft"', SpecError, "channel.hand", '"lefft" is not allowed', 'Did you mean "left"', "right, left"),
    "unknown heat model": ('model = "palmgren"', 'model = "harris"', SpecError, "heat.model", '"harris"', "full, palmgren, paper, skf, table"),
    "unknown kind": ('kind = "rotating"', 'kind = "rotation"', SpecError, "film.nose.kind", '"rotation"', 'Did you mean "rotating"'),
    "fraction of a start": ("starts = 2", "starts = 1.5", SpecError, "channel.starts", "1.5", "a whole number from 1 to 4"),
    "text for a count": ("ball_count = 19", 'ball_count = "19"', SpecError, "bearing_types.7010_C.ball_count", '"19"', "a whole number"),
    "text for a truth value": ("carries_thrust = true", 'carries_thrust = "yes"', SpecError, "bearing_set.pair.carries_thrust", '"yes"', "true, false"),
    "number for a text": ('[grease]\nname = "ester"', "[grease]\nname = 22", SpecError, "grease.name", "22", "a text"),
    "one value for a list": ('surface = ["housing.rear"]', 'surface = "housing.rear"', SpecError, "film.rear.surface", '"housing.rear"', "a list"),
    "a value for a table": ('ports = {diameter = "6 mm"}', 'ports = "6 mm"', SpecError, "channel.ports", '"6 mm"', "a table with diameter"),
    "empty list": ('applies_to = ["film.outside", "gap.spacers"]', "applies_to = []", SpecError, "factor.air.applies_to", "[]", "at least one"),
    "three ends of a range": ('z = ["24 mm", "40 mm"]', 'z = ["24 mm", "30 mm", "40 mm"]', SpecError, "bearing_set.pair.bearing.B1.z", "is not a range", "from and to"),
    "a name with a blank": ('name = "pair"', 'name = "the pair"', SpecError, "bearing_set.the pair.name", '"the pair" is not a name', "letters, digits"),
    "interpolation of order three": ('preset = "coarse"', 'preset = "coarse"\norder = 3', SpecError, "mesh.order", "3", "1, 2"),
    # marks
    "unknown mark": ('marks = "A"\nthermal', 'marks = "B"\nthermal', SpecError, "materials.steel.marks", "'B' is no mark", "P (the paper), C (bearing catalogue), A (assumed)"),
    "mark of no key": ('marks = "A"\nthermal', 'marks = {densty = "A"}\nthermal', UnknownKeyError, "materials.steel.marks.densty", 'Did you mean "density"'),
    "marks as a list": ('marks = "A"\nthermal', 'marks = ["A"]\nthermal', SpecError, "materials.steel.marks", "['A'] are no marks"),
    # the schema
    "later version": ("machine/1", "machine/2", SpecError, "schema", '"spindle-fem/machine/2" is not known', '"spindle-fem/machine/1"'),
    "another schema": ("spindle-fem/machine/1", "spindle-fem/study/1", SpecError, "schema", "spindle-fem/study/1"),
    "schema missing": ('schema = "spindle-fem/machine/1"', "", SpecError, "schema", "is missing", '"spindle-fem/machine/1"'),
    "schema as a number": ('schema = "spindle-fem/machine/1"', "schema = 1", SpecError, "schema", "1 is not known"),
}  # fmt: skip

TOGETHER = {
    # tables that contradict themselves
    "channel wider than its pitch": ('width = "8 mm"', 'width = "10 mm"', SpecError, "channel.width", "10 mm", "pitch / starts is 12 mm", "at most 9 mm"),
    "oil that thickens": ('kinematic_viscosity_100 = "5 mm**2/s"', 'kinematic_viscosity_100 = "50 mm**2/s"', SpecError, "grease.kinematic_viscosity_100", "50 mm²/s", "22 mm²/s"),
    "too many balls": ("ball_count = 19", "ball_count = 30", SpecError, "bearing_types.7010_C.ball_count", "30 balls of 8.731 mm", "at most 23"),
    "balls too large": ('ball_diameter = "8.731 mm"', 'ball_diameter = "16 mm"', SpecError, ("bearing_types.7010_C.ball_diameter", "16 mm", "cut through a ring", "50 mm"), ("bearing_types.7010_C.ball_count", "at most 12")),
    "pitch outside the rings": ("ball_count = 19", 'ball_count = 19\npitch_diameter = "78 mm"', SpecError, "bearing_types.7010_C.pitch_diameter", "78 mm", "80 mm"),
    "rings that cross": ('outer_ring_inner_diameter = "71 mm"', 'outer_ring_inner_diameter = "57 mm"', SpecError, "bearing_types.7010_C.outer_ring_inner_diameter", "57 mm", "58 mm"),
    "steep contact": ('contact_angle = "15 deg"', 'contact_angle = "75 deg"', SpecError, "bearing_types.7010_C.contact_angle", "75 deg", "60 deg"),
    "rigid preload of one direction": ('takes_thrust = "towards_nose"', 'takes_thrust = "towards_rear"', SpecError, "bearing_set.pair.preload", "250 N is rigid", "spring"),
    "table too short": ('["0 W", "22 W", "69 W"]', '["0 W", "22 W"]', SpecError, "heat.table.heat.B2", "has 2 entries", "3, as many as speed"),
    "speeds that fall": ('["0 rpm", "4000 rpm", "8000 rpm"]', '["0 rpm", "9000 rpm", "8000 rpm"]', SpecError, "heat.table.speed", "do not all grow"),
    "probe without a place": ('r = "41 mm"\nz = "32 mm"', 'r = "41 mm"', SpecError, "probe.seat.z", "is missing", "part, r and z"),
    "outlet with a place": ('kind = "coolant_outlet"', 'kind = "coolant_outlet"\nr = "3 mm"', SpecError, "probe.outlet.r", "is given"),
    # names of other tables
    "unknown material": ('name = "housing"\nmaterial = "steel"', 'name = "housing"\nmaterial = "stell"', SpecError, "part.housing.material", '"stell"', 'Did you mean "steel"'),
    "unknown ring material": ('ring_material = "steel"', 'ring_material = "bronze"', SpecError, "bearing_types.7010_C.ring_material", '"bronze"', "bearing_steel"),
    "unknown bearing type": ('bearing_type = "7010_C"', 'bearing_type = "7010_D"', SpecError, "bearing_set.pair.bearing_type", '"7010_D"', 'Did you mean "7010_C"'),
    "unknown part of a channel": ('[channel]\npart = "housing"', '[channel]\npart = "hosing"', SpecError, "channel.part", '"hosing"', 'Did you mean "housing"'),
    "channel in the shaft": ('[channel]\npart = "housing"', '[channel]\npart = "shaft"', SpecError, "channel.part", '"shaft" is no standing part', "outer_spacer, housing"),
    "unknown part of a surface": ('part = "shaft"\nwhere', 'part = "shft"\nwhere', SpecError, "surface.shaft.nose.part", '"shft"', 'Did you mean "shaft"', "B1.inner_ring"),
    "unknown part of a probe": ('part = "housing"\nr', 'part = "B3.outer_ring"\nr', SpecError, "probe.seat.part", '"B3.outer_ring"', "B1.outer_ring"),
    "probe outside its part": ('r = "41 mm"', 'r = "30 mm"', SpecError, "probe.seat", "z 32 mm, r 30 mm lies outside", "z 24-92 r 40-75 mm"),
    "unknown surface": ('surface = ["housing.rear"]', 'surface = ["housing.rear", "housing.front"]', SpindleFemError, "film.rear.surface", '"housing.front"', "housing.outside"),
    "unknown coefficient": ('"film.outside", "gap.spacers"', '"film.outside", "gap.spacer"', SpecError, "factor.air.applies_to", '"gap.spacer"', 'Did you mean "gap.spacers"'),
    "coefficient named twice": ('"film.outside", "gap.spacers"', '"film.outside", "film.outside"', SpecError, "factor.air.applies_to", '"film.outside" is named 2 times'),
    "heat of an unknown bearing": ("thrust_coefficient = {B1 = 0.1}", "thrust_coefficient = {B3 = 0.1}", SpecError, "heat.table.thrust_coefficient.B3", "B1, B2"),
    "heat of a bearing missing": (', B2 = ["0 W", "22 W", "69 W"]', "", SpecError, "heat.table.heat.B2", "is missing", "Every bearing"),
    "size of an unknown part": ("size = {housing", "size = {hausing", SpecError, "mesh.size.hausing", '"hausing"', 'Did you mean "housing"'),
    "contact of no part": ('"inner_spacer|shaft"', '"inner_spacr|shaft"', SpecError, "joint.seats.contacts", '"inner_spacr"', 'Did you mean "inner_spacer"'),
    "contact in the wrong order": ('"housing|outer_spacer"', '"outer_spacer|housing"', SpecError, "joint.seats.contacts", '"outer_spacer|housing"', 'Write "housing|outer_spacer"'),
    "contact without a partner": ('"inner_spacer|shaft"', '"inner_spacer"', SpecError, "joint.seats.contacts", '"inner_spacer" is no contact', "part_a|part_b"),
    # tables that contradict one another
    "two films on a surface": ('surface = ["housing.rear"]', 'surface = ["housing.rear", "housing.outside"]', SpecError, "film.rear.surface", '"housing.outside" is already used by film.outside.surface'),
    "film on the surface of a gap": ('surface = ["housing.rear"]', 'surface = ["housing.rear", "outer_spacer.gap"]', SpecError, "gap.spacers.standing", '"outer_spacer.gap" is already used by film.rear.surface'),
    "unused surface": ("[[gap]]", '[[surface]]\nname = "spare"\npart = "shaft"\nwhere = [{facing = "rear"}]\n[[gap]]', SpecError, "surface.spare", "has no film and no gap"),
    "gap turning on a standing part": ('rotating = "inner_spacer.gap"\nstanding = ["outer_spacer.gap"]', 'rotating = "outer_spacer.gap"\nstanding = ["inner_spacer.gap"]', SpecError, ("gap.spacers.rotating", '"outer_spacer.gap"', "standing part"), ("gap.spacers.standing", '"inner_spacer.gap"', "rotating part")),
    "rotating film on the housing": ('surface = ["shaft.nose"]', 'surface = ["shaft.nose", "housing.rear"]', SpecError, ("film.nose.surface", '"housing.rear" is already used by film.rear.surface'), ("film.nose.surface", '"housing.rear" lies on a standing part')),
    "part named twice": ('name = "outer_spacer"\n', 'name = "inner_spacer"\n', SpecError, ("part", '"inner_spacer" is used 2 times'), ("joint.seats.contacts", '"outer_spacer"'), ("surface.outer_spacer.gap.part", '"outer_spacer"')),
    "film named twice": ('[[film]]\nname = "rear"', '[[film]]\nname = "outside"', SpecError, "film", '"outside" is used 2 times'),
    "bearing named twice": ('name = "B2"', 'name = "B1"', SpecError, ("bearing_set.bearing", '"B1" is used 2 times'), ("heat.table.heat.B2", '"B2" is no bearing')),
    "ring longer than its bearing": ('z = ["76 mm", "92 mm"]', 'z = ["74 mm", "92 mm"]', SpecError, "bearing_set.pair.bearing.B2.z", "spans 18 mm", '16 mm, the width of "7010_C"'),
    "nothing takes the thrust": ("carries_thrust = true", "carries_thrust = false", SpecError, "bearing_set", "none has carries_thrust", "exactly one"),
    "no grease": ('[grease]\nname = "ester"\nkinematic_viscosity_40 = "22 mm**2/s"\nkinematic_viscosity_100 = "5 mm**2/s"', "", SpecError, "grease", "is missing", 'heat.model = "palmgren"'),
    "channel without coolant": ('[coolant]\ninlet_temperature = "20 degC"\nflow = "6 L/min"', "", SpecError, ("channel", "no [coolant]"), ("probe.outlet", "no [coolant]")),
}  # fmt: skip


@pytest.mark.parametrize("case", [*VALUES, *TOGETHER])
def test_a_broken_definition_is_refused_by_file_key_value_and_what_is_allowed(tmp_path, case):
    old, new, error, *parts = {**VALUES, **TOGETHER}[case]
    expected = parts if isinstance(parts[0], tuple) else [tuple(parts)]
    faults = faults_of(tmp_path, replaced(old, new))
    require(faults, *(("broken.toml: ", *one) for one in expected))
    assert all(isinstance(fault, error) for fault in faults)


FILES = {
    "empty file": ("", ("file", "holds nothing", "spindle-fem/machine/1")),
    "not TOML": ("name = bench", ("broken.toml", "is not valid TOML", "line 1")),
    "unclosed text": (VALID + '\n[extra]\nx = "abc', ("broken.toml", "is not valid TOML")),
    "key given twice": (VALID.replace('depth = "6 mm"', 'depth = "6 mm"\ndepth = "7 mm"'), ("is not valid TOML",)),
    "not UTF-8": (b'name = "\xff\xfe"', ("broken.toml", "is not UTF-8", "byte 9")),
    "a network": (
        'schema = "spindle-fem/machine/1"\nname = "n"\n[[network.node]]\nname = "a"\ncapacity = "1 J/K"',
        ("network", "without geometry", "[[part]]"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", FILES)
def test_a_file_that_is_no_machine_is_refused(tmp_path, case):
    text, parts = FILES[case]
    require(faults_of(tmp_path, text), parts)


def test_faults_of_different_tables_come_all_at_once(tmp_path):
    text = replaced('depth = "6 mm"', "depth = 6")
    for old, new in (
        ('hand = "left"', 'hnad = "left"'),
        ('name = "housing"\nmaterial = "steel"', 'name = "housing"\nmaterial = "stell"'),
        ('coefficient = "200 W/m**2/K"', 'coefficient = "200 W/m**2"'),
        ('surface = ["shaft.nose"]', 'surface = ["shaft.nos"]'),
        ('"film.outside", "gap.spacers"', '"film.outside", "gap.spacer"'),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    require(
        faults_of(tmp_path, text),
        ("channel.depth", "bare number 6"),
        ("channel.hnad", 'Did you mean "hand"'),
        ("part.housing.material", '"stell"'),
        ("film.rear.coefficient", '"200 W/m**2"', "W/m**2/K"),
        ("film.nose.surface", '"shaft.nos"'),
        ("surface.shaft.nose", "has no film"),
        ("factor.air.applies_to", '"gap.spacer"'),
    )


def test_a_faulty_table_does_not_make_its_name_unknown(tmp_path):
    text = replaced('density = "7800 kg/m**3"', "density = 7800")
    text = text.replace(
        'name = "housing"\nmaterial = "steel"', 'name = "housing"\nmaterial = "steel"\nspin = 1'
    )
    text = text.replace("emissivity = 0.6", "emissivity = 6")
    text = text.replace("ball_count = 19", "ball_count = 190")
    require(
        faults_of(tmp_path, text),
        ("materials.steel.density", "bare number 7800"),
        ("part.housing.spin", "unknown key"),
        ("film.outside.emissivity", "6"),
        ("bearing_types.7010_C.ball_count", "190 balls"),
    )


def test_all_faults_of_one_range_and_one_prior_are_named(tmp_path):
    text = replaced('z = ["24 mm", "40 mm"]', 'z = [24, "40 kg"]')
    require(
        faults_of(tmp_path, text),
        ("bearing_set.pair.bearing.B1.z[1]", "bare number 24"),
        ("bearing_set.pair.bearing.B1.z[2]", '"40 kg"', "wrong dimension"),
    )


def test_balls_that_follow_their_contacts_need_grease_with_a_table_of_heat_too(tmp_path):
    text = VALID.replace('model = "palmgren"', 'model = "table"')
    text = re.sub(r"\[grease\].*?\n\n", "", text, flags=re.DOTALL)
    sound = tmp_path / "sound.toml"
    sound.write_text(text)
    assert load_machine(sound).grease is None
    text = re.sub(r"ball_row = .*\n", "", text)
    require(
        faults_of(tmp_path, text), ("grease", "is missing", 'the contacts of the balls of "pair" need it')
    )


BASES = {
    "itself": ({"broken.toml": 'base = "broken.toml"'}, ("broken.toml: base", '"broken.toml" leads back', "broken.toml -> broken.toml")),
    "a loop of two": (
        {"broken.toml": 'base = "other.toml"', "other.toml": 'base = "broken.toml"'},
        ("other.toml: base", "leads back", "broken.toml -> other.toml -> broken.toml"),
    ),
    "no such file": ({"broken.toml": 'base = "nowhere.toml"'}, ("broken.toml: base", '"nowhere.toml"', "there is no such file", "wu_tan_2016")),
    "no such machine": ({"broken.toml": 'base = "wu_tan_2015"'}, ("broken.toml: base", '"wu_tan_2015"', 'Did you mean "wu_tan_2016"')),
    "a number": ({"broken.toml": "base = 3"}, ("broken.toml: base", "3 is not a name")),
    "broken TOML": ({"broken.toml": 'base = "other.toml"', "other.toml": "x ="}, ("other.toml", "is not valid TOML")),
    "a fault in the base": (
        {"broken.toml": 'base = "other.toml"\n[channel]\nwidth = "7 mm"', "other.toml": VALID.replace('depth = "6 mm"', "depth = 6")},
        ("other.toml: channel.depth", "bare number 6"),
    ),
    "a fault in the change": (
        {"broken.toml": 'base = "other.toml"\n[channel]\nwidth = 7', "other.toml": VALID},
        ("broken.toml: channel.width", "bare number 7"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BASES)
def test_a_broken_base_is_refused_and_faults_name_the_file_they_stand_in(tmp_path, case):
    files, parts = BASES[case]
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    require(faults_of(tmp_path, files["broken.toml"]), parts)


# Faults that only the geometry shows; (old text, new text, parts of the message)
GEOMETRY = {
    "overlapping parts": ('inner_diameter = "72 mm", outer_diameter = "80 mm"', 'inner_diameter = "72 mm", outer_diameter = "84 mm"', "overlaps", "housing"),
    "floating part": ('inner_diameter = "72 mm", outer_diameter = "80 mm"', 'inner_diameter = "60 mm", outer_diameter = "70 mm"', "outer_spacer", "touches no other part"),
    "part in two bodies": ('z = ["92 mm", "106 mm"]', 'z = ["94 mm", "106 mm"]', "shaft", "comes apart into 2 bodies"),
    "channel through the bore": ('inner_radius = "50 mm"', 'inner_radius = "39 mm"', "channel", "2 mm"),
    "channel through the outside": ('inner_radius = "50 mm"', 'inner_radius = "72 mm"', "channel", "2 mm"),
    "channel near the outside": ('inner_radius = "50 mm"', 'inner_radius = "68 mm"', "channel", "1 mm", "2 mm"),
    "channel beyond the end": ("turns = 2", "turns = 4", "channel", "2 mm"),
    "face claimed twice": ('where = [{facing = "rear", z = "104 mm"}]', 'where = [{facing = "rear", z = "104 mm"}, {facing = "outward"}]', "housing.rear", "housing.outside"),
    "face that is not there": ('{facing = "rear", z = "104 mm"}', '{facing = "rear", z = "100 mm"}', "housing.rear", "matches no exposed face"),
    "face without a name": ('remaining_surfaces = "adiabatic"', 'remaining_surfaces = "error"', "belongs to no surface", "remaining_surfaces"),
}  # fmt: skip


@pytest.mark.parametrize("case", GEOMETRY)
def test_a_machine_that_cannot_be_built_is_refused(tmp_path, case):
    old, new, *parts = GEOMETRY[case]
    path = tmp_path / "broken.toml"
    path.write_text(replaced(old, new))
    load_machine(path)
    with pytest.raises(FaultsError) as caught:
        load_machine(path, checks=(build_assembly,))
    assert caught.value.exit_status == 2
    messages = [str(fault) for fault in caught.value.faults]
    assert any(all(part in message for part in ("broken.toml: ", *parts)) for message in messages), messages
    assert all(isinstance(fault, GeometryError) for fault in caught.value.faults)


def test_faults_of_the_geometry_come_together_with_those_of_other_tables(tmp_path):
    text = replaced('depth = "6 mm"', 'depth = "30 mm"').replace('flow = "6 L/min"', "flow = 6")
    text = text.replace(', outer_diameter = "80 mm"}]', ', outer_diameter = "84 mm"}]')
    text = text.replace(
        'material = "steel"\nrotating = true\nsegment = [{',
        'material = "stel"\nrotating = true\nsegment = [{',
    )
    path = tmp_path / "broken.toml"
    path.write_text(text)
    with pytest.raises(FaultsError) as caught:
        load_machine(path, ["film.rear.coefficient=10"], checks=(build_assembly,))
    listing = "\n".join(str(fault) for fault in caught.value.faults)
    for parts in (
        ("broken.toml: coolant.flow", "bare number 6"),
        ("--set film.rear.coefficient", "bare number 10"),
        ("broken.toml: part.inner_spacer.material", '"stel"'),
        ("broken.toml: ", "overlaps", "outer_spacer"),
        ("broken.toml: channel.", "2 mm"),
    ):
        assert any(all(part in line for part in parts) for line in listing.splitlines()), (
            f"{parts} not in\n{listing}"
        )


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('bearing_type = "7010_C"', 'bearing_type = "7010_D"'),
        ('part = "shaft"\nwhere', 'part = "shft"\nwhere'),
        ('[channel]\npart = "housing"', '[channel]\npart = "hosing"'),
        ('z = ["76 mm", "92 mm"], takes', 'z = ["76 mm", 92], takes'),
    ],
)
def test_the_geometry_is_not_built_of_faulty_tables(tmp_path, old, new):
    path = tmp_path / "broken.toml"
    path.write_text(replaced(old, new))
    with pytest.raises(FaultsError) as caught:
        load_machine(path, checks=(build_assembly,))
    assert len(caught.value.faults) == 1


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ('depth = "6 mm"', "depth = 6", ("1 fault", "broken.toml: channel.depth: bare number 6")),
        ('hand = "left"', 'hand = 1\nhnad = "left"', ("2 faults", "channel.hand", "channel.hnad")),
        ("[mesh]", "[mesh", ("is not valid TOML",)),
        (*GEOMETRY["floating part"][:2], ("outer_spacer", "touches no other part")),
        (*GEOMETRY["face claimed twice"][:2], ("housing.rear", "housing.outside")),
    ],
)
def test_the_check_command_prints_every_fault_and_exits_with_two(
    tmp_path, monkeypatch, capsys, old, new, parts
):
    from spindle_fem.cli import main

    path = tmp_path / "broken.toml"
    path.write_text(replaced(old, new))
    monkeypatch.setattr("sys.argv", ["spindle-fem", "check", str(path)])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    printed = capsys.readouterr().err
    assert all(part in printed for part in parts), printed
    assert "Traceback" not in printed


def test_there_are_at_least_sixty_broken_definitions():
    assert len(VALUES) + len(TOGETHER) + len(FILES) + len(BASES) + len(GEOMETRY) >= 60


def test_a_refused_name_is_not_offered(tmp_path):
    text = replaced('name = "outer_spacer"', 'name = "outer spacer"')
    faults = faults_of(tmp_path, text + '[[source]]\nname = "motor"\npart = "windings"\nheat = "5 W"\n')
    (unknown,) = [str(fault) for fault in faults if "windings" in str(fault)]
    assert "outer spacer" not in unknown
    assert "housing" in unknown
