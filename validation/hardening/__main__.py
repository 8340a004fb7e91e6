"""``python -m validation.hardening -o DIR``: spoilt inputs by the thousand, one JSON line a case.

What is in ``DIR/cases.jsonl`` already is not done again. Folders of cases that showed a fault stay in
``DIR/work`` for a look, ``DIR/result.json`` has the counts and ``--page FILE`` the page. ``--short`` is a
sample that needs nothing built; ``--only FAMILY`` and ``--cases N`` choose.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .child import warm
from .families import FAMILIES, try_case
from .judged import ACCEPTED, FAULT, REFUSED, Record
from .material import make_originals
from .page import page, summarise

CASES = "cases.jsonl"
# A sample: cases whose commands need nothing but the case.
SHORT = {"definitions": 12, "circuits": 3, "recordings": 7, "studies": 4, "bearings": 3}


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
    parser.add_argument("--short", action="store_true", help="a sample of some seconds")
    parser.add_argument("--page", type=Path, help="Markdown page to write")
    given = parser.parse_args(arguments)
    place = given.output.resolve()
    place.mkdir(parents=True, exist_ok=True)
    os.environ["SPINDLE_FEM_CACHE"] = str(place / "cache")
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    planned = _planned(given)
    if set(planned) - SHORT.keys():
        warm()
        make_originals(place)
    done = {(item["family"], item["number"]) for item in read_cases(place)}
    waiting = [
        (family, number)
        for family, count in planned.items()
        for number in range(1, count + 1)
        if (family, number) not in done
    ]
    # All families side by side: a fault of any shows early.
    waiting.sort(key=lambda case: case[1] / FAMILIES[case[0]][1])
    pool = ProcessPoolExecutor(given.jobs, multiprocessing.get_context("spawn"), initializer=warm)
    with pool, (place / CASES).open("a", encoding="utf-8") as lines:
        running = {pool.submit(try_case, *case, given.seed, place): case for case in waiting}
        for future in as_completed(running):
            item = _told(future, *running[future])
            print(json.dumps(item), file=lines, flush=True)
            if item["outcome"] == FAULT:
                print(f"{item['family']} {item['number']}: {item['reason']}", flush=True)
    found = summarise(read_cases(place), {name: count for name, (_, count) in FAMILIES.items()}, given.seed)
    (place / "result.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if given.page:
        given.page.write_text(page(found), encoding="utf-8")
    for family, item in found["families"].items():
        if item["done"]:
            told = ", ".join(f"{item[outcome]} {outcome}" for outcome in (ACCEPTED, REFUSED, FAULT))
            print(f"{family}: {item['done']} of {item['planned']} done, {told}")
    return int(bool(found["faults"]))


def _told(future: Future[dict[str, Any]], family: str, number: int) -> dict[str, Any]:
    """Result of a case; a trial that itself failed is a fault, and the others continue."""
    error = future.exception()
    if error is None:
        return future.result()
    return asdict(Record(family, number, outcome=FAULT, reason=f"the trial itself failed: {error!r}"))


def _planned(given: argparse.Namespace) -> dict[str, int]:
    """Number of requested cases of each family."""
    counts = SHORT if given.short else {name: count for name, (_, count) in FAMILIES.items()}
    chosen = {name: count for name, count in counts.items() if name in (given.only or counts)}
    return {name: min(count, given.cases or count) for name, count in chosen.items()}


if __name__ == "__main__":
    sys.exit(main())
