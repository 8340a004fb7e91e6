"""Tables of the requirements on a diagnosis, for one study and for earlier ones beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from book.causes import study_seed
from book.work import Desk
from spindle_fem.report.block_page import Table
from spindle_fem.report.table_rows import column, rows_of, significant
from validation.asked import held_against_asked
from validation.score import score_study


def short(row: Mapping[str, Any]) -> str:
    """One figure in words."""
    return f"{row['words']} {_value(row)}"


def _value(row: Mapping[str, Any]) -> str:
    if row["value"] is None:
        return "–"
    return f"{100 * row['value']:.1f} %" if row["share"] else significant(row["value"])


def _bound(row: Mapping[str, Any]) -> str:
    def text(value: float) -> str:
        return f"{100 * value:.0f} %" if row["share"] else f"{value:g}"

    if row["relation"] == "within":
        return f"{text(row['bound'][0])} to {text(row['bound'][1])}"
    return {"<=": "at most ", ">=": "at least "}[row["relation"]] + text(row["bound"])


def asked_table(asked: Sequence[Mapping[str, Any]]) -> Table:
    """Every required figure, with its result."""
    rows = [
        [
            row["words"],
            _bound(row),
            _value(row),
            f"{100 * row['low']:.0f}–{100 * row['high']:.0f} %" if row["low"] is not None else "",
            str(row["of"]),
            {True: "met", False: "not met", None: "no case"}[row["met"]],
        ]
        for row in asked
    ]
    columns = (
        column("figure"),
        column("asked", number=True),
        column("found", number=True),
        column("90 % interval of the share", number=True),
        column("cases", number=True),
        column("", mark=True),
    )
    return Table(
        columns, rows_of(rows), "Clear: strong enough, and without a twin, by the generator's re-fit."
    )


def earlier_table(desk: Desk, asked: Sequence[Mapping[str, Any]]) -> list[Table]:
    """The figures for studies with other seeds, which were looked at during development."""
    studies = [(study_seed(study), score_study(study, study / "results")[0]) for study in desk.earlier]
    if not studies:
        return []
    held = [{row["key"]: row for row in held_against_asked(summary)} for _, summary in studies]
    rows = [
        [row["words"], _bound(row), _value(row), *(_value(other[row["key"]]) for other in held)]
        for row in asked
    ]
    columns = (
        column("figure"),
        column("asked", number=True),
        column("this study", number=True),
        *(column(f"seed {seed}, {summary['cases']} cases", number=True) for seed, summary in studies),
    )
    caption = (
        "Earlier studies, as the tool answered them then: their wrong cases were looked into, the tool "
        "was changed, and this study was drawn with another seed."
    )
    return [Table(columns, rows_of(rows), caption)]
