"""A machine to start from, and the picture of a definition with its faults."""

from __future__ import annotations

import re

import pytest

from spindle_fem.commands.machine_commands import check_machine
from spindle_fem.commands.new_command import NewMachine, new_machine
from spindle_fem.definition.load import examine_machine
from spindle_fem.errors import BadInputError, FaultsError, SpecError
from spindle_fem.report.definition_picture import draw_definition


def test_the_machine_to_start_from_is_sound_and_named_as_its_file(tmp_path) -> None:
    content = check_machine(new_machine(tmp_path / "my-spindle.toml"))
    assert content["machine"] == "my_spindle"
    assert content["warnings"] == []
    assert [row["name"] for row in content["sources"]] == ["belt"]


def test_it_is_a_page_and_every_rule_that_it_leans_on_is_listed(tmp_path) -> None:
    file = new_machine(tmp_path / "a.toml")
    assert len(file.read_text(encoding="utf-8").splitlines()) <= 65
    assumed = {item["name"] for item in check_machine(file)["assumed"]}
    assert assumed >= {
        "bearing_types.7014_C",
        "bearing_set.front.preload",
        "bearing_set.rear.bearing.R2.z",
        "part.front_inner_spacer",
        "part.rear_outer_spacer",
        "grease",
        "materials.bearing_steel",
        "joint.workshop_inner_seats",
        "remaining_surfaces",
    }


@pytest.mark.parametrize(
    "chosen",
    [
        NewMachine("7010 E HC", "71908 C", "motor", "helix", "18000 rpm"),
        NewMachine("7024 C", "71922 C", "motor", "none", "3000 rpm"),
        NewMachine("6014", "6010", "coupling", "none", "2000 rpm"),
        NewMachine("7214 C", "6004", "belt", "helix", "3000 rpm"),
        NewMachine("71906 AC", "71904 C", "belt", "helix", "12000 rpm"),
    ],
    ids=lambda chosen: f"{chosen.front} {chosen.drive} {chosen.cooling}",
)
def test_what_is_chosen_is_a_sound_machine_in_a_page(chosen, tmp_path) -> None:
    file = new_machine(tmp_path / "chosen.toml", chosen)
    assert len(file.read_text(encoding="utf-8").splitlines()) <= 70
    content = check_machine(file)
    assert content["warnings"] == []
    names = {row["name"] for row in content["parts"]}
    assert ("stator" in names) == (chosen.drive == "motor")
    assert ("COOLANT_OUT" in {row["name"] for row in content["probes"]}) == (chosen.cooling == "helix")


@pytest.mark.parametrize(
    ("chosen", "told"),
    [
        (NewMachine(front="7014 Q"), "--front: .*7014 C"),
        (NewMachine(front="NN3014 K"), "--front: .*no ball bearing"),
        (NewMachine(rear="7016 C"), "--rear: .*up to 65 mm"),
        (NewMachine(drive="bell"), "--drive: .*belt"),
        (NewMachine(cooling="water"), "--cooling: .*helix"),
        (NewMachine(speed="4000"), "--speed"),
    ],
)
def test_what_cannot_be_chosen_is_told_with_its_option(chosen, told, tmp_path) -> None:
    with pytest.raises(BadInputError, match=told):
        new_machine(tmp_path / "a.toml", chosen)
    assert not (tmp_path / "a.toml").exists()


MISTAKES = {
    "a bearing that there is none of": ('"7012 C"', '"7012 Q"'),
    "a preload class that there is none of": ('"medium"', '"middle"'),
    "spacers of a material that there is none of": ('"steel", bearing = [', '"steal", bearing = ['),
    "no unit": ('speed = "4000 rpm"', "speed = 4000"),
    "a unit of something else": ('force = "400 N"', 'force = "400 mm"'),
    "a key that there is none of": ("grease = {", 'grease = {maker = "X", '),
    "a coolant that there is none of": ('"water"', '"watter"'),
    "a source in no part": ('"shaft.drive_end"', '"shaft.drive"'),
    "a probe outside its part": ('z = "288 mm", r = "52 mm"', 'z = "288 mm", r = "152 mm"'),
    "a heat model that there is none of": ('"palmgren"', '"palmgreen"'),
}


def test_ten_mistakes_in_it_are_ten_faults_at_once(tmp_path) -> None:
    file = new_machine(tmp_path / "a.toml")
    text = file.read_text(encoding="utf-8")
    for old, new in MISTAKES.values():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    file.write_text(text, encoding="utf-8")
    with pytest.raises(FaultsError) as refused:
        check_machine(file)
    assert len(refused.value.faults) == len(MISTAKES), "\n".join(map(str, refused.value.faults))


def test_a_file_that_is_there_is_kept(tmp_path) -> None:
    file = new_machine(tmp_path / "a.toml")
    with pytest.raises(SpecError, match="is there already"):
        new_machine(file)
    with pytest.raises(SpecError, match=r"ends in \.toml"):
        new_machine(tmp_path / "a.txt")


def test_the_picture_marks_each_fault_where_it_belongs(tmp_path) -> None:
    file = new_machine(tmp_path / "a.toml")
    text = file.read_text()
    text = text.replace('name = "R1", z = "260 mm"', 'name = "R1", z = ["255 mm", "278 mm"]')
    text = text.replace('emperature = "22 degC"', 'emperature = "22 N"').replace("turns = 5", "turns = 9")
    file.write_text(text)
    picture = tmp_path / "a.png"
    with pytest.raises(FaultsError) as refused:
        check_machine(file, picture=picture)
    assert picture.stat().st_size > 10_000
    told = "\n".join(str(fault) for fault in refused.value.faults)
    assert re.search(r"ambient_temperature(.|\n)*R1(.|\n)*channel", told)
    placed = draw_definition(picture, examine_machine(file).spec, refused.value.faults)
    assert len(placed) == len(refused.value.faults) - 1
    assert not any("ambient_temperature" in str(fault) for fault in placed)


def test_a_sound_machine_and_a_file_without_parts_are_drawn_too(tmp_path) -> None:
    picture = tmp_path / "a.png"
    check_machine("small_two_start", picture=picture)
    assert picture.stat().st_size > 10_000
    (tmp_path / "b.toml").write_text('schema = "spindle-fem/machine/1"\nname = "b"\n')
    with pytest.raises(FaultsError):
        check_machine(tmp_path / "b.toml", picture=tmp_path / "b.png")
    assert (tmp_path / "b.png").exists()
    with pytest.raises(SpecError, match=r"Allowed: \.png"):
        check_machine("small_two_start", picture=tmp_path / "a.svg")
