"""What ``import spindle_fem`` offers: every name, and again after the first use."""

import inspect
import subprocess
import sys

import pytest

import spindle_fem
from spindle_fem.definition.load import load_machine


@pytest.mark.parametrize("name", spindle_fem.__all__)
def test_a_public_name_is_listed_and_is_no_module(name):
    assert name in dir(spindle_fem)
    for _ in range(2):
        assert not inspect.ismodule(getattr(spindle_fem, name))


def test_unknown_names_are_attribute_errors():
    with pytest.raises(AttributeError, match="nothing_like_it"):
        _ = spindle_fem.nothing_like_it


def test_a_machine_is_solved_twice_by_object_and_by_file(tmp_path):
    overrides = ("mesh.preset=coarse", "mesh.order=1", "heat.model=palmgren")
    spec = load_machine("small_two_start", overrides)
    first = spindle_fem.solve(spec)
    file = tmp_path / "machine.toml"
    from spindle_fem.definition.load import write_machine

    file.write_text(write_machine(spec), encoding="utf-8")
    second = spindle_fem.solve(file)
    assert second.probes == pytest.approx(first.probes, rel=1e-9)


def test_the_package_itself_is_light():
    code = "import sys, spindle_fem; dir(spindle_fem); print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
