"""Exact solutions and rates of convergence of the conduction solver."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from book.measured import Test, read_tests, run_tests
from book.page import Chapter, Pictures
from book.tables import comparisons, tightest
from book.work import Desk
from spindle_fem.report.block_page import Section, Table, Text
from spindle_fem.report.figure_style import CYCLE, MUTED, new_figure, set_title, styled
from spindle_fem.report.table_rows import column, rows_of, significant

TITLE = "Exact solutions and rates of convergence"
FILES = {
    "tests/verification/test_conduction_steady.py": "Steady conduction",
    "tests/verification/test_conduction_manufactured.py": "Manufactured solution on a curved domain",
    "tests/verification/test_conduction_transient.py": "Transient conduction",
    "tests/verification/test_conduction_rotation.py": "Rotating parts",
}
NORMS = {2: ("L2 norm", "H1 seminorm"), 1: ("error",)}


def make(desk: Desk, pictures: Pictures) -> Chapter:
    """Run the verification tests and show what they measured."""
    step = run_tests(desk)
    tests = [test for test in read_tests(step.folder / "figures.json") if test.file in FILES]
    count, values, used = tightest(tests)
    refined = [test for test in tests if test.rate]
    rates = [(test, number, _rate(test, number)) for test in refined for number in _norms(test)]
    second = [rate for test, number, rate in rates if test.rate["order"] == 2 and number == 0]
    sections = [
        Section(
            "rates",
            "Rates of convergence",
            [
                Text(
                    "The error of a finite-element solution falls with the cell size h like h to the "
                    "power p + 1 in the L2 norm and like h to the power p in the H1 seminorm, where p is "
                    "the order of the elements; the time stepping is of second order. The slopes are "
                    "fitted to all meshes."
                ),
                pictures.add(
                    "rates",
                    rate_plot(refined),
                    "Error over the number of cells in a direction (steps in time, right): points are "
                    "solves, lines the fitted slope.",
                ),
                _rate_table(rates),
            ],
        )
    ]
    for file, title in FILES.items():
        own = [test for test in tests if test.file == file]
        sections.append(Section(file.rpartition("/")[2].removesuffix(".py"), title, [comparisons(own, file)]))
    return Chapter(
        outcome=(
            f"{count} tests compare {values} values with closed forms, series, manufactured solutions and "
            f"two NAFEMS benchmarks; at most {100 * used:.0f} % of an allowance is used. Quadratic "
            f"elements converge in L2 with rates {min(second):.2f} to {max(second):.2f} (3 expected)."
        ),
        sections=sections,
        commands=["python -m pytest tests/verification", "python -m book --only exact"],
        evidence=[
            "Heat conduction, films, contact conductance, lumped nodes, step size control and the "
            "circumferential exchange of rotating parts are solved as the equations say.",
            "Curved walls keep the full order: the elements are curved as the walls are.",
        ],
        not_evidence=[
            "That the equations describe a spindle: no measured temperature enters here.",
            "Rates are measured on structured meshes of simple bodies, not on the meshes of machines.",
        ],
        tone="good",
    )


def _norms(test: Test) -> range:
    return range(len(test.rate["errors"]))


def _rate(test: Test, number: int) -> float:
    levels, errors = np.array(test.rate["levels"]), np.array(test.rate["errors"][number])
    return float(-np.polyfit(np.log(levels), np.log(errors), 1)[0])


def _norm_name(test: Test, number: int) -> str:
    count = len(test.rate["errors"])
    if count == 2:
        return NORMS[2][number]
    return "largest nodal error" if test.rate["order"] is None else "L2 norm"


def _expected(test: Test, number: int) -> float:
    order = test.rate["order"]
    return 2.0 if order is None else order + 1.0 - number


def _rate_table(rates: list[tuple[Test, int, float]]) -> Table:
    rows = [
        [
            test.title,
            "time" if test.rate["order"] is None else str(test.rate["order"]),
            _norm_name(test, number),
            ", ".join(f"{level:.0f}" for level in test.rate["levels"]),
            ", ".join(significant(error, 2) for error in test.rate["errors"][number]),
            f"{rate:.2f}",
            f"{_expected(test, number):.0f}",
        ]
        for test, number, rate in rates
    ]
    columns = (
        column("test"),
        column("element order", mark=True),
        column("norm"),
        column("cells or steps"),
        column("errors / K (H1: K/m)"),
        column("rate", number=True),
        column("expected", number=True),
    )
    return Table(columns, rows_of(rows), "Every refinement study, with the error on every mesh.")


@styled
def rate_plot(tests: list[Test]) -> Figure:
    """Errors of all refinement studies over the number of cells or steps."""
    figure = new_figure(760)
    set_title(figure, "Errors fall at the rate of theory")
    groups = [
        ("linear elements", [t for t in tests if t.rate["order"] == 1]),
        ("quadratic elements", [t for t in tests if t.rate["order"] == 2]),
        ("time steps", [t for t in tests if t.rate["order"] is None]),
    ]
    axes = figure.subplots(1, 3)
    figure.subplots_adjust(left=0.065, right=0.985, top=0.83, bottom=0.29, wspace=0.28)
    for own, (title, members) in zip(axes, groups, strict=True):
        for at, (test, number) in enumerate((t, n) for t in members for n in _norms(t)):
            levels = np.array(test.rate["levels"])
            errors = np.array(test.rate["errors"][number])
            slope, level = np.polyfit(np.log(levels), np.log(errors), 1)
            colour = CYCLE[at % len(CYCLE)]
            name = test.title.split("[")[0].split(";")[0].strip()
            norm = _norm_name(test, number).removesuffix(" norm").removesuffix(" seminorm")
            label = f"{_short(name)}{_case(test)}, {norm}: {-slope:.2f}"
            if test.rate["order"] is None:
                label = f"manufactured solution, {norm}: {-slope:.2f}"
            own.loglog(levels, errors, "o", color=colour, markersize=5)
            own.loglog(levels, np.exp(level) * levels**slope, color=colour, linewidth=1.3, label=label)
        own.set_title(title)
        own.set_xlabel("number of steps" if "time" in title else "cells in a direction")
        own.set_ylabel("error / K (H1 seminorm: K/m)" if own is axes[0] else "")
        own.set_xticks(sorted({level for t in members for level in t.rate["levels"]}))
        own.xaxis.set_major_formatter("{x:.0f}")
        own.minorticks_off()
        own.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17), fontsize=7.5, labelcolor=MUTED)
    return figure


def _short(name: str) -> str:
    return name if len(name) < 30 else name[:28].rstrip() + "…"


def _case(test: Test) -> str:
    return ", tied" if "-inf" in test.name else ""
