"""Heat sources of a definition: what may be written, what each gives, and that every model takes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine, write_machine
from spindle_fem.effects.catalogue.source_scale import SourceScaleTerm
from spindle_fem.errors import BadInputError
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.operation.operating_limits import operation_warnings
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.recordings.recordable_names import recordable_names
from spindle_fem.recordings.source_heat import source_heat
from spindle_fem.solvers.input_history import OperatingHistory
from spindle_fem.solvers.machine_network_steady import solve_machine_network
from spindle_fem.studies.crosscheck.axisymmetric import solve_axisymmetric
from spindle_fem.studies.solve_machine import solve
from tests.support.lumped_spindle import drive_of, lumped_model

RPM = np.pi / 30.0
ROTOR = """
[[source]]
name = "rotor"
part = "shaft.drive_end"
heat = {speed = ["0 rpm", "8000 rpm"], heat = ["0 W", "120 W"]}
"""
SEAL = """
[[source]]
name = "seal"
surface = "cover.labyrinth"
heat = "20 W"
"""


def machine(tmp_path, text: str, base: str = "small_two_start", overrides: tuple[str, ...] = ()):
    path = tmp_path / "machine.toml"
    path.write_text(f'schema = "spindle-fem/machine/1"\nbase = "{base}"\nname = "heated"\n{text}')
    return load_machine(path, overrides)


def table(tmp_path, text: str):
    return machine(tmp_path, f'[[source]]\nname = "motor"\npart = "shaft"\n{text}').source[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('part = "shafft"\nheat = "1 W"', 'motor.part: "shafft".*Did you mean "shaft"'),
        ('part = "shaft.nos"\nheat = "1 W"', 'Did you mean "shaft.nose"'),
        ('surface = "cover.labyrint"\nheat = "1 W"', 'Did you mean "cover.labyrinth"'),
        ('part = "shaft"\nsurface = "cover.labyrinth"\nheat = "1 W"', "part: is given beside surface"),
        ('heat = "1 W"', "part: is missing"),
        ('part = "shaft"', "heat: is missing"),
        ('part = "shaft"\nheat = "1 W"\ngain = "2 W/W"', "gain: is given"),
        ('part = "shaft"\nheat = "1 N"', "heat"),
        (
            'part = "shaft"\nheat = {speed = ["0 rpm", "1 rpm"], heat = ["1 W"]}',
            "Allowed: 2, as many as speed",
        ),
        ('part = "shaft"\nheat = {speed = ["1 rpm", "0 rpm"], heat = ["1 W", "1 W"]}', "do not all grow"),
    ],
)
def test_a_source_that_says_too_little_or_too_much_is_refused(tmp_path, text: str, message: str) -> None:
    with pytest.raises(BadInputError, match=message):
        machine(tmp_path, f'[[source]]\nname = "motor"\n{text}')


def test_two_sources_of_one_name_are_refused(tmp_path) -> None:
    with pytest.raises(BadInputError, match='source: the name "seal" is used 2 times'):
        machine(tmp_path, '[[source]]\nname = "a"\npart = "shaft"\nheat = "1 W"' + 2 * SEAL)


def test_a_written_machine_keeps_its_sources(tmp_path) -> None:
    spec = machine(tmp_path, ROTOR + SEAL + 'input = "motor_power"\ngain = "0.1 W/W"\n')
    (tmp_path / "again.toml").write_text(write_machine(spec))
    assert load_machine(tmp_path / "again.toml").source == spec.source


def test_a_table_is_linear_in_speed_and_thrust_and_holds_its_ends(tmp_path) -> None:
    by_speed = table(tmp_path, 'heat = {speed = ["100 rad/s", "300 rad/s"], heat = ["10 W", "30 W"]}')
    speeds = np.array([0.0, 100.0, -200.0, 400.0])
    inputs = {"speed": speeds, "thrust": np.zeros(4)}
    assert source_heat(by_speed, inputs) == pytest.approx([10.0, 10.0, 20.0, 30.0])
    both = table(
        tmp_path,
        'heat = {speed = ["0 rad/s", "100 rad/s"], thrust = ["0 N", "1 kN"], '
        'heat = ["0 W", "10 W", "0 W", "30 W"]}',
    )
    found = source_heat(both, {"speed": np.array([50.0, 100.0, 50.0]), "thrust": np.array([0.0, 500.0, 2e3])})
    assert found == pytest.approx([5.0, 20.0, 15.0])


def test_windings_follow_the_square_of_the_torque_and_iron_the_speed(tmp_path) -> None:
    text = (
        'copper_loss = "600 W"\nrated_torque = "40 N*m"\n'
        'heat = {speed = ["0 rpm", "12000 rpm"], heat = ["0 W", "360 W"]}'
    )
    motor = table(tmp_path, text + '\n[operation]\ntorque = "20 N*m"')
    by_hand = 600.0 * 0.25 + 360.0 * 8000.0 / 12000.0
    assert source_heat(motor, {"speed": 8000.0 * RPM, "thrust": 0.0}) == pytest.approx(by_hand)
    recorded = {"speed": np.full(3, 12000.0 * RPM), "thrust": 0.0, "torque": np.array([0.0, -40.0, 80.0])}
    assert source_heat(motor, recorded) == pytest.approx([360.0, 960.0, 2760.0])
    # 10 kW at 1500 rpm are 63.7 N m.
    power = table(tmp_path, text + '\n[operation]\nspeed = "1500 rpm"\npower = "10 kW"')
    torque = 10.0e3 / (1500.0 * RPM)
    assert source_heat(power, {"speed": 0.0, "thrust": 0.0}) == pytest.approx(600.0 * (torque / 40.0) ** 2)


def test_a_table_over_speed_and_torque_is_linear_in_both(tmp_path) -> None:
    motor = table(
        tmp_path,
        'heat = {speed = ["0 rad/s", "100 rad/s"], torque = ["0 N*m", "10 N*m"], '
        'heat = ["0 W", "20 W", "50 W", "90 W"]}\n[operation]\ntorque = "5 N*m"',
    )
    inputs = {"speed": np.array([0.0, 50.0, -100.0]), "thrust": 0.0}
    assert source_heat(motor, inputs) == pytest.approx([25.0, 40.0, 55.0])
    assert source_heat(motor, inputs | {"torque": 30.0}) == pytest.approx([50.0, 70.0, 90.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('copper_loss = "1 W"', "rated_torque: is missing"),
        ('rated_torque = "1 N*m"\nheat = "1 W"', "copper_loss: is missing"),
        ('copper_loss = "1 W"\nrated_torque = "4 N*m"', "motor.heat: follows the torque.*operation.torque"),
        ('copper_loss = "1 W"\nrated_torque = "4 N"', "rated_torque"),
        ('heat = "1 W"\n[operation]\ntorque = "1 N*m"\npower = "1 W"', "power: is given beside torque"),
        ('heat = "1 W"\n[operation]\nspeed = "0 rpm"\npower = "1 W"', "power: is given at rest"),
    ],
)
def test_a_load_that_says_too_little_or_too_much_is_refused(tmp_path, text: str, message: str) -> None:
    with pytest.raises(BadInputError, match=message):
        table(tmp_path, text)


def test_a_load_that_no_heat_follows_is_warned_of(tmp_path) -> None:
    load = '[operation]\ntorque = "10 N*m"\n'
    (warning,) = operation_warnings(machine(tmp_path, load + ROTOR), 100.0)
    assert warning.code == "load_unused"
    assert "operation.torque has no user" in warning.text
    motor = '[[source]]\nname = "motor"\npart = "shaft"\ncopper_loss = "10 W"\nrated_torque = "5 N*m"\n'
    assert not operation_warnings(machine(tmp_path, load + motor), 100.0)
    assert not operation_warnings(machine(tmp_path, ROTOR), 100.0)


def test_a_changed_torque_reaches_the_windings_of_every_model(tmp_path) -> None:
    motor = '[[source]]\nname = "motor"\npart = "shaft"\ncopper_loss = "100 W"\nrated_torque = "10 N*m"\n'
    text = '[operation]\ntorque = "10 N*m"\n' + motor
    spec = machine(tmp_path, text, "recorded_spindle", overrides=("operation.torque=5 N*m",))
    again = type(spec).model_validate(spec.model_dump(mode="json", by_alias=True))
    assert again.source[0].usual_torque == spec.source[0].usual_torque == 5.0
    state = solve_machine_network(build_machine_network(spec))
    plain = solve_machine_network(build_machine_network(machine(tmp_path, "", "recorded_spindle")))
    given = dict.fromkeys(("heat",), state.heat_in - plain.heat_in)
    assert given["heat"] == pytest.approx(25.0, abs=0.5)
    times = np.arange(0.0, 1200.0, 60.0)
    drive = drive_of(times, np.full(times.size, 1500.0))
    column = np.full((times.size - 1, 1), 20.0)
    start, end = (np.hstack((values, column)) for values in (drive.start, drive.end))
    loaded = replace(drive, names=(*drive.names, "torque"), start=start, end=end)
    given = motor.replace('copper_loss = "100 W"\nrated_torque = "10 N*m"', 'heat = "400 W"')
    fixed = machine(tmp_path, given, "recorded_spindle")
    found = simulate_fast(fast_spindle(lumped_model(spec), spec), loaded, 293.15)
    expected = simulate_fast(fast_spindle(lumped_model(fixed), fixed), drive, 293.15)
    assert found.temperature == pytest.approx(expected.temperature, abs=1e-9)


def test_what_is_recorded_comes_before_the_definition(tmp_path) -> None:
    source = table(tmp_path, 'heat = "7 W"\ninput = "motor_power"\ngain = "0.1 kW/kW"')
    inputs = {"speed": 0.0, "thrust": 0.0}
    assert source_heat(source, inputs) == 7.0
    assert source_heat(source, inputs | {"motor_power": 300.0}) == pytest.approx(30.0)
    assert source_heat(source, inputs | {"motor_power": 300.0, "heat.motor": 4.0}) == 4.0


def test_every_steady_model_takes_the_same_heat(tmp_path) -> None:
    spec = machine(
        tmp_path, ROTOR + SEAL, overrides=("heat.model=table", "mesh.preset=coarse", "mesh.order=1")
    )
    given = sum(source_heat(source, {"speed": spec.operation.speed, "thrust": 0.0}) for source in spec.source)
    assert given == pytest.approx(140.0)
    result = solve(spec)
    heat_in = result.energy.heat_in_by
    assert (heat_in["source.rotor"], heat_in["source.seal"]) == pytest.approx((120.0, 20.0), rel=1e-12)
    assert abs(result.energy.imbalance_relative) < 1e-8
    state = solve_machine_network(build_machine_network(spec, refinement=2))
    assert state.heat_in == pytest.approx(result.energy.heat_in, rel=1e-12)
    elements = solve_axisymmetric(state)
    assert abs(elements.residual_relative) < 1e-8
    warmest = state.temperature.max()
    assert result.temperature_maximum == pytest.approx(warmest, abs=0.03 * (warmest - 295.0))


def test_the_fast_model_marches_with_a_source_as_with_the_same_heat_recorded(tmp_path) -> None:
    spec = machine(tmp_path, "", "recorded_spindle")
    motor = '[[source]]\nname = "motor"\npart = "shaft"\ninput = "motor_power"\ngain = "0.1 W/W"\n'
    heated = machine(tmp_path, motor, "recorded_spindle")
    times = np.arange(0.0, 1200.0, 60.0)
    power = np.where(times < 600.0, 500.0, 0.0)
    plain = drive_of(times, np.full(times.size, 1500.0))
    column = 0.5 * (power[:-1] + power[1:])[:, None]

    def with_input(name: str, scale: float):
        start, end = (np.hstack((values, scale * column)) for values in (plain.start, plain.end))
        return replace(plain, names=(*plain.names, name), start=start, end=end)

    as_heat = simulate_fast(fast_spindle(lumped_model(spec), spec), with_input("heat.shaft", 0.1), 293.15)
    model = fast_spindle(lumped_model(heated), heated)
    followed = simulate_fast(model, with_input("motor_power", 1.0), 293.15)
    assert followed.temperature == pytest.approx(as_heat.temperature, abs=1e-9)
    cold = simulate_fast(model, plain, 293.15)
    assert np.abs(followed.temperature - cold.temperature).max() > 0.05


def test_the_full_model_knows_the_inputs_that_sources_follow(tmp_path) -> None:
    spec = machine(tmp_path, SEAL + 'input = "motor_power"\ngain = "0.1 W/W"\n')
    names = ("speed", "motor_power", "heat.shaft", "heat.seal")
    inputs = InputHistory(np.array([0.0, 1.0]), names, np.ones((2, 4)), np.zeros(4, dtype=bool))
    history = OperatingHistory.of(spec, inputs)
    assert [term.name for term in history.given_heat()] == ["heat.shaft"]
    assert history.at(0.5).inputs["motor_power"] == 1.0
    assert source_heat(spec.source[0], history.at(0.5).inputs) == 1.0
    with pytest.raises(BadInputError, match="motor_power"):
        OperatingHistory.of(load_machine("small_two_start"), inputs)


def test_recordings_may_drive_the_torque_of_windings(tmp_path) -> None:
    motor = '[[source]]\nname = "motor"\npart = "shaft"\ncopper_loss = "100 W"\nrated_torque = "10 N*m"\n'
    spec = machine(tmp_path, '[operation]\ntorque = "10 N*m"\n' + motor)
    assert recordable_names(tmp_path / "machine.toml").inputs["torque"] == "N*m"
    inputs = InputHistory(
        np.array([0.0, 1.0]), ("speed", "torque"), np.array([[1.0, 0.0], [1.0, 8.0]]), np.zeros(2, dtype=bool)
    )
    halfway = OperatingHistory.of(spec, inputs).at(0.5)
    assert source_heat(spec.source[0], halfway.inputs) == pytest.approx(16.0)
    with pytest.raises(BadInputError, match="torque"):
        OperatingHistory.of(load_machine("small_two_start"), inputs)


def test_a_scaled_source_is_one_of_other_heat(tmp_path) -> None:
    text = '[[source]]\nname = "motor"\npart = "shaft"\nheat = "%s W"\n'
    spec, more = (machine(tmp_path, text % heat, "recorded_spindle") for heat in ("80", "120"))
    drive = drive_of(np.arange(0.0, 1200.0, 60.0), np.full(20, 1500.0))
    term = SourceScaleTerm("scaled", spec.source[0])
    found = simulate_fast(
        fast_spindle(lumped_model(spec), spec),
        drive,
        293.15,
        parameters={"scaled.factor": 1.5},
        terms=(term,),
    )
    expected = simulate_fast(fast_spindle(lumped_model(more), more), drive, 293.15)
    assert found.temperature == pytest.approx(expected.temperature, abs=1e-9)
    plain = simulate_fast(fast_spindle(lumped_model(spec), spec), drive, 293.15)
    assert np.abs(found.temperature - plain.temperature).max() > 0.05
