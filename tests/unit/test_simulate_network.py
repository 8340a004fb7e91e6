"""A network machine on a recording: prediction, initial states, errors by condition, refusals."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from spindle_fem.definition.network_load import validate_network_machine
from spindle_fem.errors import FaultsError, RecordingError, SpecError
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.network_inputs import NetworkInputs
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.compare import compare, simulation_summary, write_simulated
from spindle_fem.recordings.conditions import operating_conditions
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.network_start import READ_SIGMA, initial_parameters, initial_state, magnitude_history
from tests.support.network_runs import modal_solution, run_on_recording
from tests.support.written_texts import network_text

MACHINE = network_text(
    "spindle on a bench",
    {"bearing": ("400 J/K", 0.3), "shaft": ("900 J/K", 0.3), "housing": ("3 kJ/K", 0.3)},
    {"bearing|housing": ("8 W/K", 0.3), "bearing|shaft": ("3 W/K", 0.3), "housing|ambient": ("4 W/K", 0.3)},
    [("bearing", "speed", ("80 W", 0.3), {"reference": "1000 rpm", "exponent": 1.5})],
)

MANIFEST = """
schema = "spindle-fem/recording/1"
name = "synthetic"
data = "data.csv"
time = {column = "time_s", unit = "s"}
[[channel]]
column = "T_bearing"
role = "temperature"
probe = "bearing"
unit = "degC"
sigma = 0.1
[[channel]]
column = "T_housing"
role = "temperature"
probe = "housing"
unit = "degC"
sigma = 0.1
[[channel]]
column = "room"
role = "input"
drives = "ambient"
unit = "degC"
[[channel]]
column = "rpm"
role = "input"
drives = "speed"
unit = "rpm"
hold = "previous"
"""


@pytest.fixture
def network():
    return build_network(validate_network_machine(tomllib.loads(MACHINE), "machine.toml").network)


def schedule(times):
    """Standstill, two speeds, the second backwards, and a cool-down."""
    return np.select([times < 300, times < 2000, times < 4000], [0.0, 1000.0, -3000.0], 0.0)


def make(folder, network, *, times=None, start=(295.0, 295.0, 295.0), noise=0.0, manifest=MANIFEST):
    times = np.arange(0.0, 6000.0, 10.0) if times is None else times
    speed, room = schedule(times), 22.0 + np.sin(times / 900.0)
    history = InputHistory(
        times,
        ("ambient", "speed"),
        np.column_stack([room + 273.15, np.abs(speed) * 2 * np.pi / 60]),
        [False, True],
    )
    truth = modal_solution(network, history, start) - 273.15
    random = np.random.default_rng(1)
    frame = pd.DataFrame(
        {
            "time_s": times,
            "T_bearing": truth[:, 0] + noise * random.standard_normal(times.size),
            "T_housing": truth[:, 2] + noise * random.standard_normal(times.size),
            "room": room,
            "rpm": speed,
        }
    )
    frame.to_csv(folder / "data.csv", index=False)
    (folder / "recording.toml").write_text(manifest)
    return read_recording(folder)


def test_prediction_reproduces_the_machine_that_made_the_recording(tmp_path, network):
    """The unread shaft starts in balance with the bearing, which it is here."""
    recording = make(tmp_path, network)
    result = run_on_recording(network, recording)
    assert_allclose(result.predicted, recording.temperature, atol=1e-6)
    assert result.notes == ('node "shaft" is not read',)
    assert compare(recording, result.predicted).row("T_bearing").rmse < 1e-6


def test_speed_counts_by_magnitude(tmp_path, network):
    recording = make(tmp_path, network)
    assert recording.inputs[:, 1].min() < 0.0
    assert magnitude_history(network, recording).values[:, 1].min() == 0.0


def test_missing_readings_do_not_stop_the_prediction(tmp_path, network):
    recording = make(tmp_path, network)
    frame = pd.read_csv(tmp_path / "data.csv")
    frame.loc[100:150, "T_bearing"] = np.nan
    frame.loc[200:210, "room"] = np.nan
    frame.drop(index=range(300, 320)).to_csv(tmp_path / "data.csv", index=False)
    holed = read_recording(tmp_path)
    predicted = run_on_recording(network, holed).predicted
    kept = np.isin(recording.times, holed.times)
    assert np.isfinite(predicted).all()
    # a straight line over 110 s of a room that swings by a degree in 1.5 h
    assert_allclose(predicted, recording.temperature[kept], atol=0.02)


def test_each_segment_starts_from_its_first_reading(tmp_path, network):
    times = np.concatenate([np.arange(0.0, 1000.0, 10.0), np.arange(90000.0, 91000.0, 10.0)])
    recording = make(tmp_path, network, times=times)
    assert len(recording.segments) == 2
    result = run_on_recording(network, recording)
    assert_allclose(result.predicted[100], recording.temperature[100], atol=1e-9)
    assert result.initial.shape == (2, 3)
    assert any("each starts from its first readings" in note for note in result.notes)


def test_initial_parameters_move_the_first_segment_only(tmp_path, network):
    times = np.concatenate([np.arange(0.0, 1000.0, 10.0), np.arange(90000.0, 91000.0, 10.0)])
    recording = make(tmp_path, network, times=times)
    start = initial_parameters(network, recording)
    assert [item.name for item in start] == ["initial.bearing", "initial.shaft", "initial.housing"]
    # noise of 0.1 K and what sensors err by on what is read, 5 K on the estimate of what is not
    read = float(np.hypot(0.1, READ_SIGMA))
    assert [item.sigma_log * item.value for item in start] == pytest.approx([read, 5.0, read])
    moved = tuple(replace(item, value=item.value + 10.0) for item in start)
    result = run_on_recording(network, recording, parameters=moved)
    assert_allclose(result.predicted[0], recording.temperature[0] + 10.0, atol=1e-9)
    assert_allclose(result.predicted[100], recording.temperature[100], atol=1e-9)
    assert np.all(result.sensitivity[100:] == 0.0)


def test_unread_node_starts_where_its_balance_is_zero(network):
    history = InputHistory.constant(np.array([0.0, 1.0]), {"ambient": 293.15, "speed": 0.0})
    state, _ = initial_state(network, history, {"shaft": 310.0, "housing": 300.0})
    # bearing between 8 W/K to 300 K and 3 W/K to 310 K, no heat
    assert state.tolist() == pytest.approx([(8 * 300.0 + 3 * 310.0) / 11, 310.0, 300.0])


def test_ambient_and_steady_starts(network):
    heat = 80.0 * 2.0**1.5
    history = InputHistory.constant(np.array([0.0, 1.0]), {"ambient": 293.15, "speed": 2000 * 2 * np.pi / 60})
    ambient, _ = initial_state(network, history, {}, kind="ambient")
    assert ambient.tolist() == [293.15] * 3
    steady, _ = initial_state(network, history, {}, kind="steady")
    housing = 293.15 + heat / 4.0
    assert steady.tolist() == pytest.approx([housing + heat / 8, housing + heat / 8, housing])
    with pytest.raises(SpecError, match='"warm" is unknown'):
        initial_state(network, history, {}, kind="warm")


@pytest.mark.parametrize("kind", ["first_reading", "ambient", "steady"])
def test_sensitivities_with_the_start_against_finite_differences(tmp_path, network, kind):
    recording = make(tmp_path, network, times=np.arange(0.0, 3000.0, 30.0), start=(310.0, 290.0, 300.0))
    extra = initial_parameters(network, recording) if kind == "first_reading" else ()
    parameters = network.parameters + extra
    derivative = run_on_recording(network, recording, parameters=parameters, initial=kind).sensitivity
    step = 1e-6
    for p, parameter in enumerate(parameters):
        shifted = []
        for sign in (1.0, -1.0):
            value = parameter.value * np.exp(sign * step)
            if parameter.kind == "initial":
                changed = tuple(
                    replace(i, value=value) if i.name == parameter.name else i for i in parameters
                )
                shifted.append(
                    run_on_recording(network, recording, parameters=changed, initial=kind).predicted
                )
            else:
                other = NetworkInputs(network).moved({parameter.name: np.exp(sign * step)})
                shifted.append(run_on_recording(other, recording, parameters=extra, initial=kind).predicted)
        numeric = (shifted[0] - shifted[1]) / (2 * step)
        assert_allclose(derivative[:, :, p], numeric, atol=2e-5 * max(1.0, np.abs(numeric).max()))


def test_unread_start_carries_its_dependence_on_parameters(tmp_path, network):
    """Without initial parameters the shaft's start follows the bearing and the conductances."""
    manifest = MANIFEST.replace('probe = "bearing"', 'probe = "shaft"')
    start = (320.0, 290.0, 300.0)
    recording = make(tmp_path, network, times=np.arange(0.0, 3000.0, 30.0), start=start, manifest=manifest)
    derivative = run_on_recording(network, recording, parameters=network.parameters).sensitivity
    step = 1e-6
    for p, parameter in enumerate(network.parameters):
        shifted = [
            run_on_recording(
                NetworkInputs(network).moved({parameter.name: np.exp(s * step)}), recording
            ).predicted
            for s in (1.0, -1.0)
        ]
        numeric = (shifted[0] - shifted[1]) / (2 * step)
        assert_allclose(derivative[:, :, p], numeric, atol=2e-5 * max(1.0, np.abs(numeric).max()))


