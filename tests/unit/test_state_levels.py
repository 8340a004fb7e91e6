"""Hidden states of a network that are on at two levels: found, stated and written into a definition."""

import numpy as np
import pytest

from spindle_fem.effects.registry import build, catalogue, definition_entry, interval_effects
from spindle_fem.inference.hypothesis_fit import Problem, amplitude_name
from spindle_fem.inference.hypothesis_search import Search
from spindle_fem.inference.opened_machine import open_machine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import calibrate
from spindle_fem.inference.state_search import add_states, inferred_states, settle_best
from spindle_fem.recordings.align import read_recording
from tests.support.flawed_network import DURATION, MACHINE, record

# Heat of the body, W, for ten minutes of every half an hour, high and low in turn.
HIGH, LOW, ON, PERIOD = 120.0, 45.0, 600.0, 1500.0
BEGINS = np.arange(900.0, DURATION - ON, PERIOD)


def at_levels(time):
    number = int(np.searchsorted(BEGINS, time, side="right")) - 1
    if number < 0 or time >= BEGINS[number] + ON:
        return 0.0
    return LOW if number % 2 else HIGH


def at_one(time):
    return HIGH if at_levels(time) else 0.0


@pytest.fixture
def searched(tmp_path):
    """Search for what switches in a recording of a network."""

    def search_in(extra):
        (tmp_path / "drive.toml").write_text(MACHINE)
        run = record(tmp_path / "run", 3, times=np.arange(0.0, DURATION + 1.0, 60.0), extra=extra)
        machine = open_machine(tmp_path / "drive.toml", (), [read_recording(run)], [])
        predictor = Predictor(machine.fast, machine.recordings)
        calibrated = calibrate(None, predictor)
        problem = Problem(predictor, calibrated.known, calibrated.slow, predictor.observations)
        effects = catalogue()
        weights = {name: effect.prior_weight for name, effect in effects.items()}
        search = Search(problem, machine.view, effects, (), interval_effects(), weights, found={})
        nothing = problem.fit()
        search.keep(search.hypothesis(nothing))
        add_states(search, nothing)
        settle_best(search)
        return search

    return search_in


def test_heat_at_two_levels_is_found_stated_and_written(searched):
    search = searched(at_levels)
    fit = search.ranked()[0].fit
    (candidate,) = fit.candidates
    effect = catalogue()[candidate.effect]
    assert (candidate.effect, candidate.component) == ("unrecorded_heat_source", "body")
    (state,) = inferred_states(search, search.problem, fit).values()
    sizes = effect.sizes(state.candidate, fit.values)
    middles = [0.5 * (start + end) for start, end in effect.intervals(state.candidate, {})]
    assert sizes == pytest.approx([at_levels(middle) for middle in middles], rel=0.25)
    assert len(middles) == len(BEGINS)
    words = effect.statement(state.candidate, effect.report(state.candidate, fit.values))
    high, low = max(sizes), min(sizes)
    assert f"at 2 levels ({low:.3g} W, {high:.3g} W)" in words
    # What is written is read back as the same heat in the same intervals.
    own = {amplitude_name(state.candidate): fit.values[amplitude_name(candidate)]}
    entry = definition_entry(state.candidate, own)
    read = build(
        entry["effect"], entry["component"], "", entry["parameters"], search.view, entry["intervals"]
    )
    assert effect.sizes(read, {}) == pytest.approx(sizes)


def test_heat_at_one_level_stays_at_one(searched):
    search = searched(at_one)
    fit = search.ranked()[0].fit
    effect = catalogue()[fit.candidates[0].effect]
    sizes = effect.sizes(fit.candidates[0], fit.values)
    assert len(set(np.round(sizes, 6))) == 1
    assert "levels" not in effect.statement(fit.candidates[0], effect.report(fit.candidates[0], fit.values))
