"""An exported model stepped along a drive, and the command line of its C form."""

import shutil
import subprocess

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.model.reduced.drive import drive_of_recording
from spindle_fem.model.reduced.recorded_model import fast_model_for
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.resolved_jumps import with_resolved_jumps
from spindle_fem.studies.export.export_machine import machine_state_space
from spindle_fem.studies.export.exported_files import file_writer
from spindle_fem.studies.export.portable_model import PortableModel
from spindle_fem.units import ZERO_CELSIUS_K

needs_compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")


def inputs_of(model, drive):
    """Inputs at both ends of every step in the model's order and units, (G, m) each, usual where unknown."""
    found = []
    for values in (drive.start, drive.end):
        columns = [
            values[:, drive.column(item["name"])] - ZERO_CELSIUS_K * (item["unit"] == "degC")
            if item["name"] in drive.names
            else np.full(len(values), item["default"])
            for item in model.header["inputs"]
        ]
        found.append(np.column_stack(columns))
    return found


def readings_along(model, drive, given, most_steps=None):
    """Outputs after every step, (G, p); as they are just after it, where inputs jump.

    Parameters
    ----------
    given : mapping of int to float or mapping
        Where the model starts, by point of the drive's grid.
    """
    begin, end = inputs_of(model, drive)
    after = np.vstack((begin[1:], end[-1:]))
    found = []
    for step, seconds in enumerate(drive.steps[:most_steps]):
        if step in given:
            model.start(given[step], begin[step])
        assert model.step(seconds, begin[step], end[step]) == []
        found.append(model.read(after[step]))
    return np.array(found)


def resolved_run(fast, drive, start, **given):
    """A drive as simulate runs it, with short steps after jumps; exported models take theirs."""
    return simulate_fast(fast, with_resolved_jumps(drive, fast.model.size), start, **given)


def told_and_found(folder, machine, overrides, recording):
    """Outputs at a recording's rows (N - 1, p): by simulate, by the exported machine in Python, in C."""
    # one export, in both forms
    space = machine_state_space(machine, overrides)
    for name in ("model.npz", "model.c"):
        file_writer(folder / name)(space, folder / name)
    spec = load_machine(machine, overrides)
    drive = drive_of_recording(spec, recording)
    start = drive.first("ambient")
    fast = fast_model_for(spec, [recording], as_given=True)
    told = resolved_run(fast, drive, start).temperature[1:] - ZERO_CELSIUS_K
    model = PortableModel.load(folder / "model.npz")
    rows = np.searchsorted(drive.grid, drive.times[1:] - 1e-7) - 1
    found = readings_along(model, drive, {0: start - ZERO_CELSIUS_K})[rows]
    in_c = c_readings_along(folder, spec.name, model, drive, start - ZERO_CELSIUS_K)[rows]
    return told, found, in_c


PROGRAM = """
#include <stdio.h>
#include "model.h"
int main(void) {
    static NAME_model model;
    double seconds, first[UPPER_INPUTS], last[UPPER_INPUTS], after[UPPER_INPUTS], found[UPPER_OUTPUTS];
    double *rows[] = {first, last, after};
    if (scanf("%lf", &seconds) != 1) return 1;
    NAME_start(&model, seconds);
    while (scanf("%lf", &seconds) == 1) {
        for (int row = 0; row < 3; row++)
            for (int i = 0; i < UPPER_INPUTS; i++)
                if (scanf("%lf", &rows[row][i]) != 1) return 1;
        if (NAME_step(&model, seconds, first, last)) return 2;
        NAME_read(&model, after, found);
        for (int i = 0; i < UPPER_OUTPUTS; i++) printf("%.17g ", found[i]);
        printf("\\n");
    }
    return 0;
}
"""


def c_readings_along(folder, name, model, drive, start):
    """The same as :func:`readings_along` by ``model.c`` in a folder, compiled without a warning."""
    (folder / "main.c").write_text(PROGRAM.replace("NAME", name).replace("UPPER", name.upper()))
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run(["gcc", *flags, "main.c", "model.c", "-lm", "-o", "m"], cwd=folder, check=True)
    begin, end = inputs_of(model, drive)
    rows = np.column_stack((drive.steps, begin, end, np.vstack((begin[1:], end[-1:]))))
    text = "\n".join([repr(float(start)), *(" ".join(map(repr, row)) for row in rows.tolist())])
    answer = subprocess.run([folder / "m"], input=text, capture_output=True, text=True, check=True)
    return np.array([[float(value) for value in line.split()] for line in answer.stdout.splitlines()])
