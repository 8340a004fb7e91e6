"""The lumped spindle with a recording that differs from it in a known way, fitted."""

from dataclasses import replace

import numpy as np
import pandas as pd

from spindle_fem.definition.load import load_machine
from spindle_fem.effects.registry import candidates_for, effect_of
from spindle_fem.inference.diagnosis import Diagnosis
from spindle_fem.inference.hypothesis import Hypothesis, Ranked
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.missing_heat import Pattern, explain, onset_answers
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import (
    EXPECTED_SLOW,
    calibrate,
)
from spindle_fem.inference.verdict import Judgement
from spindle_fem.machine.view.build_view import view_of
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.recordings.align import read_recording
from tests.support.lumped_spindle import lumped_model

PROBES = ("SP01", "SP02", "SP03", "SP04", "SP05", "COOLANT_OUT")
MANIFEST = """
schema = "spindle-fem/recording/1"
name = "steps"
data = "steps.csv"
time = {column = "t", unit = "s"}
[[channel]]
column = "speed"
role = "input"
hold = "previous"
drives = "speed"
unit = "rpm"
[[channel]]
column = "ambient"
role = "input"
drives = "ambient"
unit = "degC"
"""
CHANNEL = """
[[channel]]
column = "%s"
role = "temperature"
probe = "%s"
unit = "degC"
sigma = 0.1
"""
TIMES = np.arange(0.0, 10800.0, 30.0)
RUNS, STOPS = 1800.0, 8100.0
FROM, UNTIL, HEAT = 3000.0, 6000.0, 200.0


def written(folder, temperatures):
    columns = {
        "t": TIMES,
        "speed": np.where((TIMES >= RUNS) & (TIMES < STOPS), 3000.0, 0.0),
        "ambient": np.full(TIMES.size, 20.0),
    }
    columns |= {name: temperatures[:, column] for column, name in enumerate(PROBES)}
    pd.DataFrame(columns).to_csv(folder / "steps.csv", index=False)
    text = MANIFEST + "".join(CHANNEL % (name, name) for name in PROBES)
    (folder / "steps.toml").write_text(text, encoding="utf-8")
    return read_recording(folder / "steps.toml")


class Case:
    """A lumped spindle, and recordings of it with one effect more."""

    def __init__(self, folder):
        self.folder = folder
        self.spec = load_machine("recorded_spindle")
        model = lumped_model(self.spec)
        slopes = np.zeros((len(model.probe_names), 2, model.size))
        model = replace(
            model,
            probe_gradients=slopes,
            place_names=(*model.place_names, *(f"near.{name}" for name in model.probe_names)),
            places=np.vstack((model.places, model.probes)),
        )
        self.fast = fast_spindle(model, self.spec)
        self.blank = written(folder, np.tile(20.0, (TIMES.size, len(PROBES))))
        self.view = view_of(self.fast.names, self.blank)
        self.candidates = {(c.effect, c.component): c for c in reversed(candidates_for(self.view))}
        heat = effect_of("unrecorded_heat_source").over(self.view, "front_bearings", [(FROM, UNTIL)])
        self.candidates[heat.effect, heat.component] = heat

    def diagnosis(self, truth, amplitude, verdict, rivals):
        """Fits and judgement about a recording with an effect, as the search would hand them on."""
        candidate = self.candidates[truth] if truth else None
        predictor = Predictor(self.fast, [self.blank], [np.ones(TIMES.size, dtype=bool)])
        values, chosen = {}, ()
        if candidate is not None:
            factors = {item.name for item in candidate.factors}
            name = candidate.amplitude
            values, chosen = {f"effect:{name}" if name in factors else name: amplitude}, (candidate,)
        on_grid = predictor.predict(0, values, chosen).temperature
        true = np.array([np.interp(TIMES, predictor.drives[0].grid, column) for column in on_grid.T]).T
        noise = np.random.default_rng(7).normal(0.0, 0.1, true.shape)
        recording = written(self.folder, true - 273.15 + noise)
        held = (TIMES > 4000.0) & (TIMES < 5000.0)
        predictor = Predictor(self.fast, [recording], [~held])
        calibrated = calibrate(None, predictor)
        problem = Problem(predictor, calibrated.belief, EXPECTED_SLOW, predictor.observations)
        sets = [(self.candidates[key],) for key in ((truth,) if truth else ()) + rivals]
        null = problem.fit()
        found = [Hypothesis(problem.fit(members), -3.0) for members in sets]
        hypotheses = (*found, Hypothesis(null, -1.0))
        shares = [1.0] if not rivals else [0.6, 0.4]
        ranked = [Ranked(item, share) for item, share in zip(found, shares, strict=False)]
        best = ranked[0] if ranked else Ranked(hypotheses[-1], 1.0)
        judgement = Judgement(verdict, 0.5 if not truth else 1e-6, best, tuple(ranked[1:]), 0.0, "")
        patterns = [Pattern(spot, places) for spot, places in self.view.spots.items()]
        tracks = [explain(item) for item in onset_answers(problem, null, patterns, 0)]
        return Diagnosis(
            predictor,
            predictor,
            self.view,
            calibrated,
            hypotheses,
            judgement,
            null,
            best.fit,
            tuple(tracks),
            "from 4000 s to 5000 s",
            len(self.candidates),
            {},
        )


DRY_BEARING, DRY_SET = ("starvation", "F2"), ("starvation", "front_bearings")
LOOSE, SEAT = ("sensor_detached", "SP02"), ("joint_conductance", "F2")
EVIDENCE = {
    frozenset((DRY_BEARING, LOOSE)): -60.0,
    frozenset((DRY_BEARING, LOOSE, SEAT)): -40.0,
    frozenset((DRY_SET, LOOSE, SEAT)): -15.0,
    frozenset((DRY_SET, LOOSE)): -10.0,
}
