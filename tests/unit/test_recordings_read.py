"""Data files as they come: separators, stamps, broken cells, refusals with line and column."""

import gzip

import numpy as np
import pandas as pd
import pytest

from spindle_fem.errors import RecordingError
from spindle_fem.recordings.align import read_recording

MANIFEST = """
schema = "spindle-fem/recording/1"
name = "test"
data = "{data}"
time = {time}
[[channel]]
column = "SP01"
role = "temperature"
probe = "SP01"
unit = "degC"
[[channel]]
column = "SP03"
role = "temperature"
probe = "SP03"
unit = "degC"
[[channel]]
column = "speed"
role = "input"
drives = "speed"
unit = "rpm"
hold = "previous"
"""
SECONDS = '{column = "time_s", unit = "s"}'
STAMPS = '{column = "time_utc"}'


def rows(number=30):
    return [f"{10 * k},{20 + 0.01 * k:.2f},{21 + 0.02 * k:.2f},{100 * (k % 3)}" for k in range(number)]


def write(folder, lines, *, data="data.csv", time=SECONDS, header="time_s,SP01,SP03,speed", end="\n"):
    (folder / "recording.toml").write_text(MANIFEST.format(data=data, time=time))
    text = "\n".join([header, *lines]) + end
    content = text.encode() if isinstance(text, str) else text
    (folder / data).write_bytes(gzip.compress(content) if data.endswith(".gz") else content)
    return folder


def test_values_in_si(tmp_path):
    recording = read_recording(write(tmp_path, rows()))
    assert recording.temperature_names == ("SP01", "SP03")
    np.testing.assert_allclose(recording.times, np.arange(30) * 10.0)
    np.testing.assert_allclose(recording.temperature[:, 0], 293.15 + 0.01 * np.arange(30), atol=1e-9)
    np.testing.assert_allclose(recording.inputs[1, 0], 100 * 2 * np.pi / 60)
    assert recording.start is None
    assert recording.defects.rows == recording.defects.stamps == 30


@pytest.mark.parametrize("data", ["data.csv.gz", "data.parquet"])
def test_other_files_hold_the_same(tmp_path, data):
    plain = read_recording(write(tmp_path, rows()))
    folder = tmp_path / "other"
    folder.mkdir()
    write(folder, rows(), data=data)
    if data.endswith("parquet"):
        pd.read_csv(tmp_path / "data.csv").to_parquet(folder / data)
    other = read_recording(folder)
    np.testing.assert_array_equal(plain.temperature, other.temperature)
    np.testing.assert_array_equal(plain.inputs, other.inputs)


@pytest.mark.parametrize(
    ("separator", "decimal", "end"),
    [(";", ".", "\n"), (";", ",", "\n"), ("\t", ".", "\r\n"), (",", ".", "\r\n")],
)
def test_separators_decimal_commas_and_line_ends(tmp_path, separator, decimal, end):
    plain = read_recording(write(tmp_path, rows()))
    lines = [line.replace(".", "D").replace(",", separator).replace("D", decimal) for line in rows()]
    write(tmp_path, [], header=end.join(["time_s,SP01,SP03,speed".replace(",", separator), *lines]), end=end)
    other = read_recording(tmp_path)
    np.testing.assert_array_equal(plain.temperature, other.temperature)
    assert other.defects.blank_rows == 0


def test_byte_order_mark_and_spaces(tmp_path):
    lines = [line.replace(",", ", ") for line in rows()]
    write(tmp_path, lines, header="\ufefftime_s, SP01, SP03, speed")
    assert read_recording(tmp_path).temperature[3, 1] == pytest.approx(273.15 + 21.06)


def test_text_in_a_numeric_cell_is_named_by_line_and_column(tmp_path):
    lines = rows()
    lines[15] = "150,20.15,fault,0"
    with pytest.raises(
        RecordingError, match=r'data.csv: line 17 column SP03 holds "fault". Allowed: a number'
    ):
        read_recording(write(tmp_path, lines))


