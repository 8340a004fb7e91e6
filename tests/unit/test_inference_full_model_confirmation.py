"""What the full model's word on a set does to its probability."""

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.inference import tuned
from spindle_fem.inference.full_model_confirmation import left_by_both, with_confirmation

NOISE = 0.1
TIMES = np.linspace(0.0, 1.0, 400)
READ = 300.0 + 10.0 * TIMES[:, None] + NOISE * np.random.default_rng(0).standard_normal((400, 1))
# Nothing missing lacks up to 2 K of what was read; the set has all of it.
BEFORE, AFTER = ([300.0 + size * TIMES[:, None]] for size in (8.0, 10.0))
FAST = {"before": BEFORE, "after": AFTER}


def left(full, least_share=0.0):
    recording = SimpleNamespace(
        temperature_count=1,
        temperature=READ,
        usable=np.ones(READ.shape, dtype=bool),
        sigma=np.array([NOISE]),
        noise=(SimpleNamespace(resolution=0.0),),
    )
    predictor = SimpleNamespace(recordings=(recording,), use=(np.ones(len(TIMES), dtype=bool),))
    return left_by_both(predictor, FAST, full, least_share)


def meshed(before, after):
    return {"before": [BEFORE[0] + before], "after": [AFTER[0] + after]}


def content(fast, full):
    return {
        "verdict": "parameter",
        "reason": "",
        "set_probability": 0.8,
        "something_else_probability": 0.2,
        "findings": [{"effect": "coolant_bypass", "probability": 0.8}],
        "fit": {"full_model": {"left": {"fast": fast, "full": full}}},
    }


def test_a_mesh_that_reads_apart_alike_with_and_without_the_set_confirms_it():
    fast, full = left(meshed(0.4, 0.4))
    assert full == pytest.approx(fast)
    assert fast < 1.0
    assert with_confirmation(content(fast, full)) == content(fast, full)


def test_a_change_that_is_off_by_no_more_than_temperatures_are_says_nothing():
    """Both models are apart by a tenth of the rise with nothing missing, and of the change."""
    fast, full = left({"before": [BEFORE[0] + 0.8 * TIMES[:, None]], "after": [AFTER[0] + TIMES[:, None]]})
    assert max(fast, full) < 1.0


def test_a_mesh_tells_a_change_no_better_than_its_elements_do():
    """Temperatures agree with nothing missing, the change is 0.3 K too small of 2 K."""
    short = {"before": BEFORE, "after": [AFTER[0] - 0.3 * TIMES[:, None]]}
    (fast, told), (_, blamed) = left(short, 0.15), left(short)
    assert fast < told < 1.05
    assert blamed > 1.5 * told


def test_a_set_that_does_on_the_mesh_what_nothing_missing_does_is_not_confirmed():
    fast, full = left({"before": BEFORE, "after": BEFORE})
    assert fast < 1.0 < tuned.MOST_LEFT < full
    found = with_confirmation(content(fast, full))
    assert found["verdict"] == "unexplained"
    assert "does not confirm" in found["reason"]
    assert found["set_probability"] == found["findings"][0]["probability"] < 0.3
    assert found["set_probability"] + found["something_else_probability"] == pytest.approx(1.0)


def test_what_the_full_model_leaves_lowers_the_probability_as_what_the_fast_one_leaves_does():
    found = with_confirmation(content(1.0, 1.5))
    # The odds of something else are the square of the excess: 0.25 to one.
    assert found["set_probability"] == pytest.approx(0.8 / 1.25)
    assert found["verdict"] == "parameter"
    # What the fast model leaves is in the probability already; a better word raises nothing.
    assert with_confirmation(content(1.5, 1.5))["set_probability"] == 0.8
    assert with_confirmation(content(1.5, 1.0))["set_probability"] == 0.8


def test_without_a_run_of_the_full_model_nothing_changes():
    bare = content(1.0, 3.0) | {"fit": {"full_model": {"mesh": "off", "reason": "It was not asked for."}}}
    assert with_confirmation(bare) is bare
