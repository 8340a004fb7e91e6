"""Whether two runs of a command gave the same numbers."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# Keys that differ from run to run, or from place to place.
_OF_THE_RUN = re.compile(r"wall|rss|timing|seconds|_time_s|versions|folder|path|pictured|scheduler")
# Main result file of each command.
MAIN_FILES = {
    "run": "summary.json",
    "sweep": "results.csv",
    "transient": "transient.json",
    "diagnose": "diagnosis.json",
    "simulate": "simulated.csv",
    "simulate_spindle": "simulated.csv",
}


def numbers_of(file: Path) -> dict[str, Any]:
    """Everything in a file except times and places, by its path in the file."""
    if file.suffix == ".csv":
        with file.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        return {k: v for k, v in _leaves(rows, "") if not _OF_THE_RUN.search(k)}
    content = json.loads(file.read_text(encoding="utf-8"))
    return {k: v for k, v in _leaves(content, "") if not _OF_THE_RUN.search(k)}


def _leaves(value: Any, at: str) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _leaves(item, f"{at}/{key}")
    elif isinstance(value, list):
        for number, item in enumerate(value):
            yield from _leaves(item, f"{at}/{number}")
    else:
        yield at, value


def difference(one: Path, other: Path) -> str:
    """First difference between two files of numbers; empty if there is none."""
    if not one.is_file():
        return f"there is no {one.name}"
    first, second = numbers_of(one), numbers_of(other)
    for key in sorted(first.keys() | second.keys()):
        if key not in first or key not in second or not _equal(first[key], second[key]):
            return f"{key}: {first.get(key)!r} and {second.get(key)!r}"
    return ""


def _equal(one: Any, other: Any) -> bool:
    return one == other or (one != one and other != other)
