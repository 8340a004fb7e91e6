"""Machines with cylindrical rollers and radial loads: definition, statics, one law for all models."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.commands.machine_commands import check_machine
from spindle_fem.definition.bearing_catalogue import catalogue_bearing
from spindle_fem.definition.drawn_tables import element_rows
from spindle_fem.definition.load import (
    examine,
    find_machine,
    load_machine,
    read_definition,
    write_machine,
)
from spindle_fem.definition.machine_spec import RollerBearingType
from spindle_fem.errors import FaultsError, SpecError
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.operation.bearing_heat import BearingMechanics, BearingTemperatures
from spindle_fem.operation.coefficients import ball_row_capacity
from spindle_fem.operation.friction_map import tabulate_friction
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.radial_loads import radial_loads
from spindle_fem.solvers.machine_network_steady import solve_machine_network

RPM = np.pi / 30.0


def content(**changes):
    return {**read_definition(find_machine("belt_lathe")), **changes}


def faults(**changes) -> str:
    return "\n".join(str(fault) for fault in examine(content(**changes)).faults)


def group_with(name, **changes):
    return [{**group, **changes} if group["name"] == name else group for group in content()["bearing_set"]]


@pytest.fixture(scope="module")
def spec():
    return load_machine("belt_lathe")


@pytest.fixture(scope="module")
def mechanics(spec):
    return BearingMechanics(spec)


def everywhere(spec, celsius):
    return {b.name: BearingTemperatures(*(celsius + 273.15,) * 5) for _, b in spec.bearings}


def test_a_designation_gives_the_rollers(spec):
    kind = spec.bearing_types["NN3018_K"]
    assert isinstance(kind, RollerBearingType)
    assert (kind.rows, kind.roller_count, kind.kind) == (2, 28, "cylindrical_roller")
    assert (kind.mark_of("rows"), kind.mark_of("roller_count")) == ("C", "A")
    written = examine(tomllib.loads(write_machine(spec)))
    assert (written.spec, written.assumed, written.faults) == (spec, (), ())
    single = catalogue_bearing("N1018")
    assert (single["rows"], single["width"]) == (1, "24 mm")
    assert catalogue_bearing("NN3018 K HC")["roller_material"] == "silicon_nitride"


def test_a_value_of_a_bearing_that_ships_is_changed_by_its_name():
    spec = load_machine("belt_lathe", ["bearing_types.NN3018_K.radial_clearance=-3 um"])
    kind = spec.bearing_types["NN3018_K"]
    assert kind.radial_clearance == pytest.approx(-3e-6)
    assert (kind.roller_count, kind.mark_of("radial_clearance"), kind.mark_of("rows")) == (28, "U", "C")
    idle = BearingMechanics(spec).states(OperatingPoint.of(spec), everywhere(spec, 20.0), expand=False)
    assert idle["F1"].balls.load[:, 0].min() > 0.0


def test_every_roller_bearing_of_the_catalogue_is_a_sound_type():
    for series in ("N10", "NN30"):
        for code in (*range(4, 23), *range(24, 42, 2)):
            kind = RollerBearingType.model_validate(catalogue_bearing(f"{series}{code:02d} K"))
            assert kind.bore_diameter == pytest.approx(5e-3 * code)
            assert kind.roller_count >= 10


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"bearing_set": group_with("front", preload="100 N")}, "front.preload: .*radial_clearance"),
        ({"bearing_set": group_with("rear", carries_thrust=True)}, "rear.carries_thrust: .*carry none"),
        (
            {"bearing_set": group_with("front", fit={"inner_interference": "0 m", "outer_clearance": "0 m"})},
            "front.fit: .*clearance as mounted",
        ),
        ({"bearing_set": group_with("rear", carries_radial=False)}, "radial_load: only front carries"),
        ({"bearing_set": group_with("front", bearing_type="NN3003 K")}, "front.bearing_type: .*NN3014 K"),
        ({"bearing_types": {"NN3018_K": {"catalogue": "NN3018 K", "roller_count": 40}}}, "roller_count"),
        ({"bearing_types": {"NN3018_K": {"catalogue": "NN3018 K", "ball_count": 20}}}, "ball_count: unknown"),
    ],
)
def test_what_rollers_cannot_have_is_told_where_it_stands(changes, told):
    assert re.search(told, faults(**changes)), faults(**changes)


def test_heat_models_of_balls_alone_are_refused():
    told = r'heat.model: "full" knows ball bearings only.*palmgren, skf, table'
    with pytest.raises(SpecError, match=told):
        BearingMechanics(load_machine("belt_lathe", ["heat.model=full"]))
    with pytest.raises(FaultsError, match=told):
        check_machine("belt_lathe", overrides=["heat.model=full"])


def test_ball_bearings_still_need_preload_and_direction():
    groups = content()["bearing_set"]
    ball = {key: value for key, value in groups[1].items() if key != "preload"}
    ball["bearing"] = [{"name": "L1", "z": "97 mm"}, groups[1]["bearing"][1]]
    told = faults(bearing_set=[groups[0], ball, groups[2]])
    assert "bearing_set.locating.preload: is missing." in told
    assert "bearing_set.locating.bearing.L1.takes_thrust: is missing." in told


def test_two_supports_carry_what_statics_says(spec):
    # moments about the front: belt 1500 N down at 500 mm, cut 1000 N up at -60 mm
    front, rear = 68.5, 422.0
    at_rear = (-1500.0 * (500.0 - front) + 1000.0 * (-60.0 - front)) / (rear - front)
    shares = radial_loads(spec)
    assert shares["rear"] == pytest.approx(abs(at_rear))
    assert shares["front"] == pytest.approx(abs(1000.0 - 1500.0 - at_rear))
    assert shares["locating"] == 0.0


def test_loads_across_each_other_add_as_vectors_and_three_supports_share(spec):
    loads = [
        {"name": "up", "force": "300 N", "z": "68.5 mm"},
        {"name": "aside", "force": "400 N", "z": "68.5 mm", "angle": "90 deg"},
    ]
    crossed = examine(content(radial_load=loads)).spec
    assert radial_loads(crossed)["front"] == pytest.approx(500.0)
    three = examine(content(bearing_set=group_with("locating", carries_radial=True))).spec
    shares = radial_loads(three)
    assert min(shares.values()) > 0.0
    # forces on the rigid beam and their moments are in balance, front and locating on one side
    assert shares["front"] + shares["locating"] - shares["rear"] == pytest.approx(-500.0, abs=1.0)


def test_radial_load_reaches_rollers_and_balls(spec):
    point = OperatingPoint.of(spec)
    loaded = BearingMechanics(spec)(point, everywhere(spec, 40.0))[0]
    free = spec.model_copy(update={"radial_load": ()})
    idle = BearingMechanics(free)(point, everywhere(spec, 40.0))[0]
    for name in ("F1", "R1"):
        assert loaded[name].terms["load"] > 2.0 * idle[name].terms["load"]
        assert loaded[name].contact_pressure > 2.0 * idle[name].contact_pressure
    assert loaded["L1"] == idle["L1"]
    three = examine(content(bearing_set=group_with("locating", carries_radial=True))).spec
    balls = BearingMechanics(three)(point, everywhere(three, 40.0))[0]["L1"]
    assert balls.contact_pressure > 1.02 * idle["L1"].contact_pressure


def test_fast_models_take_the_same_heat_and_conductances(spec, mechanics):
    point = OperatingPoint.of(spec)
    table = tabulate_friction(spec, point.speed, (point.thrust,))
    at = replace(point, speed=0.6 * point.speed)
    exact = mechanics(at, everywhere(spec, 47.0))[0]
    names = [bearing.name for _, bearing in spec.bearings]
    series = table.at(at.speed, at.thrust).at(np.full((len(names), 1), 320.15))[:, :, 0]
    for row, name in zip(np.exp(series), names, strict=True):
        assert row[0] * at.speed == pytest.approx(exact[name].total, rel=2e-3)
        assert row[1] == pytest.approx(exact[name].conductance_inner, rel=2e-3)
        assert row[2] == pytest.approx(exact[name].conductance_outer, rel=2e-3)


def test_the_machine_s_network_settles_with_rollers(spec):
    network = build_machine_network(spec)
    state = solve_machine_network(network, OperatingPoint.of(spec))
    warmth = state.bearing_temperatures()
    assert 30.0 + 273.15 < warmth["F1"].outer < warmth["F1"].inner < 90.0 + 273.15
    expanding = load_machine("belt_lathe", ["heat.thermal_preload=true"])
    tight = solve_machine_network(build_machine_network(expanding), OperatingPoint.of(expanding))
    # the inner ring is warmer than the outer one, so the rollers are pressed
    assert tight.bearing_temperatures()["F1"].inner > warmth["F1"].inner + 0.1


def test_rollers_are_drawn_and_store_heat(spec):
    group, bearing = spec.bearings[0]
    rows = element_rows(bearing, spec.bearing_types[group.bearing_type])
    assert len(rows) == 2
    assert (rows[0].z, rows[1].z) == pytest.approx((0.05 + 0.037 / 4, 0.05 + 0.037 * 3 / 4))
    assert rows[1].turned == pytest.approx(np.pi / 28)
    volume = 56 * np.pi / 4 * 11e-3**2 * 9.9e-3
    assert ball_row_capacity(spec, group, group.bearing[0]) == pytest.approx(volume * 7810.0 * 475.0)
