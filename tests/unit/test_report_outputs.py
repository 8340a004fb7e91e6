"""Files of a run: complete or marked, self-contained, and the report rebuilt from the others."""

from __future__ import annotations

import dataclasses
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
import xarray as xr

from spindle_fem.definition.load import load_machine, validate
from spindle_fem.errors import BadInputError
from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.report import block_page as document
from spindle_fem.report import run_tables as tables
from spindle_fem.report.figure_style import new_figure
from spindle_fem.report.interactive_view import SURFACE_GROUP, display_surface, viewer_payload
from spindle_fem.report.run_outputs import OutputHelpers, write_outputs
from spindle_fem.report.run_report import in_order, rebuild_report, render_run_report
from spindle_fem.results.dataset import build_dataset, default_paths, read_dataset, spec_digest, write_dataset
from spindle_fem.results.output_folder import MARKER, is_complete, output_folder, require_complete
from spindle_fem.results.run_summary import build_summary
from spindle_fem.results.thermal_result import (
    BearingResult,
    Check,
    CoolantResult,
    EnergyBalance,
    ThermalResult,
)
from spindle_fem.validity import CodedWarning

PARTS = ("shaft", "F1.inner_ring", "F1.outer_ring", "housing")
WALL = "housing.channel_wall"


def make_result(machine: str = "wu_tan_2016", **changes) -> ThermalResult:
    """Tubes in contact under the names of a shipped machine, with made-up temperatures."""
    spec = load_machine(machine)
    mesh = build_joined_tubes(
        (0.03, 0.07, 0.079, 0.095, 0.15),
        0.1,
        ((2, 1, 1, 2), 12, 3),
        parts=PARTS,
        rotating=(True, True, False, False),
    )
    surfaces = {WALL if name == "housing.outer" else name: facets for name, facets in mesh.surfaces.items()}
    owners = {name: name.rsplit(".", 1)[0] for name in surfaces}
    areas = {WALL if name == "housing.outer" else name: area for name, area in mesh.cad_area.items()}
    mesh = dataclasses.replace(mesh, surfaces=surfaces, part_of_surface=owners, cad_area=areas)
    temperature = 300.0 + 100.0 * mesh.points[:, 2] - 50.0 * np.hypot(mesh.points[:, 0], mesh.points[:, 1])
    number = len(surfaces[WALL])
    along = np.linspace(0.1, 3.5, 12)
    bearings = {
        bearing.name: BearingResult(
            heat=100.0,
            terms={"rolling": 80.0, "sliding": 20.0, "seal": 0.0},
            heat_to={"inner": 25.0, "outer": 25.0, "balls": 50.0},
            temperature_inner=310.0,
            temperature_outer=301.0,
            temperature_ball=315.0,
            contact_angle_inner=0.3,
            contact_angle_outer=float("nan"),
            preload=1100.0,
            film_thickness=4.0e-7,
            film_thickness_ratio=5.5,
        )
        for _, bearing in spec.bearings
    }
    coolant = None
    if spec.coolant is not None:
        coolant = CoolantResult(
            **{"flow": 3.3e-4, "inlet_temperature": 288.15, "outlet_temperature": 289.0, "heat": 400.0},
            **{
                "reynolds": 292.0,
                "prandtl": 1200.0,
                "velocity": 2.8,
                "regime": "laminar",
                "source": "a source",
                "in_range": False,
            },
            **{"pressure_drop": 4.2e5, "pumping_power": 140.0, "hydraulic_diameter": 0.0109, "length": 3.55},
            **{"wetted_area": 0.156, "position": along, "angle": along * 8.8},
            **{"bulk_temperature": 288.15 + 0.2 * along, "wall_temperature": 297.0 + 0.0 * along},
            **{"film_coefficient": 260.0 + along, "film_low": 200.0 + along, "film_high": 400.0 + along},
            **{"mean_film_coefficient": 262.0, "mean_film_low": 202.0, "mean_film_high": 402.0},
        )
    total = 100.0 * len(bearings)
    values = {
        "spec": spec,
        "mesh": mesh,
        "order": 2,
        "n_unknowns": len(mesh.points),
        "temperature": temperature,
        "air_temperature": {},
        "film_coefficient": {WALL: np.full(number, 262.0)},
        "fluid_temperature": {WALL: np.full(number, 288.5)},
        "bearings": bearings,
        "coolant": coolant,
        "probes": {"SP01": 299.15},
        "energy": EnergyBalance(total, {f"{name}.balls": 100.0 for name in bearings}, {WALL: total}),
        "heat_flows": {"F1.inner_ring|shaft": -12.5},
        "area_error_relative": {WALL: 1.0e-5},
        "volume_error_relative": dict.fromkeys(PARTS, 2.0e-5),
        "temperature_minimum": float(temperature.min()),
        "temperature_maximum": float(temperature.max()),
        "temperature_maximum_at": mesh.points[temperature.argmax()],
        "checks": (Check("energy balance", 1.0e-12, 1.0e-8, "", True, "heat in equals heat out"),),
        "warnings": (CodedWarning("coolant_film_extrapolated", "Pr is <1200> & allowed 657."),),
        "iterations": {"coupling": 5},
        "timings": {"solve": 1.0},
    }
    return ThermalResult(**{**values, **changes})


