"""Purge air, cutting fluid, a jacket of ring grooves: streams take what their walls give."""

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.operation.circuits import capacity_rate
from spindle_fem.solvers.machine_network_steady import solve_machine_network
from spindle_fem.solvers.prepared_machine import prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared
from tests.integration.test_circuits_in_models import JACKET
from tests.support.valid_definition import VALID

pytestmark = pytest.mark.slow
SMALL = ["mesh.preset=coarse", "mesh.order=1"]
PURGED = """
schema = "spindle-fem/machine/1"
base = "router_spindle"
name = "purged"
[[surface]]
name = "housing.wet"
part = "housing"
where = [{facing = "outward", r = "55 mm"}]
[[film]]
kind = "wetted"
name = "cutting_fluid"
surface = ["housing.wet"]
width = "366 mm"
length = "173 mm"
fluid = "water"
inlet_temperature = "24 degC"
flow = "5 L/min"
[[film]]
kind = "circuit"
name = "purge"
duct = "annulus"
part = "rotor"
outer_part = "stator"
diameter = "46 mm"
outer_diameter = "47 mm"
z = ["80 mm", "150 mm"]
cells = 4
fluid = "air"
inlet_temperature = "22 degC"
flow = "60 L/min"
law = "turning"
[[probe]]
name = "PURGE_OUT"
kind = "circuit_outlet"
circuit = "purge"
"""


def solved(spec):
    result = solve_prepared(prepare_machine(spec))
    for film in spec.circuits:
        circuit = result.circuits[film.name]
        rise = circuit.outlet_temperature - film.inlet_temperature
        assert circuit.heat == pytest.approx(capacity_rate(film) * rise, rel=1e-8)
        assert circuit.heat == pytest.approx(
            sum(result.energy.heat_out[name] for name in film.surface), rel=1e-12
        )
    assert all(check.passed for check in result.checks)
    return result


def test_purge_air_and_cutting_fluid_take_what_their_walls_give(tmp_path):
    path = tmp_path / "purged.toml"
    path.write_text(PURGED, encoding="utf-8")
    spec = load_machine(str(path), SMALL)
    result = solved(spec)
    network = solve_machine_network(build_machine_network(spec))
    # The air takes from the rotor and gives to the stator: what stays in it is the difference of both.
    out = result.energy.heat_out
    moved = sum(abs(heat) for name, heat in out.items() if name.startswith("purge."))
    assert network.boundary_heat["purge"] == pytest.approx(result.circuits["purge"].heat, abs=0.1 * moved)
    fluid = result.circuits["cutting_fluid"].heat
    assert network.boundary_heat["cutting_fluid"] == pytest.approx(fluid, rel=0.05)
    air = [float(result.fluid_temperature[f"purge.inner.{n}"].mean()) for n in range(1, 5)]
    assert np.all(np.diff(air) > 0.0)
    assert result.probes["PURGE_OUT"] == result.circuits["purge"].outlet_temperature
    # A litre of air a second has 1.2 W/K.
    assert 5.0 < result.circuits["purge"].heat < 150.0


def test_ring_grooves_share_the_flow(tmp_path):
    path = tmp_path / "rings.toml"
    outside = 'name = "housing.outside"\npart = "housing"'
    text = VALID.replace(outside, outside.replace('"housing"', '"jacket"'), 1) + JACKET
    rings = 'duct = "ring_grooves"\nwidth = "8 mm"\ndepth = "5 mm"\nnumber = 5'
    text = text.replace('duct = "annulus"', rings)
    text = text.replace('outer_diameter = "160 mm"\nz', "z")
    path.write_text(text, encoding="utf-8")
    spec = load_machine(str(path), [*SMALL, "channel.ports=none", "remaining_surfaces=adiabatic"])
    result = solved(spec)
    coolant = [float(result.fluid_temperature[name].mean()) for name in spec.circuits[0].surface]
    assert sum(result.energy.heat_out[f"stator.cover.{n}"] for n in range(1, 5)) > 0.0
    assert max(coolant) - min(coolant) < 0.5 * (max(coolant) - spec.circuits[0].inlet_temperature)
