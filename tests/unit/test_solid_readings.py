"""Displacement sensors on a field in three dimensions: a tube that grows, tilts and shifts."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.model.elastic.displacement_sensors import SensorSight
from spindle_fem.model.elastic.elastic_body import Face
from spindle_fem.model.elastic.solid_readings import solid_readings

GROWN, TILT, UP = 1e-4, 2e-4, 3e-6
ANGLE = 0.7


def readings(*sights: SensorSight) -> dict[str, float]:
    """The inner tube grows by a share of its size, is turned about x and shifted up; the outer one grows."""
    mesh = build_joined_tubes((0.03, 0.045, 0.06), 0.08, ((2, 1), 24, 4), parts=("shaft", "housing"))
    moved = GROWN * mesh.points
    own = np.unique(mesh.tetrahedra[mesh.part_of_element == 0])
    moved[own] += np.column_stack(
        [np.zeros(len(own)), UP - TILT * mesh.points[own, 2], TILT * mesh.points[own, 1]]
    )
    bodies = SimpleNamespace(
        shaft="shaft", housing="housing", parts={"shaft": ["shaft"], "housing": ["housing"]}
    )
    return solid_readings(SimpleNamespace(bodies=bodies, sights=sights), mesh, moved)


def test_what_sensors_see_of_a_shaft():
    found = readings(
        SensorSight("end", 0.0, 0.04, ANGLE, -1),
        SensorSight("whole end", 0.0, 0.04, None, -1),
        SensorSight("bore", 0.05, 0.03, ANGLE, 0),
    )
    # Turned about x, what is up at the front face moves backwards.
    assert found["end"] == pytest.approx(-TILT * 0.04 * np.cos(ANGLE), rel=1e-9)
    assert found["whole end"] == pytest.approx(0.0, abs=1e-15)
    # Points of the circle lie on chords of the elements' curved sides.
    assert found["bore"] == pytest.approx(GROWN * 0.03 + (UP - TILT * 0.05) * np.cos(ANGLE), rel=1e-3)


def test_a_holder_carries_its_sensor():
    face = Face((0.08, 0.08), (0.045, 0.06))
    found = readings(
        SensorSight("on a face", 0.0, 0.04, None, -1, face),
        SensorSight("on a spot", 0.0, 0.04, None, -1, face, (0.08, 0.05)),
    )
    assert found["on a face"] == pytest.approx(GROWN * 0.08, rel=1e-9)
    assert found["on a spot"] == pytest.approx(GROWN * 0.08, rel=1e-9)
