"""Sets next to the best one, with a search that only notes what it is asked to fit."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.term import Term, TermParameter
from spindle_fem.errors import ConvergenceError
from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import Variant
from spindle_fem.inference.hypothesis import identity
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.hypothesis_search import Search
from spindle_fem.inference.neighbouring_sets import at_other_spots, exchanged
from spindle_fem.inference.screening import Screened


def law(effect: str, component: str, form: str = "", kind: str = "missing_physics") -> Candidate:
    """A law with one amplitude."""
    term = Term()
    term.name = f"{effect}.{component}.{form}"
    term.parameters = (TermParameter("size", 0.0, 1.0, logarithmic=False),)
    return Candidate(effect, component, form, kind, f"{term.name}.size", 0.0, 0.5, terms=(term,))


HUMP, RAMP = law("drift", "room", "hump"), law("drift", "room", "ramp")
BESIDE, ELSEWHERE = law("radiation", "room"), law("radiation", "flange")
LYING, OTHER_LIE = law("lag", "room", kind="sensor"), law("lag", "flange", kind="sensor")


class NotingSearch:
    """The best set is the first of the candidates; every law explains as much to first order.

    About the best set without it they promise ``gains``, in order.
    """

    interval_effects = ()
    effects = dict.fromkeys(("drift", "radiation", "lag"), SimpleNamespace(delays=False))
    view = SimpleNamespace(groups=(), sets={})
    amplitude = 1.0

    def __init__(self, candidates=(HUMP, RAMP, BESIDE, ELSEWHERE), gains=None) -> None:
        self.candidates, self.gains = candidates, gains
        self.problem = SimpleNamespace(
            predictor=SimpleNamespace(is_network=gains is None),
            simulated=lambda rest, values, iterations: SimpleNamespace(candidates=rest, values=values),
        )
        nothing = SimpleNamespace(fit=SimpleNamespace(candidates=(), values={}))
        self.best = SimpleNamespace(fit=SimpleNamespace(candidates=candidates[:1], values={}))
        self.found = {identity(()): nothing, identity(candidates[:1]): self.best}
        count = len(self.candidates)
        screened = Screened(
            tuple(Variant(item, {}) for item in self.candidates),
            np.eye(count),
            np.full(count, 5.0),
            25.0,
            np.ones(count),
            np.zeros(count),
            np.zeros(count),
        )
        self.screenings = {identity(()): (nothing.fit, screened)}
        self.asked: set = set()
        self.asked_anew: set = set()

    def ranked(self):
        """The best set first."""
        return [self.best]

    def is_explained(self, hypothesis):
        """Something is left to explain."""
        return False

    def in_intervals(self, candidate):
        """Whether it is unrecorded heat."""
        return candidate.effect == "heat"

    def families(self):
        """Two bearings of a set."""
        return {"F1": "front", "F2": "front"}

    def elsewhere(self, member, values):
        """The same at the front bearings."""
        return [Variant(law("heat", "front"), {})]

    def screened(self, fit, trust, only_laws, beside):
        """What everything promises; of intervals those of the member elsewhere as well."""
        assert trust is self.best.fit
        assert only_laws == (not beside) == (self.candidates[0].effect != "heat")
        order = np.argsort(self.gains)[::-1]
        found = SimpleNamespace(
            variants=[Variant(item, {}) for item in self.candidates],
            singles=lambda: np.array(self.gains),
            best_of=lambda allowed, number: [i for i in order if allowed(self.candidates[i])],
            amplitudes=lambda members: dict.fromkeys(members, self.amplitude),
        )
        return found, {}

    def task(self, fit, additions, intervals):
        """The set that would be fitted."""
        return (*fit.candidates, *(variant.candidate for variant, _ in additions)), {}

    def fit_all(self, tasks, anew=False, reach=0.0):
        """Note what is asked."""
        asked = {identity(candidates) for candidates, _ in tasks}
        self.asked |= asked
        self.asked_anew |= asked if anew else set()


def test_other_forms_and_laws_at_its_place_are_tried_in_the_place_of_a_law_of_a_network():
    search = NotingSearch()
    exchanged(search)
    assert search.asked == {identity((RAMP,)), identity((BESIDE,))}


def test_a_set_that_was_fitted_again_is_screened_again():
    search, screened_about = NotingSearch(), []
    ((_, known),) = search.screenings.values()
    again = SimpleNamespace(candidates=(), values={"heat": 2.0})
    search.found[identity(())] = SimpleNamespace(fit=again)
    search.screened = lambda fit, **how: screened_about.append(fit) or (known, {})
    exchanged(search)
    assert screened_about
    assert all(fit is again for fit in screened_about)


def test_laws_at_its_place_are_tried_in_the_place_of_a_sensor_of_a_network_that_lies():
    search = NotingSearch((LYING, OTHER_LIE, HUMP, BESIDE, ELSEWHERE))
    exchanged(search)
    assert search.asked == {identity((HUMP,)), identity((BESIDE,))}


def test_what_promises_to_do_the_same_is_tried_in_the_place_of_a_member_wherever_it_acts():
    least = -tuned.EXCHANGE_PROMISES * tuned.HOPELESS_SCORE
    search = NotingSearch((HUMP, RAMP, BESIDE, ELSEWHERE), (0.0, least - 1.0, least - 1.0, least + 1.0))
    exchanged(search)
    assert search.asked == {identity((ELSEWHERE,))}


def test_a_set_whose_fit_had_pulled_the_machine_far_off_is_fitted_again_about_the_best_one():
    """It ended where the machine takes up what another start shows it does."""
    search = NotingSearch((HUMP, RAMP, BESIDE, ELSEWHERE), (0.0, 1.0, 2.0, 3.0))
    for item, pulled in ((BESIDE, tuned.PULLED + 1.0), (ELSEWHERE, tuned.PULLED - 1.0)):
        fit = SimpleNamespace(misfit=500.0, misfit_with_prior=500.0 + pulled)
        search.found[identity((item,))] = SimpleNamespace(fit=fit)
    exchanged(search)
    assert search.asked_anew == {identity((BESIDE,))}
    assert search.asked == {identity((item,)) for item in (RAMP, BESIDE, ELSEWHERE)}


def test_all_that_a_sensor_may_do_and_a_few_others_are_tried_in_the_place_of_its_lie():
    """Of one law no more places than that, of all laws no more than that many."""
    laws = [law(f"law {number}", "room") for number in range(tuned.EFFECTS_EXCHANGED)]
    places = [law("law 0", f"place {number}") for number in range(tuned.OTHER_SPOTS)]
    other = law("gain", "room", kind="sensor")
    candidates = (LYING, *places, *laws, other)
    search = NotingSearch(candidates, -np.arange(len(candidates), dtype=float))
    search.effects = dict.fromkeys([c.effect for c in candidates], SimpleNamespace(delays=False))
    exchanged(search)
    few = laws[1 : 1 + tuned.EFFECTS_EXCHANGED - tuned.OTHER_SPOTS]
    assert search.asked == {identity((c,)) for c in (*places, *few, other)}


@pytest.mark.parametrize(("amplitude", "tried"), [(-1.0, False), (-40.0, True)])
def test_other_forms_of_a_factor_are_tried_where_it_is_far_off(amplitude, tried):
    """Seats that conduct a twentieth: to first order inner and outer rings say little of each other."""
    seats = []
    for form in ("inner", "outer"):
        term = Term()
        term.name = f"seats.room.{form}"
        term.parameters = (TermParameter("factor", 1.0, 0.6),)
        name = f"{term.name}.factor"
        seats.append(Candidate("seats", "room", form, "parameter", name, 1.0, 0.6, terms=(term,)))
    least = -tuned.EXCHANGE_PROMISES * tuned.HOPELESS_SCORE
    search = NotingSearch((HUMP, *seats), (0.0, least + 1.0, least - 1.0))
    search.effects = dict.fromkeys(("drift", "seats"), SimpleNamespace(delays=False))
    search.amplitude = amplitude
    exchanged(search)
    assert search.asked == {identity((seat,)) for seat in seats[: 1 + tried]}


def test_intervals_at_bearings_of_the_set_that_was_found_hide_no_other_place():
    places = [law("heat", f"place {number}") for number in range(tuned.OTHER_SPOTS)]
    candidates = (law("heat", "F1"), law("heat", "F2"), law("heat", "front"), *places)
    search = NotingSearch(candidates, -np.arange(len(candidates), dtype=float))
    search.effects = {"heat": SimpleNamespace(delays=False)}
    exchanged(search)
    assert search.asked == {identity((c,)) for c in places}


@pytest.fixture
def search(monkeypatch):
    """A search that knows one set, whose fit left 50, and keeps what is fitted as it is given."""
    monkeypatch.setattr(Search, "_hopeless", lambda self, size, reach: np.inf)
    monkeypatch.setattr(Search, "_unseen", lambda self, candidate, values: False)
    monkeypatch.setattr(Search, "hypothesis", lambda self, fit, paid=0.0: fit)
    monkeypatch.setattr(Search, "keep", lambda self, fit: self.found.update({"kept": fit}))
    problem = SimpleNamespace(begins_better=lambda fit, start: start["left"] < fit.misfit_with_prior)
    workers = SimpleNamespace(
        fits=lambda problem, orders: [
            SimpleNamespace(values=dict(order.start), misfit_with_prior=order.start["left"])
            for order in orders
        ]
    )
    found = Search(problem, NotingSearch.view, {}, (), (), {}, workers=workers)
    found.found = {identity((BESIDE,)): SimpleNamespace(fit=SimpleNamespace(misfit_with_prior=50.0))}
    return found


@pytest.mark.parametrize(
    ("left", "again", "fitted"), [(40.0, True, True), (60.0, True, False), (40.0, False, False)]
)
def test_a_known_set_is_fitted_again_where_it_begins_with_less(search, left, again, fitted):
    search.fit_all([((BESIDE,), {"left": left})], again=again)
    assert ("kept" in search.found) is fitted


@pytest.mark.parametrize(("left", "kept"), [(40.0, True), (60.0, False)])
def test_a_known_set_is_fitted_anew_and_what_ends_better_is_kept(search, left, kept):
    search.fit_all([((BESIDE,), {"left": left})], anew=True)
    assert ("kept" in search.found) is kept


def test_other_spots_are_not_sought_where_a_set_without_the_member_runs_away(monkeypatch):
    """A bypass may hold what closing bearings heat in check: without it nothing can be simulated."""

    def runs_away(self, *given, **more):
        raise ConvergenceError("t = 4600 s", "the terms run away to 5365 K.")

    monkeypatch.setattr(Problem, "fit", runs_away)
    search = SimpleNamespace(problem=object.__new__(Problem))
    fit = SimpleNamespace(candidates=(BESIDE, HUMP), values={"heat": 1.0})
    assert at_other_spots(search, fit, BESIDE, (HUMP,)) == []
