"""Heat models, coolants and effects from outside the package: of installed ones, of scripts, in processes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from spindle_fem import registry
from spindle_fem.cache import source_digest
from spindle_fem.definition.load import find_machine, read_definition
from spindle_fem.errors import BadInputError
from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.studies.sweep.designs import Design
from spindle_fem.studies.sweep.evaluate_design import Question, TaskBuilder

ROOT = Path(__file__).parents[2]
MODULE = '''
import spindle_fem
from spindle_fem.effects.catalogue.windage import Windage
from spindle_fem.physics.bearings.bearing_state import BearingHeat

FACTOR = 1.0

@spindle_fem.friction_model()
def rubbing(inputs, options):
    """Constant moment."""
    return BearingHeat("rubbing", {"rubbing": FACTOR * inputs.speed}, {})

class Draught(Windage):
    name = "draught"
'''
ANNOUNCED = """
[spindle_fem.heat_models]
rubbing = own_models:rubbing

[spindle_fem.effects]
draught = own_models:Draught

[spindle_fem.coolants]
broken = own_models:nothing_of_this_name
"""
# A script that uses the installed package's, and adds a coolant that other processes need.
SCRIPT = """
from functools import partial
import spindle_fem
from spindle_fem.effects.registry import catalogue
from spindle_fem.parallel import WorkerPool

class Glycol:
    name = "glycol"

def known(what, name):
    return name in what and type(what[name]).__name__

if __name__ == "__main__":
    spindle_fem.COOLANTS.add("glycol", Glycol())
    machine = spindle_fem.load_machine("small_two_start", ["heat.model=rubbing"])
    print(machine.heat.model, catalogue()["draught"].kind)
    asked = (spindle_fem.COOLANTS, "glycol"), (spindle_fem.HEAT_MODELS, "rubbing")
    jobs = [partial(known, *item) for item in asked]
    print([WorkerPool(2).start(job)() for job in jobs])
"""


@pytest.fixture
def installed(tmp_path):
    """A folder with an installed package that announces things."""
    (tmp_path / "own_models.py").write_text(MODULE, encoding="utf-8")
    folder = tmp_path / "own_models-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: own-models\nVersion: 1.0\n", encoding="utf-8"
    )
    (folder / "entry_points.txt").write_text(ANNOUNCED, encoding="utf-8")
    return tmp_path


@pytest.fixture
def beside(installed, monkeypatch):
    """The installed package, in this process."""
    monkeypatch.syspath_prepend(installed)
    registry.entry_points.cache_clear()
    yield installed
    registry.entry_points.cache_clear()
    sys.modules.pop("own_models", None)


def test_installed_packages_and_scripts_add_things_that_worker_processes_know(installed):
    script = installed / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(installed)))}
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, env=environment, check=False
    )
    assert done.stdout.splitlines() == ["rubbing missing_physics", "['Glycol', 'FrictionModel']"], done.stderr


def test_a_package_that_announces_what_it_has_not_is_named(beside):
    assert "broken" in COOLANTS
    with pytest.raises(
        BadInputError, match=r"own-models: entry point spindle_fem.coolants: broken.*uninstall"
    ):
        COOLANTS["broken"]


def test_what_comes_from_outside_is_part_of_cache_keys(beside):
    bearings, meshes = "spindle_fem.physics.bearings.heat_model", "spindle_fem.machine.meshing.build_mesh"
    first, mesh = source_digest(bearings), source_digest(meshes)
    file = beside / "own_models.py"
    file.write_text(MODULE.replace("FACTOR = 1.0", "FACTOR = 2.0"), encoding="utf-8")
    assert source_digest(bearings) != first
    assert source_digest(meshes) == mesh


def test_a_row_of_a_sweep_is_not_taken_again_after_an_own_model_changed(beside):
    content, design = read_definition(find_machine("small_two_start")), Design(1, ("heat.model=rubbing",), {})
    question = Question((), False, backend="full")

    def key():
        return TaskBuilder(content, question).task(design).key

    first = key()
    assert key() == first
    (beside / "own_models.py").write_text(MODULE.replace("1.0", "2.0"), encoding="utf-8")
    assert key() != first
