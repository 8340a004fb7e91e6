"""Manifests drafted from files as devices write them: form, time, meaning of columns, doubts."""

import numpy as np
import pandas as pd
import pytest

from spindle_fem.errors import RecordingError
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.column_roles import guess_channel
from spindle_fem.recordings.draft_recording import data_text, draft_recording, manifest_text
from spindle_fem.recordings.manifest import column_unit
from spindle_fem.recordings.recordable_names import RecordableNames, recordable_names

MACHINE = RecordableNames(
    probes=("SP01", "SP02"), inputs={"speed": "rad/s", "ambient": "K", "coolant_inlet": "K"}
)
TIMES = pd.Timestamp("2016-05-02 12:41:30") + pd.to_timedelta(10.0 * np.arange(60), unit="s")
WARM = 20.0 + 15.0 * (1.0 - np.exp(-np.arange(60) / 20.0))
SPEED = np.where(np.arange(60) < 30, 3000, 0)


def german():
    def comma(value):
        return f"{value:.1f}".replace(".", ",")

    rows = ["Gerät;Prüfstand Süd", "", "Datum;Uhrzeit;SP01;Umgebung;Drehzahl;Temp SP02", ";;°C;°C;1/min;°C"]
    rows += [
        f"{stamp:%d.%m.%Y};{stamp:%H:%M:%S},250;{comma(warm)};{comma(20.0)};{speed};{comma(warm - 1.0)}"
        for stamp, warm, speed in zip(TIMES, WARM, SPEED, strict=True)
    ]
    rows[10] = rows[10].replace(comma(WARM[6]) + ";", "Fehler;", 1)
    return "\r\n".join(rows) + "\r\n"


def draft(tmp_path, text, name="device.csv", encoding="utf-8", machine=MACHINE, zone=None):
    file = tmp_path / name
    file.write_bytes(text.encode(encoding))
    return draft_recording([file], machine, zone=zone)


def roles(drafted):
    return {g.channel.column: g.channel.probe or g.channel.drives for g in drafted.channels}


def test_german_export(tmp_path):
    drafted = draft(tmp_path, german(), encoding="latin-1")
    assert roles(drafted) == {"SP01": "SP01", "Umgebung": "ambient", "Drehzahl": "speed", "Temp SP02": "SP02"}
    assert drafted.data["time"].iloc[0] == pd.Timestamp("2016-05-02 12:41:30.25")
    assert drafted.lost_cells == ('device.csv line 11, column SP01: "Fehler"',)
    assert np.nanmax(np.abs(drafted.data["SP01"] - WARM)) < 0.051
    assert any("Windows-1252" in text for text in drafted.unsure)


def test_two_columns_of_one_name_both_keep_their_unit(tmp_path):
    rows = [f"{60 * n},{warm:.2f},{warm + 1.0:.2f}" for n, warm in enumerate(WARM)]
    drafted = draft(tmp_path, "\n".join(["time [s],SP01 [°C],SP01 [°C]", *rows]) + "\n")
    assert [(g.channel.column, g.channel.unit) for g in drafted.channels] == [
        ("SP01", "degC"), ("SP01_2", "degC"),
    ]  # fmt: skip
    assert not any("no unit" in guess.unsure for guess in drafted.channels)
    assert any('several columns are called "SP01"' in text for text in drafted.unsure)


def test_what_is_drafted_is_read_as_it_was(tmp_path):
    drafted = draft(tmp_path, german())
    (tmp_path / "recording.csv").write_text(data_text(drafted), encoding="utf-8")
    (tmp_path / "recording.toml").write_text(manifest_text(drafted), encoding="utf-8")
    recording = read_recording(tmp_path)
    assert recording.probes == ("SP01", "SP02")
    assert recording.start == "2016-05-02T12:41:30.250000Z"
    assert recording.input_at("speed", np.array([0.0])) == pytest.approx(3000.0 * 2.0 * np.pi / 60.0)
    assert recording.defects.channel("SP01").empty_cells == 1


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le"])
def test_encodings_read_alike(tmp_path, encoding):
    drafted = draft(tmp_path, german(), encoding=encoding)
    assert len(drafted.data) == 60
    assert roles(drafted)["Umgebung"] == "ambient"


