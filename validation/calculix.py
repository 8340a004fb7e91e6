"""Growth of bodies by CalculiX, on the curved quadratic tetrahedra of the thermal mesh, beside the package.

    python -m validation.calculix [BODY ...]

The reference spindle as it runs at 3000 rpm, coarse mesh; bodies ``F1.inner_ring``, ``shaft`` and
``housing`` unless others are named, each under its temperatures, the pressures on its seats, its rotation.
Needs ``ccx`` (CalculiX CrunchiX; Debian: ``apt install calculix-ccx``). Its quadratic tetrahedron (C3D10)
has four quadrature points, three on a side, and takes temperatures from its corners; the package's elements
are integrated in the same points for the comparison, and in their own beside it.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from skfem import ElementTetP2, ElementTriP2
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet, RefTri

from spindle_fem.definition.load import load_machine
from spindle_fem.model.elastic.machine_bodies import elastic_material
from spindle_fem.model.elastic.solid_body import SolidBody, SolidMesh, rigid_motions
from spindle_fem.model.elastic.solid_facets import on_face
from spindle_fem.model.mesh.element_integrals import (
    EDGES,
    ReferenceTable,
    evaluate_shape,
    tetrahedron_table,
    triangle_table,
)
from spindle_fem.physics.elasticity.elastic_material import ElasticMaterial
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared

Array = NDArray[np.float64]
PROGRAM = "ccx"
BODIES = ("F1.inner_ring", "shaft", "housing")
# Degree that four points of a tetrahedron and three of a triangle integrate exactly.
FEW_POINTS = 2
# Residual over load of the package's solver: far below the seven digits that CalculiX prints.
TOLERANCE = 1.0e-11
# Corners of every side of a tetrahedron, as CalculiX counts them, and the corner opposite to each.
SIDES = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
OPPOSITE = np.array([3, 2, 0, 1])
# (which of the holding corners, axis) that are held: six, so that the body can grow but not move as a whole.
HOLDS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 1))


@dataclass(frozen=True, slots=True)
class Pressed:
    """A pressure [Pa] on facets (n_facets, 6) of a body, by its own nodes."""

    facets: NDArray[np.int64]
    pressure: float

    def load(self, mesh: SolidMesh, table: ReferenceTable) -> Array:
        """Forces (n, 3) [N] on the nodes of the body, along the normals of its curved sides."""
        elements, sides = self.sides(mesh)
        nodes = mesh.points[self.facets]
        first, second = (np.einsum("qi,fix->fqx", table.gradients[:, :, k], nodes) for k in range(2))
        normals = np.cross(first, second)
        opposite = mesh.points[mesh.tetrahedra[elements, OPPOSITE[sides]]] - nodes[:, 0]
        inwards = np.sign(np.einsum("fx,fx->f", normals[:, 0], opposite))
        forces = self.pressure * inwards[:, None, None] * normals * table.weights[:, None]
        found = np.zeros_like(mesh.points)
        np.add.at(found, self.facets, np.einsum("qi,fqx->fix", table.values, forces))
        return found

    def sides(self, mesh: SolidMesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Element of every facet, and which of its sides it is, as CalculiX counts them from 0."""
        corners = np.sort(mesh.tetrahedra[:, SIDES], axis=2).reshape(-1, 3)
        place = {tuple(row): index for index, row in enumerate(corners.tolist())}
        found = np.array([place[tuple(row)] for row in np.sort(self.facets[:, :3], axis=1).tolist()])
        return found // len(SIDES), found % len(SIDES)


@dataclass(frozen=True, slots=True)
class LoadedSolid:
    """A free body, how much warmer than at assembly its corners are, what presses on it, and how it turns.

    Attributes
    ----------
    rise : (n_nodes,) ndarray, [K]
        Of the body's nodes; those between two corners have the mean of these.
    speed : float, [rad/s]
        About z.
    """

    mesh: SolidMesh
    materials: Mapping[str, ElasticMaterial]
    rise: Array
    pressed: tuple[Pressed, ...] = ()
    speed: float = 0.0

    @classmethod
    def of(cls, mesh: SolidMesh, materials: Mapping[str, ElasticMaterial], rise: Array) -> LoadedSolid:
        """A body by the rise (n_nodes of the whole mesh,) [K] of every node; that of its corners counts."""
        own = np.zeros(len(mesh.points))
        own[mesh.local[mesh.local >= 0]] = rise[mesh.local >= 0]
        ends = mesh.tetrahedra[:, EDGES]
        own[mesh.tetrahedra[:, 4:]] = own[ends].mean(axis=2)
        return cls(mesh, materials, own)

    def by_package(self, held: Sequence[int], table: ReferenceTable, side: ReferenceTable) -> Array:
        """Shift (n, 3) [m] of every node by the package's elements and solver, with six motions held.

        Parameters
        ----------
        table, side : ReferenceTable
            Tetrahedron and triangle in their quadrature points.
        """
        mesh = self.mesh
        inside = mesh.local >= 0
        rise = np.zeros(len(mesh.local))
        rise[inside] = self.rise[mesh.local[inside]]
        body = SolidBody.of(mesh, self.materials, rise, table)
        load = body.expansion + self.speed**2 * body.turning
        load += sum(pressed.load(mesh, side) for pressed in self.pressed)
        motions = rigid_motions(mesh.points)
        rows = np.array([motions[held[which], axis] for which, axis in HOLDS])
        # What the loads push and turn the body with as a whole is held where it is held.
        reactions = np.linalg.solve(rows.T, -np.einsum("nxm,nx->m", motions, load))
        for (which, axis), reaction in zip(HOLDS, reactions, strict=True):
            load[held[which], axis] += reaction
        shift = body.solve(load, TOLERANCE)
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
                "*DENSITY",
                f"{material.density:.12e}",
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
            *self._forces(),
            "*NODE PRINT, NSET=ALL",
            "U",
            "*END STEP",
        ]
        return "\n".join(lines) + "\n"

    def _forces(self) -> list[str]:
        lines = ["*DLOAD"]
        for pressed in self.pressed:
            places = zip(*pressed.sides(self.mesh), strict=True)
            lines += [f"{element + 1},P{side + 1},{pressed.pressure:.12e}" for element, side in places]
        if self.speed:
            turning = f"CENTRIF,{self.speed**2:.12e},0.,0.,0.,0.,0.,1."
            lines += [f"E{part},{turning}" for part in range(len(self.mesh.parts))]
        return lines if len(lines) > 1 else []


