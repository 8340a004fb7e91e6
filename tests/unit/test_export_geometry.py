"""A machine with geometry as a state space, on a spindle of one unknown per part; what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.machine_spec import HeatSource
from spindle_fem.machine.view.defined_point import at_the_defined_point
from spindle_fem.model.reduced.film_heat import FilmHeat, tabulated_machine
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.operation.friction_map import tabulate_friction
from spindle_fem.studies.export import export_machine as exported
from spindle_fem.studies.export.exported_files import file_writer
from spindle_fem.studies.export.geometry_export import geometry_state_space
from spindle_fem.studies.export.interpolation_axes import refined_axis
from spindle_fem.studies.export.portable_model import PortableModel
from spindle_fem.studies.export.source_export import source_loads
from spindle_fem.studies.export.state_space import ModelInput
from spindle_fem.units import ZERO_CELSIUS_K
from tests.support.lumped_spindle import RPM, drive_of, lumped_model, with_natural_film
from tests.support.stepped_model import c_readings_along, needs_compiler, readings_along, resolved_run

# Largest difference from simulate, K.
AGREEMENT = 1e-3
START = 22.0
TIMES = np.arange(0.0, 7200.0, 30.0)


@pytest.fixture(scope="module")
def space(fast):
    return geometry_state_space(fast, "lumped", 4500.0 * RPM)


def driven(**changes):
    """Speed, standstill and another flow, with thrust, air and inlet that move."""
    speed = np.where(TIMES < 3000.0, 3000.0, np.where(TIMES < 5000.0, 0.0, 1234.0))
    inputs = {
        "ambient": 293.15 + np.sin(TIMES / 1000.0),
        "inlet": 290.15 + np.cos(TIMES / 700.0),
        "thrust": 1000.0 + 0.1 * TIMES,
        "flow": np.where(TIMES < 4000.0, 20.0, 14.0) / 60e3,
    }
    return drive_of(TIMES, speed, **inputs | changes)


@pytest.fixture(scope="module")
def drive():
    return driven()


@pytest.fixture(scope="module")
def simulated(fast, drive):
    return resolved_run(fast, drive, START + ZERO_CELSIUS_K).temperature[1:] - ZERO_CELSIUS_K


def test_agrees_with_simulate(space, drive, simulated):
    found = readings_along(space.model(), drive, {0: START})
    assert np.abs(found - simulated).max() < AGREEMENT


def test_settles_with_heat_in_balance(space, fast):
    model = space.model()
    inputs = {"speed": 3000.0 * RPM, "coolant_inlet": 17.0, "ambient": 17.0}
    model.settle(inputs)
    rises = model.read(inputs) - 17.0
    model.settle({**inputs, "coolant_inlet": 20.0, "ambient": 20.0})
    # The same heat above surroundings that are 3 K warmer; films know the coolant's temperature.
    assert model.read({**inputs, "coolant_inlet": 20.0, "ambient": 20.0}) - 20.0 == pytest.approx(
        rises, rel=0.02
    )
    conduction, load, _, _ = model.matrices(model.vector(inputs))
    assert conduction @ model.arrays["uniform"] == pytest.approx(load[:, :2].sum(axis=1), abs=1e-6)


@needs_compiler
def test_c_agrees_with_python(space, drive, tmp_path):
    path = tmp_path / "model.c"
    file_writer(path)(space, path)
    found = c_readings_along(tmp_path, "lumped", space.model(), drive, START)
    np.testing.assert_allclose(found, readings_along(space.model(), drive, {0: START}), rtol=0.0, atol=1e-9)


def test_names_inputs_beyond_its_range(space):
    model = space.model()
    assert model.step(1.0, {"speed": 9000.0 * RPM, "coolant_flow": 0.0}) == ["coolant_flow", "speed"]


def test_files_hold_it_all(space, tmp_path):
    path = tmp_path / "model.npz"
    file_writer(path)(space, path)
    read = PortableModel.load(path)
    assert read.header == space.header
    assert all(np.array_equal(read.arrays[name], values) for name, values in space.arrays.items())


def agrees(fast, drive):
    """Whether an exported model reads along a drive what simulate does; the export, its readings."""
    told = resolved_run(fast, drive, START + ZERO_CELSIUS_K).temperature[1:] - ZERO_CELSIUS_K
    space = geometry_state_space(fast, "lumped", 4500.0 * RPM)
    found = readings_along(space.model(), drive, {0: START})
    assert np.abs(found - told).max() < AGREEMENT
    return space, found


@pytest.fixture(scope="module")
def turning():
    """A spindle cooled by water that turns turbulent at about the definition's flow."""
    changes = ["coolant.fluid=water", "coolant.film_model=helical", "coolant.flow=5 L/min"]
    spec = load_machine("recorded_spindle", changes)
    return fast_spindle(lumped_model(spec), spec)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("litres", "inlet"),
    [
        (5.7, 294.15),
        (6.5, 287.15),
        (4.0, 297.15),
        (5.0 + np.sin(TIMES / 1100.0), 290.15 + np.cos(TIMES / 700.0)),
    ],
    ids=["near", "cold", "slow", "back_and_forth"],
)
def test_a_film_that_turns_turbulent_over_flow_and_inlet_is_that_of_simulate(turning, litres, inlet):
    model = agrees(turning, driven(flow=litres / 60e3, inlet=inlet))[0].model()
    # the films bend at one Reynolds number, along no line of flow or inlet
    assert model.header["table_inputs"]["coolant"] == [-1, model.inputs.index("coolant_inlet")]


