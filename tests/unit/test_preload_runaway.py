"""What is said of a fold whose own films, oil and joints cannot be had."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.errors import OutOfValidityError
from spindle_fem.solvers.preload_runaway import HeatResponse
from spindle_fem.solvers.solution_branch import Branch


@pytest.mark.parametrize(("top", "reason"), [(2.0, "the oil leaves its data"), (0.5, "does not rise")])
def test_a_fold_that_keeps_the_films_of_its_start_says_why(monkeypatch, top, reason) -> None:
    def refuse(self, state, speed):
        raise OutOfValidityError("film", "the oil leaves its data.", "Cool it.")

    monkeypatch.setattr(HeatResponse, "at", refuse)
    response = object.__new__(HeatResponse)
    response.names = ("F1",)
    states = np.array([[1.0, 1.0, 1.0], [top, 1.0, 1.0]])
    branch = Branch(np.array([100.0, 200.0]), states, "fold", 200.0, states[1])
    found = response.renewed(branch, 300.0)
    assert (found.end, found.limit) == ("fold", 200.0)
    assert reason in found.reason
    assert response.renewed(Branch(branch.parameter, states, "end", 200.0, states[1]), 300.0).reason == ""
