"""What ``import spindle_fem`` offers: every name, and again after the first use."""

import inspect
import subprocess
import sys

import pytest

import spindle_fem


@pytest.mark.parametrize("name", spindle_fem.__all__)
def test_a_public_name_is_listed_and_is_no_module(name):
    assert name in dir(spindle_fem)
    for _ in range(2):
        assert not inspect.ismodule(getattr(spindle_fem, name))


def test_nothing_else_is_listed():
    assert dir(spindle_fem) == sorted(spindle_fem.__all__)


def test_unknown_names_are_attribute_errors():
    with pytest.raises(AttributeError, match="nothing_like_it"):
        _ = spindle_fem.nothing_like_it


def test_the_package_itself_is_light():
    code = "import sys, spindle_fem; dir(spindle_fem); print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
