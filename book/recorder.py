"""A pytest plugin that keeps the figure of every comparison a test makes, not only that it held.

``pytest tests/verification -p book.recorder --figures FILE -o enable_assertion_pass_hook=true``
writes one entry a test: what was compared, what came out, what was allowed. Where a test refines
a mesh or a step and keeps its ``errors``, those are kept as well, for the plots of the rates.

Modules that pytest has compiled without the hook stay silent, so give the run a cache of its own
(``PYTHONPYCACHEPREFIX``).
"""

from __future__ import annotations

import functools
import inspect
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

# Names that tests give to the levels of a refinement.
LEVELS = ("refinements", "meshes", "counts")


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--figures FILE``."""
    parser.addoption("--figures", type=Path, default=None, help="file for the figures of every comparison")


def pytest_configure(config: pytest.Config) -> None:
    """Start to record where a file is given."""
    if config.getoption("--figures"):
        config.pluginmanager.register(Recorder(config.getoption("--figures")), "book-figures")


class Recorder:
    """Keeps comparisons by test."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tests: dict[str, dict[str, Any]] = {}
        self.current: dict[str, Any] | None = None
        self.allclose = np.testing.assert_allclose

    def pytest_sessionstart(self) -> None:
        """Listen to numpy's comparisons too, and have arrays in explanations in full."""
        np.set_printoptions(precision=17)
        np.testing.assert_allclose = self._listening(self.allclose)

    def _listening(self, compare: Any) -> Any:
        @functools.wraps(compare)
        def listening(actual: Any, desired: Any, rtol: float = 1e-7, atol: float = 0.0, **rest: Any) -> None:
            compare(actual, desired, rtol=rtol, atol=atol, **rest)
            if self.current is None:
                return
            found, wanted = np.broadcast_arrays(
                np.asarray(actual, dtype=float), np.asarray(desired, dtype=float)
            )
            allowed = atol + rtol * np.abs(wanted)
            difference = np.abs(found - wanted)
            with np.errstate(divide="ignore", invalid="ignore"):
                used = np.where(difference == 0.0, 0.0, difference / allowed)
            at = np.unravel_index(int(np.argmax(used)), used.shape) if used.size else ()
            caller = inspect.currentframe().f_back
            self.current["checks"].append(
                {
                    "line": caller.f_lineno if caller else 0,
                    "source": "largest difference",
                    "measured": float(found[at]),
                    "reference": float(wanted[at]),
                    "allowed": float(np.asarray(allowed)[at]),
                    "values": int(found.size),
                }
            )

        return listening

    @pytest.hookimpl(wrapper=True)
    def pytest_pyfunc_call(self, pyfuncitem: pytest.Function) -> Iterator[None]:
        """Record one test; follow its local names where it measures a rate."""
        function = pyfuncitem.function
        self.current = self.tests.setdefault(
            pyfuncitem.nodeid,
            {
                "test": pyfuncitem.nodeid,
                "name": pyfuncitem.name,
                "says": inspect.getdoc(function) or "",
                "module": inspect.getdoc(pyfuncitem.module) or "",
                "checks": [],
                "rate": None,
            },
        )
        names = function.__code__.co_varnames
        follow = "errors" in names and any(level in names for level in LEVELS)
        if follow:
            sys.setprofile(functools.partial(self._keep_rate, function.__code__))
        try:
            return (yield)
        finally:
            if follow:
                sys.setprofile(None)
            self.current = None

    def _keep_rate(self, code: Any, frame: Any, event: str, _: Any) -> None:
        if event != "return" or frame.f_code is not code or self.current is None:
            return
        found = frame.f_locals
        levels = next((found[name] for name in LEVELS if name in found), None)
        errors = found.get("errors")
        if levels is not None and errors is not None and len(levels) == len(errors):
            self.current["rate"] = {
                "levels": [float(x) for x in levels],
                "errors": np.asarray(errors, dtype=float).reshape(len(levels), -1).T.tolist(),
                "order": found.get("order"),
            }

    def pytest_assertion_pass(self, item: pytest.Item, lineno: int, orig: str, expl: str) -> None:
        """Keep what was compared."""
        if self.current is not None:
            self.current["checks"].append({"line": lineno, "source": orig, "text": expl})

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep how it ended and how long it took."""
        if report.when == "call" and report.nodeid in self.tests:
            self.tests[report.nodeid] |= {"outcome": report.outcome, "seconds": report.duration}

    def pytest_sessionfinish(self) -> None:
        """Write the file."""
        np.testing.assert_allclose = self.allclose
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_text(json.dumps(list(self.tests.values()), indent=1), encoding="utf-8")
