"""Sets on springs: a rear pair in tandem that all face one way, bearings at both ends in one set."""

from __future__ import annotations

import math

import pytest

from spindle_fem.commands.machine_commands import check_machine
from spindle_fem.definition.load import find_machine, load_machine
from spindle_fem.definition.solid_tables import Fit
from spindle_fem.errors import FaultsError, SpecError
from spindle_fem.machine.view.machine_names import MachineNames
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.operation.bearing_heat import BearingMechanics, BearingTemperatures
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.preload_mechanics import PreloadMechanics

TANDEM = ("bearing_set.rear.preload_kind=spring", "bearing_set.rear.bearing.R1.takes_thrust=towards_nose")


def states(spec):
    warm = {b.name: BearingTemperatures(*(313.15,) * 5) for _, b in spec.bearings}
    return BearingMechanics(spec).states(OperatingPoint.of(spec), warm, expand=False)


@pytest.mark.parametrize("thrust", [0.0, 250.0])
def test_springs_keep_their_force_and_load_the_set_that_holds_the_shaft(thrust):
    spec = load_machine(
        "motor_spindle", [*TANDEM, f"operation.thrust={thrust} N", "operation.speed=3000 rpm"]
    )
    front, rear = spec.bearing_set
    assert spec.axial_load(rear, thrust) == -200.0
    assert spec.axial_load(front, thrust) == thrust + 200.0
    found = states(spec)
    for name in ("R1", "R2"):
        assert found[name].axial_force == pytest.approx(100.0, rel=1e-6)
        assert found[name].preload == found[name].axial_force
    # forces along the shaft add up
    held = found["F1"].axial_force - found["F2"].axial_force
    assert held == pytest.approx(thrust + 200.0, rel=1e-6)


def test_springs_that_push_the_other_way_take_thrust_off():
    other = "bearing_set.rear.bearing.R2.takes_thrust=towards_rear"
    spec = load_machine("motor_spindle", [TANDEM[0], other])
    assert spec.axial_load(spec.bearing_set[0], 300.0) == 100.0


def test_a_class_of_springs_loads_each_bearing_as_in_a_pair():
    spec, pair = (
        load_machine("motor_spindle", [*changes, "bearing_set.rear.preload=light"])
        for changes in (TANDEM, TANDEM[:1])
    )
    assert spec.bearing_set[1].preload == pytest.approx(2.0 * pair.bearing_set[1].preload, rel=1e-3)


def test_springs_on_bearings_of_one_direction_hold_no_shaft():
    with pytest.raises((FaultsError, SpecError), match=r"rear\.carries_thrust: .*springs, which give way"):
        load_machine(
            "motor_spindle",
            [*TANDEM, "bearing_set.rear.carries_thrust=true", "bearing_set.front.carries_thrust=false"],
        )


def fitted(*changes):
    spec = load_machine("motor_spindle", [*changes, "mesh.preset=coarse"])
    fit = Fit(inner_interference="3 um", outer_clearance="6 um")
    sets = tuple(group.model_copy(update={"fit": fit}) for group in spec.bearing_set)
    return spec.model_copy(update={"bearing_set": sets})


def test_their_rings_are_seated_by_the_share_of_the_force():
    # each of a tandem pair has half of it, each of an opposed pair all of it
    tandem, opposed = (
        BearingMechanics(spec, build_machine_network(spec).growth.seats).assembled_seats()
        for spec in (fitted(*TANDEM, "bearing_set.rear.preload=400 N"), fitted())
    )
    assert tandem["R1"][0][0] > 0.0
    for name in ("F1", "R1", "R2"):
        for found, known in zip(tandem[name], opposed[name], strict=True):
            assert found == pytest.approx(known, rel=1e-6)


def test_their_preload_is_no_effect_of_temperature():
    spec = fitted(*TANDEM)
    mechanics = PreloadMechanics(spec, frozenset(MachineNames.of(spec).place_names))
    assert mechanics("rear_bearings") is None


