"""Pictures of recordings: what is drawn of readings that are not used, gaps and units."""

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from spindle_fem.recordings.align import read_recording
from spindle_fem.report.recording_picture import recording_figure

MANIFEST = """
schema = "spindle-fem/recording/1"
name = "cost $5 & more"
data = "data.csv"
time = {column = "time", unit = "s"}
[[channel]]
column = "a $x_ b"
role = "temperature"
probe = "SP01"
unit = "degC"
[[channel]]
column = "nothing"
role = "temperature"
probe = "SP02"
unit = "degC"
[[channel]]
column = "power"
role = "covariate"
unit = "kW"
"""


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recording")
    warm = 20.0 + 0.1 * np.arange(100)
    warm[50] = -200.0
    rows = [f"{10 * k + 5000 * (k > 70)},{warm[k]:.1f},,{k % 3}" for k in range(100)]
    (folder / "data.csv").write_text("\n".join(["time,a $x_ b,nothing,power", *rows]))
    (folder / "recording.toml").write_text(MANIFEST)
    figure = recording_figure(read_recording(folder))
    figure.canvas.draw()
    return figure


def test_a_far_reading_stands_at_the_edge(figure):
    low, high = figure.axes[0].get_ylim()
    assert 15.0 < low < 20.0
    assert high < 35.0
    marked = [line.get_ydata() for line in figure.axes[0].lines if line.get_marker() == "x"]
    assert [list(values) for values in marked] == [[low]]


def test_gaps_are_shaded_on_every_strip(figure):
    for strip in figure.axes:
        spans = [
            (patch.get_x(), patch.get_width()) for patch in strip.patches if isinstance(patch, Rectangle)
        ]
        assert any(width > 0.8 * 5000.0 / 3600.0 for _, width in spans), strip.get_title(loc="left")


def test_names_with_dollar_signs_and_units_are_shown(figure):
    assert figure.axes[0].get_title(loc="left") == "a $x_ b (probe SP01)"
    assert figure.axes[2].get_ylabel() == "W"
    assert max(figure.axes[2].lines[0].get_ydata()) == 2000.0


@pytest.mark.parametrize("pause", [0, 5000])
def test_the_key_names_gaps_where_there_are_some(tmp_path, pause):
    rows = [f"{10 * k + pause * (k > 70)},{20.0 + 0.1 * (k % 7):.1f},21.0,{k % 3}" for k in range(100)]
    (tmp_path / "data.csv").write_text("\n".join(["time,a $x_ b,nothing,power", *rows]))
    (tmp_path / "recording.toml").write_text(MANIFEST)
    drawn = recording_figure(read_recording(tmp_path))
    named = [text.get_text() for text in drawn.legends[0].get_texts()]
    assert ("gap or nothing read" in named) == bool(pause)
