"""Compile the kernels and keep them on disk: ``python -m spindle_fem.model.mesh.kernels.compile``.

numba compiles a kernel at its first call, some seconds for all of them. A small problem is solved
with the kernels of a large one; machines are meshed meanwhile.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.model.mesh.column_solver import corrections, product_of
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, LumpedNode
from spindle_fem.model.mesh.element_integrals import elements_by_kernel
from spindle_fem.model.mesh.equations import assemble_system
from spindle_fem.model.mesh.linear_solvers import build_preconditioner
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.steady_conduction import solve_steady


def compile_kernels() -> None:
    """Compile every kernel that a steady run calls, or load it from disk."""
    problem = _small_problem()
    mesh = problem.operators.mesh
    elements_by_kernel(mesh.points, mesh.tetrahedra, 2)
    solve_steady(problem, method="multigrid")


def compile_column_kernels() -> None:
    """Compile kernels for several right-hand sides, with which fast models are made."""
    system = assemble_system(_small_problem()).tied()
    preconditioner = build_preconditioner(system, "multigrid")
    matrix = sparse.csr_array(system.full_matrix())
    for kind in (np.float32, np.float64):
        loads = np.ones((matrix.shape[0], 2), dtype=kind)
        product = product_of(matrix.astype(kind))
        corrections(
            lambda vectors, out, _, product=product: product(vectors, out),
            loads,
            preconditioner.apply(loads),
            preconditioner.apply,
            np.full(2, 1e-6),
        )


def _small_problem() -> ConductionProblem:
    mesh = build_joined_tubes((0.1, 0.15, 0.2), 0.1, ((2, 2), 16, 4))
    return ConductionProblem(
        build_operators(mesh, 2),
        dict.fromkeys(mesh.part_names, 40.0),
        films=(Film("outer.outer", 300.0, 290.0),),
        joint_conductance={"inner|outer": 2e3},
        lumped_nodes=(LumpedNode("air", (("inner.z1", 50.0), ("outer.z1", 30.0)), heat=3.0),),
        adiabatic="rest",
    )


if __name__ == "__main__":
    compile_kernels()
    compile_column_kernels()