@pytest.mark.slow
@needs_compiler
def test_c_scales_the_flow_as_python_does(turning, tmp_path):
    space, path = geometry_state_space(turning, "lumped", 4500.0 * RPM), tmp_path / "model.c"
    file_writer(path)(space, path)
    drive = driven(flow=5.7 / 60e3)
    found = c_readings_along(tmp_path, "lumped", space.model(), drive, START)
    np.testing.assert_allclose(found, readings_along(space.model(), drive, {0: START}), rtol=0.0, atol=1e-9)


@pytest.fixture(scope="module")
def warmed():
    """A spindle whose film in the channel follows the wall."""
    spec = load_machine("recorded_spindle", ["coolant.properties_at=bulk"])
    return fast_spindle(lumped_model(spec), spec)


@pytest.mark.slow
@needs_compiler
def test_a_film_follows_the_wall(warmed, drive, tmp_path):
    space, path = geometry_state_space(warmed, "lumped", 4500.0 * RPM), tmp_path / "model.c"
    model = space.model()
    told = resolved_run(warmed, drive, START + ZERO_CELSIUS_K).temperature[1:] - ZERO_CELSIUS_K
    found = readings_along(model, drive, {0: START})
    assert np.abs(found - told).max() < AGREEMENT
    file_writer(path)(space, path)
    in_c = c_readings_along(tmp_path, "lumped", model, drive, START)
    np.testing.assert_allclose(in_c, found, rtol=0.0, atol=1e-9)


@needs_compiler
def test_natural_films_follow_their_walls(fast, drive, tmp_path):
    natural = with_natural_film(fast)
    space, found = agrees(natural, drive)
    model = space.model()
    inputs = {"speed": 3000.0 * RPM, "ambient": 23.0, "coolant_inlet": 17.0}
    model.settle(inputs)
    settled = model.read(inputs)
    model.step(3600.0, inputs)
    assert model.read(inputs) == pytest.approx(settled, abs=1e-6)
    path = tmp_path / "model.c"
    file_writer(path)(space, path)
    in_c = c_readings_along(tmp_path, "lumped", model, drive, START)
    np.testing.assert_allclose(in_c, found, rtol=0.0, atol=1e-7)


def test_the_range_holds_a_recording(fast, spec, monkeypatch):
    asked = []
    monkeypatch.setattr(
        exported, "fast_model_for", lambda spec, recordings, **options: asked.append(recordings)
    )
    monkeypatch.setattr(exported, "geometry_state_space", lambda fast, name, highest, effects: highest)
    plain = exported.machine_state_space("recorded_spindle")
    faster = spec.operation.model_copy(update={"speed": 2.0 * plain})
    recording = at_the_defined_point(spec.model_copy(update={"operation": faster}))
    highest = exported.machine_state_space("recorded_spindle", (), [recording])
    assert asked == [(), [recording]]
    assert highest == pytest.approx(np.abs(recording.inputs[:, recording.input_names.index("speed")]).max())
    assert highest > 1.9 * plain


def with_sources(fast, *sources):
    changed = fast.spec.model_copy(update={"source": tuple(HeatSource(**source) for source in sources)})
    return fast_spindle(fast.model, changed)


