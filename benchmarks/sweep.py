"""Designs an hour of a study, and what sharing meshes and processes brings.

    python benchmarks/sweep.py [MACHINE] [--preset normal] [--depths 40] [--temperatures 1] [--jobs 2]

A grid of channel depths (each a mesh of its own) by oil temperatures (which
share it), in an empty mesh cache; with ``--serial`` once more in one process.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from spindle_fem.design.sweep import sweep_machine
from spindle_fem.design.table import read_results

STUDY = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "channel.depth"
{depths}
[[parameter]]
path = "coolant.inlet_temperature"
{temperatures}
[study]
outputs = ["temperature.max_degC", "derived.largest_ring_difference_K", "coolant.pressure_drop_Pa"]
"""


def _axis(low: float, high: float, number: int, unit: str) -> str:
    if number == 1:
        return f'values = ["{low:g} {unit}"]'
    return f'low = "{low:g} {unit}"\nhigh = "{high:g} {unit}"\nnumber = {number}'


def timed_sweep(machine: str, study: Path, preset: str, jobs: int) -> tuple[float, list[dict]]:
    """Seconds and rows of one study in an empty mesh cache."""
    with tempfile.TemporaryDirectory() as work:
        os.environ["SPINDLE_FEM_CACHE"] = str(Path(work) / "cache")
        started = time.perf_counter()
        sweep_machine(machine, study, Path(work) / "out", [f"mesh.preset={preset}"], jobs=jobs, progress=True)
        return time.perf_counter() - started, read_results(Path(work) / "out")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("machine", nargs="?", default="wu_tan_2016")
    parser.add_argument("--preset", default="normal")
    parser.add_argument("--depths", type=int, default=40)
    parser.add_argument("--temperatures", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--serial", action="store_true", help="Also in one process, for the ratio.")
    arguments = parser.parse_args()
    text = STUDY.format(
        depths=_axis(5.0, 24.5, arguments.depths, "mm"),
        temperatures=_axis(15.0, 40.0, arguments.temperatures, "degC"),
    )
    with tempfile.TemporaryDirectory() as work:
        study = Path(work) / "study.toml"
        study.write_text(text, encoding="utf-8")
        seconds, rows = timed_sweep(arguments.machine, study, arguments.preset, arguments.jobs)
        solved = sum(row["status"] == "ok" for row in rows)
        print(f"{arguments.machine}, {arguments.preset}: {solved} of {len(rows)} designs solved")
        print(f"{arguments.jobs} processes: {seconds:8.1f} s  {seconds / len(rows):6.2f} s a design")
        if arguments.serial:
            alone, again = timed_sweep(arguments.machine, study, arguments.preset, 1)
            print(f"one process: {alone:8.1f} s  ratio {alone / seconds:.2f}")
            if again != rows:
                sys.exit("the rows differ")


if __name__ == "__main__":
    main()
