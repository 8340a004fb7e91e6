"""Families of cases: what tries one of each, and how many there are."""

from __future__ import annotations

import os
import random
import shutil
from pathlib import Path
from typing import Any

from . import texts
from .definitions import try_circuit, try_definition
from .folders import try_folder
from .judged import FAULT, Record
from .kills import KILLS, try_kill
from .recordings import try_recording
from .studies import try_bearing, try_study
from .surroundings import TRIALS, try_surroundings
from .texts import try_text

# For each family: function that tries one case, and number of cases.
FAMILIES = {
    "definitions": (try_definition, 1800),
    "recordings": (try_recording, 1000),
    "studies": (try_study, 150),
    "circuits": (try_circuit, 200),
    "bearings": (try_bearing, 150),
    "folders": (try_folder, 200),
    "texts": (try_text, texts.count()),
    "kills": (try_kill, sum(KILLS.values())),
    "surroundings": (try_surroundings, len(TRIALS)),
}
# Where a command runs, and what it may leave beside that.
HERE = "here"
BESIDE = frozenset({HERE, f"{HERE}.out", f"{HERE}.err"})
# Files that hostile texts would write, and how the texts would appear in a page that runs them.
OUTSIDE = ("outside", "/tmp/outside")
LIVE = ("<script>alert(1)", "<img src=x")


def try_case(family: str, number: int, seed: int, place: Path) -> dict[str, Any]:
    """Try one case in its own folder, which is kept if it shows a fault."""
    folder = place / "work" / f"{family}_{number:04d}"
    shutil.rmtree(folder, ignore_errors=True)
    here = folder / HERE
    here.mkdir(parents=True)
    record = FAMILIES[family][0](number, random.Random(f"{seed}/{family}/{number}"), here)
    _look_round(record, folder)
    if record.outcome != FAULT:
        shutil.rmtree(folder, ignore_errors=True)
    return record.as_dict()


def _look_round(record: Record, folder: Path) -> None:
    """Check that only the requested output was written, and that no page runs a text of the input."""
    beside = {item.name for item in folder.iterdir()} - BESIDE
    if beside or any(os.path.lexists(name) for name in OUTSIDE if os.path.isabs(name)):
        record.fault(f"wrote outside its folder: {', '.join(sorted(beside)) or OUTSIDE[1]}")
    if any((folder / HERE).rglob(OUTSIDE[0])):
        record.fault("ran a text of its input")
    for page in (folder / HERE).rglob("*.html"):
        content = page.read_text(encoding="utf-8", errors="replace") if page.is_file() else ""
        if any(text in content for text in LIVE):
            record.fault(f"{page.name} holds a text of the input as it is")
