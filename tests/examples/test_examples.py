"""Every script of ``examples/`` runs from top to bottom, is short, and stands in the README."""

import contextlib
import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
LONGEST = 60


# These register something, which must not reach other tests.
ALONE = {"own_effect", "own_heat_model"}
IN_TURN = "import runpy, sys\nfor script in sys.argv[2:]: runpy.run_path(script, run_name='__main__')"


@pytest.mark.usefixtures("unpictured")
@pytest.mark.parametrize("script", [path for path in SCRIPTS if path.stem not in ALONE], ids=lambda p: p.stem)
def test_an_example_runs(script, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [str(script), str(tmp_path / "out")])
    with contextlib.chdir(tmp_path):
        runpy.run_path(str(script), run_name="__main__")
    assert capsys.readouterr().out


def test_examples_that_register_something_run_in_a_process_of_their_own(tmp_path):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    scripts = [path for path in SCRIPTS if path.stem in ALONE]
    assert len(scripts) == len(ALONE)
    process = subprocess.run(
        [sys.executable, "-c", IN_TURN, tmp_path / "out", *scripts],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=environment,
        check=False,
    )
    assert process.returncode == 0, process.stdout + process.stderr
    assert all(word in process.stdout for word in ("casing", "warmest"))


def test_examples_are_short_and_listed():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert SCRIPTS
    for script in SCRIPTS:
        assert len(script.read_text(encoding="utf-8").splitlines()) <= LONGEST, script.name
        assert f"examples/{script.name}" in readme, script.name
