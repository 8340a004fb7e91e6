"""The interactive page of a result folder: what it carries, and folders that it refuses."""

from __future__ import annotations

import json
import re

import numpy as np
import pandas as pd
import pytest

from spindle_fem.commands.simulate_command import simulate_machine
from spindle_fem.commands.view_command import view_folder
from spindle_fem.definition.drawn_tables import element_rows
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import BadInputError
from spindle_fem.model.elastic.deformed_shape import BodyShape
from spindle_fem.report.machine_scene import Solid, bearing_balls, probes_of, solid_scene, spread_out
from spindle_fem.report.scenes import ball_triangles
from spindle_fem.report.viewed_scene import Layer, Scene, Sphere
from spindle_fem.results.field_series import FieldSeries, read_series
from spindle_fem.results.growth_file import growth_dataset, shift_of_points
from tests.support.command_line import run_here
from tests.support.made_result import make_result
from tests.support.unpacked_view import unpacked
from tests.support.written_texts import network_text

NETWORK = network_text(
    "two bodies",
    {"bearing": ("400 J/K", 0.3), "housing": ("3 kJ/K", 0.3)},
    {"bearing|housing": ("8 W/K", 0.3), "housing|ambient": ("4 W/K", 0.3)},
    [("bearing", "speed", ("80 W", 0.3), {"reference": "1000 rpm", "exponent": 1.5})],
)
HOSTILE = "</script><script>alert(1)</script>"


@pytest.fixture(scope="module")
def result():
    return make_result()


def restored(payload, number=0):
    """Values of a layer at every time, as the page works them out."""
    layer, columns = payload["layers"][number], unpacked(payload)
    steps = columns[f"layer{number}"].reshape(layer["times"], -1)
    total = np.cumsum(steps, axis=0, dtype=np.uint16)
    return layer["low"] + total / 65535.0 * (layer["high"] - layer["low"])


# ------------------------------------------------------------------ what a page carries
def test_fields_over_time_come_back_from_their_differences(result):
    solid = Solid.of(result.mesh)
    first = result.temperature - 273.15
    fields = np.stack([first, first - 7.0, first + 30.0 * solid.points[:, 2]])
    scene = solid_scene(solid, {"temperature": fields}, np.array([0.0, 60.0, 120.0]))
    payload = scene.payload()
    used = np.isin(np.arange(len(first)), solid.tetrahedra[:, :4])
    assert np.allclose(restored(payload), scene.layers[0].values, atol=2.0e-3)
    assert payload["times"] == [0.0, 60.0, 120.0]
    assert scene.layers[0].values.shape[1] >= used.sum()


def test_the_tetrahedra_of_a_cut_fill_the_parts(result):
    solid = Solid.of(result.mesh)
    payload = solid_scene(solid, {"temperature": result.temperature[None]}).payload()
    columns = unpacked(payload)
    points = columns["points"].reshape(3, -1).T / 65535.0 * payload["span"] + payload["low"]
    corners = points[np.cumsum(columns["tetrahedra"]).reshape(-1, 4)]
    edges = corners[:, 1:] - corners[:, :1]
    volume = np.abs(np.linalg.det(edges)) / 6.0
    for entry, name in zip(payload["parts"], result.mesh.part_names, strict=True):
        first, number = entry["tetrahedra"]
        # straight edges cut the corners off the round parts
        assert volume[first : first + number].sum() == pytest.approx(result.mesh.cad_volume[name], rel=0.06)


