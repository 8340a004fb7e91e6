"""Edges of intervals and levels in recordings of months, whose instants and steps are far apart."""

import tomllib

import numpy as np
import pandas as pd
import pytest

from spindle_fem.definition.network_load import validate_network_machine
from spindle_fem.effects.framework.unrecorded import EDGE_WIDTH, PULSES, STEPS, InIntervals
from spindle_fem.effects.registry import definition_entry, effect_of
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.hypothesis_search import Search
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import expected_slow_error, known_before
from spindle_fem.model.lumped.network_view import view_of_network
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.recordings.align import read_recording
from tests.support.written_texts import manifest_text, network_text

MACHINE = network_text(
    "rig",
    {"plate": ("9000 J/K", 0.05)},
    {"plate|ambient": ("2 W/K", 0.05)},
    [("plate", "power", ("1 W/W", 0.05))],
)
DAY, HEAT = 86400.0, 30.0
# Heat at one level, then at twice that.
BEGINS, RISES, ENDS = 3.37 * DAY, 7.81 * DAY, 12.2 * DAY


def searched(folder, days, step):
    """A search on a recording of a plate that is heated at two levels beside its load."""
    fine = np.arange(0.0, days * DAY, 60.0)
    heat = HEAT * ((fine >= BEGINS) + 1.0 * (fine >= RISES) - 2.0 * (fine >= ENDS))
    load = 100.0 * ((fine // 14400.0) % 2)
    rise = np.zeros(fine.size)
    kept = np.exp(-60.0 * 2.0 / 9000.0)
    for i in range(1, fine.size):
        rise[i] = rise[i - 1] * kept + (load[i - 1] + heat[i - 1]) / 2.0 * (1.0 - kept)
    rows = slice(None, None, round(step / 60.0))
    noise = np.random.default_rng(0).normal(0.0, 0.05, fine[rows].size)
    table = {"time_s": fine[rows], "T": 20.0 + rise[rows] + noise, "room": 20.0, "P": load[rows]}
    pd.DataFrame(table).to_csv(folder / "data.csv", index=False)
    text = manifest_text("run", {"T": "plate"}, {"room": "ambient", "P": "power"})
    (folder / "recording.toml").write_text(text)
    recording = read_recording(folder)
    spec = validate_network_machine(tomllib.loads(MACHINE), "rig")
    network = build_network(spec.network)
    predictor = Predictor(fast_network(network, spec), [recording])
    belief, slow = known_before(predictor), expected_slow_error(predictor)
    problem = Problem(predictor, belief, slow, predictor.observations)
    return Search(problem, view_of_network(network, recording), {}, (), (), {})


def test_edges_are_found_between_instants_that_are_hours_apart(tmp_path):
    search = searched(tmp_path, 15.0, 900.0)
    edges, effect = search.edges(0), effect_of("unrecorded_heat_source")
    assert edges["apart"] > 6000.0
    assert edges["blurred"] > EDGE_WIDTH
    # From the nearest instants, as they are sought.
    begun, rises, ends = np.round(np.array([BEGINS, RISES, ENDS]) / edges["apart"]) * edges["apart"]
    spans = [(begun, rises), (rises, ends)]
    candidate = effect.over(search.view, "plate", spans, course=STEPS, sizes=(1.0, 2.0), **edges)
    fit = search.problem.fit((candidate,), {candidate.amplitude: HEAT})
    found = np.ravel(effect.intervals(candidate, fit.values))
    np.testing.assert_allclose(found, [BEGINS, RISES, RISES, ENDS], atol=450.0)
    # What is written has sharp edges.
    entry = definition_entry(candidate, fit.values)
    assert entry["parameters"]["lag"] == f"{EDGE_WIDTH:g} s"


def test_edges_of_short_recordings_stay_as_they_are(tmp_path):
    assert searched(tmp_path, 0.5, 60.0).edges(0) == {"blurred": 0.0, "apart": pytest.approx(360.0, rel=0.01)}
    spans, sought = [(3000.0, 9000.0), (12000.0, 20000.0)], {"blurred": 0.0, "apart": 600.0}
    for course in (PULSES, STEPS):
        assert InIntervals(spans, course, **sought).parameters == InIntervals(spans, course).parameters
    first = InIntervals(spans).parameters[1]
    assert (first.sigma, first.low) == (300.0, 3000.0 - 540.0)
    assert InIntervals(spans, apart=4000.0).parameters[1].low == 3000.0 - 3600.0