def test_errors_by_channel_and_condition(tmp_path, network):
    recording = make(tmp_path, network)
    predicted = recording.temperature.copy()
    moving = np.abs(schedule(recording.times)) > 2000.0
    predicted[moving, 0] += 2.0
    comparison = compare(recording, predicted)
    row = comparison.row("T_bearing", "2750-3250 rpm")
    assert (row.readings, row.rmse, row.mean, row.largest) == (
        moving.sum(),
        pytest.approx(2.0),
        pytest.approx(-2.0),
        pytest.approx(-2.0),
    )
    assert comparison.row("T_bearing", "750-1250 rpm").rmse == pytest.approx(0.0, abs=1e-9)
    assert comparison.row("T_bearing").rmse == pytest.approx(2.0 * np.sqrt(moving.mean()))
    assert comparison.row("T_housing").rmse == pytest.approx(0.0, abs=1e-9)
    content = simulation_summary(comparison)
    assert content["schema"] == "spindle-fem/simulation/1"
    assert [item["channel"] for item in content["channels"]] == ["T_bearing", "T_housing"]
    assert set(content["channels"][0]) >= {"channel", "rmse_K", "noise_K"}


def test_flagged_readings_do_not_count(tmp_path, network):
    make(tmp_path, network, noise=0.05)
    frame = pd.read_csv(tmp_path / "data.csv")
    frame.loc[100, "T_bearing"] = 300.0
    frame.to_csv(tmp_path / "data.csv", index=False)
    recording = read_recording(tmp_path)
    comparison = compare(recording, run_on_recording(network, recording).predicted)
    assert comparison.row("T_bearing").readings == recording.times.size - 1
    assert comparison.row("T_bearing").rmse < 0.1


