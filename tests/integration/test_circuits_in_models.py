"""A bore and a jacket with coolants of their own in elements, network, fast model, sweep and transient."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.effects.catalogue.coolant_film import CoolantFilm
from spindle_fem.machine.view.build_view import view_of
from spindle_fem.machine.view.defined_point import at_the_defined_point
from spindle_fem.machine.view.machine_names import MachineNames
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.model.reduced.build_reduced import reduced_model_of
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.operation.circuits import duct_flow
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.results.run_summary import build_summary
from spindle_fem.solvers.coupled_steady import circuit_outlets, solve_coupled
from spindle_fem.solvers.machine_network_steady import solve_machine_network
from spindle_fem.solvers.machine_transient import TransientOptions, simulate_full, start_from
from spindle_fem.solvers.prepared_machine import machine_on_mesh, prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared
from spindle_fem.studies.sweep.evaluate_design import row_of, solve_checked
from spindle_fem.studies.sweep.fast_backend import GroupTask, answer_tasks, model_of
from spindle_fem.studies.sweep.prepared_study import prepare_study
from tests.support.valid_definition import VALID

SMALL = ["mesh.preset=coarse", "mesh.order=1"]
BORED = """
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
inlet_temperature = "12 degC"
flow = "0.5 L/min"
factor = {value = 1.0, sigma_rel = 0.3}
[[probe]]
name = "BORE_OUT"
kind = "circuit_outlet"
circuit = "bore"
"""
# A sleeve round the housing of the small valid machine, 5 mm of water between them.
JACKET = """
[[part]]
name = "jacket"
material = "steel"
segment = [
    {name = "sleeve", z = ["24 mm", "92 mm"], inner_diameter = "160 mm", outer_diameter = "180 mm"},
    {name = "foot", z = ["92 mm", "104 mm"], inner_diameter = "150 mm", outer_diameter = "180 mm"},
]
[[joint]]
name = "foot"
conductance = "5000 W/m**2/K"
contacts = ["housing|jacket"]
[[film]]
kind = "circuit"
name = "stator"
duct = "annulus"
part = "housing"
outer_part = "jacket"
diameter = "150 mm"
outer_diameter = "160 mm"
z = ["24 mm", "92 mm"]
flows_to = "front"
cells = 4
fluid = "water"
inlet_temperature = "15 degC"
flow = "1 L/min"
"""


def heat_of(summary, name):
    energy = summary["energy"]["heat_out_W"]
    return sum(heat for surface, heat in energy.items() if surface.startswith(f"{name}."))


@pytest.fixture(scope="module")
def definition(tmp_path_factory):
    path = tmp_path_factory.mktemp("bored") / "bored.toml"
    path.write_text(BORED, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def spec(definition):
    return load_machine(str(definition), SMALL)


@pytest.fixture(scope="module")
def machine(spec):
    return prepare_machine(spec)


@pytest.fixture(scope="module")
def result(machine):
    return solve_prepared(machine)


@pytest.fixture(scope="module")
def fast(spec):
    return fast_spindle(reduced_model_of(spec), spec)


def test_what_the_bore_gives_the_coolant_carries_away(result, spec):
    summary = build_summary(result, 0.0, 0.0)
    bore = summary["circuits"]["bore"]
    rate = duct_flow(spec.circuits[0]).capacity_rate
    assert bore["heat_W"] == pytest.approx(heat_of(summary, "bore"), rel=1e-12)
    assert bore["heat_W"] == pytest.approx(rate * (bore["outlet_degC"] - 12.0), rel=1e-8)
    assert summary["probes"]["BORE_OUT"] == bore["outlet_degC"] > 14.0
    assert all(check.passed for check in result.checks)
    assert any(check.name == "circuit enthalpy" for check in result.checks)
    coolant = [float(result.fluid_temperature[name].mean()) for name in spec.circuits[0].surface]
    assert np.all(np.diff(coolant) > 0.0)


def test_the_network_gives_the_bore_about_as_much(result, spec):
    network = solve_machine_network(build_machine_network(spec))
    assert network.boundary_heat["bore"] == pytest.approx(result.circuits["bore"].heat, rel=0.06)
    assert network.imbalance_relative < 1e-10


@pytest.mark.parametrize("factors", [{}, {"film.bore": 0.4}])
def test_the_fast_model_settles_where_the_elements_do(machine, fast, factors):
    changed = with_parameters(machine.spec, factors)
    point = replace(OperatingPoint.of(machine.spec), ambient_temperature=293.15)
    full = solve_coupled(machine_on_mesh(changed, machine.mesh, machine.operators), point)
    times = np.linspace(0.0, 4.0e6, 4000)
    given = (point.speed, point.thrust, 293.15, point.coolant_inlet_temperature, point.coolant_flow)
    values = np.tile(given, (times.size, 1))
    held = np.ones(len(STANDARD), dtype=bool)
    run = simulate_fast(
        fast, make_drive(times, STANDARD, values, held, largest_step=1.0e4), 293.15, parameters=factors
    )
    outlet = circuit_outlets(machine, full.solution, full.loads)["bore"]
    assert run.temperature[-1, fast.channels.index("BORE_OUT")] == pytest.approx(outlet, abs=2e-3)
    state = machine.field_state(full.solution.temperature, {})
    for name in ("F1.inner_raceway", "R2.inner_raceway", "bore.1", "bore.8"):
        expected = machine.builder.surface_mean(name, state)
        assert fast.model.place(name) @ run.states[-1] == pytest.approx(expected, abs=5e-3), name


def test_derivatives_to_the_factor_of_the_bore_are_those_of_differences(spec, fast):
    point, step = OperatingPoint.of(spec), 1e-5
    exact = fast.operators(point, fast.table.factors({"film.bore": 1.0}), ["film.bore"])
    ends = [fast.operators(point, fast.table.factors({"film.bore": np.exp(s * step)})) for s in (1, -1)]
    for name in ("conduction", "loads", "outputs", "output_inputs"):
        difference = (getattr(ends[0], name) - getattr(ends[1], name)) / (2.0 * step)
        assert getattr(exact, f"{name}_by")["film.bore"] == pytest.approx(
            difference, abs=1e-7 * np.abs(difference).max()
        ), name


def test_a_change_of_the_walls_is_the_difference_of_both(spec, fast):
    point, changes = OperatingPoint.of(spec), {f"film.{name}": 0.5 for name in spec.circuits[0].surface}
    whole = [fast.operators(point, {}, changes=own) for own in (changes, {})]
    found = fast.change(point, {}, (changes, {}), ({}, {}))
    for name in ("conduction", "loads", "outputs", "output_inputs"):
        expected = getattr(whole[0], name) - getattr(whole[1], name)
        assert getattr(found, name) == pytest.approx(expected, abs=1e-12 * np.abs(expected).max()), name


def test_a_transient_balances_and_reads_the_outlet(machine):
    start = start_from(solve_coupled(machine, OperatingPoint.of(machine.spec)))
    inputs = InputHistory.constant(np.array([0.0, 600.0]), {"speed": 0.0, "thrust": 0.0})
    run = simulate_full(
        machine, inputs, sample_times=[0.0, 600.0], start=start, options=TransientOptions(error=0.2)
    )
    assert run.energy.imbalance_relative < 1e-8
    outlet = run.readings[:, [probe.name for probe in machine.spec.probe].index("BORE_OUT")]
    settled = circuit_outlets(machine, *_solved(machine))["bore"]
    assert outlet[0] == pytest.approx(settled, abs=1e-5)
    assert outlet[1] < outlet[0]


WARM = 293.15


def test_every_model_takes_a_recorded_inlet(machine, fast):
    film = machine.spec.circuits[0]
    point = replace(OperatingPoint.of(machine.spec), beside={film.inlet_input: WARM})
    full = solve_coupled(machine, point)
    heat = sum(full.solution.balance.films[name] for name in film.surface)
    outlet = WARM + heat / duct_flow(film).capacity_rate
    network = solve_machine_network(build_machine_network(machine.spec), point)
    assert network.boundary_heat["bore"] == pytest.approx(heat, rel=0.06)
    # warmer water takes less
    assert heat < 0.8 * _heat(machine, solve_coupled(machine, OperatingPoint.of(machine.spec)))
    run = _driven(fast, point, np.linspace(0.0, 4.0e6, 4000), 1.0e4)
    assert run.temperature[-1, fast.channels.index("BORE_OUT")] == pytest.approx(outlet, abs=2e-3)
    state = machine.field_state(full.solution.temperature, {})
    for name in ("F1.inner_raceway", "bore.1", "bore.8"):
        expected = machine.builder.surface_mean(name, state)
        assert fast.model.place(name) @ run.states[-1] == pytest.approx(expected, abs=5e-3), name


def test_transients_follow_a_recorded_inlet(machine, fast):
    film, point = machine.spec.circuits[0], OperatingPoint.of(machine.spec)
    start = start_from(solve_coupled(machine, point))
    times = np.linspace(0.0, 1800.0, 61)
    inputs = InputHistory.constant(
        times[[0, -1]], {"speed": point.speed, "thrust": point.thrust, film.inlet_input: WARM}
    )
    run = simulate_full(
        machine, inputs, sample_times=[0.0, 900.0, 1800.0], start=start, options=TransientOptions(error=0.05)
    )
    assert run.energy.imbalance_relative < 1e-8
    column = [probe.name for probe in machine.spec.probe].index("BORE_OUT")
    settled = _driven(fast, point, np.linspace(0.0, 4.0e6, 4000), 1.0e4)
    warm = replace(point, beside={film.inlet_input: WARM})
    quick = _driven(fast, warm, times, 60.0, start=settled.states[-1])
    found = quick.temperature[[0, 30, 60], fast.channels.index("BORE_OUT")]
    assert run.readings[:, column] == pytest.approx(found, abs=0.03)
    assert run.readings[0, column] > circuit_outlets(machine, *_solved(machine))["bore"] + 5.0


def _heat(machine, found):
    return sum(found.solution.balance.films[name] for name in machine.spec.circuits[0].surface)


def _driven(fast, point, times, step, start=293.15):
    given = (point.speed, point.thrust, point.ambient_temperature)
    given = (*given, point.coolant_inlet_temperature, point.coolant_flow, *point.beside.values())
    names = (*STANDARD, *point.beside)
    drive = make_drive(
        times, names, np.tile(given, (times.size, 1)), np.ones(len(names), dtype=bool), largest_step=step
    )
    return simulate_fast(fast, drive, start)


def _solved(machine):
    found = solve_coupled(machine, OperatingPoint.of(machine.spec))
    return found.solution, found.loads


def test_a_sweep_over_the_flow_of_the_bore_has_what_full_solves_have(definition, tmp_path):
    outputs = ["temperature.max_degC", "probes.BORE_OUT", "energy.heat_out_W.bore.1"]
    study = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "film.bore.flow"
low = "{low} L/min"
high = "{high} L/min"
[[parameter]]
path = "film.bore.inlet_temperature"
low = "12 degC"
high = "16 degC"
[study]
design = "latin_hypercube"
size = {size}
outputs = {outputs}
"""
    prepared = []
    for low, high, size in ((0.4, 2.2, 16), (0.9, 1.4, 2)):
        path = tmp_path / f"{size}.toml"
        path.write_text(study.format(low=low, high=high, size=size, outputs=outputs), encoding="utf-8")
        prepared.append(prepare_study(str(definition), path, SMALL))
    wide, others = prepared
    model, _, tables = model_of(GroupTask(wide.tasks, wide.tasks), wide.question)
    rows = answer_tasks(model, tables, others.tasks, others.question)
    # Those that it leaves, for its careful estimate of its error, are solved in full.
    assert rows
    for row in rows:
        task = next(task for task in others.tasks if task.key == row["key"])
        exact = row_of(task, others.question, solve_checked(task))
        assert {name: row[name] for name in outputs} == pytest.approx(
            {name: exact[name] for name in outputs}, abs=0.02
        )


