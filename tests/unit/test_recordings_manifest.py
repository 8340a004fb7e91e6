"""Manifests: what is allowed, and every fault at once."""

import pytest

from scripts import manifest_page
from spindle_fem.errors import FaultsError, RecordingError, SpecError, UnitError
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.manifest import column_unit, find_manifest, load_manifest
from spindle_fem.recordings.recordable_names import RecordableNames, recordable_names

TEXT = """
schema = "spindle-fem/recording/1"
name = "test"
data = "data.csv"
time = {column = "time_s", unit = "s"}
[[channel]]
column = "SP01"
role = "temperature"
probe = "SP01"
unit = "degC"
sigma = 0.1
[[channel]]
column = "speed"
role = "input"
drives = "speed"
hold = "previous"
unit = "rpm"
[[channel]]
column = "load"
role = "covariate"
unit = "percent"
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "recording.toml").write_text(TEXT)
    (tmp_path / "data.csv").write_text("time_s,SP01,speed,load\n0,20,0,0\n1,20,0,0\n")
    return tmp_path


def rewrite(folder, old, new):
    text = (folder / "recording.toml").read_text()
    assert old in text
    (folder / "recording.toml").write_text(text.replace(old, new, 1))


def test_folder_or_file(folder):
    manifest, data = load_manifest(folder)
    again, _ = load_manifest(folder / "recording.toml")
    assert manifest == again
    assert data == folder / "data.csv"
    assert manifest.channel[1].hold == "previous"


def test_only_manifest_of_a_folder_is_found(folder):
    (folder / "recording.toml").rename(folder / "run.toml")
    assert find_manifest(folder).name == "run.toml"
    (folder / "other.toml").write_text("")
    with pytest.raises(
        RecordingError, match=r"holds no recording.toml. Name one .toml file; found: other.toml, run"
    ):
        find_manifest(folder)


def test_no_such_recording(tmp_path):
    with pytest.raises(RecordingError, match="does not exist"):
        load_manifest(tmp_path / "nothing.toml")


def test_data_file_is_no_manifest(folder):
    with pytest.raises(RecordingError, match=r"data.csv: is not a manifest. Give the .toml file"):
        load_manifest(folder / "data.csv")


FAULTS = [
    ("recording/1", "recording/2", r'schema: .*recording/2. is not known. Allowed: ".*/1"'),
    ('unit = "rpm"', 'unit = "rmp"', r'channel\[2\].unit: "rmp" is not a known unit'),
    ('unit = "rpm"', 'unit = "N"', r'channel\[2\].unit: "N" has the wrong dimension. Allowed: .* rad/s'),
    ('unit = "rpm"', 'unit = "Hz"', '"Hz" does not say turns or radians'),
    ('unit = "rpm"', 'unit = "1/min"', '"1/min" does not say turns or radians'),
    ('unit = "degC"', 'unit = "delta_degC"', r'channel\[1\].unit: "delta_degC" is a temperature difference'),
    ('unit = "degC"', 'unit = "m"', r'channel\[1\].unit: "m" has the wrong dimension. Allowed: units of K'),
    ('unit = "degC"\n', "", r"channel\[1\].unit: is missing"),
    ('probe = "SP01"\n', "", r"channel\[1\].probe: is missing"),
    ('drives = "speed"\n', "", r"channel\[2\].drives: is missing"),
    ('"covariate"', '"covariate"\ndrives = "thrust"', r"channel\[3\].drives: 'thrust' has no meaning"),
    ('role = "covariate"', 'role = "status"', "Allowed: temperature, displacement, input, covariate"),
    ('hold = "previous"', 'hold = "last"', "Allowed: previous, linear"),
    ("sigma = 0.1", "sigma = -0.1", r"channel\[1\].sigma: is -0.1. Allowed: above 0"),
    ("sigma = 0.1", "sigm = 0.1", 'unknown key. Did you mean "sigma"'),
    ('unit = "s"', 'unit = "m"', r'time.unit: "m" has the wrong dimension'),
    ('column = "load"', 'column = "SP01"', r'channel\[3\].column: "SP01" is already channel\[1\].column'),
    ('column = "load"', 'column = "time_s"', r'channel\[3\].column: "time_s" is already time.column'),
    ('data = "data.csv"', 'data = "other.csv"', '"other.csv" does not exist beside the manifest'),
    ('data = "data.csv"', 'data = "data.xlsx"', '"data.xlsx" is of unknown kind. Allowed: .csv, .csv.gz'),
    ('data = "data.csv"\n', "", "data: is missing"),
    ('role = "temperature"\nprobe = "SP01"', 'role = "covariate"', "no channel is a temperature"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), FAULTS)
def test_faults_name_file_key_value_and_what_is_allowed(folder, old, new, message):
    rewrite(folder, old, new)
    with pytest.raises(FaultsError, match=message) as caught:
        load_manifest(folder)
    assert "recording.toml" in str(caught.value)


def test_every_fault_at_once(folder):
    rewrite(folder, 'unit = "rpm"', 'unit = "rmp"')
    rewrite(folder, 'probe = "SP01"\n', "")
    rewrite(folder, 'data = "data.csv"', 'data = "nothing.csv"')
    rewrite(folder, "recording/1", "recording/2")
    with pytest.raises(FaultsError) as caught:
        load_manifest(folder)
    assert len(caught.value.faults) == 4


def test_nothing_but_the_schema_of_another_kind_of_file_is_a_fault(folder):
    rewrite(folder, "recording/1", "study/1")
    rewrite(folder, 'unit = "rpm"', 'unit = "rmp"')
    with pytest.raises(FaultsError) as caught:
        load_manifest(folder)
    assert places(caught) == ["schema"]


def test_columns_and_names_of_the_machine_are_told_beside_other_faults(folder):
    rewrite(folder, 'unit = "rpm"', 'unit = "upm"')
    rewrite(folder, 'column = "speed"', 'column = "sped"')
    rewrite(folder, 'drives = "speed"', 'drives = "sped"')
    rewrite(folder, 'probe = "SP01"', 'probe = "PS01"')
    with pytest.raises(FaultsError) as caught:
        read_recording(folder)
    assert places(caught) == ["channel[2].unit", "channel[2].column"]
    known = RecordableNames(("SP01",), inputs={"speed": "rad/s"}, needed=("speed",))
    of_machine = ["channel[1].probe", "channel[2].drives", "channel"]
    with pytest.raises(FaultsError) as caught:
        read_recording(folder, names=lambda: known)
    assert places(caught) == ["channel[2].unit", "channel[2].column", *of_machine]
    rewrite(folder, 'unit = "upm"', 'unit = "rpm"')
    with pytest.raises(FaultsError, match=r'"sped" is not in data.csv. Did you mean "speed"') as caught:
        read_recording(folder, names=lambda: known)
    assert places(caught) == ["channel[2].column", *of_machine]


def test_a_faulty_machine_hides_no_fault_of_a_recording(folder):
    def refused():
        raise SpecError("machine", "is faulty.")

    rewrite(folder, 'unit = "rpm"', 'unit = "upm"')
    with pytest.raises(FaultsError, match="upm") as caught:
        read_recording(folder, names=refused)
    assert len(caught.value.faults) == 1


def test_the_names_that_machines_of_both_kinds_know():
    spindle, motor = recordable_names("recorded_spindle"), recordable_names("bench_motor")
    assert "COOLANT_OUT" in spindle.probes
    assert (spindle.needed, spindle.takes_others) == (("speed",), False)
    assert set(motor.probes) == {"winding", "stator_body"}
    assert set(motor.needed) == {"ambient", "electrical_power"}


def places(caught):
    return [fault.where.rpartition(": ")[2] for fault in caught.value.faults]


def test_contradictions_are_told_beside_keys_that_are_no_keys(folder):
    rewrite(folder, "sigma = 0.1", "sigm = 0.1")
    rewrite(folder, 'unit = "s"', 'unit = "m"')
    rewrite(folder, 'hold = "previous"', 'hold = "last"')
    rewrite(folder, 'unit = "percent"', 'unit = "percent"\nhold = "linear"')
    rewrite(folder, 'schema = "spindle-fem/recording/1"\n', "")
    with pytest.raises(FaultsError) as caught:
        load_manifest(folder)
    assert sorted(places(caught)) == [
        "channel[1].sigm",
        "channel[2].hold",
        "channel[3].hold",
        "schema",
        "time.unit",
    ]


def test_two_channels_cannot_drive_the_same(folder):
    with (folder / "recording.toml").open("a") as file:
        file.write('[[channel]]\ncolumn = "speed2"\nrole = "input"\ndrives = "speed"\nunit = "rpm"\n')
    with pytest.raises(FaultsError, match=r'channel\[4\].drives: "speed" is already driven by channel\[2\]'):
        load_manifest(folder)


def test_heat_inputs_are_powers(folder):
    rewrite(folder, 'drives = "speed"', 'drives = "heat.motor"')
    with pytest.raises(FaultsError, match=r"wrong dimension\. Allowed: units of W"):
        load_manifest(folder)


def test_broken_toml_is_named_with_its_line(folder):
    (folder / "recording.toml").write_text('schema = "spindle-fem/recording/1"\nname = \n')
    with pytest.raises(SpecError, match="line 2"):
        load_manifest(folder)


@pytest.mark.parametrize(
    ("unit", "raw", "si"),
    [
        ("degC", 25.0, 298.15),
        ("degF", 77.0, 298.15),
        ("K", 298.15, 298.15),
        ("rpm", 60.0, 6.283185307179586),
        ("percent", 50.0, 0.5),
        ("L/min", 60.0, 1e-3),
        ("kW", 2.0, 2000.0),
        ("bar", 1.0, 1e5),
    ],
)
def test_conversion_of_columns(unit, raw, si):
    conversion = column_unit(unit, "x")
    assert conversion.scale * raw + conversion.offset == pytest.approx(si, rel=1e-12)


def test_unknown_unit_is_refused():
    with pytest.raises(UnitError, match='x: "wibble" is not'):
        column_unit("wibble", "x")


def test_the_page_lists_every_key():
    page = manifest_page.PAGE.read_text(encoding="utf-8")
    assert page == manifest_page.renewed(page), "run: python -m scripts.manifest_page"
