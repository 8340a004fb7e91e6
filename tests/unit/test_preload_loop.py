"""Shaft, housing and spacers between the two sides of a set: how they give way, against springs in series."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import BadInputError, SpecError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.geometry.part_shapes import AnnularSegment
from spindle_fem.machine.meshing.build_mesh import build_mesh
from spindle_fem.model.elastic.elastic_body import ElasticBody, Face
from spindle_fem.model.elastic.machine_bodies import machine_bodies
from spindle_fem.model.elastic.machine_growth import GrowthModel
from spindle_fem.model.elastic.meridian_mesh import MeridianMesh
from spindle_fem.model.elastic.preload_loop import (
    carrier_give,
    loop_stiffness,
    spacer_give,
    tube_give,
)
from spindle_fem.operation.assembled_sets import assembled_set
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_set import (
    BearingSet,
    BearingTemperatures,
    MountedBearing,
    SetTemperatures,
    solve_bearing_set,
)
from spindle_fem.physics.elasticity.elastic_material import ElasticMaterial

YOUNG = 2.1e11
STEEL = ElasticMaterial(YOUNG, 0.3, 12e-6, 7850.0).stiffness


def area(inner: float, outer: float) -> float:
    """Of a ring with these diameters, m²."""
    return 0.25 * math.pi * (outer**2 - inner**2)


def tube(length: float, inner: float, outer: float) -> ElasticBody:
    shape = AnnularSegment(0.0, length, 0.5 * inner, 0.5 * outer)
    lines = [0.02, length - 0.02] if length > 0.1 else []
    return ElasticBody("tube", MeridianMesh.of([[shape]], 2e-3, z_lines=lines), [STEEL])


def test_a_tube_between_its_ends_is_a_spring_of_its_length() -> None:
    found = tube_give(tube(0.03, 0.1, 0.12), (0.0, 0.03), (0.05, 0.06))
    assert found == pytest.approx(0.03 / (YOUNG * area(0.1, 0.12)), rel=1e-9)


def test_seats_on_a_thin_tube_let_it_stretch_between_them() -> None:
    """A force that a seat of width w takes evenly acts, for its mean shift, w/3 from the seat's inner end.

    The shift inside a seat grows to w F / 2EA with the square of the place; its mean is w F / 3EA.
    """
    body = tube(0.3, 0.1, 0.102)
    seats = [Face((0.0, 0.02), (0.051, 0.051)), Face((0.28, 0.3), (0.051, 0.051))]
    found = carrier_give(body, seats, np.array([1.0, -1.0]))
    expected = (0.26 + 2.0 * 0.02 / 3.0) / (YOUNG * area(0.1, 0.102))
    assert found == pytest.approx(expected, rel=0.01)


# ------------------------------------------------------------- reference machine
@pytest.fixture(scope="module")
def spec():
    return load_machine("wu_tan_2016", ["mesh.preset=coarse"])


def test_the_loop_of_the_front_set_is_springs_in_series(spec) -> None:
    """F1 and F2 share the force: between them is half of it; shaft beside rings, housing beside rings."""
    group = next(item for item in spec.bearing_set if item.name == "front")
    bodies = machine_bodies(spec)
    give = 0.0
    for inner in (True, False):
        seats = [seat for seat in bodies.seats if seat.is_inner is inner][:3]
        radii = sorted((seats[0].face.r[0], seats[0].raceway.r[0]))
        ring = 0.024 / (YOUNG * area(*(2.0 * r for r in radii)))
        name = "front_inner_spacer" if inner else "front_outer_spacer"
        part = next(part for part in spec.part if part.name == name)
        (segment,) = part.segment
        young = spec.part_material(name).young_modulus
        spacer = 0.020 / (young * area(segment.inner_diameter, segment.outer_diameter))
        assert spacer_give(spec, part) == pytest.approx(spacer, rel=1e-9)
        ring *= YOUNG / spec.part_material(seats[0].ring).young_modulus
        stack = 0.25 * ring + (ring + spacer)
        carrier = carrier_give(
            bodies.bodies[seats[0].carrier], [s.face for s in seats], np.array([0.5, 0.5, -1.0])
        )
        if inner:
            # The shaft between the middles of seats, by hand; seats give way themselves.
            alone = (0.25 * 0.024 + 0.044) / (spec.part_material("shaft").young_modulus * area(0.06, 0.14))
            assert alone < carrier < 2.0 * alone
        give += 1.0 / (1.0 / carrier + 1.0 / stack)
    assert loop_stiffness(spec, group, bodies) == pytest.approx(1.0 / give, rel=1e-6)
    # 21 N/nm, beside 0.06 N/nm of the bearings in series.
    assert loop_stiffness(spec, group, bodies) == pytest.approx(2.13e10, rel=0.01)


def test_a_set_asks_for_its_loop_by_name(spec) -> None:
    elastic = load_machine("wu_tan_2016", ["bearing_set.front.preload_kind=elastic"])
    front, rear = elastic.bearing_set
    assert assembled_set(elastic, front).loop_stiffness == pytest.approx(2.13e10, rel=0.01)
    assert assembled_set(elastic, rear).loop_stiffness is None
    with pytest.raises(BadInputError, match="Allowed: rigid, elastic, spring"):
        load_machine("wu_tan_2016", ["bearing_set.front.preload_kind=glued"])


def test_spacers_grow_as_warm_as_they_are(spec) -> None:
    """α ΔT L of even rises; of one that grows along the axis its mean."""
    mesh = build_mesh(build_assembly(spec), preset="coarse")
    model = GrowthModel(spec, mesh, 1)
    steel = spec.part_material("front_inner_spacer").thermal_expansion
    even = np.full(mesh.n_corners, model.assembly_temperature + 10.0)
    found = model.at(even, 0.0, model.assembly_forces).spacers
    assert set(found) == {f"{a}_{b}_spacer" for a in ("front", "rear") for b in ("inner", "outer")}
    assert found["front_inner_spacer"] == pytest.approx(10.0 * steel * 0.020, rel=1e-4)
    assert found["rear_outer_spacer"] == pytest.approx(10.0 * steel * 0.010, rel=1e-4)
    along = model.assembly_temperature + 100.0 * mesh.points[: mesh.n_corners, 2]
    found = model.at(along, 0.0, model.assembly_forces).spacers
    assert found["front_inner_spacer"] == pytest.approx(100.0 * 0.103 * steel * 0.020, rel=1e-3)


# -------------------------------------------------------------------- mechanics
BALLS = BearingGeometry(14.2875e-3, 30, 165e-3, math.radians(15.0), 0.52, 0.52)
PAIR = BearingSet((MountedBearing("A", BALLS, -1, 0.0), MountedBearing("B", BALLS, 1, 0.3)), preload=1000.0)


def warm(rise: float) -> SetTemperatures:
    """A shaft that is warmer than at assembly; rings are not."""
    cold = BearingTemperatures(293.15, 293.15, 293.15)
    return SetTemperatures((cold, cold), 293.15 + rise, 293.15, 293.15)


def force(bearings: BearingSet, rise: float) -> float:
    return solve_bearing_set(bearings, 0.0, 0.0, warm(rise), control="outer")[0].axial_force


def test_a_loop_gives_way_to_what_is_beyond_the_preload_of_assembly() -> None:
    """Face to face a longer shaft presses on; in the end the loop has taken its share of the lengthening."""
    stiffness = 2e8
    loop = replace(PAIR, loop_stiffness=stiffness)
    assert force(loop, 0.0) == pytest.approx(1000.0, rel=1e-6)
    pressed = force(loop, 8.0)
    assert 1000.0 < pressed < force(PAIR, 8.0)
    # The shaft between the centres of the inner grooves lengthens by α ΔT times their distance.
    reach = 2.0 * (BALLS.groove_curvature_inner - 0.5) * BALLS.ball_diameter * math.sin(BALLS.contact_angle)
    by_kelvin = PAIR.shaft_expansion * (0.3 + reach)
    as_rigid = 8.0 - (pressed - 1000.0) / stiffness / by_kelvin
    assert force(PAIR, as_rigid) == pytest.approx(pressed, rel=1e-6)
    assert force(replace(PAIR, loop_stiffness=1e16), 8.0) == pytest.approx(force(PAIR, 8.0), rel=1e-6)


def test_states_side_by_side_keep_their_loops() -> None:
    """With thrust the remaining preload is solved beside the loaded state."""
    loop = replace(PAIR, loop_stiffness=2e8)
    states = solve_bearing_set(loop, 0.0, 200.0, warm(8.0), control="outer")
    assert states[0].preload == pytest.approx(force(loop, 8.0), rel=1e-6)
    assert states[1].axial_force - states[0].axial_force == pytest.approx(200.0, rel=1e-6)
    with pytest.raises(SpecError, match="loop_stiffness"):
        replace(PAIR, loop_stiffness=0.0)
