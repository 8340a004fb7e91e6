"""Sentences of findings name what they are of."""

from types import SimpleNamespace

import pytest

from spindle_fem.effects.framework.effect import Reported
from spindle_fem.effects.registry import catalogue


@pytest.mark.parametrize(
    ("form", "words"),
    [("oil.shaft_power", "The oil: the heat of shaft power is 1.56"), ("", "The oil: the heat is 1.56")],
)
def test_a_factor_on_heat_names_the_source_of_a_node_with_several(form, words):
    candidate = SimpleNamespace(component="oil", form=form)
    assert words in catalogue()["heat_scale"].statement(candidate, {"factor": Reported(1.56, "")})
