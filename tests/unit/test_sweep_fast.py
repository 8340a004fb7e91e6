"""Pieces of the projected model of designs: heat tables, many channels at once, extremes of fields."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spindle_fem.definition.load import load_machine
from spindle_fem.model.reduced.coolant_batch import ChannelBatch, pressure_drops
from spindle_fem.model.reduced.heat_tables import (
    QUANTITIES,
    BearingTables,
    is_constant,
    mechanical_keys,
)
from spindle_fem.operation.bearing_heat import BearingTemperatures, heat_model_of
from spindle_fem.operation.channel_cells import ChannelCells
from spindle_fem.operation.coolant_loop import CoolantLoop
from spindle_fem.operation.friction_map import FilmSeries, chebyshev_nodes, film_temperature
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.duct_films import DUCT_FILMS
from spindle_fem.physics.coolant.duct_kinds.bore import bore
from spindle_fem.physics.coolant.ducts import DuctFlow, DuctShape
from spindle_fem.physics.coolant.regimes import ChannelState, select_film
from spindle_fem.studies.sweep.fast_outputs import extreme_temperatures


@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6), st.floats(280.0, 340.0))
def test_tables_are_exact_for_polynomials(coefficients, place):
    nodes = chebyshev_nodes(280.0, 340.0, 6, ends=True)
    polynomial = np.polynomial.Polynomial(coefficients, domain=(280.0, 340.0))
    series = FilmSeries.through(nodes, polynomial(nodes)[None, None], 280.0, 340.0)
    film = np.array([[place]])
    assert series.at(film)[0, 0, 0] == pytest.approx(polynomial(place), abs=1e-9)
    assert series.slope(film)[0, 0, 0] == pytest.approx(polynomial.deriv()(place), abs=1e-9)
    by_complex_step = series.at(film + 1e-30j).imag / 1e-30
    assert by_complex_step[0, 0, 0] == pytest.approx(polynomial.deriv()(place), abs=1e-9)


def test_a_series_of_one_state_is_constant_and_others_go_on_along_their_tangent():
    series = FilmSeries.through(np.array([300.0]), np.ones((1, 1, 1)), 280.0, 320.0)
    assert series.at(np.array([[300.0, 310.0]])).tolist() == [[[1.0, 1.0]]]
    nodes = chebyshev_nodes(280.0, 320.0, 3)
    parabola = FilmSeries.through(nodes, ((nodes - 280.0) ** 2)[None, None], 280.0, 320.0)
    assert parabola.at(np.array([[270.0, 330.0]]))[0, 0] == pytest.approx(
        [0.0, 40.0**2 + 80.0 * 10.0], abs=1e-9
    )


@pytest.mark.parametrize("model", ["palmgren", "full", "table"])
def test_a_table_answers_as_the_heat_model_does(model):
    """Bearings of a set at temperatures of their own: what each feels of the others is left out."""
    spec = load_machine("wu_tan_2016", [f"heat.model={model}", "heat.thermal_preload=false"])
    point = OperatingPoint.of(spec)
    tables = BearingTables(285.0, 345.0)
    table = tables.of(spec, point, mechanical_keys([spec], [point])[0])
    names = [bearing.name for _, bearing in spec.bearings]
    inner, outer, ball = (
        np.linspace(318.0, 305.0, 5),
        np.linspace(308.0, 300.0, 5),
        np.linspace(314.0, 303.0, 5),
    )
    exact, _ = heat_model_of(spec)(
        point,
        {
            name: BearingTemperatures(*row)
            for name, *row in zip(names, inner, outer, ball, inner, outer, strict=True)
        },
    )
    found = table.at(film_temperature(inner, outer, ball)[None])[0]
    for name, row in zip(names, found, strict=True):
        assert row[QUANTITIES.index("total")] == pytest.approx(exact[name].total, rel=2e-3)
        conductance = row[QUANTITIES.index("conductance_inner")]
        assert conductance == pytest.approx(exact[name].conductance_inner, rel=1e-3)
        terms = dict(zip(table.terms, row[len(QUANTITIES) :], strict=True))
        assert sum(terms.values()) == pytest.approx(row[0], rel=1e-6)


@pytest.mark.parametrize(("machine", "preload_matters"), [("recorded_spindle", False), ("wu_tan_2016", True)])
def test_what_makes_heat_and_what_does_not_decides_which_designs_share_a_table(machine, preload_matters):
    changes = ([], ["coolant.flow=10 L/min"], ["operation.speed=500 rpm"], ["bearing_set.rear.preload=900 N"])
    specs = [load_machine(machine, change) for change in changes]
    keys = mechanical_keys(specs, [OperatingPoint.of(spec) for spec in specs])
    assert keys[0] == keys[1] != keys[2]
    assert (keys[3] != keys[0]) == preload_matters
    assert is_constant(specs[0]) != preload_matters


def test_tables_grow_only_to_what_is_read():
    tables = BearingTables(290.0, 330.0)
    assert not tables.widen(291.0, 329.0)
    assert tables.widen(280.0, 325.0)
    assert (tables.low, tables.high) == (274.0, 330.0)
    assert tables.widen(300.0, 5000.0)  # a runaway is not followed
    assert not tables.widen(300.0, 6000.0)


CELLS = ChannelCells(
    (), {}, {}, np.full((1, 14), 0.011), np.arange(14.0), np.arange(14.0), np.arange(14) % 13 == 0
)


@pytest.mark.parametrize("film_model", ["helical", "sieder_tate", "paper"])
@pytest.mark.parametrize("properties_at", ["bulk", "inlet"])
@pytest.mark.parametrize("pumping", ["true", "false"])
def test_many_channels_are_what_each_is_alone(film_model, properties_at, pumping):
    designs = [("12 degC", "8 L/min", 0.8), ("30 degC", "35 L/min", 1.3), ("38 degC", "60 L/min", 1.0)]
    specs = [
        load_machine(
            "wu_tan_2016",
            [
                f"coolant.film_model={film_model}",
                f"coolant.properties_at={properties_at}",
                f"coolant.pumping_heat={pumping}",
                f"coolant.inlet_temperature={inlet}",
                f"coolant.flow={flow}",
                f"coolant.film_factor={factor}",
            ],
        )
        for inlet, flow, factor in designs
    ]
    points = [OperatingPoint.of(spec) for spec in specs]
    inputs = SimpleNamespace(
        specs=specs,
        points=points,
        inlet=np.array([point.coolant_inlet_temperature for point in points]),
        flow=np.array([point.coolant_flow for point in points]),
        film_factor=np.array([spec.coolant.film_factor.value for spec in specs]),
    )

    class Sized(SimpleNamespace):
        def __len__(self):
            return len(self.specs)

    model = SimpleNamespace(
        cell_area=CELLS.cell_area,
        cell_angle=CELLS.angle,
        cell_position=CELLS.position,
        cell_is_port=CELLS.is_port,
    )
    wall = inputs.inlet[:, None, None] + np.linspace(12.0, 3.0, 14)
    batch = ChannelBatch(model, Sized(**vars(inputs)))
    state = None
    for _ in range(12):
        state = batch.at(wall, state)
    matrix, constant = batch.linear(state)
    assert np.allclose(
        constant + np.einsum("nsij,nsj->nsi", matrix, wall), state.march.heat, rtol=1e-9, atol=1e-9
    )
    for row, (spec, point) in enumerate(zip(specs, points, strict=True)):
        alone = CoolantLoop(spec, CELLS).at(point, wall[row])
        assert np.allclose(state.film[row], alone.film_coefficient, rtol=1e-9)
        assert np.allclose(state.march.heat[row], alone.march.march.heat, rtol=1e-8, atol=1e-9)
        assert np.allclose(state.march.bulk_temperature[row], alone.march.march.bulk_temperature, atol=1e-8)
        assert state.march.outlet_temperature[row].mean() == pytest.approx(
            alone.march.march.mixed_outlet_temperature, abs=1e-7
        )
        assert state.enthalpy_rise[row] == pytest.approx(alone.march.march.enthalpy_rise, rel=1e-6)
        drop = pressure_drops(batch.loop, inputs)[row]
        assert drop.total == pytest.approx(alone.pressure.total, rel=1e-12)


@pytest.mark.parametrize(("fluid", "litres"), [("iso_vg_32", 20.0), ("iso_vg_10", 60.0), ("water", 20.0)])
def test_drillings_have_the_film_of_a_straight_duct_in_every_regime(fluid, litres):
    """Sieder and Tate's laminar law in water at Re 38,000 gave a fifth of it."""
    spec = load_machine("wu_tan_2016", [f"coolant.fluid={fluid}", f"coolant.flow={litres} L/min"])
    loop, point = CoolantLoop(spec, CELLS), OperatingPoint.of(spec)
    flow, inlet = point.coolant_flow, point.coolant_inlet_temperature
    length = 0.011 / (np.pi * 0.01)
    duct = DuctFlow(bore(DuctShape(0.01, length)), length, loop.coolant, flow, inlet)
    film = DUCT_FILMS["straight"](duct).nusselt * float(duct.properties.thermal_conductivity) / 0.01
    channel = select_film("helical", loop.section, ChannelState(loop.coolant, flow, inlet)).value
    assert loop.cell_factors(flow, inlet) == pytest.approx(np.where(CELLS.is_port, film / channel, 1.0))
    assert not any(
        "drillings" in warning.text for warning in loop.at(point, np.full((1, 14), inlet)).warnings
    )
    short = CoolantLoop(spec, replace(CELLS, cell_area=1e-4 * np.ones((1, 14))))
    said = [warning.text for warning in short.at(point, np.full((1, 14), inlet)).warnings]
    assert any("slenderness" in text for text in said) == (duct.regime != "laminar")


@settings(max_examples=20)
@given(st.integers(0, 2**31))
def test_extremes_are_those_of_the_whole_field(seed):
    random = np.random.default_rng(seed)
    nodes = random.normal(size=(5, 300))
    nodes[0] = 2.0
    one = np.array([0.5, 0.0, 0.0, 0.0, 0.0])
    reference = random.uniform(285.0, 300.0, 130)
    unknowns = reference[:, None] * one + random.normal(scale=10.0, size=(130, 5))
    model = SimpleNamespace(nodes=nodes.astype(np.float32), one=one)
    low, high = extreme_temperatures(model, unknowns, reference)
    field = unknowns @ nodes
    assert np.allclose(low, field.min(axis=1), atol=2e-5)
    assert np.allclose(high, field.max(axis=1), atol=2e-5)
