"""NGSolve: its own assembly and threads; conjugate gradients with ``h1amg`` or Jacobi (``--local``)."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import netgen.meshing as netgen
import ngsolve as ngs
import numpy as np
import protocol

# Relative to the change of one step, where other programs use 1e-8 of the whole rise.
CHANGE_TOLERANCE = 1e-6
KIND = "local" if "--local" in sys.argv else "h1amg"
if KIND == "local":
    sys.argv.remove("--local")


def read_mesh(problem: protocol.Problem) -> tuple[ngs.Mesh, np.ndarray]:
    """NGSolve mesh with a boundary number for each distinct film and heat."""
    mesh = netgen.Mesh(dim=3)
    mesh.AddPoints(np.ascontiguousarray(problem.points))
    loads = np.column_stack((problem.film_coefficient, problem.ambient_temperature, problem.heat_flux))
    distinct, kind = np.unique(loads, axis=0, return_inverse=True)
    for number in range(len(distinct)):
        index = mesh.Add(netgen.FaceDescriptor(surfnr=number + 1, domin=1, bc=number + 1))
        mesh.AddElements(dim=2, index=index, data=problem.facets[kind == number].astype(np.int32), base=0)
        mesh.SetBCName(number, f"film{number}")
    # NGSolve's positive orientation is the mirror of ours.
    for part in range(len(problem.part_conductivity)):
        index = mesh.AddRegion(f"part{part}", dim=3)
        own = problem.tetrahedra[problem.part_of_element == part][:, [0, 1, 3, 2]]
        mesh.AddElements(dim=3, index=index, data=np.ascontiguousarray(own, dtype=np.int32), base=0)
    mesh.Update()
    return ngs.Mesh(mesh), distinct


def run(folder: Path, steps: int, record: protocol.Record) -> tuple[np.ndarray, np.ndarray | None]:
    """Solve the steady problem and the steps."""
    threads = int(os.environ.get("PEER_THREADS", "2"))
    ngs.SetNumThreads(threads)
    record.notes["threads"] = threads
    problem = protocol.Problem.read(folder)
    mesh, loads = read_mesh(problem)
    names = [f"film{number}" for number in range(len(loads))]

    def on_boundary(values):
        return mesh.BoundaryCF(dict(zip(names, values.tolist(), strict=True)), default=0.0)

    def of_parts(values):
        return mesh.MaterialCF({f"part{k}": float(v) for k, v in enumerate(values)})

    film, ambient, heat = loads.T
    with ngs.TaskManager():
        with record.stage("assembly"):
            space = ngs.H1(mesh, order=1)
            u, v = space.TnT()
            matrix = ngs.BilinearForm(space, symmetric=True)
            matrix += of_parts(problem.part_conductivity) * ngs.grad(u) * ngs.grad(v) * ngs.dx
            matrix += on_boundary(film) * u * v * ngs.ds
            inverse = ngs.Preconditioner(matrix, KIND)

            def load(factor):
                flux = film * (ambient - problem.start_temperature) + factor * heat
                form = ngs.LinearForm(space)
                form += on_boundary(flux) * v * ngs.ds
                return form.Assemble().vec

            # assembles the matrix and sets the preconditioner up: NGSolve has no seam between
            matrix.Assemble()
            right = load(1.0)
        rise = ngs.GridFunction(space)

        def solver(form, preconditioner, tolerance=protocol.RELATIVE_TOLERANCE):
            return ngs.CGSolver(
                form.mat, preconditioner.mat, tol=tolerance, maxiter=2000, printrates=False
            )  # fmt: skip

        with record.stage("solve"):
            solve = solver(matrix, inverse)
            rise.vec.data = solve * right
        record.notes |= {"iterations": solve.iterations, "peak_kB": protocol.peak_kilobytes()}
        steady = problem.start_temperature + rise.vec.FV().NumPy().copy()
        if not steps:
            return steady, None
        with record.stage("steps"):
            capacity = ngs.BilinearForm(space, symmetric=True)
            capacity += of_parts(problem.part_capacity / problem.step_s) * u * v * ngs.dx
            capacity.Assemble()
            stepped = ngs.BilinearForm(space, symmetric=True)
            stepped += of_parts(problem.part_conductivity) * ngs.grad(u) * ngs.grad(v) * ngs.dx
            stepped += of_parts(problem.part_capacity / problem.step_s) * u * v * ngs.dx
            stepped += on_boundary(film) * u * v * ngs.ds
            inverse = ngs.Preconditioner(stepped, KIND)
            stepped.Assemble()
            loads_of = {factor: load(factor) for factor in np.unique(problem.heat_factor[:steps]).tolist()}
            rise.vec[:] = 0.0
            residual, change = rise.vec.CreateVector(), rise.vec.CreateVector()
            counted = 0
            for factor in problem.heat_factor[:steps].tolist():
                # the change of a step solves the same matrix with the steady residual at its start
                residual.data = loads_of[factor] - matrix.mat * rise.vec
                solve = solver(stepped, inverse, CHANGE_TOLERANCE)
                change.data = solve * residual
                counted += solve.iterations
                rise.vec.data += change
        record.notes["step_iterations"] = counted
        return steady, problem.start_temperature + rise.vec.FV().NumPy().copy()


if __name__ == "__main__":
    protocol.main(run)
