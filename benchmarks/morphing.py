"""What a design whose channel is deeper would gain by moving the mesh of another one.

    python benchmarks/morphing.py [--preset normal] [--changes 1 2 4]

Prints where the processor time of one design goes, and for each change of
depth (mm, both ways) the worst element of the moved mesh beside that of a new
one, and how far the temperatures on both lie apart, beside what a mesh of 1.5
times the element size changes.

The mesh is moved radially: what lies between the channel's floor and the
body's outside is stretched, in full along the channel and less and less
beyond its end. Ports would need more, so the machine has none.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from dataclasses import replace

import numpy as np

from spindle_fem.conduction.operators import build_operators
from spindle_fem.coupling import machine_on_mesh, prepare_machine
from spindle_fem.geometry.assembly import build_assembly
from spindle_fem.meshing.build import build_mesh
from spindle_fem.meshing.quality import sampled_quality
from spindle_fem.meshing.tagged_mesh import TaggedMesh
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.solve import solve_prepared
from spindle_fem.spec.load import load_machine
from spindle_fem.spec.model import MachineSpec

FADE = 0.06


def moved(mesh: TaggedMesh, spec: MachineSpec, depth: float) -> TaggedMesh:
    """The mesh with its channel deeper or shallower."""
    channel = spec.channel
    floor, roof = channel.inner_radius, channel.inner_radius + channel.depth
    body = next(part for part in spec.part if part.name == channel.part)
    end = channel.z_start + channel.pitch * channel.turns + channel.width
    beside = [s for s in body.segment if s.z[0] < end and s.z[1] > channel.z_start]
    outside = min(s.outer_diameter / 2.0 for s in beside if s.outer_diameter / 2.0 > roof)
    x, y, z = mesh.points.T
    radius = np.hypot(x, y)
    share = np.interp(radius, [floor, roof, outside], [0.0, 1.0, 0.0])
    share *= np.clip((end + FADE - z) / FADE, 0.0, 1.0)
    scale = 1.0 + (depth - channel.depth) * share / np.maximum(radius, 1e-9)
    points = np.column_stack((x * scale, y * scale, z))
    return replace(mesh, points=points)


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


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machine", default="recorded_spindle")
    parser.add_argument("--preset", default="normal")
    parser.add_argument("--changes", type=float, nargs="+", default=[1.0, 2.0, 4.0])
    options = parser.parse_args()
    base = load_machine(options.machine, [f"mesh.preset={options.preset}"])
    profile = cProfile.Profile()
    clock = [time.process_time()]
    profile.enable()
    mesh = build_mesh(build_assembly(base), options.preset, use_cache=False)
    profile.disable()
    clock.append(time.process_time())
    operators = build_operators(mesh, base.mesh.order)
    clock.append(time.process_time())
    first = solve_prepared(machine_on_mesh(base, mesh, operators))
    clock.append(time.process_time())
    meshing, assembly, solving = np.diff(clock)
    total = clock[-1] - clock[0]
    print(f"{options.machine}, {options.preset}: mesh {meshing:.2f} s, operators {assembly:.2f} s, "
          f"solve {solving:.2f} s; meshing is {meshing / total:.0%} of a design")  # fmt: skip
    pstats.Stats(profile).sort_stats("cumtime").print_stats("gmsh|meshing", 14)
    coarser = solve_prepared(prepare_machine(base, size_factor=1.5))
    print(f"a mesh of 1.5 times the size changes {same_numbers(first, coarser):.3f} K")
    for change in [sign * value for value in options.changes for sign in (1.0, -1.0)]:
        depth = base.channel.depth + 1e-3 * change
        spec = load_machine(options.machine, [f"mesh.preset={options.preset}", f"channel.depth={depth} m"])
        fresh = build_mesh(build_assembly(spec), options.preset)
        begin = time.process_time()
        other = replace(moved(mesh, base, depth), cad_area=fresh.cad_area, cad_volume=fresh.cad_volume)
        worst = float(sampled_quality(other.points[other.tetrahedra]).min())
        spent = time.process_time() - begin
        results = []
        for one in (other, fresh):
            machine = machine_on_mesh(spec, one, build_operators(one, spec.mesh.order))
            results.append(solve_prepared(machine))
        print(
            f"depth {depth * 1e3:4.1f} mm: moved in {spent:.2f} s, worst minSICN {worst:.3f} "
            f"(new mesh {fresh.min_quality:.3f}), temperatures apart {same_numbers(*results):.3f} K"
        )


if __name__ == "__main__":
    main()
