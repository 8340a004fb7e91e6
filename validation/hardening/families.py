"""Families of cases: what tries one of each, and how many there are."""

from __future__ import annotations

import random
import shutil
from pathlib import Path
from typing import Any

from .definitions import try_definition
from .judged import FAULT

# Of each family: what tries one case, and how many cases there are.
FAMILIES = {"definitions": (try_definition, 2000)}


def try_case(family: str, number: int, seed: int, place: Path) -> dict[str, Any]:
    """One case, in a folder of its own that stays where it shows a fault."""
    folder = place / "work" / f"{family}_{number:04d}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    record = FAMILIES[family][0](number, random.Random(f"{seed}/{family}/{number}"), folder)
    if record.outcome != FAULT:
        shutil.rmtree(folder, ignore_errors=True)
        for suffix in (".out", ".err"):
            folder.with_name(folder.name + suffix).unlink(missing_ok=True)
    return record.as_dict()