def test_conditions_of_a_run(tmp_path, network):
    recording = make(tmp_path, network, noise=0.05)
    conditions = operating_conditions(recording)
    assert conditions.names == (
        "standstill",
        "750-1250 rpm",
        "2750-3250 rpm",
        "heating",
        "cooling",
        "steady",
    )
    times = recording.times
    assert np.array_equal(conditions.of("standstill"), schedule(times) == 0.0)
    assert conditions.of("heating")[(times > 500) & (times < 900)].mean() > 0.9
    assert conditions.of("cooling")[(times > 4100) & (times < 4600)].all()
    assert not conditions.of("cooling")[times < 3900].any()
    trends = conditions.of("heating").astype(int) + conditions.of("cooling") + conditions.of("steady")
    assert np.all(trends == 1)


@pytest.mark.parametrize(
    "levels", [(2000.0, 4000.0, 6000.0), (1000.0, 8000.0), (333.0, 500.0, 2750.0, 3000.0)]
)
def test_a_speed_that_is_held_lies_in_one_band_whatever_its_jitter(tmp_path, network, levels):
    recording = make(tmp_path, network)
    steps = np.linspace(0, len(levels), recording.times.size, endpoint=False).astype(int)
    held = np.array(levels)[steps]
    jitter = np.where(np.arange(held.size) % 2 == 0, 1.0, -1.0)
    column = recording.input_names.index("speed")
    inputs = recording.inputs.copy()
    inputs[:, column] = (held + jitter) * np.pi / 30.0
    conditions = operating_conditions(replace(recording, inputs=inputs))
    for level in levels:
        owners = [
            name for name in conditions.names if "rpm" in name and conditions.of(name)[held == level].any()
        ]
        assert len(owners) == 1
        low, high = map(float, owners[0].removesuffix(" rpm").split("-"))
        assert low < level < high


