"""Processor time with preload followed over that at the size of assembly: steady states, fast transients.

The reference spindle; pairs one after the other in one process, so that the ratio is that of one load.

Run: ``python benchmarks/growth.py``
"""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path

import numpy as np

from spindle_fem.definition.load import load_machine
from spindle_fem.inference.followed_model import with_followed_preload
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS
from spindle_fem.model.reduced.recorded_model import fast_model_for
from spindle_fem.operation.bearing_heat import at_assembly_size
from spindle_fem.recordings.align import read_recording
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared

MACHINE = ("mesh.preset=coarse",)
MANIFEST = """schema = "spindle-fem/recording/1"
name = "heat-up"
data = "made.csv"
time = {column = "time_s", unit = "s"}
channel = [
    {column = "n", role = "input", drives = "speed", unit = "rpm", hold = "previous"},
    {column = "SP01", role = "temperature", probe = "SP01", unit = "degC", sigma = 0.1},
]
"""
PAIRS = 3


def prepared(follow: bool) -> PreparedMachine:
    """The machine on its mesh."""
    chosen = f"heat.thermal_preload={str(follow).lower()}"
    return prepare_machine(load_machine("wu_tan_2016", [*MACHINE, chosen]))


def seconds(machine: PreparedMachine, find_fold: bool) -> float:
    """Processor time of one solve."""
    begin = time.process_time()
    solve_prepared(machine, find_fold=find_fold)
    return time.process_time() - begin


def fast_pair() -> tuple[Predictor, Predictor]:
    """The fast model on four hours of heat-up and idling, without and with preload followed."""
    spec = load_machine("wu_tan_2016", MACHINE)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        times = np.arange(0, 14401, 60)
        rows = [f"{t},{3000 if t < 9000 else 1000},20" for t in times]
        (place / "made.csv").write_text("\n".join(("time_s,n,SP01", *rows)))
        (place / "recording.toml").write_text(MANIFEST)
        recording = read_recording(place)
    assembled = fast_model_for(at_assembly_size(spec), [recording], as_given=True)
    followed, _ = with_followed_preload(spec, assembled, [recording], NO_EFFECTS)
    plain, coupled = (Predictor(fast, [recording], at_stamps=True) for fast in (assembled, followed))
    return plain, coupled


def run_seconds(predictor: Predictor) -> float:
    """Processor time of one run."""
    begin = time.process_time()
    predictor.predict(0, {})
    return time.process_time() - begin


def main() -> None:
    """Print one line for a state alone and one with the search for the fold."""
    plain, followed = prepared(follow=False), prepared(follow=True)
    seconds(plain, find_fold=False)  # compiled and cached things are made once
    for find_fold in (False, True):
        pairs = [(seconds(plain, find_fold), seconds(followed, find_fold)) for _ in range(PAIRS)]
        without, coupled = np.median(pairs, axis=0).round(2).tolist()
        line = {"fold": find_fold, "plain_s": without, "coupled_s": coupled}
        print(json.dumps(line | {"ratio": round(coupled / without, 2)}))
    one, other = fast_pair()
    for predictor in (one, other):
        run_seconds(predictor)
    pairs = [(run_seconds(one), run_seconds(other)) for _ in range(PAIRS)]
    without, coupled = np.median(pairs, axis=0).round(3).tolist()
    line = {"fast": True, "plain_s": without, "coupled_s": coupled}
    print(json.dumps(line | {"ratio": round(coupled / without, 2)}))


if __name__ == "__main__":
    main()