@dataclass(frozen=True, slots=True)
class Compared:
    """A body under one kind of load by both programs; differences over the largest shift.

    Attributes
    ----------
    largest : float, [m]
    apart : float
        Both integrated in CalculiX' points.
    by_points : float
        The package in its own points from the package in those of CalculiX.
    """

    body: str
    load: str
    nodes: int
    elements: int
    largest: float
    apart: float
    by_points: float


def is_there() -> bool:
    """Whether CalculiX can be called."""
    return shutil.which(PROGRAM) is not None


def calculix_points() -> tuple[ReferenceTable, ReferenceTable]:
    """The quadratic tetrahedron and its side in the points of CalculiX' C3D10."""
    found = []
    for shape, element in ((RefTet, ElementTetP2()), (RefTri, ElementTriP2())):
        places, weights = get_quadrature(shape, FEW_POINTS)
        found.append(ReferenceTable(weights, *evaluate_shape(element, places)))
    return found[0], found[1]


def holding_corners(mesh: SolidMesh) -> list[int]:
    """Three corners far from each other: from the first along x, and along z."""
    corners = mesh.points[: mesh.n_corners]
    first = int(np.argmin(corners[:, 0] + corners[:, 2]))
    x, _, z = np.abs(corners - corners[first]).T
    return [first, int(np.argmax(x - z)), int(np.argmax(z - x))]


def compare(name: str, load: str, solid: LoadedSolid) -> Compared:
    """Shifts of a body by CalculiX and by the package."""
    held = holding_corners(solid.mesh)
    theirs = solid.by_calculix(held)
    ours = solid.by_package(held, *calculix_points())
    own = solid.by_package(held, tetrahedron_table(2), triangle_table(2))
    largest = float(np.abs(ours).max())
    return Compared(
        name,
        load,
        len(solid.mesh.points),
        len(solid.mesh.tetrahedra),
        largest,
        float(np.abs(theirs - ours).max()) / largest,
        float(np.abs(own - ours).max()) / largest,
    )


def loaded_solids(
    machine: PreparedMachine, result: ThermalResult, name: str
) -> Iterator[tuple[str, LoadedSolid]]:
    """One of a machine's elastic bodies under each kind of load that a solved state has on it."""
    growth = machine.growth
    parts = growth.bodies.parts[name]
    materials = {part: elastic_material(machine.spec.part_material(part)) for part in parts}
    mesh = SolidMesh.of(machine.mesh, parts)
    yield "temperatures", LoadedSolid.of(mesh, materials, result.temperature - growth.assembly_temperature)
    seats = result.growth.seats
    still = LoadedSolid(mesh, materials, np.zeros(len(mesh.points)))
    pressed = tuple(
        Pressed(mesh.local[on_face(machine.mesh, parts, seat.face).nodes], pressure)
        for seat in growth.bodies.seats
        if name in (seat.ring, seat.carrier)
        and (pressure := seats[seat.bearing, "shaft" if seat.is_inner else "housing"].pressure) > 0.0
    )
    if pressed:
        yield "pressures on seats", replace(still, pressed=pressed)
    if name == growth.bodies.shaft or name.endswith(".inner_ring"):
        yield "rotation", replace(still, speed=result.speed)


def compare_machine(names: Sequence[str] = BODIES) -> list[Compared]:
    """Bodies of the reference spindle at 3000 rpm, coarse mesh."""
    machine = prepare_machine(load_machine("wu_tan_2016", ["mesh.preset=coarse"]))
    result = solve_prepared(machine, find_fold=False)
    return [
        compare(name, load, solid) for name in names for load, solid in loaded_solids(machine, result, name)
    ]


def main(names: Sequence[str]) -> None:
    """Print how far both are apart, over the largest shift."""
    for found in compare_machine(names or BODIES):
        print(f"{found.body}, {found.load}: {found.nodes} nodes, {found.elements} tetrahedra, largest shift "
              f"{1e6 * found.largest:.3f} µm, apart by {found.apart:.1e} of it; by the package's own "
              f"quadrature points {found.by_points:.1e}")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
