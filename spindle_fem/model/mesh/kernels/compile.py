"""Compile the kernels and keep them on disk: ``python -m spindle_fem.model.mesh.kernels.compile``.

numba compiles a kernel at its first call. A tiny problem is solved with the kernels of a large
one, so that the call that needs them finds them ready.
"""

from __future__ import annotations

import threading
from functools import cache

from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, LumpedNode
from spindle_fem.model.mesh.element_integrals import elements_by_kernel
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.steady_conduction import solve_steady


def compile_kernels() -> None:
    """Compile every kernel that a steady run calls, or load it from disk."""
    mesh = build_joined_tubes((0.1, 0.15, 0.2), 0.05, ((1, 1), 12, 2))
    elements_by_kernel(mesh.points, mesh.tetrahedra, 2)
    problem = ConductionProblem(
        build_operators(mesh, 2),
        dict.fromkeys(mesh.part_names, 40.0),
        films=(Film("outer.outer", 300.0, 290.0),),
        joint_conductance={"inner|outer": 2e3},
        lumped_nodes=(LumpedNode("air", (("inner.z1", 50.0), ("outer.z1", 30.0)), heat=3.0),),
        adiabatic="rest",
    )
    solve_steady(problem, method="multigrid")


@cache
def compile_beside() -> threading.Thread:
    """Compile in a thread of its own, once in a process: beside work that leaves the interpreter's lock alone."""
    thread = threading.Thread(target=compile_kernels, name="spindle-fem-compile", daemon=True)
    thread.start()
    return thread


if __name__ == "__main__":
    compile_kernels()
