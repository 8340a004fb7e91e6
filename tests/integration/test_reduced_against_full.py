"""The reduced model of a meshed machine against the full model, and the way to its files."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.sparse.linalg import splu, spsolve

from spindle_fem.commands.simulate_command import simulate_machine
from spindle_fem.definition.load import load_machine
from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.search_basis import on_smaller_bases
from spindle_fem.machine.view.place_names import ACROSS, UP
from spindle_fem.model.reduced import build_reduced as building
from spindle_fem.model.reduced.build_reduced import ReductionOptions, reduced_model_of
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.model.reduced.mesh_model import build_mesh_model
from spindle_fem.model.reduced.recorded_model import fast_model_for
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.coupled_steady import solve_coupled
from spindle_fem.solvers.machine_transient import TransientOptions, simulate_full
from spindle_fem.solvers.prepared_machine import machine_on_mesh
from spindle_fem.units import Uncertain

ROOT = Path(__file__).parents[2]
RPM = np.pi / 30.0
OVERRIDES = ("mesh.preset=coarse", "mesh.order=1")
HELD = np.array([True, True, False, False, True])
FLOW = 20.0e-3 / 60.0


@pytest.fixture(scope="module")
def machine(small):
    return small


@pytest.fixture(scope="module")
def on_mesh(machine):
    return build_mesh_model(machine)


@pytest.fixture(scope="module")
def fast(small_fast):
    return small_fast


def history(times, speed, ambient, inlet):
    columns = [speed, 1750.0, ambient, inlet, FLOW]
    return np.column_stack([np.broadcast_to(np.asarray(c, dtype=float), times.shape) for c in columns])


def test_its_own_check_is_within_what_was_asked(fast):
    assert fast.model.errors["probes"] <= ReductionOptions().error
    assert fast.model.size <= ReductionOptions().largest


@pytest.mark.slow
def test_what_a_check_misses_is_solved_as_closely_as_the_probes_ask(monkeypatch, tmp_path):
    """What joins the basis of this small spindle by its energy alone leaves a probe 7 mK off."""
    monkeypatch.setenv("SPINDLE_FEM_CACHE", str(tmp_path))
    small = load_machine(ROOT / "validation" / "hardening" / "spindle.toml", OVERRIDES[:1])
    assert fast_model_for(small, []).model.errors["probes"] <= ReductionOptions().error


def test_every_operator_conserves_heat(machine, on_mesh):
    one = np.ones(on_mesh.size)
    for name, matrix in zip(on_mesh.coefficient_names, on_mesh.operators, strict=True):
        leaving = matrix @ one
        if name in on_mesh.fluid_names:
            surface = name.removeprefix("film.")
            area = machine.operators.surface_area(surface)
            assert leaving.sum() == pytest.approx(area, rel=1e-12), name
        else:
            assert np.abs(leaving).max() < 1e-12 * np.abs(matrix).max(), name
    assert on_mesh.cell_load.sum() == pytest.approx(on_mesh.cell_area.sum(), rel=1e-12)


def test_reduced_operators_are_positive_and_hold_the_uniform_field(fast):
    model = fast.model
    for name, matrix in zip(model.coefficient_names, model.operators, strict=True):
        values = np.linalg.eigvalsh(matrix)
        assert values[0] > -1e-9 * max(values[-1], 1e-300), name
    assert model.probes @ model.one == pytest.approx(1.0, abs=1e-9)
    sided = np.array([name.startswith((UP, ACROSS)) for name in model.place_names])
    assert model.places[~sided] @ model.one == pytest.approx(1.0, abs=1e-9)
    assert model.places[sided] @ model.one == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("speed", "inlet", "factors"),
    [
        (3000.0, 288.15, {}),
        (4500.0, 303.15, {"joint.rear_outer_ring_seats": 0.5, "film.outside": 1.6, "heat.front": 1.15}),
    ],
)
def test_its_steady_state_is_that_of_the_coupled_full_model(machine, fast, speed, inlet, factors):
    point = replace(
        OperatingPoint.of(machine.spec),
        speed=speed * RPM,
        coolant_inlet_temperature=inlet,
        ambient_temperature=293.15,
        coolant_flow=FLOW,
    )
    spec = with_parameters(machine.spec, factors)
    full = solve_coupled(machine_on_mesh(spec, machine.mesh, machine.operators), point)
    times = np.linspace(0.0, 4.0e6, 8000)
    values = history(times, speed * RPM, 293.15, inlet)
    drive = make_drive(times, STANDARD, values, HELD, largest_step=1.0e4)
    run = simulate_fast(fast, drive, 293.15, parameters=factors)
    outlet = full.coolant.march.march.mixed_outlet_temperature
    assert run.temperature[-1, fast.channels.index("COOLANT_OUT")] == pytest.approx(outlet, abs=2e-3)
    state = machine.field_state(full.solution.temperature, {})
    for name in ("F1.inner_raceway", "F2.outer_raceway", "R2.inner_raceway", "housing.gap", "shaft.nose_end"):
        expected = machine.builder.surface_mean(name, state)
        assert fast.model.place(name) @ run.states[-1] == pytest.approx(expected, abs=5e-3), name


@pytest.mark.parametrize(
    ("seats", "factor"),
    [
        ("F1", 0.05),
        ("R2", 4.0),
        pytest.param("F2", 0.26, marks=pytest.mark.slow),
        pytest.param("F1 F2 F3", 0.1, marks=pytest.mark.slow),
    ],
    ids=lambda v: str(v),
)
def test_a_seat_that_alone_is_worse_moves_the_probes_as_in_the_full_model(
    machine, on_mesh, fast, seats, factor
):
    model = fast.model
    point = replace(OperatingPoint.of(machine.spec), speed=3000.0 * RPM)
    film = fast.channel.film(point, {})[0]
    raceways = [f"{name}.{side}_raceway" for name in fast.bearings for side in ("inner", "outer")]
    loads = 80.0 * sum(on_mesh.place(name) for name in raceways)
    reduced_loads = 80.0 * sum(model.place(name) for name in raceways)
    scaled = {f"joint.{seat}.outer_ring|housing": factor for seat in seats.split()}
    read = []
    for factors in ({}, scaled):
        values = {name: value * factors.get(name, 1.0) for name, value in fast.table.base(point).items()}
        full = spsolve(on_mesh.conduction(values, film).tocsc(), loads)
        own = np.array([values[name] for name in model.coefficient_names])
        matrix = np.tensordot(own, model.operators, axes=1) + np.tensordot(film, model.cell_film, axes=1)
        read.append((on_mesh.probes @ full, model.probes @ np.linalg.solve(matrix, reduced_loads)))
    change, reduced_change = (after - before for before, after in zip(*read, strict=True))
    assert np.abs(change).max() > 0.1
    assert np.abs(reduced_change - change).max() < 0.03 * np.abs(change).max()


def test_ring_spot_and_sides_stand_for_heat_on_a_part_of_the_housing(machine, on_mesh, fast):
    """72° of the top, 60 mm long, above the probe: at rest and while the heat changes."""
    values = fast.table.base(point := OperatingPoint.of(machine.spec))
    capacity = on_mesh.capacity(fast.table.capacities())
    conduction = on_mesh.conduction(values, fast.channel.film(point, {})[0])
    x, y, z = machine.operators.mesh.points[: on_mesh.n_unknowns].T
    on_top = (np.hypot(x, y) > 0.149) & (np.abs(np.arctan2(x, y)) < np.pi / 5) & (abs(z - 0.29) < 0.03)
    heat = np.zeros(on_mesh.size)
    heat[: on_mesh.n_unknowns] = on_top / on_top.sum()
    places = ("around.SP04", "near.SP04", f"{UP}housing.middle_body")
    wanted, offered = [], []
    for shift in (0.0, 3.0e-4, 1.0e-3):
        solve = splu((conduction + shift * capacity).tocsc()).solve
        wanted.append(on_mesh.probes @ solve(heat))
        offered.append(on_mesh.probes @ solve(np.column_stack([on_mesh.place(name) for name in places])))
    wanted, offered = np.concatenate(wanted), np.concatenate(offered)
    left = {}
    for number in (1, 3):
        amplitudes = np.linalg.lstsq(offered[:, :number], wanted, rcond=None)[0]
        left[number] = np.abs(wanted - offered[:, :number] @ amplitudes).max() / np.abs(wanted).max()
    assert left[1] > 0.1
    assert left[3] < 0.03
    # Ring and spot share the heat, known to a tenth; the side adds none.
    assert amplitudes[:2].sum() == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("length", "swing", "step"),
    [(0.1, 0.25, 20.0), pytest.param(1.0, 3.0, None, marks=pytest.mark.slow)],
    ids=["short, even steps", "long, steps by their error"],
)
def test_it_follows_the_full_transient_within_a_fiftieth_of_a_kelvin(machine, fast, length, swing, step):
    end = 5400.0 * length
    times = np.arange(0.0, end + 1.0, 20.0)
    switched = [times < length * instant for instant in (600, 2400, 4200)]
    speed = RPM * np.select(switched, [0.0, 3000.0, 4500.0], 500.0)
    values = history(times, speed, 293.15 + 1e-4 * times, 290.0 + 0.5 * np.sin(times / 1000.0))
    inputs = InputHistory(times, STANDARD, values, HELD)
    samples = np.arange(0.0, end + 1.0, 60.0)
    full = simulate_full(
        machine, inputs, sample_times=samples, options=TransientOptions(error=0.01, fixed_step=step)
    )
    run = simulate_fast(fast, make_drive(times, STANDARD, values, HELD), 293.15)
    for probe in full.probes:
        reduced = run.temperature[::3, fast.channels.index(probe)][: len(samples)]
        assert np.abs(reduced - full.reading(probe)).max() < 0.02, probe
    assert np.ptp(full.reading("SP05")) > swing


def test_it_is_found_again_in_the_cache(machine, fast, monkeypatch, tmp_path):
    monkeypatch.setenv("SPINDLE_FEM_CACHE", str(tmp_path))
    made, meshed = [], []

    def build(spec, full, options, **more):
        made.append(spec)
        model = replace(fast.model, digest=building.reduced_digest(spec, options.key(spec)))
        return building.Reduction(model, np.zeros((2, 1), dtype=np.float32))

    def prepare(spec, **more):
        meshed.append(spec)
        return replace(machine, spec=spec)

    monkeypatch.setattr(building, "prepare_machine", prepare)
    monkeypatch.setattr(building, "build_reduced_model", build)
    spec, options = machine.spec, ReductionOptions()
    first, again = reduced_model_of(spec), reduced_model_of(spec)
    assert made == [spec]
    assert np.array_equal(first.operators, again.operators)
    # a machine with other coefficients, within the range of the first and beyond it
    near, far = (with_parameters(spec, {"film.outside": factor}) for factor in (1.02, 50.0))
    assert reduced_model_of(near, as_given=True).digest == first.digest
    assert made == [spec]
    assert reduced_model_of(far, as_given=True).digest != first.digest
    assert reduced_model_of(near).digest != first.digest
    assert made == [spec, far, near]
    # heat that differs leaves the range of the coefficients as it was; a smaller error was not checked
    front, rear = spec.bearing_set
    warmer = front.model_copy(update={"heat_factor": Uncertain(1.2, front.heat_factor.sigma_log)})
    heated = spec.model_copy(update={"bearing_set": (warmer, rear)})
    assert reduced_model_of(heated).digest != building.reduced_digest(heated, options.key(heated))
    assert made == [spec, far, near]
    assert reduced_model_of(heated, options=replace(options, error=1e-4)).digest != first.digest
    assert made == [spec, far, near, heated]
    # the operators of the family are kept too, but for those of one whose geometry differs
    assert meshed == [spec]


@pytest.fixture(scope="module")
def made(fast, recorded_in, tmp_path_factory):
    """A recording of a spindle whose rear bearings make 15 % more heat than the definition says."""
    times = np.arange(0.0, 9000.0, 30.0)
    speed = np.where((times > 600) & (times < 6000), 3000.0, 0.0)
    values = history(times, speed * RPM, 293.15, OperatingPoint.of(fast.spec).coolant_inlet_temperature)
    exact = simulate_fast(
        fast, make_drive(times, STANDARD, values, HELD), 293.15, parameters={"heat.rear": 1.15}
    ).temperature
    noise = np.random.default_rng(3).normal(0.0, 0.1, exact.shape)
    read = exact + noise - 273.15
    frame = pd.DataFrame({"time": times, "n": speed, "room": 20.0})
    frame["rear seat"] = read[:, fast.channels.index("SP05")]
    frame["oil"] = read[:, fast.channels.index("COOLANT_OUT")]
    temperatures, inputs = {"rear seat": "SP05", "oil": "COOLANT_OUT"}, {"n": "speed", "room": "ambient"}
    return recorded_in(tmp_path_factory.mktemp("made"), frame, temperatures, inputs)


def test_simulate_writes_what_every_channel_should_have_read(fast, made, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "spindle_fem.model.reduced.recorded_model.reduced_model_of", lambda spec, **options: fast.model
    )
    folder = tmp_path / "out"
    plain = simulate_machine("recorded_spindle", made, folder, overrides=OVERRIDES)
    assert json.loads((folder / "simulation.json").read_text())["channels"] == plain["channels"]
    table = pd.read_csv(folder / "simulated.csv")
    assert list(table.columns) == ["time_s", "rear seat", "oil"]
    assert len(table) == 300
    assert not (folder / "calibrated_machine.toml").exists()
    assert (folder / "figures" / "residual_rear_seat.png").stat().st_size > 10_000
    assert any('"thrust" is not recorded' in note for note in plain["notes"])
    errors = {row["channel"]: row["rmse_K"] for row in plain["channels"]}
    assert errors["rear seat"] > 0.3
    fitted = simulate_machine("recorded_spindle", made, folder, calibrate=[made], overrides=OVERRIDES)
    errors = {row["channel"]: row["rmse_K"] for row in fitted["channels"]}
    assert errors["rear seat"] < 0.12
    assert 0.84 < fitted["channels"][0]["inside_90_percent_interval"] < 0.97
    rear = next(item for item in fitted["calibration"]["parameters"] if item["name"] == "heat.rear")
    assert rear["low"] < 1.15 < rear["high"]
    # The written machine predicts the same without a fit of its own.
    again = simulate_machine(folder / "calibrated_machine.toml", made, tmp_path / "again")
    assert again["channels"][0]["rmse_K"] == pytest.approx(errors["rear seat"], abs=2e-3)


def test_the_basis_of_a_search_holds_what_a_single_seat_changes(fast, made):
    recording = read_recording(made)
    predictor = Predictor(fast, [recording], [np.ones(recording.times.size, dtype=bool)])
    parameters = [prior.name for prior in predictor.uncertain()]
    places = [name for name in fast.model.place_names if name.endswith("_raceway")]
    seats = [f"joint.{name}.outer_ring|housing" for name in ("R1", "R2")]
    with_seats, without = (
        on_smaller_bases(predictor, parameters, places, seats)[0],
        on_smaller_bases(predictor, parameters, places)[0],
    )
    assert without.fast.model.size < with_seats.fast.model.size < fast.model.size
    errors = []
    for seat in seats:
        change, found, missed = (
            own.predict(0, {seat: 0.05}).temperature - own.predict(0, {}).temperature
            for own in (predictor, with_seats, without)
        )
        assert np.abs(change).max() > 0.1
        errors.append([np.abs(found - change).max(), np.abs(missed - change).max()])
    with_error, without_error = np.max(errors, axis=0)
    assert with_error < 0.03
    assert without_error > 2.0 * with_error


def test_speeds_beyond_the_table_get_a_range_of_their_own(fast, monkeypatch):
    asked = []

    def remember(spec, *, options, as_given, progress):
        asked.append(options)
        return fast.model

    monkeypatch.setattr("spindle_fem.model.reduced.recorded_model.reduced_model_of", remember)
    for speed in (4000.0, 6000.0):
        given = {"input_names": ("speed",), "input_units": ("rad/s",), "inputs": np.array([[speed * RPM]])}
        recording = SimpleNamespace(source="made", **given)
        fast_model_for(fast.spec, [recording])
    assert asked[0].highest_speed is None
    assert asked[1].highest_speed == pytest.approx(6000.0 * RPM)
