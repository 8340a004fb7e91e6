"""The interactive page in a real browser: Chromium, driven by Playwright; a picture of every view.

Pictures go to the folder that ``VIEW_PICTURES`` names, to be looked at.
"""

from __future__ import annotations

import io
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from spindle_fem.commands.machine_commands import run_machine
from spindle_fem.commands.transient_command import run_transient_study
from spindle_fem.commands.view_command import view_folder
from tests.support.command_line import run_here
from tests.support.documented_commands import made_recording

playwright = pytest.importorskip("playwright.sync_api")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")]

BESIDE = Path(__file__).resolve().parents[3] / "shared" / "recordings"
RECORDINGS = Path(os.environ.get("SPINDLE_FEM_RECORDINGS", BESIDE))
PUMP = Path(__file__).parents[2] / "examples" / "pump.toml"
COARSE = ("mesh.preset=coarse", "mesh.order=1")
STUDY = """
schema = "spindle-fem/transient/1"
name = "Heat-up <and> rest"
machine = "small_two_start"
sample_every = "2 min"
fields_every = "5 min"
error = "0.5 K"
[[phase]]
name = "on"
duration = "20 min"
"""
# Graphics in software, as machines without a screen have them.
SWITCHES = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
]


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    place = tmp_path_factory.mktemp("views")
    run_machine("small_two_start", place / "run", overrides=COARSE, progress=False)
    (place / "study.toml").write_text(STUDY, encoding="utf-8")
    run_transient_study(place / "study.toml", place / "transient", overrides=COARSE)
    return place


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as started:
        found = started.chromium.launch(executable_path=CHROMIUM, args=SWITCHES)
        yield found
        found.close()


@pytest.fixture
def opened(browser, folders):
    """A page by its folder; nothing may go wrong in it, and it may ask for nothing else."""
    complaints = []

    def open_view(name):
        page = browser.new_page(viewport={"width": 1280, "height": 1150})
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
        asked = view_folder(folders / name).as_uri()
        page.on("request", lambda it: complaints.append(it.url) if it.url != asked else None)
        page.goto(asked)
        page.wait_for_selector("#view3d[data-drawn]")
        return page

    yield open_view
    assert not complaints


def seen(page, name):
    """Pixels of the canvas; the page's picture is kept where it was asked for."""
    from PIL import Image

    page.wait_for_timeout(400)
    if os.environ.get("VIEW_PICTURES"):
        folder = Path(os.environ["VIEW_PICTURES"])
        folder.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=folder / f"{name}.png", full_page=True)
    with Image.open(io.BytesIO(page.locator("canvas").screenshot())) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def inked(pixels):
    """Share of a picture that is not white."""
    return float(np.mean(pixels.min(axis=2) < 240))


def slide(page, what, value):
    page.eval_on_selector(
        f"[data-{what}]",
        "(slider, value) => { slider.value = value; slider.dispatchEvent(new Event('input')); }",
        value,
    )


def click(page, x, y):
    box = page.locator("canvas").bounding_box()
    page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])


def test_a_cut_moves_and_turns(opened):
    page = opened("run")
    upright = seen(page, "run_upright")
    assert 0.1 < inked(upright) < 0.8
    page.click("[data-view=drive]")
    page.click("[data-normal='0 90']")
    slide(page, "depth", -0.5)
    across = seen(page, "run_across")
    slide(page, "depth", 0.5)
    less = seen(page, "run_across_later")
    assert np.any(across != less)
    page.click("[data-flip]")
    assert "along (" in page.inner_text(".view3d-plane")
    place = float(page.inner_text(".view3d-plane").split()[2])
    page.click("[data-flip]")
    assert float(page.inner_text(".view3d-plane").split()[2]) == -place
    # closed, a machine covers at least what is left of it after a cut
    page.uncheck("[data-open]")
    assert inked(seen(page, "run_closed")) >= inked(less) - 0.01


def test_what_is_read_is_what_was_solved(opened, folders):
    summary = json.loads((folders / "run" / "summary.json").read_text(encoding="utf-8"))
    page = opened("run")
    page.click("[data-view=side]")
    page.wait_for_timeout(300)
    tags = page.locator(".view3d-names span").all_inner_texts()
    assert tags
    for tag in tags:
        name, value = tag.rsplit(" ", 1)
        assert float(value) == pytest.approx(summary["probes"][name], abs=0.06)
    assert page.locator(".view3d-ticks span").last.inner_text().endswith("°C")


