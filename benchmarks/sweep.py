"""Designs an hour of a study, and what sharing meshes, processes and a projected model brings.

    python benchmarks/sweep.py [MACHINE] [--preset normal] [--depths 40] [--temperatures 1] [--jobs 2]
                               [--mesh moved]
    python benchmarks/sweep.py recorded_spindle --reduced 1000 [--checks 20] [--preset normal]

A grid of channel depths (each a geometry of its own) by oil temperatures (which
share it), in an empty mesh cache; with ``--serial`` once more in one process.
``--mesh new`` gives every depth a mesh of its own instead of moving those of the lattice.

With ``--reduced``, that many designs of films, oil and flow through the
projected model: its set-up, the designs through it, and its error at designs
that it was not made from.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from spindle_fem.commands.sweep_command import sweep_machine
from spindle_fem.studies.sweep.evaluate_design import evaluate
from spindle_fem.studies.sweep.fast_backend import GroupTask, answer_tasks, model_of
from spindle_fem.studies.sweep.prepared_study import prepare_study
from spindle_fem.studies.sweep.results_table import read_results

STUDY = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "channel.depth"
{depths}
[[parameter]]
path = "coolant.inlet_temperature"
{temperatures}
[study]
mesh = "{mesh}"
outputs = ["temperature.max_degC", "derived.largest_ring_difference_K", "coolant.pressure_drop_Pa"]
"""


FILMS = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "coolant.inlet_temperature"
low = "12 degC"
high = "35 degC"
[[parameter]]
path = "coolant.flow"
low = "10 L/min"
high = "40 L/min"
[[parameter]]
path = "coolant.film_factor"
low = 0.7
high = 1.4
[[parameter]]
path = "film.outside.coefficient"
low = "6 W/m**2/K"
high = "15 W/m**2/K"
[study]
design = "sobol"
size = {size}
seed = {seed}
backend = "reduced"
outputs = [
    "temperature.max_degC", "temperature.min_degC", "derived.largest_ring_difference_K",
    "derived.cooler_heat_W", "probes.SP01", "probes.SP02", "probes.SP03", "probes.SP04", "probes.SP05",
    "probes.COOLANT_OUT",
]
"""


def reduced_study(machine: str, preset: str, number: int, checks: int) -> None:
    """Set-up, speed and error of the projected model over designs that share a mesh."""
    overrides = [f"mesh.preset={preset}"]
    with tempfile.TemporaryDirectory() as work:
        os.environ["SPINDLE_FEM_CACHE"] = str(Path(work) / "cache")
        study = Path(work) / "study.toml"
        prepared = []
        for size, seed in ((number, 1), (4 * checks, 2)):
            study.write_text(FILMS.format(size=size, seed=seed), encoding="utf-8")
            begin = time.process_time()
            prepared.append(prepare_study(machine, study, overrides))
            print(f"{size} designs read and checked in {time.process_time() - begin:.1f} s")
        plan, others = prepared
        begin = time.process_time()
        model, _, tables = model_of(GroupTask(plan.tasks, plan.tasks), plan.question)
        print(f"{machine}, {preset}: set-up {time.process_time() - begin:.1f} s, {model.size} basis vectors, "
              f"checked to {model.checked_error:.2g} K")  # fmt: skip
        for name in ("first", "again"):
            begin = time.process_time()
            rows = answer_tasks(model, tables, plan.tasks, plan.question)
            spent = time.process_time() - begin
            each = 1e3 * spent / number
            print(f"{len(rows)} of {number} designs through it, {name}: {spent:.2f} s, {each:.2f} ms each")
        rows = answer_tasks(model, tables, others.tasks, others.question)[:checks]
        by_key = {task.key: task for task in others.tasks}
        worst, estimate = 0.0, 0.0
        for row in rows:
            exact = evaluate(by_key[row["key"]], others.question)
            columns = [path for path in others.question.outputs if path != "derived.cooler_heat_W"]
            worst = max(worst, *(abs(row[path] - exact[path]) for path in columns))
            estimate = max(estimate, row["error_estimate_K"])
        print(f"{len(rows)} designs not used to build it: largest error of any temperature {worst:.2g} K, "
              f"estimated {estimate:.2g} K")  # fmt: skip


def _axis(low: float, high: float, number: int, unit: str) -> str:
    if number == 1:
        return f'values = ["{low:g} {unit}"]'
    return f'low = "{low:g} {unit}"\nhigh = "{high:g} {unit}"\nnumber = {number}'


def timed_sweep(machine: str, study: Path, preset: str, jobs: int) -> tuple[float, float, list[dict]]:
    """Seconds of the clock and of this process's processor, and rows, of one study in an empty mesh cache."""
    with tempfile.TemporaryDirectory() as work:
        os.environ["SPINDLE_FEM_CACHE"] = str(Path(work) / "cache")
        started, busy = time.perf_counter(), time.process_time()
        sweep_machine(machine, study, Path(work) / "out", [f"mesh.preset={preset}"], jobs=jobs, progress=True)
        spent = time.perf_counter() - started, time.process_time() - busy
        return *spent, read_results(Path(work) / "out")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("machine", nargs="?", default="wu_tan_2016")
    parser.add_argument("--preset", default="normal")
    parser.add_argument("--depths", type=int, default=40)
    parser.add_argument("--temperatures", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--mesh", choices=["new", "moved"], default="moved")
    parser.add_argument("--serial", action="store_true", help="Also in one process, for the ratio.")
    parser.add_argument("--reduced", type=int, default=0, help="Designs through the projected model instead.")
    parser.add_argument("--checks", type=int, default=20, help="Of them with a full solve beside.")
    arguments = parser.parse_args()
    if arguments.reduced:
        reduced_study(arguments.machine, arguments.preset, arguments.reduced, arguments.checks)
        return
    text = STUDY.format(
        depths=_axis(5.0, 24.5, arguments.depths, "mm"),
        temperatures=_axis(15.0, 40.0, arguments.temperatures, "degC"),
        mesh=arguments.mesh,
    )
    with tempfile.TemporaryDirectory() as work:
        study = Path(work) / "study.toml"
        study.write_text(text, encoding="utf-8")
        seconds, busy, rows = timed_sweep(arguments.machine, study, arguments.preset, arguments.jobs)
        solved = sum(row["status"] == "ok" for row in rows)
        moved = sum(row["mesh"] == "moved" for row in rows)
        print(
            f"{arguments.machine}, {arguments.preset}: {solved} of {len(rows)} designs solved, "
            f"{moved} on a moved mesh"
        )
        print(f"{arguments.jobs} processes: {seconds:8.1f} s  {seconds / len(rows):6.2f} s a design")
        if arguments.jobs == 1:
            print(f"of the processor: {busy:8.1f} s  {busy / len(rows):6.2f} s a design")
        if arguments.serial:
            alone, _, again = timed_sweep(arguments.machine, study, arguments.preset, 1)
            print(f"one process: {alone:8.1f} s  ratio {alone / seconds:.2f}")
            if again != rows:
                sys.exit("the rows differ")


if __name__ == "__main__":
    main()
