"""Screening of sets, missing heat over time and intervals, on linear problems with known answers."""

from itertools import combinations

import numpy as np
import pytest

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.term import Term, TermParameter
from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import Variant
from spindle_fem.inference.missing_heat import (
    Onsets,
    Pattern,
    conditions_of,
    explain,
    find_intervals,
    shares,
    stretches,
)
from spindle_fem.inference.screening import (
    Screened,
    amplitude_spread,
    amplitude_to_begin_from,
    amplitude_value,
    is_far_off,
    log_priors,
    spreads_at_size,
)

STOP, COUNT = 14400.0, 40
TIMES = np.linspace(0.0, STOP, COUNT + 1)[:-1]
READ = np.arange(0.0, STOP, 60.0)


class Seats(Term):
    def operating_factor(self, point, parameters):
        return {}


def candidate(effect, component="a", form="", **parameter):
    term = Term()
    term.name = f"{effect}.{component}.{form}"
    given = {"name": "size", "value": 0.0, "sigma": 2.0, "logarithmic": False} | parameter
    term.parameters = (TermParameter(**given),)
    null = 1.0 if given["logarithmic"] else 0.0
    return Candidate(
        effect, component, form, "missing_physics", f"{term.name}.size", null, null + 0.5, terms=(term,)
    )


def variants(*keys):
    return tuple(Variant(candidate(effect, component, form), {}) for effect, component, form in keys)


def screened(columns, data, spread=1.0, signs=None, keys=None, log_prior=None):
    count = columns.shape[1]
    keys = keys or [(f"effect{i}", "a", "") for i in range(count)]
    return Screened(
        variants(*keys),
        columns.T @ columns,
        columns.T @ data,
        float(data @ data),
        np.full(count, spread),
        np.zeros(count) if signs is None else np.asarray(signs, dtype=float),
        np.zeros(count) if log_prior is None else np.asarray(log_prior, dtype=float),
    )


@pytest.fixture(scope="module")
def problem():
    """Twelve answers; the data hold the third and the eighth, whose sum resembles the sixth."""
    generator = np.random.default_rng(1)
    columns = generator.normal(size=(200, 12))
    columns[:, 5] = columns[:, 2] + columns[:, 7] + 0.5 * generator.normal(size=200)
    data = 2.0 * columns[:, 2] + 1.5 * columns[:, 7] + generator.normal(size=200)
    return columns, data


# ---------------------------------------------------------------------- screening
def exact_gain(columns, data, spread):
    """Evidence of Gaussian amplitudes over none, from the dense covariance of the data."""
    covariance = np.eye(len(data)) + spread**2 * columns @ columns.T
    _, log_det = np.linalg.slogdet(covariance)
    return 0.5 * (data @ data - data @ np.linalg.solve(covariance, data)) - 0.5 * log_det


def test_gains_are_those_of_the_marginal_likelihood(problem):
    columns, data = problem
    item = screened(columns, data, spread=1.7)
    singles = item.singles()
    for index in range(12):
        assert singles[index] == pytest.approx(exact_gain(columns[:, [index]], data, 1.7), rel=1e-8)
    for members, gain in item.best(2, 5):
        assert gain == pytest.approx(exact_gain(columns[:, members], data, 1.7), rel=1e-8)


def test_the_true_pair_is_first_though_one_answer_resembles_its_sum(problem):
    columns, data = problem
    item = screened(columns, data, spread=2.0)
    assert item.best(1, 1)[0][0] == (5,)
    members, _ = item.best(2, 3)[0]
    assert members == (2, 7)
    amplitudes = item.amplitudes(members)
    assert [amplitudes[2], amplitudes[7]] == pytest.approx([2.0, 1.5], abs=0.25)


