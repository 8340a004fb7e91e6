"""The benchmark's problem through spindle_fem: operators, system, multigrid, conjugate gradients."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import protocol

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from case import merged_nodes, read_case

from spindle_fem.conduction.assemble import assemble_capacity, assemble_system
from spindle_fem.conduction.linear_solvers import build_preconditioner, solve_linear
from spindle_fem.conduction.operators import build_operators
from spindle_fem.conduction.problem import ConductionProblem, Film


def run(folder: Path, steps: int, record: protocol.Record) -> tuple[np.ndarray, np.ndarray | None]:
    """Solve the steady problem and the steps."""
    mesh, case = read_case(folder)
    start = case["start_temperature"]
    first = merged_nodes(mesh)[1]
    record.notes["mesh_kB"] = protocol.resident_kilobytes()

    with record.stage("assembly"):
        operators = build_operators(mesh, 1)
        problem = ConductionProblem(
            operators,
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
    return steady, None


if __name__ == "__main__":
    protocol.main(run)
