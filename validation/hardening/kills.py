"""Commands killed at random moments: nothing half-written counts as whole, the same command succeeds."""

from __future__ import annotations

import csv
import io
import random
import shutil
from pathlib import Path

import numpy as np

from .child import Ended, Surroundings, run_command
from .judged import BAD_INPUT, Record
from .material import CACHE, FOLDERS, MESH, ORIGINALS, PATIENT, spent_on
from .same_numbers import MAIN_FILES, difference

# How many of each are killed; what a kill hits shares its cache or begins with an empty one.
KILLS = {
    "run": 10,
    "sweep": 14,
    "transient": 10,
    "diagnose": 14,
    "report": 24,
    "mesh cache": 24,
    "model cache": 4,
}
# A command that ended before its kill is tried again with a moment this much earlier.
EARLIER = 0.5


def kind_of(number: int) -> str:
    """Target of the kill of this number."""
    kinds = [name for name, count in KILLS.items() for _ in range(count)]
    return kinds[number - 1]


def try_kill(number: int, chance: random.Random, folder: Path) -> Record:
    """Kill once, inspect the remains, and run the same command again."""
    kind = kind_of(number)
    record = Record("kills", number, [kind])
    originals = folder.parents[2] / ORIGINALS
    for file in [*originals.glob("*.toml"), *originals.glob("*.csv")]:
        shutil.copy(file, folder)
    arguments, around = _command(kind, folder, originals)
    moment = chance.random() * spent_on(originals, kind)
    while not (killed := _killed(arguments, folder, around, moment)).stopped:
        if killed.status != 0:
            record.step("first", killed)
            return record
        for name in ("out", "cache"):
            shutil.rmtree(folder / name, ignore_errors=True)
        _command(kind, folder, originals)
        moment *= EARLIER
    record.done.append(f"killed after {killed.seconds:.2f} s of processor")
    if killed.stopped != "killed":
        record.fault(killed.stopped)
    before = _rows(folder / "out")
    _look_at(record, kind, folder, originals)
    again = run_command(arguments, folder, Surroundings(around.environment, patience_s=PATIENT))
    record.step("again", again)
    if record.outcome == "accepted":
        _compare(record, kind, folder, originals)
        after = _rows(folder / "out")
        if any(after.get(key) != row for key, row in before.items()):
            record.fault("a finished row is not there any more")
    return record


def _command(kind: str, folder: Path, originals: Path) -> tuple[list[str], Surroundings]:
    if kind == "report":
        shutil.copytree(originals / "run", folder / "out", dirs_exist_ok=True)
        return ["report", "out"], Surroundings()
    cache = folder / "cache"
    if kind == "mesh cache":
        cache.mkdir(exist_ok=True)
        return list(MESH), Surroundings({"SPINDLE_FEM_CACHE": str(cache)})
    if kind == "model cache":
        shutil.copytree(originals / CACHE, cache, dirs_exist_ok=True)
        for entry in cache.glob("reduced-*"):
            entry.unlink()
        around = Surroundings({"SPINDLE_FEM_CACHE": str(cache)})
        return ["out" if item == "simulate_spindle" else item for item in FOLDERS["simulate_spindle"]], around
    # the command itself bears the name of its folder
    command, *rest = FOLDERS[kind]
    return [command, *("out" if item == kind else item for item in rest)], Surroundings()


def _killed(arguments: list[str], folder: Path, around: Surroundings, moment: float) -> Ended:
    return run_command(
        arguments, folder, Surroundings(around.environment, kill_after=moment, patience_s=PATIENT)
    )


def _look_at(record: Record, kind: str, folder: Path, originals: Path) -> None:
    """Check that remains are marked, or whole, or refused; entries of the cache are whole."""
    for entry in (folder / "cache").glob("*.npz"):
        with np.load(entry, allow_pickle=False) as data:
            for name in data.files:
                data[name].sum() if data[name].dtype.kind in "fiu" else data[name].tolist()
    out = folder / "out"
    if kind in ("report", "mesh cache") or not out.is_dir():
        return
    name = "simulate_spindle" if kind == "model cache" else kind
    whole = not (out / "INCOMPLETE").exists() and not difference(
        out / MAIN_FILES[name], originals / name / MAIN_FILES[name]
    )
    if not whole:
        report = run_command(["report", "out"], folder)
        if report.status != BAD_INPUT:
            record.fault(f"report of what was left ended with {report.status}: {report.err[-200:]}")


def _rows(out: Path) -> dict[str, dict[str, str]]:
    """Whole rows of a sweep's table by key."""
    table = out / "results.csv"
    if not table.is_file():
        return {}
    whole = table.read_text(encoding="utf-8").rpartition("\n")[0]
    return {row["key"]: row for row in csv.DictReader(io.StringIO(whole)) if "key" in row}


def _compare(record: Record, kind: str, folder: Path, originals: Path) -> None:
    if kind == "mesh cache":
        same = (folder / "out.msh").read_bytes() == (originals / "out.msh").read_bytes()
        told = "" if same else "the mesh"
    elif kind == "report":
        names = {file.name for file in (folder / "out").iterdir()}
        told = "no report.html" if "report.html" not in names else ""
        told = told or difference(folder / "out" / "summary.json", originals / "run" / "summary.json")
    else:
        name = "simulate_spindle" if kind == "model cache" else kind
        told = difference(folder / "out" / MAIN_FILES[name], originals / name / MAIN_FILES[name])
    if told:
        record.fault(f"another result after the kill: {told}")
