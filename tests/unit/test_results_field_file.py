"""fields.vtu: exact fluxes, names and cells as other programs read them."""

from __future__ import annotations

import meshio
import numpy as np
import pytest
import pyvista as pv

from spindle_fem.machine.meshing.simple_bodies import build_box, build_joined_tubes, build_tube
from spindle_fem.results.field_file import heat_flux, write_tagged_vtu
from spindle_fem.results.field_series import FieldSeries
from tests.support.made_result import make_result

RADII = (0.04, 0.07)


def test_flux_of_a_quadratic_field_is_exact_on_straight_elements():
    box = build_box((0.3, 0.2, 0.1), (2, 2, 2))
    x, y, z = box.points.T
    flux = heat_flux(box, 280.0 + 3.0 * x**2 - 2.0 * x * y + 5.0 * z, dict.fromkeys(box.part_names, 42.0))
    expected = -42.0 * np.column_stack([6.0 * x - 2.0 * y, -2.0 * x, np.full_like(z, 5.0)])
    assert np.allclose(flux, expected, atol=1.0e-9)


def test_flux_through_a_tube_converges_to_the_logarithmic_profile():
    errors = []
    for number in (2, 4):
        tube = build_tube(RADII, 0.02, (number, 10 * number, 1))
        radius = np.hypot(tube.points[:, 0], tube.points[:, 1])
        flux = heat_flux(tube, 300.0 - 20.0 * np.log(radius / RADII[0]), dict.fromkeys(tube.part_names, 50.0))
        outward = tube.points[:, :2] / radius[:, None]
        along = (flux[:, :2] * outward).sum(axis=1)
        errors.append(np.abs(along * radius / (50.0 * 20.0) - 1.0).max())
    assert errors[0] < 0.05
    assert errors[1] < 0.4 * errors[0]


def test_flux_does_not_mix_parts_across_a_joint():
    pair = build_joined_tubes((0.03, 0.05, 0.08), 0.05, ((2, 2), 12, 2), parts=("shaft", "ring"))
    flux = heat_flux(pair, pair.points[:, 2], {"shaft": 1.0, "ring": 10.0})
    ring = np.unique(pair.tetrahedra[pair.part_of_element == pair.part_names.index("ring")])
    shaft = np.setdiff1d(np.arange(len(pair.points)), ring)
    assert np.allclose(flux[shaft, 2], -1.0, atol=1.0e-9)
    assert np.allclose(flux[ring, 2], -10.0, atol=1.0e-9)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    mesh = build_joined_tubes((0.03, 0.05, 0.08), 0.05, ((2, 2), 12, 2), parts=("shaft", "ring"))
    path = tmp_path_factory.mktemp("fields") / "fields.vtu"
    n_faces = sum(len(facets) for facets in mesh.surfaces.values())
    film = np.full(mesh.n_elements + n_faces, np.nan, dtype=np.float32)
    film[mesh.n_elements :] = 12.0
    write_tagged_vtu(
        mesh,
        path,
        point_data={"temperature_degC": mesh.points[:, 2], "heat_flux_W_m2": mesh.points},
        cell_data={"film_coefficient_W_m2K": film},
    )
    return mesh, path


def test_meshio_reads_points_elements_and_names(written):
    mesh, path = written
    read = meshio.read(path)
    assert np.array_equal(read.points, mesh.points)
    blocks = {block.type: block.data for block in read.cells}
    assert np.array_equal(blocks["tetra10"], mesh.tetrahedra)
    assert len(blocks["triangle6"]) == sum(len(facets) for facets in mesh.surfaces.values())
    for number, name in enumerate(mesh.part_names):
        assert read.field_data[f"part.{name}"] == number
    for number, name in enumerate(mesh.surfaces):
        assert read.field_data[f"surface.{name}"] == number
    assert np.allclose(read.point_data["temperature_degC"], mesh.points[:, 2])
    assert read.point_data["heat_flux_W_m2"].shape == (len(mesh.points), 3)


@pytest.mark.render
def test_vtk_finds_the_volume_of_each_part_by_name(written):
    import pyvista as pv

    mesh, path = written
    grid = pv.read(path)
    for name in mesh.part_names:
        number = int(grid.field_data[f"part.{name}"][0])
        chosen = (grid.cell_data["part_id"] == number) & (grid.cell_data["surface_id"] == -1)
        sizes = grid.extract_cells(np.flatnonzero(chosen)).compute_cell_sizes()
        assert sizes.cell_data["Volume"].sum() == pytest.approx(mesh.cad_volume[name], rel=2.0e-2)


@pytest.mark.render
def test_vtk_finds_faces_of_a_surface_with_their_film(written):
    import pyvista as pv

    mesh, path = written
    grid = pv.read(path)
    name = "ring.outer"
    chosen = grid.cell_data["surface_id"] == int(grid.field_data[f"surface.{name}"][0])
    assert chosen.sum() == len(mesh.surfaces[name])
    assert np.all(grid.cell_data["film_coefficient_W_m2K"][chosen] == 12.0)
    assert np.all(np.isnan(grid.cell_data["film_coefficient_W_m2K"][: mesh.n_elements]))


def test_vtk_reads_a_series_of_fields(tmp_path):
    from vtkmodules.vtkIOHDF import vtkHDFReader

    result = make_result()
    file = tmp_path / "fields.vtkhdf"
    with FieldSeries(file, result.mesh) as series:
        for time in (0.0, 60.0, 60.0, 300.0):
            series.add(time, result.temperature + time / 60.0)
    reader = vtkHDFReader()
    reader.SetFileName(str(file))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 3
    for time in (300.0, 60.0):
        reader.UpdateTimeStep(time)
        grid = pv.wrap(reader.GetOutput())
        expected = result.temperature + time / 60.0 - 273.15
        assert grid["temperature_degC"] == pytest.approx(expected, abs=1e-4)
    assert grid.cell_data["part"].tolist() == result.mesh.part_of_element.tolist()
    assert grid.compute_cell_sizes()["Volume"].min() > 0.0
