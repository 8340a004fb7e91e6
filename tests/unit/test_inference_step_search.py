"""Levels that change: what happens to a set that cannot be simulated again."""

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.errors import ConvergenceError
from spindle_fem.inference import step_search
from spindle_fem.inference.change_points import Changes


def test_a_set_that_runs_away_when_it_begins_anew_is_given_up(monkeypatch):
    def runs_away(problem, fit):
        raise ConvergenceError("fast model", "the terms run away.")

    kept = []
    changes = Changes((1,), np.array([20.0]), 30.0)
    fit = SimpleNamespace(values={}, candidates=())
    monkeypatch.setattr(step_search, "find_changes", lambda *given: changes)
    monkeypatch.setattr(step_search, "_spread", lambda *given: 1.0)
    monkeypatch.setattr(step_search, "_below_known", lambda *given: False)
    monkeypatch.setattr(step_search, "levels_over_lowest", lambda *given: ((), ()))
    monkeypatch.setattr(step_search, "_fitted", lambda *given: SimpleNamespace(fit=fit))
    drives = [SimpleNamespace(grid=np.array([0.0, 100.0]))]
    search = SimpleNamespace(
        problem=SimpleNamespace(predictor=SimpleNamespace(drives=drives)), keep=kept.append
    )
    onsets = SimpleNamespace(pattern=None, recording=0, times=np.zeros(3), gram=None, data=None)
    monkeypatch.setattr(step_search, "slow_error_of", runs_away)
    step_search._settle(search, fit, None, onsets)
    assert kept == []


def test_a_level_that_lasts_to_the_end_is_no_step_at_the_last_instant():
    for end in np.linspace(1001.3, 99999.7, 40):
        times = np.linspace(0.0, end, 121)[:-1]
        assert np.abs(step_search._at(times, end)).max() < 1e-6
        at = [step_search._at(times, place * end / 120.0) for place in (0.0, 50.25, 119.5)]
        assert [weights.sum() for weights in at] == pytest.approx([1.0, 1.0, 0.5])
        assert at[1][[50, 51]] == pytest.approx([0.75, 0.25])


def test_a_stretch_is_unread_where_the_clock_of_the_inputs_has_no_reading():
    """Temperatures are stamped 1000 s late: what they leave unread is as much earlier on that clock."""
    times, late = np.arange(0.0, 10000.0, 50.0), 1000.0
    unread = (times >= 4000.0) & (times < 6000.0)
    predictor = SimpleNamespace(
        drives=[SimpleNamespace(grid=np.array([0.0, 9000.0]))],
        recordings=[SimpleNamespace(usable=np.ones((times.size, 1), dtype=bool), times=times)],
        use=[~unread],
        stamps=lambda number: times - late,
    )
    place, problem = SimpleNamespace(recording=0), SimpleNamespace(predictor=predictor)

    def course(start, end):
        return step_search._course([(start, end)], [7.0], problem, place)

    # Nothing tells the level of a stretch without readings: it has that of what came before.
    assert course(3000.0, 5000.0) == ([0.0, 5000.0, 9000.0], [0.0, 0.0])
    assert course(4500.0, 6500.0) == ([0.0, 4500.0, 6500.0, 9000.0], [0.0, 7.0, 0.0])
