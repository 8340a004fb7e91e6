"""What the program says to its users: coolants are called oil only where they are."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import spindle_fem
from scripts.definition_page import reference_page

PACKAGE = Path(spindle_fem.__file__).parent
SPEAKS = ("report", "commands", "command_line", "library", "studies/run_checks.py", "inference/schedules.py")
OIL = re.compile(r"\boils?\b", re.IGNORECASE)


def texts(path: Path):
    """Every text of a file with its line."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value


@pytest.mark.parametrize("place", SPEAKS)
def test_reports_and_consoles_speak_of_coolant(place):
    files = [PACKAGE / place] if place.endswith(".py") else sorted((PACKAGE / place).rglob("*.py"))
    assert files
    found = [f"{path.name}:{line}" for path in files for line, text in texts(path) if OIL.search(text)]
    assert not found


@pytest.mark.parametrize("heading", ["### `[channel]`", "### `[channel.ports]`", "### `[coolant]`"])
def test_the_page_of_definitions_does_too(heading):
    section = reference_page().partition(heading)[2].partition("\n### ")[0]
    assert section
    assert not OIL.search(section)
