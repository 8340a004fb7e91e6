"""Seconds and memory of a whole run, stage by stage, as a user gets it.

    python benchmarks/pipeline.py [MACHINE] [--preset normal] [--repeats 3] [--cached]

Each repeat is a process of its own with an empty mesh cache, or with --cached
one that has the mesh; the table shows the fastest repeat and the share of each
stage, and what the whole process took on the wall and of processor, those that
it started included. Stages "in parallel" ran in these. Numbers of different
machines compare as ratios only.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def run_once(machine: str, preset: str, cache: Path | None) -> dict:
    """Summary of one run in a fresh process, with what it took; in an empty cache when None is given."""
    with tempfile.TemporaryDirectory() as work:
        environment = {**os.environ, "SPINDLE_FEM_CACHE": str(cache or Path(work) / "cache")}
        command = [sys.executable, "-m", "spindle_fem", "run", machine, "--set", f"mesh.preset={preset}"]
        before, began = os.times(), time.perf_counter()
        process = subprocess.run(
            [*command, "-o", str(Path(work) / "out"), "--json"],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        after, seconds = os.times(), time.perf_counter() - began
        processor = after.children_user + after.children_system
        processor -= before.children_user + before.children_system
        return json.loads(process.stdout) | {"process_s": seconds, "processor_s": processor}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("machine", nargs="?", default="wu_tan_2016")
    parser.add_argument("--preset", default="normal")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--cached", action="store_true", help="Take the mesh from a cache filled before.")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder) if arguments.cached else None
        if cache is not None:
            run_once(arguments.machine, arguments.preset, cache)
        summaries = [run_once(arguments.machine, arguments.preset, cache) for _ in range(arguments.repeats)]
    best = min(summaries, key=lambda summary: summary["process_s"])
    mesh = best["mesh"]
    print(f"{best['machine']}, {arguments.preset}: {mesh['nodes']} temperatures, {mesh['elements']} elements")
    print(f"{'stage':<20}{'s':>8}{'share':>8}")
    for stage, seconds in best["timings_s"].items():
        print(f"{stage:<20}{seconds:8.2f}{seconds / best['process_s']:8.0%}")
    print(
        f"{'all':<20}{best['process_s']:8.2f}   {best['processor_s']:.2f} s of processor, "
        f"peak {best['peak_rss_MB']:.0f} MB"
    )


if __name__ == "__main__":
    main()
