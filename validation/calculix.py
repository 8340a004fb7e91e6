"""Growth of bodies by CalculiX, on the curved quadratic tetrahedra of the thermal mesh, beside the package.

    python -m validation.calculix [BODY ...]

The reference spindle as it runs at 3000 rpm, coarse mesh; bodies ``F1.inner_ring``, ``shaft`` and
``housing`` unless others are named. Needs ``ccx`` (CalculiX CrunchiX; Debian: ``apt install calculix-ccx``).
Its quadratic tetrahedron (C3D10) has four quadrature points and takes temperatures from its corners; the
package's elements are integrated in the same points for the comparison, and in their own beside it.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from skfem import ElementTetP2
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet

from spindle_fem.definition.load import load_machine
from spindle_fem.model.elastic.machine_bodies import elastic_material
from spindle_fem.model.elastic.solid_body import SolidBody, SolidMesh, rigid_motions
from spindle_fem.model.mesh.element_integrals import EDGES, ReferenceTable, evaluate_shape, tetrahedron_table
from spindle_fem.physics.elasticity.elastic_material import ElasticMaterial
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared

Array = NDArray[np.float64]
PROGRAM = "ccx"
BODIES = ("F1.inner_ring", "shaft", "housing")
# Degree that four points integrate exactly.
FOUR_POINTS = 2
# Residual over load of the package's solver: far below the seven digits that CalculiX prints.
TOLERANCE = 1.0e-11
# (which of the holding corners, axis) that are held: six, so that the body can grow but not move as a whole.
HOLDS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 1))


@dataclass(frozen=True, slots=True)
class WarmSolid:
    """A free body and how much warmer than at assembly its corners are.

    Attributes
    ----------
    rise : (n_nodes,) ndarray, [K]
        Of the body's nodes; those between two corners have the mean of these.
    """

    mesh: SolidMesh
    materials: Mapping[str, ElasticMaterial]
    rise: Array

    @classmethod
    def of(cls, mesh: SolidMesh, materials: Mapping[str, ElasticMaterial], rise: Array) -> WarmSolid:
        """A body by the rise (n_nodes of the whole mesh,) [K] of every node; that of its corners counts."""
        own = np.zeros(len(mesh.points))
        own[mesh.local[mesh.local >= 0]] = rise[mesh.local >= 0]
        ends = mesh.tetrahedra[:, EDGES]
        own[mesh.tetrahedra[:, 4:]] = own[ends].mean(axis=2)
        return cls(mesh, materials, own)

    def by_package(self, held: Sequence[int], table: ReferenceTable) -> Array:
        """Shift (n, 3) [m] of every node by the package's elements and solver, with six motions held."""
        mesh = self.mesh
        inside = mesh.local >= 0
        rise = np.zeros(len(mesh.local))
        rise[inside] = self.rise[mesh.local[inside]]
        body = SolidBody.of(mesh, self.materials, rise, table)
        shift = body.solve(body.expansion, TOLERANCE)
        motions = rigid_motions(mesh.points)
        rows = np.array([motions[held[which], axis] for which, axis in HOLDS])
        values = np.array([shift[held[which], axis] for which, axis in HOLDS])
        return shift - motions @ np.linalg.solve(rows, values)

    def by_calculix(self, held: Sequence[int]) -> Array:
        """The same by CalculiX."""
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder) / "body"
            place.with_suffix(".inp").write_text(self._deck(held), encoding="utf-8")
            subprocess.run([PROGRAM, place.name], cwd=folder, check=True, capture_output=True, text=True)
            lines = place.with_suffix(".dat").read_text(encoding="utf-8").splitlines()
        rows = [line.split() for line in lines]
        values = np.array([[float(x) for x in row] for row in rows if len(row) == 4 and row[0].isdigit()])
        assert np.array_equal(values[:, 0], np.arange(1, len(values) + 1))
        return values[:, 1:]

    def _deck(self, held: Sequence[int]) -> str:
        # Fields of numbers are 20 characters wide.
        mesh = self.mesh
        lines = ["*NODE, NSET=ALL"]
        lines += [f"{i},{p[0]:.12e},{p[1]:.12e},{p[2]:.12e}" for i, p in enumerate(mesh.points, 1)]
        for part, name in enumerate(mesh.parts):
            material = self.materials[name]
            own = np.flatnonzero(mesh.part == part)
            lines += [f"*ELEMENT, TYPE=C3D10, ELSET=E{part}"]
            cells = (mesh.tetrahedra[own] + 1).tolist()
            lines += [f"{i}," + ",".join(map(str, cell)) for i, cell in zip(own + 1, cells, strict=True)]
            lines += [
                f"*MATERIAL, NAME=M{part}",
                "*ELASTIC",
                f"{material.young_modulus:.12e},{material.poisson_ratio:.12e}",
                "*EXPANSION, ZERO=0.",
                f"{material.thermal_expansion:.12e}",
                f"*SOLID SECTION, ELSET=E{part}, MATERIAL=M{part}",
            ]
        lines += [
            "*INITIAL CONDITIONS, TYPE=TEMPERATURE",
            "ALL,0.",
            "*BOUNDARY",
            *(f"{held[which] + 1},{axis + 1},{axis + 1}" for which, axis in HOLDS),
            "*STEP",
            "*STATIC",
            "*TEMPERATURE",
            *(f"{i},{value:.12e}" for i, value in enumerate(self.rise, 1)),
            "*NODE PRINT, NSET=ALL",
            "U",
            "*END STEP",
        ]
        return "\n".join(lines) + "\n"


