"""What every command takes and leaves: how much it says, its log, and the files that ship."""

import logging
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from spindle_fem.commands import console
from spindle_fem.errors import BadInputError
from spindle_fem.results.output_folder import output_folder
from spindle_fem.results.run_log import LOG_FILE, LOGGER
from spindle_fem.studies.shipped_files import EXAMPLES, STUDIES, find_study, shipped_folder

ROOT = Path(__file__).parents[2]


@pytest.fixture
def pump(tmp_path):
    """The machine of the examples and a recording of it at rest: arguments of ``simulate``."""
    times = np.arange(0.0, 601.0, 60.0)
    data = pd.DataFrame({"t": times, "T1": 22.0, "T2": 22.0, "room": 22.0, "P": 0.0})
    data.to_csv(tmp_path / "data.csv", index=False)
    shutil.copy(ROOT / "examples" / "pump_recording.toml", tmp_path / "recording.toml")
    return "simulate", ROOT / "examples" / "pump.toml", tmp_path / "recording.toml", "-o", tmp_path / "out"


def test_a_quiet_command_says_nothing_and_leaves_the_same(command, pump, tmp_path):
    done = command(*pump, "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "out" / "report.html").is_file()
    refused = command("-q", "simulate", "nothing_there", *pump[2:])
    assert refused.returncode == 2
    assert "nothing_there" in refused.stderr


def test_a_verbose_command_tells_its_stages_and_the_log_has_them(command, pump, tmp_path):
    done = command(*pump, "--verbose")
    log = (tmp_path / "out" / LOG_FILE).read_text(encoding="utf-8")
    assert "spindle-fem simulate" in log.splitlines()[0]
    for text in ("simulation", "writing", "done after"):
        assert text in done.stderr
        assert text in log
    again = command(*pump)
    assert "INFO" not in again.stderr
    assert (tmp_path / "out" / LOG_FILE).read_text(encoding="utf-8").count("done after") == 2


def test_without_a_terminal_stages_of_long_commands_are_lines(command, pump, monkeypatch):
    monkeypatch.setattr(console, "FIRST_LINE", 0.0)
    assert "s: simulation ...\n" in command(*pump).stderr
    assert command(*pump, "--json").stderr == ""
    assert command(*pump, "--quiet").stderr == ""
    monkeypatch.setattr(console, "FIRST_LINE", 1e9)
    assert command(*pump).stderr == ""


def failing_run(folder):
    with output_folder(folder):
        logging.getLogger("py.warnings").warning("a library's own")
        raise ZeroDivisionError


def test_the_log_keeps_warnings_and_how_a_run_ended(tmp_path):
    with pytest.raises(ZeroDivisionError):
        failing_run(tmp_path / "out")
    log = (tmp_path / "out" / LOG_FILE).read_text(encoding="utf-8")
    for text in ("a library's own", "not finished: ZeroDivisionError", "Traceback"):
        assert text in log
    assert not LOGGER.handlers


def test_what_ships_is_copied_and_found_by_name(command, tmp_path):
    assert command("examples", "-o", tmp_path).returncode == 0
    for name in (EXAMPLES, STUDIES):
        files = {item.name for item in shipped_folder(name).iterdir() if item.is_file()}
        assert files == {item.name for item in (tmp_path / name).iterdir()}
    (tmp_path / STUDIES / "cool_down.toml").write_text("mine", encoding="utf-8")
    assert "wrote 0 files" in command("examples", "-o", tmp_path).stdout
    assert (tmp_path / STUDIES / "cool_down.toml").read_text(encoding="utf-8") == "mine"
    assert find_study("cool_down") == shipped_folder(STUDIES) / "cool_down.toml"
    with pytest.raises(BadInputError, match='Did you mean "cool_down"'):
        find_study("cooldown")
