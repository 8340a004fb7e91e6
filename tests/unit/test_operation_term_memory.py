"""What terms remember, all steps at once, against one step after the other."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.effects.catalogue.gap_closure import GapClosureTerm
from spindle_fem.effects.catalogue.starvation import StarvationTerm
from spindle_fem.effects.catalogue.thermal_preload import PreloadMechanicsTerm, ThermalPreloadTerm
from spindle_fem.effects.framework.term import Term, TermParameter
from spindle_fem.operation.effect_terms import Derivatives, EffectTerms, Instants
from spindle_fem.operation.term_memory import carried, remembered
from tests.support.set_response import set_response

STEPS = 80
GAP = 33


class Bent(Term):
    """Memory that follows itself along no straight line, and turns where it is large."""

    name = "bent"
    parameters = (TermParameter("rate", 0.03, 0.5),)
    reads = ("housing",)
    n_states = 2

    def initial_state(self, parameters):
        return np.array([0.2, 1.0])

    def advance(self, context, step):
        first, second = context.state
        grown = first + step * context.parameters["rate"] * 0.1 * first * (1.0 - first)
        pulled = np.where(first.real > 0.6, 0.5 * second, second + 0.01 * (context.temperatures[0] - 300.0))
        return np.array([grown, pulled])


TERMS = {
    "over start": GapClosureTerm("gap", ("seat",), ("a", "b"), ()),
    "over housing": GapClosureTerm("gap", ("seat",), ("a", "b"), ("c",)),
    "ring by ring": GapClosureTerm("gap", ("seat", "spacer"), ("a", "b"), ("c",), ((0,), (0, 1))),
    "preload": ThermalPreloadTerm("preload", ("A",), ("a",), ("b",)),
    "mechanics": PreloadMechanicsTerm(
        "mechanics", ("a",), ("b",), set_response(("A",), {"c": 0.9e-6}, {"d": 0.4})
    ),
    "starvation": StarvationTerm("dry", ("A",), "speed", 300.0),
    "bent": Bent(),
}


@pytest.fixture(scope="module")
def inputs():
    random = np.random.default_rng(3)
    lengths = random.choice((20.0, 60.0), STEPS)
    times = np.concatenate(([0.0], np.cumsum(lengths)))
    speed = np.repeat(random.choice((0.0, 150.0, 290.0), STEPS // 8), 8)
    sensed = 300.0 + np.cumsum(random.normal(0.0, 0.3, (STEPS, 4)), axis=0)
    return times[:-1], lengths, {"speed": speed, "thrust": np.zeros(STEPS)}, sensed


def both(term, inputs):
    """Memories and derivatives to what is sensed, to them and to parameters: at once, and one by one."""
    times, lengths, given, sensed = inputs
    sensed = sensed[:, : len(term.reads)]
    terms = EffectTerms((term,), {}, tuple(term.names()))
    held = np.array([GAP])
    memory, moves = remembered(terms, Instants(times, given), lengths, sensed, Derivatives.ALL, held=held)
    expected = np.zeros((STEPS + 1, term.n_states))
    expected[0] = term.initial_state(term.values({}))
    slopes = np.zeros((STEPS, term.n_states, moves.by.shape[2]))
    for step in range(STEPS):
        if step == GAP:
            expected[step + 1] = expected[step]
            slopes[step, :, terms.n_sensed : terms.n_sensed + terms.n_states] = np.eye(term.n_states)
            continue
        at = Instants(float(times[step]), {name: float(column[step]) for name, column in given.items()})
        one = terms.advance(at, float(lengths[step]), sensed[[step]], expected[[step]])
        expected[step + 1], slopes[step] = one.value[0], one.by[0]
    return (memory, moves.by), (expected, slopes)


@pytest.mark.parametrize("name", TERMS)
def test_memories_are_those_of_one_step_after_the_other(name, inputs):
    found, expected = both(TERMS[name], inputs)
    assert np.ptp(expected[0], axis=0).max() > 0.01
    for one, other in zip(found, expected, strict=True):
        assert np.abs(one - other).max(initial=0.0) <= 1e-9 * (1.0 + np.abs(other).max(initial=0.0))


def test_departures_are_carried_on():
    random = np.random.default_rng(5)
    by_state, added = random.normal(0.0, 0.5, (STEPS, 3, 3)), random.normal(size=(STEPS, 3, 2))
    expected = np.zeros((STEPS + 1, 3, 2))
    for step in range(STEPS):
        expected[step + 1] = by_state[step] @ expected[step] + added[step]
    assert carried(by_state, added) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert carried(by_state[:, :0, :0], added[:, :0]).shape == (STEPS + 1, 0, 2)
