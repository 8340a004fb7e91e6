"""Time and size of meshing the reference spindle, stage by stage.

``python benchmarks/meshing.py [--preset normal] [--size-factor 1.0]`` prints
seconds of wall clock and of processor, nodes, elements and the worst element.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

from spindle_fem.definition.load import load_machine
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.geometry.cad_solids import build_solids, gmsh_session
from spindle_fem.machine.meshing.generate import LADDER, mesh_once
from spindle_fem.machine.meshing.quality import area_errors, require_quality, volume_errors
from spindle_fem.machine.meshing.sizes import build_sizes
from spindle_fem.machine.meshing.tags import tag_mesh


def timed(label: str, function: Callable[[], Any]) -> Any:
    """Result of a call whose times are printed."""
    wall, processor = time.perf_counter(), time.process_time()
    result = function()
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(f"{label:32s} {wall:6.2f} s wall {processor:6.2f} s processor")
    return result


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machine", default="wu_tan_2016")
    parser.add_argument("--preset", default="normal")
    parser.add_argument("--size-factor", type=float, default=1.0)
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args()
    spec = load_machine(arguments.machine)
    assembly = timed("meridian faces and checks", lambda: build_assembly(spec))
    sizes = build_sizes(assembly, arguments.preset, size_factor=arguments.size_factor)
    with gmsh_session(arguments.threads) as geometry:
        timed("solids alone", lambda: build_solids(assembly, geometry))
    linear = timed(
        "solids, gmsh, classification", lambda: mesh_once(assembly, sizes, LADDER[0], arguments.threads)
    )
    mesh = timed("parts, curving, tags, relaxation", lambda: tag_mesh(assembly, linear))
    timed("areas and volumes against CAD", lambda: require_quality(mesh, minimum=0.0))
    print(f"{len(mesh.points)} nodes, {mesh.n_elements} elements, worst minSICN {mesh.min_quality:.3f}")
    print(f"largest area error {max(map(abs, area_errors(mesh).values())):.1e}")
    print(f"largest volume error {max(map(abs, volume_errors(mesh).values())):.1e}")


if __name__ == "__main__":
    main()
