"""A refined network converges to axisymmetric elements of the same machine without helix."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.solvers.machine_network_steady import solve_machine_network
from spindle_fem.studies.crosscheck.axisymmetric import solve_axisymmetric
from spindle_fem.studies.crosscheck.gather_fields import gather_axisymmetric, gather_network


@pytest.fixture(scope="module")
def spindle():
    return load_machine("recorded_spindle")


def refined(spec, refinement, **settings):
    return solve_machine_network(build_machine_network(spec, refinement=refinement, **settings))


@pytest.fixture(scope="module")
def coarse(spindle):
    return build_machine_network(spindle)


@pytest.fixture(scope="module")
def networks(spindle):
    return {n: refined(spindle, n) for n in (2, 4, 8)}


@pytest.fixture(scope="module")
def elements(networks):
    return {n: solve_axisymmetric(networks[n]) for n in (2, 4)}


def test_refined_network_converges_to_axisymmetric_elements(coarse, networks, elements):
    reference = gather_axisymmetric(coarse, networks[4].network.machine, elements[4])
    errors = [np.abs(gather_network(coarse, networks[n]) - reference).max() for n in (2, 4, 8)]
    assert errors[0] > errors[1] > errors[2]
    # the corners of seats and shoulders make the field singular: first order in the cell size
    assert errors[0] / errors[1] > 1.6
    assert errors[2] < 0.1
    own = gather_axisymmetric(coarse, networks[2].network.machine, elements[2])
    assert np.abs(own - reference).max() < 0.03


def test_closed_rings_converge_as_well(spindle, coarse):
    rings = [refined(spindle, n, channelling="rings") for n in (2, 4)]
    reference = gather_axisymmetric(coarse, rings[1].network.machine, solve_axisymmetric(rings[1]))
    errors = [np.abs(gather_network(coarse, state) - reference).max() for state in rings]
    assert errors[1] < 0.6 * errors[0]


def test_elements_balance_and_have_the_network_s_heat(networks, elements):
    for n, state in elements.items():
        assert abs(state.residual_relative) < 1e-9
        out = networks[n].boundary_heat["coolant"]
        rate = networks[n].network.stream_rate
        inlet = networks[n].network.point.coolant_inlet_temperature
        assert rate * (state.coolant[-1] - inlet) == pytest.approx(out, rel=2e-3)


def test_both_are_at_rest_when_everything_around_is(spindle):
    """No heat, oil at room temperature: every node has it, in both."""
    still = spindle.model_copy(
        update={
            "operation": spindle.operation.model_copy(update={"speed": 0.0, "ambient_temperature": 295.0}),
            "coolant": spindle.coolant.model_copy(update={"inlet_temperature": 295.0}),
        }
    )
    state = refined(still, 2)
    assert state.temperature == pytest.approx(np.full(state.temperature.size, 295.0), abs=1e-9)
    assert solve_axisymmetric(state).mean == pytest.approx(
        np.full(state.network.machine.n_solid, 295.0), abs=1e-9
    )


def test_nothing_is_colder_than_its_surroundings(networks):
    for state in networks.values():
        assert state.temperature.min() >= 288.15 - 1e-9


@pytest.mark.parametrize("machine", ["small_two_start", "uncooled"])
def test_other_machines_converge_too(machine):
    spec = load_machine(machine)
    lumps = build_machine_network(spec)
    errors = []
    for n in (2, 4):
        # each beside elements with its own friction heat, which follows the temperatures
        state = refined(spec, n)
        reference = gather_axisymmetric(lumps, state.network.machine, solve_axisymmetric(state))
        errors.append(np.abs(gather_network(lumps, state) - reference).max())
    assert errors[1] < 0.6 * errors[0]
    assert errors[1] < 0.25
