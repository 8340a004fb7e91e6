"""Circuits beside the channel: ducts against closed forms, the march against the exchanger's, definitions."""

import math

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.machine_spec import CircuitFilm
from spindle_fem.errors import FaultsError, OutOfValidityError
from spindle_fem.operation.circuits import (
    CircuitMarch,
    coolant_temperatures,
    duct_flow,
    stream_answer,
    stream_warnings,
    wall_cells,
)
from spindle_fem.physics.coolant.coolants.water import Water
from spindle_fem.physics.coolant.duct_films import DUCT_FILMS
from spindle_fem.physics.coolant.duct_kinds import DUCT_KINDS
from spindle_fem.physics.coolant.ducts import LAMINAR_TO, TURBULENT_FROM, DuctFlow, DuctShape

WATER = Water()
LITRE_PER_MINUTE = 1e-3 / 60.0
BORE = {
    "kind": "circuit", "name": "bore", "part": "shaft", "diameter": "20 mm", "z": ["0 mm", "400 mm"],
    "fluid": "water", "inlet_temperature": "20 degC", "flow": "2 L/min",
}  # fmt: skip


def circuit(**changes):
    return CircuitFilm.model_validate({**BORE, **changes})


def said(film):
    return stream_warnings(film, stream_answer(film, 0.0))


def flow_of(litres, kind="bore", diameter=0.02, outer=None, length=0.4):
    section = DUCT_KINDS[kind](DuctShape(diameter, length, outer))
    return DuctFlow(section, length, WATER, litres * LITRE_PER_MINUTE, 293.15)


def test_a_laminar_bore_loses_what_hagen_and_poiseuille_say():
    flow = flow_of(1.0)
    viscosity = float(flow.properties.kinematic_viscosity * flow.properties.density)
    assert flow.regime == "laminar"
    assert flow.pressure_drop == pytest.approx(
        128.0 * viscosity * 0.4 * flow.volume_flow / (math.pi * 0.02**4), rel=1e-12
    )


def test_a_laminar_annulus_loses_what_a_slit_does():
    flow = flow_of(2.0, "annulus", 0.1, 0.104)
    viscosity = float(flow.properties.kinematic_viscosity * flow.properties.density)
    assert flow.pressure_drop == pytest.approx(12.0 * viscosity * flow.velocity * 0.4 / 0.002**2, rel=1e-12)


def test_a_turbulent_bore_by_hand():
    # 10 L/min of water at 20 °C through 20 mm: 0.531 m/s, Re 10570; f = (1.8 lg Re - 1.5)^-2 = 0.0303;
    # 0.0303 · 20 · 998/2 · 0.531² = 85 Pa. Nu: 0.00379 · 9570 · 7.01/(1 + 12.7 · 0.0616 · 2.66) = 82.5, times
    # 1 + 20^(-2/3) = 1.136: 93.7.
    flow = flow_of(10.0)
    assert flow.reynolds == pytest.approx(10570.0, rel=5e-3)
    assert flow.pressure_drop == pytest.approx(85.0, rel=2e-2)
    assert DUCT_FILMS["straight"](flow).nusselt == pytest.approx(93.7, rel=1e-2)


def test_a_long_laminar_bore_has_the_developed_film():
    long = flow_of(0.1, length=1.0e4)
    assert DUCT_FILMS["straight"](long).nusselt == pytest.approx(3.657, rel=1e-3)


def test_film_and_pressure_do_not_jump_between_the_regimes():
    per_litre = flow_of(1.0).reynolds
    for reynolds in (LAMINAR_TO, TURBULENT_FROM):
        below, above = (flow_of(share * reynolds / per_litre) for share in (1.0 - 1e-9, 1.0 + 1e-9))
        for what in (lambda flow: DUCT_FILMS["straight"](flow).nusselt, lambda flow: flow.pressure_drop):
            assert what(above) == pytest.approx(what(below), rel=1e-6)


def test_a_wide_annulus_is_refused():
    with pytest.raises(OutOfValidityError, match="outer_diameter is 210 mm"):
        DUCT_KINDS["annulus"](DuctShape(0.1, 0.2, 0.21))


def test_outside_its_source_the_film_says_so():
    assert not said(circuit())
    warning = said(circuit(flow="3000 L/min"))[-1]
    assert "reynolds" in warning.text


