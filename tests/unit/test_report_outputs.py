"""Files of a run: complete or marked, self-contained, and the report rebuilt from the others."""

from __future__ import annotations

import dataclasses
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from spindle_fem.errors import BadInputError
from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.report import block_page as document
from spindle_fem.report import table_rows
from spindle_fem.report.figure_style import new_figure
from spindle_fem.report.interactive_view import SURFACE_GROUP, display_surface, viewer_payload
from spindle_fem.report.run_outputs import OutputHelpers, write_outputs
from spindle_fem.report.run_report import _equilibrium, in_order, rebuild_report, render_run_report
from spindle_fem.results.dataset import build_dataset, read_dataset
from spindle_fem.results.output_folder import output_folder
from spindle_fem.results.run_log import LOG_FILE
from spindle_fem.results.run_summary import build_summary
from spindle_fem.results.thermal_result import (
    Check,
    EnergyBalance,
    ThermalResult,
)
from spindle_fem.validity import CodedWarning
from tests.support.made_result import make_result
from tests.support.unpacked_view import unpacked


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

    VOID = frozenset({"meta", "img", "input", "br", "hr", "link", "wbr"})

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
        (table_rows.column("channel"), table_rows.column("passed", verdict=True)),
        table_rows.rows_of([["SP01", True], ["SP<02>", False]]),
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
    surface = display_surface(result)
    payload = viewer_payload(surface)
    columns = unpacked(payload)
    place = columns["points"].reshape(3, -1).T / 65535.0 * payload["span"] + payload["low"]
    assert np.allclose(place, surface["position"].values, atol=payload["span"] / 65535.0)
    index = np.cumsum(columns["triangles"])
    caps = np.cumsum(columns["caps"])
    assert (min(index.min(), caps.min()), max(index.max(), caps.max())) == (0, len(place) - 1)
    shown = sum(part["triangles"][1] + part["caps"][1] for part in payload["parts"])
    assert shown == surface.sizes["triangle_number"]
    (layer,) = payload["layers"]
    celsius = layer["low"] + columns["layer0"] / 65535.0 * (layer["high"] - layer["low"])
    assert np.allclose(celsius, surface["temperature"].values, atol=1.0e-3)


def test_viewer_balls_follow_the_definition(result):
    balls = viewer_payload(display_surface(result))["balls"]
    assert len(balls) == 3 * 30 + 2 * 27
    places = np.array([ball["place"] for ball in balls])
    assert np.allclose(np.hypot(places[:90, 0], places[:90, 1]), 0.0825, atol=1.0e-5)
    assert np.allclose([ball["values"][0] for ball in balls], 41.85, atol=1.0e-2)


def test_a_large_surface_is_thinned_to_its_budget(result):
    full, thin = display_surface(result), display_surface(result, triangle_budget=300)
    on_surface = int((thin["triangle_is_section"] == 0).sum())
    assert 50 < on_surface <= 300 < int((full["triangle_is_section"] == 0).sum())
    assert int(thin["triangle"].max()) < thin.sizes["vertex"]


# ------------------------------------------------------------------ result.nc


# ------------------------------------------------------------------ the folder


@pytest.fixture(scope="module")
def run_folder(result, tmp_path_factory):
    steps: list[str] = []
    with output_folder(tmp_path_factory.mktemp("runs") / "run") as folder:
        times = write_outputs(result, folder, notify=steps.append)
    assert steps == ["fields", "pictures", "report"]
    assert list(times) == [
        *steps,
        *(f"in parallel: {what}" for what in ("pictures", "data", "charts", "growth")),
    ]
    return folder


@pytest.mark.render
def test_a_run_writes_every_file(run_folder):
    names = {item.name for item in run_folder.iterdir()}
    expected = {"summary.json", "fields.vtu", "result.nc", "machine.toml", "figures", "report.html", LOG_FILE}
    assert names == expected
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


@pytest.mark.slow
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


@pytest.mark.parametrize(
    ("fold", "searched", "said"),
    [
        (4713.0, None, "Above 4713 rpm heat and preload feed each other without end: no steady state exists"),
        (None, 4500.0, "Followed up to 4500 rpm, heat and preload do not run away"),
        (None, None, "expansion is followed."),
    ],
)
def test_the_end_of_steady_states_is_said(fold, searched, said):
    found = {
        "preload_ratio": {"F1": 2.0, "F2": 3.0},
        "followed": True,
        "fold_speed_rpm": fold,
        "searched_to_rpm": searched,
        "limits": [],
    }
    (text,) = _equilibrium({"equilibrium": found})
    assert text.text.startswith("The preload of F2 is 3.00 times that of assembly")
    assert said in text.text
    assert ("rpm" in text.text) == (said != "expansion is followed.")