def with_input(drive, name, values):
    """A drive with one more input, (G,), held over each step."""
    start, end = (np.column_stack((old, values)) for old in (drive.start, drive.end))
    return replace(drive, names=(*drive.names, name), start=start, end=end)


@needs_compiler
def test_sources_are_inputs_or_tables_and_windings_follow_the_torque(fast, drive, tmp_path):
    iron = {"speed": ["0 rpm", "4500 rpm"], "heat": ["0 W", "90 W"]}
    motor = {"copper_loss": "80 W", "rated_torque": "10 N*m"}
    table = {
        "speed": ["0 rpm", "2000 rpm", "8000 rpm"],
        "thrust": ["1200 N", "1500 N"],
        "heat": ["10 W", "90 W", "80 W", "0 W", "50 W", "90 W"],
    }
    heated = with_sources(
        fast,
        {"name": "rotor", "part": "shaft", "input": "motor_power", "gain": "0.1 W/W", "heat": "12 W"},
        {"name": "seal", "part": "housing", "heat": "20 W"},
        {"name": "belt", "part": "shaft", "heat": table},
        {"name": "windings", "part": "shaft", **motor},
        {"name": "motor", "part": "housing", **motor, "heat": iron},
    )
    loaded = with_input(drive, "torque", np.linspace(0.0, 18.0, drive.steps.size))
    power = with_input(loaded, "motor_power", np.linspace(400.0, 900.0, drive.steps.size))
    space, path = geometry_state_space(heated, "lumped", 4500.0 * RPM), tmp_path / "model.c"
    model = space.model()
    told = resolved_run(heated, power, START + ZERO_CELSIUS_K).temperature[1:] - ZERO_CELSIUS_K
    named = {item["name"]: (item["unit"], item["default"]) for item in model.header["inputs"]}
    assert (named["motor_power"], named["heat.seal"]) == (("W", pytest.approx(120.0)), ("W", 20.0))
    (torque,) = (item for item in model.header["inputs"] if item["name"] == "torque")
    assert (torque["unit"], torque["high"]) == ("N*m", 20.0)
    every = with_input(power, "heat.seal", np.full(drive.steps.size, 20.0))
    found = readings_along(model, every, {0: START})
    assert np.abs(found - told).max() < AGREEMENT
    file_writer(path)(space, path)
    in_c = c_readings_along(tmp_path, "lumped", model, every, START)
    np.testing.assert_allclose(in_c, found, rtol=0.0, atol=1e-9)


def test_a_source_without_its_quantity_gives_what_the_definition_says(fast):
    standard = [ModelInput("speed", "rad/s", 1.0, 0.0, 9.0), ModelInput("thrust", "N", 1.0, 0.0, 9.0)]
    source = {"name": "rotor", "part": "shaft", "input": "motor_power", "gain": "0.1 W/W", "heat": "12 W"}
    heated = with_sources(fast, {**source, "name": "stator", "heat": None}, source)
    found = source_loads(heated.spec, standard)
    (power,) = found.inputs
    assert (power.name, power.unit, power.default) == ("motor_power", "W", pytest.approx(120.0))
    assert [(load.input, load.gain) for load in found.powers] == [(2, 0.1), (2, 0.1)]
    table = {"speed": ["0 rpm", "1 rpm"], "heat": ["0 W", "1 W"]}
    (note,) = source_loads(with_sources(fast, {**source, "heat": table}).spec, standard).notes
    assert "its own heat" in note


@pytest.mark.slow
def test_friction_and_ball_rows_follow_their_films():
    spec = load_machine("wu_tan_2016", ["coolant.properties_at=inlet"])
    friction = tabulate_friction(spec, 4500.0 * RPM, (1000.0, 1750.0))
    table = tabulated_machine(spec, friction)
    fast = fast_spindle(lumped_model(table), table, (FilmHeat(friction, spec, table),))
    # Simulate takes one thrust and steps of 1 K of the inlet for its operators, which here follow both.
    agrees(fast, driven(inlet=290.15, thrust=1300.0))


def test_axes_are_refined_at_bends_and_jumps():
    found = refined_axis(lambda x: np.array([1.0 if x == 0.0 else 2.0 + x**2]), 0.0, 1.0, 1e-3)
    assert found[1] < 1e-5
    middle = 0.5 * (found[1:-1] + found[2:])
    between = 2.0 + 0.5 * (found[1:-1] ** 2 + found[2:] ** 2)
    assert np.abs(between / (2.0 + middle**2) - 1.0).max() <= 1e-3
