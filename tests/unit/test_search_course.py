"""How long a search goes on beside its best set, on a search made up for the purpose."""

from types import SimpleNamespace

import pytest

from spindle_fem.inference import search_course, tuned


class Ever:
    """Every round finds the same effects again, better by ``gain``."""

    def __init__(self, gain):
        self.gain, self.rounds = gain, 0

    def ranked(self):
        fit = SimpleNamespace(candidates=("state",))
        return [SimpleNamespace(keys=frozenset({"state"}), fit=fit, score=self.gain * self.rounds)]

    def progress(self, words):
        pass

    def is_explained(self, best):
        return False

    def is_hidden_state(self, candidate):
        return True

    def screened(self, fit):
        self.rounds += 1
        return None, {}

    def extend(self, *ignored):
        pass


@pytest.mark.parametrize(
    ("gain", "rounds"), [(0.5 * tuned.WORTH_ANOTHER, 1), (1e3, search_course.LARGEST_SET)]
)
def test_a_state_that_gains_a_little_every_time_is_not_followed_for_ever(monkeypatch, gain, rounds):
    monkeypatch.setattr(search_course, "settle_best", lambda search: None)
    search = Ever(gain)
    search_course._beside(search)
    assert search.rounds == rounds
