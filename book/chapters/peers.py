"""Other programs on the same mesh."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from book.page import Chapter, Pictures
from book.work import ROOT, Desk, read_json
from spindle_fem.errors import BadInputError
from spindle_fem.report.block_page import Section, Table, Text
from spindle_fem.report.table_rows import column, number, rows_of, significant
from spindle_fem.results.output_folder import replace_text
from validation import calculix

TITLE = "Other programs on the same mesh"
SCRIPTS = ROOT / "benchmarks" / "peers"
MACHINE, MESH = "wu_tan_2016", "coarse"
AGREED_K = 1e-5
# Of the largest shift.
AGREED_SHIFT = 1e-6
OWN = "spindle_fem"
# Script, what its interpreter must be able to import (or the program it calls), name for people.
PEERS = {
    "ngsolve": ("ngsolve", "NGSolve"),
    "mfem": ("mfem", "MFEM"),
    "skfem": ("skfem", "plain scikit-fem with pyamg"),
    "dolfinx": ("dolfinx", "DOLFINx (FEniCS)"),
    "pardiso": ("pypardiso", "Intel PARDISO on scikit-fem's matrix"),
    "calculix": ("ccx", "CalculiX"),
}
_ENVIRONMENT = "PEER_PYTHONS"


def make(desk: Desk, pictures: Pictures) -> Chapter:
    """Solve one discrete problem with every program that is there."""
    del pictures
    found = {name: interpreter_of(name) for name in PEERS}
    there = sorted(name for name, python in found.items() if python)
    absent = [PEERS[name][1] for name, python in found.items() if not python]
    commands = [
        f"{_ENVIRONMENT}=/path/to/venv/bin/python python -m book --only peers",
        "python benchmarks/peers/run_ngsolve.py runs/book/peers/case OUTPUT.npz",
    ]
    missing = f"Not installed here: {', '.join(absent)}." if absent else "All of them are installed here."

    def run(folder: Path) -> None:
        case = _write_case(folder / "case")
        for name in (OWN, *there):
            _solve(folder, case, name, found.get(name) or sys.executable)
        replace_text(folder / "peers.json", json.dumps(_compare(folder, there), indent=1))

    step = desk.step("peers", run, inputs={"peers": there, "machine": MACHINE, "mesh": MESH})
    growth = _growth(desk)
    table = read_json(step.folder / "peers.json")
    compared = [row for row in table["programs"] if row["largest_K"] is not None]
    failed = [row for row in table["programs"] if row["largest_K"] is None]
    worst = max((row["largest_K"] for row in compared), default=None)
    failures = "; ".join(f"{PEERS[row['name']][1]}: {row['error']}" for row in failed)
    if worst is None:
        outcome = f"No other program could be run. {missing} {failures}"
    else:
        near = [row for row in compared if row["largest_K"] <= AGREED_K]
        far = [row for row in compared if row["largest_K"] > AGREED_K]
        said = [
            f"{_names(near)} agree with this program at all {table['nodes']:,} nodes within "
            f"{significant(max(row['largest_K'] for row in near), 2)} K ({AGREED_K:g} K asked for)."
            if near
            else "No program agrees within what is asked for.",
            *(f"{_names([row])} differs by up to {significant(row['largest_K'], 2)} K." for row in far),
            missing,
            failures,
        ]
        outcome = " ".join(filter(None, said))
    if growth:
        outcome += (
            f" CalculiX moves every node of {len({row['body'] for row in growth})} bodies, warm, pressed or "
            "turning, alike within "
            f"{significant(max(row['apart'] for row in growth), 2)} of the largest shift."
        )
    rows = [
        [
            OWN if row["name"] == OWN else PEERS[row["name"]][1],
            row["version"],
            "" if row["name"] == OWN else significant(row["largest_K"], 2),
            "" if row["name"] == OWN else significant(row["rms_K"], 2),
            str(row.get("iterations") or ""),
            ""
            if row["name"] == OWN or row["largest_K"] is None
            else ("yes" if row["largest_K"] <= AGREED_K else "no"),
        ]
        for row in [table["own"], *table["programs"]]
    ]
    columns = (
        column("program"),
        column("version"),
        column("largest difference / K", number=True),
        column("rms / K", number=True),
        column("iterations", number=True),
        column(f"within {AGREED_K:g} K", mark=True),
    )
    return Chapter(
        outcome=outcome,
        sections=[
            Section(
                "problem",
                "The problem",
                [
                    Text(
                        f"The reference spindle ({MACHINE}, {MESH} mesh), every curved quadratic element "
                        f"divided into eight straight linear ones: {table['nodes']:,} nodes, "
                        f"{table['elements']:,} tetrahedra. Film coefficients, surrounding temperatures "
                        "and heat are means over each surface of the solved machine; joints conduct "
                        "perfectly, because most programs know no other. Every program assembles this "
                        "problem itself from nodes, elements and facets and solves it to a relative "
                        f"residual of 1e-9; temperatures run from {number(table['low_degC'], 1)} to "
                        f"{number(table['high_degC'], 1)} °C."
                    )
                ],
            ),
            Section("agreement", "Agreement", [Table(columns, rows_of(rows)), Text(missing)]),
            *([Section("growth", "Growth in three dimensions", _growth_blocks(growth))] if growth else []),
        ],
        commands=commands,
        evidence=[
            "Assembly, films, heat and solver of linear elements give what programs written by others give.",
            *(["So do curved quadratic elements of elasticity, warm, pressed, turning."] if growth else []),
        ],
        not_evidence=[
            "Quadratic curved elements of conduction, contact conductance, lumped nodes and the coupling are "
            "not compared here; exact solutions and the network chapter hold for those. Neither are "
            "pressures and rotation of growing bodies.",
            "Agreement on one mesh says nothing about the mesh.",
            "Why a program that differs does so is not looked into here; what it prints of its own accord "
            "may have fewer digits than what is compared.",
        ],
        tone="good" if worst is not None and min(row["largest_K"] for row in compared) <= AGREED_K else "",
    )


def _growth(desk: Desk) -> list[dict[str, Any]]:
    """Bodies of the reference spindle in three dimensions by CalculiX; empty where it is missing."""
    if not calculix.is_there():
        return []

    def run(folder: Path) -> None:
        rows = [asdict(found) for found in calculix.compare_machine()]
        replace_text(folder / "growth.json", json.dumps(rows, indent=1))

    step = desk.step("growth beside CalculiX", run, sources=("tool", "generator"))
    return read_json(step.folder / "growth.json")


def _growth_blocks(rows: list[dict[str, Any]]) -> list[Text | Table]:
    columns = (
        column("body"),
        column("load"),
        column("nodes", number=True),
        column("tetrahedra", number=True),
        column("largest shift / µm", number=True),
        column("largest difference over it", number=True),
        column("the same by other quadrature", number=True),
        column(f"within {AGREED_SHIFT:g}", mark=True),
    )
    cells = [
        [
            row["body"],
            row["load"],
            f"{row['nodes']:,}",
            f"{row['elements']:,}",
            significant(1e6 * row["largest"], 3),
            significant(row["apart"], 2),
            significant(row["by_points"], 2),
            "yes" if row["apart"] <= AGREED_SHIFT else "no",
        ]
        for row in rows
    ]
    said = (
        f"Free bodies of {MACHINE} as warm as at 3000 rpm ({MESH} mesh), pressed on its seats, and "
        "turning, one load at a time, on the curved quadratic elements of the temperatures, held at six "
        "components of three corners. CalculiX (C3D10) integrates in four points, three on a side, and takes "
        "temperatures from the corners; so does this program for the comparison. Its own "
        "points, which integrate curved elements more exactly, move a node by what the last but one column "
        "says. CalculiX prints seven digits."
    )
    return [Text(said), Table(columns, rows_of(cells))]


def _names(rows: list[dict[str, Any]]) -> str:
    names = [PEERS[row["name"]][1] for row in rows]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def interpreter_of(name: str) -> str | None:
    """Python that can run a peer's script; None where none of those that are named can.

    Interpreters are this one, those of the environment variable ``PEER_PYTHONS``, and the system's.

    Raises
    ------
    BadInputError
        One of the variable cannot be run.
    """
    needs = PEERS[name][0]
    if not (SCRIPTS / f"run_{name}.py").is_file():
        return None
    if name == "calculix":
        return sys.executable if shutil.which(needs) else None
    given = [item for item in os.environ.get(_ENVIRONMENT, "").split(os.pathsep) if item]
    for item in given:
        if shutil.which(item) is None:
            raise BadInputError(
                _ENVIRONMENT, f'"{item}" cannot be run.', f"Join interpreters by “{os.pathsep}”."
            )
    system = shutil.which("python3", path="/usr/bin")
    for python in dict.fromkeys([sys.executable, *given, *([system] if system else [])]):
        asked = subprocess.run(
            [python, "-c", f"import numpy, {needs}"],
            capture_output=True,
            check=False,
            env=_plain_environment(),
        )
        if asked.returncode == 0:
            return python
    return None


def _plain_environment() -> dict[str, str]:
    """Environment without paths of ours, which another interpreter would trip over."""
    return {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


def _write_case(folder: Path) -> Path:
    if (folder / "case.json").is_file():
        return folder
    from spindle_fem.definition.load import load_machine
    from spindle_fem.solvers.prepared_machine import prepare_machine

    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        import case as benchmark_case
    finally:
        sys.path.pop(0)
    machine = prepare_machine(load_machine(MACHINE, (f"mesh.preset={MESH}",)))
    return benchmark_case.write_case(folder, machine, benchmark_case.loads_of(machine))


def _solve(folder: Path, case: Path, name: str, python: str) -> None:
    record = folder / f"{name}.json"
    output = (folder / f"{name}.npz").resolve()
    environment = _plain_environment()
    if name == OWN:
        environment["PYTHONPATH"] = str(ROOT)
    command = [python, str(SCRIPTS / f"run_{name}.py"), str(case.resolve()), str(output)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines()
        content: dict[str, Any] = {"error": said[-1][:300] if said else f"ended with {done.returncode}"}
    else:
        content = json.loads(done.stdout.strip().splitlines()[-1])
    content["version"] = _version(name, python)
    replace_text(record, json.dumps(content, indent=1))


def _version(name: str, python: str) -> str:
    if name == OWN:
        from spindle_fem import __version__

        return __version__
    packages = {"skfem": "scikit-fem", "dolfinx": "fenics-dolfinx"}
    package = packages.get(name, PEERS[name][0])
    code = f"import importlib.metadata as m; print(m.version({package!r}))"
    asked = subprocess.run(
        [python, "-c", code], capture_output=True, text=True, check=False, env=_plain_environment()
    )
    return asked.stdout.strip() if asked.returncode == 0 else ""


def _compare(folder: Path, names: list[str]) -> dict[str, Any]:
    own_record = read_json(folder / f"{OWN}.json")
    with np.load(folder / f"{OWN}.npz") as data:
        own = data["steady"]
    case = read_json(folder / "case" / "case.json")
    programs = []
    for name in names:
        record = read_json(folder / f"{name}.json")
        row = {"name": name, "version": record["version"], "largest_K": None, "rms_K": None}
        if "error" in record:
            row["error"] = record["error"]
        else:
            with np.load(folder / f"{name}.npz") as data:
                difference = data["steady"] - own
            row |= {
                "largest_K": float(np.abs(difference).max()),
                "rms_K": float(np.sqrt(np.mean(difference**2))),
                "iterations": record.get("iterations"),
            }
        programs.append(row)
    return {
        "nodes": case["nodes"],
        "elements": case["elements"],
        "low_degC": float(own.min()) - 273.15,
        "high_degC": float(own.max()) - 273.15,
        "own": {
            "name": OWN,
            "version": own_record["version"],
            "largest_K": None,
            "rms_K": None,
            "iterations": own_record.get("iterations"),
        },
        "programs": programs,
    }