@pytest.mark.parametrize(
    ("head", "stamp"),
    [
        ("# Logger 3\n# t[s]   SP01[°C]  n[1/min]", "{second:8.1f}"),
        ("Date       Time      SP01  n[1/min]", "{time:%d.%m.%Y %H:%M:%S}"),
        ('"Time stamp"  SP01\tn[1/min]', "{time:%Y-%m-%dT%H:%M:%S}"),
    ],
)
def test_columns_apart_by_blanks(tmp_path, head, stamp):
    rows = [
        f"{stamp.format(second=10.0 * i, time=TIMES[i])}  {warm:8.3f}   {speed:7.1f} "
        for i, (warm, speed) in enumerate(zip(WARM, SPEED, strict=True))
    ]
    drafted = draft(tmp_path, "\n".join([head, *rows]), name="device.asc")
    assert [g.channel.probe or g.channel.drives for g in drafted.channels] == ["SP01", "speed"]
    assert np.abs(drafted.data.iloc[:, 1] - WARM).max() < 1e-3
    steps = np.diff(drafted.data["time"]) / (1.0 if drafted.time_unit else np.timedelta64(1, "s"))
    assert (steps == 10.0).all()


def test_american_dates_and_groups_of_thousands(tmp_path):
    rows = [
        f'{stamp:%m/%d/%Y %I:%M:%S %p},{warm:.2f},"{speed:,}"'
        for stamp, warm, speed in zip(TIMES, WARM, SPEED, strict=True)
    ]
    drafted = draft(tmp_path, "\n".join(["Time,SP01,Speed", *rows]))
    assert drafted.data["time"].iloc[0] == TIMES[0]
    assert drafted.data["Speed"].max() == 3000.0


def test_days_of_spreadsheets_are_stamps(tmp_path):
    rows = [f"{42492.5 + second / 8640.0:.9f};{warm:.2f}" for second, warm in enumerate(WARM)]
    drafted = draft(tmp_path, "\n".join(["time;SP01", *rows]).replace(".", ","))
    assert abs(drafted.data["time"].iloc[1] - pd.Timestamp("2016-05-02 12:00:10")) < pd.Timedelta("1ms")
    assert any("spreadsheets" in text for text in drafted.unsure)


def test_dates_as_excel_holds_them_stand_beside_their_clock(tmp_path):
    rows = [f"{s:%Y-%m-%d} 00:00:00;{s:%H:%M:%S};{w:.2f}" for s, w in zip(TIMES, WARM, strict=True)]
    drafted = draft(tmp_path, "\n".join(["Datum;Uhrzeit;SP01", *rows]))
    assert (drafted.data["time"] == TIMES).all()
    days = "\n".join(["day;SP01", *(f"{d:02d}.05.2016;{20 + d}" for d in range(1, 9))])
    assert (np.diff(draft(tmp_path, days).data["time"]) == np.timedelta64(1, "D")).all()


@pytest.mark.parametrize("form", ["%d-%b-%Y %H:%M:%S", "%a %b %d %H:%M:%S %Y", "%Y%m%dT%H%M%S"])
def test_stamps_with_months_in_words_or_without_signs(tmp_path, form):
    rows = [f"{stamp:{form}},{warm:.2f}" for stamp, warm in zip(TIMES, WARM, strict=True)]
    drafted = draft(tmp_path, "\n".join(["Timestamp,SP01", *rows]))
    assert (drafted.data["time"] == TIMES).all()


def test_a_clock_without_dates_passes_midnight(tmp_path):
    rows = [f"{(23 + k // 6) % 24}:{k % 6}0:00,{20 + k}" for k in range(12)]
    drafted = draft(tmp_path, "\n".join(["Uhrzeit,SP01", *rows]))
    assert (np.diff(drafted.data["time"]) == 600.0).all()
    assert any("no date" in text for text in drafted.unsure)


@pytest.mark.parametrize(
    ("zone", "hour"), [(" CET", 6), (" MESZ", 5), ("+02", 5), (" -0500", 12), (" GMT", 7)]
)
def test_stamps_may_name_their_zone(tmp_path, zone, hour):
    rows = "".join(f"2016-02-05 07:00:{i:02d}{zone},{20 + 0.1 * i:.1f},3000\n" for i in range(20))
    drafted = draft(tmp_path, f"time,SP01 (degC),speed (rpm)\n{rows}")
    assert drafted.data["time"].iloc[0] == pd.Timestamp(2016, 2, 5, hour)


