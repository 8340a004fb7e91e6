"""Published values of bearings, films, friction, oil and helical channels."""

from __future__ import annotations

import importlib
from types import ModuleType

import numpy as np
from matplotlib.figure import Figure

from book.measured import read_tests, run_tests
from book.page import Chapter, Pictures
from book.tables import comparisons, tightest
from book.work import ROOT, Desk
from spindle_fem.report.block_page import Section, Table, Text
from spindle_fem.report.figure_style import CYCLE, new_figure, set_title, styled
from spindle_fem.report.table_rows import column, rows_of, significant

TITLE = "Published values of bearings, films and coolant channels"
FILES = {
    "tests/published/test_bearing_hertz_preload.py": "Contact, deflection, preload and stiffness",
    "tests/published/test_bearing_speed.py": "Bearings at speed",
    "tests/published/test_load_distribution.py": "Load of every ball and roller, and life",
    "tests/published/test_catalogue_friction.py": "Friction of each kind at a catalogue's reference speeds",
    "tests/published/test_bearing_catalogue_rows.py": "Bearings that ship against rows of two catalogues",
    "tests/published/test_film_friction.py": "Viscosity, films and friction",
    "tests/published/test_measured_friction.py": "Measured heat and rolling friction, conduction by balls",
    "tests/published/test_coolant_reference_values.py": "Oil and helical channels",
}


def make(desk: Desk, pictures: Pictures) -> Chapter:
    """Run the published tests, and the table of bearing deviations, and show both."""
    step = run_tests(desk)
    tests = [test for test in read_tests(step.folder / "figures.json") if test.file in FILES]
    count, values, used = tightest(tests)
    rows = _deviations().rows()
    deviation = np.array([100.0 * (ours / published - 1.0) for _, _, published, ours in rows])
    typical, largest = float(np.median(np.abs(deviation))), int(np.argmax(np.abs(deviation)))
    sections = [
        Section(
            "deviations",
            "Bearing model against each published value",
            [
                pictures.add(
                    "deviations",
                    deviation_plot(rows, deviation),
                    "Deviation of the program from each published or independently recomputed value.",
                ),
                Table(
                    (
                        column("case"),
                        column("quantity"),
                        column("published", number=True),
                        column("spindle_fem", number=True),
                        column("deviation", number=True),
                    ),
                    rows_of(
                        [case, quantity, significant(value, 6), significant(ours, 6), f"{d:+.2f} %"]
                        for (case, quantity, value, ours), d in zip(rows, deviation, strict=True)
                    ),
                    "Sources stand at the head of the test files.",
                ),
            ],
        )
    ]
    for file, title in FILES.items():
        own = [test for test in tests if test.file == file]
        sections.append(
            Section(
                file.rpartition("/")[2].removesuffix(".py"),
                title,
                [Text(_sources(own, file)), comparisons(own, file, f"All {len(own)} tests of this file")],
            )
        )
    return Chapter(
        outcome=(
            f"{count} tests hold {values} values against papers, catalogues and handbooks; at most "
            f"{100 * used:.0f} % of an allowance is used. Of {len(rows)} bearing values the median "
            f"deviation is {typical:.2f} %, the largest {deviation[largest]:+.1f} % ({rows[largest][0]}, "
            f"{rows[largest][1]})."
        ),
        sections=sections,
        commands=[
            "python -m pytest tests/published",
            "python -m tests.published.bearing_deviations",
            "python -m book --only published",
        ],
        evidence=[
            "Hertz contact, ball equilibrium at speed, films, friction laws and channel correlations are "
            "programmed as their sources print them; allowances are the rounding of the source.",
        ],
        not_evidence=[
            "That the friction of this grease and these bearings is what the laws say: the laws "
            "themselves differ by a factor of three and more at 3000 rpm (last rows of the first table).",
            "Values marked as recomputed independently confirm the arithmetic, not the physics.",
        ],
        tone="good",
    )


def _deviations() -> ModuleType:
    return importlib.import_module("tests.published.bearing_deviations")


def _sources(tests: list, file: str) -> str:
    text = (ROOT / file).read_text(encoding="utf-8").split('"""')[1]
    return " ".join(text.split()) if tests else "No test of this file was run."


@styled
def deviation_plot(rows: list, deviation: np.ndarray) -> Figure:
    """Deviations in percent, one point a value, grouped by kind of quantity."""
    kinds = {
        "contact and static load": lambda c, q: (
            "rest" in c or q.startswith(("K_n", "Jones", "C0", "unloading"))
        ),
        "pair stiffness": lambda c, q: "stiffness" in q,
        "angle at speed": lambda c, q: q.endswith("angle, °"),
        "ball load at speed": lambda c, q: q.endswith("load, N"),
        "deflection at speed": lambda c, q: q.startswith("axial"),
        "viscosity and film": lambda c, q: q.startswith(("viscosity", "Roelands")) or "film" in q,
        "ring to ring": lambda c, q: q.startswith("ring to ring"),
        "friction heat": lambda c, q: q.endswith(", W") or "sliding" in q,
    }
    groups: dict[str, list[float]] = {name: [] for name in kinds}
    for (case, quantity, _, _), value in zip(rows, deviation, strict=True):
        name = next((name for name, holds in kinds.items() if holds(case, quantity)), "friction heat")
        groups[name].append(float(value))
    figure = new_figure(560)
    set_title(figure, "Deviation from published values")
    axes = figure.add_axes((0.2, 0.15, 0.77, 0.7))
    for at, (name, values) in enumerate(reversed(groups.items())):
        place = at + 0.22 * np.linspace(-1, 1, len(values)) if len(values) > 1 else [at]
        axes.plot(values, place, "o", color=CYCLE[0], alpha=0.75, markersize=6)
        del name
    axes.axvline(0.0, color=CYCLE[1], linewidth=1.0)
    axes.set_yticks(range(len(groups)), [f"{n} ({len(v)})" for n, v in reversed(groups.items())])
    axes.set_xscale("symlog", linthresh=0.1)
    axes.set_xticks([-10, -1, -0.1, 0, 0.1, 1, 10], ["−10", "−1", "−0.1", "0", "0.1", "1", "10"])
    axes.set_xlabel("spindle_fem − published / %  (linear within ±0.1 %)")
    return figure
