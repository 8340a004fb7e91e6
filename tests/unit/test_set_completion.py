"""What rules give bearing sets: spacers between their bearings, preload classes."""

from __future__ import annotations

import tomllib

import pytest

from spindle_fem.definition.bearing_catalogue import preload_of_class
from spindle_fem.definition.load import examine, find_machine, read_definition, write_machine


def page(*changes, **others):
    """The router spindle with what changes in its front set."""
    content = read_definition(find_machine("router_spindle"))
    front, rear = content["bearing_set"]
    for change in changes:
        front = {**front, **change}
    return {**content, "bearing_set": [front, rear], **others}


def test_rings_between_bearings_are_as_high_as_theirs():
    result = examine(page())
    assert not result.faults
    parts = {part.name: part for part in result.spec.part}
    kind = result.spec.bearing_types["7006_C_HC"]
    inner, outer = parts["front_inner_spacer"], parts["front_outer_spacer"]
    assert (inner.rotating, outer.rotating, inner.material) == (True, False, "steel")
    assert inner.segment[0].z == pytest.approx((0.033, 0.049))
    assert inner.segment[0].inner_diameter == pytest.approx(kind.bore_diameter)
    assert inner.segment[0].outer_diameter == pytest.approx(kind.inner_ring_outer_diameter)
    assert outer.segment[0].inner_diameter == pytest.approx(kind.outer_ring_inner_diameter)
    assert outer.segment[0].outer_diameter == pytest.approx(kind.outer_diameter)
    assert {"part.front_inner_spacer", "part.front_outer_spacer"} <= {item.where for item in result.assumed}
    again = examine(tomllib.loads(write_machine(result.spec)))
    assert (again.spec, again.assumed) == (result.spec, ())


def test_the_file_s_own_spacer_stays_and_neighbours_need_none():
    segment = {
        "name": "ring",
        "z": ["33 mm", "49 mm"],
        "inner_diameter": "30 mm",
        "outer_diameter": "36 mm",
    }
    own = {"name": "front_inner_spacer", "material": "steel", "rotating": True, "segment": [segment]}
    parts = [*page()["part"], own]
    spec = examine(page(part=parts)).spec
    found = [part for part in spec.part if part.name == "front_inner_spacer"]
    assert [part.segment[0].outer_diameter for part in found] == pytest.approx([0.036])
    close = [{"name": "F1", "z": "20 mm", "takes_thrust": "towards_rear"}]
    close += [{"name": "F2", "z": "33 mm", "takes_thrust": "towards_nose"}]
    names = {part.name for part in examine(page({"bearing": close})).spec.part}
    assert not any(name.startswith("front_") for name in names)


def test_several_gaps_are_numbered():
    three = [
        {"name": f"F{number}", "z": f"{z} mm", "takes_thrust": side}
        for number, z, side in ((1, 20, "towards_rear"), (2, 34, "towards_rear"), (3, 49, "towards_nose"))
    ]
    spec = examine(page({"bearing": three})).spec
    inner = [part.name for part in spec.part if part.name.startswith("front_inner")]
    assert inner == ["front_inner_spacer_1", "front_inner_spacer_2"]


@pytest.mark.parametrize(
    ("sides", "factor"), [((1, 1), 1.0), ((2, 1), 1.359), ((2, 2), 2.0), ((3, 2), 2.415)]
)
def test_a_class_is_the_force_of_the_set(sides, factor):
    turned = ["towards_rear"] * sides[0] + ["towards_nose"] * sides[1]
    rows = [
        {"name": f"F{number}", "z": f"{20 + 13 * number} mm", "takes_thrust": side}
        for number, side in enumerate(turned)
    ]
    result = examine(page({"bearing": rows, "preload": "heavy"}))
    own = preload_of_class("7006 C", "heavy")
    assert result.spec.bearing_set[0].preload == pytest.approx(factor * own, rel=1e-3)
    (rule,) = [item.rule for item in result.assumed if item.where == "bearing_set.front.preload"]
    assert "heavy" in rule
    assert "IBC" in rule


@pytest.mark.parametrize(
    "change",
    [
        {"preload": "middle"},
        {"bearing_type": "own"},
        {"bearing": [{"name": "F1", "z": "20 mm", "takes_thrust": "towards_rear"}]},
    ],
)
def test_a_class_without_a_force_is_told(change):
    kind = read_definition(find_machine("small_two_start"))["bearing_types"]["7010_C"]
    result = examine(page(change, bearing_types={"own": kind}))
    told = [str(fault) for fault in result.faults if "bearing_set.front.preload" in str(fault)]
    assert len(told) == 1
    assert "light, medium, heavy" in told[0]
