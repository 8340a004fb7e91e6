"""A study over Dask with more and more local workers, and what one scheduler could carry.

    python benchmarks/scale.py [MACHINE] [--workers 1 2 4 8] [--designs 32] [--preset coarse] [-o FILE.json]

Every design differs in flow and oil temperature, so all share one mesh. For
each number of workers: rows an hour of the study, the largest worker before its first row
and at its peak, and the overhead a row: the same tasks through the same scheduler with an
answer that is ready. Then what reading, checking, sending and writing one design costs. More
workers than cores show contention, not scaling. ``benchmarks/scheduler.py`` goes on from the
file that is written.
"""

from __future__ import annotations

import argparse
import json
import os
import pickle
import sys
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from spindle_fem.parallel import WorkerPool
from spindle_fem.studies.sweep import run_tasks as runner
from spindle_fem.studies.sweep.evaluate_design import DesignTask, Question, evaluate_tasks
from spindle_fem.studies.sweep.prepared_study import PreparedStudy, prepare_study
from spindle_fem.studies.sweep.results_table import ResultTable, Row

if TYPE_CHECKING:
    from distributed import Client

STUDY = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "coolant.flow"
low = "{low:g} L/min"
high = "{high:g} L/min"
[[parameter]]
path = "coolant.inlet_temperature"
low = "15 degC"
high = "30 degC"
[study]
design = "sobol"
size = {designs}
backend = "full"
outputs = ["temperature.max_degC", "coolant.outlet_degC", "coolant.pressure_drop_Pa"]
"""


def ready_answer(tasks: Sequence[DesignTask], question: Question) -> list[Row]:
    """Rows of the usual shape, without solving: what remains is the scheduler's and the wire's."""
    return [
        {"key": task.key, "design": 0, "status": "ok", **dict.fromkeys(question.outputs, 0.0)}
        for task in tasks
    ]


def memory() -> dict[str, float]:
    """Resident memory of this process, now and at its largest, MB.

    ``ru_maxrss`` would keep what the process that started it held.
    """
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    named = dict(line.split(":", 1) for line in lines)
    return {name: int(named[name].split()[0]) / 1024.0 for name in ("VmRSS", "VmHWM")}


def _largest(client: Client, kind: str) -> float:
    """Of all workers, MB."""
    return max(worker[kind] for worker in client.run(memory).values())


def _rows(pool: WorkerPool, jobs: list[partial]) -> list[dict]:
    return [row for _, found in pool.stream(jobs) for row in found]


def on_cluster(prepared: PreparedStudy, workers: int) -> dict[str, float]:
    """Rows a second and overhead a row with so many local workers."""
    from distributed import Client, LocalCluster

    with LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        pieces = runner.chunks_of(prepared.tasks, workers)
        # every worker imports, and reads the mesh, before the clock starts
        first = [list(pieces[0][:1])] * (2 * workers)
        pool = WorkerPool(scheduler=address)
        question = prepared.question
        list(pool.stream([partial(ready_answer, piece, question) for piece in first]))
        with Client(address) as client:
            program = _largest(client, "VmRSS")
        list(pool.stream([partial(evaluate_tasks, piece, question) for piece in first]))
        begin = time.perf_counter()
        rows = _rows(pool, [partial(evaluate_tasks, piece, question) for piece in pieces])
        seconds = time.perf_counter() - begin
        repeated = [partial(ready_answer, piece, question) for _ in range(8) for piece in pieces]
        begin = time.perf_counter()
        empty = _rows(pool, repeated)
        overhead = time.perf_counter() - begin
        with Client(address) as client:
            peak = _largest(client, "VmHWM")
    return {
        "workers": workers,
        "rows": len(rows),
        "solved": sum(row["status"] == "ok" for row in rows),
        "seconds": seconds,
        "rows_an_hour": 3600.0 * len(rows) / seconds,
        "worker_program_MB": program,
        "worker_peak_MB": peak,
        "overhead_ms_a_row": 1e3 * overhead / len(empty),
        "rows_a_piece": len(prepared.tasks) / len(pieces),
    }


def costs_of_one(machine: str, study: Path, overrides: list[str], prepared: PreparedStudy) -> dict:
    """What the client pays for one design: reading and checking, sending, writing its row."""
    begin = time.process_time()
    again = prepare_study(machine, study, overrides)
    reading = (time.process_time() - begin) / len(again.tasks)
    piece = runner.chunks_of(prepared.tasks, 1)[0]
    sent = len(pickle.dumps((piece, prepared.question))) / len(piece)
    number = 2000
    with tempfile.TemporaryDirectory() as folder:
        table = ResultTable(Path(folder), prepared.columns)
        begin = time.process_time()
        for count in range(number):
            row = dict.fromkeys(prepared.columns, 0.0) | {"status": "ok", "reason": ""}
            table.append(row | {"key": f"{count:032x}", "design": count})
        writing = (time.process_time() - begin) / number
    return {
        "read_and_check_ms": 1e3 * reading,
        "sent_bytes": sent,
        "append_ms": 1e3 * writing,
        "serial_ms": 1e3 * _serial_seconds(prepared),
    }


def _serial_seconds(prepared: PreparedStudy) -> float:
    evaluate_tasks(prepared.tasks[:1], prepared.question)
    some = prepared.tasks[: min(8, len(prepared.tasks))]
    begin = time.process_time()
    evaluate_tasks(some, prepared.question)
    return (time.process_time() - begin) / len(some)


def main() -> None:
    """Run, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("machine", nargs="?", default="wu_tan_2016")
    parser.add_argument("--preset", default="coarse")
    parser.add_argument("--set", action="append", default=[], dest="overrides", metavar="PATH=VALUE")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 4, 8])
    parser.add_argument("--designs", type=int, default=32)
    parser.add_argument("--flow", type=float, nargs=2, default=[15.0, 30.0], help="Range, L/min.")
    parser.add_argument("-o", "--output", type=Path)
    arguments = parser.parse_args()
    overrides = [f"mesh.preset={arguments.preset}", *arguments.overrides]
    with tempfile.TemporaryDirectory() as work:
        study = Path(work) / "study.toml"
        low, high = arguments.flow
        study.write_text(STUDY.format(designs=arguments.designs, low=low, high=high), encoding="utf-8")
        prepared = prepare_study(arguments.machine, study, overrides)
        one = costs_of_one(arguments.machine, study, overrides, prepared)
        runs = []
        for workers in arguments.workers:
            runs.append(on_cluster(prepared, workers))
            print(json.dumps(runs[-1]), file=sys.stderr, flush=True)
    answer = {
        "machine": arguments.machine,
        "cores": os.cpu_count(),
        "one_design": one,
        "runs": runs,
    }
    text = json.dumps(answer, indent=1)
    if arguments.output:
        arguments.output.write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