def test_a_diagnosis_may_find_the_bore_fouled(spec):
    view = view_of(MachineNames.of(spec), at_the_defined_point(spec))
    found = {candidate.component: candidate for candidate in CoolantFilm().forms(view)}
    assert found["bore"].amplitude == "film.bore"
    assert "bore" not in view.films.get("shaft", ())
    assert not any(name.startswith("film.bore") for films in view.films.values() for name in films)


def test_a_jacket_warms_along_both_of_its_walls(tmp_path):
    path = tmp_path / "jacket.toml"
    outside = 'name = "housing.outside"\npart = "housing"'
    text = VALID.replace(outside, outside.replace('"housing"', '"jacket"'), 1)
    path.write_text(text + JACKET, encoding="utf-8")
    spec = load_machine(str(path), [*SMALL, "channel.ports=none"])
    result = solve_prepared(prepare_machine(spec))
    circuit, film = result.circuits["stator"], spec.circuits[0]
    rise = circuit.outlet_temperature - film.inlet_temperature
    assert circuit.heat == pytest.approx(duct_flow(film).capacity_rate * rise, rel=1e-8)
    inner, outer = (
        [float(result.fluid_temperature[f"stator.{side}.{n}"].mean()) for n in range(1, 5)]
        for side in ("inner", "outer")
    )
    assert inner == pytest.approx(outer, abs=1e-12)
    assert np.all(np.diff(inner) > 0.0)
