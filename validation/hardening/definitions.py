"""Spoilt definitions of machines: checked, and solved where they are accepted."""

from __future__ import annotations

import random
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from .child import run_command, run_function, run_process
from .judged import ACCEPTED, BAD_INPUT, OTHER_REFUSAL, Record
from .mutations import HOSTILE, NUMBERS, UNITS, mutated
from .solved import solve_elements, solve_lumped, solve_written

ROOT = Path(__file__).parents[2]
# Numbers that these divide are checked by an interpreter of their own, solved by finite elements, and run.
EVERY_PROCESS, EVERY_ELEMENTS, EVERY_RUN = 50, 12, 100
SHARE_OVERRIDES = 0.1
OVERRIDDEN = ("operation.speed", "operation.thrust", "channel.depth", "channel.pitch", "coolant.flow")
OVERRIDDEN = (*OVERRIDDEN, "mesh.preset", "heat.model", "channel.turns", "part.0.name", "name", "x.y.z", "")


@cache
def sources() -> dict[str, dict[str, Any]]:
    """Tables of every definition that is at hand, by name; those with a base as they are written."""
    return _tables_of([*sorted((ROOT / "geometry").glob("*.toml")), ROOT / "examples" / "pump.toml"])


@cache
def circuit_sources() -> dict[str, dict[str, Any]]:
    """Tables of machines with circuits, streams, oil and unlike bearings beside what ships."""
    return _tables_of(sorted(Path(__file__).with_name("machines").glob("*.toml")))


def _tables_of(files: list[Path]) -> dict[str, dict[str, Any]]:
    return {path.stem: tomllib.loads(path.read_text(encoding="utf-8")) for path in files}


def try_definition(number: int, chance: random.Random, folder: Path) -> Record:
    """Check one spoilt definition; solve it where it is accepted."""
    return _try(Record("definitions", number), sources(), chance, folder)


def try_circuit(number: int, chance: random.Random, folder: Path) -> Record:
    """The same of a machine with circuits, streams, oil or unlike bearings."""
    return _try(Record("circuits", number), circuit_sources(), chance, folder)


def _try(record: Record, tables: dict[str, dict[str, Any]], chance: random.Random, folder: Path) -> Record:
    name = chance.choice(sorted(tables))
    content, record.done = mutated(chance, tables[name])
    record.done.insert(0, name)
    file = folder / "machine.toml"
    file.write_bytes(content)
    given = ["--set", _override(chance)] if chance.random() < SHARE_OVERRIDES else []
    record.done += given
    run = run_process if record.number % EVERY_PROCESS == 0 else run_command
    if record.step("check", run(["check", file.name, *given], folder)) == ACCEPTED:
        _run_accepted(record, file, given, folder)
    return record


def _override(chance: random.Random) -> str:
    value = chance.choice([f"{chance.choice(NUMBERS)} {chance.choice(UNITS)}", *HOSTILE])
    return f"{chance.choice(OVERRIDDEN)}{chance.choice(('=', '=', '==', ' '))}{value}".replace("\0", "")


def _run_accepted(record: Record, file: Path, given: list[str], folder: Path) -> None:
    refusals, overrides = (BAD_INPUT, OTHER_REFUSAL), given[1:]
    if record.number % EVERY_RUN == 0 and "[[network" not in file.read_text(encoding="utf-8"):
        record.ran = "run"
        arguments = ["run", file.name, "-o", "out", *given, "--set", "mesh.preset=coarse"]
        record.step("run", run_command(arguments, folder), refusals)
        return
    if "[[network" in file.read_text(encoding="utf-8"):
        record.ran, solve = "written network", solve_written
    elif record.number % EVERY_ELEMENTS == 0:
        record.ran, solve = "elements", solve_elements
    else:
        record.ran, solve = "lumped network", solve_lumped
    record.step(record.ran, run_function(lambda: solve(file, overrides), folder), refusals)
