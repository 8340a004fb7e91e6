"""Full disks, folders that cannot be written, no home, no network, two users, eight commands at once."""

from __future__ import annotations

import contextlib
import os
import random
import resource
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from .child import Surroundings, run_command, run_function, run_process
from .judged import ACCEPTED, BAD_INPUT, OTHER_REFUSAL, Record
from .material import COARSE, FOLDERS, ORIGINALS, PATIENT, PUMP, SPINDLE
from .same_numbers import MAIN_FILES, difference

# Largest file that a full disk takes, bytes: a message, less and more than tables, pictures and fields.
SIZES = (600, 4_000, 60_000, 400_000)
# Commands that write: folders as in the material, and single files.
SINGLE_FILES = {
    "mesh": ("mesh", SPINDLE, "-o", "out.vtu", *COARSE),
    "step": ("mesh", SPINDLE, "-o", "out.step"),
    "draft": ("recording", "draft", "pump.csv", "-o", "out"),
    "show": ("recording", "show", "pump.toml", "-o", "out.png"),
    "new": ("new", "-o", "out.toml"),
    "picture": ("check", SPINDLE, "--picture", "out.png"),
    "export": ("export", str(PUMP), "-o", "out.json"),
    "export c": ("export", str(PUMP), "-o", "out.c"),
}
LIMITED, MOUNTED = "a limit on files", "a full file system"
MOUNT_SIZES = ("64k", "1m")
NOBODY = 65534
AT_ONCE = ("run", "run", "simulate_spindle", "simulate_spindle", "sweep", "transient", "simulate", "diagnose")

Trial = Callable[[Record, Path, Path], None]


def _arguments(kind: str, out: str = "out") -> list[str]:
    if kind in SINGLE_FILES:
        return [
            item.replace("out", out, 1) if item.startswith("out") else item for item in SINGLE_FILES[kind]
        ]
    command, *rest = FOLDERS[kind]
    return [command, *(out if item == kind else item for item in rest)]


def _compare(record: Record, kind: str, out: Path, originals: Path) -> None:
    if kind in MAIN_FILES:
        told = difference(out / MAIN_FILES[kind], originals / kind / MAIN_FILES[kind])
        if told:
            record.fault(f"another result: {told}")


def _finish(record: Record, kind: str, folder: Path, originals: Path) -> None:
    """Run the command again with room: it succeeds, with the same numbers."""
    record.step("again", run_command(_arguments(kind), folder, Surroundings(patience_s=PATIENT)))
    _compare(record, kind, folder / "out", originals)


