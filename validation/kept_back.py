"""Improved machines held against further runs: ``python -m validation.kept_back STUDY RESULTS``.

For a finished study of roughly known spindles (:mod:`validation.generate_rough`). Every case whose first set
is right, or that is consistent, is drawn anew; the same machine with the same effects runs through another
cycle, recorded by the same sensors every 15 s on one clock into ``RESULTS/kept_back/inputs``: what rows and
clocks of a recording leave open is not the machine's. The ``improved_machine.toml`` that the
diagnosis left is simulated over it, nothing fitted. Its error about what the sensors would show without noise
and faults of rows, together with their noise, is held against noise and structure of the case. Left out are
effects that a further run does not repeat: they belong to the hours of one recording.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .generate import plan_for
from .generate_rough import Drawn, draw_case, machines
from .recorder import Logger, record
from .score import first_right
from .score_families import accepted

# Phases, rooms, drifts and hours of what comes and goes are another recording's.
ONCE = ("chiller_cycling", "ambient_drift", "sensor_drift")
OTHER_RUN, STEP_S = 17, 15.0
# Times, s, and what every channel shows without noise, (n, channels) K.
Shown = tuple[np.ndarray, np.ndarray]


def repeats(answer: dict[str, Any]) -> bool:
    """Whether another run of the machine shows the same effects."""
    return not any(e["effect"] in ONCE or e.get("intervals") for e in answer["effects"])


def write_other_run(folder: Path, case: Drawn, seed: int, number: int) -> Shown:
    """Record another cycle of a case's machine; its times in s and what sensors show without noise, K."""
    rng = np.random.default_rng((seed, number, OTHER_RUN))
    plan = plan_for(case.wanted, rng)
    readings = case.readings(plan)
    logger = Logger((STEP_S,), case.logger.channels)
    record(folder, "recording", folder.name, plan, readings, case.sensors, rng, logger)
    return plan.drive.time, readings


def left_by(machine: Path, inputs: Path, case: Drawn, shown: Shown, work: Path) -> float:
    """RMS in K, over all channels, of a machine's error in a recorded run."""
    from spindle_fem.commands.simulate_command import simulate_machine

    simulate_machine(machine, inputs / "recording.toml", work, overrides=("mesh.preset=coarse",))
    predicted = pd.read_csv(work / "simulated.csv")
    times, readings = shown
    errors = [
        predicted[name] - np.interp(predicted["time_s"], times, readings[:, channel])
        for name, channel in zip(case.logger.names, case.logger.channels, strict=True)
    ]
    return float(np.sqrt(np.mean(np.square(errors))))


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("--cache", type=Path, default=None, help="folder of the reduced machines")
    given = parser.parse_args(arguments)
    drawn = json.loads((given.study / "study.json").read_text(encoding="utf-8"))
    nominal, pool = machines(drawn["seed"], drawn["shapes"], given.cache)
    work, rows = given.results / "kept_back", []
    for path in sorted((given.study / "answers").glob("*.json")):
        improved = given.results / path.stem / "improved_machine.toml"
        if not improved.exists():
            continue
        answer = accepted(json.loads(path.read_text(encoding="utf-8")))
        told = json.loads((improved.parent / "diagnosis.json").read_text(encoding="utf-8"))
        if not (repeats(answer) and first_right(answer, told["findings"])):
            continue
        number = int(path.stem.rpartition("_")[2])
        inputs = work / "inputs" / path.stem
        case = draw_case(nominal, pool, drawn["seed"], number)
        shown = write_other_run(inputs, case, drawn["seed"], number)
        sensor, structure = case.noise_and_structure_K
        before, left = (
            float(np.hypot(sensor, left_by(machine, inputs, case, shown, work / path.stem)))
            for machine in (Path("recorded_spindle"), improved)
        )
        total = float(np.hypot(sensor, structure))
        rows.append({"case": path.stem, "before_K": before, "left_K": left, "over_noise": left / total})
        print(f"{path.stem} {before:.2f} > {left:.2f} K, {left / total:.2f} x noise", flush=True)
    ratios = [row["over_noise"] for row in rows]
    print(f"{len(rows)} machines: {np.median(ratios):.2f} x noise and structure in the median")
    (work / "kept_back.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
