"""Charts of a transient: what is drawn, and what is left out."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from spindle_fem.report.transient_charts import (
    bearing_history,
    growth_history,
    heat_history,
    probe_history,
)
from spindle_fem.studies.transient_study import StudyResult

HOUR = 3600.0


def phase(start, end, preload):
    """A phase of two probes that rise, in three steps."""
    times = np.linspace(start, end, 4)
    steps = SimpleNamespace(
        times=times[1:],
        bearing_heat=np.full((3, 2), 50.0),
        coolant_heat=np.full(3, 40.0),
        preload=preload,
    )
    readings = 290.0 + np.column_stack([times, 2.0 * times]) / HOUR
    transient = SimpleNamespace(
        times=times, readings=readings, probes=("A", "B"), bearings=("F1", "R1"), steps=steps,
        inner=readings + 5.0, outer=readings, motions=("nose_axial", "nose_radial_up"),
        motion=1e-6 * readings,
    )  # fmt: skip
    return SimpleNamespace(start=start, end=end, point=SimpleNamespace(speed=100.0), transient=transient)


def result(preload):
    phases = (phase(0.0, HOUR, preload), phase(HOUR, 3.0 * HOUR, preload))
    return StudyResult(SimpleNamespace(name="two phases", error=0.05), phases)


def test_where_the_last_phase_tends_to_is_drawn_over_it():
    plain = probe_history(result(np.full((3, 2), 500.0))).axes[0]
    upper = probe_history(result(np.full((3, 2), 500.0)), {"A": 21.0, "B": 24.5}).axes[0]
    dotted = [line for line in upper.lines if line.get_linestyle() == ":" and len(line.get_xdata())]
    assert [line.get_ydata()[0] for line in dotted] == [21.0, 24.5]
    assert [float(x) for x in dotted[0].get_xdata()] == [1.0, 3.0]
    assert not any(line.get_linestyle() == ":" for line in plain.lines)


@pytest.mark.parametrize(
    ("preload", "charts"),
    [
        (np.full((3, 2), 500.0), 1),
        (np.full((3, 2), np.nan), 1),
        (np.array([[500.0, 400.0], [505.0, 400.0], [510.0, 400.0]]), 2),
    ],
)
def test_preload_is_drawn_where_it_changes(preload, charts):
    assert len(heat_history(result(preload)).axes) == charts


@pytest.mark.parametrize("chart", [probe_history, bearing_history, heat_history, growth_history])
def test_legends_lie_over_no_curve_and_not_over_the_title(chart):
    figure = chart(result(np.array([[500.0, 400.0], [505.0, 400.0], [510.0, 400.0]])))
    FigureCanvasAgg(figure).draw()
    legends = [axes.get_legend() for axes in figure.axes if axes.get_legend() is not None]
    assert legends
    taken = [axes.get_window_extent() for axes in figure.axes] + [figure._suptitle.get_window_extent()]
    for legend in legends:
        box = legend.get_window_extent()
        assert not any(box.overlaps(other) for other in taken)
        assert 0.0 <= box.x0 < box.x1 <= figure.bbox.width