@pytest.mark.parametrize(("zone", "hour", "said"), [(None, 12, True), ("Australia/Brisbane", -3, False)])
def test_letters_of_two_continents_are_told_unless_the_zone_is_given(tmp_path, zone, hour, said):
    rows = "".join(f"2016-02-05 07:00:{i:02d} EST,{20 + 0.1 * i:.1f},3000\n" for i in range(20))
    drafted = draft(tmp_path, f"time,SP01 (degC),speed (rpm)\n{rows}", zone=zone)
    assert drafted.data["time"].iloc[0] == pd.Timestamp(2016, 2, 5) + pd.Timedelta(hours=hour)
    assert any("UTC-5; in Australia it is UTC+10" in text for text in drafted.unsure) == said


def test_zone_resolves_the_end_of_summer_time(tmp_path):
    clock = pd.date_range("2016-10-30 00:30", periods=6, freq="30min", tz="UTC").tz_convert("Europe/Berlin")
    text = "\n".join(["time,SP01", *(f"{stamp:%Y-%m-%d %H:%M:%S},{20 + i}" for i, stamp in enumerate(clock))])
    local, resolved = draft(tmp_path, text), draft(tmp_path, text, zone="Europe/Berlin")
    assert any("summer time" in text for text in local.unsure)
    assert (np.diff(resolved.data["time"]) == np.timedelta64(30, "m")).all()
    assert resolved.data["time"].iloc[0] == pd.Timestamp("2016-10-30 00:30")


def test_repeated_and_unordered_rows_stay(tmp_path):
    text = "time_s,SP01\n0,20\n20,21\n10,20.5\n10,20.5\n30,22\n"
    assert list(draft(tmp_path, text).data["time"]) == [0.0, 20.0, 10.0, 10.0, 30.0]


def test_hostile_names_stay_within_their_comments(tmp_path):
    rows = "".join(f"{i},{20 + i},{i}\n" for i in range(12))
    drafted = draft(tmp_path, f'time_s,SP01,"x"" \u2028[[channel]] = \\"\n{rows}')
    (tmp_path / "recording.csv").write_text(data_text(drafted), encoding="utf-8")
    (tmp_path / "recording.toml").write_text(manifest_text(drafted), encoding="utf-8")
    assert len(read_recording(tmp_path).covariate_names) == 1


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a,b\nx,y\n", "no table of numbers"),
        ("SP01,SP02\n" + "".join(f"{20 + i % 3},21\n" for i in range(9)), "no column of times"),
        ("time,SP01\n" + "".join(f"5,{20 + i}\n" for i in range(9)), "the same time in all 9 rows"),
        ("time_s,load\n" + "".join(f"{i},{900 + i}\n" for i in range(9)), "no column could be told"),
        (
            "time SP01 room air\n" + "".join(f"{i}  {20 + i}  21\n" for i in range(9)),
            "names 4 columns, rows have 3",
        ),
        ("", "is empty"),
    ],
)
def test_refusals_say_why(tmp_path, text, reason):
    with pytest.raises(RecordingError, match=reason):
        draft(tmp_path, text)


@pytest.mark.parametrize(
    ("column", "means"),
    [
        ("Temp_SP01", "SP01"),
        ("ch3/SP02", "SP02"),
        ("Raumtemperatur", "ambient"),
        ("Hallenluft Temp", "ambient"),
        ("Oil COOLANT OUT", "COOLANT_OUT"),
        ("SP01-SP02", None),
        ("coolant_in", "coolant_inlet"),
        ("oil inside", None),
    ],
)
def test_names_stand_within_columns(column, means):
    machine = RecordableNames((*MACHINE.probes, "OUT", "COOLANT_OUT"), (), MACHINE.inputs)
    channel = guess_channel(column, "degC", WARM, machine, set()).channel
    assert (channel.probe or channel.drives) == means


@pytest.mark.parametrize(
    ("column", "probe"),
    [("Kühlmittel Rücklauf", "COOLANT_OUT"), ("oil outlet", "COOLANT_OUT"), ("Rest", None)],
)
def test_the_outlet_is_told_by_its_name(column, probe):
    names = recordable_names("recorded_spindle")
    taken: set[str] = set()
    guess = guess_channel(column, "degC", WARM, names, taken)
    assert (guess.channel.probe, guess.unsure == "") == (probe, probe is not None)
    assert guess_channel("Rücklauf 2", "degC", WARM, names, taken | {"COOLANT_OUT"}).channel.probe is None


