"""Neighbourhoods and slopes of point probes, on fields that the elements hold exactly."""

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.machine_spec import Probe
from spindle_fem.errors import GeometryError
from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.machine.view.place_names import ringed_probes
from spindle_fem.model.mesh.evaluate import probe_matrix
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.operation.probe_places import (
    around_places,
    harmonics,
    near_places,
    probe_positions,
    probe_slopes,
)

# Two tubes, radii 100, 150 and 200 mm, 100 mm long.
MESH = build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((4, 3), 48, 6))
GRADIENT = np.array([200.0, -100.0, 300.0])


def probe(name, r, z, angle="0 deg", part="inner"):
    return Probe(name=name, part=part, r=f"{r} mm", z=f"{z} mm", angle=angle)


@pytest.fixture(scope="module", params=[1, 2])
def operators(request):
    return build_operators(MESH, request.param)


def test_a_neighbourhood_is_a_mean_around_its_probe(operators):
    probes = [probe("A", 125, 50), probe("B", 125, 50, "180 deg"), probe("C", 175, 50, part="outer")]
    near = dict(near_places(operators, probes))
    assert list(near) == ["near.A", "near.B", "near.C"]
    x, y, z = MESH.points[: operators.n_unknowns].T
    for item, vector in zip(probes, near.values(), strict=True):
        assert vector.sum() == pytest.approx(1.0, abs=1e-12)
        own = operators.part_of_unknown == MESH.part_names.index(item.part)
        assert not vector[~own].any()
    # The centre of mass lies at the probe: at its side of the axis, half-way along.
    for name, side in (("near.A", 1.0), ("near.B", -1.0)):
        assert near[name] @ y == pytest.approx(side * 0.125, abs=2e-3)
        assert near[name] @ x == pytest.approx(0.0, abs=1e-3)
        assert near[name] @ z == pytest.approx(0.05, abs=1e-3)


def test_a_neighbourhood_spreads_over_some_20_mm():
    operators = build_operators(build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((6, 6), 96, 12)), 2)
    [(_, vector)] = near_places(operators, [probe("A", 125, 50)])
    offset = operators.mesh.points - np.array([0.0, 0.125, 0.05])
    spread = np.sqrt(vector @ np.sum(offset**2, axis=1))
    # The walls, 25 mm away inside and outside, cut the Gaussian's tails.
    assert 0.018 < spread < 0.0215


def test_a_ring_goes_round_the_axis_through_its_probe():
    operators = build_operators(build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((6, 6), 96, 12)), 2)
    [(name, vector)] = around_places(operators, [probe("A", 125, 50, "30 deg")])
    x, y, z = operators.mesh.points.T
    radius = np.hypot(x, y)
    assert name == "around.A"
    assert vector.sum() == pytest.approx(1.0, abs=1e-12)
    # Tetrahedra are not quite alike at both ends and on all sides.
    assert [vector @ x, vector @ y, vector @ z] == pytest.approx([0.0, 0.0, 0.05], abs=1e-4)
    # Two of the three directions of a patch; the walls cut the tails, and outer radii have more room.
    spread = np.sqrt(vector @ ((radius - 0.125) ** 2 + (z - 0.05) ** 2))
    assert 0.9 * 0.02 * np.sqrt(2.0 / 3.0) < spread < 1.02 * 0.02 * np.sqrt(2.0 / 3.0)
    assert 0.125 < vector @ radius < 0.128


def test_probes_at_bearings_have_no_ring_of_their_own():
    spec = load_machine("recorded_spindle")
    assert [item.name for item in ringed_probes(spec)] == ["SP04"]


def test_harmonics_of_a_place_tell_which_side_is_warmer(operators):
    mean = np.where(operators.part_of_unknown == MESH.part_names.index("outer"), operators.part_load, 0.0)
    up, across = harmonics(operators, mean / mean.sum())
    x, y, _ = MESH.points[: operators.n_unknowns].T
    angle = np.arctan2(-x, y)
    radius = np.hypot(x, y)
    field = 300.0 + 8.0 * np.cos(angle) - 6.0 * np.sin(angle) + 5.0 * np.cos(2.0 * angle) + radius
    assert up @ field == pytest.approx(4.0, abs=1e-6)
    assert across @ field == pytest.approx(-3.0, abs=1e-6)
    assert [up.sum(), across.sum()] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_slopes_of_a_linear_field_are_its_gradient():
    operators = build_operators(MESH, 2)
    field = 300.0 + MESH.points @ GRADIENT
    # Inside, on a wall that lets it move one way only, and turned by 60 degrees.
    probes = [probe("A", 125, 50), probe("B", 125, 0), probe("C", 175, 70, "60 deg", part="outer")]
    slopes = (probe_slopes(operators, probes) @ field).reshape(3, 2)
    angle = np.deg2rad(60.0)
    outward = [-100.0, -100.0, -200.0 * np.sin(angle) - 100.0 * np.cos(angle)]
    assert slopes[:, 0] == pytest.approx(outward, abs=1e-6)
    assert slopes[:, 1] == pytest.approx(300.0, abs=1e-6)


def test_slopes_predict_the_reading_of_a_displaced_probe():
    operators = build_operators(MESH, 2)
    field = 300.0 + 40.0 * np.log(np.hypot(*MESH.points[:, :2].T) / 0.1)
    here, there = probe("A", 120, 50), probe("A", 120.5, 50)
    rows = probe_matrix(operators, probe_positions([here, there]), ["inner"] * 2)
    before, after = rows @ field
    slope = (probe_slopes(operators, [here]) @ field)[0]
    assert after - before == pytest.approx(0.5e-3 * slope, rel=0.02)
    assert slope == pytest.approx(40.0 / 0.12, rel=0.05)


def test_a_probe_at_a_joint_moves_in_its_own_part_only():
    operators = build_operators(MESH, 2)
    inner = np.isin(np.arange(operators.n_unknowns), np.unique(MESH.tetrahedra[MESH.part_of_element == 0]))
    radius = np.hypot(*MESH.points[:, :2].T)
    field = np.where(inner, 1000.0 * radius, 5000.0 * radius + 40.0)
    probes = [probe("A", 150, 50), probe("B", 150, 50, part="outer")]
    slopes = (probe_slopes(operators, probes) @ field).reshape(2, 2)
    assert slopes[:, 0] == pytest.approx([1000.0, 5000.0], rel=1e-3)


def test_a_part_too_thin_to_move_in_is_refused():
    thin = build_joined_tubes((0.1, 0.1004, 0.2), 0.1, ((1, 2), 48, 3))
    with pytest.raises(GeometryError, match=r"probe A: .inner. ends within 0.5 mm on both sides along r"):
        probe_slopes(build_operators(thin, 2), [probe("A", 100.2, 50)])


def test_a_machine_without_point_probes_has_no_rows():
    operators = build_operators(MESH, 1)
    assert probe_slopes(operators, []).shape == (0, operators.n_unknowns)
    assert list(near_places(operators, [])) == []
    assert probe_matrix(operators, probe_positions([]), []).shape == (0, operators.n_unknowns)