def test_simulated_csv(tmp_path, network):
    recording = make(tmp_path, network)
    result = run_on_recording(network, recording)
    write_simulated(tmp_path / "simulated.csv", recording, result.predicted)
    frame = pd.read_csv(tmp_path / "simulated.csv")
    assert list(frame.columns) == ["time_s", "T_bearing", "T_housing"]
    assert_allclose(frame["time_s"], recording.times)
    assert_allclose(frame["T_housing"] + 273.15, result.predicted[:, 1], atol=1e-3)


def test_simulated_csv_keeps_fractions_of_long_times(tmp_path, network):
    times = 1.0e6 + np.cumsum(np.tile([0.3, 0.3, 0.4], 20))
    recording = make(tmp_path, network, times=times)
    write_simulated(tmp_path / "simulated.csv", recording, recording.temperature)
    frame = pd.read_csv(tmp_path / "simulated.csv")
    assert_allclose(frame["time_s"], times - times[0], atol=1e-6)
    assert frame["time_s"].diff().dropna().min() > 0.29


def test_channel_that_reads_nothing_has_no_error(tmp_path, network):
    make(tmp_path, network)
    frame = pd.read_csv(tmp_path / "data.csv")
    frame["T_housing"] = np.nan
    frame.to_csv(tmp_path / "data.csv", index=False)
    recording = read_recording(tmp_path)
    result = run_on_recording(network, recording)
    assert np.isfinite(result.predicted).all()
    content = simulation_summary(compare(recording, result.predicted))
    assert content["channels"][1]["rmse_K"] is None
    assert content["channels"][1]["readings"] == 0
    json.dumps(content, allow_nan=False)


def test_every_misfit_of_machine_and_recording_at_once(tmp_path, network):
    make(tmp_path, network)
    manifest = MANIFEST.replace('probe = "bearing"', 'probe = "bearng"')
    manifest = manifest.replace('drives = "ambient"', 'drives = "hall"')
    (tmp_path / "recording.toml").write_text(manifest)
    with pytest.raises(FaultsError) as caught:
        run_on_recording(network, read_recording(tmp_path))
    text = str(caught.value)
    assert len(caught.value.faults) == 2
    assert 'channel T_bearing: probe "bearng" is not a node of the machine. Did you mean "bearing"' in text
    assert 'no channel drives "ambient", which the machine needs. Give its channel' in text
    assert 'drives = "ambient"; driven: hall, speed.' in text


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('gain = {value = "80 W", sigma_rel = 0.3}\nreference = "1000 rpm"', 'gain = "80 W/W"', "is no heat"),
        ('reference = "1000 rpm"', 'reference = "1 kW"', "is no heat"),
        ('temperature = "ambient"', 'temperature = "speed"', '"ambient" but is no temperature'),
    ],
)  # fmt: skip
def test_units_of_machine_and_recording_must_agree(tmp_path, network, old, new, message):
    recording = make(tmp_path, network)
    assert old in MACHINE
    other = validate_network_machine(tomllib.loads(MACHINE.replace(old, new)), "machine.toml")
    with pytest.raises(FaultsError, match=message):
        run_on_recording(build_network(other.network), recording)


def test_prediction_of_another_shape_is_refused(tmp_path, network):
    recording = make(tmp_path, network)
    with pytest.raises(RecordingError, match="prediction of shape"):
        compare(recording, recording.temperature[:, :1])
    with pytest.raises(RecordingError, match="not finite"):
        compare(recording, np.full_like(recording.temperature, np.nan))