def test_several_broken_cells_are_listed(tmp_path):
    lines = rows()
    lines[4] = "40,overflow,21,0"
    for k in range(10, 18):
        lines[k] = f"{10 * k},20,?,0"
    with pytest.raises(RecordingError) as caught:
        read_recording(write(tmp_path, lines))
    text = str(caught.value)
    assert 'line 6 column SP01 holds "overflow"' in text
    assert 'line 12 column SP03 holds "?"' in text
    assert "and 4 more" in text


def test_blank_lines_do_not_shift_the_line_number(tmp_path):
    lines = rows()
    lines[3] = ""
    lines[15] = "150,20.15,fault,0"
    with pytest.raises(RecordingError, match="line 17 column SP03"):
        read_recording(write(tmp_path, lines))


def test_text_in_a_parquet_row(tmp_path):
    write(tmp_path, rows(), data="data.parquet")
    frame = pd.DataFrame(
        {"time_s": [0, 1, 2], "SP01": ["20", "x", "20"], "SP03": [1.0, 2, 3], "speed": [0, 0, 0]}
    )
    frame.to_parquet(tmp_path / "data.parquet")
    with pytest.raises(RecordingError, match='row 2 column SP01 holds "x"'):
        read_recording(tmp_path)


def test_empty_nan_and_infinite_cells_are_counted(tmp_path):
    lines = rows()
    lines[2] = "20,,21,0"
    lines[3] = "30,NaN,21,"
    lines[4] = "40,inf,21,0"
    recording = read_recording(write(tmp_path, lines))
    channel = recording.defects.channel("SP01")
    assert (channel.empty_cells, channel.infinite, channel.readings) == (2, 1, 27)
    assert channel.longest_missing_s == pytest.approx(40.0)
    assert recording.defects.channel("speed").bridged == 1
    assert np.isnan(recording.temperature[2:5, 0]).all()


def test_blank_and_short_lines_are_counted(tmp_path):
    lines = rows()
    lines[5] = ""
    lines[6] = "60,20.5"
    recording = read_recording(write(tmp_path, lines))
    assert recording.defects.blank_rows == 1
    assert recording.defects.rows_without_time == 1
    assert recording.defects.short_rows == 1
    assert recording.defects.stamps == 29


def test_last_line_that_broke_off_is_dropped(tmp_path):
    recording = read_recording(write(tmp_path, [*rows(), "300,20.3,2"], end=""))
    assert recording.defects.truncated_last_row
    assert recording.defects.rows == 30
    assert "1 broken off at the end" in "\n".join(recording.defects.lines())


def test_too_many_cells_are_refused(tmp_path):
    lines = rows()
    lines[7] += ",99"
    with pytest.raises(RecordingError, match="line 9: has 5 cells, the header names 4"):
        read_recording(write(tmp_path, lines))


def test_quoted_cells(tmp_path):
    """Quotes may hide separators: such lines are counted another way."""
    plain = read_recording(write(tmp_path, rows()))
    lines = [",".join(f'"{cell}"' for cell in row.split(",")) for row in rows()]
    header = '"time_s","SP01","SP03","speed"'
    np.testing.assert_array_equal(
        plain.temperature, read_recording(write(tmp_path, lines, header=header)).temperature
    )
    with pytest.raises(RecordingError, match="line 2: has 5 cells, the header names 4"):
        read_recording(write(tmp_path, [line + ',"9"' for line in lines], header=header))
    with pytest.raises(RecordingError, match="quoted cell that runs over several lines"):
        read_recording(write(tmp_path, [*lines, '"300","20\n1","2","3"'], header=header))


def test_missing_column_offers_the_nearest(tmp_path):
    with pytest.raises(RecordingError, match=r'line 1: has no column "SP03". Did you mean "SP3"'):
        read_recording(write(tmp_path, rows(), header="time_s,SP01,SP3,speed"))


