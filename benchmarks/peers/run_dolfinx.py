"""DOLFINx with PETSc: its own assembly, conjugate gradients with GAMG or hypre (``--hypre``).

Also under ``mpirun``: the mesh is then divided between the processes.
"""

from __future__ import annotations

import contextlib
import io
import sys
from pathlib import Path

import dolfinx
import dolfinx.io.utils
import numpy as np
import protocol
import ufl
from dolfinx import fem, mesh
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

KIND = "hypre" if "--hypre" in sys.argv else "gamg"
if KIND == "hypre":
    sys.argv.remove("--hypre")
COMM = MPI.COMM_WORLD


def tagged_facets(domain, facets, kind):
    """Facet tags of the input's boundary triangles."""
    own = (facets, kind) if COMM.rank == 0 else (np.empty((0, 3), dtype=np.int64), np.empty(0, np.int32))
    entities, values = dolfinx.io.utils.distribute_entity_data(
        domain, 2, own[0].astype(np.int64), own[1].astype(np.int32)
    )
    domain.topology.create_connectivity(2, 0)
    domain.topology.create_connectivity(2, 3)
    adjacency = dolfinx.cpp.graph.AdjacencyList_int32(entities)
    return mesh.meshtags_from_entities(domain, 2, adjacency, np.asarray(values, dtype=np.int32))


def run(folder: Path, steps: int, record: protocol.Record) -> tuple[np.ndarray, np.ndarray | None]:
    """Solve the steady problem and the steps."""
    problem = protocol.Problem.read(folder)
    columns = (problem.film_coefficient, problem.ambient_temperature, problem.heat_flux)
    distinct, kind = np.unique(np.column_stack(columns), axis=0, return_inverse=True)
    shape = ufl.Mesh(ufl.VectorElement("Lagrange", ufl.tetrahedron, 1))
    mine = COMM.rank == 0
    domain = mesh.create_mesh(
        COMM,
        problem.tetrahedra.astype(np.int64) if mine else np.empty((0, 4), dtype=np.int64),
        problem.points if mine else np.empty((0, 3)),
        shape,
    )
    tags = tagged_facets(domain, problem.facets, kind)
    domain.topology.create_connectivity(2, 3)
    constant_space = fem.FunctionSpace(domain, ("DG", 0))
    original = np.asarray(domain.topology.original_cell_index)
    conductivity, capacity = fem.Function(constant_space), fem.Function(constant_space)
    conductivity.x.array[: len(original)] = problem.conductivity[original]
    capacity.x.array[: len(original)] = problem.capacity[original] / problem.step_s
    film, ambient, heat = distinct.T
    ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)

    def clock_in():
        COMM.barrier()

    def setup(matrix, prefix):
        solver = PETSc.KSP().create(COMM)
        solver.setOptionsPrefix(prefix)
        options = PETSc.Options()
        options.prefixPush(prefix)
        options["ksp_type"] = "cg"
        options["pc_type"] = KIND
        if KIND == "gamg":
            options["mg_levels_ksp_type"] = "chebyshev"
            options["mg_levels_pc_type"] = "jacobi"
        options.prefixPop()
        solver.setFromOptions()
        solver.setOperators(matrix)
        solver.setTolerances(rtol=protocol.RELATIVE_TOLERANCE, atol=0.0, max_it=2000)
        solver.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        solver.setUp()
        return solver

    def gathered(vector):
        """Values at the input's nodes, on the first process."""
        cells = domain.topology.index_map(3).size_local
        nodes = domain.geometry.dofmap.array.reshape(-1, 4)[:cells].ravel()
        dofs = space.dofmap.list.array.reshape(-1, 4)[:cells].ravel()
        values = np.zeros(len(problem.points))
        hit = np.zeros(len(problem.points))
        with vector.localForm() as local:
            array = local.array
        index = np.asarray(domain.geometry.input_global_indices)[nodes]
        values[index] = array[dofs]
        hit[index] = 1.0
        values, hit = COMM.allreduce(values), COMM.allreduce(hit)
        return values / hit

    def flux(factor):
        return film * (ambient - problem.start_temperature) + factor * heat

    with_constants = [fem.Constant(domain, PETSc.ScalarType(value)) for value in flux(1.0)]
    films = [fem.Constant(domain, PETSc.ScalarType(value)) for value in film]
    space = fem.FunctionSpace(domain, ("Lagrange", 1))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    conduction = conductivity * ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx
    for number, value in enumerate(films):
        conduction += value * u * v * ds(number)
    loads = sum(value * v * ds(number) for number, value in enumerate(with_constants))
    # compiled (or read from DOLFINx's own cache) before the clock starts
    steady_form, load_form = fem.form(conduction), fem.form(loads)
    stepped_form = fem.form(conduction + capacity * u * v * ufl.dx) if steps else None
    capacity_form = fem.form(capacity * u * v * ufl.dx) if steps else None

    def load(factor):
        for constant, value in zip(with_constants, flux(factor), strict=True):
            constant.value = value
        vector = fem_petsc.assemble_vector(load_form)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return vector

    def assembled(form):
        matrix = fem_petsc.assemble_matrix(form)
        matrix.assemble()
        return matrix

    clock_in()
    with record.stage("assembly"):
        matrix = assembled(steady_form)
        right = load(1.0)
        clock_in()
    with record.stage("setup"):
        solver = setup(matrix, "steady_")
        clock_in()
    rise = matrix.createVecRight()
    ghosted = fem.Function(space)
    with record.stage("solve"):
        solver.solve(right, rise)
        clock_in()
    record.notes |= {"iterations": solver.getIterationNumber(), "threads": COMM.size}
    peaks = COMM.allgather(protocol.peak_kilobytes())
    record.notes["peak_kB"] = int(np.sum(peaks))

    def temperatures(vector):
        ghosted.vector.array[:] = vector.array
        ghosted.x.scatter_forward()
        return problem.start_temperature + gathered(ghosted.vector)

    steady = temperatures(rise)
    if solver.getConvergedReason() < 0:
        raise RuntimeError(f"PETSc ended with {solver.getConvergedReason()}")
    if not steps:
        return steady, None
    solver.destroy()
    clock_in()
    with record.stage("steps"):
        stored, stepped = assembled(capacity_form), assembled(stepped_form)
        solver = setup(stepped, "steps_")
        solver.setInitialGuessNonzero(True)
        loads_of = {factor: load(factor) for factor in np.unique(problem.heat_factor[:steps]).tolist()}
        rise.set(0.0)
        counted = 0
        for factor in problem.heat_factor[:steps].tolist():
            right = stored * rise
            right.axpy(1.0, loads_of[factor])
            solver.solve(right, rise)
            counted += solver.getIterationNumber()
        clock_in()
    record.notes["step_iterations"] = counted
    return steady, temperatures(rise)


if __name__ == "__main__":
    if COMM.rank:
        with contextlib.redirect_stdout(io.StringIO()):
            protocol.main(run)
    else:
        protocol.main(run)
