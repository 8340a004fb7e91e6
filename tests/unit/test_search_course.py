"""How long a search goes on beside its best set, on a search made up for the purpose."""

from types import SimpleNamespace

import pytest

from spindle_fem.inference import search_course, tuned
from spindle_fem.inference.hypothesis import identity
from spindle_fem.inference.hypothesis_search import Search
from tests.support.made_hypotheses import candidate


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

    in_intervals = is_hidden_state

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
    monkeypatch.setattr(search_course, "add_states", lambda search, fit, number: None)
    asked = []
    monkeypatch.setattr(search_course, "add_steps", lambda search, fit: asked.append(fit.candidates))
    search = Ever(gain)
    search_course._beside(search)
    assert search.rounds == rounds
    assert asked == [("state",)] * rounds


@pytest.mark.parametrize(
    ("best", "explained", "asked"),
    [
        ("state law", False, ["state"]),
        ("state law other", False, ["state"]),
        ("state law", True, []),
        ("state", False, []),
        ("law other", False, []),
    ],
)
def test_levels_are_sought_in_the_stead_of_laws_beside_a_state(monkeypatch, best, explained, asked):
    """Laws are found before levels, whose place they may have taken."""

    def found(names):
        members = tuple(candidate(name) for name in names.split())
        return SimpleNamespace(keys=frozenset(names.split()), fit=SimpleNamespace(candidates=members))

    search = SimpleNamespace(
        ranked=lambda: [found(best)],
        found={identity(found(names).fit.candidates): found(names) for names in ("state", best)},
        is_hidden_state=lambda item: item.effect == "state",
    )
    begun = []
    monkeypatch.setattr(search_course, "_leaves_little", lambda search, best: explained)
    monkeypatch.setattr(
        search_course, "add_steps", lambda search, fit: begun.extend(c.effect for c in fit.candidates)
    )
    search_course._levels_for_laws(search)
    assert begun == asked


def test_what_changes_is_sought_beside_the_best_laws_that_leave_room_for_it():
    def found(*names):
        return SimpleNamespace(fit=SimpleNamespace(candidates=names))

    three, with_state, two, one = found("a", "b", "c"), found("a", "state"), found("a", "b"), found("a")
    search = SimpleNamespace(
        ranked=lambda: [three, with_state, two, one], in_intervals=lambda item: item == "state"
    )
    assert search_course.laws_with_room(search) is two.fit


@pytest.mark.parametrize(
    ("explained", "members", "size", "is_network", "beam"),
    [
        (False, "ab", 2, False, tuned.BEAM),
        (False, "ab", 2, True, tuned.BEAM),
        (True, "", 1, True, 1),
        (True, "a", 1, False, 1),
        (True, "a", 2, False, 0),
        (True, "ab", 2, False, 1),
        (True, "ab", 2, True, 0),
    ],
)
def test_a_third_effect_beside_two_that_fit_is_looked_for_with_geometry(
    explained, members, size, is_network, beam
):
    problem = SimpleNamespace(predictor=SimpleNamespace(is_network=is_network))
    search = SimpleNamespace(is_explained=lambda best: explained, problem=problem)
    assert search_course._beam(search, SimpleNamespace(keys=frozenset(members)), size) == beam


def test_beside_the_best_set_additions_are_fitted_that_promise_little():
    """To first order a small effect gains less than it does once its law is fitted."""
    least, short = tuned.LEAST_PROMISED_GAIN, tuned.PROMISED_SHORT
    best = 3.0 * least / tuned.LEAST_PROMISED_SHARE
    share = tuned.LEAST_PROMISED_SHARE * best
    gains = (best, share + 0.1, share - 0.1, share - short + 0.1, share - short - 0.1)

    def fitted(gains, **more):
        """Which additions are."""
        found = []
        search = SimpleNamespace(
            ranked=lambda: [SimpleNamespace(score=9.0)],
            found={identity(()): SimpleNamespace(score=0.0)},
            task=lambda fit, additions, intervals: additions[0][0],
            fit_all=found.extend,
        )
        screened = SimpleNamespace(
            best=lambda number, count: [((i,), gain) for i, gain in enumerate(gains)][:count],
            amplitudes=lambda members: dict.fromkeys(members, 1.0),
            variants=list(range(len(gains))),
        )
        Search.extend(search, SimpleNamespace(candidates=("a",)), screened, {}, 1, 6, **more)
        return found

    assert fitted(gains) == [0, 1]
    assert fitted(gains, beside=True) == [0, 1, 2, 3]
    assert fitted((least - 0.1,)) == []
    assert fitted((least - 0.1, least - short + 0.1, least - short - 0.1), beside=True) == [0, 1]


def test_a_search_begins_from_what_is_known_too_where_nothing_missing_departs_far_from_it():
    def pulled(misfit_per_datum, departs, is_network=False):
        null = SimpleNamespace(
            reduced_misfit=misfit_per_datum, misfit=500.0, misfit_with_prior=500.0 + departs
        )
        return search_course._pulled_far_off(null, is_network)

    much, far = 1.01 * tuned.DISTORTED**2, 1.01 * tuned.PULLED
    assert not pulled(0.99 * tuned.DISTORTED**2, 0.99 * tuned.PULLED)
    assert pulled(much, 0.0)
    assert pulled(much, 0.0, is_network=True)
    assert pulled(1.0, far)
    # What is known of a network's nodes is loose.
    assert not pulled(1.0, far, is_network=True)
