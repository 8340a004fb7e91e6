"""Growth of bodies by CalculiX, on the same tetrahedra as by scikit-fem, and beside the package.

    python -m validation.calculix [BODY ...]

The reference spindle as it runs at 3000 rpm, coarse mesh; bodies ``F1.inner_ring`` and ``shaft`` unless
others are named. Needs ``ccx`` (CalculiX CrunchiX; Debian: ``apt install calculix-ccx``). Quadratic
tetrahedra (C3D10), whose thermal strain CalculiX interpolates from their corners.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

from spindle_fem.definition.load import load_machine
from spindle_fem.solvers.prepared_machine import prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared
from validation.solid_growth import Solid, WarmBody, warm_body

Array = NDArray[np.float64]
PROGRAM = "ccx"
# Order of the sides' midpoints: 12, 23, 13, 14, 24, 34, which is that of scikit-fem's edges; of a tetrahedron
# whose first two corners are exchanged.
EXCHANGED = [0, 2, 1, 4, 3, 5]


def is_there() -> bool:
    """Whether CalculiX can be called."""
    return shutil.which(PROGRAM) is not None


def by_calculix(body: WarmBody, held: NDArray[np.int64]) -> Array:
    """Shift (3, n) of corners, then of edges' midpoints, by CalculiX, m.

    Parameters
    ----------
    held : (3,) int ndarray
        Corners that hold the body: the first wholly, the others as :func:`holding_corners` has them.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "body"
        place.with_suffix(".inp").write_text(_deck(body, held), encoding="utf-8")
        subprocess.run([PROGRAM, place.name], cwd=folder, check=True, capture_output=True, text=True)
        rows = [line.split() for line in place.with_suffix(".dat").read_text(encoding="utf-8").splitlines()]
    values = np.array([[float(item) for item in row] for row in rows if len(row) == 4 and row[0].isdigit()])
    assert np.array_equal(values[:, 0], np.arange(1, len(values) + 1))
    return values[:, 1:].T


def by_same_elements(body: WarmBody, held: NDArray[np.int64]) -> Array:
    """The same by scikit-fem, solved directly."""
    basis, matrix, load = body.equations()
    nodes = np.hstack([basis.nodal_dofs, basis.edge_dofs])
    fixed = np.array([nodes[axis, held[row]] for row, axis in HOLDS])
    free = np.setdiff1d(np.arange(basis.N), fixed)
    shift = np.zeros(basis.N)
    shift[free] = spsolve(matrix[free][:, free].tocsc(), load[free])
    return shift[nodes]


# (which of the holding corners, axis) that are held: six, so that the body can grow but not move as a whole.
HOLDS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 1))


def holding_corners(body: WarmBody) -> NDArray[np.int64]:
    """Three corners far from each other: from the first along x, and along z."""
    x, _, z = body.mesh.p
    first = int(np.argmin(x + z))
    apart = np.abs(body.mesh.p - body.mesh.p[:, [first]])
    return np.array([first, int(np.argmax(apart[0] - apart[2])), int(np.argmax(apart[2] - apart[0]))])


def _deck(body: WarmBody, held: NDArray[np.int64]) -> str:
    # Fields of numbers are 20 characters wide.
    mesh, material = body.mesh, body.material
    edges = mesh.edges
    points = np.hstack([mesh.p, mesh.p[:, edges].mean(axis=1)])
    rise = np.concatenate([body.rise, body.rise[edges].mean(axis=0)])
    corners, sides = mesh.t.copy(), mesh.t2e + mesh.p.shape[1]
    first, *others = mesh.p[:, corners].transpose(1, 2, 0)
    turned = np.linalg.det(np.stack([other - first for other in others], axis=1)) < 0.0
    corners[:2, turned] = corners[1::-1, turned]
    sides[:, turned] = sides[:, turned][EXCHANGED]
    cells = np.vstack([corners, sides]).T + 1
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i},{p[0]:.12e},{p[1]:.12e},{p[2]:.12e}" for i, p in enumerate(points.T, 1)]
    lines += ["*ELEMENT, TYPE=C3D10, ELSET=BODY"]
    lines += [f"{i}," + ",".join(map(str, cell)) for i, cell in enumerate(cells.tolist(), 1)]
    lines += [
        "*MATERIAL, NAME=M",
        "*ELASTIC",
        f"{material.young_modulus:.12e},{material.poisson_ratio:.12e}",
        "*EXPANSION, ZERO=0.",
        f"{material.thermal_expansion:.12e}",
        "*SOLID SECTION, ELSET=BODY, MATERIAL=M",
        "*INITIAL CONDITIONS, TYPE=TEMPERATURE",
        "ALL,0.",
        "*BOUNDARY",
        *(f"{held[row] + 1},{axis + 1},{axis + 1}" for row, axis in HOLDS),
        "*STEP",
        "*STATIC",
        "*TEMPERATURE",
        *(f"{i},{value:.12e}" for i, value in enumerate(rise, 1)),
        "*NODE PRINT, NSET=ALL",
        "U",
        "*END STEP",
    ]
    return "\n".join(lines) + "\n"


def seat_growths(solid: Solid, machine, name: str, field: Array) -> dict[str, tuple[float, float]]:
    """Mean growth of the seats of a body in three dimensions, and by the package, µm."""
    growth = machine.growth
    even = growth.seat_rows @ (field - growth.assembly_temperature)
    return {
        ring.seat.ring: (
            1e6 * solid.mean(solid.outwards, solid.on(ring.seat.face.z, ring.seat.face.r)),
            1e6 * float(own),
        )
        for ring, own in zip(growth.rings, even, strict=True)
        if ring.seat.carrier == name
    }


def main(names: list[str]) -> None:
    """Print how far both are apart, over the largest shift, and seats beside the package."""
    machine = prepare_machine(load_machine("wu_tan_2016", ["mesh.preset=coarse", "mesh.order=1"]))
    field = solve_prepared(machine, find_fold=False).temperature[: machine.mesh.n_corners]
    for name in names or ["F1.inner_ring", "shaft"]:
        body = warm_body(machine, field, name)
        held = holding_corners(body)
        theirs, ours = by_calculix(body, held), by_same_elements(body, held)
        apart = np.abs(theirs - ours).max() / np.abs(ours).max()
        print(f"{name}: {theirs.shape[1]} nodes, {body.mesh.t.shape[1]} tetrahedra, largest shift "
              f"{1e6 * np.abs(ours).max():.3f} µm, apart by {apart:.1e} of it")  # fmt: skip
        solid = body.solid(theirs[:, : body.mesh.p.shape[1]])
        for ring, (solid_um, even_um) in seat_growths(solid, machine, name, field).items():
            print(f"  seat of {ring}: CalculiX {solid_um:.3f} µm, package {even_um:.3f} µm")


if __name__ == "__main__":
    main(sys.argv[1:])
