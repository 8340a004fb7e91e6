"""Every package has its floor: a module imports from its own and lower floors only, and in no circle."""

from __future__ import annotations

import ast
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import spindle_fem

PACKAGE = Path(spindle_fem.__file__).parent
# From the ground up.
FLOORS = (
    "errors",
    "units",
    "validity",
    "registry",
    "correlation",
    "bracketed_root",
    "cache",
    "parallel",
    "machine.geometry.part_shapes",
    "machine.geometry.faces",
    "machine.geometry.overlaps",
    "machine.geometry.meridian",
    "definition",
    "physics.bearings",
    "physics.coolant",
    "physics.surroundings",
    "physics.elasticity",
    "machine.geometry",
    "machine.meshing",
    "recordings",
    "effects.framework",
    "effects.catalogue",
    "effects.registry",
    "machine.view",
    "model.trbdf2",
    "model.matrices_on_pattern",
    "model.thermal_model",
    "model.mesh",
    "model.elastic",
    "operation",
    "model.lumped",
    "solvers",
    "model.reduced",
    "results",
    "inference",
    "studies",
    "report",
    "commands",
    "library",
    "command_line",
    "cli",
    "__main__",
)
MAY_LOAD_PYVISTA = {"report"}
# Climbs that are left to mend: from, to.
OPEN: set[tuple[str, str]] = set()
# Imports between files that close a circle: left to mend.
OPEN_CIRCLES: tuple[tuple[str, str], ...] = ()


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
def trees() -> dict[str, ast.Module]:
    """Syntax tree of every module, by name."""
    return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in modules().items()}


def is_for_types(node: ast.AST) -> bool:
    """Whether a node is what only type checkers see."""
    return isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")


@cache
def imports(module: str, *, for_types: bool = True) -> frozenset[str]:
    """Names that a module imports, also inside functions; with or without what only types need."""
    names: set[str] = set()
    left: list[ast.AST] = [trees()[module]]
    while left:
        node = left.pop()
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: imports are absolute"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, (ast.stmt, ast.Module, ast.ExceptHandler, ast.match_case)) and (
            for_types or not is_for_types(node)
        ):
            left.extend(ast.iter_child_nodes(node))
    return frozenset(names)


def own_modules(names: frozenset[str]) -> set[str]:
    """Modules of the package among imported names."""
    known = modules()
    found = {name if name in known else name.rpartition(".")[0] for name in names}
    return {name for name in found if name in known and name != "spindle_fem"}


# Hold no code of their own beyond names that load on demand.
DOORS = (
    "spindle_fem",
    "spindle_fem.model",
    "spindle_fem.physics",
    "spindle_fem.machine",
    "spindle_fem.effects",
)
DOOR_IMPORTS = {"importlib.import_module", "importlib", "typing.Any", "__future__.annotations"}


def climbs_of(module: str) -> set[str]:
    """Floors above its own that a module imports from."""
    floor = floor_of(module)
    used = {floor_of(name) for name in own_modules(imports(module))} - {floor, ""}
    return {other for other in used if FLOORS.index(other) > FLOORS.index(floor)}


def test_packages_that_only_hold_others_import_nothing():
    assert not {name: found for name in DOORS if (found := imports(name) - DOOR_IMPORTS)}


def test_every_module_has_a_floor():
    assert not [name for name in modules() if name not in DOORS and not floor_of(name)]


def test_modules_import_only_from_floors_below():
    found = {}
    for module in modules().keys() - set(DOORS):
        excess = climbs_of(module) - {other for mine, other in OPEN if mine == floor_of(module)}
        if excess:
            found[module] = sorted(excess)
    assert not found


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


def test_only_pictures_and_the_command_line_load_pyvista():
    loaded = [
        module
        for module in modules()
        if floor_of(module) not in MAY_LOAD_PYVISTA
        and {name.split(".")[0] for name in imports(module, for_types=False)}
        & {"pyvista", "vtk", "vtkmodules"}
    ]
    assert not loaded


def test_reading_a_definition_loads_nothing_heavy():
    code = (
        "import sys; import spindle_fem.definition, spindle_fem.definition.load; "
        "print([name for name in ('numpy', 'scipy', 'pint', 'gmsh', 'skfem', 'pyvista', 'xarray', 'pandas',"
        " 'matplotlib') if name in sys.modules])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


def test_run_and_check_load_nothing_of_diagnosis_and_check_no_solver():
    code = (
        "import sys; from spindle_fem.commands.machine_commands import check_machine, run_machine; "
        "check_machine('wu_tan_2016'); check_machine('bench_motor'); "
        "slow = {'numba', 'pandas', 'scipy.stats', 'skfem', 'gmsh'}; "
        "print([n for n in sys.modules if n.startswith('spindle_fem.inference') or n in slow])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
