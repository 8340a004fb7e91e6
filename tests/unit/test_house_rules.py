"""What holds for every file of the repository: its length, its name, what its functions ask for."""

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

import spindle_fem

ROOT = Path(__file__).parents[2]
FOLDERS = ("spindle_fem", "tests", "examples", "validation", "book", "benchmarks", "scripts")
LONGEST_FILE = 500
MOST_PARAMETERS = 8
MOST_OF_ONE_NAME = 2
# Offences that are left to mend: each list only shrinks.
LONG_FILES: set[str] = set()
BUSY_FUNCTIONS: set[str] = set()


def files(folder):
    return sorted((ROOT / folder).rglob("*.py"))


def is_kernel(function):
    """Whether a function is compiled: kernels take arrays one by one."""
    return any(
        "njit" in ast.unparse(decorator) or "compiled" in ast.unparse(decorator)
        for decorator in function.decorator_list
    )


def functions_of(path):
    """Names of a file's functions with how many parameters they ask for, ``self`` and ``cls`` left out."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and not is_kernel(node):
            taken = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            taken += [extra for extra in (node.args.vararg, node.args.kwarg) if extra]
            yield node.name, sum(argument.arg not in ("self", "cls") for argument in taken)


def test_no_file_is_longer_than_a_reader_bears():
    found = {
        str(path.relative_to(ROOT))
        for folder in FOLDERS
        for path in files(folder)
        if len(path.read_text(encoding="utf-8").splitlines()) > LONGEST_FILE
    }
    assert not found - LONG_FILES


def test_no_function_asks_for_more_than_eight_things():
    found = {
        f"{path.relative_to(ROOT)}:{name}"
        for folder in ("spindle_fem", "examples")
        for path in files(folder)
        for name, number in functions_of(path)
        if number > MOST_PARAMETERS
    }
    assert not found - BUSY_FUNCTIONS


@pytest.mark.parametrize("folder", ["spindle_fem", "examples"])
def test_no_file_name_stands_more_than_twice(folder):
    names = Counter(path.name for path in files(folder) if path.name != "__init__.py")
    assert not {name for name, number in names.items() if number > MOST_OF_ONE_NAME}


def test_one_version_stands_everywhere():
    version = spindle_fem.__version__
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(r"^## (\S+)", changes, re.MULTILINE).group(1) == version
