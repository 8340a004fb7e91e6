"""The paper's choice of depth and oil temperature (Wu & Tan 2016, Figure 22) by both sets of equations."""

import numpy as np
import pytest

from spindle_fem.design.film_study import PAPER_DEPTH, film_study
from spindle_fem.spec.load import load_machine


@pytest.fixture(scope="module")
def charts():
    return {(item.model, item.held): item for item in film_study(load_machine("wu_tan_2016"))}


def at_optimum(chart):
    return np.argmin(np.abs(chart.depth - 0.019)), np.argmin(np.abs(chart.temperature - 304.15))


def test_velocity_puts_the_optimum_on_the_papers_own_line(charts):
    """Re on the depth is 2300 at 19 mm and 31 °C (ν 46.5 mm²/s) for 5.6 m/s, 77 L/min in this channel."""
    item = charts["paper", "velocity"]
    assert item.amount == pytest.approx(5.6, abs=0.05)
    flow = item.amount * PAPER_DEPTH * 0.012
    assert flow * 6e4 == pytest.approx(77.0, abs=1.0)
    row, column = at_optimum(item.chart)
    assert item.chart.regime[row, column + 2] == "turbulent"
    assert item.chart.regime[row, column - 2] == "laminar"


def test_at_the_coolers_flow_nothing_is_turbulent(charts):
    for model in ("paper", "helical"):
        item = charts[model, "flow"]
        assert set(item.chart.regime.ravel()) == {"laminar"}
        assert item.best[0] == pytest.approx(0.005)
        assert item.paper_value < 0.5 * item.best_value
    assert set(charts["helical", "velocity"].chart.regime.ravel()) == {"laminar"}


def test_value_at_the_papers_optimum(charts):
    """Equation 31 at 19 mm, 31 °C, 20 L/min: 161.4 W/(m²·K) within 1 %."""
    assert charts["paper", "flow"].paper_value == pytest.approx(161.4, rel=0.01)


def test_pump(charts):
    """Straight duct: f Re = 14.85 gives 1.1 bar and 150 W; White's curvature factor at De 445 is 2.63."""
    item = charts["helical", "velocity"]
    row, column = at_optimum(item.chart)
    hydraulic_diameter, length = 4 * 19e-3 * 12e-3 / (2 * 31e-3), 3.69
    fanning = 14.85 / (item.amount * hydraulic_diameter / 46.46e-6)
    density = 869.1 * (1 - 7.9744e-4 * 10.0)
    straight = 4 * fanning * length / hydraulic_diameter * density * item.amount**2 / 2
    assert straight == pytest.approx(1.1e5, rel=0.05)
    assert item.pressure_drop[row, column] == pytest.approx(2.63 * straight, rel=0.01)
    assert np.allclose(item.pumping_power, item.pressure_drop * item.chart.volume_flow[:, None])


def test_the_line_is_where_each_model_leaves_laminar_flow(charts):
    for item in charts.values():
        turbulent = item.chart.regime != "laminar"
        assert ((item.laminar_share > 1.0) == turbulent).all()
    paper = charts["paper", "velocity"]
    row = int(np.argmin(np.abs(paper.chart.depth - PAPER_DEPTH)))
    share = np.interp(304.15, paper.chart.temperature, paper.laminar_share[row])
    assert share == pytest.approx(1.0, rel=1e-3)


def test_machine_without_a_channel_has_no_map():
    assert film_study(load_machine("uncooled")) == ()
