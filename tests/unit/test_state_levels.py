"""Hidden states of a network that are on at two levels: found, stated and written into a definition."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.effects.registry import build, catalogue, definition_entry
from spindle_fem.inference import state_search
from spindle_fem.inference.followed_states import inferred_states
from spindle_fem.inference.hypothesis_fit import amplitude_name
from spindle_fem.inference.state_search import settle, settle_best
from tests.support.flawed_network import DURATION
from tests.support.searched_network import searched

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


def settled(folder, extra):
    """Search for what switches in a recording of a network, followed again at further levels."""
    _, search = searched(folder, np.arange(0.0, DURATION + 1.0, 60.0), extra)
    settle_best(search)
    return search


def test_heat_at_two_levels_is_found_stated_and_written(tmp_path):
    search = settled(tmp_path, at_levels)
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


def test_heat_at_one_level_stays_at_one(tmp_path):
    search = settled(tmp_path, at_one)
    fit = search.ranked()[0].fit
    effect = catalogue()[fit.candidates[0].effect]
    sizes = effect.sizes(fit.candidates[0], fit.values)
    assert len(set(np.round(sizes, 6))) == 1
    assert "levels" not in effect.statement(fit.candidates[0], effect.report(fit.candidates[0], fit.values))


def test_worse_course_leaves_search_as_it_was(tmp_path, monkeypatch):
    search = settled(tmp_path, at_one)
    best = search.ranked()[0]
    (candidate,) = best.fit.candidates
    known = search.courses[candidate.amplitude]
    place, course, _ = known
    # Half of the intervals, and not followed again: a set with this course is less likely.
    monkeypatch.setattr(state_search, "course_about", lambda *given: None)
    level = np.where(np.arange(len(course.level)) < len(course.level) // 2, course.level, 0)
    half = replace(course, level=level.astype(course.level.dtype))
    settle(search, best.fit, place, half, candidate)
    assert search.ranked()[0] is best
    assert search.courses[candidate.amplitude] is known
