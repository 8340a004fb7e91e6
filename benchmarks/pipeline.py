"""Seconds and memory of a whole run, stage by stage, as a user gets it.

    python benchmarks/pipeline.py [MACHINE] [--preset normal] [--repeats 3]

Each repeat is a process of its own with an empty mesh cache; the table shows
the fastest repeat and the share of each stage. Numbers of different machines
compare as ratios only.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path


def run_once(machine: str, preset: str) -> dict:
    """Summary of one run in a fresh process and an empty cache."""
    with tempfile.TemporaryDirectory() as work:
        environment = {**os.environ, "SPINDLE_FEM_CACHE": str(Path(work) / "cache")}
        command = [sys.executable, "-m", "spindle_fem", "run", machine, "--set", f"mesh.preset={preset}"]
        process = subprocess.run(
            [*command, "-o", str(Path(work) / "out"), "--json"],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        return json.loads(process.stdout)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("machine", nargs="?", default="wu_tan_2016")
    parser.add_argument("--preset", default="normal")
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    summaries = [run_once(arguments.machine, arguments.preset) for _ in range(arguments.repeats)]
    best = min(summaries, key=lambda summary: summary["wall_time_s"])
    mesh = best["mesh"]
    print(f"{best['machine']}, {arguments.preset}: {mesh['nodes']} temperatures, {mesh['elements']} elements")
    print(f"{'stage':<12}{'s':>8}{'share':>8}")
    for stage, seconds in best["timings_s"].items():
        print(f"{stage:<12}{seconds:8.2f}{seconds / best['wall_time_s']:8.0%}")
    print(f"{'all':<12}{best['wall_time_s']:8.2f}   peak {best['peak_rss_MB']:.0f} MB")


if __name__ == "__main__":
    main()
