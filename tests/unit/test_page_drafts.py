"""A machine in a page by the documentation alone, and its drafts: every mistake one fault, all at once."""

from __future__ import annotations

import itertools

import pytest

from spindle_fem.commands.checked_machine import load_buildable
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import FaultsError
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.operation.circuits import capacity_rate
from spindle_fem.solvers.machine_network_steady import solve_machine_network
from tests.support.page_machine import PAGE, TEN, TEN_OTHERS, draft


def written(folder, text: str):
    path = folder / "draft.toml"
    path.write_text(text, encoding="utf-8")
    return path


def faults_of(folder, mistakes) -> list[str]:
    with pytest.raises(FaultsError) as caught:
        load_buildable(written(folder, draft(mistakes)), ())
    assert caught.value.exit_status == 2
    return [str(fault) for fault in caught.value.faults]


def require(faults: list[str], mistakes) -> None:
    listing = "\n".join(faults)
    assert len(faults) == len(mistakes), listing
    for *_, parts in mistakes:
        assert sum(all(part in fault for part in parts) for fault in faults) == 1, (
            f"{parts} not in\n{listing}"
        )
    # Every fault says where, and what is allowed.
    assert all(fault.startswith("draft.toml: ") for fault in faults)
    allowed = (
        "Allowed: ",
        "Write it with its unit, such as",
        "Names must differ",
        "Parts may touch",
        "Did you mean",
    )
    assert all(any(words in fault for words in allowed) for fault in faults), listing


def test_the_page_has_at_most_seventy_lines_and_is_a_machine(tmp_path):
    assert len(PAGE.splitlines()) <= 70
    spec = load_buildable(written(tmp_path, PAGE), ())
    assert {kind.ball_material for kind in spec.bearing_types.values()} == {"silicon_nitride"}
    assert [film.fluid for film in spec.circuits] == ["ethylene_glycol_30"]


def test_the_page_runs_and_its_jacket_takes_most_of_the_heat(tmp_path):
    """900 W of the stator, 120 W of the rotor and what bearings rub; 0.8 kW/K of water and glycol."""
    spec = load_machine(written(tmp_path, PAGE))
    state = solve_machine_network(build_machine_network(spec))
    jacket = state.boundary_heat["jacket"]
    assert 1020.0 + 500.0 < state.heat_in < 1020.0 + 1600.0
    assert 0.8 * state.heat_in < jacket < state.heat_in
    warmed = jacket / capacity_rate(spec.circuits[0])
    assert 1.5 < warmed < 3.5
    assert all(at.inner > at.outer for at in state.bearing_temperatures().values())


@pytest.mark.parametrize("mistakes", [TEN, TEN_OTHERS], ids=["ten", "ten others"])
def test_ten_mistakes_are_ten_faults(tmp_path, mistakes):
    require(faults_of(tmp_path, mistakes), mistakes)


@pytest.mark.parametrize("mistake", [*TEN, *TEN_OTHERS], ids=lambda mistake: " ".join(mistake[2])[:40])
def test_one_mistake_is_one_fault(tmp_path, mistake):
    require(faults_of(tmp_path, [mistake]), [mistake])


@pytest.mark.parametrize("mistakes", [TEN, TEN_OTHERS], ids=["ten", "ten others"])
def test_two_mistakes_are_two_faults(tmp_path, mistakes):
    for pair in itertools.combinations(mistakes, 2):
        require(faults_of(tmp_path, pair), pair)
