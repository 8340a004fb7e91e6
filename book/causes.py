"""Wrong cases of a concealed study and their causes, which are written by hand in ``causes.toml``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from spindle_fem.report.block_page import Table
from spindle_fem.report.table_rows import column, rows_of
from validation.causes import OPEN, read_causes, study_seed

__all__ = ["CAUSES", "OPEN", "cause_counts", "read_causes", "study_seed", "wrong_table"]

CAUSES = Path(__file__).parent / "causes.toml"


def wrong_table(wrong: Sequence[Mapping[str, Any]], causes: Mapping[str, Mapping[str, str]]) -> Table:
    """Every wrong case: what was concealed, what was reported instead, and why."""
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
    """Number of cases of each kind of cause."""
    kinds = Counter(causes.get(row["case"], {}).get("kind", OPEN) for row in wrong)
    listed = [[kind, str(count)] for kind, count in kinds.most_common()]
    return [Table((column("kind of cause"), column("cases", number=True)), rows_of(listed))] if listed else []