def test_the_best_of_a_size_are_the_best_of_all(problem):
    columns, data = problem
    item = screened(columns, data)
    gains = {pair: exact_gain(columns[:, pair], data, 1.0) for pair in combinations(range(12), 2)}
    ranked = sorted(gains, key=lambda pair: -gains[pair])
    assert [members for members, _ in item.best(2, 6)] == ranked[:6]
    triples = {three: exact_gain(columns[:, three], data, 1.0) for three in combinations(range(12), 3)}
    best = max(triples, key=triples.get)
    assert set(item.best(3, 1)[0][0]) == set(best)


def test_an_amplitude_of_the_wrong_sign_is_not_offered(problem):
    columns, data = problem
    either = screened(columns, -data, keys=None)
    positive = screened(columns, -data, signs=np.ones(12))
    assert {2, 7} <= {members[0] for members, _ in either.best(1, 3)} | {5}
    offered = {members[0] for members, gain in positive.best(1, 12) if np.isfinite(gain)}
    assert not offered & {2, 5, 7}
    # Where it has the right sign, half of the prior counts twice.
    right = screened(columns, data, signs=np.ones(12)).singles()
    assert right[2] == pytest.approx(screened(columns, data).singles()[2] + np.log(2.0))


def test_the_best_of_some_candidates(problem):
    columns, data = problem
    keys = [(f"effect{i}", "ab"[i % 2], "") for i in range(columns.shape[1])]
    found = screened(columns, data, keys=keys)
    singles = found.singles()
    order = [int(i) for i in np.argsort(-singles) if i != 2]
    other = found.best_of(lambda c: c.effect != "effect2", 4)
    assert other == order[:4]
    assert found.best_of(lambda c: c.component == "b", 4) == [i for i in order if i % 2][:4]


def test_forms_of_one_effect_at_one_place_never_come_together(problem):
    columns, data = problem
    keys = [(f"effect{i}", "a", "") for i in range(12)]
    keys[7] = ("effect2", "a", "other form")
    item = screened(columns, data, keys=keys)
    assert all({2, 7} != set(members) for members, _ in item.best(2, 60))
    keys[7] = ("effect2", "b", "")
    assert set(screened(columns, data, keys=keys).best(2, 1)[0][0]) == {2, 7}


def test_each_set_of_effects_and_places_is_offered_once(problem):
    columns, data = problem
    twice = np.column_stack((columns, columns[:, 2] * 1.01))
    keys = [(f"effect{i}", "a", "") for i in range(12)] + [("effect2", "a", "second")]
    found = screened(twice, data, keys=keys).best(1, 13)
    assert len(found) == 12
    sets = screened(twice, data, keys=keys).best(2, 20)
    names = [frozenset(keys[i][:2] for i in members) for members, _ in sets]
    assert len(names) == len(set(names)) == 20


def test_priors_share_the_weight_of_an_effect_evenly():
    own = variants(("x", "a", ""), ("x", "a", "form"), ("x", "b", ""), ("y", "a", ""))
    found = np.exp(log_priors(own, {"x": 1.0, "y": 0.5, "z": 0.5}))
    assert found == pytest.approx([0.125, 0.125, 0.25, 0.25])


@pytest.mark.parametrize("logarithmic", [False, True])
def test_amplitudes_go_back_to_values(logarithmic):
    given = {"logarithmic": logarithmic, "value": 1.0 if logarithmic else 0.0, "low": -1.0, "high": 3.0}
    item = Variant(candidate("x", **given), {})
    assert amplitude_value(item, 0.0) == item.candidate.null
    assert amplitude_value(item, 1.0) == pytest.approx(item.candidate.reference)
    assert amplitude_value(item, 2.0) == pytest.approx(2.25 if logarithmic else 1.0)
    assert amplitude_value(item, 100.0) == 3.0


