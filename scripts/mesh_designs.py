"""Mesh many random channel designs of a machine and report each.

``python scripts/mesh_designs.py --number 300 --seed 1`` draws designs from the
space of scripts.design_space, meshes every valid one at the coarse
preset and ends with status 1 if one fails.
"""

from __future__ import annotations

import argparse
import sys
import time

from scripts.design_space import draw_valid_designs
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import SpindleFemError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.meshing.build_mesh import generate_mesh
from spindle_fem.machine.meshing.sizes import build_sizes


def main() -> int:
    """Mesh the designs; number of failures as exit status, at most 1."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machine", default="wu_tan_2016")
    parser.add_argument("--number", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--preset", default="coarse")
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args()
    reference = build_assembly(load_machine(arguments.machine))
    designs = draw_valid_designs(
        reference.parts, reference.channel.definition, arguments.number, arguments.seed
    )
    failures, qualities, retries = 0, [], 0
    begun = time.perf_counter()
    for index, assembly in enumerate(designs):
        channel = assembly.channel.definition
        label = (
            f"{index + 1:4d} depth {channel.depth * 1e3:5.2f} width {channel.width * 1e3:5.2f} "
            f"pitch {channel.pitch * 1e3:5.2f} turns {channel.turns:g} "
            f"starts {channel.starts} {channel.hand:5s}"
        )
        start = time.perf_counter()
        try:
            mesh = generate_mesh(assembly, build_sizes(assembly, arguments.preset), threads=arguments.threads)
        except SpindleFemError as error:
            failures += 1
            print(f"{label}  FAILED {error}", flush=True)
            continue
        qualities.append(mesh.min_quality)
        notes = [note for note in mesh.notes if "minSICN" in note or note.startswith("meshed")]
        retries += bool(notes)
        print(
            f"{label}  nodes {len(mesh.points):6d}  minSICN {mesh.min_quality:.3f}  "
            f"{time.perf_counter() - start:5.1f} s  {' | '.join(notes)}",
            flush=True,
        )
    print(
        f"{len(qualities)} of {arguments.number} designs meshed, {retries} after a retry; worst minSICN "
        f"{min(qualities, default=float('nan')):.3f}; {time.perf_counter() - begun:.0f} s"
    )
    return min(failures, 1)


if __name__ == "__main__":
    sys.exit(main())
