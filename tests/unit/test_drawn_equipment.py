"""Coolant, heat sources and displacement sensors in the drawing of a machine; cracks of sections closed."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from spindle_fem.definition.circuit_tables import CircuitFilm
from spindle_fem.definition.load import examine, find_machine, read_definition
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.report import drawn_equipment
from spindle_fem.report.drawn_surfaces import TriangleSet
from spindle_fem.report.machine_drawing import machine_drawing
from spindle_fem.report.plane_sections import behind

DUCTS = {
    "bore": ({"duct": "bore"}, [((0.0, 0.2), (0.0, 0.05))]),
    "annulus": ({"duct": "annulus", "outer_diameter": "104 mm"}, [((0.0, 0.2), (0.05, 0.052))]),
    "rings": (
        {"duct": "ring_grooves", "width": "10 mm", "depth": "4 mm", "number": 2},
        [((0.045, 0.055), (0.05, 0.054)), ((0.145, 0.155), (0.05, 0.054))],
    ),
    "bores": ({"duct": "axial_bores", "bore_diameter": "8 mm"}, [((0.0, 0.2), (0.042, 0.05))]),
}


def circuit(**changed):
    return CircuitFilm.model_validate(
        {
            "kind": "circuit", "name": "c", "part": "p", "diameter": "100 mm", "z": ["0 mm", "200 mm"],
            "fluid": "water", "inlet_temperature": "20 degC", "flow": "5 L/min", **changed,
        }
    )  # fmt: skip


def with_sensor(**keys):
    at = {"z": "0 mm", "radius": "40 mm"}
    page = read_definition(find_machine("motor_spindle"))
    sensor = {"name": "S1", "at": at, "direction": "axial", **keys}
    return examine({**page, "displacement_sensor": [sensor]}).spec


@pytest.mark.parametrize("name", DUCTS)
def test_ducts_are_drawn_where_they_are(name):
    keys, places = DUCTS[name]
    found = list(drawn_equipment._sections(circuit(**keys), 1.0))
    assert np.allclose(found, places)


def test_a_helix_is_half_a_pitch_further_on_the_other_side():
    film = circuit(duct="helical_groove", width="10 mm", depth="4 mm", turns=4.0)
    above, below = (list(drawn_equipment._sections(film, sign)) for sign in (1.0, -1.0))
    shift = np.array([a[0][0] - b[0][0] for a, b in zip(above, below, strict=True)])
    assert np.allclose(shift, 0.5 * 0.2 / 4.0)


def test_sources_are_hatched_and_told_and_sensors_drawn_with_their_mount():
    spec = with_sensor()
    figure = machine_drawing(spec)
    axes, head = figure.axes[0], figure.axes[-1]
    hatched = [patch for patch in axes.patches if isinstance(patch, Rectangle) and patch.get_hatch()]
    assert len(hatched) == 2 * len(spec.source)
    texts = [item.get_text() for item in head.texts]
    assert "700 W into stator: stator losses" in texts
    assert "S1" in texts
    squares = [line for line in axes.lines if line.get_marker() == "s"]
    # behind the flange, which ends at 60 mm and is 280 mm wide
    assert [(*line.get_xdata(), *line.get_ydata()) for line in squares] == [(60.0, 140.0)]


def test_a_sensor_on_a_frame_stands_beside_the_flange():
    spec = with_sensor(mount="frame")
    axes = Figure().subplots()
    drawn_equipment.draw_sensors(axes, spec, build_assembly(spec))
    (square,) = axes.lines
    assert square.get_markerfacecolor() == "none"
    # in the plane behind the flange, outside its 280 mm
    assert (*square.get_xdata(), *square.get_ydata()) == pytest.approx((60.0, 142.8))
    (arrow,) = axes.texts
    assert arrow.xy == (0.0, 40.0)


def test_faces_behind_a_section_cover_its_cracks():
    points = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    shape = TriangleSet(points, np.array([[0, 1, 2]]), np.array([[1.0], [2.0], [3.0]]), np.zeros(1, np.int32))
    found = behind(shape, 1.0e-3)
    assert np.allclose(np.linalg.norm(found.points[:, 1:] - points[:, 1:], axis=1), 1.0e-3)
    assert np.allclose(found.points[:, 0], 1.0e-3)
    assert np.array_equal(found.values, shape.values)
