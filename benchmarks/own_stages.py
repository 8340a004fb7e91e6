"""Seconds of each stage of the machine's own pipeline, on a mesh of a given size factor.

    python benchmarks/own_stages.py SIZE_FACTOR [--machine wu_tan_2016] [--steps 100] [--no-reduced]

Quadratic temperatures on curved elements, the coupled problem, as ``spindle-fem
run`` solves it; prints one line of JSON.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

from spindle_fem.definition.load import load_machine
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.meshing.build_mesh import build_mesh
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.steady_conduction import solve_steady
from spindle_fem.model.mesh.step_control import StepControl
from spindle_fem.model.mesh.thermal_state import uniform_state
from spindle_fem.model.mesh.time_stepper import integrate
from spindle_fem.model.reduced.build_reduced import build_reduced_model
from spindle_fem.model.reduced.mesh_model import build_mesh_model
from spindle_fem.model.reduced.solving_order import in_solving_order
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.report.run_outputs import write_outputs
from spindle_fem.results.run_summary import peak_memory_MB
from spindle_fem.solvers.coupled_steady import solve_coupled
from spindle_fem.solvers.machine_network_steady import solve_machine_network
from spindle_fem.solvers.prepared_machine import machine_on_mesh
from spindle_fem.studies.solve_machine import solve_prepared

STEP_S = 60.0


def measure(machine_name: str, size_factor: float, steps: int, reduced: bool) -> dict:
    """Run every stage once."""
    seconds: dict[str, float] = {}
    last = time.perf_counter()

    def lap(name: str) -> None:
        nonlocal last
        now = time.perf_counter()
        seconds[name] = now - last
        last = now

    spec = load_machine(machine_name, ("mesh.preset=coarse",))
    assembly = build_assembly(spec)
    lap("definition and geometry")
    mesh = build_mesh(assembly, "coarse", size_factor=size_factor, use_cache=False)
    lap("mesh")
    operators = build_operators(mesh, 2)
    lap("assembly (unit integrals)")
    machine = machine_on_mesh(spec, mesh, operators)
    point = OperatingPoint.of(spec)
    coupled = solve_coupled(machine, point)
    lap("coupled solution")
    problem = coupled.solution.problem
    solution = solve_steady(problem)
    lap("one steady solution (system, set-up, solve)")
    solve_steady(problem, preconditioner=solution.preconditioner)
    lap("one more with the same hierarchy")
    state = machine.field_state(
        coupled.solution.temperature,
        dict(zip(problem.lumped_names, coupled.solution.lumped_temperature.tolist(), strict=True)),
    )
    machine.builder.at(point, state)
    lap("tribology, films and coolant at one field")
    if steps:
        control = StepControl(tolerance=None, first_step=STEP_S)
        start = uniform_state(problem, spec.operation.ambient_temperature)
        integrate(problem, start, steps * STEP_S, control=control)
        lap(f"{steps} implicit steps")
    network = build_machine_network(spec)
    lap("network, made")
    solve_machine_network(network, point)
    lap("network, solved")
    if reduced:
        build_reduced_model(machine.spec, in_solving_order(build_mesh_model(machine)))
        lap("reduced model")
    result = solve_prepared(machine)
    lap("checked result")
    with tempfile.TemporaryDirectory() as folder:
        write_outputs(result, Path(folder))
    lap("heat over speed, pictures and report")
    return {
        "nodes": operators.n_unknowns,
        "elements": mesh.n_elements,
        "seconds": seconds,
        "peak_MB": peak_memory_MB(),
    }


def main() -> None:
    """Parse, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("size_factor", type=float)
    parser.add_argument("--machine", default="wu_tan_2016")
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--no-reduced", action="store_true")
    arguments = parser.parse_args()
    answer = measure(arguments.machine, arguments.size_factor, arguments.steps, not arguments.no_reduced)
    json.dump(answer, sys.stdout)
    print()


if __name__ == "__main__":
    main()
