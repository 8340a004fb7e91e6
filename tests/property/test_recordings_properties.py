"""What holds for every recording: row order, units and repeats do not change what is read."""

import tempfile
from pathlib import Path

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from spindle_fem.errors import BadInputError
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.channel_checks import temperature_flags, white_noise

MANIFEST = """
schema = "spindle-fem/recording/1"
name = "property"
data = "data.csv"
time = {{column = "t", unit = "{time}"}}
[[channel]]
column = "T"
role = "temperature"
probe = "SP01"
unit = "{unit}"
[[channel]]
column = "n"
role = "input"
drives = "speed"
unit = "rpm"
hold = "previous"
"""


def read(times, kelvin, speed, *, unit="K", time="s"):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "recording.toml").write_text(MANIFEST.format(unit=unit, time=time))
        lines = [
            f"{float(t)!r},{'' if np.isnan(k) else repr(float(k))},{float(n)!r}"
            for t, k, n in zip(times, kelvin, speed, strict=True)
        ]
        (folder / "data.csv").write_text("t,T,n\n" + "\n".join(lines) + "\n")
        return read_recording(folder)


@st.composite
def samples(draw):
    number = draw(st.integers(3, 40))
    steps = draw(st.lists(st.integers(1, 500), min_size=number, max_size=number))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    times = np.cumsum(steps).astype(float)
    kelvin = 295.0 + np.cumsum(random.normal(0, 0.2, number))
    kelvin[random.uniform(size=number) < 0.1] = np.nan
    kelvin[0] = 295.0
    return times, kelvin, np.round(random.uniform(0, 4000, number)), random


@settings(max_examples=40)
@given(samples())
def test_row_order_does_not_matter(data):
    times, kelvin, speed, random = data
    plain = read(times, kelvin, speed)
    order = random.permutation(times.size)
    mixed = read(times[order], kelvin[order], speed[order])
    assert_allclose(mixed.times, plain.times, atol=1e-9)
    assert_allclose(mixed.temperature, plain.temperature)
    assert_allclose(mixed.inputs, plain.inputs)
    assert np.array_equal(mixed.flags, plain.flags)
    # a row is out of order when a later stamp came before it
    assert mixed.defects.unordered_rows == sum(
        times[order][k] < times[order][:k].max() for k in range(1, times.size)
    )


@settings(max_examples=40)
@given(samples(), st.integers(1, 10))
def test_repeated_rows_change_nothing_but_their_count(data, repeats):
    times, kelvin, speed, random = data
    plain = read(times, kelvin, speed)
    again = np.concatenate([np.arange(times.size), random.integers(0, times.size, repeats)])
    doubled = read(times[again], kelvin[again], speed[again])
    assert_allclose(doubled.temperature, plain.temperature)
    assert_allclose(doubled.inputs, plain.inputs)
    assert doubled.defects.repeated_rows == repeats
    assert doubled.defects.conflicting_stamps == 0


@settings(max_examples=40)
@given(samples())
def test_units_do_not_matter(data):
    times, kelvin, speed, _ = data
    plain = read(times, kelvin, speed)
    for unit, values in (("degC", kelvin - 273.15), ("degF", (kelvin - 273.15) * 1.8 + 32.0)):
        other = read(times / 60.0, values, speed, unit=unit, time="min")
        assert_allclose(other.temperature, plain.temperature, atol=1e-9)
        assert_allclose(other.times, plain.times, atol=1e-6)


@settings(max_examples=40)
@given(samples())
def test_held_input_at_its_own_stamps_and_between(data):
    times, kelvin, speed, _ = data
    recording = read(times, kelvin, speed)
    rad = speed * 2.0 * np.pi / 60.0
    assert_allclose(recording.input_at("speed", recording.times), rad)
    middle = 0.5 * (recording.times[1:] + recording.times[:-1])
    assert_allclose(recording.input_at("speed", middle), rad[:-1])


PLAIN = "t,T,n\n" + "".join(f"{10 * k},{295 + 0.1 * k:.1f},{k % 3 * 100}\n" for k in range(12))
SCRAPS = [
    b"",
    b",",
    b"\n",
    b'"',
    b"\xff",
    b"\0",
    b"NaN",
    b"-",
    b"1e400",
    b"inf",
    b"text",
    b";",
    b"\r",
    b" ",
    b"2016-05-02",
]


@settings(max_examples=150)
@given(
    st.lists(st.tuples(st.integers(0, len(PLAIN)), st.integers(0, 8), st.sampled_from(SCRAPS)), max_size=4)
)
@example([(0, 0, b"\r")])
def test_damaged_files_are_read_or_refused_but_never_crash(damages):
    content = PLAIN.encode()
    for at, length, scrap in damages:
        content = content[:at] + scrap + content[at + length :]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "recording.toml").write_text(MANIFEST.format(unit="K", time="s"))
        (folder / "data.csv").write_bytes(content)
        recording, refusal = None, ""
        try:
            recording = read_recording(folder)
        except BadInputError as error:
            refusal = str(error)
        assert recording is not None or str(folder) in refusal
    if recording is None:
        return
    assert np.all(np.diff(recording.times) > 0.0)
    assert np.all(np.isfinite(recording.temperature[recording.usable]))
    assert np.all(np.isfinite(recording.input_history().values))
    assert recording.defects.lines()


@settings(max_examples=60)
@given(
    st.integers(5, 194),
    st.floats(4.0, 50.0),
    st.booleans(),
    st.floats(0.005, 0.15),
    st.integers(0, 2**32 - 1),
)
def test_one_spike_is_found_and_nothing_else(at, size, down, sigma, seed):
    random = np.random.default_rng(seed)
    values = 300.0 + 10.0 * np.sin(np.arange(200) / 30.0) + sigma * random.standard_normal(200)
    values[at] += -size if down else size
    flagged = np.flatnonzero(temperature_flags(values, sigma, 0.0, judge_stuck=True))
    assert flagged.tolist() == [at]


@settings(max_examples=30)
@given(st.floats(0.001, 10.0), st.floats(-100.0, 100.0), st.floats(-1.0, 1.0), st.integers(0, 2**32 - 1))
def test_noise_scales_and_ignores_offset_and_drift(scale, offset, drift, seed):
    noise = np.random.default_rng(seed).standard_normal(500)
    plain = white_noise(noise)
    assert_allclose(
        white_noise(scale * noise + offset + scale * drift * np.arange(500)), scale * plain, rtol=1e-6
    )
