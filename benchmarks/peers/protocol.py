"""Input and report of every program of the comparison; needs numpy alone.

A program is called as ``PYTHON run_NAME.py CASE_FOLDER OUTPUT.npz [--steps N]``.
It prints one line of JSON: the seconds of each stage, iterations, threads, the
peak memory of its process. ``OUTPUT.npz`` holds the temperatures at the nodes
of ``problem.npz`` after the steady solve and after the steps.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

# Relative residual required of every iterative solver; results are compared in kelvin.
RELATIVE_TOLERANCE = 1e-8


@dataclass
class Problem:
    """Arrays of ``problem.npz``; see ``case.write_case``."""

    points: np.ndarray
    tetrahedra: np.ndarray
    part_of_element: np.ndarray
    part_conductivity: np.ndarray
    part_capacity: np.ndarray
    facets: np.ndarray
    film_coefficient: np.ndarray
    ambient_temperature: np.ndarray
    heat_flux: np.ndarray
    start_temperature: float
    step_s: float
    heat_factor: np.ndarray

    @classmethod
    def read(cls, folder: Path) -> Problem:
        """Read a case's problem."""
        with np.load(Path(folder) / "problem.npz") as data:
            values = {name: data[name] for name in data.files}
        for name in ("start_temperature", "step_s"):
            values[name] = float(values[name])
        return cls(**values)

    @property
    def conductivity(self) -> np.ndarray:
        """Conductivity of each element, (n_elements,) [W/(m·K)]."""
        return self.part_conductivity[self.part_of_element]

    @property
    def capacity(self) -> np.ndarray:
        """Volumetric, of each element, (n_elements,) [J/(m³·K)]."""
        return self.part_capacity[self.part_of_element]

    def flux(self, heat_factor: float = 1.0) -> np.ndarray:
        """Heat flux into each facet at the start temperature, (n_facets,) [W/m²].

        Unknowns count from the start temperature: round-off and relative
        tolerances then refer to the rise.
        """
        film = self.film_coefficient * (self.ambient_temperature - self.start_temperature)
        return film + heat_factor * self.heat_flux


@dataclass
class Record:
    """Seconds of stages and other figures of one process.

    Processor seconds (of all threads of this process) are more reliable than wall time
    where the machine has other work.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    processor_seconds: dict[str, float] = field(default_factory=dict)
    notes: dict[str, object] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a stage; entered twice, the times add up."""
        begin, busy = time.perf_counter(), time.process_time()
        yield
        for times, spent in (
            (self.seconds, time.perf_counter() - begin),
            (self.processor_seconds, time.process_time() - busy),
        ):
            times[name] = times.get(name, 0.0) + spent


def peak_kilobytes() -> int:
    """Largest resident memory of this process so far, without that of the program that started it.

    ``ru_maxrss`` would keep what the process held before its own program was loaded.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1])


def resident_kilobytes() -> int:
    """Resident memory of this process now."""
    with Path("/proc/self/statm").open(encoding="ascii") as stream:
        return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024


def main(run: Callable[[Path, int, Record], tuple[np.ndarray, np.ndarray | None]]) -> None:
    """Parse the command line, run, write temperatures, print the record."""
    parser = argparse.ArgumentParser()
    parser.add_argument("case", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--steps", type=int, default=0)
    arguments = parser.parse_args()
    record = Record()
    record.notes["libraries_kB"] = resident_kilobytes()
    steady, last = run(arguments.case, arguments.steps, record)
    record.notes.setdefault("peak_kB", peak_kilobytes())
    arrays = {"steady": steady} | ({} if last is None else {"last": last})
    np.savez(arguments.output, **arrays)
    times = {"seconds": record.seconds, "processor_seconds": record.processor_seconds}
    json.dump(times | record.notes, sys.stdout)
    print(flush=True)