def test_growth_is_drawn_with_its_exaggeration(opened):
    page = opened("run")
    before = seen(page, "run_assembled")
    assert "as assembled" in page.inner_text(".view3d-stretched")
    page.click("[data-grown]")
    after = seen(page, "run_grown")
    assert "times larger" in page.inner_text(".view3d-stretched")
    changed = np.mean(np.any(before != after, axis=2))
    assert 0.005 < changed < 0.5


def test_times_and_histories_of_what_is_clicked(opened):
    page = opened("transient")
    assert page.inner_text("h1") == "Heat-up <and> rest"
    slide(page, "time", 0)
    cold = seen(page, "transient_start")
    assert page.inner_text(".view3d-clock") == "0 s"
    slide(page, "time", 4)
    warm = seen(page, "transient_end")
    assert page.inner_text(".view3d-clock") == "20 min 00 s"
    assert np.mean(np.any(cold != warm, axis=2)) > 0.1
    click(page, 0.5, 0.5)
    tag = page.locator(".view3d-names span").first
    box, stage = tag.bounding_box(), page.locator("canvas").bounding_box()
    probe = ((box["x"] - 9 - stage["x"]) / stage["width"], (box["y"] + 24 - stage["y"]) / stage["height"])
    click(page, *probe)
    seen(page, "transient_histories")
    picked = page.locator(".view3d-picked li").all_inner_texts()
    assert len(picked) == 2
    assert picked[1] in tag.inner_text()
    curves = page.locator(".view3d-chart path").evaluate_all("all => all.map(one => one.getAttribute('d'))")
    assert len(curves) == 2
    assert all(curve.startswith("M") and curve.count("L") >= 4 for curve in curves)
    page.click("[data-clear]")
    assert page.locator(".view3d-picked li").count() == 0


def test_parts_can_be_hidden(opened):
    page = opened("run")
    whole = inked(seen(page, "run_whole"))
    page.click("summary")
    page.locator(".view3d-parts label", has_text="housing").locator("input").uncheck()
    assert inked(seen(page, "run_without_housing")) < 0.8 * whole


# ------------------------------------------------------------- before and after of a diagnosis
@pytest.fixture(scope="module")
def diagnosed(folders):
    """Folders of a diagnosis of a spindle and of a network, and what the first one found."""
    recording = RECORDINGS / "spindle_examples" / "example_2_heat_scale"
    if not recording.is_dir():
        pytest.skip("no folder of recordings")
    earlier = recording / "calibration.toml"
    for name, machine, given in (
        ("diagnosed", "recorded_spindle", ["--set", "mesh.preset=coarse", "--calibrate", earlier]),
        ("diagnosed_network", PUMP, []),
    ):
        measured = recording if name == "diagnosed" else folders / "pump"
        if name != "diagnosed":
            made_recording(measured, machine)
        done = run_here(
            "diagnose", str(machine), str(measured), "-o", str(folders / name), *given, cwd=folders
        )
        assert done.returncode == 0, done.stderr
    return json.loads((folders / "diagnosed" / "diagnosis.json").read_text(encoding="utf-8"))


def layers_of(page):
    return page.locator(".view3d-layer option").all_inner_texts()


def show(page, layer):
    page.select_option(".view3d-layer select", label=layer)


def test_a_diagnosis_shows_the_machine_before_and_after(opened, diagnosed):
    page = opened("diagnosed")
    assert diagnosed["verdict"] in ("parameter", "missing_physics")
    assert layers_of(page)[:2] == ["before", "after"]
    slide(page, "time", 20)
    pictures = {}
    for layer in layers_of(page):
        show(page, layer)
        pictures[layer] = seen(page, f"diagnosis_{layer.replace(' ', '_')}")
        assert page.inner_text(".view3d-scale").startswith(layer)
    before, after = pictures["before"], pictures["after"]
    # one colour scale for both: what was found shows as other colours
    assert np.mean(np.any(before != after, axis=2)) > 0.02
    page.select_option(".view3d-layer select", label="before")
    tag = page.locator(".view3d-names span").first
    box, stage = tag.bounding_box(), page.locator("canvas").bounding_box()
    click(page, (box["x"] - 9 - stage["x"]) / stage["width"], (box["y"] + 24 - stage["y"]) / stage["height"])
    seen(page, "diagnosis_history")
    assert page.locator(".view3d-picked li").count() == 1
    # read, before and after
    assert page.locator(".view3d-chart path").count() == 3


def test_a_diagnosis_of_a_network_shows_nodes_and_links(opened, diagnosed):
    page = opened("diagnosed_network")
    assert {"before", "after"} <= set(layers_of(page))
    show(page, "before")
    assert 0.002 < inked(seen(page, "network_before")) < 0.8
    show(page, "after")
    seen(page, "network_after")
