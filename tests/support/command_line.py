"""The command line called in this process, without the second that a new interpreter loads for."""

import contextlib
import io
import os
import sys
from subprocess import CompletedProcess
from unittest import mock

import spindle_fem.cli


def run_here(*arguments, cwd=None):
    """What ``spindle-fem`` with these arguments answers, as ``subprocess.run`` gives it back."""
    out, err, status = io.StringIO(), io.StringIO(), 0
    with (
        contextlib.chdir(cwd or "."),
        mock.patch.dict(os.environ, {"COLUMNS": "200"}),
        mock.patch.object(sys, "argv", ["spindle-fem", *map(str, arguments)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            spindle_fem.cli.main()
        except SystemExit as end:
            status = end.code or 0
    return CompletedProcess(sys.argv, status, out.getvalue(), err.getvalue())