def test_doubled_column_is_refused(tmp_path):
    with pytest.raises(RecordingError, match='names the column "SP01" twice'):
        read_recording(write(tmp_path, [r + ",1" for r in rows()], header="time_s,SP01,SP03,speed,SP01"))


def test_unused_columns_are_listed(tmp_path):
    recording = read_recording(
        write(tmp_path, [r + ",text" for r in rows()], header="time_s,SP01,SP03,speed,operator")
    )
    assert recording.defects.unused_columns == ("operator",)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"\n\n", "is empty"),
        (b"time_s,SP01,SP03,speed\n", "has 0 rows with a time"),
        (b"time_s,SP01,SP03,speed\n0,1,2,3\n", "has 1 row with a time"),
        (b"time_s,SP01,SP03,speed\n0,1,2,3\n1,\xff,2,3\n", "line 3: is not UTF-8 text"),
        (b"time_s,SP01,SP03,speed\n0,1,2,3\n1,\0,2,3\n", "line 3: holds a zero byte"),
        (b"time_s,SP01,SP03,speed\n0,,,3\n1,,,3\n", "no temperature channel has a reading"),
        (b"time_s,SP01,SP03,speed\n0,20,20,\n1,20,20,\n", 'input column "speed" has no reading'),
    ],
)
def test_files_without_use_are_refused(tmp_path, content, message):
    write(tmp_path, rows())
    (tmp_path / "data.csv").write_bytes(content)
    with pytest.raises(RecordingError, match=message):
        read_recording(tmp_path)


@pytest.mark.parametrize(
    ("data", "message"), [("data.csv.gz", "cannot be read"), ("data.parquet", "not a readable parquet")]
)
def test_damaged_archives_are_refused(tmp_path, data, message):
    write(tmp_path, rows(), data=data)
    (tmp_path / data).write_bytes(b"\x1f\x8bnot really")
    with pytest.raises(RecordingError, match=message):
        read_recording(tmp_path)


def stamped(number=30):
    start = pd.Timestamp("2016-05-02T12:41:30Z")
    return [
        row.replace(row.split(",")[0], str(start + pd.Timedelta(seconds=30 * k)), 1)
        for k, row in enumerate(rows(number))
    ]


def test_iso_stamps(tmp_path):
    recording = read_recording(write(tmp_path, stamped(), time=STAMPS, header="time_utc,SP01,SP03,speed"))
    np.testing.assert_allclose(recording.times, 30.0 * np.arange(30))
    assert recording.start == "2016-05-02T12:41:30Z"
    assert recording.stamps(np.array([90.0])) == ["2016-05-02T12:43:00Z"]


def test_stamps_of_other_zones_are_one_time(tmp_path):
    lines = stamped()
    lines[1] = lines[1].replace("2016-05-02 12:42:00+00:00", "2016-05-02T14:42:00+02:00")
    recording = read_recording(write(tmp_path, lines, time=STAMPS, header="time_utc,SP01,SP03,speed"))
    np.testing.assert_allclose(recording.times, 30.0 * np.arange(30))


@pytest.mark.parametrize("kind", ["naive", "aware", "milliseconds", "durations"])
def test_times_that_parquet_knows(tmp_path, kind):
    stamps = pd.date_range("2020-01-01", periods=30, freq="30s")
    made = {
        "naive": stamps,
        "aware": stamps.tz_localize("UTC").tz_convert("Asia/Tokyo"),
        "milliseconds": stamps.as_unit("ms"),
        "durations": pd.to_timedelta(30.0 * np.arange(30), unit="s"),
    }
    write(
        tmp_path, rows(), data="data.parquet", time=SECONDS if kind == "durations" else '{column = "time_s"}'
    )
    frame = pd.DataFrame({"time_s": made[kind], "SP01": 20.0, "SP03": np.arange(30.0), "speed": 0})
    frame.to_parquet(tmp_path / "data.parquet")
    recording = read_recording(tmp_path)
    np.testing.assert_allclose(recording.times, 30.0 * np.arange(30))
    assert recording.start == (None if kind == "durations" else "2020-01-01T00:00:00Z")


