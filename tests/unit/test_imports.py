"""Every package has its floor: a module imports from its own and lower floors only, and in no circle."""

from __future__ import annotations

import ast
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import spindle_fem

PACKAGE = Path(spindle_fem.__file__).parent
# From the ground up.
FLOORS = (
    "errors",
    "units",
    "validity",
    "cache",
    "parallel",
    "definition",
    "physics.bearings",
    "physics.coolant",
    "physics.surroundings",
    "machine.geometry",
    "machine.meshing",
    "recordings",
    "effects.framework",
    "effects.catalogue",
    "effects.registry",
    "machine.view",
    "model.trbdf2",
    "model.mesh",
    "operation",
    "model.lumped",
    "solvers",
    "model.reduced",
    "results",
    "inference",
    "studies",
    "report",
    "commands",
    "cli",
    "__main__",
)
MAY_LOAD_PYVISTA = {"report", "cli"}
# Climbs that are left to mend: from, to.
OPEN: set[tuple[str, str]] = {
    ("inference", "studies"),
    ("machine.view", "model.reduced"),
    ("machine.view", "operation"),
    ("machine.view", "model.lumped"),
    ("model.reduced", "studies"),
    ("recordings", "model.reduced"),
    ("recordings", "model.lumped"),
    ("recordings", "studies"),
    ("studies", "commands"),
    ("studies", "report"),
}
# Imports between files that close a circle: left to mend.
OPEN_CIRCLES: tuple[tuple[str, str], ...] = (
    ("spindle_fem.studies.sweep.sweep_summary", "spindle_fem.commands.sweep_command"),
    ("spindle_fem.solvers.preload_runaway", "spindle_fem.solvers.coupled_steady"),
    ("spindle_fem.definition.network_faults", "spindle_fem.definition.network_tables"),
    ("spindle_fem.machine.geometry.faces", "spindle_fem.machine.geometry.assembly"),
    ("spindle_fem.machine.geometry.meridian", "spindle_fem.machine.geometry.assembly"),
    ("spindle_fem.report.figure_style", "spindle_fem.report.scenes"),
)


def floor_of(module: str) -> str:
    """Which floor a module stands on: its longest listed beginning."""
    parts = module.split(".")[1:]
    names = [".".join(parts[:length]) for length in range(len(parts), 0, -1)]
    return next((name for name in names if name in FLOORS), "")


@cache
def modules() -> dict[str, Path]:
    """Every module of the package by name."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        name = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        found[name.removesuffix(".__init__")] = path
    return found


@cache
def imports(module: str, *, for_types: bool = True) -> frozenset[str]:
    """Names that a module imports, also inside functions; with or without what only types need."""
    tree = ast.parse(modules()[module].read_text(encoding="utf-8"))
    left_out: set[int] = set()
    for node in ast.walk(tree):
        only_types = isinstance(node, ast.If) and ast.unparse(node.test) in (
            "TYPE_CHECKING",
            "typing.TYPE_CHECKING",
        )
        if only_types and not for_types:
            left_out |= {id(inner) for inner in ast.walk(node)}
    names: set[str] = set()
    for node in ast.walk(tree):
        if id(node) in left_out:
            continue
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: imports are absolute"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(names)


def own_modules(names: frozenset[str]) -> set[str]:
    """Modules of the package among imported names."""
    known = modules()
    found = {name if name in known else name.rpartition(".")[0] for name in names}
    return {name for name in found if name in known and name != "spindle_fem"}


@pytest.mark.parametrize("module", modules())
def test_a_module_imports_only_from_floors_below(module):
    floor = floor_of(module)
    if module in (
        "spindle_fem",
        "spindle_fem.model",
        "spindle_fem.physics",
        "spindle_fem.machine",
        "spindle_fem.effects",
    ):
        assert not imports(module) - {
            "importlib.import_module",
            "importlib",
            "typing.Any",
            "__future__.annotations",
        }
        return
    assert floor, f"{module} has no floor"
    used = {floor_of(name) for name in own_modules(imports(module))} - {floor, ""}
    excess = {other for other in used if FLOORS.index(other) > FLOORS.index(floor)}
    excess -= {other for mine, other in OPEN if mine == floor}
    assert not excess, f"{module} imports {sorted(excess)}"


def test_what_is_open_is_still_open():
    climbs = {
        (floor_of(module), floor_of(name)) for module in modules() for name in own_modules(imports(module))
    }
    assert climbs >= OPEN, f"mended, leave out of OPEN: {sorted(OPEN - climbs)}"


def test_no_files_import_one_another_in_a_circle():
    graph = {module: own_modules(imports(module)) - {module} for module in modules()}
    for first, second in OPEN_CIRCLES:
        graph[first].discard(second)
    TopologicalSorter(graph).prepare()


@pytest.mark.parametrize("module", modules())
def test_only_pictures_and_the_command_line_load_pyvista(module):
    loads = any(
        name.split(".")[0] in ("pyvista", "vtk", "vtkmodules") for name in imports(module, for_types=False)
    )
    assert not loads or floor_of(module) in MAY_LOAD_PYVISTA


def test_no_basename_stands_more_than_twice():
    names = [path.name for path in modules().values() if path.name != "__init__.py"]
    assert not {name for name in names if names.count(name) > 2}


def test_reading_a_definition_loads_nothing_heavy():
    code = (
        "import sys; import spindle_fem.definition, spindle_fem.definition.load; "
        "print([name for name in ('numpy', 'scipy', 'pint', 'gmsh', 'skfem', 'pyvista', 'xarray', 'pandas',"
        " 'matplotlib') if name in sys.modules])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


def test_run_and_check_load_nothing_of_diagnosis():
    code = (
        "import sys; from spindle_fem.commands.machine_commands import check_machine, run_machine; "
        "check_machine('wu_tan_2016'); "
        "print([name for name in sys.modules if name.startswith('spindle_fem.inference')])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
