"""Every notebook of ``examples`` runs cell by cell, shows what cells end with, and is kept without output."""

import ast
import contextlib
import json
import shutil
from pathlib import Path

import pytest

from spindle_fem.registry import ADDED

EXAMPLES = Path(__file__).parents[2] / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


def cells(notebook):
    """Sources of the code cells."""
    content = json.loads(notebook.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in content["cells"] if cell["cell_type"] == "code"]


def run_cell(source, namespace):
    """Run a cell as a notebook does; gives the value of its last line where that is an expression."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "<cell>", "exec"), namespace)
    return None if last is None else eval(compile(ast.Expression(last.value), "<cell>", "eval"), namespace)


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(notebook, tmp_path, monkeypatch):
    monkeypatch.setitem(ADDED, "coolants", {})
    for name in ("pump.toml", "pump_recording.toml"):
        shutil.copy(EXAMPLES / name, tmp_path)
    shown, namespace = [], {}
    with contextlib.chdir(tmp_path):
        for source in cells(notebook):
            value = run_cell(source, namespace)
            for show in ("_repr_html_", "_repr_png_"):
                if hasattr(value, show):
                    shown.append(getattr(value, show)())
    assert len(shown) >= 3
    assert any(isinstance(item, bytes) and item.startswith(b"\x89PNG") for item in shown)


def test_notebooks_are_kept_without_output():
    assert len(NOTEBOOKS) >= 3
    for notebook in NOTEBOOKS:
        content = json.loads(notebook.read_text(encoding="utf-8"))
        assert not [cell for cell in content["cells"] if cell.get("outputs")], notebook.name
