"""The other commands: what they print, what they refuse, how they end."""

import json

import meshio
import pytest

ALL_MACHINES = ("wu_tan_2016", "recorded_spindle", "small_two_start", "uncooled")


@pytest.mark.parametrize("machine", ALL_MACHINES)
def test_machines_that_ship_are_valid(command, machine):
    process = command("check", machine)
    assert process.returncode == 0, process.stderr
    assert "is valid" in process.stdout


def test_check_as_json_lists_contacts_with_their_conductance(command):
    content = json.loads(command("check", "wu_tan_2016", "--json").stdout)
    contacts = {row["name"]: row["detail"] for row in content["contacts"]}
    assert contacts["F1.inner_ring|shaft"] == "inner_ring_seats: 10000 W/(m²·K)"
    assert contacts["F1.outer_ring|shaft:face"] == "nose_clearance: 0 W/(m²·K)"


def test_check_reports_all_faults_of_several_tables_at_once(command):
    process = command(
        "check", "wu_tan_2016",
        "--set", "operation.speed=3000", "--set", "channel.width=23mm", "--set", "heat.model=guess",
    )  # fmt: skip
    assert process.returncode == 2
    assert "operation.speed" in process.stderr
    assert "channel.width" in process.stderr
    assert "heat.model" in process.stderr


def test_geometry_fault_is_bad_input(process):
    done = process("check", "wu_tan_2016", "--set", "channel.depth=41mm")
    assert done.returncode == 2
    assert "channel" in done.stderr
    assert "Traceback" not in done.stderr


def test_misspelt_override_is_refused_with_a_suggestion(command):
    process = command("check", "wu_tan_2016", "--set", "channel.depht=12mm")
    assert process.returncode == 2
    assert "depht" in process.stderr
    assert 'Did you mean "depth"?' in process.stderr


def test_unknown_machine_is_refused_with_a_suggestion(command, tmp_path):
    process = command("run", "wu_tan_2015", "-o", tmp_path / "out")
    assert process.returncode == 2
    assert 'Did you mean "wu_tan_2016"?' in process.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("path", [
    "operation.speed=1000rpm", "operation.thrust=500N", "operation.ambient_temperature=25degC",
    "coolant.inlet_temperature=20degC", "coolant.flow=12L/min", "channel.depth=8mm", "channel.width=8mm",
    "channel.pitch=20mm", "channel.turns=3", "channel.starts=1", "channel.hand=left", "heat.model=skf",
    "mesh.preset=fine",
])  # fmt: skip
@pytest.mark.parametrize("machine", ["wu_tan_2016", "small_two_start"])
def test_paths_that_stay_put_can_be_set(command, machine, path):
    process = command("check", machine, "--set", path)
    # A value may be impossible on the small machine; the path itself never is.
    assert "unknown key" not in process.stderr
    assert "there is no" not in process.stderr


def test_heat_prints_terms_and_models(command):
    process = command("heat", "wu_tan_2016", "--speed", "3000 rpm", "--json")
    assert process.returncode == 0, process.stderr
    content = json.loads(process.stdout)
    row = content["bearings"]["F1"][0]
    assert row["speed_rpm"] == pytest.approx(3000.0)
    assert sum(row["terms_W"].values()) == pytest.approx(row["heat_W"])
    heat = content["models"][0]["heat_W"]
    assert heat["paper"]["F1"] < heat["full"]["F1"] < heat["palmgren"]["F1"]


@pytest.mark.render
def test_heat_writes_its_table_and_charts(command, tmp_path):
    process = command(
        "heat", "small_two_start", "--speed", "2000 rpm", "--speed", "4000 rpm", "-o", tmp_path / "heat"
    )
    assert process.returncode == 0, process.stderr
    assert (tmp_path / "heat" / "heat.csv").is_file()
    assert len(list((tmp_path / "heat" / "figures").glob("*.png"))) == 7


def test_heat_at_a_bare_speed_is_refused(command):
    process = command("heat", "wu_tan_2016", "--speed", "3000")
    assert process.returncode == 2
    assert "--speed: bare number" in process.stderr


@pytest.mark.parametrize("ending", [".msh", ".vtu", ".step"])
def test_mesh_is_written_with_names(command, tmp_path, ending):
    file = tmp_path / f"machine{ending}"
    process = command("mesh", "small_two_start", "--set", "mesh.preset=coarse", "-o", file)
    assert process.returncode == 0, process.stderr
    assert file.stat().st_size > 10_000
    if ending == ".msh":
        assert "shaft" in meshio.read(file).field_data


def test_mesh_of_an_unknown_format_is_refused(command, tmp_path):
    process = command("mesh", "small_two_start", "-o", tmp_path / "machine.stl")
    assert process.returncode == 2
    assert "Allowed: .msh, .vtu, .step" in process.stderr


def test_bearing_file_gives_the_published_state(command, tmp_path):
    file = tmp_path / "bearing.toml"
    file.write_text(
        """
        [bearing]
        ball_diameter = "22.225 mm"
        ball_count = 16
        pitch_diameter = "125.26 mm"
        contact_angle = "40 deg"
        groove_curvature_inner = 0.5232
        groove_curvature_outer = 0.5232
        young_modulus = "206.8 GPa"
        poisson_ratio = 0.29
        density = "7800 kg/m**3"
        arrangement = "single"
        [operation]
        speed = "10000 rpm"
        axial_load = "17800 N"
        raceway_control = "outer"
        """,
        encoding="utf-8",
    )
    process = command("bearing", file, "--json")
    assert process.returncode == 0, process.stderr
    content = json.loads(process.stdout)
    ball = content["balls"][0]
    assert ball["contact_angle_inner_deg"] == pytest.approx(49.954, abs=0.05)
    assert ball["contact_angle_outer_deg"] == pytest.approx(31.341, abs=0.05)
    assert content["axial_deflection_um"] == pytest.approx(14.96, rel=3e-3)


def test_help_and_version(process):
    assert "run" in process("--help").stdout
    assert process("--version").stdout.startswith("spindle-fem ")


@pytest.mark.parametrize("command_line", [(), ("check",), ("recording", "draft")])
def test_flags_are_not_listed_as_if_they_took_a_value(process, command_line):
    shown = process(*command_line, "--help").stdout
    assert "--help" in shown
    assert "bool" not in shown