@pytest.mark.parametrize("cells", [2, 8])
def test_walls_of_one_temperature_warm_the_coolant_as_the_exchanger_has_it(cells):
    film = circuit(cells=cells)
    rate, conductance = duct_flow(film).capacity_rate, 170.0
    each = dict.fromkeys(film.surface, conductance / cells)
    coolant, outlet = coolant_temperatures(film, each, dict.fromkeys(film.surface, 313.15), 293.15)
    assert outlet == pytest.approx(313.15 - 20.0 * math.exp(-conductance / rate), abs=1e-10)
    heat = sum(each[name] * (313.15 - coolant[name]) for name in each)
    assert heat == pytest.approx(rate * (outlet - 293.15), rel=1e-12)


def test_walls_of_one_flux_warm_the_coolant_evenly():
    film = circuit(cells=40)
    rate, flux, conductance = duct_flow(film).capacity_rate, 500.0, 170.0
    middle = (np.arange(40) + 0.5) / 40.0
    wall = 293.15 + flux * middle / rate + flux / conductance
    each = dict.fromkeys(film.surface, conductance / 40)
    walls = dict(zip(film.surface, wall.tolist(), strict=True))
    coolant, outlet = coolant_temperatures(film, each, walls, 293.15)
    assert outlet - 293.15 == pytest.approx(flux / rate, rel=1e-3)
    assert list(coolant.values()) == pytest.approx((293.15 + flux * middle / rate).tolist(), abs=0.01)


def test_both_walls_of_an_annulus_share_their_coolant():
    film = circuit(duct="annulus", diameter="100 mm", outer_diameter="110 mm", cells=2)
    each = dict(zip(film.surface, (30.0, 10.0, 30.0, 10.0), strict=True))
    coolant, outlet = coolant_temperatures(film, each, dict.fromkeys(film.surface, 313.15), 293.15)
    assert coolant["bore.inner.1"] == coolant["bore.outer.1"] < coolant["bore.inner.2"]
    heat = sum(each[name] * (313.15 - coolant[name]) for name in each)
    assert heat == pytest.approx(duct_flow(film).capacity_rate * (outlet - 293.15), rel=1e-12)


def test_a_wall_that_does_not_conduct_leaves_the_coolant_alone():
    film = circuit(cells=2)
    march = CircuitMarch.of(film, np.array([0.0, 0.0]), wall_cells(film))
    assert np.all(march.warming == 0.0)
    assert np.all(march.outlet == 0.0)


def test_cells_are_counted_from_the_inlet():
    towards = {end: circuit(flows_to=end, cells=4).walls for end in ("rear", "front")}
    assert [wall.name for wall in towards["rear"]] == ["bore.1", "bore.2", "bore.3", "bore.4"]
    assert towards["rear"][0].where[0].z == (0.0, 0.1)
    assert towards["front"][0].where[0].z == pytest.approx((0.3, 0.4))
    assert towards["front"][0].where[0].r == (0.01, 0.01)


MACHINE = """
schema = "spindle-fem/machine/1"
base = "recorded_spindle"
name = "bored"
[[film]]
kind = "circuit"
name = "bore"
part = "shaft"
diameter = "60 mm"
z = ["20 mm", "300 mm"]
fluid = "water"
inlet_temperature = "20 degC"
flow = "2 L/min"
[[probe]]
name = "BORE_OUT"
kind = "circuit_outlet"
circuit = "bore"
"""


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ('part = "shaft"', 'part = "shift"', '"shift" is no part'),
        ('circuit = "bore"', 'circuit = "boar"', '"boar" is no circuit'),
        ('circuit = "bore"', "", "circuit: is missing"),
        ('diameter = "60 mm"', 'diameter = "60 mm"\nduct = "annulus"', "outer_diameter: is missing"),
        ('diameter = "60 mm"', 'diameter = "60 mm"\nouter_diameter = "70 mm"', "outer_diameter: is given"),
        (
            'diameter = "60 mm"',
            'diameter = "60 mm"\nduct = "annulus"\nouter_diameter = "70 mm"',
            '"shaft" turns',
        ),
        ('name = "bore"', 'name = "bore"\nlaw = "strait"', "strait"),
    ],
)
def test_faults_of_circuits_are_named(tmp_path, old, new, what):
    path = tmp_path / "machine.toml"
    path.write_text(MACHINE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(FaultsError, match=what):
        load_machine(str(path))


def test_what_was_resolved_reads_back_the_same(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(MACHINE, encoding="utf-8")
    machine = load_machine(str(path), ["film.bore.flow=3 L/min"])
    assert machine.circuits[0].flow == pytest.approx(3.0 * LITRE_PER_MINUTE)
    dumped = machine.model_dump(mode="json", by_alias=True, exclude_none=True)
    assert type(machine).model_validate(dumped).circuits == machine.circuits
