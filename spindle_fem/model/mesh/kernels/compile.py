"""Compile the kernels and keep them on disk: ``python -m spindle_fem.model.mesh.kernels.compile``.

numba compiles a kernel at its first call, some seconds for all of them. A small problem is solved
with the kernels of a large one. After an installation that did not compile, a copy of the process
does it while the first machine is meshed and solved.
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import numpy as np
from scipy import sparse

from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.model.mesh.column_solver import corrections, product_of
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, LumpedNode
from spindle_fem.model.mesh.element_integrals import elements_by_kernel
from spindle_fem.model.mesh.equations import assemble_system
from spindle_fem.model.mesh.kernels import column_loops, team_loops
from spindle_fem.model.mesh.linear_solvers import build_preconditioner
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.steady_conduction import solve_steady
from spindle_fem.parallel import BackgroundProcess, beside, can_be_copied
from spindle_fem.parallel.worker_threads import Job


class KernelsInTurn:
    """Compile kernels, or load them from disk, in the order in which a run needs them."""

    def elements(self) -> None:
        """Kernels that integrate a mesh."""
        problem = _small_problem()
        mesh = problem.operators.mesh
        elements_by_kernel(mesh.points, mesh.tetrahedra, 2)

    def steady(self) -> None:
        """All that a steady solution calls."""
        self.elements()
        solve_steady(_small_problem(), method="multigrid")

    def columns(self) -> None:
        """Solutions for several right-hand sides, of folds and fast models."""
        _solve_columns()


# What waits for the kernels of each stage, by the process that began: copies of it do not wait for them.
_begun: dict[int, dict[str, Job]] = {}


def begin_compiling() -> dict[str, Job]:
    """Start to compile what is not kept on disk, or to load it, beside this process' work.

    Returns
    -------
    dict of str to callable
        For each method of :class:`KernelsInTurn` what waits until its kernels are there.
    """
    number = os.getpid()
    if number not in _begun:
        if can_be_copied() and not _are_kept():
            process = BackgroundProcess(KernelsInTurn)
            _begun[number] = {stage: cache(process.ask(stage)) for stage in ("elements", "steady", "columns")}
        else:
            loaded = cache(beside(KernelsInTurn().steady))
            _begun[number] = {"elements": loaded, "steady": loaded, "columns": lambda: None}
    return _begun[number]


def wait_for_columns() -> None:
    """Wait for the kernels of several right-hand sides, if a copy of this process compiles them."""
    if os.getpid() in _begun:
        _begun[os.getpid()]["columns"]()


def _are_kept() -> bool:
    """Whether the last kernels of both kinds to be compiled were kept since their source changed."""
    for kernel in (team_loops.conjugate_step, column_loops.add_prolonged_columns):
        source, folder = Path(kernel.py_func.__code__.co_filename), kernel.stats.cache_path
        indices = Path(folder or "").glob(f"{source.stem}.{kernel.__name__}-*.nbi")
        if not any(index.stat().st_mtime > source.stat().st_mtime for index in indices):
            return False
    return True


def _solve_columns() -> None:
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
    KernelsInTurn().steady()
    KernelsInTurn().columns()
