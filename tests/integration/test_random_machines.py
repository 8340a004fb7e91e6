"""Machines drawn at random solve, or are refused with the key that rules them out."""

from __future__ import annotations

import numpy as np
import pytest

from scripts.random_kinds import add_kinds
from scripts.random_machines import draw_machine, solve_machine
from spindle_fem.commands.checked_machine import load_buildable
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.duct_kinds import DUCT_KINDS
from spindle_fem.physics.coolant.lubrication_kinds import LUBRICATION_KINDS
from spindle_fem.solvers.machine_network_steady import BALANCE_TOLERANCE, solve_machine_network
from tests.support.valid_definition import VALID


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2, 3, 5, 6, 7, 13, 14, 15, 16])
def test_by_the_machine_s_own_network(number, tmp_path):
    content = draw_machine(np.random.default_rng([3, number]))
    word, why = solve_machine(content, tmp_path / "machine.toml", meshed=False)
    assert word == "solved" or (word == "refused" and ":" in why), why


def draw_wider(seed, number):
    generator = np.random.default_rng([seed, number])
    return add_kinds(draw_machine(generator), generator)


def test_every_kind_is_drawn():
    machines = [draw_wider(6, number) for number in range(1, 61)]
    films = [film for content in machines for film in content.get("film", ())]
    groups = [group for content in machines for group in content["bearing_set"]]
    circuits = [film for film in films if film["kind"] == "circuit"]
    coolants = {film["fluid"] for film in circuits} | {
        content["coolant"]["fluid"] for content in machines if "coolant" in content
    }
    assert {film["duct"] for film in circuits if "duct" in film} == DUCT_KINDS.keys() - {"bore"}
    assert {
        group["lubrication"]["kind"] for group in groups if "lubrication" in group
    } == LUBRICATION_KINDS.keys()
    assert coolants == COOLANTS.keys()
    assert {film["name"] for film in films} == {
        "bore_flow",
        "jacket_flow",
        "jacket",
        "purge",
        "cutting_fluid",
    }
    assert any(not group.get("lubrication") for group in groups)
    assert {group["bearing_type"][:2] for group in groups} >= {"60", "70", "71", "72", "N1", "NN"}
    assert any(group["bearing_type"].endswith("HC") for group in groups)


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5, 6])
def test_wider_ones_by_the_machine_s_own_network(number, tmp_path):
    word, why = solve_machine(draw_wider(6, number), tmp_path / "machine.toml", meshed=False)
    assert word == "solved" or (word == "refused" and ":" in why), why


@pytest.mark.slow
@pytest.mark.parametrize("number", range(1, 9))
def test_by_elements(number, tmp_path):
    content = draw_machine(np.random.default_rng([4, number]))
    word, why = solve_machine(content, tmp_path / "machine.toml")
    assert word in ("solved", "refused", "unsettled"), why


def test_friction_that_falls_steeply_with_temperature_is_followed_to_its_state(tmp_path):
    """An uncooled machine whose cold grease would heat it by hundreds of kelvin; it settles too warm."""
    word, why = solve_machine(draw_machine(np.random.default_rng([2, 263])), tmp_path / "machine.toml")
    assert word == "refused"
    assert why.startswith("checks: grease temperature")


def test_network_whose_ball_rows_do_not_follow_temperature_balances(tmp_path):
    """Its only round is solved to the end."""
    file = tmp_path / "machine.toml"
    file.write_text(VALID, encoding="utf-8")
    spec = load_buildable(file, ())
    assert all(group.ball_row.kind != "contact" for group in spec.bearing_set)
    state = solve_machine_network(build_machine_network(spec), OperatingPoint.of(spec))
    assert state.imbalance_relative < BALANCE_TOLERANCE