def test_a_factor_begins_where_its_resistance_is_and_no_further_off_than_a_twentieth():
    item = Variant(candidate("x", logarithmic=True, value=1.0, low=0.0, high=np.inf), {})
    unit = np.log(item.candidate.reference)
    # Of a conductance the first order is one of its resistance.
    assert amplitude_to_begin_from(item, -1.5 / unit) == pytest.approx(1.0 / 2.5)
    assert amplitude_to_begin_from(item, 1.5 / unit) == pytest.approx(2.5)
    assert amplitude_to_begin_from(item, -1e9 / unit) == pytest.approx(np.exp(-tuned.FARTHEST_START))
    assert amplitude_to_begin_from(item, 1e9 / unit) == pytest.approx(np.exp(tuned.FARTHEST_START))
    assert amplitude_value(item, -5000.0) == 0.0  # where a logarithm would begin at minus infinity
    straight = Variant(candidate("x", logarithmic=False, value=0.0, low=-1e6, high=1e6), {})
    assert amplitude_to_begin_from(straight, 5000.0) == amplitude_value(straight, 5000.0)


@pytest.mark.parametrize("true", [0.04, 0.3, 1.02, 6.0])
def test_a_factor_pays_for_its_logarithm_however_far_off_it_is(true):
    item = Variant(candidate("x", logarithmic=True, value=1.0, low=0.0, high=np.inf), {})
    own, unit = amplitude_spread(item), abs(np.log(item.candidate.reference))
    size = max(true, 1.0 / true) - 1.0
    gram = np.array([[1e6]])  # readings that tell the size
    (spread,) = spreads_at_size([item], gram, gram[0] * size / unit)
    deviations = abs(np.log(true)) / unit / own
    assert size / unit / spread == pytest.approx(deviations, rel=1e-3)
    assert is_far_off(item, size / unit) == (abs(np.log(true)) > tuned.FACTOR_FAR_OFF)
    straight = Variant(candidate("x", logarithmic=False, value=0.0), {})
    assert spreads_at_size([straight], gram, gram[0]) == [amplitude_spread(straight)]


def test_the_answer_of_a_lost_contact_is_worth_its_own_size():
    """Once its answer is as far off as the machine was changed, by the prior and to begin from."""
    usual = candidate("x", logarithmic=True, value=1.0, low=0.0, high=np.inf)
    usual.terms[0].__class__ = Seats
    lost = Variant(usual, {usual.amplitude: 0.1})
    assert lost.changes_the_machine
    assert amplitude_to_begin_from(lost, 1.0) == pytest.approx(0.1)
    gram = np.array([[1e6]])
    (spread,) = spreads_at_size([lost], gram, gram[0])
    sigma = usual.parameters[usual.amplitude].sigma
    assert 1.0 / spread == pytest.approx(-np.log(0.1) / sigma, rel=1e-3)


# ------------------------------------------------------------------ missing heat
def answers(time_constant=1500.0, gain=0.05):
    """Readings of a first-order lag to unit heat from each instant on, in units of the noise."""
    since = READ[:, None] - TIMES
    return np.where(since > 0.0, gain * -np.expm1(-since / time_constant), 0.0) / 0.1


def onsets_of(heat, seed=0, noise=1.0):
    """Of heat (40,) W that holds from instant to instant."""
    columns = answers()
    steps = np.diff(heat, prepend=0.0)
    data = columns @ steps + noise * np.random.default_rng(seed).normal(size=READ.size)
    return Onsets(Pattern("housing", ("housing",)), 0, TIMES, columns.T @ columns, columns.T @ data)


def pulses(*intervals, size=60.0):
    heat = np.zeros(COUNT)
    for first, last in intervals:
        heat[first:last] = size
    return heat


def test_heat_over_time_is_found_within_what_it_says_of_itself():
    heat = pulses((10, 18), (25, 32))
    found = explain(onsets_of(heat))
    assert found.log_evidence > 50.0
    # The last instants have hardly been seen yet.
    apart = (found.heat - heat)[:-2] / found.sigma[:-2]
    assert np.sqrt(np.mean(apart**2)) < 1.5
    assert found.heat[12:17] == pytest.approx(60.0, abs=25.0)
    assert np.abs(found.heat[3:8]).max() < 25.0


def test_without_heat_there_is_no_evidence_for_it():
    found = [explain(onsets_of(np.zeros(COUNT), seed)) for seed in range(10)]
    assert max(item.log_evidence for item in found) < 3.0
    assert np.mean([np.abs(item.heat).max() for item in found]) < 15.0


