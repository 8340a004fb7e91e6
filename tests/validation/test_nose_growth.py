"""Elasticity of the concealed machines' nose: exact bodies, and the elastic bodies of the product."""

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.meshing.build_mesh import build_mesh
from spindle_fem.model.elastic.machine_growth import GrowthModel
from validation import machine as m
from validation.nose_growth import ACROSS, Body, growth_by_cell


def test_an_even_rise_stretches_freely():
    whole = growth_by_cell(m.build_grid(8))
    assert whole["nose"].sum() == pytest.approx(12.5e-6 * 0.125 - 10.5e-6 * 0.060, rel=1e-9)


def test_a_long_tube_stretches_by_the_mean_of_its_section():
    """Timoshenko & Goodier (1970), article 152: far from the ends the axial strain is that of the mean."""
    r, z = np.linspace(0.03, 0.07, 13), np.linspace(0.0, 1.0, 41)
    tube = Body(r, z, np.ones((12, 40), dtype=bool), 0.3, 12e-6)
    middle = 0.5 * (r[1:] + r[:-1])
    rise = np.repeat(100.0 * (middle[:, None] / 0.07) ** 2, 40, axis=1)
    mean = rise[:, 0] @ np.diff(r**2) / (0.07**2 - 0.03**2)
    apart = tube.mean_on_cylinder(0.07, 0.6, 0.625) - tube.mean_on_cylinder(0.07, 0.4, 0.425)
    assert (tube.by_cell(apart)[0] * rise).sum() == pytest.approx(12e-6 * mean * 0.2, rel=1e-5)


def test_a_disc_with_a_gradient_through_its_thickness_becomes_a_sphere():
    """Free of stress under T = g z: u_z = α g (z² − r²) / 2; n layers bend by 1 − 1/n² of that."""
    r, z = np.linspace(0.02, 0.10, 9), np.linspace(-0.005, 0.005, 21)
    disc = Body(r, z, np.ones((8, 20), dtype=bool), 0.3, 12e-6)
    rise = np.broadcast_to(1000.0 * 0.5 * (z[1:] + z[:-1]), (8, 20))
    apart = disc.at_spot(0.0, 0.10) - disc.at_spot(0.0, 0.02)
    expected = -12e-6 * 1000.0 * 0.5 * (0.10**2 - 0.02**2) * (1.0 - 1.0 / 20**2)
    assert (disc.by_cell(apart)[0] * rise).sum() == pytest.approx(expected, rel=1e-5)


def warm_bearings(r, z):
    """Rise by 12 K at the front bearings, less outwards and with the distance from them."""
    return 12.0 * np.exp(-(((z - 0.09) / 0.05) ** 2)) * np.exp(-np.abs(r - 0.08) / 0.04)


def test_the_bore_of_a_long_tube_grows_by_the_mean_of_its_section():
    """Timoshenko & Goodier (1970), article 151: u(a) = 2 α a / (b² - a²) ∫ T r dr."""
    r, z = np.linspace(0.03, 0.07, 13), np.linspace(0.0, 1.0, 41)
    tube = Body(r, z, np.ones((12, 40), dtype=bool), 0.3, 12e-6)
    rise = np.repeat(100.0 * (0.5 * (r[1:] + r[:-1])[:, None] / 0.07) ** 2, 40, axis=1)
    mean = rise[:, 0] @ np.diff(r**2) / (0.07**2 - 0.03**2)
    bore = tube.mean_on_cylinder(0.03, 0.4, 0.6, axis=ACROSS)
    assert (tube.by_cell(bore)[0] * rise).sum() == pytest.approx(12e-6 * mean * 0.03, rel=1e-5)


def cold_outside(r, z):
    """Rise from 0 K outside to 10 K at the seats, and more towards the drive end."""
    return 10.0 * (0.15 - r) / 0.055 + 40.0 * z


@pytest.mark.slow
def test_the_elastic_bodies_of_the_product_move_nose_and_seats_as_far(tmp_path):
    """Other elements, another channel, another mesh: 5.2 µm, where the means of sections would give 3.6."""
    text = 'schema = "spindle-fem/machine/1"\nbase = "recorded_spindle"\nname = "seen"\n'
    look = '[[displacement_sensor]]\nname = "S1"\nat = {z = "0 mm", radius = "60 mm", angle = "0 deg"}\n'
    (tmp_path / "seen.toml").write_text(text + look + 'direction = "axial"\nmount = "flange"\n')
    spec = load_machine(tmp_path / "seen.toml", ["mesh.preset=coarse"])
    mesh = build_mesh(build_assembly(spec), preset="coarse")
    growth = GrowthModel(spec, mesh, 2)
    warm = warm_bearings(np.hypot(*mesh.points[:, :2].T), mesh.points[:, 2])
    told = growth.displacements(growth.assembly_temperature + warm, 0.0)["S1"]
    grid = m.build_grid(32)
    r, z = (0.5 * (lines[1:] + lines[:-1]) for lines in (grid.r, grid.z))
    rise = warm_bearings(r[:, None], z)
    cells = growth_by_cell(grid)
    assert told == pytest.approx((cells["nose"] * rise).sum(), rel=5e-3)
    warm = cold_outside(np.hypot(*mesh.points[:, :2].T), mesh.points[:, 2])
    for name, rows in zip(growth.bearings, growth.seat_rows[1::2], strict=True):
        beside = (cells[name] * cold_outside(r[:, None], z)).sum()
        assert rows @ warm / rows.sum() == pytest.approx(beside, rel=0.015), name
