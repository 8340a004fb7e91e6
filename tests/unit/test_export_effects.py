"""Effects of a definition in exported models: what simulate marches, or a refusal that says why."""

import numpy as np
import pytest

from spindle_fem.definition.network_load import load_network_machine
from spindle_fem.effects.registry import candidates_for, fixed
from spindle_fem.errors import SpindleFemError
from spindle_fem.machine.view.defined_point import at_the_defined_point
from spindle_fem.model.lumped.network_view import day_of_a_network, view_of_network
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.defined_effects import ActiveEffects
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.operation.preload_mechanics import machine_view
from spindle_fem.studies.export.effect_export import ExportedEffects
from spindle_fem.studies.export.geometry_export import geometry_state_space
from spindle_fem.studies.export.network_export import network_state_space
from spindle_fem.units import ZERO_CELSIUS_K
from tests.support.lumped_spindle import RPM, drive_of
from tests.support.stepped_model import readings_along, resolved_run
from tests.support.written_texts import network_text

# Largest difference from simulate, K; what an effect changes at least.
AGREEMENT, SEEN = 1e-3, 1.5e-3
START = 22.0
HELD = {
    "coolant_bypass", "coolant_film", "drive_heat", "heat_capacity", "heat_scale", "heat_split",
    "joint_conductance", "seal_friction", "sensor_gain", "sensor_offset", "shaft_convection", "windage",
}  # fmt: skip
NETWORK = network_text(
    "Spindle 2",
    {"bearing": "400 J/K", "shaft": "900 J/K", "housing": "3 kJ/K"},
    {"bearing|housing": "8 W/K", "bearing|shaft": "3 W/K", "housing|ambient": "4 W/K"},
    [("bearing", "speed", "80 W", {"reference": "1000 rpm", "exponent": 1.5})],
    {"ambient": "ambient"},
)


def with_size(candidate):
    """A candidate at its usual size, factors at 1.3."""
    item = candidate.parameters[candidate.amplitude]
    neutral = item.value if item.value else 0.0
    size = 1.3 * neutral if neutral else candidate.reference
    return fixed(candidate, {item.name: size})


def told_by_simulate(fast, drive, candidate):
    effects = ActiveEffects((candidate,))
    run = resolved_run(
        fast, drive, START + ZERO_CELSIUS_K, parameters=effects.times_parameters({}), terms=effects.terms
    )
    found = run.temperature[1:].copy()
    for reading in effects.readings:
        row = fast.channels.index(reading.channel)
        inputs = {name: drive.end[:, number] for number, name in enumerate(drive.names)}
        own = {item.name: np.full(1, item.value, dtype=complex) for item in reading.parameters}
        there = found[:, [row]].astype(complex)
        found[:, row] = np.real(reading.read(drive.grid[1:], there, inputs, own))[:, 0]
    return found - ZERO_CELSIUS_K


def refusal(candidate, export):
    try:
        export(ActiveEffects((candidate,)))
    except SpindleFemError as error:
        return str(error)
    return ""


def held_effects(fast, drive, candidates, export):
    """Names of effects whose exports agree; what is not agreed on fails, and refusals say why."""
    plain = resolved_run(fast, drive, START + ZERO_CELSIUS_K).temperature[1:] - ZERO_CELSIUS_K
    found = set()
    for candidate in map(with_size, candidates):
        refused = refusal(candidate, export)
        if refused:
            assert candidate.label in refused or "changes so sharply" in refused
            assert "simulate takes it" in refused
            continue
        space = export(ActiveEffects((candidate,)))
        told = told_by_simulate(fast, drive, candidate)
        assert np.abs(told - plain).max() > SEEN, candidate.label
        read = readings_along(space.model(), drive, {0: START})
        assert np.abs(read - told).max() < AGREEMENT, candidate.label
        assert candidate.label in space.header["notes"][-1]
        found.add(candidate.effect)
    return found


@pytest.mark.parametrize("names", [{"heat_scale", "drive_heat", "sensor_gain"}])
def test_effects_agree_with_simulate(fast, names):
    assert held_by_spindle(fast, lambda effect: effect in names) == names


def test_films_over_the_reynolds_number_are_refused_and_fouled_ones_held(fast):
    view = machine_view(fast.names, at_the_defined_point(fast.spec))
    films = [with_size(item) for item in candidates_for(view) if item.effect == "coolant_film"]
    reasons = {item.form: refusal(item, lambda own: ExportedEffects(fast, own)) for item in films}
    assert {form for form, reason in reasons.items() if "steps of a kelvin" in reason} == {
        "curvature",
        "transition",
    }
    assert reasons["fouling"] == ""


def test_fouled_film_agrees_with_simulate_while_the_inlet_moves(fast):
    times = np.arange(0.0, 2400.0, 30.0)
    drive = drive_of(times, np.full(times.size, 3000.0), inlet=290.15 + 4.0 * np.sin(times / 400.0))
    view = machine_view(fast.names, at_the_defined_point(fast.spec))
    fouled = [
        item for item in candidates_for(view) if (item.effect, item.form) == ("coolant_film", "fouling")
    ]
    assert held_effects(
        fast, drive, fouled, lambda effects: geometry_state_space(fast, "lumped", 4500.0 * RPM, effects)
    ) == {"coolant_film"}


@pytest.mark.slow
def test_every_effect_agrees_with_simulate_or_is_refused_with_a_reason(fast):
    assert held_by_spindle(fast, lambda effect: True) == HELD


def held_by_spindle(fast, wanted):
    times = np.arange(0.0, 2400.0, 30.0)
    speed = np.where(times < 1200.0, 3000.0, np.where(times < 1800.0, 0.0, 1234.0))
    view = machine_view(fast.names, at_the_defined_point(fast.spec))
    of_form = {(item.effect, item.form): item for item in candidates_for(view) if wanted(item.effect)}
    return held_effects(
        fast,
        drive_of(times, speed),
        of_form.values(),
        lambda effects: geometry_state_space(fast, "lumped", 4500.0 * RPM, effects),
    )


def test_effects_of_a_network_agree_with_simulate_or_say_why(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(NETWORK, encoding="utf-8")
    spec = load_network_machine(path)
    network = build_network(spec.network)
    fast = fast_network(network, spec)
    times = np.arange(0.0, 2400.0, 30.0)
    drive = drive_of(times, 1000.0 * (times < 1500.0), ambient=298.15)
    candidates = candidates_for(view_of_network(network, day_of_a_network(network, ["speed"])))
    found = held_effects(
        fast, drive, candidates, lambda effects: network_state_space(fast, "lumped", effects)
    )
    machines = {"coolant_bypass", "coolant_film", "heat_split", "shaft_convection"}
    assert found == HELD - machines