def test_evidence_of_missing_heat_is_that_of_its_covariance():
    onsets = onsets_of(pulses((10, 18)))
    columns, scale = answers(), 100.0
    data = columns @ np.diff(pulses((10, 18)), prepend=0.0) + np.random.default_rng(0).normal(size=READ.size)
    best = max(exact_gain(columns, data, scale) for scale in (1.0, 3.0, 10.0, 30.0, scale))
    assert explain(onsets).log_evidence == pytest.approx(best - np.log(5.0), rel=1e-6)


@pytest.mark.parametrize(
    "intervals", [[(10, 18)], [(5, 12), (22, 30)], [(4, 9), (15, 21), (29, 35)], [(25, 40)]]
)
def test_intervals_of_constant_heat_are_found(intervals):
    options = find_intervals(onsets_of(pulses(*intervals)), 50.0, STOP)
    best = max(options, key=lambda item: item.gain)
    assert len(best.intervals) == len(intervals)
    edges = np.append(TIMES, STOP)
    step = TIMES[1]
    for found, (first, last) in zip(best.intervals, intervals, strict=True):
        assert found == pytest.approx((edges[first], edges[last]), abs=1.01 * step)
    assert best.strength == pytest.approx(60.0, rel=0.15)
    assert [len(item.intervals) for item in options] == list(range(1, len(options) + 1))


def test_intervals_of_noise_do_not_pay():
    for seed in range(10):
        options = find_intervals(onsets_of(np.zeros(COUNT), seed), 50.0, STOP)
        assert max((item.gain for item in options), default=-1.0) < 1.0


def test_cooling_is_not_called_heat():
    options = find_intervals(onsets_of(-pulses((0, 40))), 50.0, STOP)
    assert all(item.gain < 0.0 or not np.isfinite(item.gain) for item in options)


def test_the_gain_of_an_interval_is_its_evidence_less_the_choice():
    onsets = onsets_of(pulses((10, 18)))
    columns = answers()
    data = columns @ np.diff(pulses((10, 18)), prepend=0.0) + np.random.default_rng(0).normal(size=READ.size)
    first = find_intervals(onsets, 50.0, STOP)[0]
    begin, end = (int(np.argmin(np.abs(np.append(TIMES, STOP) - edge))) for edge in first.intervals[0])
    column = columns[:, [begin]] - (columns[:, [end]] if end < COUNT else 0.0)
    exact = exact_gain(column, data, 50.0) + np.log(2.0) - np.log(COUNT * (COUNT + 1) / 2)
    assert first.gain == pytest.approx(exact, rel=1e-6)


# ------------------------------------------------------------------------- words
def test_conditions_follow_speed_and_rate():
    times = np.arange(0.0, 6000.0, 60.0)
    speed = np.where((times >= 600) & (times < 4200), 300.0, 0.0)
    temperature = 293.0 + np.where(times < 600, 0.0, np.minimum(times - 600.0, 1800.0) * 0.01)
    falling = times >= 3600
    temperature = temperature - np.where(falling, (times - 3600.0) * 0.005, 0.0)
    words = conditions_of(times, speed, temperature)
    assert words[3] == "standstill"
    assert words[20] == "heating"
    assert words[50] == "steady running"
    assert words[65] == "cooling"
    assert words[-1] == "standstill"


def test_stretches_are_from_first_to_last():
    times = np.arange(8.0)
    mask = np.array([True, True, False, False, True, False, True, True])
    assert stretches(mask, times) == [(0.0, 1.0), (4.0, 4.0), (6.0, 7.0)]
    assert stretches(np.zeros(8, dtype=bool), times) == []


def test_shares_of_evidence_sum_to_one_whatever_its_level():
    found = shares({"a": -1e5, "b": -1e5 + np.log(3.0)})
    assert found == pytest.approx({"a": 0.25, "b": 0.75})
