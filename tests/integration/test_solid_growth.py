"""Growth of a whole machine in three dimensions, beside that of the meridian plane."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.report.growth_chart import deformed_section
from spindle_fem.report.profiles import displacement_section
from spindle_fem.results.run_summary import build_summary
from spindle_fem.studies.solve_machine import solve
from tests.support.valid_definition import VALID


def grown(folder, definition, *overrides):
    path = folder / "machine.toml"
    path.write_text(definition)
    return solve(load_machine(path, ["mesh.preset=coarse", *overrides])).with_solid_growth()


def seats_agree(plane, solid):
    for place, state in plane.seats.items():
        assert solid.raceways[place] == pytest.approx(state.raceway_growth, rel=0.03)
        # of seats beside the channel the meridian plane smears the helix
        assert solid.seats[place] == pytest.approx(state.seat_growth, rel=0.05)


def test_a_machine_without_a_flange_has_no_nose_but_seats_and_raceways(tmp_path):
    found = grown(tmp_path, VALID, "mesh.order=1")
    seats_agree(found.growth, found.solid_growth)
    assert found.growth.nose_axial is found.solid_growth.nose_axial is None
    assert found.solid_growth.displacement.shape == found.mesh.points.shape


SENSOR = """
[[displacement_sensor]]
name = "%s"
at = {z = "%s mm", radius = "%s mm", angle = "%s deg"}
direction = "%s"
mount = %s
"""


def with_sensors():
    """The reference spindle with sensors on the flange and on spots of the housing."""
    text = 'schema = "spindle-fem/machine/1"\nbase = "wu_tan_2016"\nname = "seen"\n'
    text += SENSOR % ("front", 0, 60, 0, "axial", '"flange"')
    text += SENSOR % ("across", 10, 90, 90, "radial", '{z = "25 mm", radius = "150 mm"}')
    text += SENSOR % ("below", 0, 60, 180, "axial", '{z = "300 mm", radius = "150 mm"}')
    return text


@pytest.mark.slow
def test_the_nose_moves_as_in_the_meridian_plane_and_the_flange_stays(tmp_path):
    found = grown(tmp_path, with_sensors())
    plane, solid = found.growth, found.solid_growth
    seats_agree(plane, solid)
    assert solid.nose_axial == pytest.approx(plane.nose_axial, rel=0.02)
    assert solid.nose_tilt == pytest.approx(plane.nose_tilt, rel=0.05)
    moved = solid.displacement
    back = np.unique(found.mesh.surfaces["housing.flange_back"])
    assert np.linalg.norm(moved[back].mean(axis=0)) < 0.1 * np.linalg.norm(moved, axis=1).max()
    told = build_summary(found, 0.0, 0.0)["growth"]
    assert told["three_dimensional"]["nose_axial_um"] == pytest.approx(told["nose_axial_um"], rel=0.02)
    assert set(told["three_dimensional"]["raceways"]) == set(told["raceways"])
    assert len(found.displacements) == 3
    assert solid.displacements == pytest.approx(found.displacements, rel=0.01)
    assert deformed_section(displacement_section(found), "the flange") is not None
