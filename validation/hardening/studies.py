"""Spoilt studies and bearing files."""

from __future__ import annotations

import random
from pathlib import Path

from .child import run_command, run_process
from .judged import OTHER_REFUSAL, Record
from .material import BALL, BEARINGS, COARSE, ROLLER, SPINDLE, SWEEP, TRANSIENT, tables
from .mutations import mutated

EVERY_PROCESS = 50
# Of ten cases, the number for each file: bearings are quick.
FILES = {"ball": 5, "roller": 2, "sweep": 2, "transient": 1}
TEXTS = {"ball": BALL, "roller": ROLLER, "sweep": SWEEP, "transient": TRANSIENT}


def try_study(number: int, chance: random.Random, folder: Path) -> Record:
    """One mutated study or bearing file, given to its command."""
    record = Record("studies", number)
    order = [name for name, share in FILES.items() for _ in range(share)]
    kind = order[number % len(order)]
    content, done = mutated(chance, tables(TEXTS[kind]))
    record.done = [kind, *done]
    (folder / "file.toml").write_bytes(content)
    arguments = {
        "sweep": ["sweep", SPINDLE, "file.toml", "-o", "out", *COARSE],
        "transient": ["transient", "file.toml", "-o", "out", *COARSE],
    }.get(kind, ["bearing", "file.toml", "--json"])
    run = run_process if number % EVERY_PROCESS == 0 else run_command
    # A file that is read well may be impossible: no equilibrium of a bearing, no steady state of a machine.
    record.step(kind, ended := run(arguments, folder), (2, OTHER_REFUSAL))
    if ended.stopped == "time" and (folder / "out" / "INCOMPLETE").is_file():
        record.long_work()
    return record


def try_bearing(number: int, chance: random.Random, folder: Path) -> Record:
    """One mutated bearing file with what the plain ones of the studies do not have."""
    record = Record("bearings", number)
    kind = sorted(BEARINGS)[number % len(BEARINGS)]
    content, done = mutated(chance, tables(BEARINGS[kind]))
    record.done = [kind, *done]
    (folder / "file.toml").write_bytes(content)
    run = run_process if number % EVERY_PROCESS == 0 else run_command
    record.step(kind, run(["bearing", "file.toml", "--json"], folder), (2, OTHER_REFUSAL))
    return record
