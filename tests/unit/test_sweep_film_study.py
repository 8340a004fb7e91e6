"""The paper's choice of depth and oil temperature (Wu & Tan 2016, Figure 22) by both sets of equations."""

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.report.sweep_film import film_maps, film_words
from spindle_fem.studies.sweep.film_study import PAPER_DEPTH, PumpLimits, film_study, pump_limits


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
    assert film_study(load_machine("small_two_start")) == ()


def test_limits_of_a_study_that_concern_the_pump():
    """The tightest of each kind; limits of other outputs, and lower ones, say nothing of the pump."""
    constraints = [
        {"output": "coolant.pressure_drop_Pa", "min": None, "max": 5e5},
        {"output": "coolant.pressure_drop_Pa", "min": 1e4, "max": 4e5},
        {"output": "coolant.pumping_power_W", "min": 10.0, "max": None},
        {"output": "temperature.max_degC", "min": None, "max": 50.0},
    ]
    assert pump_limits(constraints) == PumpLimits(4e5)
    assert pump_limits(constraints).given
    assert not pump_limits(constraints[2:]).given


def test_what_the_pump_may_do_bounds_the_best_film(charts):
    """At constant flow thin channels have the largest film and the largest pressure drop."""
    item = charts["helical", "flow"]
    limits = PumpLimits(pressure_drop=1e5)
    assert limits.demand(item) == pytest.approx(item.pressure_drop / 1e5)
    depth, temperature, value = limits.best(item)
    assert depth > item.best[0]
    assert value < item.best_value
    row = int(np.argmin(np.abs(item.chart.depth - depth)))
    column = int(np.argmin(np.abs(item.chart.temperature - temperature)))
    assert item.pressure_drop[row, column] <= 1e5 < item.pressure_drop[row - 1, column]
    # The tighter of two limits counts.
    power = PumpLimits(1e5, float(item.pumping_power[row, column]) / 2.0)
    assert power.demand(item)[row, column] == pytest.approx(2.0)
    assert PumpLimits(pumping_power=1e-6).best(item) is None
    assert PumpLimits().best(item) == (*item.best, item.best_value)


def dashed(collection):
    return any(pattern is not None for _, pattern in collection.get_linestyle() or ())


def test_the_map_shows_the_pumps_limit(charts):
    films = list(charts.values())
    limits = PumpLimits(pressure_drop=5e5)
    plain, limited = film_maps(films), film_maps(films, limits)

    def drawn(figure):
        return [sum(dashed(item) for item in axes.collections) for axes in figure.axes[:4]]

    def words(figure):
        return [text.get_text() for axes in figure.axes[:4] for text in axes.texts]

    assert drawn(plain) == [0, 0, 0, 0]
    inside = [limits.demand(item).min() < 1.0 < limits.demand(item).max() for item in films]
    assert any(inside)
    assert drawn(limited) == [int(here) for here in inside]
    legend = [text.get_text() for text in limited.axes[0].get_legend().get_texts()]
    assert "the pump's limit" in legend
    nothing = film_maps(films, PumpLimits(pumping_power=1e-3))
    assert sum("beyond the pump everywhere" in text for text in words(nothing)) == 4
    assert not any("beyond the pump" in text for text in words(limited))


def test_the_table_tells_the_largest_film_that_the_pump_allows(charts):
    films = list(charts.values())
    _, plain = film_words(films)
    _, limited = film_words(films, PumpLimits(pressure_drop=1e5))
    assert len(limited.columns) == len(plain.columns) + 1
