"""The command line as a user runs it: a process of its own."""

import os
import subprocess
import sys

import pytest


@pytest.fixture(scope="session")
def command():
    """Run ``spindle-fem`` with arguments; gives status, standard output and standard error."""

    def run(*arguments, cwd=None):
        environment = {**os.environ, "COLUMNS": "200"}
        return subprocess.run(
            [sys.executable, "-m", "spindle_fem", *map(str, arguments)],
            capture_output=True,
            text=True,
            cwd=cwd,
            env=environment,
            check=False,
        )

    return run


@pytest.fixture(scope="session")
def small_run(command, tmp_path_factory):
    """One run of the small two-start spindle, shared by the tests that look at its files."""
    folder = tmp_path_factory.mktemp("run") / "out"
    process = command("run", "small_two_start", "--set", "mesh.preset=coarse", "-o", folder, "--json")
    return folder, process
