"""Corners of the command line: unusual values end with a reason, and what is printed can be used."""

import json
import re
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from spindle_fem import cli
from spindle_fem.cli import app
from spindle_fem.commands import diagnose_command
from spindle_fem.commands.console import print_check, print_sweep
from spindle_fem.commands.machine_commands import mesh_machine
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import BadInputError
from spindle_fem.results.output_folder import output_folder
from spindle_fem.studies.heat_study import heat_study
from tests.support.documented_commands import made_recording


def test_heat_at_a_speed_that_no_bearing_reaches_is_bad_input(command, tmp_path):
    done = command("heat", "wu_tan_2016", "--speed", "200000 rpm", "-o", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert "--speed: 200000 rpm. No rolling bearing of 165 mm" in done.stderr
    assert not (tmp_path / "out").exists()


def test_heat_leaves_a_report_that_can_be_rebuilt(command, tmp_path):
    done = command("heat", "small_two_start", "--speed", "3000 rpm", "--speed", "6000 rpm", "-o", tmp_path)
    assert str(tmp_path / "report.html") in done.stdout
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for text in ("all bearings at 6000 rpm", "Heat by every model", "data:image/"):
        assert text in page
    (tmp_path / "report.html").unlink()
    assert command("report", tmp_path).returncode == 0
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == page


def test_an_interrupted_diagnosis_leaves_the_machine_of_an_earlier_one(tmp_path, monkeypatch):
    machine = Path(__file__).parents[2] / "examples" / "pump.toml"
    made_recording(tmp_path / "recording", machine)
    folder = tmp_path / "out"
    folder.mkdir()
    for name in ("machine.toml", "diagnosis.json"):
        (folder / name).write_text("earlier", encoding="utf-8")

    def interrupted(*told, **settings):
        raise KeyboardInterrupt

    monkeypatch.setattr(diagnose_command, "diagnose_recordings", interrupted)
    with pytest.raises(KeyboardInterrupt):
        diagnose_command.diagnose(machine, [tmp_path / "recording"], folder)
    assert (folder / "machine.toml").read_text(encoding="utf-8") == "earlier"
    assert (folder / "INCOMPLETE").is_file()


def test_a_folder_without_results_has_no_report(command, tmp_path):
    done = command("report", tmp_path)
    assert done.returncode == 2
    assert "transient.json" in done.stderr


def test_brackets_of_texts_reach_the_terminal(capsys):
    row = {"name": "[[film]]", "detail": "[/] of [bold]"}
    warning = {"code": "no_heat_to_air", "text": "No surface has a [[film]]."}
    print_check({"machine": "[x]", "parts": [row], "assumed": [row], "warnings": [warning]})
    shown = capsys.readouterr().out
    for text in ("[x] is valid", "[[film]]  [/] of [bold]", "[[film]]: [/] of", "has a [[film]]."):
        assert text in shown


def test_check_opens_and_ends_with_its_verdict_and_keeps_the_assumed_of_a_table_together(capsys):
    assumed = [{"name": name, "detail": "a rule"} for name in ("gap.a", "joint.b", "gap.c")]
    print_check({"machine": "made", "assumed": assumed, "warnings": []})
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == lines[-1] == "made is valid."
    assert [line.split()[1] for line in lines[1:-1]] == ["gap.a:", "gap.c:", "joint.b:"]


def test_a_sweep_names_its_best_design_in_customary_units(capsys):
    content = {
        "parameters": [{"path": "channel.depth", "unit": "m"}],
        "outputs": [{"path": "coolant.pressure_drop_Pa", "unit": "Pa"}],
        "objectives": [{"output": "coolant.pressure_drop_Pa", "direction": "minimize"}],
        "optimum": {
            "best": {
                "design": 3,
                "parameters": {"channel.depth": 0.019},
                "outputs": {"coolant.pressure_drop_Pa": 1.5e5, "coolant.pressure_drop_Pa_low": 1.0},
            },
            "front": [3],
        },
    }
    print_sweep(content, Path("out"))
    shown = capsys.readouterr().out
    assert "best (minimize coolant.pressure_drop_Pa): design 3, channel.depth = 19 mm" in shown
    assert "there coolant.pressure_drop_Pa = 1.5 bar\n" in shown
    print_sweep({**content, "optimum": None}, Path("out"))
    assert "none of the solved designs keeps every limit" in capsys.readouterr().out


def test_a_speed_without_equilibrium_is_told_with_the_reason():
    content = heat_study(load_machine("wu_tan_2016"), [2.0e4], 313.15, coupled=False)
    assert "gross sliding" in str(content)
    assert "from about" not in str(content)  # no speed below was reached


def test_a_solid_model_goes_to_a_new_folder_and_nothing_else_is_printed(tmp_path, capfd):
    target = tmp_path / "missing" / "m.step"
    done = CliRunner().invoke(app, ["mesh", "small_two_start", "-o", str(target), "--json"])
    assert done.exit_code == 0
    assert json.loads(done.stdout)["parts"] > 0
    assert target.is_file()
    assert capfd.readouterr().out == ""
    with pytest.raises(OSError):
        mesh_machine("small_two_start", target / "m.step")


@pytest.mark.parametrize("arguments", [["sweep", "--jobs", "-3"], ["diagnose-folder", "--jobs", "-3"]])
def test_a_negative_number_of_workers_is_refused(arguments, tmp_path):
    given = ["pump", "study.toml"] if arguments[0] == "sweep" else ["pump", str(tmp_path)]
    done = CliRunner().invoke(app, [*arguments, *given, "-o", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert "--jobs" in done.output
    assert "greater than or equal to" in done.output


def test_help_keeps_the_names_of_tables():
    root = typer.main.get_command(app)
    texts = [
        getattr(item, "help", None) or ""
        for command in root.commands.values()
        for item in (command, *command.params)
    ]
    assert not [text for text in texts if re.search(r"(?<!\\)\[[a-z]", text)]
    shown = CliRunner().invoke(app, ["bearing", "--help"]).output
    assert "[bearing]" in shown


def test_help_fills_its_lines_whatever_those_of_the_source():
    shown = CliRunner().invoke(app, ["diagnose", "--help"], env={"COLUMNS": "80"}).output
    assert "which effects the\n" in shown.replace(" \n", "\n")
    assert "``" not in shown


@pytest.mark.parametrize(
    "name", ["report.html", "machine.toml", "study.toml", "improved_machine.toml", "results.csv"]
)
def test_a_folder_with_somebody_elses_file_is_left_alone(name, tmp_path):
    (tmp_path / name).write_text("mine")
    with pytest.raises(BadInputError, match=re.escape(name)), output_folder(tmp_path):
        pass
    assert (tmp_path / name).read_text() == "mine"


def test_a_checked_machine_tells_where_it_runs_and_what_was_drawn(command, tmp_path):
    done = command("check", "small_two_start", "--picture", tmp_path / "machine.png")
    assert f"is valid, drawn in {tmp_path / 'machine.png'}." in done.stdout.replace("\n", "")
    for text in ("rpm", "L/min at"):
        assert text in done.stdout


def test_an_oil_beyond_its_known_properties_is_refused(command):
    key = "bearing_set.front.lubrication.inlet_temperature"
    done = command("check", "grinding_spindle", "--set", f"{key}=-30degC")
    assert done.returncode == 2
    assert f"{key}: -30 °C. Properties of iso_vg_10 are known from 0 to 80 °C." in done.stderr


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("operation.speed=90000rpm", "No rolling bearing of"),
        ("operation.ambient_temperature=500degC", "No machine stands in air outside -60 to 400 °C"),
        ("coolant.inlet_temperature=120degC", "are known from"),
        ("part.shaft.material=stahl", "aluminium_alloy"),
    ],
)
def test_what_no_machine_runs_at_is_refused_before_it_is_solved(command, override, told):
    done = command("check", "small_two_start", "--set", override)
    assert done.returncode == 2
    assert told in done.stderr


def test_faults_are_json_where_that_is_asked_for(command):
    done = command("check", "small_two_start", "--set", "part.shaft.material=stahl", "--json")
    assert done.returncode == 2
    (fault,) = json.loads(done.stdout)["faults"]
    assert "stahl" in fault["what"]
    assert "part.shaft.material" in fault["where"]


def test_an_unknown_bearing_is_one_fault(command, tmp_path):
    text = '[bearing]\ncatalogue = "7099 C"\n[operation]\nspeed = "6000 rpm"\naxial_load = "500 N"\n'
    (tmp_path / "bearing.toml").write_text(text, encoding="utf-8")
    done = command("bearing", tmp_path / "bearing.toml")
    assert done.returncode == 2
    assert "7099 C" in done.stderr
    assert "missing" not in done.stderr


def test_an_interrupted_command_says_so(tmp_path, monkeypatch, capsys):
    def interrupted(**settings):
        # as the library of the command line ends where a user does
        raise SystemExit(130)

    monkeypatch.setattr(cli, "app", interrupted)
    with pytest.raises(SystemExit):
        cli.main()
    assert "Interrupted" in capsys.readouterr().err
    with pytest.raises(KeyboardInterrupt), output_folder(tmp_path / "out"):
        raise KeyboardInterrupt
    assert "was interrupted" in (tmp_path / "out" / "INCOMPLETE").read_text(encoding="utf-8")