@pytest.fixture(scope="module")
def result():
    return make_result()


@pytest.fixture(scope="module")
def html(result):
    return render(result)


def render(result: ThermalResult) -> str:

    summary = json.loads(json.dumps(build_summary(result, 1.0, 100.0)))
    return render_run_report(summary, build_dataset(result), display_surface(result), in_order({}))


class Page(HTMLParser):
    """Tags, identifiers and links of a page; fails where tags do not close."""

    VOID = frozenset({"meta", "img", "input", "br", "hr", "link"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.ids += [found["id"]] if "id" in found else []
        self.links += [found[key] for key in ("src", "href") if key in found]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


# ------------------------------------------------------------------ the report
def test_report_is_a_sound_page_that_needs_nothing_else(html):
    page = Page(html)
    assert len(page.ids) == len(set(page.ids))
    anchors = [link[1:] for link in page.links if link.startswith("#")]
    assert anchors
    assert set(anchors) <= set(page.ids)
    assert all(link.startswith(("#", "data:")) for link in page.links)
    assert not re.search(r"@import|url\(\s*['\"]?(?!data:)", html)


@pytest.mark.parametrize(
    "text",
    [
        "3000 rpm, thrust 1750 N, ambient 17.6 °C, coolant 20 L/min at 15 °C",
        "41.9 °C",  # warmest balls
        "9.0 K",  # ring difference
        "4.2 bar",
        "outside the range of its source",
        "coolant, channel wall",
        "F1.inner ring | shaft",
        "−12.50",
        "42CrMo4",
        "10000 W/(m²·K) ± 30 %",
        "Limits of validity",
        "definition (SHA-256)",
    ],
)
def test_report_says(html, text):
    assert text in html


def test_warnings_are_prominent_and_escaped(html):
    assert "Pr is &lt;1200&gt; &amp; allowed 657." in html
    assert html.index("Pr is &lt;1200") < html.index('id="answers"')


def test_missing_values_are_dashes(html):
    row = re.search(r'<tr><th scope="row">F1</th>(.*?)</tr>', html, re.DOTALL).group(1)
    assert re.findall(r">([^<]*)</td>", row)[6] == "–"
    assert not re.search(r"\b(nan|None)\b", re.sub(r"<(script|style).*?</\1>", "", html, flags=re.DOTALL))


def test_a_failed_check_is_told_before_the_numbers():
    failed = Check("residual", 1.0, 1.0e-8, "", False, "")
    text = render(make_result(checks=(failed,)))
    assert "Failed: residual." in text
    assert text.index("Failed: residual.") < text.index('class="cards"')
    assert "All 1 checks" not in text


def test_a_machine_without_channel_has_no_coolant_section():
    text = render(make_result("uncooled", film_coefficient={}, fluid_temperature={}))
    assert 'id="coolant"' not in text
    assert 'href="#coolant"' not in text


def test_reports_of_other_commands_are_put_together_from_blocks():
    table = document.Table(
        (tables.column("channel"), tables.column("passed", verdict=True)),
        tables.rows_of([["SP01", True], ["SP<02>", False]]),
        caption="All channels",
        folded="Details",
    )
    blocks = [
        document.Text("a < b"),
        document.Bullets(["first", "second"]),
        document.Notice("Ambiguous.", "bad"),
        document.Cards([{"value": "0.12 K", "name": "residual"}]),
        document.Warnings([CodedWarning("gap", "Data end early.")]),
        table,
        document.illustration_of(new_figure(120, 200), "Residuals"),
    ]
    text = document.render_document(
        "Diagnosis", "Recording 1", [document.Section("fit", "Fit", blocks)], subtitle="From Monday."
    )
    page = Page(text)
    assert {"fit", "content"} <= set(page.ids)
    assert all(link.startswith(("#", "data:")) for link in page.links)
    for expected in (
        "a &lt; b",
        "SP&lt;02&gt;",
        "Ambiguous.",
        "0.12 K",
        "Data end early.",
        "Residuals",
        "From Monday.",
    ):
        assert expected in text
    assert text.count('class="passed"') == text.count('class="failed"') == 1
    assert 'width="200" height="120"' in text


# ------------------------------------------------------------------ the viewer
def test_viewer_data_restore_the_surface(result):
    import base64
    import zlib

    surface = display_surface(result)
    payload = viewer_payload(surface)
    block = zlib.decompress(base64.b64decode(payload["block"]))
    n, m = payload["vertices"], payload["triangles"]
    assert len(block) == 6 * n + 3 * n + 2 * n + 12 * m
    place = np.frombuffer(block, "<u2", 3 * n).reshape(3, n).T / 65535.0 * payload["span"] + payload["low"]
    assert np.allclose(place, surface["position"].values, atol=payload["span"] / 65535.0)
    index = np.cumsum(np.frombuffer(block[11 * n :], "<i4"))
    assert (index.min(), index.max()) == (0, n - 1)
    shown = sum(part["count"] + part["cap_count"] for part in payload["parts"])
    assert shown == m
    kelvin = np.frombuffer(block[9 * n : 11 * n], "<u2") / 65535.0 * (payload["warmest"] - payload["coldest"])
    assert np.allclose(kelvin + payload["coldest"], surface["temperature"].values, atol=1.0e-3)


def test_viewer_balls_follow_the_definition(result):
    balls = np.array(viewer_payload(display_surface(result))["balls"])
    assert len(balls) == 3 * 30 + 2 * 27
    assert np.allclose(np.hypot(balls[:90, 0], balls[:90, 1]), 0.0825, atol=1.0e-5)
    assert np.allclose(balls[:, 4], 41.85, atol=1.0e-2)


def test_a_large_surface_is_thinned_to_its_budget(result):
    full, thin = display_surface(result), display_surface(result, triangle_budget=300)
    on_surface = int((thin["triangle_is_section"] == 0).sum())
    assert 50 < on_surface <= 300 < int((full["triangle_is_section"] == 0).sum())
    assert int(thin["triangle"].max()) < thin.sizes["vertex"]


# ------------------------------------------------------------------ result.nc
def test_dataset_has_units_names_and_provenance(result, tmp_path):
    dataset = build_dataset(result, sources=("Somebody (1999)",))
    path = write_dataset(dataset, tmp_path / "result.nc")
    read = read_dataset(path)
    xr.testing.assert_identical(read, dataset)
    for name, variable in read.data_vars.items():
        assert {"units", "long_name"} <= set(variable.attrs), name
    assert "Somebody (1999)" in read.attrs["sources"]
    assert read.attrs["spec_sha256"] == spec_digest(result.spec)
    assert json.loads(read.attrs["versions"])["python"]
    assert float(read["bearing_temperature_ball"].sel(bearing="F1")) == pytest.approx(41.85)
    assert float(read["bearing_heat_term"].sel(bearing="F1", heat_term="sliding")) == 20.0


def test_dataset_means_are_exact_for_a_field_linear_in_z(result):
    dataset = build_dataset(result)
    wall = dataset.sel(surface=WALL)
    assert float(wall["surface_area"]) == pytest.approx(2.0 * np.pi * 0.15 * 0.1, rel=1.0e-4)
    assert float(wall["surface_temperature_mean"]) == pytest.approx(300.0 + 5.0 - 7.5 - 273.15, abs=2.0e-3)
    assert float(wall["surface_film_coefficient"]) == pytest.approx(262.0)
    assert float(wall["surface_fluid_temperature"]) == pytest.approx(15.35)
    assert np.isnan(float(dataset["surface_film_coefficient"].sel(surface="shaft.z0")))
    assert float(dataset["part_temperature_max"].sel(part="shaft")) == pytest.approx(300 + 10 - 1.5 - 273.15)


def test_definition_in_the_dataset_reads_back_to_the_same_machine(result):
    import tomllib

    text = build_dataset(result).attrs["machine_definition_toml"]
    assert spec_digest(validate(tomllib.loads(text), "result.nc")) == spec_digest(result.spec)


def test_digest_follows_values():
    assert spec_digest(load_machine("wu_tan_2016")) != spec_digest(
        load_machine("wu_tan_2016", ["channel.depth=11mm"])
    )


def test_defaults_are_what_the_file_does_not_give():
    paths = default_paths(load_machine("wu_tan_2016"))
    assert "coolant.pumping_heat" in paths
    assert "coolant.flow" not in paths


def test_unknown_schema_is_refused(tmp_path):
    xr.Dataset(attrs={"schema": "spindle-fem/result/99"}).to_netcdf(tmp_path / "result.nc", engine="h5netcdf")
    with pytest.raises(BadInputError, match=r'schema is .*/99.* Known: "spindle-fem/result/1"'):
        read_dataset(tmp_path / "result.nc")


def test_missing_dataset_is_refused(tmp_path):
    with pytest.raises(BadInputError, match="there is no such file"):
        read_dataset(tmp_path / "result.nc")


# ------------------------------------------------------------------ the folder
def test_folder_is_marked_until_it_is_complete(tmp_path):
    with output_folder(tmp_path / "a" / "run") as folder:
        assert not is_complete(folder)
    assert is_complete(folder)


def test_folder_keeps_its_marker_and_the_reason_after_an_error(tmp_path):
    with pytest.raises(ZeroDivisionError), output_folder(tmp_path / "run") as folder:
        raise ZeroDivisionError("half way")
    assert "ZeroDivisionError: half way" in (folder / MARKER).read_text()
    with pytest.raises(BadInputError, match=r"is incomplete: .*half way"):
        require_complete(folder)
    with output_folder(folder):
        pass
    assert is_complete(folder)


def test_folder_refuses_a_file(tmp_path):
    (tmp_path / "run").write_text("mine")
    with pytest.raises(BadInputError, match="is a file"), output_folder(tmp_path / "run"):
        pass


def test_folder_refuses_what_is_not_its_own(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(BadInputError, match=r"other content \(thesis\.tex\)"), output_folder(tmp_path):
        pass
    assert [item.name for item in tmp_path.iterdir()] == ["thesis.tex"]


def test_folder_that_does_not_exist_has_no_report(tmp_path):
    with pytest.raises(BadInputError, match="there is no such folder"):
        rebuild_report(tmp_path / "nothing")


@pytest.fixture(scope="module")
def run_folder(result, tmp_path_factory):
    steps: list[str] = []
    with output_folder(tmp_path_factory.mktemp("runs") / "run") as folder:
        times = write_outputs(result, folder, notify=steps.append)
    assert steps == ["fields", "pictures", "report"]
    assert list(times) == [*steps, "beside: pictures", "beside: data", "beside: charts"]
    return folder


@pytest.mark.render
def test_a_run_writes_every_file(run_folder):
    names = {item.name for item in run_folder.iterdir()}
    assert names == {"summary.json", "fields.vtu", "result.nc", "machine.toml", "figures", "report.html"}
    figures = {item.stem for item in (run_folder / "figures").iterdir()}
    assert figures == {
        *(
            "machine_definition",
            "temperature_cut",
            "channel_walls",
            "bearings_front",
            "bearings_rear",
            "mesh",
        ),
        *(
            "meridian_temperature",
            "radial_profiles",
            "axial_profiles",
            "heat_balance",
            "heat_by_bearing",
            "coolant",
        ),
    }
    assert read_dataset(run_folder / "result.nc", group=SURFACE_GROUP).sizes["axis"] == 3


@pytest.mark.render
def test_the_report_is_rebuilt_from_the_other_files(run_folder):
    written = (run_folder / "report.html").read_bytes()
    assert len(written) < 4.0e6
    assert Page(written.decode()).links
    (run_folder / "report.html").unlink()
    assert rebuild_report(run_folder).read_bytes() == written


@pytest.mark.render
def test_pictures_fill_their_page(run_folder):
    from PIL import Image

    for path in sorted((run_folder / "figures").glob("*.png")):
        pixels = np.asarray(Image.open(path).convert("RGB"))
        ink = (pixels < 245).any(axis=2)
        rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
        assert ink.mean() > 0.01, path.name
        assert np.ptp(rows) > 0.88 * ink.shape[0], path.name
        if not path.name.startswith("bearings_"):  # the tubes of this test end inside that frame
            assert np.ptp(columns) > 0.85 * ink.shape[1], path.name


@pytest.mark.render
def test_helpers_that_were_started_before_write_the_same_files(run_folder, result, tmp_path):
    with output_folder(tmp_path / "run") as folder, OutputHelpers() as helpers:
        helpers.prepare(result.spec, result.mesh, result.n_unknowns)
        helpers.begin(result, folder)
        write_outputs(result, folder, helpers=helpers)
    figures = sorted(path.name for path in (run_folder / "figures").glob("*.png"))
    for name in figures:
        assert (folder / "figures" / name).read_bytes() == (run_folder / "figures" / name).read_bytes(), name
    assert (folder / "fields.vtu").read_bytes() == (run_folder / "fields.vtu").read_bytes()
    assert rebuild_report(folder).read_bytes()


@pytest.mark.render
def test_a_machine_without_bearings_and_channel_is_reported_as_well(tmp_path):
    full = make_result("uncooled", film_coefficient={}, fluid_temperature={})
    spec = full.spec.model_copy(update={"bearing_set": (), "probe": ()})
    mesh = build_joined_tubes((0.03, 0.07, 0.15), 0.1, ((2, 2), 12, 3), parts=("shaft", "housing"))
    temperature = 300.0 + mesh.points[:, 2]
    bare = dataclasses.replace(
        full,
        **{"spec": spec, "mesh": mesh, "temperature": temperature, "energy": EnergyBalance(0.0, {}, {})},
        **{"bearings": {}, "probes": {}, "heat_flows": {}, "warnings": ()},
    )
    with output_folder(tmp_path / "run") as folder:
        write_outputs(bare, folder)
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert Page(text).ids
    assert "No warnings." in text
    assert 'id="bearings"' not in text
    assert not (folder / "figures" / "heat_by_bearing.png").exists()


def test_broken_summary_is_refused(tmp_path):
    (tmp_path / "summary.json").write_text("{")
    with pytest.raises(BadInputError, match="is not valid JSON"):
        rebuild_report(tmp_path)
    (tmp_path / "summary.json").write_text('{"schema": "spindle-fem/summary/9"}')
    with pytest.raises(BadInputError, match="summary/9"):
        rebuild_report(tmp_path)
