"""Wrong cases of a concealed study and their causes, which are written by hand in ``causes.toml``."""

from __future__ import annotations

import json
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from spindle_fem.errors import BadInputError
from spindle_fem.report.block_page import Table
from spindle_fem.report.table_rows import column, rows_of

CAUSES = Path(__file__).parent / "causes.toml"
OPEN = "not looked into yet"


def study_seed(study: Path) -> int | None:
    """Seed that the study was drawn with; None where it is not written down."""
    path = study / "study.json"
    return int(json.loads(path.read_text(encoding="utf-8"))["seed"]) if path.is_file() else None


def read_causes(path: Path, seed: int | None) -> dict[str, dict[str, str]]:
    """Causes written by hand, by case, for one seed.

    Raises
    ------
    BadInputError
        A case stands there twice, or without a cause.
    """
    found: dict[str, dict[str, str]] = {}
    for entry in tomllib.loads(path.read_text(encoding="utf-8")).get("case", []):
        name = f"{path.name}: {entry.get('case', '?')} of seed {entry.get('seed', '?')}"
        if not {"seed", "case", "kind", "cause"} <= entry.keys():
            raise BadInputError(name, "is incomplete.", "Give seed, case, kind and cause.")
        if entry["seed"] != seed:
            continue
        if entry["case"] in found:
            raise BadInputError(name, "stands there twice.", "Keep one.")
        found[entry["case"]] = entry
    return found


def wrong_table(wrong: Sequence[Mapping[str, Any]], causes: Mapping[str, Mapping[str, str]]) -> Table:
    """Every wrong case: what was concealed, what was said instead, and why."""
    rows = []
    for row in wrong:
        cause = causes.get(row["case"], {})
        others = "; ".join(
            f"{' + '.join(item['set']) or 'nothing'} {item['probability']:.2f}"
            for item in row["alternatives"]
        )
        rows.append(
            [
                row["case"],
                " + ".join(row["truth"]) or "nothing",
                f"{row['ratio']:.1f}" if row["ratio"] is not None else "–",
                "clear" if row["clear"] else "hard",
                f"{row['verdict'].replace('_', ' ')}: {' + '.join(row['found']) or 'nothing'}",
                f"{row['probability']:.2f}",
                others,
                cause.get("cause", OPEN),
                cause.get("remedy", ""),
            ]
        )
    columns = (
        column("case"),
        column("concealed"),
        column("ratio", number=True),
        column("", mark=True),
        column("said"),
        column("probability", number=True),
        column("instead"),
        column("cause"),
        column("what was changed"),
    )
    return Table(columns, rows_of([row[0], *map(_spaced, row[1:])] for row in rows))


def _spaced(text: str) -> str:
    return text.replace("_", " ").replace("@", " at ")


def cause_counts(wrong: Sequence[Mapping[str, Any]], causes: Mapping[str, Mapping[str, str]]) -> list[Any]:
    """How many cases each kind of cause has."""
    kinds = Counter(causes.get(row["case"], {}).get("kind", OPEN) for row in wrong)
    listed = [[kind, str(count)] for kind, count in kinds.most_common()]
    return [Table((column("kind of cause"), column("cases", number=True)), rows_of(listed))] if listed else []