@pytest.mark.parametrize(
    ("column", "probe"),
    [
        ("T vorne", "FRONT"),
        ("Lager vorne", "front_bearing"),
        ("Hinteres Lager", None),
        ("Wellenende", None),
        ("Spindel Gehäuse", "housing"),
    ],
)
def test_german_names_of_places(column, probe):
    names = RecordableNames(("FRONT", "front_bearing", "REAR_LEFT", "housing"), (), MACHINE.inputs)
    guess = guess_channel(column, "degC", WARM, names, set())
    assert guess.channel.probe == probe
    assert guess.unsure


@pytest.mark.parametrize(("source", "unit"), [("x_load", "percent"), ("main_speed", "rpm"), ("pump", "W")])
def test_units_of_network_inputs_by_their_names(source, unit):
    machine = RecordableNames(("SP01",), (), {source: ""})
    guess = guess_channel(source, "", SPEED.astype(float), machine, set())
    assert (guess.channel.unit, guess.channel.hold) == (unit, "previous")
    assert "no unit" in guess.unsure


def test_files_of_the_same_columns_follow_one_another(tmp_path):
    for number in range(2):
        rows = "".join(f"{60 * number + i},{20 + i}\n" for i in range(12))
        (tmp_path / f"{number}.csv").write_text("time_s,SP01\n" + rows)
    drafted = draft_recording([tmp_path / "0.csv", tmp_path / "1.csv"], MACHINE)
    assert len(drafted.data) == 24
    assert drafted.sources == ("0.csv", "1.csv")


def test_names_that_differ_in_signs_only_stay_apart(tmp_path):
    rows = "".join(f"{i},{20 + i},{40 + i},{i}\n" for i in range(12))
    drafted = draft(tmp_path, 'time_s,SP01,"SP01,",time [K]\n' + rows)
    assert list(drafted.data.columns) == ["time", "SP01", "SP01_2", "time_2"]
    assert drafted.data["SP01_2"].iloc[0] == 40.0


def test_recorded_quantities_of_heat_sources_are_inputs(tmp_path):
    machine = tmp_path / "motor.toml"
    machine.write_text(
        'base = "small_two_start"\n[[source]]\nname = "rotor"\npart = "shaft"\ninput = "motor_power"\n'
    )
    names = recordable_names(machine)
    assert names.inputs["motor_power"] == names.inputs["heat.rotor"] == "W"
    guess = guess_channel("motor power", "kW", 1.0 + np.arange(12) % 2, names, set())
    assert (guess.channel.drives, guess.channel.unit) == ("motor_power", "kW")


@pytest.mark.parametrize("preamble", ["", "Gerät;Prüfstand Süd\r\nBearbeiter;Müller\r\n\r\n"])
@pytest.mark.parametrize(
    "units",
    [
        "TT.MM.JJJJ;hh:mm:ss,000;1/min;°C;°C",
        ";hh:mm:ss,000;1/min;°C;°C",
        "TT.MM.JJJJ;hh:mm:ss;1/min;°C;°C",
        "[tt.mm.jjjj];[HH:MM:SS];[1/min];[°C];[°C]",
        "YYYY-MM-DD;hh:mm;rpm;degC;degC",
        "DD.MM.YYYY;-;1/min;°C;°C",
    ],
)
def test_format_words_are_units_of_dates_and_clocks(tmp_path, preamble, units):
    rows = [
        f"{stamp:%d.%m.%Y;%H:%M:%S},250;{speed};{warm:.1f};20.0"
        for stamp, warm, speed in zip(TIMES, WARM, SPEED, strict=True)
    ]
    drafted = draft(
        tmp_path, preamble + "\r\n".join(["Datum;Uhrzeit;Drehzahl;SP01;Raumtemperatur", units, *rows])
    )
    assert roles(drafted) == {"Drehzahl": "speed", "SP01": "SP01", "Raumtemperatur": "ambient"}
    assert [guess.channel.unit for guess in drafted.channels] == ["rpm", "degC", "degC"]


