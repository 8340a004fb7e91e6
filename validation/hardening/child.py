"""One command in a process of its own, with limits, from a process that has loaded the package already."""

from __future__ import annotations

import gc
import importlib
import os
import pkgutil
import resource
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import xarray

import spindle_fem
from spindle_fem.units import registry

# Limits of every case: seconds of processor, and memory.
MOST_SECONDS, MOST_MB = 30.0, 2048.0
# A process that waits uses no processor: what it may take in all on a machine that does other work too.
MOST_WALL_SECONDS = 120.0
LOOK_EVERY_S = 0.01
# How long helpers of a killed process may go on.
MOST_ORPHANED_S = 20.0
WIDE = "200"


@dataclass(frozen=True, slots=True)
class Ended:
    """End of a process.

    Attributes
    ----------
    status : int
        Exit status; minus the signal that ended it.
    seconds, wall_seconds : float
        Of processor, and in all.
    peak_MB : float
        Largest resident memory.
    stopped : str
        Why it was stopped from outside; empty when it ended by itself.
    patient : bool
        Whether it was given a patience in place of the limits of a case: a whole command, not a spoilt input.
    """

    status: int
    seconds: float
    wall_seconds: float
    peak_MB: float
    out: str
    err: str
    stopped: str = ""
    patient: bool = False


@dataclass(slots=True)
class Surroundings:
    """Environment of a process.

    Attributes
    ----------
    environment : mapping
        Variables that are set; None takes one away.
    before : callable
        Called in the new process before the command.
    kill_after : float, optional
        Seconds of processor after which the process is killed, [s].
    patience_s : float, optional
        In place of the limits of a case.
    """

    environment: Mapping[str, str | None] = field(default_factory=dict)
    before: Callable[[], object] = lambda: None
    kill_after: float | None = None
    patience_s: float | None = None


def warm() -> None:
    """Load what commands load, once for all children: every module, units, readers of files."""
    for module in pkgutil.walk_packages(spindle_fem.__path__, "spindle_fem."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    for name in ("distributed", "h5netcdf", "matplotlib.pyplot"):
        importlib.import_module(name)
    xarray.backends.list_engines()
    registry()
    gc.freeze()


def run_command(arguments: Sequence[str], folder: Path, around: Surroundings | None = None) -> Ended:
    """``spindle-fem`` with these arguments, in a child of this warm process."""

    def command() -> int:
        import spindle_fem.cli

        sys.argv = ["spindle-fem", *arguments]
        spindle_fem.cli.main()
        return 0

    return run_function(command, folder, around)


def run_function(function: Callable[[], int], folder: Path, around: Surroundings | None = None) -> Ended:
    """A function in a child of this process; what it raises is shown as an interpreter shows it."""
    around = around or Surroundings()
    with _Streams(folder) as (out, err):
        started = time.perf_counter()
        child = os.fork()
        if child == 0:
            _be_child(function, folder, around, (out, err))
        return _watch(child, started, folder, around)


def run_process(
    arguments: Sequence[str], folder: Path, around: Surroundings | None = None, *, prefix: Sequence[str] = ()
) -> Ended:
    """Run the command in an interpreter of its own."""
    around = around or Surroundings()
    with _Streams(folder) as (out, err):
        started = time.perf_counter()
        process = subprocess.Popen(
            [*prefix, sys.executable, "-m", "spindle_fem", *arguments],
            cwd=folder,
            env=_environment(around),
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=err,
            start_new_session=True,
            preexec_fn=around.before,
        )
        return _watch(process.pid, started, folder, around)


class _Streams:
    """Files for what a process prints, in its folder."""

    def __init__(self, folder: Path) -> None:
        self.paths = _output_files(folder)
        self.handles: list[int] = []

    def __enter__(self) -> tuple[int, int]:
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        self.handles = [os.open(path, flags, 0o666) for path in self.paths]
        return self.handles[0], self.handles[1]

    def __exit__(self, *error: object) -> None:
        for handle in self.handles:
            os.close(handle)


def _output_files(folder: Path) -> tuple[Path, Path]:
    """Beside the folder: the folder itself is the command's."""
    return folder.with_name(folder.name + ".out"), folder.with_name(folder.name + ".err")


def _environment(around: Surroundings) -> dict[str, str]:
    changed = {**os.environ, "COLUMNS": WIDE, **around.environment}
    return {name: value for name, value in changed.items() if value is not None}


def _be_child(
    function: Callable[[], int], folder: Path, around: Surroundings, streams: tuple[int, int]
) -> None:
    status = 1
    try:
        os.setsid()
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(streams[0], 1)
        os.dup2(streams[1], 2)
        os.chdir(folder)
        wanted = _environment(around)
        for name in set(os.environ) - set(wanted):
            del os.environ[name]
        os.environ.update(wanted)
        around.before()
        status = function()
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # noqa: BLE001 - this is where the interpreter would print it
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except OSError:
                status = status or 1
        os._exit(status)


def _watch(child: int, started: float, folder: Path, around: Surroundings) -> Ended:
    """Wait for a process; stop it where it takes more than it may."""
    stopped = ""
    while True:
        done, code, usage = os.wait4(child, os.WNOHANG)
        wall = time.perf_counter() - started
        if done:
            break
        if not stopped:
            stopped = _reason_to_stop(child, wall, around)
            if stopped:
                os.kill(child, signal.SIGKILL)
        time.sleep(LOOK_EVERY_S)
    if stopped == "killed" and not _vanished(child):
        stopped = "killed, and left processes behind"
    _end_group(child)
    out, err = (path.read_bytes().decode("utf-8", "replace") for path in _output_files(folder))
    seconds, peak = usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0
    return Ended(
        os.waitstatus_to_exitcode(code), seconds, wall, peak, out, err, stopped, around.patience_s is not None
    )


def _reason_to_stop(child: int, wall: float, around: Surroundings) -> str:
    if wall > (around.patience_s or MOST_WALL_SECONDS):
        return "time"
    try:
        fields = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return ""
    # Fields 14, 15 and 24 of proc(5): user and system time in ticks, resident pages.
    used = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    if around.kill_after is not None and used > around.kill_after:
        return "killed"
    if around.patience_s is not None:
        return ""
    if used > MOST_SECONDS:
        return "time"
    resident = int(fields[21]) * resource.getpagesize() / 2**20
    return "memory" if resident > MOST_MB else ""


def _vanished(child: int) -> bool:
    """Whether all that a killed process started ends by itself."""
    until = time.perf_counter() + MOST_ORPHANED_S
    while time.perf_counter() < until:
        try:
            os.killpg(child, 0)
        except ProcessLookupError:
            return True
        time.sleep(10 * LOOK_EVERY_S)
    return False


def _end_group(child: int) -> None:
    """End what a child left behind."""
    try:
        os.killpg(child, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        return
