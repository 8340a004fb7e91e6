"""What is on in several intervals, followed in stretches that are held out."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.effects.framework.unrecorded import STEPS
from spindle_fem.effects.registry import catalogue, interval_effects
from spindle_fem.inference.followed_readings import FollowedReadings
from spindle_fem.inference.followed_states import inferred_states
from spindle_fem.inference.hypothesis_fit import Problem, amplitude_name
from spindle_fem.inference.hypothesis_search import Search
from spindle_fem.inference.opened_machine import open_machine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import calibrate
from spindle_fem.inference.set_problems import SetProblems
from spindle_fem.inference.unseen_moments import unseen_moments
from spindle_fem.recordings.align import read_recording
from tests.support.flawed_network import MACHINE, record

# The third pulse lies in a stretch that no fit sees.
SIZE, PULSES = 60.0, ((1500.0, 2400.0), (5100.0, 6000.0), (8400.0, 9300.0), (12000.0, 12900.0))
HELD = (7800.0, 10200.0)


def searched(folder, heat, held):
    """A search that has not begun, on a recording with unrecorded heat, a stretch of which is held out."""
    (folder / "drive.toml").write_text(MACHINE)
    recording = read_recording(record(folder / "run", 5, extra=heat))
    machine = open_machine(folder / "drive.toml", (), [recording], [])
    (stamps,) = (item.times for item in machine.recordings)
    predictor = Predictor(machine.fast, machine.recordings, [(stamps < held[0]) | (stamps > held[1])])
    calibrated = calibrate(None, predictor)
    problem = Problem(predictor, calibrated.known, calibrated.slow, predictor.observations)
    effects = catalogue()
    weights = {name: effect.prior_weight for name, effect in effects.items()}
    return Search(problem, machine.view, effects, (), interval_effects(), weights, found={})


def on_in(pulses):
    return lambda time: sum(SIZE for start, end in pulses if start <= time < end)


def test_a_pulse_that_no_fitted_reading_shows_is_found_among_those_held_out(tmp_path):
    search = searched(tmp_path, on_in(PULSES), HELD)
    problem = search.problem
    effect = search.effects["unrecorded_heat_source"]
    seen = [pulse for pulse in PULSES if not HELD[0] < pulse[0] < HELD[1]]

    def fitted(intervals, iterations=20, **form):
        pulses = replace(effect.over(search.view, "body", intervals, **form), reference=SIZE)
        return problem.fit((pulses,), {amplitude_name(pulses): SIZE}, iterations=iterations)

    fit = fitted(seen)
    (state,) = inferred_states(search, problem, fit).values()
    found = effect.intervals(state.candidate, {})
    assert len(found) == len(PULSES)
    assert found[2] == pytest.approx(PULSES[2], abs=120.0)
    # Those that fitted readings show stay as they were fitted, to a step.
    fitted_edges = effect.intervals(fit.candidates[0], fit.values)
    assert np.allclose([*found[:2], found[3]], fitted_edges, atol=120.0)
    readings = FollowedReadings(
        SetProblems(problem, problem), lambda fit: inferred_states(search, problem, fit)
    )
    assert readings.beyond(fit) < 1.5
    assert FollowedReadings(SetProblems(problem, problem)).beyond(fit) > 3.0
    # Levels that differ are no state, nor is a single interval.
    levels = fitted(seen, iterations=0, course=STEPS, sizes=(0.3, 1.0, 3.0))
    assert not inferred_states(search, problem, levels)
    assert not inferred_states(search, problem, fitted(seen[:1], iterations=0))


@pytest.mark.parametrize(
    ("truth", "fitted"),
    [
        # Cooling after the pulse would be a pulse that begins after its end.
        (lambda time: -SIZE if 5100.0 <= time < 5700.0 else 0.0, [(5000.0, 5100.0)]),
        # Twice the heat for a while would be the pulses over each other.
        (on_in([(4000.0, 5600.0), (5100.0, 7000.0)]), [(4000.0, 5000.0), (5100.0, 7000.0)]),
    ],
)
def test_moments_that_all_readings_tell_stay_in_their_order(tmp_path, truth, fitted):
    search = searched(tmp_path, truth, (4900.0, 5800.0))
    effect = search.effects["unrecorded_heat_source"]
    pulses = replace(effect.over(search.view, "body", fitted), reference=SIZE)
    fit = search.problem.fit((pulses,), {amplitude_name(pulses): SIZE}, iterations=0)
    moved = unseen_moments(search.problem.predictor, fit)
    assert moved
    edges = np.ravel(effect.intervals(pulses, fit.values | moved))
    assert np.all(np.diff(edges) > 0.0)


def test_pulses_none_of_which_a_held_out_reading_shows_stay_as_they_were_fitted(tmp_path):
    """All of them in a stretch that was held out, what switches on either side of it: nothing is followed."""
    search = searched(tmp_path, on_in((*PULSES[:2], PULSES[3])), HELD)
    effect = search.effects["unrecorded_heat_source"]
    pulses = effect.over(search.view, "body", [(8000.0, 8500.0), (9000.0, 9500.0)])
    fit = search.problem.fit((pulses,), {amplitude_name(pulses): SIZE}, iterations=0)
    assert inferred_states(search, search.problem, fit) == {}
