"""How experience lowers what evidence says of a set, and what that leaves of the verdict."""

import pytest

from spindle_fem.inference.reliability import gain_of_more, reliable, share_of_last
from spindle_fem.inference.verdict import DOUBTED_REASON
from tests.support.made_hypotheses import OFFSET, PRELOAD, candidate, hypothesis, verdict


def test_a_small_last_effect_makes_a_set_less_reliable():
    null, one = hypothesis(misfit=4400.0), hypothesis(PRELOAD, misfit=600.0)
    other = hypothesis(candidate("windage", "shaft"), misfit=3000.0)
    pair = hypothesis(PRELOAD, OFFSET, misfit=400.0)
    assert share_of_last([null, one, other, pair], pair) == pytest.approx(200.0 / 4000.0)
    assert share_of_last([null, one, other, pair], one) == 1.0
    # Nothing smaller was fitted but nothing itself: all of the gain is the set's.
    assert share_of_last([null, pair], pair) == 1.0
    assert gain_of_more([null, one, other, pair], one) == pytest.approx(
        0.5 * (one.fit.misfit_with_prior - pair.fit.misfit_with_prior)
    )
    assert gain_of_more([null, one, other, pair], pair) == 0.0
    assert reliable(0.999, 1.0, more=50.0) < reliable(0.999, 1.0)
    assert reliable(0.999, 0.05) < reliable(0.999, 0.5) < reliable(0.999, 1.0) < 0.999


@pytest.mark.parametrize("probability", [0.02, 0.3, 0.6, 0.9, 0.99, 1.0])
def test_experience_only_lowers_what_evidence_says(probability):
    found = [reliable(probability, share) for share in (0.0, 0.1, 1.0)]
    assert all(0.0 < value <= probability for value in found)


def test_what_experience_takes_goes_to_something_else():
    found = verdict(
        hypothesis(misfit=1400.0),
        hypothesis(PRELOAD, misfit=400.0),
        hypothesis(candidate("windage", "shaft"), misfit=404.0),
        calibrated=True,
    )
    stated = [found.chosen.probability, *(item.probability for item in found.alternatives), found.other]
    assert sum(stated) == pytest.approx(1.0)
    assert found.chosen.probability == pytest.approx(reliable(found.evidence, 1.0))


@pytest.mark.parametrize(("member", "expected"), [(PRELOAD, "missing_physics"), (OFFSET, "ambiguous")])
def test_a_doubted_set_leaves_no_doubt_that_physics_is_missing(monkeypatch, member, expected):
    monkeypatch.setattr("spindle_fem.inference.verdict.reliable", lambda *_: 0.4)
    found = verdict(hypothesis(misfit=1400.0), hypothesis(member, misfit=400.0, position=(0.0, 2.5)))
    assert (found.verdict, found.reason) == (expected, DOUBTED_REASON)
    assert found.chosen.probability == pytest.approx(0.4)
