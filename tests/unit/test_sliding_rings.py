"""Outer rings that springs press: sliding ones keep the force, held ones close the loop."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import BadInputError
from spindle_fem.operation.assembled_sets import assembled_set
from spindle_fem.operation.sliding_rings import sliding_rings, stuck_rings
from spindle_fem.physics.bearings.bearing_set import solve_states
from spindle_fem.physics.bearings.mounting import ExternalLoad, uniform_temperatures
from spindle_fem.physics.bearings.preload import axial_force

SPRUNG = "bearing_set.rear.preload_kind=spring"
HELD = "bearing_set.rear.fit.outer_ring=held"
TANDEM = "bearing_set.rear.bearing.R1.takes_thrust=towards_nose"
RISE = 8.0


def rear(*changes):
    return load_machine("wu_tan_2016", changes).bearing_set[1]


def force_with_a_warm_shaft(*changes: str) -> float:
    """Force of R1 at rest with the shaft between the bearings warmer, its rings rigid and cold."""
    spec = load_machine("wu_tan_2016", changes)
    mounted = assembled_set(spec, spec.bearing_set[1]).with_rigid_rings()
    cold = uniform_temperatures(2, 293.15)
    warm = replace(cold, shaft=293.15 + RISE)
    ((first, second),) = solve_states(mounted, 0.0, ExternalLoad(), (warm,), control="outer")
    assert second.axial_force == pytest.approx(first.axial_force, rel=1e-6)
    return first.axial_force


def test_a_ring_that_slides_keeps_the_force_and_one_that_is_held_loses_what_the_shaft_grows_by() -> None:
    spec = load_machine("wu_tan_2016", [SPRUNG])
    group = spec.bearing_set[1]
    assert force_with_a_warm_shaft(SPRUNG) == pytest.approx(group.preload, rel=1e-9)
    mounted = assembled_set(spec, group)
    first, second = mounted.bearings
    geometry = first.geometry
    # by hand: back to back, the inner grooves stand apart by the bearings' distance and what both angles add
    add = (geometry.groove_curvature_inner - 0.5) * geometry.ball_diameter * math.sin(geometry.contact_angle)
    apart = second.axial_position - first.axial_position - 2.0 * add
    lost = 0.5 * mounted.shaft_expansion * RISE * apart
    rigid = mounted.with_rigid_rings().assembly_approaches()
    by_hand = axial_force(geometry, float(rigid[0]) - lost)
    assert 0.2 * group.preload < by_hand < 0.95 * group.preload
    assert force_with_a_warm_shaft(SPRUNG, HELD) == pytest.approx(by_hand, rel=1e-6)
    assert force_with_a_warm_shaft() == pytest.approx(by_hand, rel=1e-6)


def test_friction_that_holds_more_than_the_springs_is_told_with_its_numbers() -> None:
    group = rear(SPRUNG, "bearing_set.rear.preload=600 N", "bearing_set.rear.fit.seat_friction=0.15")
    # 0.15 × (2 + 1) MPa × 1e-3 m² = 450 N, 0.15 × (3 + 2) MPa × 1e-3 m² = 750 N
    assert stuck_rings(group, {"R1": (2e6, 1e-3), "R2": (1e6, 1e-3)}) == ()
    (told,) = stuck_rings(group, {"R1": (3e6, 1e-3), "R2": (2e6, 1e-3)})
    assert told.code == "ring_sticks"
    assert "up to 3.00 MPa hold them with 750 N (friction 0.15)" in told.text
    assert "more than the force of the springs, 600 N" in told.text
    assert 'bearing_set.rear.fit.outer_ring = "held"' in told.text


def test_rings_that_slide() -> None:
    spec = load_machine("wu_tan_2016", ["bearing_set.front.preload_kind=spring"])
    front, back = spec.bearing_set
    assert sliding_rings(front) == ("F3",)
    # a set that does not hold the shaft moves with it
    assert sliding_rings(back) == ("R1", "R2")
    held = load_machine("wu_tan_2016").bearing_set[0]
    assert sliding_rings(held) == ()
    assert stuck_rings(held, {}) == ()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (["bearing_set.rear.fit.outer_ring=slides"], 'preload_kind is "rigid": no spring presses rings'),
        ([SPRUNG, TANDEM, HELD], "its bearings all face one way, on springs"),
        ([SPRUNG, "bearing_set.rear.fit.outer_ring=glued"], "Allowed: slides, held"),
    ],
)
def test_rings_that_nothing_moves_are_refused(changes, message) -> None:
    with pytest.raises(BadInputError, match=r"fit\.outer_ring") as told:
        load_machine("wu_tan_2016", changes)
    assert message in str(told.value)
