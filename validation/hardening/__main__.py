"""``python -m validation.hardening -o DIR``: spoilt inputs by the thousand, one JSON line a case.

What is in ``DIR/cases.jsonl`` already is not done again. Folders of cases that showed a fault stay in
``DIR/work`` for a look. ``--only FAMILY`` and ``--cases N`` make it shorter.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from .child import warm
from .families import FAMILIES, try_case
from .judged import FAULT
from .material import make_originals

CASES = "cases.jsonl"


def read_cases(place: Path) -> list[dict[str, Any]]:
    """Cases that are done; a last line without its end is none."""
    file = place / CASES
    if not file.is_file():
        return []
    whole = file.read_text(encoding="utf-8").rpartition("\n")[0]
    return [json.loads(line) for line in whole.splitlines()]


def main(arguments: list[str] | None = None) -> int:
    """Command line; the exit status is 1 where there is a fault."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.hardening", description=__doc__.splitlines()[0]
    )
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", action="append", choices=sorted(FAMILIES))
    parser.add_argument("--cases", type=int, help="of each family at most")
    given = parser.parse_args(arguments)
    place = given.output.resolve()
    place.mkdir(parents=True, exist_ok=True)
    os.environ["SPINDLE_FEM_CACHE"] = str(place / "cache")
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    warm()
    make_originals(place)
    done = {(item["family"], item["number"]) for item in read_cases(place)}
    waiting = [
        (family, number)
        for family in given.only or FAMILIES
        for number in range(1, min(FAMILIES[family][1], given.cases or 10**9) + 1)
        if (family, number) not in done
    ]
    # All families side by side: a fault of any shows early.
    waiting.sort(key=lambda case: case[1] / FAMILIES[case[0]][1])
    pool = ProcessPoolExecutor(given.jobs, multiprocessing.get_context("spawn"), initializer=warm)
    with pool, (place / CASES).open("a", encoding="utf-8") as lines:
        running = [pool.submit(try_case, *case, given.seed, place) for case in waiting]
        for future in as_completed(running):
            item = future.result()
            print(json.dumps(item), file=lines, flush=True)
            if item["outcome"] == FAULT:
                print(f"{item['family']} {item['number']}: {item['reason']}", flush=True)
    counts = Counter((item["family"], item["outcome"]) for item in read_cases(place))
    for (family, outcome), number in sorted(counts.items()):
        print(f"{family}: {number} {outcome}")
    return int(any(outcome == FAULT for _, outcome in counts))


if __name__ == "__main__":
    sys.exit(main())
