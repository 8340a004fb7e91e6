"""Machines drawn at random solve, or are refused with the key that rules them out."""

from __future__ import annotations

import numpy as np
import pytest

from scripts.random_machines import draw_machine, solve_machine


@pytest.mark.parametrize("number", [1, 2, 3, 5, 6, 7, 13, 14, 15, 16])
def test_by_the_machine_s_own_network(number, tmp_path):
    content = draw_machine(np.random.default_rng([3, number]))
    word, why = solve_machine(content, tmp_path / "machine.toml", meshed=False)
    assert word == "solved" or (word == "refused" and ":" in why), why


@pytest.mark.slow
@pytest.mark.parametrize("number", range(1, 9))
def test_by_elements(number, tmp_path):
    content = draw_machine(np.random.default_rng([4, number]))
    word, why = solve_machine(content, tmp_path / "machine.toml")
    assert word in ("solved", "refused", "unsettled"), why
