"""Time saved by moving meshes in a sweep of channel geometries, and the change of the temperatures.

    python benchmarks/morphing.py [--machine recorded_spindle] [--preset normal] [--random 0]

For each design: processor seconds of a new mesh and of moving that of the
design's lattice point (``spindle_fem.studies.sweep.morphing``), the worst element of
both, and how far the temperatures on both lie apart; beside it what a mesh of
1.5 times the element size changes. With ``--random``, that many designs drawn
around the machine's channel after those below.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import MeshQualityError, SpindleFemError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.meshing.build_mesh import build_mesh
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.solvers.prepared_machine import machine_on_mesh, prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared
from spindle_fem.studies.sweep.channel_map import MOVABLE
from spindle_fem.studies.sweep.morphing import LATTICE, lattice_assembly, lattice_machine, move_mesh

# Shares of a lattice step by which the channel differs from the machine's own; each alone, then together.
SHARES = (0.3, 0.5, -0.3, -0.48)


def same_numbers(first: ThermalResult, second: ThermalResult) -> float:
    """Largest difference of probes, bearings and hottest place, K."""
    found = [first.temperature_maximum - second.temperature_maximum]
    found += [value - second.probes[name] for name, value in first.probes.items()]
    for name, bearing in first.bearings.items():
        other = second.bearings[name]
        found += [
            bearing.temperature_inner - other.temperature_inner,
            bearing.temperature_outer - other.temperature_outer,
        ]
    return float(np.abs(found).max())


def solved_on(spec: MachineSpec, mesh: TaggedMesh) -> tuple[ThermalResult, float]:
    """Result on a mesh and the processor seconds from there on."""
    begin = time.process_time()
    result = solve_prepared(machine_on_mesh(spec, mesh, build_operators(mesh, spec.mesh.order)))
    return result, time.process_time() - begin


def compare(spec: MachineSpec, meshes: dict[str, TaggedMesh]) -> tuple[float, float, float] | None:
    """One line of the table; seconds for a new mesh, for moving one, and for the rest of a design."""
    target = build_assembly(spec)
    values = ", ".join(f"{name} {getattr(spec.channel, name) * 1e3:5.2f}" for name in MOVABLE)
    begin = time.process_time()
    fresh = build_mesh(target, spec.mesh.preset, use_cache=False)
    meshing = time.process_time() - begin
    near = lattice_assembly(spec)
    if near is None:
        what = "lies on the lattice" if lattice_machine(spec) is None else "has no lattice point to move from"
        print(f"{values} mm {what}")
        return None
    source, assembly = near
    point = ", ".join(f"{getattr(source.channel, name) * 1e3:g}" for name in MOVABLE)
    if point not in meshes:
        meshes[point] = build_mesh(assembly, spec.mesh.preset)
    begin = time.process_time()
    try:
        moved = move_mesh(meshes[point], assembly, target)
    except MeshQualityError as error:
        print(f"{values} mm from {point}: meshed anew, {error.what}")
        return None
    moving = time.process_time() - begin
    (exact, rest), (other, _) = solved_on(spec, fresh), solved_on(spec, moved)
    print(
        f"{values} mm from {point}: new {meshing:5.2f} s, moved {moving:4.2f} s; worst minSICN "
        f"new {fresh.min_quality:.3f}, moved {moved.min_quality:.3f}; "
        f"temperatures {same_numbers(exact, other):.4f} K apart",
        flush=True,
    )
    return meshing, moving, rest


def designs(spec: MachineSpec, number: int) -> list[dict[str, float]]:
    """Channels: each dimension alone, all together, then random ones; some may be impossible."""
    own = {name: getattr(spec.channel, name) for name in MOVABLE}
    found = [own | {name: own[name] + share * LATTICE[name]} for name in MOVABLE for share in SHARES]
    found += [{name: value + share * LATTICE[name] for name, value in own.items()} for share in SHARES]
    random = np.random.default_rng(1)
    for _ in range(number):
        factors = random.uniform((0.5, 0.6, 0.85), (2.2, 1.3, 1.1))
        found.append(
            {name: value * factor for (name, value), factor in zip(own.items(), factors, strict=True)}
        )
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machine", default="recorded_spindle")
    parser.add_argument("--preset", default="normal")
    parser.add_argument("--random", type=int, default=0)
    options = parser.parse_args()
    overrides = [f"mesh.preset={options.preset}"]
    base = load_machine(options.machine, overrides)
    first = solve_prepared(prepare_machine(base))
    coarser = solve_prepared(prepare_machine(base, size_factor=1.5))
    print(f"a mesh of 1.5 times the element size changes {same_numbers(first, coarser):.4f} K")
    meshes: dict[str, TaggedMesh] = {}
    seconds = []
    for values in designs(base, options.random):
        changes = [f"channel.{name}={value:.6g} m" for name, value in values.items()]
        try:
            spec = load_machine(options.machine, [*overrides, *changes])
            build_assembly(spec)
        except SpindleFemError:
            continue
        found = compare(spec, meshes)
        if found is not None:
            seconds.append(found)
    new, moved, rest = np.mean(seconds, axis=0)
    print(
        f"{len(seconds)} designs: a new mesh {new:.2f} s, a moved one {moved:.2f} s, all else {rest:.2f} s; "
        f"a design takes {(moved + rest) / (new + rest):.0%} of its time once its lattice point is meshed"
    )


if __name__ == "__main__":
    main()
