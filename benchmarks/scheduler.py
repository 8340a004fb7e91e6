"""A study of any size through one client and one Dask scheduler, simulated from measured rows.

    python benchmarks/scheduler.py SCALE.json [--rows 1000000] [--workers 100 200 400 800] [--row-seconds S]

``SCALE.json`` is what ``benchmarks/scale.py -o`` wrote: seconds of processor a row, of the client for
reading and checking a design, of scheduler and wire. Every piece of rows waits until the client has read
its designs, then for the scheduler, which serves one after the other, then for a worker. Workers begin with
loading and meshing, and die at a given rate, whereupon their piece is done again by another.
"""

from __future__ import annotations

import argparse
import heapq
import json
import math
import random
from dataclasses import dataclass
from pathlib import Path

SEED = 1
LOST_NOTICE_S = 30.0  # until a scheduler takes a silent worker for dead


@dataclass(frozen=True)
class Costs:
    """Seconds of one row, and of what happens once.

    Attributes
    ----------
    solve, spread : float
        Mean of a row on a worker, and its standard deviation relative to that.
    read, dispatch, write : float
        Of a row on the client before, on the scheduler, and on the client after.
    begin : float
        Until a new worker has loaded the program and a mesh.
    """

    solve: float
    spread: float
    read: float
    dispatch: float
    write: float
    begin: float


@dataclass(frozen=True)
class Outcome:
    """What a simulated study took: wall time, share of it in which workers solve, pieces done again."""

    seconds: float
    busy: float
    repeated: int


def simulate(
    rows: int, workers: int, costs: Costs, *, piece: int = 4, readers: int = 1, lives_h: float = 24.0
) -> Outcome:
    """Run a study of so many rows.

    Parameters
    ----------
    piece : int
        Rows that are handed over together.
    readers : int
        Processes of the client that read and check designs.
    lives_h : float
        Mean life of a worker.

    >>> costs = Costs(solve=1.0, spread=0.0, read=0.0, dispatch=0.0, write=0.0, begin=0.0)
    >>> round(simulate(400, 10, costs, lives_h=1e9).seconds, 6)
    40.0
    """
    chance = random.Random(SEED)
    free = [costs.begin * (1.0 + 0.1 * chance.random()) if costs.begin else 0.0 for _ in range(workers)]
    heapq.heapify(free)
    number = math.ceil(rows / piece)
    scheduler = solved = last = 0.0
    repeated = 0
    waiting: list[float] = []  # pieces whose worker died: when that is noticed
    given = 0
    while given < number or waiting:
        worker = heapq.heappop(free)
        if waiting and (given == number or waiting[0] <= worker):
            ready = heapq.heappop(waiting)
        else:
            given += 1
            ready = given * piece * costs.read / readers
        scheduler = max(scheduler, ready, worker) + piece * costs.dispatch
        seconds = sum(
            costs.solve * max(0.2, chance.gauss(1.0, costs.spread)) if costs.spread else costs.solve
            for _ in range(piece)
        )
        life = chance.expovariate(1.0 / (3600.0 * lives_h))
        if life < seconds:
            repeated += 1
            heapq.heappush(waiting, scheduler + life + LOST_NOTICE_S)
            heapq.heappush(free, scheduler + life + LOST_NOTICE_S + costs.begin)
            continue
        solved += seconds
        last = max(last, scheduler + seconds)
        heapq.heappush(free, scheduler + seconds)
    finished = max(last, rows * costs.write)
    return Outcome(finished, solved / (workers * finished), repeated)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("measured", type=Path)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--workers", type=int, nargs="+", default=[100, 200, 400, 800])
    parser.add_argument("--row-seconds", type=float, help="In place of the measured ones.")
    parser.add_argument("--piece", type=int, default=4)
    parser.add_argument("--readers", type=int, default=1)
    parser.add_argument("--lives-h", type=float, default=24.0)
    arguments = parser.parse_args()
    content = json.loads(arguments.measured.read_text(encoding="utf-8"))
    one = content["one_design"]
    costs = Costs(
        solve=arguments.row_seconds or 1e-3 * one["serial_ms"],
        spread=0.2,
        read=1e-3 * one["read_and_check_ms"],
        dispatch=1e-3 * min(run["overhead_ms_a_row"] for run in content["runs"]),
        write=1e-3 * one["append_ms"],
        begin=30.0,
    )
    print(costs)
    print("| workers | hours | core hours | workers solving | pieces done again |")
    print("|---|---|---|---|---|")
    for workers in arguments.workers:
        found = simulate(
            arguments.rows,
            workers,
            costs,
            piece=arguments.piece,
            readers=arguments.readers,
            lives_h=arguments.lives_h,
        )
        hours = found.seconds / 3600.0
        print(f"| {workers} | {hours:.1f} | {workers * hours:.0f} | {found.busy:.0%} | {found.repeated} |")


if __name__ == "__main__":
    main()
