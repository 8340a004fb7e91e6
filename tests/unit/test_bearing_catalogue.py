"""Bearings and materials that ship: dimensions, balls against published ones, laid under what is given."""

from __future__ import annotations

import tomllib

import pytest

from spindle_fem.definition.bearing_catalogue import boundary_dimensions, catalogue_bearing
from spindle_fem.definition.bearing_types import BallBearingType
from spindle_fem.definition.load import examine, find_machine, load_machine, read_definition, write_machine
from spindle_fem.physics.bearings.bearing_file import bearing_report


@pytest.mark.parametrize(
    ("designation", "millimetres"),
    [
        ("71928 C", (140, 190, 24)),
        ("71904_E", (20, 37, 9)),
        ("7014 AC", (70, 110, 20)),
        ("7210 C", (50, 90, 20)),
        ("N1014", (70, 110, 20)),
        ("NN3020 K", (100, 150, 37)),
    ],
)
def test_boundary_dimensions_are_those_of_iso_15(designation, millimetres) -> None:
    assert [1e3 * value for value in boundary_dimensions(designation)] == pytest.approx(millimetres)


@pytest.mark.parametrize("designation", ["7014", "7003 C", "71923 C", "7014 X", "6014 C", "70145 C"])
def test_what_is_not_in_the_catalogue(designation) -> None:
    assert catalogue_bearing(designation) is None


def test_every_ball_bearing_of_the_catalogue_is_a_sound_type() -> None:
    for series in ("719", "70", "72"):
        for code in (*range(4, 23), *range(24, 42, 2)):
            kind = _type_of(catalogue_bearing(f"{series}{code:02d} C"))
            assert kind.bore_diameter == pytest.approx(5e-3 * code)


def _type_of(table) -> BallBearingType:
    return BallBearingType.model_validate(table)


def test_estimated_balls_are_near_those_that_makers_publish() -> None:
    """Machines that ship name them from catalogues: 71924 17/32 in and 27, 71928 9/16 in and 30."""
    published = load_machine("wu_tan_2016").bearing_types
    for name, designation in (("71928_CD", "71928 C"), ("71924_CD", "71924 C")):
        own, estimate = published[name], _type_of(catalogue_bearing(designation))
        assert estimate.ball_diameter == pytest.approx(own.ball_diameter, rel=0.1)
        assert abs(estimate.ball_count - own.ball_count) <= 2


def _named(**changes):
    content = read_definition(find_machine("small_two_start"))
    group = {**content["bearing_set"][0], "bearing_type": "7010 C"}
    group["bearing"] = [{**row, "z": row["z"][0]} for row in group["bearing"]]
    solids = {"steel_42CrMo4": content["materials"]["steel_42CrMo4"]}
    return {**content, "bearing_types": {}, "bearing_set": [group], "materials": solids, **changes}


def test_a_set_names_a_bearing_that_ships_and_where_its_rings_begin() -> None:
    result = examine(_named(grease={"catalogue": "high_speed_grease"}))
    assert not result.faults
    assert result.spec.bearing_types["7010_C"].ball_count == 18
    assert result.spec.bearing_set[0].bearing[0].z == pytest.approx((0.024, 0.040))
    assert {item.where for item in result.assumed} >= {
        "bearing_types.7010_C",
        "grease",
        "materials.bearing_steel",
    }
    written = examine(tomllib.loads(write_machine(result.spec)))
    assert (written.spec, written.assumed) == (result.spec, ())


def test_what_the_file_gives_replaces_the_catalogue() -> None:
    types = {"7010_C": {"catalogue": "7010 C HC", "ball_count": 17}}
    spec = examine(_named(bearing_types=types)).spec
    kind = spec.bearing_types["7010_C"]
    assert (kind.ball_count, kind.ball_material, kind.mark_of("ball_count")) == (17, "silicon_nitride", "")
    assert kind.mark_of("ball_diameter") == "A"
    assert kind.mark_of("width") == "C"


@pytest.mark.parametrize(
    ("name", "word"), [("NN3010", "preload"), ("7010_X", "7014 C"), ("7010 X", "7014 C")]
)
def test_other_bearings_are_refused_with_what_there_is(name, word) -> None:
    content = _named()
    content["bearing_set"][0]["bearing_type"] = name
    assert any(word in f"{fault.what} {fault.how_to_fix}" for fault in examine(content).faults)


def test_a_bearing_file_names_one_too(tmp_path) -> None:
    file = tmp_path / "bearing.toml"
    operation = '[operation]\nspeed = "3000 rpm"\naxial_load = "500 N"\n'
    file.write_text(f'[bearing]\ncatalogue = "7014 C"\n{operation}')
    steel = bearing_report(file)
    file.write_text(f'[bearing]\ncatalogue = "7014 C HC"\n{operation}')
    assert steel != bearing_report(file)
