"""The drawing of displacements: micrometres, before and after, and what each leaves."""

import numpy as np
import pytest
import xarray as xr

from spindle_fem.report.read_against_predicted import displaced_before_after


def drawn_lines(figure):
    """What is drawn of the only channel: readings, before, after; then what each leaves."""
    upper, lower = figure.axes
    return [line.get_ydata() for line in upper.lines], [line.get_ydata() for line in lower.lines[1:]]


def test_displacements_are_drawn_in_micrometres_beside_both_models():
    times = np.arange(0.0, 3600.0, 60.0)
    read = 1e-6 * np.linspace(0.0, 12.0, times.size)
    read[7] = np.nan
    along = ("stamp", "displacement_name")
    data = xr.Dataset(
        {
            "time": ("stamp", times),
            "recording_index": ("stamp", np.zeros(times.size, dtype=int)),
            "held_out": ("stamp", np.zeros(times.size, dtype=int)),
            "displacement": (along, read[:, None]),
            "displacement_before": (along, read[:, None] - 3e-6),
            "displacement_after": (along, read[:, None]),
            "displacement_noise": (("recording", "displacement_name"), [[0.3e-6]]),
            "start_stamp": ("recording", [""]),
        },
        {"displacement_name": ["S1"], "recording": ["nose"]},
    )
    figure = displaced_before_after(data, 0)
    (shown, before, after), (left_before, left_after) = drawn_lines(figure)
    assert shown == pytest.approx(1e6 * np.delete(read, 7))
    assert np.nanmax(after - before) == pytest.approx(3.0)
    assert left_before == pytest.approx(3.0)
    assert left_after == pytest.approx(0.0, abs=1e-9)
    assert [axes.get_ylabel() for axes in figure.axes] == ["µm", "residual / µm"]
    assert displaced_before_after(data.drop_vars("displacement"), 0) is None
    assert displaced_before_after(data.assign(displacement=data["displacement"] * np.nan), 0) is None
