"""What the generators' commands share: options, ``study.json``, case after case with a line each."""

import argparse
import json
import time as clock
from collections.abc import Callable
from pathlib import Path
from typing import Any

SCHEMA = "spindle-fem/concealed-study/1"


def study_options(description: str, *, cases: int, seed: int) -> argparse.ArgumentParser:
    """Parser of a generator's command line, with the numbers drawn where none are given."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--cases", type=int, default=cases)
    parser.add_argument("--first", type=int, default=1, help="number of the first case")
    parser.add_argument("--seed", type=int, default=seed)
    parser.add_argument("-o", "--output", type=Path, required=True)
    return parser


def write_study(given: argparse.Namespace, make_case: Callable[[int], dict[str, Any]], **drawn: Any) -> None:
    """Make every case of a study; ``drawn`` says in ``study.json`` what it was drawn from.

    ``make_case`` writes the case of a number and returns its answer.
    """
    given.output.mkdir(parents=True, exist_ok=True)
    study = {"schema": SCHEMA, "seed": given.seed, "cases": given.cases} | drawn
    (given.output / "study.json").write_text(json.dumps(study, indent=1), encoding="utf-8")
    for number in range(given.first, given.first + given.cases):
        began = clock.perf_counter()
        answer = make_case(number)
        print(f"{line_of(answer)} {clock.perf_counter() - began:.1f} s", flush=True)


def line_of(answer: dict[str, Any]) -> str:
    """One case in a line: what it conceals, how well that can be told, against what noise."""
    effects = ", ".join(e["effect"] for e in answer["effects"]) or "none"
    known = answer["identifiability"]
    seen = f"ratio {known['ratio']:6.2f}" if known else 13 * " "
    noise = answer.get("noise", {}).get("total_K")
    return " ".join(
        (
            answer["case"],
            f"{answer.get('family') or answer.get('machine', ''):34s}",
            f"{effects:60s}",
            seen,
            f"noise {noise:.2f} K" if noise is not None else "",
            "clear" if answer.get("clear") else "     ",
        )
    )
