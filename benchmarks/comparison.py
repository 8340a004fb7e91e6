"""Programs that solve the benchmark's problem, and how they are run side by side."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent / "peers"
OURS = "spindle_fem"
# Temperatures of two programs are those of one discrete problem when they differ by no more, K.
AGREEMENT_K = 1e-5
TIME_LIMIT_S = 300.0
STEADY = ("assembly", "setup", "solve", "whole run")


@dataclass(frozen=True, slots=True)
class Program:
    """One way to solve the problem.

    Attributes
    ----------
    name : str
    script : str
        In ``peers/``.
    needs : str
        Module that must be importable, or command that must be found (``$ccx``).
    arguments : tuple of str
    launcher : tuple of str
        Before the interpreter.
    environment : mapping of str to str
    largest, largest_steps : int
        Nodes above which it, or its steps, are left out: they would take all the memory or hours.
    """

    name: str
    script: str
    needs: str
    arguments: tuple[str, ...] = ()
    launcher: tuple[str, ...] = ()
    environment: dict[str, str] = field(default_factory=dict)
    largest: int = 10_000_000
    largest_steps: int = 10_000_000


_TWO_RANKS = ("mpirun", "--allow-run-as-root", "--oversubscribe", "-n", "2")
PROGRAMS = (
    Program(OURS, "run_spindle_fem.py", "spindle_fem", environment={"SPINDLE_FEM_THREADS": "2"}),
    Program(
        f"{OURS}, 1 thread", "run_spindle_fem.py", "spindle_fem", environment={"SPINDLE_FEM_THREADS": "1"}
    ),
    Program("DOLFINx, GAMG, 2 processes", "run_dolfinx.py", "dolfinx", launcher=_TWO_RANKS),
    Program("DOLFINx, GAMG, 1 process", "run_dolfinx.py", "dolfinx"),
    Program("DOLFINx, hypre, 2 processes", "run_dolfinx.py", "dolfinx", ("--hypre",), _TWO_RANKS),
    Program("MFEM, Gauss-Seidel CG", "run_mfem.py", "mfem", largest_steps=300_000),
    Program("NGSolve, h1amg, 2 threads", "run_ngsolve.py", "ngsolve", largest_steps=0),
    Program("NGSolve, Jacobi CG, 2 threads", "run_ngsolve.py", "ngsolve", ("--local",), largest_steps=0),
    Program(
        "numpy + PARDISO, 2 threads",
        "run_pardiso.py",
        "pypardiso",
        environment={"MKL_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"},
        largest=300_000,
    ),
    Program(
        "scikit-fem + pyamg, as in its examples", "run_skfem.py", "skfem", largest=300_000, largest_steps=0
    ),
    Program("CalculiX, iterative", "run_calculix.py", "$ccx", largest=300_000, largest_steps=0),
)


def find_python(program: Program, interpreters: list[str]) -> str | None:
    """The first interpreter that has what a program needs; None when none has."""
    if program.needs == OURS:
        return interpreters[0]
    if program.needs.startswith("$"):
        return interpreters[0] if shutil.which(program.needs[1:]) else None
    if program.launcher and not shutil.which(program.launcher[0]):
        return None
    for python in interpreters:
        check = f"import importlib.util as u, sys; sys.exit(u.find_spec({program.needs!r}) is None)"
        if subprocess.run([python, "-c", check], capture_output=True, check=False).returncode == 0:
            return python
    return None


def run_program(program: Program, python: str, case: Path, steps: int) -> tuple[dict, dict[str, np.ndarray]]:
    """One process: its record and its temperatures. A failure is a record with ``error``."""
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "MKL_NUM_THREADS": "1",
        # threads that spin while they wait take the cores from those that work
        "OMP_WAIT_POLICY": "PASSIVE",
        "PEER_THREADS": "2",
        **program.environment,
    }
    if program.needs == OURS:
        root = str(Path(__file__).resolve().parents[1])
        environment["PYTHONPATH"] = os.pathsep.join([root, environment.get("PYTHONPATH", "")])
    with tempfile.TemporaryDirectory() as work:
        output = Path(work) / "temperatures.npz"
        command = [*program.launcher, python, str(FOLDER / program.script), str(case), str(output)]
        command += [*program.arguments, "--steps", str(steps)]
        try:
            done = subprocess.run(
                command, env=environment, capture_output=True, text=True, timeout=TIME_LIMIT_S, check=False
            )
        except subprocess.TimeoutExpired:
            return {"error": f"not done in {TIME_LIMIT_S:.0f} s"}, {}
        if done.returncode or not output.exists():
            return {"error": (done.stderr.strip() or "no output").splitlines()[-1][:200]}, {}
        with np.load(output) as data:
            fields = {name: data[name] for name in data.files}
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    return json.loads(lines[-1]), fields


def steady_seconds(record: dict, times: str = "seconds") -> float:
    """Assembly, set-up and solution of one process, s; or ``processor_seconds``."""
    return sum(record[times].get(stage, 0.0) for stage in STEADY)


def compare(
    case: Path, nodes: int, steps: int, repeats: int, chosen: list[tuple[Program, str]]
) -> list[dict]:
    """Rows of one case: every program in turn, ``repeats`` times, minima and the largest differences.

    The program named first is what temperatures and ratios refer to.
    """
    records: dict[str, list[dict]] = {program.name: [] for program, _ in chosen}
    fields: dict[str, dict[str, np.ndarray]] = {}
    for turn in range(repeats):
        for program, python in chosen:
            if nodes > program.largest or any("error" in item for item in records[program.name]):
                continue
            record, found = run_program(program, python, case, steps if nodes <= program.largest_steps else 0)
            records[program.name].append(record)
            fields.setdefault(program.name, found)
            told = record.get("error") or f"{steady_seconds(record):.3f} s"
            print(f"  {nodes} nodes, turn {turn + 1}: {program.name}: {told}", file=sys.stderr, flush=True)
    reference = fields.get(chosen[0][0].name, {})
    return [_row(program, records[program.name], fields.get(program.name, {}), reference, nodes)
            for program, _ in chosen]  # fmt: skip


def _row(program: Program, records: list[dict], fields: dict, reference: dict, nodes: int) -> dict:
    row: dict = {"program": program.name, "nodes": nodes}
    if not records:
        return row | {"error": f"left out above {program.largest} nodes"}
    failed = next((record["error"] for record in records if "error" in record), None)
    if failed:
        return row | {"error": failed}
    stages = {name for record in records for name in record["seconds"]}
    row["seconds"] = {
        name: min(record["seconds"][name] for record in records if name in record["seconds"])
        for name in sorted(stages)
    }
    row["steady_s"] = min(steady_seconds(record) for record in records)
    if all("processor_seconds" in record for record in records):
        row["steady_processor_s"] = min(steady_seconds(record, "processor_seconds") for record in records)
        if "steps" in stages:
            row["steps_processor_s"] = min(record["processor_seconds"]["steps"] for record in records)
    row["steady_all_s"] = [steady_seconds(record) for record in records]
    if "steps" in stages:
        row["steps_s"] = row["seconds"]["steps"]
    row["peak_kB_a_node"] = min(record["peak_kB"] for record in records) / nodes
    for name in ("iterations", "step_iterations", "threads"):
        if name in records[0]:
            row[name] = records[0][name]
    differences = {
        name: float(np.abs(fields[name] - reference[name]).max()) for name in fields if name in reference
    }
    row["difference_K"] = differences
    row["agrees"] = all(value <= AGREEMENT_K for value in differences.values())
    return row


def with_ratios(rows: list[dict]) -> list[dict]:
    """Ratios to the best other program whose temperatures agree, among rows of one size."""
    for key in ("steady", "steps", "steady_processor", "steps_processor"):
        others = [
            row[f"{key}_s"]
            for row in rows
            if f"{key}_s" in row and row["agrees"] and not row["program"].startswith(OURS)
        ]
        if others:
            for row in rows:
                if f"{key}_s" in row:
                    row[f"{key}_ratio"] = row[f"{key}_s"] / min(others)
    return rows
