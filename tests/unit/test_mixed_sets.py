"""Sets of unlike bearings, deep-groove bearings, seals and cages in machines and in bearing files."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import spindle_fem
from spindle_fem.commands.bearing_console import print_bearing
from spindle_fem.commands.machine_commands import check_machine
from spindle_fem.definition.bearing_catalogue import catalogue_bearing
from spindle_fem.definition.load import load_machine, read_definition, write_machine
from spindle_fem.errors import FaultsError, SpecError
from spindle_fem.operation.bearing_heat import BearingMechanics, BearingTemperatures
from spindle_fem.operation.coefficients import ball_row_capacity
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.rating_life import dynamic_load_rating
from spindle_fem.report.bearing_chart import write_bearing_chart

EXAMPLES = Path(__file__).parents[2] / "examples"
MIXED = "bearing_set.front.bearing.F2.bearing_type=7014 E"
GROOVES = ("bearing_set.rear.bearing_type=6012", "bearing_set.rear.preload_kind=spring")


def states(spec, celsius=40.0):
    warm = {b.name: BearingTemperatures(*(celsius + 273.15,) * 5) for _, b in spec.bearings}
    return BearingMechanics(spec).states(OperatingPoint.of(spec), warm, expand=False)


def test_unlike_bearings_of_a_set_carry_one_preload_each_at_its_angle():
    spec = load_machine("motor_spindle", [MIXED, "operation.thrust=0 N", "operation.speed=10 rpm"])
    found = states(spec)
    assert found["F1"].axial_force == pytest.approx(found["F2"].axial_force, rel=1e-3)
    assert found["F1"].axial_force == pytest.approx(300.0, rel=0.01)
    assert math.degrees(found["F1"].contact_angle_inner) == pytest.approx(16.3, abs=0.5)
    assert math.degrees(found["F2"].contact_angle_inner) == pytest.approx(25.5, abs=0.5)
    # the steeper bearing presses its balls less
    assert found["F2"].balls.load.max() < 0.7 * found["F1"].balls.load.max()


def test_each_bearing_has_its_own_rings_and_balls(tmp_path):
    hybrid = load_machine("motor_spindle", ["bearing_set.front.bearing.F2.bearing_type=7014 C HC"])
    group = hybrid.bearing_set[0]
    steel, ceramic = (ball_row_capacity(hybrid, group, bearing) for bearing in group.bearing)
    assert ceramic < 0.8 * steel
    # a resolved definition is the same machine
    file = tmp_path / "resolved.toml"
    file.write_text(write_machine(hybrid), encoding="utf-8")
    assert load_machine(file).bearing_set[0].bearing[1].bearing_type == "7014_C_HC"


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("bearing_set.front.bearing.F2.bearing_type=7014 X", "F2.bearing_type: .*no bearing type"),
        ("bearing_set.front.bearing.F2.bearing_type=NN3014 K", "F2.bearing_type: .*sets of one type"),
        ("bearing_set.front.bearing.F2.bearing_type=7214 C", None),
        ("bearing_types.7012_C.radial_clearance=5 um", "radial_clearance: .*contact_angle instead"),
        ("bearing_types.7012_C.seal_moment=-1 N*m", "seal_moment"),
        ("part.shaft.segment.nose.outer_diameter=88 m", r"nose\.outer_diameter: 88 m .*is the unit right"),
        (
            "part.shaft.segment.nose.outer_diameter=120 mm",
            r'"F1\.outer_ring\|shaft:face" has no conductance. One turns and the other stands: leave a gap',
        ),
    ],
)
def test_what_does_not_go_together_is_told(change, told):
    with pytest.raises((FaultsError, SpecError), match=told):
        check_machine("motor_spindle", overrides=[change])


def test_classes_are_those_of_equal_bearings():
    with pytest.raises((FaultsError, SpecError), match=r"front\.preload"):
        load_machine("motor_spindle", [MIXED, "bearing_set.front.preload=medium"])


def test_deep_groove_bearings_lean_as_far_as_their_clearance_lets_them():
    spec = load_machine("motor_spindle", GROOVES)
    kind = spec.bearing_types["6012"]
    assert kind.kind == "deep_groove_ball"
    # cos α = 1 - P_d / (2 A), A = 0.04 of 9.5 mm: 10 µm lean the rings by 9.3 degrees
    apart = 0.04 * kind.ball_diameter
    assert math.cos(kind.contact_angle) == pytest.approx(1.0 - 10e-6 / (2.0 * apart), rel=1e-9)
    tighter = load_machine("motor_spindle", [*GROOVES, "bearing_types.6012.radial_clearance=5 um"])
    assert tighter.bearing_types["6012"].contact_angle < kind.contact_angle
    found = states(spec)["R1"]
    # under load they lean further, and rub by Palmgren's law of their kind
    assert found.contact_angle_inner > kind.contact_angle
    assert found.heat_W == pytest.approx(states(load_machine("motor_spindle"))["R1"].heat_W, rel=0.25)
    assert any("6012" in item.rule for item in read_assumed("motor_spindle", GROOVES))
    slow = "operation.speed=3000 rpm"
    skf = states(load_machine("motor_spindle", [*GROOVES, "heat.model=skf", slow]))["R1"]
    palmgren = states(load_machine("motor_spindle", [*GROOVES, slow]))["R1"]
    assert 0.2 * palmgren.heat_W < skf.heat_W < 2.0 * palmgren.heat_W


def read_assumed(machine, overrides):
    from spindle_fem.definition.completion import complete
    from spindle_fem.definition.inherit import apply_overrides
    from spindle_fem.definition.load import find_machine
    from spindle_fem.definition.machine_spec import MachineSpec

    return complete(apply_overrides(read_definition(find_machine(machine)), overrides, MachineSpec))[1]


def test_every_deep_groove_bearing_is_one_that_can_be_assembled():
    for series in ("60", "62"):
        for code in (*range(4, 23), *range(24, 42, 2)):
            table = catalogue_bearing(f"{series}{code:02d}")
            ball, pitch = (float(table[key].split()[0]) for key in ("ball_diameter", "pitch_diameter"))
            # Conrad: half the circle and a little takes all balls but one side by side
            assert (table["ball_count"] - 1) * math.asin(ball / pitch) < math.radians(196.0) * 0.5 * 2.0
            assert table["ball_count"] >= 7
    # SKF's and NSK's catalogues have 9 balls of 9.525 mm and some 19.5 kN for the 6206
    table = catalogue_bearing("6206")
    assert (table["ball_count"], table["ball_diameter"]) == (9, "9.525 mm")
    geometry = BearingGeometry(9.525e-3, 9, 46e-3, 0.1, 0.52, 0.52, kind="deep_groove_ball")
    assert dynamic_load_rating(geometry) == pytest.approx(19.5e3, rel=0.02)


@pytest.mark.parametrize("model", ["palmgren", "skf", "full"])
def test_seals_and_cages_of_a_machine_s_bearings_add_their_heat(model):
    added = ["bearing_types.7014_C.seal_moment=0.04 N*m"]
    bare = states(load_machine("motor_spindle", [f"heat.model={model}"]))["F1"]
    sealed = states(load_machine("motor_spindle", [f"heat.model={model}", *added]))["F1"]
    speed = 9000.0 * np.pi / 30.0
    assert sealed.heat_W - bare.heat_W == pytest.approx(0.04 * speed, rel=1e-9)
    codes = {item.code for item in sealed.warnings}
    assert "cage_seal_not_given" not in codes
    assert ("cage_seal_not_given" in {item.code for item in bare.warnings}) == (model == "full")


@pytest.mark.parametrize("name", ["bearing_pair", "bearing_rollers"])
def test_the_files_that_ship_are_solved_drawn_and_told_in_80_columns(name, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    solved = spindle_fem.bearing(EXAMPLES / f"{name}.toml")
    print_bearing(solved)
    shown = capsys.readouterr().out
    assert "rating life h" in shown
    assert "highest pressure GPa" in shown
    assert ("cage" if name == "bearing_pair" else "seal") in shown
    assert max(map(len, shown.splitlines())) <= 120
    assert write_bearing_chart(solved, tmp_path / "loads.png").stat().st_size > 10_000


def test_balls_that_are_alike_are_shown_when_asked_for(tmp_path, capsys):
    file = tmp_path / "axial.toml"
    text = (EXAMPLES / "bearing_pair.toml").read_text(encoding="utf-8").replace('"800 N"', '"0 N"')
    file.write_text(text, encoding="utf-8")
    solved = spindle_fem.bearing(file)
    print_bearing(solved)
    assert "azimuth" not in capsys.readouterr().out
    print_bearing(solved, every=True)
    assert "azimuth" in capsys.readouterr().out
    # a set fails where its weakest bearing does, a little earlier
    lives = [bearing["rating_life_h"] for bearing in solved["bearings"]]
    assert 0.8 * min(lives) < solved["rating_life_h"] < min(lives)


@pytest.mark.parametrize(
    ("change", "said"), [((), True), (("bearing_types.sealed.radial_clearance=8 um",), False)]
)
def test_a_clearance_that_is_given_is_not_called_assumed(change, said):
    assumed = str(check_machine("groove_spindle", overrides=change)["assumed"])
    assert "as many balls as fill" in assumed
    assert ("10 µm of clearance as mounted" in assumed) == said
