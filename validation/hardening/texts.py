"""Texts that mean something elsewhere, as names and titles of what is run, drawn, reported and exported."""

from __future__ import annotations

import importlib.util
import random
from pathlib import Path
from typing import Any

import tomli_w

from .child import Surroundings, run_command, run_function
from .judged import ACCEPTED, Record
from .material import PATIENT, PUMP, SPINDLE, pump_recording, tables
from .mutations import HOSTILE, copied

# Texts that are also carried through a run with fields, pictures and page: markup, a template, a shell's.
RUN = (0, 1, 2, 6)
NAMES, COLUMNS = ("motor", "casing", "ambient", "power"), ("T1", "T2", "room", "P")


def count() -> int:
    """Number of cases."""
    return len(HOSTILE) + len(RUN)


def try_text(number: int, chance: random.Random, folder: Path) -> Record:
    """One text in place of every name."""
    if number > len(HOSTILE):
        text = HOSTILE[RUN[number - len(HOSTILE) - 1]]
        return _try_run(Record("texts", number, [text[:40]]), text, folder)
    text = HOSTILE[number - 1]
    record = Record("texts", number, [text[:40]])
    machine = tables(PUMP.read_text(encoding="utf-8"))
    _write(folder / "names.toml", _renamed(machine, text) | {"name": text})
    record.step("names", run_command(["check", "names.toml"], folder))
    record.refused_rightly()
    # names are of letters and few signs, what follows is for readers and free
    _write(folder / "machine.toml", machine | {"description": text})
    manifest, frame = pump_recording()
    for channel in manifest["channel"]:
        channel["column"] = text + channel["column"]
    _write(folder / "recording.toml", manifest | {"name": text, "description": text})
    frame.rename(columns={name: text + name for name in COLUMNS}).to_csv(folder / "data.csv", index=False)
    simulate = ["simulate", "machine.toml", "recording.toml", "-o", "out"]
    if record.step("simulate", run_command(simulate, folder)) == ACCEPTED:
        record.step("view", run_command(["view", "out"], folder))
        record.step("show", run_command(["recording", "show", "recording.toml", "-o", "out.png"], folder))
    record.step("export c", run_command(["export", "machine.toml", "-o", "out2/model.c"], folder))
    if (
        record.step("export", run_command(["export", "machine.toml", "-o", "out2/model.py"], folder))
        == ACCEPTED
    ):
        record.step("import", run_function(lambda: _imported(folder / "out2" / "model.py"), folder))
    return record


def _write(file: Path, content: dict[str, Any]) -> None:
    file.write_text(tomli_w.dumps(content), encoding="utf-8")


def _renamed(tree: dict[str, Any], text: str) -> dict[str, Any]:
    """Every name with the text before it."""

    def changed(value: object) -> object:
        if isinstance(value, dict):
            return {key: item if key == "schema" else changed(item) for key, item in value.items()}
        if isinstance(value, list):
            return [changed(item) for item in value]
        return text + value if value in NAMES else value

    return changed(copied(tree))


def _try_run(record: Record, text: str, folder: Path) -> Record:
    machine = tables(Path(SPINDLE).read_text(encoding="utf-8"))
    _write(folder / "machine.toml", machine | {"title": text, "description": text})
    around = Surroundings(patience_s=PATIENT)
    if record.step("run", run_command(["run", "machine.toml", "-o", "out"], folder, around)) == ACCEPTED:
        record.step("view", run_command(["view", "out"], folder))
    return record


def _imported(file: Path) -> int:
    """Load an exported module, which runs its code."""
    found = importlib.util.spec_from_file_location("exported", file)
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    module.model()
    return 0
