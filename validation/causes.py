"""Causes of wrong cases, written by hand after looking into them: a ``[[case]]`` each of a TOML file."""

import json
import tomllib
from pathlib import Path

from spindle_fem.errors import BadInputError

OPEN = "not looked into yet"
SPINDLE = "spindle"


def study_seed(study: Path) -> int | None:
    """Seed that the study was drawn with; None where it is not written down."""
    path = study / "study.json"
    return int(json.loads(path.read_text(encoding="utf-8"))["seed"]) if path.is_file() else None


def read_causes(path: Path, seed: int | None, generator: str = SPINDLE) -> dict[str, dict[str, str]]:
    """Causes by case, for one seed of one generator (that of the recorded spindle by default).

    Raises
    ------
    BadInputError
        A case is listed twice, or without a cause.
    """
    found: dict[str, dict[str, str]] = {}
    for entry in tomllib.loads(path.read_text(encoding="utf-8")).get("case", []):
        name = f"{path.name}: {entry.get('case', '?')} of seed {entry.get('seed', '?')}"
        if not {"seed", "case", "kind", "cause"} <= entry.keys():
            raise BadInputError(name, "is incomplete.", "Give seed, case, kind and cause.")
        if (entry["seed"], entry.get("generator", SPINDLE)) != (seed, generator):
            continue
        if entry["case"] in found:
            raise BadInputError(name, "stands there twice.", "Keep one.")
        found[entry["case"]] = entry
    return found


def read_note(path: Path, seed: int | None, generator: str = SPINDLE) -> str:
    """What is to be known of a study, as a ``[[study]]`` of the file has it; nothing where it has none."""
    entries = tomllib.loads(path.read_text(encoding="utf-8")).get("study", [])
    own = [e["note"] for e in entries if (e["seed"], e.get("generator", SPINDLE)) == (seed, generator)]
    return " ".join(own)