def test_broken_stamp_is_named(tmp_path):
    lines = stamped()
    lines[11] = "yesterday,20,21,0"
    with pytest.raises(RecordingError, match=r'line 13 column time_utc: holds "yesterday". Allowed: ISO'):
        read_recording(write(tmp_path, lines, time=STAMPS, header="time_utc,SP01,SP03,speed"))


def test_stamps_where_seconds_are_announced(tmp_path):
    with pytest.raises(
        RecordingError, match=r"line 2 column time_s: holds .* not a number of s. Leave time.unit out"
    ):
        read_recording(write(tmp_path, stamped()))


def test_seconds_where_stamps_are_announced(tmp_path):
    with pytest.raises(RecordingError, match=r"line 2 column time_utc: holds the number 0. Give time.unit"):
        read_recording(write(tmp_path, rows(), time=STAMPS, header="time_utc,SP01,SP03,speed"))


def test_time_in_hours_counts_from_the_earliest(tmp_path):
    recording = read_recording(write(tmp_path, rows(), time='{column = "time_s", unit = "h"}'))
    assert recording.times[1] == pytest.approx(36000.0)
    shifted = [f"{1000 + 10 * k}," + row.split(",", 1)[1] for k, row in enumerate(rows())]
    assert read_recording(write(tmp_path, shifted)).times[0] == 0.0


@pytest.mark.parametrize("stamp", ["{k}", "2016-05-02T12:41:{k:02d}.250"])
def test_one_bad_cell_of_a_file_with_decimal_commas_is_named_alone(tmp_path, stamp):
    lines = [f"{stamp.format(k=k)};{20 + 0.01 * k:.2f};21;0".replace(".", ",") for k in range(40)]
    lines = [line.replace(",250;", ".250;") for line in lines]
    lines[15] = lines[15].replace("20,15", "Fehler")
    folder = write(
        tmp_path,
        lines,
        header="time_s;SP01;SP03;speed",
        time=SECONDS if stamp == "{k}" else '{column = "time_s"}',
    )
    with pytest.raises(RecordingError, match=r'data.csv: line 17 column SP01 holds "Fehler"\. Allowed'):
        read_recording(folder)
    (folder / "data.csv").write_text((folder / "data.csv").read_text().replace("Fehler", "-"))
    recording = read_recording(folder)
    assert recording.temperature[3, 0] == pytest.approx(293.18)
    assert recording.defects.channel("SP01").empty_cells == 1


def test_a_comma_that_may_part_thousands_is_not_guessed_at(tmp_path):
    lines = rows()
    lines[3] = '30,20,21,"3,000"'
    with pytest.raises(RecordingError, match='line 5 column speed holds "3,000"'):
        read_recording(write(tmp_path, lines))


def test_times_that_are_all_the_same_are_said_to_be(tmp_path):
    lines = [line.replace(f"{10 * k},", "7,", 1) for k, line in enumerate(rows())]
    with pytest.raises(RecordingError, match=r'the same time in all 30 rows of column "time_s"'):
        read_recording(write(tmp_path, lines))


def test_an_input_that_no_sensor_can_read_is_refused_with_the_reason(tmp_path):
    folder = write(
        tmp_path,
        [",".join(["-300" if i == 3 else c for i, c in enumerate(row.split(","))]) for row in rows()],
    )
    manifest = (folder / "recording.toml").read_text()
    manifest = manifest.replace('drives = "speed"\nunit = "rpm"', 'drives = "coolant_inlet"\nunit = "degC"')
    (folder / "recording.toml").write_text(manifest)
    with pytest.raises(
        RecordingError, match=r"no reading that can be used\. 30 readings are outside .* -60 to 400"
    ):
        read_recording(folder)