def test_bearings_at_both_ends_are_one_set_with_rings_of_their_own(tmp_path):
    # what rules give follows each bearing's own type: seats, raceways, and no spacer between unlike rings
    text = find_machine("motor_spindle").read_text(encoding="utf-8")
    sets = text[text.index("bearing_set = [") : text.index("probe = [")]
    both = """bearing_set = [
    {name = "both", bearing_type = "7014 C", preload = "300 N", preload_kind = "spring", carries_thrust = true, marks = "A", spacers = "steel", bearing = [
        {name = "F1", z = "40 mm", takes_thrust = "towards_rear"},
        {name = "F2", z = "100 mm", takes_thrust = "towards_rear"},
        {name = "R1", z = "330 mm", takes_thrust = "towards_nose", bearing_type = "7012 C"},
        {name = "R2", z = "368 mm", takes_thrust = "towards_nose", bearing_type = "7012 C"}]},
]
"""  # noqa: E501
    file = tmp_path / "both.toml"
    spacers = text[text.index('    {name = "inner_spacer"') : text.index('    {name = "stator", material')]
    file.write_text(text.replace(sets, both).replace(spacers, ""), encoding="utf-8")
    said = check_machine(file)
    conductance = {row["name"]: row["detail"] for row in said["contacts"]}
    assert conductance["R2.inner_ring|shaft"].startswith("workshop_inner_seats")
    spacers = [part["name"] for part in said["parts"] if "_spacer" in part["name"]]
    assert "both_inner_spacer_2" in spacers
    assert not any(name.endswith("_3") for name in spacers)
    spec = load_machine(file, ["operation.thrust=100 N", "operation.speed=3000 rpm"])
    found = states(spec)
    assert found["F1"].axial_force + found["F2"].axial_force == pytest.approx(400.0, rel=1e-6)
    assert found["R1"].axial_force + found["R2"].axial_force == pytest.approx(300.0, rel=1e-6)
    assert math.isfinite(found["F1"].heat.total)


def test_springs_keep_the_load_of_balls_that_fly_outwards():
    # at rest the raceways would stand too far apart for the balls; the springs bring them nearer
    spec = load_machine("motor_spindle", [*TANDEM, "operation.speed=18000 rpm", "operation.thrust=0 N"])
    codes = {name: {note.code for note in state.warnings} for name, state in states(spec).items()}
    assert "counter_bearing_unloaded" not in codes["R1"] | codes["R2"]


FACING = ("bearing_set.front.bearing.F2.takes_thrust=towards_rear", "bearing_set.front.preload=0 N")


def test_springs_of_the_rear_seat_the_rings_of_a_front_pair_in_tandem():
    spec = fitted(*TANDEM, *FACING, "operation.thrust=0 N")
    mechanics = BearingMechanics(spec, build_machine_network(spec).growth.seats)
    assert mechanics.sets["front"].assembled_force == mechanics.sets["rear"].assembled_force == 200.0
    assert mechanics.assembled_seats()["F1"][0][0] > 0.0
    assert states(spec)["F1"].axial_force == pytest.approx(100.0, rel=1e-6)


def test_a_pair_in_tandem_that_others_press_on_shares_their_force_and_has_no_preload():
    thrust, different = 250.0, "bearing_set.front.bearing.F2.bearing_type=7014 AC"
    spec = load_machine("motor_spindle", [*TANDEM, *FACING, f"operation.thrust={thrust} N", different])
    warm = {bearing.name: BearingTemperatures(*(313.15,) * 5) for _, bearing in spec.bearings}
    found, _ = BearingMechanics(spec)(OperatingPoint.of(spec), warm)
    loads = [found[name].axial_load for name in ("F1", "F2")]
    assert sum(loads) == pytest.approx(thrust + 200.0, rel=1e-6)
    # the steeper contacts of the second take more of it
    assert loads[1] > 1.2 * loads[0] > 0.0
    assert math.isnan(found["F1"].preload)


@pytest.mark.parametrize(("thrust", "sound"), [("0 N", False), ("-50 N", False), ("50 N", True)])
def test_check_refuses_a_shaft_that_nothing_holds(thrust, sound):
    changes = [*FACING, f"operation.thrust={thrust}"]
    if sound:
        check_machine("motor_spindle", overrides=changes)
        return
    thrown = [
        "bearing_set.front.preload_kind=spring",
        "bearing_set.front.preload=200N",
        "operation.thrust=-250N",
    ]
    with pytest.raises(FaultsError, match=r"bearing_set\.front\.preload: 200 N of its spring .* by 250 N"):
        check_machine("motor_spindle", overrides=thrown)
    with pytest.raises(FaultsError, match=r"bearing_set\.front\.preload: .*nothing presses them on"):
        check_machine("motor_spindle", overrides=changes)


def test_check_names_every_set_that_nothing_presses_on():
    changes = [*FACING, TANDEM[1], "bearing_set.rear.preload=0 N", "operation.thrust=0 N"]
    with pytest.raises(FaultsError) as told:
        check_machine("motor_spindle", overrides=changes)
    assert [f"bearing_set.{name}.preload" in str(told.value) for name in ("front", "rear")] == [True, True]
