"""Corners of the command line: unusual values end with a reason, and what is printed can be used."""

import json
import re

import pytest
import typer
from typer.testing import CliRunner

from spindle_fem.cli import app
from spindle_fem.commands.machine_commands import mesh_machine
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import BadInputError
from spindle_fem.results.output_folder import output_folder
from spindle_fem.studies.heat_study import heat_study


@pytest.mark.filterwarnings("ignore:invalid value")
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


def test_a_folder_with_somebody_elses_report_is_left_alone(tmp_path):
    (tmp_path / "report.html").write_text("mine")
    with pytest.raises(BadInputError, match=r"report\.html"), output_folder(tmp_path):
        pass
    assert (tmp_path / "report.html").read_text() == "mine"