@dataclass(frozen=True, slots=True)
class Compared:
    """A body by both programs; differences over the largest shift.

    Attributes
    ----------
    largest : float, [m]
    apart : float
        Both integrated in CalculiX' points.
    by_points : float
        The package in its own points from the package in those of CalculiX.
    """

    body: str
    nodes: int
    elements: int
    largest: float
    apart: float
    by_points: float


def is_there() -> bool:
    """Whether CalculiX can be called."""
    return shutil.which(PROGRAM) is not None


def four_points() -> ReferenceTable:
    """The quadratic tetrahedron in the points of CalculiX' C3D10."""
    places, weights = get_quadrature(RefTet, FOUR_POINTS)
    return ReferenceTable(weights, *evaluate_shape(ElementTetP2(), places))


def holding_corners(mesh: SolidMesh) -> list[int]:
    """Three corners far from each other: from the first along x, and along z."""
    corners = mesh.points[: mesh.n_corners]
    first = int(np.argmin(corners[:, 0] + corners[:, 2]))
    x, _, z = np.abs(corners - corners[first]).T
    return [first, int(np.argmax(x - z)), int(np.argmax(z - x))]


def compare(name: str, solid: WarmSolid) -> Compared:
    """Shifts of a body by CalculiX and by the package."""
    held = holding_corners(solid.mesh)
    theirs = solid.by_calculix(held)
    ours, own = (solid.by_package(held, table) for table in (four_points(), tetrahedron_table(2)))
    largest = float(np.abs(ours).max())
    counts = len(solid.mesh.points), len(solid.mesh.tetrahedra)
    return Compared(
        name,
        *counts,
        largest,
        float(np.abs(theirs - ours).max()) / largest,
        float(np.abs(own - ours).max()) / largest,
    )


def warm_solid(machine: PreparedMachine, temperature: Array, name: str) -> WarmSolid:
    """One of a machine's elastic bodies at temperatures (n_nodes of the mesh,) [K]."""
    growth = machine.growth
    parts = growth.bodies.parts[name]
    materials = {part: elastic_material(machine.spec.part_material(part)) for part in parts}
    rise = temperature - growth.assembly_temperature
    return WarmSolid.of(SolidMesh.of(machine.mesh, parts), materials, rise)


def compare_machine(names: Sequence[str] = BODIES) -> list[Compared]:
    """Bodies of the reference spindle at 3000 rpm, coarse mesh."""
    machine = prepare_machine(load_machine("wu_tan_2016", ["mesh.preset=coarse"]))
    field = solve_prepared(machine, find_fold=False).temperature
    return [compare(name, warm_solid(machine, field, name)) for name in names]


def main(names: Sequence[str]) -> None:
    """Print how far both are apart, over the largest shift."""
    for found in compare_machine(names or BODIES):
        print(f"{found.body}: {found.nodes} nodes, {found.elements} tetrahedra, largest shift "
              f"{1e6 * found.largest:.3f} µm, apart by {found.apart:.1e} of it; by the package's own "
              f"quadrature points {found.by_points:.1e}")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
