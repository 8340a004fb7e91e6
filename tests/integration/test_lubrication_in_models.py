"""Oil-air and oil jets in elements, network, fast model and transient: streams take what films give."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.effects.catalogue.coolant_film import CoolantFilm
from spindle_fem.effects.catalogue.grease_churning import GreaseChurning
from spindle_fem.machine.view.build_view import view_of
from spindle_fem.machine.view.defined_point import at_the_defined_point
from spindle_fem.machine.view.machine_names import MachineNames
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.model.reduced.build_reduced import reduced_model_of
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.operation.circuits import capacity_rate
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.coupled_steady import circuit_outlets, solve_coupled
from spindle_fem.solvers.machine_network_steady import solve_machine_network
from spindle_fem.solvers.machine_transient import TransientOptions, simulate_full, start_from
from spindle_fem.solvers.prepared_machine import prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared
from tests.support.oiled_machine import oiled

pytestmark = pytest.mark.slow
SMALL = ["mesh.preset=coarse", "mesh.order=1"]


@pytest.fixture(scope="module")
def spec(tmp_path_factory):
    return load_machine(str(oiled(tmp_path_factory.mktemp("oiled"))), SMALL)


@pytest.fixture(scope="module")
def machine(spec):
    return prepare_machine(spec)


@pytest.fixture(scope="module")
def result(machine):
    return solve_prepared(machine)


def test_every_stream_takes_what_its_raceways_give(result, spec):
    for film in spec.circuits:
        circuit = result.circuits[film.name]
        rise = circuit.outlet_temperature - film.inlet_temperature
        assert circuit.heat == pytest.approx(capacity_rate(film) * rise, rel=1e-8)
        given = sum(result.energy.heat_out[name] for name in film.surface)
        assert circuit.heat == pytest.approx(given, rel=1e-12)
        # Balls give it their film times their surface times how much warmer they are than what passes them.
        row = film.ball_row
        warmer = result.bearings[film.bearing].temperature_ball - result.fluid_temperature[row][0]
        conducts = float(result.film_coefficient[row][0]) * film.element_surface
        assert result.energy.heat_out[row] == pytest.approx(conducts * warmer, rel=1e-6)
    assert all(check.passed for check in result.checks)
    names = {check.name for check in result.checks}
    assert {"circuit enthalpy", "oil temperature"} <= names
    assert "grease temperature" not in names
    # Half a litre of oil a minute takes most of a rear bearing's heat, air a quarter of a front one's.
    assert result.circuits["R1.lubrication"].heat > 0.5 * result.bearings["R1"].heat
    assert 0.5 < result.circuits["F1.lubrication"].heat < 0.3 * result.bearings["F1"].heat


def test_the_network_gives_the_oil_about_as_much(result, spec):
    network = solve_machine_network(build_machine_network(spec))
    for name in ("F1.lubrication", "R1.lubrication"):
        assert network.boundary_heat[name] == pytest.approx(result.circuits[name].heat, rel=0.1), name
    assert network.imbalance_relative < 1e-10


# Recordings' fast models have heat by table and ball rows of constant conductance.
TABLE = """
schema = "spindle-fem/machine/1"
base = "oiled.toml"
name = "tabled"
[heat]
model = "table"
[heat.table]
speed = ["0 rpm", "24000 rpm"]
heat = {F1 = ["0 W", "60 W"], F2 = ["0 W", "60 W"], R1 = ["0 W", "80 W"], R2 = ["0 W", "80 W"]}
[[bearing_set]]
name = "front"
ball_row = {kind = "constant", conductance = "3 W/K"}
[[bearing_set]]
name = "rear"
ball_row = {kind = "constant", conductance = "3 W/K"}
"""


def test_the_fast_model_settles_where_the_elements_do(tmp_path):
    oiled(tmp_path)
    path = tmp_path / "tabled.toml"
    path.write_text(TABLE, encoding="utf-8")
    machine = prepare_machine(load_machine(str(path), SMALL))
    spec = with_parameters(machine.spec, {"film.R1.lubrication": 0.6})
    fast = fast_spindle(reduced_model_of(machine.spec), machine.spec)
    point = replace(OperatingPoint.of(machine.spec), ambient_temperature=293.15)
    full = solve_coupled(prepare_machine(spec), point)
    times = np.linspace(0.0, 4.0e6, 4000)
    given = (point.speed, point.thrust, 293.15, point.coolant_inlet_temperature, point.coolant_flow)
    drive = make_drive(
        times, STANDARD, np.tile(given, (times.size, 1)), np.ones(len(STANDARD), bool), largest_step=1e4
    )
    run = simulate_fast(fast, drive, 293.15, parameters={"film.R1.lubrication": 0.6})
    outlet = circuit_outlets(machine, full.solution, full.loads)["R1.lubrication"]
    assert run.temperature[-1, fast.channels.index("OIL_OUT")] == pytest.approx(outlet, abs=0.02)


def test_a_transient_balances_and_reads_the_oil_at_each_speed(machine):
    start = start_from(solve_coupled(machine, OperatingPoint.of(machine.spec)))
    inputs = InputHistory.constant(np.array([0.0, 600.0]), {"speed": 0.0, "thrust": 0.0})
    run = simulate_full(
        machine, inputs, sample_times=[0.0, 600.0], start=start, options=TransientOptions(error=0.2)
    )
    assert run.energy.imbalance_relative < 1e-8
    column = [probe.name for probe in machine.spec.probe].index("OIL_OUT")
    assert run.readings[1, column] < run.readings[0, column]


def test_oil_neither_fouls_nor_churns_as_grease(spec):
    view = view_of(MachineNames.of(spec), at_the_defined_point(spec))
    assert not any("lubrication" in candidate.component for candidate in CoolantFilm().forms(view))
    churning = {candidate.component for candidate in GreaseChurning().forms(view)}
    assert not churning
    assert not any("raceway" in name for films in view.films.values() for name in films)
