"""Freeze the numbers that the commands give, and compare a changed package with them.

``python -m validation.frozen_numbers freeze`` runs every case below through the command line and keeps
its numbers in ``validation/frozen/CASE.json``; ``... compare`` runs them again and lists every number
that moved by more than the case allows, relative to its size. ``--case`` picks some, ``--work`` names the
folder of the runs. Everything goes through the command line, so a new layout of the package changes nothing.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
FROZEN = Path(__file__).parent / "frozen"
RECORDINGS = ROOT.parent / "shared" / "recordings"
COARSE = ("--set", "mesh.preset=coarse")
# The full model is compared to its linear solver's tolerance, fast models to their fits' stopping limits.
FULL, FAST = 1e-9, 1e-6
# Columns and keys that identify the source, the machine and the moment, not the result.
HASHES = ("key", "geometry")
PASSING = (
    "versions",
    "wall",
    "timing",
    "rss",
    "_MB",
    "seconds",
    "path",
    "created",
    "digest",
    "hash",
    "host",
)


@dataclass(frozen=True)
class Case:
    """One command whose numbers are frozen.

    Attributes
    ----------
    arguments : tuple of str
        Of the command line; ``{out}`` is the case's folder, ``{shared}`` the recordings.
    tolerance : float
        Largest relative change of a number.
    files : tuple of str
        Results in the folder that are compared beside what ``--json`` prints.
    """

    arguments: tuple[str, ...]
    tolerance: float = FULL
    files: tuple[str, ...] = ()


def _diagnosis(machine: str, recording: str, *more: str) -> Case:
    arguments = ("diagnose", machine, f"{{shared}}/{recording}", "-o", "{out}", "--full-model", "off", *more)
    return Case((*arguments, "--json"), FAST, ("diagnosis.json",))


OPEN_EXAMPLES = (
    "example_1_consistent",
    "example_2_heat_scale",
    "example_3_sensor_lag",
    "example_4_thermal_preload",
    "example_5_coolant_film",
    "example_6_gap_closure",
    "example_7_unrecorded_heat_source",
    "example_8_pair",
)
SPINDLE = "recorded_spindle"
EXAMPLE = "{shared}/spindle_examples/example_2_heat_scale"
CASES = {
    "run_reference": Case(("run", "wu_tan_2016", *COARSE, "-o", "{out}", "--json")),
    "run_recorded": Case(("run", SPINDLE, *COARSE, "-o", "{out}", "--json")),
    "run_two_start": Case(("run", "small_two_start", *COARSE, "-o", "{out}", "--json")),
    "run_uncooled": Case(("run", "uncooled", *COARSE, "-o", "{out}", "--json")),
    "heat": Case(("heat", "wu_tan_2016", "--json")),
    "crosscheck": Case(
        ("crosscheck", "wu_tan_2016", *COARSE, "-o", "{out}", "--json"), FULL, ("crosscheck.json",)
    ),
    "transient": Case(
        ("transient", "{root}/validation/frozen/heat_up.toml", *COARSE, "-o", "{out}", "--json"), FAST
    ),
    "sweep": Case(
        ("sweep", "wu_tan_2016", "{root}/validation/frozen/sweep.toml", *COARSE, "-o", "{out}", "--json"),
        FAST,
        ("results.csv",),
    ),
    "simulate": Case(
        ("simulate", SPINDLE, EXAMPLE, *COARSE, "-o", "{out}", "--json"), FAST, ("simulated.csv",)
    ),
    "calibrate": Case(
        ("simulate", SPINDLE, EXAMPLE, "--calibrate", EXAMPLE, *COARSE, "-o", "{out}", "--json"),
        FAST,
        ("simulated.csv",),
    ),
    "simulate_network": Case(
        ("simulate", "bench_motor", "{shared}/bench_motor/test_1.toml", "-o", "{out}", "--json"),
        FAST,
        ("simulated.csv",),
    ),
    "diagnose_network": _diagnosis("bench_motor", "bench_motor/test_1.toml"),
    **{
        f"diagnose_{name}": _diagnosis(SPINDLE, f"spindle_examples/{name}", *COARSE) for name in OPEN_EXAMPLES
    },
}


def numbers(content: object, where: str = "") -> dict[str, float | str]:
    """Every number and word of a result by its path, without those that depend on machine and moment."""
    if isinstance(content, dict):
        found: dict[str, float | str] = {}
        for key, value in content.items():
            if key not in HASHES and not any(word in key for word in PASSING):
                found |= numbers(value, f"{where}.{key}" if where else key)
        return found
    if isinstance(content, list):
        return {k: v for i, value in enumerate(content) for k, v in numbers(value, f"{where}[{i}]").items()}
    if isinstance(content, bool) or content is None:
        return {where: str(content)}
    if isinstance(content, int | float):
        return {where: float(content)}
    return {where: str(content)}


def run(case: Case, folder: Path) -> dict[str, float | str]:
    """Numbers of one case, by running its command."""
    known = {"out": str(folder), "shared": str(RECORDINGS), "root": str(ROOT)}
    command = [sys.executable, "-m", "spindle_fem", *(text.format(**known) for text in case.arguments)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}\n{done.stderr[-3000:]}")
    found = numbers(json.loads(done.stdout))
    for name in case.files:
        path = folder / name
        if path.suffix == ".json":
            content = json.loads(path.read_text(encoding="utf-8"))
        else:
            # Every tenth row: a curve that moves moves there too.
            content = pd.read_csv(path).iloc[::10].to_dict(orient="list")
        found |= numbers(content, name)
    return found


def differences(before: dict, after: dict, tolerance: float) -> list[tuple[float, str, object, object]]:
    """Changed numbers and words, the largest change first.

    A number is compared with its own size, and with a thousandth of one unit where it is smaller: a
    balance of 1e-12 W is no number to keep.
    """
    found = []
    for key in sorted(before.keys() | after.keys()):
        old, new = before.get(key), after.get(key)
        if isinstance(old, float) and isinstance(new, float):
            if math.isnan(old) and math.isnan(new):
                continue
            change = abs(new - old) / max(abs(old), 1e-3)
            if not change <= tolerance:
                found.append((change, key, old, new))
        elif old != new:
            found.append((math.inf, key, old, new))
    return sorted(found, key=lambda row: -row[0])


def main(arguments: list[str] | None = None) -> int:
    """Command line; exit status 1 where a number moved."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.frozen_numbers", description=__doc__.splitlines()[0]
    )
    parser.add_argument("action", choices=["freeze", "compare"])
    parser.add_argument("--case", action="append", choices=sorted(CASES))
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "frozen")
    parser.add_argument("--most", type=int, default=12, help="changes listed a case")
    given = parser.parse_args(arguments)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    moved = 0
    for name in given.case or CASES:
        case, path, began = CASES[name], FROZEN / f"{name}.json", time.perf_counter()
        if "{shared}" in " ".join(case.arguments) and not RECORDINGS.is_dir():
            print(f"{name}: no recordings beside the repository, left out", flush=True)
            continue
        found = run(case, given.work / name)
        took = f"{time.perf_counter() - began:.0f} s"
        if given.action == "freeze":
            path.write_text(json.dumps(found, indent=0) + "\n", encoding="utf-8")
            print(f"{name}: {len(found)} numbers, {took}", flush=True)
            continue
        changed = differences(json.loads(path.read_text(encoding="utf-8")), found, case.tolerance)
        moved += len(changed)
        verdict = f"{len(changed)} of {len(found)} moved" if changed else f"{len(found)} as before"
        print(f"{name}: {verdict}, {took}", flush=True)
        for change, key, old, new in changed[: given.most]:
            print(f"    {key}: {old} -> {new} ({change:.1e})", flush=True)
    return 1 if moved else 0


if __name__ == "__main__":
    sys.exit(main())