def test_the_surface_is_closed_part_by_part(result):
    payload = solid_scene(Solid.of(result.mesh), {"temperature": result.temperature[None]}).payload()
    columns = unpacked(payload)
    vertex = np.cumsum(columns["vertex"])
    triangles = vertex[np.cumsum(columns["triangles"])].reshape(-1, 3)
    for entry in payload["parts"]:
        first, number = entry["triangles"]
        own = np.sort(triangles[first : first + number][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        _, met = np.unique(own, axis=0, return_counts=True)
        assert np.all(met == 2)


def test_layers_of_one_kind_share_a_scale_and_differences_have_zero_in_the_middle():
    none = np.zeros((1, 0))
    spheres = (
        Sphere(np.zeros(3), 1.0, {"a": np.array([20.0]), "b": np.array([30.0]), "c": np.array([-0.5])}, "p"),
        Sphere(np.ones(3), 1.0, {"a": np.array([25.0]), "b": np.array([np.nan]), "c": np.array([0.2])}, "q"),
    )
    layers = (Layer("a", "°C", none), Layer("b", "°C", none), Layer("c", "K", none, difference=True))
    payload = Scene(np.eye(3), layers, places=spheres).payload()
    assert [(item["low"], item["high"]) for item in payload["layers"]] == [(20.0, 30.0)] * 2 + [(-0.5, 0.5)]
    assert payload["places"][1]["values"] == [[25.0], [None], [0.2]]
    json.dumps(payload, allow_nan=False)


def test_growth_reaches_every_point_of_a_body(result):
    solid = Solid.of(result.mesh)
    z, r = np.meshgrid(np.linspace(-0.01, 0.11, 13), np.linspace(0.0, 0.2, 21))
    place = np.column_stack([z.ravel(), r.ravel()])
    shift = np.column_stack([1.0e-6 + 1.0e-4 * place[:, 0], 2.0e-4 * place[:, 1]])
    name = solid.part_names[0]
    shapes = {name: BodyShape(place, np.zeros((0, 4), int), np.zeros((0, 2), int), shift)}
    found = shift_of_points(growth_dataset(shapes), solid.points, solid.part_of_point, solid.part_names)
    own = solid.part_of_point == 0
    expected = np.column_stack([2.0e-4 * solid.points[:, :2], 1.0e-6 + 1.0e-4 * solid.points[:, 2]])
    assert np.allclose(found[own], expected[own], atol=1.0e-9)
    # another part moves with the nearest place of a body
    assert np.allclose(found[~own], expected[~own], atol=2.0e-6)


def test_fields_over_time_are_read_from_their_file(result, tmp_path):
    path = tmp_path / "fields.vtkhdf"
    with FieldSeries(path, result.mesh) as series:
        series.add(0.0, result.temperature)
        series.add(60.0, result.temperature + 1.0)
    arrays, names = read_series(path)
    assert names == result.mesh.part_names
    assert np.array_equal(arrays["tetrahedra"], result.mesh.tetrahedra)
    assert np.allclose(arrays["temperature"][1], result.temperature - 272.15, atol=1.0e-4)
    path.write_bytes(b"no such thing")
    with pytest.raises(BadInputError):
        read_series(path)


def test_balls_and_probes_stand_where_the_definition_has_them(result):
    scene = solid_scene(Solid.of(result.mesh), {"temperature": result.temperature[None]})
    balls = bearing_balls(result.spec, {"F1": {"temperature": np.array([50.0])}})
    assert len(balls) == 3 * 30 + 2 * 27
    assert np.hypot(*balls[0].place[:2]) == pytest.approx(0.0825)
    probe = next(item for item in result.spec.probe if item.kind == "point")
    (shown,) = probes_of(result.spec, scene, {probe.name: {"temperature": np.array([30.0])}})
    assert np.hypot(*shown.place[:2]) == pytest.approx(probe.r)


def test_rollers_are_cylinders():
    spec = load_machine("belt_lathe")
    assert spec.rolling_elements == "balls and rollers"
    (group, bearing), *_ = spec.bearings
    rows = element_rows(bearing, spec.bearing_types[group.bearing_type])
    shown = bearing_balls(spec, {})
    assert {item.length for item in shown} >= {0.0, rows[0].length}
    values = {bearing.name: 30.0 for _, bearing in spec.bearings}
    shape = ball_triangles(spec, values)
    corners = shape.points[shape.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.all(np.einsum("ij,ij->i", across, shape.normals[shape.triangles].mean(axis=1)) > 0.0)
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    row = rows[0]
    wanted = len(rows) * row.ball_count * 0.25 * np.pi * row.ball_diameter**2 * row.length
    assert volumes[shape.label == 0].sum() == pytest.approx(wanted, rel=5e-3)
    half = ball_triangles(spec, values, lambda centres: centres[:, 0] > 0.0)
    assert 0.4 < len(half.triangles) / len(shape.triangles) < 0.6


def test_a_chain_of_nodes_is_drawn_as_long_as_it_is():
    places = spread_out(4, [(0, 1), (1, 2), (2, 3)])
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert np.allclose(apart, np.abs(np.subtract.outer(np.arange(4), np.arange(4))), atol=0.05)
    assert np.ptp(places[:, 0]) > 5.0 * np.ptp(places[:, 1])


# ------------------------------------------------------------------ folders
@pytest.fixture(scope="module")
def simulated(recorded_in, tmp_path_factory):
    folder = tmp_path_factory.mktemp("viewed")
    times = np.arange(0.0, 3000.0, 20.0)
    rise = 30.0 * (1.0 - np.exp(-times / 900.0))
    frame = pd.DataFrame(
        {"time": times, "T_b": 22.0 + rise, "T_h": 22.0 + 0.4 * rise, "room": 22.0, "rpm": 1000.0}
    )
    recording = recorded_in(
        folder / "recording",
        frame,
        {"T_b": "bearing", "T_h": "housing"},
        {"room": "ambient", "rpm": "speed"},
    )
    manifest = recording / "recording.toml"
    manifest.write_text(manifest.read_text().replace('"made"', json.dumps(HOSTILE)), encoding="utf-8")
    (folder / "machine.toml").write_text(NETWORK, encoding="utf-8")
    simulate_machine(folder / "machine.toml", recording, folder / "out")
    return folder / "out"


def test_a_simulated_network_becomes_nodes_with_histories(simulated):
    page = view_folder(simulated).read_text(encoding="utf-8")
    data = json.loads(re.search(r'id="view3d-data">(.*?)</script>', page, re.DOTALL)[1])
    assert [item["name"] for item in data["places"]] == ["bearing", "housing", "ambient"]
    assert [item["name"] for item in data["layers"]] == ["read", "model", "read less model"]
    assert len(data["links"]) == 2
    ambient = data["places"][2]["values"]
    assert ambient[0] == pytest.approx([22.0] * len(data["times"]))
    read, model = data["histories"]["bearing"]
    assert (read["name"], model["name"]) == ("read", "model")
    assert read["values"][-1] == pytest.approx(
        22.0 + 30.0 * (1.0 - np.exp(-read["times"][-1] / 900.0)), abs=0.01
    )


def test_names_do_not_leave_their_place_in_the_page(simulated):
    page = view_folder(simulated).read_text(encoding="utf-8")
    assert HOSTILE not in page
    assert "&lt;/script&gt;" in page
    assert not re.search(r'(?:src|href)="(?!#|data:)', page), "the page asks for another file"


def test_other_folders_are_refused_with_a_reason(tmp_path, simulated):
    (tmp_path / "empty").mkdir()
    (tmp_path / "half").mkdir()
    (tmp_path / "half" / "INCOMPLETE").write_text("This folder is being written.\n")
    for name, reason in (
        ("none", "no such folder"),
        ("empty", "nothing that a view"),
        ("half", "incomplete"),
    ):
        answer = run_here("view", tmp_path / name)
        assert (answer.returncode, answer.stdout) == (2, "")
        assert reason in answer.stderr
    answer = run_here("view", simulated, "--design", "3")
    assert answer.returncode == 2
    assert "sweep" in answer.stderr


def test_a_folder_without_its_data_says_what_to_do(simulated, tmp_path):
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "simulation.json").write_bytes((simulated / "simulation.json").read_bytes())
    with pytest.raises(BadInputError, match="Run spindle-fem simulate again"):
        view_folder(tmp_path / "old")
    assert not (tmp_path / "old" / "view.html").exists()
