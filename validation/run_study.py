"""Diagnose every case of a study; reads inputs only, never answers.

``python -m validation.run_study DIR RESULTS --jobs 2 --mesh coarse`` leaves
``RESULTS/case_0001/diagnosis.json`` and ``timing.json``. What is there is not done again, so an
interrupted study goes on where it stopped; a case that raised leaves ``failed.json`` and is tried
again next time. A case with a ``machine.toml`` of its own is held against that.
"""

import argparse
import json
import os
import subprocess
import time
import traceback
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from .draw import EVERY_EFFECT

MACHINE = "recorded_spindle"


def diagnose_case(
    inputs: Path, result: Path, machine: str, overrides: tuple[str, ...], full_model: str, report: bool
) -> str:
    """Diagnose one case, in this process; return the verdict or the error."""
    from spindle_fem.commands.diagnose_command import diagnose, diagnose_without_report

    result.mkdir(parents=True, exist_ok=True)
    calibration, own = inputs / "calibration.toml", inputs / "machine.toml"
    if own.exists():
        machine = str(own)
        overrides = () if "[[network." in own.read_text(encoding="utf-8") else overrides
    began, cpu = time.perf_counter(), time.process_time()
    try:
        found = (diagnose if report else diagnose_without_report)(
            machine,
            [inputs / "recording.toml"],
            result,
            calibrate=[calibration] if calibration.exists() else [],
            overrides=overrides,
            full_model=full_model,
        )
    except Exception as error:  # noqa: BLE001 - a study goes on and counts its failures
        text = {"error": type(error).__name__, "message": str(error), "trace": traceback.format_exc()}
        (result / "failed.json").write_text(json.dumps(text, indent=1), encoding="utf-8")
        return f"FAILED {type(error).__name__}: {str(error)[:120]}"
    (result / "failed.json").unlink(missing_ok=True)
    timing = {"wall_s": time.perf_counter() - began, "cpu_s": time.process_time() - cpu}
    (result / "timing.json").write_text(json.dumps(timing), encoding="utf-8")
    names = ", ".join(f"{f['effect']}@{f['component']}" for f in found["findings"])
    return f"{found['verdict']} {names}"


def outstanding(inputs: Path, results: Path, only: list[str] | None) -> list[str]:
    """Cases without a diagnosis yet, in order."""
    names = sorted(p.name for p in inputs.iterdir() if (p / "recording.toml").exists())
    wanted = [n for n in names if not only or n in only]
    return [n for n in wanted if not (results / n / "timing.json").exists()]


def not_concealed() -> list[str]:
    """Effects of the catalogue that no case conceals, so that a study gives no evidence on them."""
    from spindle_fem.effects.registry import catalogue

    return sorted(set(catalogue()) - set(EVERY_EFFECT))


def commit() -> str | None:
    """Commit of the package that diagnoses, marked where files differ from it; None without git."""
    told = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--abbrev=10"],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=False,
    )
    return told.stdout.strip() or None


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.run_study", description=__doc__.splitlines()[0]
    )
    parser.add_argument("study", type=Path, help="folder written by validation.generate")
    parser.add_argument("results", type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--mesh", default="coarse", choices=["coarse", "normal", "fine"])
    parser.add_argument("--machine", default=MACHINE)
    parser.add_argument("--full-model", default="auto", choices=["auto", "off", "coarse", "own"])
    parser.add_argument("--report", action="store_true", help="pictures and reports too")
    parser.add_argument("--case", action="append", help="only this case; may be repeated")
    given = parser.parse_args(arguments)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    inputs = given.study / "inputs"
    names = outstanding(inputs, given.results, given.case)
    overrides = (f"mesh.preset={given.mesh}",)
    left_out = ", ".join(not_concealed()) or "no effect"
    print(f"{len(names)} cases to diagnose; concealed in none: {left_out}", flush=True)
    if not names:
        return
    given.results.mkdir(parents=True, exist_ok=True)
    about = {"schema": "spindle-fem/study-run/1", "commit": commit(), "mesh": given.mesh}
    about["full_model"] = given.full_model
    (given.results / "run.json").write_text(json.dumps(about), encoding="utf-8")
    # The first case alone: it builds the fast model that all others then read from the cache.
    first, *rest = names
    common = (given.machine, overrides, given.full_model, given.report)
    print(first, diagnose_case(inputs / first, given.results / first, *common), flush=True)
    with ProcessPoolExecutor(given.jobs) as pool:
        running = {pool.submit(diagnose_case, inputs / n, given.results / n, *common): n for n in rest}
        for done in as_completed(running):
            print(running[done], done.result(), flush=True)


if __name__ == "__main__":
    main()
