"""What a pump drives through the reference channel: by hand, and as every model is told."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import FaultsError, OutOfValidityError
from spindle_fem.machine.geometry.coolant_path import INLET_STEP, CoolantPath, delivered_flow
from spindle_fem.machine.view.defined_point import at_the_defined_point
from spindle_fem.model.reduced.drive import drive_of_recording
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.pump import Pump
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.recordings.standard_inputs import standard_inputs
from spindle_fem.solvers.input_history import OperatingHistory

LITRE_PER_MINUTE = 1e-3 / 60.0
LIMITED = "coolant.pressure_limit=2 bar"
CURVE = 'coolant.pump_curve={flow=["0 L/min","30 L/min"],pressure=["6 bar","0 bar"]}'


def test_laminar_loss_of_the_reference_channel_by_hand():
    # Oil VG 32 at 15 °C: 20 L/min through 12 x 10 mm is 2.78 m/s; D = 10.909 mm, Re = 292 on 103.8 mm²/s.
    # f = 57.31/292 = 0.1963 straight; Dean 292 √0.0483 = 64.2 raises it by White's 1.336 to 0.262.
    # 0.262 · 3.552/0.010909 · 874/2 · 2.778² = 2.88 bar.
    path = CoolantPath.of(load_machine("wu_tan_2016"))
    drop = path.pressure_drop(20.0 * LITRE_PER_MINUTE, 288.15)
    assert drop.reynolds == pytest.approx(292.0, rel=2e-3)
    assert drop.channel == pytest.approx(2.88e5, rel=5e-3)


def test_turbulent_loss_of_the_reference_channel_by_hand():
    # Water at 20 °C, 60 L/min: 8.333 m/s, Re = 8.333 · 0.010909/1.004e-6 = 9.05e4,
    # f = 0.3164/17.35 + 0.03 √0.0483 = 0.0182 + 0.0066 = 0.0248: 0.0248 · 325.6 · 998/2 · 8.333² = 2.80 bar.
    machine = load_machine("wu_tan_2016", ["coolant.fluid=water", "coolant.film_model=helical"])
    drop = CoolantPath.of(machine).pressure_drop(60.0 * LITRE_PER_MINUTE, 293.15)
    assert drop.reynolds == pytest.approx(9.05e4, rel=5e-3)
    assert drop.channel == pytest.approx(2.80e5, rel=1e-2)


@pytest.mark.parametrize("fluid", ["iso_vg_32", "water"])
def test_the_loss_grows_with_the_flow_through_every_regime(fluid):
    path = CoolantPath.of(load_machine("wu_tan_2016", [f"coolant.fluid={fluid}"]))
    drops = [path.pressure_drop(flow, 300.0).total for flow in np.geomspace(1e-7, 1e-2, 500)]
    assert np.all(np.diff(drops) > 0.0)


def test_a_relief_valve_holds_the_pressure():
    path = CoolantPath.of(load_machine("wu_tan_2016", [LIMITED]))
    flow = float(path.delivered(288.15))
    assert flow < path.pump.flow
    assert path.pressure_drop(flow, 288.15).total == pytest.approx(2e5, rel=1e-9)


def test_a_curve_is_met_where_it_crosses_the_channels():
    path = CoolantPath.of(load_machine("wu_tan_2016", [CURVE]))
    flow = float(path.delivered(288.15))
    by_hand = 6e5 * (1.0 - flow / (30.0 * LITRE_PER_MINUTE))
    assert path.pressure_drop(flow, 288.15).total == pytest.approx(by_hand, rel=1e-9)
    both = CoolantPath.of(load_machine("wu_tan_2016", [CURVE, LIMITED]))
    assert path.pump.pressure(flow) > 2e5
    assert float(both.delivered(288.15)) == pytest.approx(
        float(CoolantPath.of(load_machine("wu_tan_2016", [LIMITED])).delivered(288.15))
    )


def test_a_pump_that_suffices_gives_what_is_asked():
    assert delivered_flow(load_machine("wu_tan_2016", ["coolant.pressure_limit=6 bar"]), 288.15) == (
        pytest.approx(20.0 * LITRE_PER_MINUTE, rel=1e-15)
    )


def test_beyond_its_curve_a_pump_goes_on_falling():
    pump = Pump(4.0, curve_flow=(1.0, 2.0), curve_pressure=(6.0, 4.0))
    assert [pump.pressure(flow) for flow in (0.0, 1.5, 3.0, 4.0)] == [6.0, 5.0, 2.0, 0.0]
    assert pump.delivered(lambda flow: flow) == pytest.approx(8.0 / 3.0)


def test_cold_oil_flows_less_and_between_temperatures_as_at_them():
    machine = load_machine("wu_tan_2016", [LIMITED])
    inlets = np.linspace(283.15, 303.15, 97)
    flows = delivered_flow(machine, inlets)
    assert np.all(np.diff(flows) > 0.0)
    alone = [float(delivered_flow(machine, inlet)) for inlet in inlets]
    assert flows == pytest.approx(alone, rel=1e-4)
    assert np.diff(inlets)[0] < INLET_STEP


def test_every_model_is_told_the_flow_that_flows():
    machine = load_machine("wu_tan_2016", [LIMITED])
    flow = float(CoolantPath.of(machine).delivered(machine.coolant.inlet_temperature))
    assert OperatingPoint.of(machine).coolant_flow == flow
    assert standard_inputs(machine)["coolant_flow"] == flow


def history(machine, **inputs):
    columns = {name: np.asarray(values, dtype=float) for name, values in inputs.items()}
    values = np.column_stack(list(columns.values()))
    given = InputHistory(np.array([0.0, 100.0]), tuple(columns), values, np.zeros(len(columns), dtype=bool))
    return OperatingHistory.of(machine, given)


def test_a_history_follows_the_inlet_and_leaves_a_recorded_flow_alone():
    machine = load_machine("wu_tan_2016", [LIMITED])
    followed = history(machine, speed=[100.0, 100.0], coolant_inlet=[283.15, 303.15])
    for time, inlet in ((0.0, 283.15), (50.0, 293.15)):
        assert followed.at(time).coolant_flow == pytest.approx(float(delivered_flow(machine, inlet)))
    asked = machine.coolant.flow
    recorded = history(machine, speed=[100.0] * 2, coolant_inlet=[283.15] * 2, coolant_flow=[asked] * 2)
    assert recorded.at(0.0).coolant_flow == asked


def without(recording, name):
    keep = [column for column, own in enumerate(recording.input_names) if own != name]
    return replace(
        recording,
        input_names=tuple(recording.input_names[column] for column in keep),
        input_columns=tuple(recording.input_columns[column] for column in keep),
        inputs=recording.inputs[:, keep],
        held=recording.held[keep],
        input_units=tuple(recording.input_units[column] for column in keep),
    )


def test_a_recording_without_the_flow_has_the_pumps():
    machine = load_machine("wu_tan_2016", [LIMITED])
    recording = at_the_defined_point(machine)
    drive = drive_of_recording(machine, without(recording, "coolant_flow"))
    column = drive.names.index("coolant_flow")
    assert drive.start[:, column] == pytest.approx(OperatingPoint.of(machine).coolant_flow)
    assert any("as far as the pump drives it" in note for note in drive.notes)
    recorded = drive_of_recording(machine, recording)
    assert recorded.start[0, column] == pytest.approx(0.5 * OperatingPoint.of(machine).coolant_flow)


@pytest.mark.parametrize(
    ("curve", "what"),
    [
        ('{flow=["0 L/min","30 L/min"],pressure=["6 bar"]}', "pressure"),
        ('{flow=["30 L/min","0 L/min"],pressure=["6 bar","0 bar"]}', "do not all grow"),
        ('{flow=["0 L/min","30 L/min"],pressure=["1 bar","2 bar"]}', "do not all fall"),
    ],
)
def test_curves_that_are_none_are_refused(curve, what):
    with pytest.raises(FaultsError, match=what):
        load_machine("wu_tan_2016", [f"coolant.pump_curve={curve}"])


def test_a_pump_refuses_what_is_no_curve():
    with pytest.raises(OutOfValidityError, match="make no curve"):
        Pump(1.0, curve_flow=(0.0, 1.0), curve_pressure=(1.0, 2.0))