def _full_disk(kind: str, size: int, record: Record, folder: Path, originals: Path) -> None:
    """No file grows beyond a size: the system reports it like a full disk, except for the error number."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

    ended = run_command(_arguments(kind), folder, Surroundings(before=limit, patience_s=PATIENT))
    outcome = record.step("full", ended, (OTHER_REFUSAL, BAD_INPUT))
    out = folder / "out"
    if outcome == ACCEPTED:
        _compare(record, kind, out, originals)
        cut = [path.name for path in folder.rglob("out*") if path.is_file() and path.stat().st_size == size]
        if cut:
            record.fault(f"cut without a word: {', '.join(cut)}")
        return
    if kind in FOLDERS and out.is_dir() and any(out.iterdir()) and not (out / "INCOMPLETE").exists():
        record.fault("what was left is not marked")
    record.refused_rightly()
    _finish(record, kind, folder, originals)


def _mounted(kind: str, size: str, record: Record, folder: Path, originals: Path) -> None:
    """A small file system of its own for the results."""
    out = folder / "out"
    out.mkdir()
    with _file_system(out, f"size={size}") as mounted:
        if not mounted:
            record.done.append("not permitted here")
            return
        around = Surroundings(patience_s=PATIENT)
        record.step("full", run_command(_arguments(kind), folder, around), (OTHER_REFUSAL, BAD_INPUT))
        if record.outcome == ACCEPTED:
            return
        record.refused_rightly()
        subprocess.run(["mount", "-o", "remount,size=100m", str(out)], check=True)
        _finish(record, kind, folder, originals)


@contextlib.contextmanager
def _file_system(at: Path, options: str) -> Iterator[bool]:
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "hardening", str(at)], capture_output=True, check=False
    )
    try:
        yield done.returncode == 0
    finally:
        if done.returncode == 0:
            subprocess.run(["umount", "-l", str(at)], check=False)


def _read_only(kind: str, record: Record, folder: Path, originals: Path) -> None:
    place = folder / "out"
    place.mkdir()
    with _file_system(place, "size=1m,ro") as mounted:
        if not mounted:
            place.chmod(0o500)
        ended = run_command(_arguments(kind, "out/new"), folder)
        if record.step("read only", ended) == ACCEPTED:
            record.fault("wrote where nothing can be written")
    record.refused_rightly()


def _cache_read_only(kind: str, record: Record, folder: Path, originals: Path) -> None:
    """A cache that cannot be written costs time, no result."""
    cache = folder / "cache"
    cache.mkdir()
    with _file_system(cache, "size=1m,ro") as mounted:
        if not mounted:
            cache.chmod(0o500)
        around = Surroundings({"SPINDLE_FEM_CACHE": str(cache)}, patience_s=PATIENT)
        record.step("cache", run_command(_arguments(kind), folder, around))
    _compare(record, kind, folder / "out", originals)


def _cache_full(kind: str, record: Record, folder: Path, originals: Path) -> None:
    cache = folder / "cache"
    cache.mkdir()
    with _file_system(cache, "size=200k") as mounted:
        if not mounted:
            record.done.append("not permitted here")
            return
        around = Surroundings({"SPINDLE_FEM_CACHE": str(cache)}, patience_s=PATIENT)
        record.step("cache", run_command(_arguments(kind), folder, around))
    _compare(record, kind, folder / "out", originals)


def _no_home(kind: str, record: Record, folder: Path, originals: Path) -> None:
    nowhere = str(folder / "nowhere" / "at all")
    changed: dict[str, str | None] = {"HOME": None, "XDG_CACHE_HOME": nowhere, "SPINDLE_FEM_CACHE": None}
    record.step("no home", run_process(_arguments(kind), folder, Surroundings(changed, patience_s=PATIENT)))
    _compare(record, kind, folder / "out", originals)
    shutil.rmtree(folder / "nowhere", ignore_errors=True)


def _no_network(kind: str, record: Record, folder: Path, originals: Path) -> None:
    prefix = ["unshare", "-n"]
    if subprocess.run([*prefix, "true"], capture_output=True, check=False).returncode != 0:
        record.done.append("not permitted here")
        return
    around = Surroundings(patience_s=PATIENT)
    record.step("no network", run_process(_arguments(kind), folder, around, prefix=prefix))
    _compare(record, kind, folder / "out", originals)


def _two_users(kind: str, record: Record, folder: Path, originals: Path) -> None:
    """Another user with what the first one left in a cache that both may write."""
    if os.getuid() != 0:
        record.done.append("not permitted here")
        return
    cache = folder / "cache"
    cache.mkdir()
    folder.chmod(0o777)
    cache.chmod(0o777)

    def both() -> int:
        import sys

        from spindle_fem.command_line.application import app

        # as the first user to write and to read, so that all that Python needs is loaded, then as another
        for out in ("out2", "out2", "out"):
            if out == "out":
                os.setgid(NOBODY)
                os.setuid(NOBODY)
            sys.argv = ["spindle-fem", *_arguments(kind, out)]
            app(sys.argv[1:], standalone_mode=False)
        return 0

    around = Surroundings({"SPINDLE_FEM_CACHE": str(cache)}, patience_s=PATIENT)
    record.step("two users", run_function(both, folder, around))
    _compare(record, kind, folder / "out", originals)
    unread = [item.name for item in cache.glob("*.npz") if not item.stat().st_mode & 0o044]
    if unread:
        record.fault(f"entries that another user cannot read: {', '.join(unread)}")


def _at_once(record: Record, folder: Path, originals: Path) -> None:
    """Eight commands on one empty cache."""
    around = Surroundings({"SPINDLE_FEM_CACHE": str(folder / "cache")}, patience_s=2 * PATIENT)

    def one(position: int) -> tuple[str, str]:
        place = folder / f"out{position}"
        place.mkdir()
        for file in [*originals.glob("*.toml"), *originals.glob("*.csv")]:
            shutil.copy(file, place)
        kind = AT_ONCE[position]
        ended = run_process(_arguments(kind), place, around)
        record.step(kind, ended)
        return kind, difference(place / "out" / MAIN_FILES[kind], originals / kind / MAIN_FILES[kind])

    with ThreadPoolExecutor(len(AT_ONCE)) as threads:
        for kind, told in threads.map(one, range(len(AT_ONCE))):
            if told:
                record.fault(f"{kind} at once with others: {told}")


def _trials() -> list[tuple[str, Trial]]:
    found: list[tuple[str, Trial]] = []
    for kind in (*FOLDERS, *SINGLE_FILES):
        if kind == "simulate_spindle":
            continue
        # whole folders take long: every other size
        for size in SIZES[1::2] if kind in FOLDERS else SIZES:
            found.append((f"{LIMITED} of {size} bytes: {kind}", partial(_full_disk, kind, size)))
        found.append((f"a folder that cannot be written: {kind}", partial(_read_only, kind)))
    for kind in ("run", "transient", "simulate", "diagnose"):
        found += [(f"{MOUNTED} of {size}: {kind}", partial(_mounted, kind, size)) for size in MOUNT_SIZES]
        found.append((f"no home: {kind}", partial(_no_home, kind)))
        found.append((f"no network: {kind}", partial(_no_network, kind)))
    for kind in ("run", "sweep"):
        found.append((f"a cache that cannot be written: {kind}", partial(_cache_read_only, kind)))
        found.append((f"a full cache: {kind}", partial(_cache_full, kind)))
    found.append(("two users on one cache: mesh", partial(_two_users, "mesh")))
    found.append(("two users on one cache: sweep", partial(_two_users, "sweep")))
    found.append(("eight commands at once on one cache", _at_once))
    return found


TRIALS = _trials()


def try_surroundings(number: int, chance: random.Random, folder: Path) -> Record:
    """One trial of the list above."""
    name, trial = TRIALS[number - 1]
    record = Record("surroundings", number, [name])
    originals = folder.parents[2] / ORIGINALS
    for file in [*originals.glob("*.toml"), *originals.glob("*.csv")]:
        shutil.copy(file, folder)
    trial(record, folder, originals)
    return record
