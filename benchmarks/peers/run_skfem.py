"""scikit-fem as in its examples: forms over a Basis, pyamg smoothed aggregation with conjugate gradients."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import protocol
import pyamg
from scipy.sparse.linalg import cg
from skfem import Basis, BilinearForm, ElementTetP0, ElementTetP1, FacetBasis, LinearForm, MeshTet
from skfem.helpers import dot, grad


@BilinearForm
def conduction(u, v, w):
    """Conduction form with one conductivity per element."""
    return w.conductivity * dot(grad(u), grad(v))


@BilinearForm
def storage(u, v, w):
    """Storage form with one volumetric capacity per element."""
    return w.capacity * u * v


def run(folder: Path, steps: int, record: protocol.Record) -> tuple[np.ndarray, np.ndarray | None]:
    """Solve the steady problem and the steps."""
    problem = protocol.Problem.read(folder)
    mesh = MeshTet(np.ascontiguousarray(problem.points.T), np.ascontiguousarray(problem.tetrahedra.T))
    known = np.sort(mesh.facets, axis=0).astype(np.int64)
    asked = np.sort(problem.facets, axis=1).T.astype(np.int64)
    size = np.int64(len(problem.points))
    keys, asked_keys = ((k[0] * size + k[1]) * size + k[2] for k in (known, asked))
    order = np.argsort(keys)
    facets = order[np.searchsorted(keys, asked_keys, sorter=order)]

    def loads(basis, factor):
        flux = problem.flux(factor)
        return LinearForm(lambda v, w: flux[:, None] * v).assemble(basis)

    with record.stage("assembly"):
        basis = Basis(mesh, ElementTetP1())
        parts = basis.with_element(ElementTetP0())
        matrix = conduction.assemble(basis, conductivity=parts.interpolate(problem.conductivity))
        boundary = FacetBasis(mesh, ElementTetP1(), facets=facets)
        matrix = matrix + BilinearForm(
            lambda u, v, w: problem.film_coefficient[:, None] * u * v
        ).assemble(boundary)  # fmt: skip
        load = loads(boundary, 1.0)
    with record.stage("setup"):
        hierarchy = pyamg.smoothed_aggregation_solver(matrix.tocsr()).aspreconditioner()
    counted = []
    with record.stage("solve"):
        rise, status = cg(
            matrix, load, rtol=protocol.RELATIVE_TOLERANCE, M=hierarchy, callback=counted.append
        )
    if status:
        raise RuntimeError(f"conjugate gradients ended with {status}")
    record.notes |= {"iterations": len(counted), "peak_kB": protocol.peak_kilobytes()}
    steady = problem.start_temperature + rise
    if not steps:
        return steady, None
    with record.stage("steps"):
        capacity = storage.assemble(basis, capacity=parts.interpolate(problem.capacity)) / problem.step_s
        stepped = (matrix + capacity).tocsr()
        hierarchy = pyamg.smoothed_aggregation_solver(stepped).aspreconditioner()
        loads_of = {factor: loads(boundary, factor) for factor in np.unique(problem.heat_factor[:steps])}
        rise = np.zeros(len(problem.points))
        for factor in problem.heat_factor[:steps]:
            right = loads_of[factor] + capacity @ rise
            rise, status = cg(
                stepped,
                right,
                x0=rise,
                rtol=protocol.RELATIVE_TOLERANCE,
                M=hierarchy,
                callback=counted.append,
            )
            if status:
                raise RuntimeError(f"conjugate gradients ended with {status}")
    record.notes["step_iterations"] = len(counted) - record.notes["iterations"]
    return steady, problem.start_temperature + rise


if __name__ == "__main__":
    protocol.main(run)
