"""The command line as a user runs it, and the same in this process."""

import os
import subprocess
import sys

import pytest

from tests.support.command_line import run_here


@pytest.fixture(scope="session")
def command():
    """Run ``spindle-fem`` with arguments in this process; gives status, standard output and error."""
    return run_here


@pytest.fixture(scope="session")
def process():
    """The same in a process of its own: for what only shows there."""

    def run(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "spindle_fem", *map(str, arguments)],
            capture_output=True,
            text=True,
            env={**os.environ, "COLUMNS": "200"},
            check=False,
        )

    return run


@pytest.fixture(scope="session")
def small_run(process, tmp_path_factory):
    """One run of the small two-start spindle, shared by the tests that look at its files."""
    folder = tmp_path_factory.mktemp("run") / "out"
    small = ("--set", "mesh.preset=coarse", "--set", "mesh.order=1")
    return folder, process("run", "small_two_start", *small, "-o", folder, "--json")
