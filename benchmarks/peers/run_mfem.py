"""MFEM (its serial wheel): its own assembly, conjugate gradients with a symmetric Gauss-Seidel smoother."""

from __future__ import annotations

import tempfile
from pathlib import Path

import mfem.ser as mfem
import numpy as np
import protocol


def write_mesh(problem: protocol.Problem, path: Path, kind: np.ndarray) -> None:
    """MFEM mesh v1.0 text."""
    tetrahedra, facets = problem.tetrahedra, problem.facets
    with path.open("w", encoding="ascii") as stream:
        stream.write(f"MFEM mesh v1.0\n\ndimension\n3\n\nelements\n{len(tetrahedra)}\n")
        rows = np.column_stack((problem.part_of_element + 1, np.full(len(tetrahedra), 4), tetrahedra))
        np.savetxt(stream, rows, fmt="%d")
        stream.write(f"\nboundary\n{len(facets)}\n")
        np.savetxt(stream, np.column_stack((kind + 1, np.full(len(facets), 2), facets)), fmt="%d")
        stream.write(f"\nvertices\n{len(problem.points)}\n3\n")
        np.savetxt(stream, problem.points, fmt="%.17g")


def run(folder: Path, steps: int, record: protocol.Record) -> tuple[np.ndarray, np.ndarray | None]:
    """Solve the steady problem and the steps."""
    problem = protocol.Problem.read(folder)
    columns = (problem.film_coefficient, problem.ambient_temperature, problem.heat_flux)
    distinct, kind = np.unique(np.column_stack(columns), axis=0, return_inverse=True)
    with tempfile.TemporaryDirectory() as work:
        write_mesh(problem, Path(work) / "mesh", kind)
        # neither refined nor turned: nodes keep their numbers
        mesh = mfem.Mesh(str(Path(work) / "mesh"), 1, 0, False)
    film, ambient, heat = distinct.T

    def by_attribute(values):
        return mfem.PWConstCoefficient(mfem.Vector(np.ascontiguousarray(values, dtype=float)))

    def solve(matrix, right, unknowns):
        smoother = mfem.GSSmoother(matrix)
        solver = mfem.CGSolver()
        solver.SetRelTol(protocol.RELATIVE_TOLERANCE)
        solver.SetAbsTol(0.0)
        solver.SetMaxIter(20000)
        solver.SetPrintLevel(-1)
        solver.SetPreconditioner(smoother)
        solver.SetOperator(matrix)
        solver.iterative_mode = True
        solver.Mult(right, unknowns)
        return solver.GetNumIterations()

    def assembled(conductive, capacitive):
        form = mfem.BilinearForm(space)
        if conductive:
            form.AddDomainIntegrator(mfem.DiffusionIntegrator(conductivity))
            form.AddBoundaryIntegrator(mfem.BoundaryMassIntegrator(films))
        if capacitive:
            form.AddDomainIntegrator(mfem.MassIntegrator(capacity))
        form.Assemble()
        form.Finalize()
        return form

    def load(factor):
        flux = by_attribute(film * (ambient - problem.start_temperature) + factor * heat)
        form = mfem.LinearForm(space)
        form.AddBoundaryIntegrator(mfem.BoundaryLFIntegrator(flux))
        form.Assemble()
        return form

    conductivity, films = by_attribute(problem.part_conductivity), by_attribute(film)
    capacity = by_attribute(problem.part_capacity / problem.step_s)
    with record.stage("assembly"):
        collection = mfem.H1_FECollection(1, 3)
        space = mfem.FiniteElementSpace(mesh, collection)
        matrix = assembled(True, False)
        right = load(1.0)
    rise = mfem.Vector(len(problem.points))
    rise.Assign(0.0)
    with record.stage("solve"):
        record.notes["iterations"] = solve(matrix.SpMat(), right, rise)
    record.notes |= {"peak_kB": protocol.peak_kilobytes(), "threads": 1}
    steady = problem.start_temperature + rise.GetDataArray().copy()
    if not steps:
        return steady, None
    with record.stage("steps"):
        stored, stepped = assembled(False, True), assembled(True, True)
        loads_of = {factor: load(factor) for factor in np.unique(problem.heat_factor[:steps]).tolist()}
        rise.Assign(0.0)
        right = mfem.Vector(len(problem.points))
        counted = 0
        for factor in problem.heat_factor[:steps].tolist():
            stored.SpMat().Mult(rise, right)
            right.Add(1.0, loads_of[factor])
            counted += solve(stepped.SpMat(), right, rise)
    record.notes["step_iterations"] = counted
    return steady, problem.start_temperature + rise.GetDataArray().copy()


if __name__ == "__main__":
    protocol.main(run)
