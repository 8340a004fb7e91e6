"""The benchmark's problem through spindle_fem: operators, system, multigrid, conjugate gradients."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import protocol

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from case import STEP_S, divided, merged_nodes, read_case
from numbering import numbered
from solved_space import SolvedSpace

from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.machine.meshing.tagged_mesh import Joint, TaggedMesh
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film
from spindle_fem.model.mesh.equations import assemble_capacity, assemble_load, assemble_system
from spindle_fem.model.mesh.linear_solvers import build_preconditioner, multiply, solve_linear
from spindle_fem.model.mesh.linear_system import ThermalSystem, merged
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.time_stage import add_scaled
from spindle_fem.parallel import thread_count

# Estimated error that each step may leave.
STEP_TOLERANCE_K = 1e-6


def problem_on(mesh: TaggedMesh, case: dict) -> ConductionProblem:
    """Operators of a mesh and the case's coefficients on them."""
    return ConductionProblem(
        build_operators(mesh, 1),
        case["conductivity"],
        films=tuple(
            Film(surface, coefficient, ambient)
            for surface, (coefficient, ambient, _) in case["loads"].items()
            if coefficient > 0.0
        ),
        joint_conductance=dict.fromkeys(mesh.joints, np.inf),
        surface_heat={surface: heat for surface, (_, _, heat) in case["loads"].items() if heat},
        volumetric_capacity=case["volumetric_capacity"],
        adiabatic="rest",
    )


def thermal_system(folder: Path) -> tuple[ConductionProblem, ThermalSystem, ThermalSystem]:
    """Problem, system and tied system of a case."""
    mesh, case = read_case(folder)
    problem = problem_on(numbered(mesh)[0], case)
    system = assemble_system(problem, case["start_temperature"])
    return problem, system, system.tied()


def run(folder: Path, steps: int, record: protocol.Record) -> tuple[np.ndarray, np.ndarray | None]:
    """Solve the steady problem and the steps."""
    warm_up()
    mesh, case = read_case(folder)
    # the mesh in our own form, as DOLFINx numbers anew what it reads
    first = merged_nodes(mesh)[1]
    mesh, number = numbered(mesh)
    first = number[first]
    start = case["start_temperature"]
    record.notes["threads"] = thread_count()
    record.notes["mesh_kB"] = protocol.resident_kilobytes()

    with record.stage("assembly"):
        problem = problem_on(mesh, case)
        system = assemble_system(problem, start)
        tied = system.tied()
    with record.stage("setup"):
        preconditioner = build_preconditioner(tied, "multigrid")
    with record.stage("solve"):
        solution = solve_linear(
            tied.matrix, tied.load, preconditioner, relative_tolerance=protocol.RELATIVE_TOLERANCE
        )
    record.notes |= {"iterations": solution.iterations, "residual": solution.residual}
    record.notes["peak_kB"] = protocol.peak_kilobytes()
    steady = start + (system.tie @ solution.unknowns)[first]
    if not steps:
        return steady, None
    heat_factor = protocol.Problem.read(folder).heat_factor[:steps]
    with record.stage("steps"):
        storage = merged(assemble_capacity(problem)[0], system.tie)
        stepped = add_scaled(storage, STEP_S, tied.matrix)
        preconditioner = build_preconditioner(replace(tied, matrix=stepped), "multigrid")
        loads = {factor: system.tie.T @ _load(problem, start, factor) for factor in np.unique(heat_factor)}
        known = SolvedSpace(stepped)
        rise = np.zeros(len(tied.load))
        counted = 0
        for factor in heat_factor:
            residual = STEP_S * (loads[factor] - multiply(tied.matrix, rise))
            guess = known.guess(residual)
            change = solve_linear(stepped, residual, preconditioner, guess, error_tolerance=STEP_TOLERANCE_K)
            counted += change.iterations
            if change.iterations:
                known.add(change.unknowns, guess)
            rise += change.unknowns
    record.notes["step_iterations"] = counted
    return steady, start + (system.tie @ rise)[first]


def _load(problem: ConductionProblem, reference: float, heat_factor: float) -> np.ndarray:
    """Load of the problem with all heat scaled."""
    heat = {surface: heat_factor * value for surface, value in problem.surface_heat.items()}
    return assemble_load(replace(problem, surface_heat=heat), reference)[0]


def warm_up() -> None:
    """Load what is compiled, by a small problem, before clocks and memory are read."""
    mesh = divided(build_joined_tubes((1.0, 1.5, 2.0), 1.0, ((2, 2), 8, 2)))
    # arrays as read_case gives them: compiled code is made for each kind
    small = {"surfaces": {name: facets.astype(np.int32) for name, facets in mesh.surfaces.items()}}
    small["joints"] = {
        name: Joint(name, joint.facets_a.astype(np.int32), joint.facets_b.astype(np.int32))
        for name, joint in mesh.joints.items()
    }
    mesh = numbered(replace(mesh, tetrahedra=mesh.tetrahedra.astype(np.int32), **small))[0]
    problem = ConductionProblem(
        build_operators(mesh, 1),
        dict.fromkeys(mesh.part_names, 1.0),
        films=(Film("inner.z0", 1.0, 300.0),),
        joint_conductance=dict.fromkeys(mesh.joints, np.inf),
        volumetric_capacity=dict.fromkeys(mesh.part_names, 1.0),
        adiabatic="rest",
    )
    system = assemble_system(problem)
    tied = system.tied()
    merged(assemble_capacity(problem)[0], system.tie)
    ones = np.ones(len(tied.load))
    preconditioner = build_preconditioner(tied, "multigrid")
    known = SolvedSpace(tied.matrix)
    known.add(solve_linear(tied.matrix, ones, preconditioner, ones).unknowns)
    known.add(multiply(tied.matrix, ones), known.guess(ones))


if __name__ == "__main__":
    protocol.main(run)
