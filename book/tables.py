"""Tables that several chapters share."""

from __future__ import annotations

from collections.abc import Sequence

from book.measured import Check, Test, worst_by_assertion
from spindle_fem.report.block_page import Table
from spindle_fem.report.table_rows import column, rows_of, significant

_RELATIONS = {"=": "", "<": "below ", "<=": "at most ", ">": "above ", ">=": "at least "}


def comparisons(tests: Sequence[Test], caption: str, folded: str = "") -> Table:
    """Every comparison of some tests with its figure."""
    rows = []
    for test in tests:
        title = test.title
        for check, count in worst_by_assertion(test.checks):
            if check.measured is None:
                continue
            rows.append(
                [
                    title,
                    check.source if len(check.source) < 90 else check.source[:87] + "…",
                    str(count),
                    significant(check.measured, 6),
                    _reference(check),
                    "" if check.used is None else significant(abs(check.measured - check.reference), 2),
                    "" if check.allowed is None else significant(check.allowed, 2),
                    "" if check.used is None else f"{100 * check.used:.0f} %",
                ]
            )
            title = ""
    columns = (
        column("test"),
        column("what is compared"),
        column("values", number=True),
        column("measured", number=True),
        column("reference", number=True),
        column("off by", number=True),
        column("allowed ±", number=True),
        column("used", number=True),
    )
    return Table(columns, rows_of(rows), caption, folded)


def _reference(check: Check) -> str:
    digits = 6 if check.relation == "=" else 3
    return _RELATIONS[check.relation] + significant(check.reference, digits)


def tightest(tests: Sequence[Test]) -> tuple[int, int, float]:
    """Number of tests, of compared values, and the largest share of an allowance that was used."""
    checks = [check for test in tests for check in test.checks]
    return (
        len(tests),
        sum(check.values for check in checks),
        max((check.used for check in checks if check.used is not None), default=0.0),
    )
