"""Figures of the tests: how an assertion becomes measured, reference, allowed."""

import doctest
import importlib
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from book.measured import comparison_of, read_tests, worst_by_assertion

ROOT = Path(__file__).parents[2]

SAMPLE = '''
"""Head of the file."""
import numpy as np
import pytest

@pytest.mark.parametrize("order", [2])
def test_rate(order):
    """Errors fall."""
    counts = (2, 4, 8)
    errors = [1.0 / n**order for n in counts]
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(order, abs=0.1)
    np.testing.assert_allclose([1.0, 2.5], [1.0, 2.0], atol=1.0, rtol=0)
    assert errors[-1] < 0.5
    assert np.array([0.1 + 0.2, 2.0]) == pytest.approx([0.3, 2.0], abs=1e-12)
'''


def test_equality_with_a_band():
    check = comparison_of(
        "x == pytest.approx(2.0, abs=0.1)", "np.float64(1.95) == 2.0 ± 0.1\n + where 2.0 ± 0.1"
    )
    assert (check.relation, check.measured, check.reference, check.allowed) == ("=", 1.95, 2.0, 0.1)
    assert check.used == pytest.approx(0.5)


def test_band_on_the_left():
    check = comparison_of("pytest.approx(1.36, rel=2e-3) == x", "1.36 ± 0.00272 == 1.35919")
    assert (check.measured, check.reference) == (1.35919, 1.36)


def test_of_several_values_the_tightest_is_kept():
    check = comparison_of("a == b", "array([1.0, 2.09]) == approx([1.0 ± 0.1, 2.0 ± 0.1])")
    assert (check.measured, check.reference, check.values) == (2.09, 2.0, 2)
    assert check.used == pytest.approx(0.9)


def test_limits_and_what_is_no_number():
    assert comparison_of("e < 1e-8", "3.2e-10 < 1e-08").reference == 1e-8
    assert comparison_of("e >= x", "np.float64(288.2) >= (288.1)").relation == ">="
    assert comparison_of("film.regime == regime", "'laminar' == 'laminar'").measured is None


def test_what_was_cut_short_has_no_figure():
    check = comparison_of("a == b", "array([0.3...004, 2.0]) == approx([0.3 ± 0.1, 2.0 ± 0.1])")
    assert check.measured is None


def test_exact_agreement_where_nothing_is_allowed():
    assert comparison_of("a == b", "2.0 == 2.0 ± 0.0").used == 0.0
    assert math.isinf(comparison_of("a == b", "2.1 == 2.0 ± 0.0").used)


def test_an_assertion_in_a_loop_counts_once_with_its_worst():
    checks = [comparison_of("x == y", f"{value} == 2.0 ± 0.1") for value in (2.01, 2.08, 1.99)]
    (worst, count), *rest = worst_by_assertion(checks)
    assert not rest
    assert (worst.measured, count) == (2.08, 3)
    limits = [comparison_of("e < 1", f"{value} < 1.0") for value in (0.2, 0.7, 0.4)]
    assert worst_by_assertion(limits)[0][0].measured == 0.7


def test_plugin_keeps_the_figures_of_a_run(tmp_path):
    (tmp_path / "test_sample.py").write_text(SAMPLE, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "book.recorder", "-p", "no:cacheprovider"]
    command += ["-o", "enable_assertion_pass_hook=true", "-o", "verbosity_assertions=2"]
    command += ["-c", os.devnull, "--rootdir", str(tmp_path)]
    command += ["--figures", str(tmp_path / "figures.json"), str(tmp_path / "test_sample.py")]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (test,) = read_tests(tmp_path / "figures.json")
    assert test.title == "Errors fall [2]"
    assert test.rate["levels"] == [2.0, 4.0, 8.0]
    assert test.rate["errors"] == [[0.25, 0.0625, 0.015625]]
    slope, nearest, limit, digits = test.checks
    assert slope.reference == 2.0
    assert slope.measured == pytest.approx(2.0)
    assert (nearest.measured, nearest.reference, nearest.used, nearest.values) == (2.5, 2.0, 0.5, 2)
    assert (limit.relation, limit.measured, limit.reference) == ("<", 0.015625, 0.5)
    assert digits.used == pytest.approx((0.1 + 0.2 - 0.3) / 1e-12)


def test_figures_file_is_plain_json(tmp_path):
    path = tmp_path / "figures.json"
    entry = {"test": "tests/a.py::test_b", "name": "test_b", "says": "", "checks": [], "rate": None}
    path.write_text(json.dumps([entry]), encoding="utf-8")
    (test,) = read_tests(path)
    assert (test.file, test.title) == ("tests/a.py", "b")


@pytest.mark.parametrize(
    "name", ["book.measured", "book.work", "book.makeup", "book.chapters.turning_centre"]
)
def test_examples_of_the_modules_hold(name):
    failed, tried = doctest.testmod(importlib.import_module(name))
    assert tried
    assert not failed
