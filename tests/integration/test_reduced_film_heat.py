"""A machine with analytical friction in the fast model, against the full model and through its files."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.commands.simulate_command import simulate_machine
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import SpecError
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.model.reduced.film_heat import FilmHeat
from spindle_fem.model.reduced.recorded_model import fast_model_for
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.operation.bearing_heat import at_assembly_size
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.machine_transient import TransientOptions, simulate_full
from spindle_fem.solvers.prepared_machine import prepare_machine

RPM = np.pi / 30.0
OVERRIDES = ("mesh.preset=coarse", "mesh.order=1")
HELD = np.array([True, True, False, False, True])
TIMES = np.arange(0.0, 2401.0, 20.0)
SPEED = RPM * np.where(TIMES < 1200.0, 3000.0, 1000.0)


def at_speeds(speed):
    """What the fast model asks of a recording."""
    return SimpleNamespace(
        source="speeds", input_names=("speed",), input_units=("rad/s",), inputs=speed[:, None]
    )


@pytest.fixture(scope="module")
def spec():
    return load_machine("wu_tan_2016", OVERRIDES)


@pytest.fixture(scope="module")
def fast(spec):
    return fast_model_for(spec, [at_speeds(SPEED)])


def driven(spec):
    """The definition's operating point, and the standard inputs over ``TIMES``."""
    point = OperatingPoint.of(spec)
    columns = (SPEED, 1750.0, point.ambient_temperature, point.coolant_inlet_temperature, point.coolant_flow)
    columns = [np.broadcast_to(np.asarray(c, dtype=float), TIMES.shape) for c in columns]
    return point, np.column_stack(columns)


def test_expansion_is_refused_with_a_way_out(spec):
    follows = spec.model_copy(update={"heat": spec.heat.model_copy(update={"thermal_preload": True})})
    with pytest.raises(SpecError, match=r"every ring.*heat.thermal_preload=false.*spindle-fem simulate"):
        fast_model_for(follows, [])


@pytest.mark.slow
def test_it_follows_the_full_model_whose_friction_follows_its_films(spec, fast):
    point, values = driven(spec)
    full = simulate_full(
        prepare_machine(at_assembly_size(spec)),
        InputHistory(TIMES, STANDARD, values, HELD),
        sample_times=TIMES[::3],
        options=TransientOptions(error=0.01),
    )
    drive = make_drive(TIMES, STANDARD, values, HELD)
    run = simulate_fast(fast, drive, point.ambient_temperature)
    for probe in full.probes:
        reduced = run.temperature[::3, fast.channels.index(probe)]
        assert np.abs(reduced - full.reading(probe)).max() < 0.05, probe
    # Without the term the same heat table errs visibly.
    plain = fast_spindle(fast.model, fast.spec)
    cold = simulate_fast(plain, drive, point.ambient_temperature)
    row = fast.channels.index("SP01")
    assert np.abs(cold.temperature[::3, row] - full.reading("SP01")).max() > 0.05


@pytest.mark.slow
def test_a_spindle_on_rollers_follows_its_full_model():
    spec = load_machine("belt_lathe", OVERRIDES)
    point = OperatingPoint.of(spec)
    speed = RPM * np.where(TIMES < 1200.0, 2500.0, 1200.0)
    columns = (speed, point.thrust, point.ambient_temperature, point.coolant_inlet_temperature, 0.0)
    values = np.column_stack([np.broadcast_to(np.asarray(c, dtype=float), TIMES.shape) for c in columns])
    fast = fast_model_for(spec, [at_speeds(speed)])
    run = simulate_fast(fast, make_drive(TIMES, STANDARD, values, HELD), point.ambient_temperature)
    full = simulate_full(
        prepare_machine(spec),
        InputHistory(TIMES, STANDARD, values, HELD),
        sample_times=TIMES[::6],
        options=TransientOptions(error=0.02),
    )
    for probe in full.probes:
        reduced = run.temperature[::6, fast.channels.index(probe)]
        assert np.ptp(full.reading(probe)) > 2.0
        assert np.abs(reduced - full.reading(probe)).max() < 0.1, probe


@pytest.mark.slow
def test_simulate_takes_it_and_a_calibrated_machine_keeps_its_heat_model(spec, fast, recorded_in, tmp_path):
    point, values = driven(spec)
    drive = make_drive(TIMES, STANDARD, values, HELD)
    made = simulate_fast(fast, drive, point.ambient_temperature).temperature
    frame = pd.DataFrame({"time": TIMES, "n": SPEED / RPM})
    noise = np.random.default_rng(5).normal(0.0, 0.1, TIMES.size)
    frame["rear seat"] = made[:, fast.channels.index("SP05")] - 273.15 + noise
    recorded_in(tmp_path, frame, {"rear seat": "SP05"}, {"n": "speed"})
    assembled = (*OVERRIDES, "heat.thermal_preload=false")
    found = simulate_machine(
        "wu_tan_2016", tmp_path, tmp_path / "out", calibrate=[tmp_path], overrides=assembled
    )
    assert found["channels"][0]["rmse_K"] < 0.12
    assert any('"full" friction and ball contacts from a map' in note for note in found["notes"])
    assert "preload_N" not in found
    written = load_machine(tmp_path / "out" / "calibrated_machine.toml")
    assert written.heat.model == "full"
    assert {group.ball_row.kind for group in written.bearing_set} == {"contact"}
    assert isinstance(fast.inputs.extra_terms[0], FilmHeat)