def test_a_format_word_above_a_clock_alone_is_a_unit(tmp_path):
    rows = [f"{stamp:%H:%M:%S};{warm:.1f};21" for stamp, warm in zip(TIMES, WARM, strict=True)]
    drafted = draft(tmp_path, "\n".join(["Zeit;SP01;n", "[hh:mm:ss];[°C];[1/min]", *rows]))
    assert roles(drafted) == {"SP01": "SP01", "n": "speed"}


@pytest.mark.parametrize(
    "heads",
    [
        "Lager vorne °C;Raumtemperatur °C;Drehzahl 1/min",
        "Lager vorne [°C];Raumtemperatur in °C;Drehzahl U/min",
        "Lager vorne Außenring;Raumtemperatur;Drehzahl",
        "Lager vorne;Raum;Drehzahl",
    ],
)
def test_units_beside_names_or_none_at_all(tmp_path, heads):
    rows = [
        f"{s:%d.%m.%Y %H:%M:%S};{w:.1f};{21.5 + w / 100:.1f};{n}"
        for s, w, n in zip(TIMES, WARM, SPEED, strict=True)
    ]
    text = "\n".join([f"Zeit;{heads}", *rows])
    drafted = draft(tmp_path, text, machine=None)
    assert list(roles(drafted).values()) == [drafted.channels[0].channel.column, "ambient", "speed"]
    assert [guess.channel.unit for guess in drafted.channels] == ["degC", "degC", "rpm"]
    stated = "1/min" in heads or "U/min" in heads
    assert all(("no unit" in guess.unsure) != stated for guess in drafted.channels)
    drafted = draft(tmp_path, text, machine=RecordableNames(("FRONT", "REAR"), (), MACHINE.inputs))
    assert list(roles(drafted).values()) == ["FRONT", "ambient", "speed"]


@pytest.mark.parametrize("column", ["Lager vorne Kraft", "Lagerschwingung", "Antriebsstrom", "Luftdruck"])
def test_other_quantities_without_units_are_no_temperatures(column):
    guess = guess_channel(column, "", WARM, RecordableNames(), set())
    assert guess.channel.role == "covariate"
    assert guess.channel.unit is None


def test_a_speed_in_hertz_is_marked_with_what_to_do(tmp_path):
    guess = guess_channel("Drehzahl", "Hz", SPEED / 60.0, MACHINE, set())
    assert guess.channel.role == "covariate"
    assert "Hz is not taken" in guess.unsure
    assert "rpm = 60 times" in guess.unsure
    assert column_unit("turn/s", "speed").scale == pytest.approx(60.0 * column_unit("rpm", "speed").scale)


@pytest.mark.parametrize(("unit", "shift", "other"), [("degC", 273.15, "K"), ("K", 0.0, "degC")])
@pytest.mark.parametrize("column", ["SP01", "Umgebung", "Rest"])
def test_units_that_do_not_fit_the_size_are_marked(column, unit, shift, other):
    assert f'unit = "{other}"?' in guess_channel(column, unit, WARM + shift, MACHINE, set()).unsure
    assert "look like" not in guess_channel(column, other, WARM + shift, MACHINE, set()).unsure
    assert guess_channel("Temp 1", "", WARM + shift, MACHINE, set()).channel.unit == other


def test_refusals_without_a_probe_say_what_would_help(tmp_path):
    rows = "".join(f"{i},{w:.2f},{w + 1:.2f}\n" for i, w in enumerate(WARM))
    with pytest.raises(
        RecordingError, match=r"temperatures: Temp1, Temp2; .* SP02\), or leave --machine out"
    ):
        draft(tmp_path, f"time_s,Temp1,Temp2\n{rows}")
    with pytest.raises(RecordingError, match=r"needs a unit \(\[°C\] behind its name") as caught:
        draft(tmp_path, f"time_s,A,B\n{rows}", machine=None)
    assert "any name" not in str(caught.value)
    with pytest.raises(RecordingError, match=r"needs a unit .* after a probe \(SP01, SP02\)") as caught:
        draft(tmp_path, f"time_s,A,B\n{rows}")
    assert "--machine" not in str(caught.value)


