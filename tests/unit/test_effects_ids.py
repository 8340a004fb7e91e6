"""An effect is one file: its id stands nowhere else in the package."""

import ast
from pathlib import Path

import pytest

import spindle_fem
from spindle_fem.effects.registry import catalogue

PACKAGE = Path(spindle_fem.__file__).parent
# The same word for something else: an option of the definition's heat model, a number of a joint.
OTHER_MEANING = {
    "thermal_preload": {"operation/bearing_heat.py", "solvers"},
    "joint_conductance": {"model/mesh/conduction_problem.py"},
}


def literals(path, ids):
    """Text constants of a file that are not docstrings; none where no id stands in quotes."""
    text = path.read_text(encoding="utf-8")
    if not any(f'"{name}"' in text for name in ids):
        return
    tree = ast.parse(text)
    alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone:
            yield node.value


def test_no_id_of_an_effect_stands_outside_the_catalogue():
    ids = set(catalogue())
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        where = path.relative_to(PACKAGE).as_posix()
        if where.startswith("effects/catalogue/"):
            continue
        for text in ids.intersection(literals(path, ids)):
            if not any(part in where for part in OTHER_MEANING.get(text, ())):
                found.append(f"{where}: {text}")
    assert not found


def test_an_id_stands_in_one_file_of_the_catalogue():
    ids = catalogue()
    homes = {name: [] for name in ids}
    for path in sorted((PACKAGE / "effects" / "catalogue").glob("*.py")):
        for name in ids.keys() & set(literals(path, ids)):
            homes[name].append(path.stem)
    assert homes == {name: [name] for name in ids}


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_what_the_diagnosis_asks_of_an_effect_is_said_by_itself(name):
    effect = catalogue()[name]
    assert effect.kind in ("missing_physics", "parameter", "sensor")
    assert effect.title
    assert effect.check
    assert 0.0 < effect.prior_weight <= 1.0
