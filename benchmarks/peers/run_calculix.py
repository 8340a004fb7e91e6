"""CalculiX (``ccx``), heat transfer with C3D4 elements: one whole run, input and output included."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import protocol

# Corners of the faces of a C3D4 element, in CalculiX' order.
FACES = np.array([[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]])
SOLVER = "ITERATIVE CHOLESKY"


def faces_of(problem: protocol.Problem) -> tuple[np.ndarray, np.ndarray]:
    """Element and face number (0-3) of each boundary facet."""
    n = np.int64(len(problem.points))

    def key(nodes):
        low, middle, high = np.sort(nodes, axis=-1).astype(np.int64).transpose(-1, *range(nodes.ndim - 1))
        return (low * n + middle) * n + high

    keys = key(problem.tetrahedra[:, FACES]).ravel()
    order = np.argsort(keys)
    place = order[np.searchsorted(keys, key(problem.facets), sorter=order)]
    return np.divmod(place, 4)


def write_input(problem: protocol.Problem, path: Path) -> None:
    """The .inp file of the steady problem; temperatures count from the start temperature."""
    element, face = faces_of(problem)
    ambient = problem.ambient_temperature - problem.start_temperature
    with path.open("w", encoding="ascii") as stream:
        stream.write("*NODE, NSET=ALL\n")
        numbers = np.arange(1, len(problem.points) + 1)
        np.savetxt(stream, np.column_stack((numbers, problem.points)), fmt="%d,%.13g,%.13g,%.13g")
        for part, conductivity in enumerate(problem.part_conductivity):
            own = np.flatnonzero(problem.part_of_element == part)
            stream.write(f"*ELEMENT, TYPE=C3D4, ELSET=PART{part}\n")
            np.savetxt(
                stream, np.column_stack((own + 1, problem.tetrahedra[own] + 1)), fmt="%d", delimiter=","
            )
            stream.write(f"*MATERIAL, NAME=M{part}\n*CONDUCTIVITY\n{conductivity:.15g}\n")
            stream.write(f"*SOLID SECTION, ELSET=PART{part}, MATERIAL=M{part}\n")
        stream.write("*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL,0.0\n")
        stream.write(f"*STEP\n*HEAT TRANSFER, STEADY STATE, SOLVER={SOLVER}\n1.0,1.0\n*FILM\n")
        filmed = problem.film_coefficient > 0.0
        for row in np.flatnonzero(filmed):
            line = f"{element[row] + 1},F{face[row] + 1},{ambient[row]:.15g},"
            stream.write(f"{line}{problem.film_coefficient[row]:.15g}\n")
        stream.write("*DFLUX\n")
        for row in np.flatnonzero(problem.heat_flux):
            stream.write(f"{element[row] + 1},S{face[row] + 1},{problem.heat_flux[row]:.15g}\n")
        stream.write("*NODE PRINT, NSET=ALL\nNT\n*END STEP\n")


def run(folder: Path, steps: int, record: protocol.Record) -> tuple[np.ndarray, np.ndarray | None]:
    """Solve the steady problem; steps are left out."""
    problem = protocol.Problem.read(folder)
    threads = os.environ.get("PEER_THREADS", "2")
    with tempfile.TemporaryDirectory() as work:
        write_input(problem, Path(work) / "case.inp")
        environment = {**os.environ, "OMP_NUM_THREADS": threads}
        with record.stage("whole run"):
            done = subprocess.run(
                ["ccx", "case"], cwd=work, env=environment, capture_output=True, text=True, check=False
            )
        answer = Path(work) / "case.dat"
        if done.returncode or not answer.exists():
            sys.exit(f"ccx failed: {done.stdout[-500:]}")
        rows = np.loadtxt(answer, skiprows=3)
    rise = np.empty(len(problem.points))
    rise[rows[:, 0].astype(int) - 1] = rows[:, 1]
    record.notes["peak_kB"] = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    record.notes["threads"] = int(threads)
    return problem.start_temperature + rise, None


if __name__ == "__main__":
    protocol.main(run)
