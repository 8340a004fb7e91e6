"""Models between definition and diagnosis: networks, oil, fast model, transients, effects."""

from __future__ import annotations

from book.measured import Test, read_tests, run_tests
from book.page import Chapter, Pictures
from book.tables import comparisons, tightest
from book.work import Desk
from spindle_fem.report.block_page import Section, Text

TITLE = "Networks, oil, fast model and transients against exact and full solutions"
FILES = {
    "tests/unit/test_lumped_steady.py": ("Networks at rest", "Closed forms, balances, derivatives."),
    "tests/unit/test_lumped_transient.py": (
        "Networks in time",
        "Exact steps against the matrix exponential and closed forms; the implicit scheme against the "
        "exact one.",
    ),
    "tests/unit/test_coolant_march.py": (
        "Oil along the channel",
        "Enthalpy march against the exact solution along a wall, heat booked on both sides.",
    ),
    "tests/unit/test_reduced_stepping.py": (
        "Time steps of the fast model",
        "Order of the scheme, stiff parts, stored heat, derivatives.",
    ),
    "tests/unit/test_reduced_transient.py": (
        "The fast model",
        "Heat in and out, derivatives against differences, effects as terms and as changed definitions.",
    ),
    "tests/integration/test_reduced_against_full.py": (
        "Fast model against the full model",
        "Its operators, its steady state and a recorded run beside the coupled finite elements.",
    ),
    "tests/integration/test_effects_mesh_and_reduced.py": (
        "Effects in the full model",
        "Every way in which an effect acts, in the finite-element transient and in the fast model.",
    ),
    "tests/integration/test_coupled_transient.py": (
        "Energy of transients",
        "Heat in less heat out is stored; oil by its own enthalpy; a steady state stays one.",
    ),
}


def make(desk: Desk, pictures: Pictures) -> Chapter:
    """Run the tests and show what they measured."""
    del pictures
    step = run_tests(desk, tuple(FILES), "tests_models")
    tests = [test for test in read_tests(step.folder / "figures.json") if _measures(test)]
    count, values, used = tightest(tests)
    sections = []
    for file, (title, words) in FILES.items():
        own = [test for test in tests if test.file == file]
        if own:
            name = file.rpartition("/")[2].removesuffix(".py")
            sections.append(Section(name, title, [Text(words), comparisons(own, file)]))
    return Chapter(
        outcome=(
            f"{count} tests compare {values} values with exact solutions, with the full finite-element "
            "model, with differences instead of derivatives, or with what was put in; at most "
            f"{100 * used:.0f} % of an allowance is used."
        ),
        sections=sections,
        commands=[f"python -m pytest {' '.join(FILES)}", "python -m book --only models"],
        evidence=[
            "What simulate and diagnose compute with is what the finite elements give, to the kelvin "
            "stated in each row.",
            "Every model keeps its energy: heat in, heat out and heat stored add up.",
        ],
        not_evidence=[
            "The comparisons hold for the machines and runs of the tests; a machine far from them is "
            "watched by the range of the reduced basis, which warns.",
        ],
        tone="good",
    )


def _measures(test: Test) -> bool:
    return any(check.measured is not None for check in test.checks)
