"""Diagnose the recordings that have answers beside them, and say which sets are right.

``python -m validation.open_examples RESULTS [--recordings DIR] [--only NAME ...] [--jobs 2]`` leaves
``RESULTS/NAME/diagnosis.json`` for every example that is not there yet and prints a table: verdict, sets,
whether they count as right, what is left held out over the noise, seconds. Answers are read after the
diagnoses only.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from .run_study import diagnose_case
from .score import first_right

FOLDERS = ("spindle_examples", "rough_examples", "network_examples", "oil_circuit")
MESH = ("mesh.preset=coarse",)


def examples(recordings: Path) -> dict[str, tuple[Path, str, Path]]:
    """Name to folder of inputs, machine (a definition's path or a shipped name) and answer."""
    found = {}
    for folder in FOLDERS:
        root = recordings / folder
        cases = [root] if (root / "answer.json").exists() else sorted(p for p in root.glob("example_*"))
        for case in cases:
            beside = case / "answer.json"
            answer = beside if beside.exists() else root / "answers" / f"{case.name}.json"
            own = case / "machine.toml"
            name = f"{folder.removesuffix('_examples')}_{case.name.removeprefix('example_')}"
            found["oil" if case is root else name] = (
                case,
                str(own) if own.exists() else "recorded_spindle",
                answer,
            )
    return found


def cases_of(study: Path) -> dict[str, tuple[Path, str, Path]]:
    """The same of a study's cases."""
    found = {}
    for manifest in sorted((study / "inputs").glob("*/recording.toml")):
        case = manifest.parent
        own, answer = case / "machine.toml", study / "answers" / f"{case.name}.json"
        found[case.name] = (case, str(own) if own.exists() else "recorded_spindle", answer)
    return found


def noise_of(answer: dict[str, Any]) -> float:
    """Smallest held-out error of a right diagnosis, K, sensors and structure together."""
    if "heldout_rmse_K_with_it" in answer:
        return float(answer["heldout_rmse_K_with_it"])
    return float(answer["noise"]["total_K"])


def accepted_sets(answer: dict[str, Any]) -> list[list[dict[str, Any]]]:
    """Sets that count as right; nothing at all for a consistent machine."""
    if "acceptable_sets" in answer:
        return answer["acceptable_sets"] or [[]]
    return [
        [{"effect": one["effect"], "components": one["component"]}] * count
        for one in answer["acceptable"]
        for count in (1, 2)
    ]


def row(name: str, answer: dict[str, Any], diagnosis: dict[str, Any], wall: float) -> dict[str, Any]:
    """One line of the table."""
    found, noise = diagnosis["findings"], noise_of(answer)
    before, after = (diagnosis["fit"][when]["heldout_rmse_K"] or np.nan for when in ("before", "after"))
    verdicts = answer.get("acceptable_verdicts", [answer["verdict"]])
    accepted = {"acceptable_sets": accepted_sets(answer)}
    ranked = [first_right(accepted, alternative["findings"]) for alternative in diagnosis["alternatives"]]
    return {
        "case": name,
        "set_right": first_right(accepted, found),
        "verdict_right": diagnosis["verdict"] in verdicts,
        "among_alternatives": any(ranked),
        "verdict": diagnosis["verdict"],
        "probability": diagnosis.get("set_probability"),
        "found": [f"{f['effect']}@{f['component']}" for f in found],
        "truth": [f"{e['effect']}@{e['component']}" for e in answer.get("effects", answer.get("acceptable"))],
        "before_over_noise": before / noise,
        "after_over_noise": after / noise,
        "wall_s": wall,
    }


def main(arguments: list[str] | None = None) -> None:
    """Diagnose what is outstanding, then score."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("--recordings", type=Path, default=Path("../shared/recordings"))
    parser.add_argument("--only", nargs="*", default=[], help="names or beginnings of names")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--report", action="store_true")
    given = parser.parse_args(arguments)
    wanted = {
        name: item
        for name, item in examples(given.recordings).items()
        if not given.only or name.startswith(tuple(given.only))
    }
    with ProcessPoolExecutor(given.jobs) as pool:
        orders = {
            name: pool.submit(diagnose_case, case, given.results / name, machine, overrides, given.report)
            for name, (case, machine, _) in wanted.items()
            if not (given.results / name / "timing.json").exists()
            for overrides in [() if machine.endswith(".toml") else MESH]
        }
        for name, order in orders.items():
            print(name, order.result(), flush=True)
    rows = []
    for name, (_, _, answer) in wanted.items():
        folder = given.results / name
        if (folder / "timing.json").exists():
            told, timing = (json.loads((folder / f).read_text()) for f in ("diagnosis.json", "timing.json"))
            rows.append(row(name, json.loads(answer.read_text()), told, timing["wall_s"]))
    for item in rows:
        marks = "".join("+" if item[k] else "-" for k in ("set_right", "verdict_right", "among_alternatives"))
        ratios = f"{item['before_over_noise']:5.2f} > {item['after_over_noise']:5.2f}"
        print(
            f"{item['case']:34s} {marks} {item['verdict']:15s} p {item['probability'] or 0:.2f}"
            f" rms/noise {ratios} {item['wall_s']:5.0f} s"
            f"  {', '.join(item['found']) or '(nothing)'}   truth: {', '.join(item['truth']) or '(nothing)'}"
        )
    (given.results / "examples.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
    print(f"{sum(r['set_right'] and r['verdict_right'] for r in rows)} of {len(rows)} right")


if __name__ == "__main__":
    main()