@pytest.mark.parametrize("column", ["T_Ruecklauf_C", "Kuehlmittel Ruecklauf [degC]", "Rücklauf"])
def test_umlauts_may_be_spelt_with_two_letters(tmp_path, column):
    rows = "".join(f"{i};{w:.2f}\n" for i, w in enumerate(WARM))
    drafted = draft(tmp_path, f"time_s;{column}\n{rows}", machine=recordable_names("recorded_spindle"))
    assert list(roles(drafted).values()) == ["COOLANT_OUT"]
    assert drafted.channels[0].channel.unit == "degC"
    names = RecordableNames(("housing", "shaft"), (), MACHINE.inputs)
    assert guess_channel("Gehaeuse", "degC", WARM, names, set()).channel.probe == "housing"


def test_steps_with_jitter_hold_and_what_changes_steadily_does_not():
    rng, time = np.random.default_rng(3), np.arange(400.0)
    steps = np.repeat([0.0, 1500.0, 3000.0, 800.0], 100)
    courses = {
        "steps": (steps + rng.integers(-1, 2, 400), "previous"),
        "constant": (3000.0 + rng.integers(-1, 2, 400), "previous"),
        "ramp": (10.0 * time, "linear"),
        "slow": (3000.0 * (1.0 - np.exp(-time / 100.0)), "linear"),
        "wave": (2000.0 + 1000.0 * np.sin(time / 3.0), "linear"),
        "noise": (8.0 + rng.normal(0.0, 0.3, 400), "linear"),
    }
    found = {
        name: guess_channel("speed", "rpm", values, MACHINE, set()).channel.hold
        for name, (values, _) in courses.items()
    }
    assert found == {name: hold for name, (_, hold) in courses.items()}


def test_a_row_a_reading_becomes_a_column_a_channel(tmp_path):
    rows = ["time,channel,value,unit"]
    for stamp, warm, speed in zip(TIMES, WARM, SPEED, strict=True):
        rows += [f"{stamp.isoformat()},SP01,{warm:.2f},degC", f"{stamp.isoformat()},n_ist,{speed},rpm"]
    drafted = draft(tmp_path, "\n".join(rows) + "\n")
    assert roles(drafted) == {"SP01": "SP01", "n_ist": "speed"}
    assert np.abs(drafted.data["SP01"] - WARM).max() < 0.0051
    assert drafted.data["n_ist"].tolist() == SPEED.tolist()


def test_a_column_of_remarks_leaves_a_table_as_it_is(tmp_path):
    rows = ["time_s,state,SP01"]
    rows += [f"{10 * i},{'heating' if i < 30 else 'cooling'},{warm:.2f}" for i, warm in enumerate(WARM)]
    assert roles(draft(tmp_path, "\n".join(rows) + "\n")) == {"SP01": "SP01"}


@pytest.mark.parametrize(("scale", "name"), [(1.0, "epoch_s"), (1e3, "epoch_ms"), (1e6, "time_us")])
def test_counts_from_1970_are_stamps_whatever_they_count(tmp_path, scale, name):
    rows = [f"{name},SP01"]
    rows += [f"{stamp.timestamp() * scale:.0f},{warm:.2f}" for stamp, warm in zip(TIMES, WARM, strict=True)]
    drafted = draft(tmp_path, "\n".join(rows) + "\n")
    assert drafted.data["time"].iloc[0] == TIMES[0]


@pytest.mark.parametrize(
    ("column", "unit", "means"),
    [
        ("T_amb", "", "ambient"),
        ("V_oil", "", "coolant_flow"),
        ("T_VL", "degC", "coolant_inlet"),
        ("cooling", "l/min", "coolant_flow"),
    ],
)
def test_short_names_of_inputs(column, unit, means):
    machine = RecordableNames(
        probes=("SP01",), inputs={"ambient": "K", "coolant_inlet": "K", "coolant_flow": "m**3/s"}
    )
    assert guess_channel(column, unit, 20.0 + 0.01 * np.arange(60), machine, set()).channel.drives == means


def test_waveforms_have_the_stamps_of_their_start(tmp_path):
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    start = {"wf_start_time": np.datetime64("2016-05-02T10:41:30"), "wf_increment": 10.0}
    with TdmsWriter(tmp_path / "log.tdms") as writer:
        channel = ChannelObject("Log", "SP01", WARM, properties={**start, "unit_string": "degC"})
        writer.write_segment([RootObject(), GroupObject("Log"), channel])
    drafted = draft_recording([tmp_path / "log.tdms"], MACHINE)
    assert drafted.data["time"].iloc[1] == pd.Timestamp("2016-05-02 10:41:40")
