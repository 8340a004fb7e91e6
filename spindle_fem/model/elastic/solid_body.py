"""One elastic body in three dimensions, on the curved quadratic tetrahedra of a thermal mesh.

The body is free in space. Its six rigid motions are taken out of loads and displacements; where it stands
among the others is for :mod:`spindle_fem.model.elastic.solid_growth`. Conjugate gradients solve it,
preconditioned by one multigrid hierarchy for each component of the displacement: that leaves out how the
components act on each other, which by Korn's inequality costs iterations, but no more on finer meshes.

Source: Axelsson, Gustafsson, Numer. Linear Algebra Appl. 1 (1978) 213 (separate displacement components).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, cg

from spindle_fem.errors import ConvergenceError, GeometryError, MeshQualityError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.element_integrals import ReferenceTable, tetrahedron_table
from spindle_fem.model.mesh.integration import ENTRIES_OF_QUADRATIC
from spindle_fem.model.mesh.kernels import assembly_loops
from spindle_fem.model.mesh.kernels.elasticity_loops import add_elements, multiply_blocks
from spindle_fem.model.mesh.mesh_operators import prolongation_from_corners
from spindle_fem.model.mesh.multigrid import Hierarchy, build_hierarchy
from spindle_fem.model.mesh.sparsity_pattern import SymmetricPattern, expand_pattern, grouped
from spindle_fem.model.mesh.threads import fill_rows, row_blocks, run_blocks, unsigned
from spindle_fem.physics.elasticity.elastic_material import ElasticMaterial

Array = NDArray[np.float64]
# Residual over load: shifts then err by 1e-5 of the largest, by 4e-5 in thin rings.
TOLERANCE = 1.0e-6
MOST_ITERATIONS = 1_000
# Added to the diagonals that multigrid sees, relative: it needs a matrix that no shift leaves without force.
HOLD = 1.0e-5


@dataclass(frozen=True, slots=True)
class SolidMesh:
    """Parts of a mesh that move as one body, joined where they touch.

    Attributes
    ----------
    points : (n, 3) ndarray, [m]
        Corners first.
    tetrahedra : (n_elements, 10) int64 ndarray
    part : (n_elements,) ndarray of int
        Index into ``parts``.
    local : (n_nodes of the mesh,) int64 ndarray
        Node of the body at each node of the mesh, -1 where there is none.
    """

    parts: tuple[str, ...]
    points: Array
    n_corners: int
    tetrahedra: NDArray[np.int64]
    part: NDArray[np.int64]
    local: NDArray[np.int64]

    @classmethod
    def of(cls, mesh: TaggedMesh, parts: Sequence[str]) -> SolidMesh:
        """The body of some parts of a mesh.

        Raises
        ------
        GeometryError
            Parts that no joint connects.
        """
        n = len(mesh.points)
        inner = [joint for name, joint in mesh.joints.items() if set(joined_parts(name)) <= set(parts)]
        pairs = [np.array([joint.facets_a.ravel(), joint.facets_b.ravel()]) for joint in inner]
        one, other = np.hstack(pairs) if pairs else np.empty((2, 0), dtype=np.int64)
        _, group = connected_components(sparse.coo_array((np.ones(len(one)), (one, other)), shape=(n, n)))
        # the lowest of the nodes at one place, so that corners stay first
        leader = np.unique(group, return_index=True)[1][group]
        part_of_element = np.full(len(mesh.part_names), -1)
        part_of_element[[mesh.part_names.index(part) for part in parts]] = np.arange(len(parts))
        part = part_of_element[mesh.part_of_element]
        elements = mesh.tetrahedra[part >= 0]
        used, tetrahedra = np.unique(leader[elements], return_inverse=True)
        tetrahedra = tetrahedra.reshape(elements.shape)
        local = np.full(n, -1)
        local[elements] = tetrahedra
        edges = tetrahedra[:, :2].T
        links = np.hstack([edges, tetrahedra[:, [0, 2]].T, tetrahedra[:, [0, 3]].T])
        corners = int(np.sum(used < mesh.n_corners))
        count, _ = connected_components(
            sparse.coo_array((np.ones(links.shape[1]), tuple(links)), shape=(corners, corners))
        )
        if count > 1:
            raise GeometryError(
                ", ".join(parts), f"move as one body, but are {count} that touch nowhere.", "Let them touch."
            )
        return cls(tuple(parts), mesh.points[used], corners, tetrahedra, part[part >= 0], local)

    def pattern(self) -> SymmetricPattern:
        """Which nodes share an element."""
        n = len(self.points)
        nodes = unsigned(np.ascontiguousarray(self.tetrahedra))[0]
        joined = unsigned(np.zeros(n + 1, dtype=np.int32), np.zeros(0, dtype=np.int32))
        given = (nodes, *unsigned(*grouped(self.tetrahedra, n)), *joined)
        rows = fill_rows(assembly_loops.fill_upper, n, given, ENTRIES_OF_QUADRATIC, (np.int32,))
        return expand_pattern(*rows)


def joined_parts(joint: str) -> list[str]:
    """Names of the two parts that a joint connects.

    >>> joined_parts("cover|housing:face")
    ['cover', 'housing']
    """
    return joint.removesuffix(":face").split("|")


def rigid_motions(points: Array) -> Array:
    """Displacement (n, 3, 6) of points by each shift along x, y, z [m] and each turn about them [rad]."""
    x, y, z = points.T
    found = np.zeros((len(points), 3, 6))
    found[:, range(3), range(3)] = 1.0
    found[:, 1, 3], found[:, 2, 3] = -z, y
    found[:, 0, 4], found[:, 2, 4] = z, -x
    found[:, 0, 5], found[:, 1, 5] = -y, x
    return found


@dataclass(frozen=True)
class SolidBody:
    """A free body and its loads.

    Attributes
    ----------
    starts, columns : ndarray
        Compressed rows of nodes.
    blocks : (n_entries, 3, 3) ndarray, [N/m]
        Stiffness between the displacements of two nodes.
    expansion : (n, 3) ndarray, [N]
        Load of the temperatures.
    turning : (n, 3) ndarray, [kg m]
        Load of 1 rad/s about z.
    """

    mesh: SolidMesh
    starts: NDArray[np.int32]
    columns: NDArray[np.int32]
    blocks: Array
    expansion: Array
    turning: Array

    @classmethod
    def of(
        cls,
        mesh: SolidMesh,
        materials: Mapping[str, ElasticMaterial],
        rise: Array,
        table: ReferenceTable | None = None,
    ) -> SolidBody:
        """Integrate a body.

        Parameters
        ----------
        materials : mapping of part to ElasticMaterial
        rise : (n_nodes of the thermal mesh,) ndarray, [K]
            How much warmer than as assembled.
        table : ReferenceTable, optional
            Element at its quadrature points; by default those of the temperatures.

        Raises
        ------
        MeshQualityError
            An inverted element.
        """
        pattern, n = mesh.pattern(), len(mesh.points)
        by_part = np.array([_constants(materials[part]) for part in mesh.parts])
        own_rise = np.zeros(n)
        own_rise[mesh.local[mesh.local >= 0]] = rise[mesh.local >= 0]
        blocks, expansion = np.zeros((len(pattern.indices), 3, 3)), np.zeros((n, 3))
        turning, table = np.zeros((n, 3)), tetrahedron_table(2) if table is None else table
        inverted = add_elements(
            mesh.points,
            unsigned(np.ascontiguousarray(mesh.tetrahedra))[0],
            table.gradients,
            table.values,
            table.weights,
            by_part[mesh.part],
            own_rise,
            *unsigned(pattern.indptr, pattern.indices),
            blocks,
            expansion,
            turning,
        )
        if inverted:
            raise MeshQualityError(
                ", ".join(mesh.parts), f"{inverted} inverted elements.", "Refine or optimise the mesh."
            )
        return cls(mesh, pattern.indptr, pattern.indices, blocks, expansion, turning)

    @cached_property
    def rigid(self) -> Array:
        """Orthonormal rigid motions, (3 n, 6)."""
        about_middle = self.mesh.points - self.mesh.points.mean(axis=0)
        return np.linalg.qr(rigid_motions(about_middle).reshape(-1, 6))[0]

    @cached_property
    def _hierarchies(self) -> list[Hierarchy]:
        prolongation = prolongation_from_corners(self.mesh)
        own = np.repeat(np.arange(len(self.mesh.points)), np.diff(self.starts)) == self.columns
        found = []
        for k in range(3):
            values = self.blocks[:, k, k] * np.where(own, 1.0 + HOLD, 1.0)
            matrix = sparse.csr_array((values, self.columns, self.starts), shape=2 * (len(self.starts) - 1,))
            matrix.has_canonical_format = True
            found.append(build_hierarchy(matrix, prolongation))
        return found

    def multiply(self, shift: Array) -> Array:
        """Forces (n, 3) [N] that hold a displacement (n, 3) [m]."""
        forces = np.empty_like(shift)
        rows = unsigned(self.starts, self.columns)
        run_blocks(multiply_blocks, row_blocks(len(shift)), *rows, self.blocks, shift, forces)
        return forces

    def solve(self, load: Array, tolerance: float = TOLERANCE) -> Array:
        """Displacement (n, 3) [m] under a load (n, 3) [N], without rigid motion.

        What a load pushes or turns the body as a whole is taken out of it.

        Raises
        ------
        ConvergenceError
            The residual does not fall to ``tolerance`` times the load.
        """
        size = load.size

        def balanced(vector: Array) -> Array:
            return vector - self.rigid @ (self.rigid.T @ vector)

        def forces(shift: Array) -> Array:
            return self.multiply(shift.reshape(-1, 3)).ravel()

        def precondition(residual: Array) -> Array:
            columns = np.ascontiguousarray(residual.reshape(-1, 3).T)
            cycles = zip(self._hierarchies, columns, strict=True)
            return balanced(np.stack([each.cycle(column) for each, column in cycles], axis=1).ravel())

        right = balanced(load.ravel())
        matrix, inverse = (
            LinearOperator((size, size), matvec=own, dtype=np.float64) for own in (forces, precondition)
        )
        shift, unfinished = cg(matrix, right, rtol=tolerance, maxiter=MOST_ITERATIONS, M=inverse)
        if unfinished:
            raise ConvergenceError(
                ", ".join(self.mesh.parts),
                f"elasticity does not converge in {MOST_ITERATIONS} iterations.",
                "Refine the mesh or look for thin places.",
            )
        return shift.reshape(-1, 3)


def _constants(material: ElasticMaterial) -> tuple[float, float, float, float]:
    stiffness = material.stiffness
    return stiffness.normal[0, 1], material.shear_modulus, stiffness.thermal[0], material.density
