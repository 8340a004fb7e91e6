"""Comparisons that the tests made, as numbers: measured, reference, allowed, share of it used."""

from __future__ import annotations

import ast
import json
import math
import operator
import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from book.work import ROOT, Desk, Step
from spindle_fem.errors import SpindleFemError

_NUMBER = r"[-+]?(?:\d+\.\d*|\.\d+|\d+)(?:[eE][-+]?\d+)?"
_BAND = re.compile(rf"({_NUMBER}) ± ({_NUMBER})")
_LIMIT = re.compile(r"^([^<>=]+?)\s*(<=|>=|<|>)\s*([^<>=]+)$")
# Lines that pytest adds beneath a comparison: origin of values, and a table of unequal ones.
_APPENDED = re.compile(r"\n\s*(?:\+|comparison failed)")
_WRAPPED = re.compile(rf"(?:np\.)?(?:float64|float32|int64)\(({_NUMBER})\)")

_SIGNS = {ast.USub: operator.neg, ast.UAdd: operator.pos}
_OPERATIONS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


class TestsFailedError(SpindleFemError):
    """A test failed, so there is nothing that its chapter could show."""


@dataclass(frozen=True, slots=True)
class Check:
    """One comparison of a test; ``used`` is the deviation over the tolerance, for equalities."""

    source: str
    relation: str
    measured: float | None
    reference: float | None
    allowed: float | None
    used: float | None
    text: str
    values: int = 1


@dataclass(frozen=True, slots=True)
class Test:
    """One test: its statement, its comparisons, and the errors of its refinements."""

    identifier: str
    name: str
    says: str
    checks: tuple[Check, ...]
    rate: Mapping[str, Any] | None
    seconds: float

    @property
    def file(self) -> str:
        """File of the test."""
        return self.identifier.partition("::")[0]

    @property
    def title(self) -> str:
        """Statement of the test, or its name in words."""
        name, _, case = self.name.partition("[")
        words = self.says.split("\n")[0].rstrip(".") or name.removeprefix("test_").replace("_", " ")
        return f"{words} [{case.rstrip(']')}]" if case else words


VERIFICATION = ("tests/verification", "tests/published")


def run_tests(desk: Desk, paths: Sequence[str] = VERIFICATION, name: str = "tests") -> Step:
    """Run tests, those of verification and of published values by default, and keep their figures.

    Parameters
    ----------
    desk : Desk
    paths : sequence of str
        Files or folders.
    name : str
        Of the folder that keeps the figures.

    Raises
    ------
    TestsFailedError
    """

    def make(folder: Path) -> None:
        command = [
            sys.executable,
            *("-m", "pytest", "-q", "-p", "book.recorder", "-p", "no:cacheprovider"),
            *("-o", "enable_assertion_pass_hook=true", "-o", "verbosity_assertions=2"),
            *("--figures", str((folder / "figures.json").resolve())),
            *paths,
        ]
        # Modules compiled without the hook would stay silent.
        outside = os.environ | {"PYTHONPYCACHEPREFIX": str((folder / "compiled").resolve())}
        outside["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
        done = subprocess.run(command, cwd=ROOT, env=outside, capture_output=True, text=True, check=False)
        if done.returncode:
            raise TestsFailedError(
                ", ".join(paths),
                f"pytest ended with {done.returncode}:\n{done.stdout[-3000:]}{done.stderr[-1000:]}",
                "Mend what failed; the book shows figures of tests that hold.",
            )

    return desk.step(name, make, sources=("tool", "tests"), inputs={"paths": list(paths)})


def read_tests(path: Path) -> list[Test]:
    """Tests of a file that the recorder wrote."""
    return [
        Test(
            item["test"],
            item["name"],
            item["says"],
            tuple(_check(check) for check in item["checks"]),
            item["rate"],
            float(item.get("seconds", 0.0)),
        )
        for item in json.loads(path.read_text(encoding="utf-8"))
    ]


def _check(item: Mapping[str, Any]) -> Check:
    if "text" not in item:
        used = _share(item["measured"], item["reference"], item["allowed"])
        return Check(
            item["source"],
            "=",
            item["measured"],
            item["reference"],
            item["allowed"],
            used,
            "",
            item["values"],
        )
    return comparison_of(item["source"], item["text"])


def comparison_of(source: str, text: str) -> Check:
    """Numbers of an assertion as pytest explains it.

    >>> check = comparison_of("rate == pytest.approx(2.0, abs=0.1)", "np.float64(1.98) == 2.0 ± 0.1")
    >>> check.measured, check.reference, check.allowed, round(check.used, 2)
    (1.98, 2.0, 0.1, 0.2)
    >>> comparison_of("error < 1e-8", "3e-10 < 1e-08").relation
    '<'
    """
    source = " ".join(source.split())
    text = _WRAPPED.sub(r"\1", _APPENDED.split(text)[0].replace("\n", " ")).strip()
    left, equals, right = text.partition(" == ")
    if equals:
        if "±" in left and "±" not in right:
            left, right = right, left
        bands = [(float(a), float(b)) for a, b in _BAND.findall(right)]
        found = [float(value) for value in re.findall(_NUMBER, left)]
        # Output that pytest or numpy cut short has no numbers to rely on.
        if bands and len(bands) == len(found) and "..." not in text:
            shares = [
                _share(value, reference, allowed)
                for value, (reference, allowed) in zip(found, bands, strict=True)
            ]
            worst = max(range(len(shares)), key=shares.__getitem__)
            return Check(source, "=", found[worst], *bands[worst], shares[worst], text, len(found))
    limit = _LIMIT.match(text)
    if limit:
        value, bound = number_of(limit[1]), number_of(limit[3])
        if value is not None and bound is not None:
            return Check(source, limit[2], value, bound, None, None, text)
    return Check(source, "", None, None, None, None, text)


def number_of(text: str) -> float | None:
    """Value of a number or of a sum, product, power of numbers; None of anything else.

    >>> number_of("(0.6 * 0.5)"), number_of("288.15 - 1e-09 > 3"), number_of("'laminar'")
    (0.3, None, None)
    """
    try:
        return _value(ast.parse(text.strip(), mode="eval").body)
    except (SyntaxError, ValueError, ZeroDivisionError, OverflowError):
        return None


def _value(node: ast.AST) -> float:
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return float(node.value)
    if isinstance(node, ast.UnaryOp) and type(node.op) in _SIGNS:
        return _SIGNS[type(node.op)](_value(node.operand))
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        return _OPERATIONS[type(node.op)](_value(node.left), _value(node.right))
    raise ValueError(f"{type(node).__name__} is no number")


def _share(value: float, reference: float, allowed: float) -> float:
    difference = abs(value - reference)
    if difference == 0.0:
        return 0.0
    return difference / allowed if allowed else math.inf


def worst_by_assertion(checks: Sequence[Check]) -> list[tuple[Check, int]]:
    """The tightest check of each assertion that ran several times, with the number of values compared."""
    kept: dict[tuple[str, str], tuple[Check, int]] = {}
    for check in checks:
        key = (check.source, check.relation)
        before, count = kept.get(key, (check, 0))
        tighter = check if (check.used or 0.0) > (before.used or 0.0) else before
        if check.relation in ("<", "<=") and (check.measured or 0.0) > (before.measured or 0.0):
            tighter = check
        if check.relation in (">", ">=") and (check.measured or 0.0) < (before.measured or 0.0):
            tighter = check
        kept[key] = (tighter, count + check.values)
    return list(kept.values())
