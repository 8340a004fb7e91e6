"""numpy assembly in triplets and the direct solver PARDISO (MKL)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import protocol
import pypardiso
from scipy import sparse


def triplets(nodes: np.ndarray, local: np.ndarray, size: int) -> sparse.csr_array:
    """Sum of local matrices (n, k, k) over their nodes (n, k)."""
    k = nodes.shape[1]
    rows, columns = np.repeat(nodes, k, axis=1).ravel(), np.tile(nodes, (1, k)).ravel()
    return sparse.coo_array((local.ravel(), (rows, columns)), shape=(size, size)).tocsr()


def run(folder: Path, steps: int, record: protocol.Record) -> tuple[np.ndarray, np.ndarray | None]:
    """Solve the steady problem and the steps."""
    problem = protocol.Problem.read(folder)
    size = len(problem.points)

    def load(factor):
        each = problem.flux(factor) * area / 3.0
        return np.bincount(problem.facets.ravel(), weights=np.repeat(each, 3), minlength=size)

    with record.stage("assembly"):
        corners = problem.points[problem.tetrahedra]
        edges = corners[:, 1:] - corners[:, :1]
        volume = np.linalg.det(edges) / 6.0
        gradients = np.empty((len(edges), 4, 3))
        gradients[:, 1:] = np.linalg.inv(edges).transpose(0, 2, 1)
        gradients[:, 0] = -gradients[:, 1:].sum(axis=1)
        local = (problem.conductivity * volume)[:, None, None] * (gradients @ gradients.transpose(0, 2, 1))
        matrix = triplets(problem.tetrahedra, local, size)
        sides = problem.points[problem.facets]
        area = 0.5 * np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1)
        films = (problem.film_coefficient * area / 12.0)[:, None, None] * (np.ones((3, 3)) + np.eye(3))
        matrix = (matrix + triplets(problem.facets, films, size)).tocsr()
        right = load(1.0)
    solver = pypardiso.PyPardisoSolver(mtype=2)
    with record.stage("setup"):
        upper = sparse.csr_matrix(sparse.triu(matrix, format="csr"))
        solver.factorize(upper)
    with record.stage("solve"):
        rise = solver.solve(upper, right)
    record.notes |= {"iterations": 0, "peak_kB": protocol.peak_kilobytes()}
    steady = problem.start_temperature + rise
    if not steps:
        return steady, None
    with record.stage("steps"):
        storage = (problem.capacity * volume / 20.0)[:, None, None] * (np.ones((4, 4)) + np.eye(4))
        stored = triplets(problem.tetrahedra, storage / problem.step_s, size)
        upper = sparse.csr_matrix(sparse.triu(matrix + stored, format="csr"))
        solver.factorize(upper)
        loads_of = {factor: load(factor) for factor in np.unique(problem.heat_factor[:steps])}
        rise = np.zeros(size)
        for factor in problem.heat_factor[:steps]:
            rise = solver.solve(upper, loads_of[factor] + stored @ rise)
    return steady, problem.start_temperature + rise


if __name__ == "__main__":
    protocol.main(run)
