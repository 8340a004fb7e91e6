"""Imports go one way: a module uses only packages that stand before its own in ARCHITECTURE.md."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import spindle_fem

PACKAGE = Path(spindle_fem.__file__).parent
ROOT_MODULES = {"errors", "units", "constants", "validity", "cache"}

# Packages that a package may import, besides the root modules and itself.
ALLOWED = {
    "spec": set(),
    "geometry": {"spec"},
    "meshing": {"geometry", "spec"},
    "tribology": set(),
    "coolant": set(),
    "surroundings": set(),
    "effects": {"spec", "geometry", "meshing", "tribology", "coolant", "surroundings"},
    "loads": {"spec", "geometry", "meshing", "tribology", "coolant", "surroundings", "effects"},
    "results": {"spec", "geometry", "meshing"},
    "conduction": {"geometry", "meshing", "results"},
    "network": {"spec", "geometry", "tribology", "coolant", "surroundings", "effects", "loads", "results"},
}
LOWER = set(ALLOWED)
# What puts the stages together; nothing below may import these.
ABOVE = {
    "coupling",
    "runaway",
    "checks",
    "solve",
    "heat_study",
    "crosscheck",
    "reduced",
    "simulate",
    "effect_entries",
    "calibration",
    "transients",
    "transient_run",
}
ABOVE |= {"design", "recordings", "diagnosis", "reporting"}
COMMAND_LINE = {"cli", "commands", "console", "__main__"}
MAY_LOAD_PYVISTA = {"reporting", "cli"}


def sources() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def package_of(path: Path) -> str:
    first, *rest = path.relative_to(PACKAGE).parts
    return first if rest else Path(first).stem


def imported_names(path: Path) -> set[str]:
    """Absolute names of everything a module imports, also inside functions; not what only types need."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for_types = {
        id(node)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and ast.unparse(block.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")
        for node in ast.walk(block)
    }
    names: set[str] = set()
    for node in ast.walk(tree):
        if id(node) in for_types:
            continue
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("path", sources(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_imports_only_from_packages_before_its_own(path):
    package = package_of(path)
    if package in COMMAND_LINE or path == PACKAGE / "__init__.py":
        return
    used = {name.split(".")[1] for name in imported_names(path) if name.startswith("spindle_fem.")}
    used -= {"__version__"}
    if package in ROOT_MODULES:
        allowed: set[str] = set()
    else:
        allowed = ALLOWED.get(package, LOWER | ABOVE)
    excess = used - allowed - ROOT_MODULES - {package}
    assert not excess, f"{path.relative_to(PACKAGE)} imports {sorted(excess)}"


@pytest.mark.parametrize("path", sources(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_only_reporting_and_the_command_line_load_pyvista(path):
    loads = any(name.split(".")[0] in ("pyvista", "vtk", "vtkmodules") for name in imported_names(path))
    assert not loads or package_of(path) in MAY_LOAD_PYVISTA


def test_every_package_has_its_place():
    packages = {package_of(path) for path in sources()} - {"__init__"}
    assert packages <= set(ALLOWED) | ABOVE | COMMAND_LINE | ROOT_MODULES


def test_reading_a_definition_loads_nothing_heavy():
    code = (
        "import sys; import spindle_fem.spec, spindle_fem.spec.load; "
        "print([name for name in ('numpy', 'scipy', 'pint', 'gmsh', 'skfem', 'pyvista', 'xarray', 'pandas',"
        " 'matplotlib') if name in sys.modules])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
