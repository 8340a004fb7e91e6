"""The paper's riddle: a model that is worst at 2000 and 2500 rpm, thermal preload and lubrication blamed.

``python -m validation.riddle write DIR`` builds that machine with the independent model: a step
test from 0 to 4500 rpm by 500, with preload that grows with the warmth of the inner rings *and* a
film that is no longer replenished above a speed, as-built values and noise drawn from a seed. The
inputs go to ``DIR/inputs/riddle``, the answer to ``DIR/answers/riddle.json``.

``diagnose`` reads the inputs alone; ``report`` holds what was found against the answer and gives
the error before and after at every speed.
"""

import argparse
import csv
import gzip
import json
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import laws
from .concealed_effect import Concealed
from .cycles import STEP, Plan
from .generate import effect_answer, judge, what_is_known
from .identify import Study
from .machine import CHANNELS
from .recorder import draw_noise, record
from .reduction import ReducedSpindle, load_reduced
from .stepping import Drive, draw_as_built, run

SPEEDS_RPM = tuple(range(0, 4501, 500))
WORST_RPM = (2000, 2500)
NAME = "riddle"
_HOLD_S, _REST_S, _COOL_S = 4500.0, 900.0, 3600.0
_THRUST_N = 1750.0
_FRONT = ["F1", "F2", "F3", "front_bearings"]


def step_test(rng: np.random.Generator, hold: float = _HOLD_S) -> Drive:
    """Step test of the paper with a room that drifts a little and a chiller that holds 15 °C."""
    spans = [_REST_S, *[hold] * (len(SPEEDS_RPM) - 1), _COOL_S]
    levels = [*SPEEDS_RPM, 0]
    counts = [round(span / STEP) for span in spans]
    speed = np.repeat(np.array(levels, dtype=float), counts)
    time = np.arange(speed.size) * STEP
    swing = np.sin(2 * np.pi * time / rng.uniform(15_000, 30_000) + rng.uniform(0, 2 * np.pi))
    ambient = rng.uniform(17.0, 19.0) + rng.normal(0.0, 0.8) * time / time[-1] + 0.3 * swing
    coolant = 15.0 + 0.1 * np.sin(2 * np.pi * time / 4000.0)
    return Drive(time, speed, np.where(speed > 0, _THRUST_N, 0.0), ambient, coolant)


def concealed_effects() -> list[Concealed]:
    """Thermal preload and a film that fails, both at the front bearings.

    Preload raises the friction as the inner rings outgrow the outer ones. Above 2700 rpm grease no
    longer flows back into the track: less of it is churned and rolled over, and friction falls.
    The sum of both is largest in between.
    """
    preload = {"width": 1.2, "exponent": 1.1, "delay": 400.0, "onset": 0.0}
    film = {"width": 80.0, "delay": 300.0, "growth": 0.0}
    amplitude, change, onset = 0.045, -0.45, 2700.0
    return [
        Concealed(
            "thermal_preload",
            "front_bearings",
            list(_FRONT),
            amplitude,
            laws.ThermalPreload("F", amplitude, **preload),
            form=preload,
        ),
        Concealed(
            "starvation",
            "front_bearings",
            list(_FRONT),
            change,
            laws.Starvation("F", change, onset, **film),
            parameters={"onset_speed": (onset, "rpm")},
            form=film,
        ),
    ]


def write(folder: FilePath, seed: int, *, model: ReducedSpindle, calibrated: bool = False) -> dict[str, Any]:
    """Write inputs and answer; return the answer.

    ``calibrated`` adds an earlier run of the same machine, run-in at one speed and without either effect.
    """
    rng = np.random.default_rng([seed, 2016])
    as_built, noise = draw_as_built(rng), draw_noise(rng)
    plan = Plan("step test", "constant", step_test(rng))
    earlier = Plan("step test", "constant", step_test(rng, hold=1200.0)) if calibrated else None
    effects = concealed_effects()
    machine = tuple(effect.machine for effect in effects)
    truth = run(model, plan.drive, as_built, machine).readings
    plain = run(model, plan.drive, as_built).readings
    inputs = folder / "inputs" / NAME
    rows = {"recording": record(inputs, "recording", NAME, plan, truth, noise, rng)}
    if earlier is not None:
        clean = run(model, earlier.drive, as_built).readings
        rows["calibration"] = record(inputs, "calibration", f"{NAME} calibration", earlier, clean, noise, rng)
    known = what_is_known(Study(model, plan, earlier, as_built, noise), effects)
    answer = {
        "schema": "spindle-fem/answer/1",
        "case": NAME,
        "seed": seed,
        "two_recordings": calibrated,
        "noise": noise.answer(),
        "as_built": {key: round(value, 4) for key, value in as_built.items()},
        "identifiability": known,
        **judge(effects, known, calibrated),
        "effects": [effect_answer(effect) for effect in effects],
        "left_out_K": by_speed(plan.drive.time, plan.drive.speed, truth - plain),
        "cycle": plan.cycle,
        "oil": plan.oil,
        "rows": rows,
    }
    (folder / "answers").mkdir(parents=True, exist_ok=True)
    path = folder / "answers" / f"{NAME}.json"
    path.write_text(json.dumps(answer, indent=1), encoding="utf-8")
    return answer


def by_speed(
    time: NDArray[np.float64], speed: NDArray[np.float64], error: NDArray[np.float64], last: float = 1200.0
) -> list[dict[str, Any]]:
    """Error over the last part of every step up, where the probes have nearly settled.

    Parameters
    ----------
    time, speed : (n,) ndarray, [s], [rpm]
    error : (n, m) ndarray, [K]
        NaN where a channel has no reading.
    last : float, [s]

    Returns
    -------
    list of dict
        ``speed_rpm``, ``rms_K`` over all channels, ``mean_K`` over them, and ``channels_K``, the mean
        of each, None where it has no reading.
    """
    rows = []
    peak = int(np.argmax(speed))
    stop = (
        peak + int(np.argmax(speed[peak:] < speed[peak]))
        if (speed[peak:] < speed[peak]).any()
        else len(speed)
    )
    for level in SPEEDS_RPM:
        here = np.flatnonzero(np.abs(speed[:stop] - level) < 1.0)
        if here.size == 0:
            continue
        window = here[time[here] >= time[here[-1]] - last]
        part = error[window]
        rows.append(
            {
                "speed_rpm": float(level),
                "rms_K": float(np.sqrt(np.nanmean(part**2))),
                "mean_K": float(np.nanmean(part)),
                "channels_K": [_mean(values) for values in part.T],
            }
        )
    return rows


def _mean(values: NDArray[np.float64]) -> float | None:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else None


def _columns(path: FilePath) -> dict[str, NDArray[np.float64]]:
    packed = path.read_bytes()
    text = (gzip.decompress(packed) if path.suffix == ".gz" else packed).decode("utf-8")
    header, *rows = list(csv.reader(text.splitlines()))
    table = np.array([[float(cell) if cell else np.nan for cell in row] for row in rows])
    return dict(zip(header, table.T, strict=True))


def errors_by_speed(inputs: FilePath, simulated: FilePath) -> list[dict[str, Any]]:
    """Reading minus model at every speed, for a ``before.csv``, ``after.csv`` or ``simulated.csv``."""
    read, model = _columns(inputs / "recording.csv.gz"), _columns(simulated)
    stamps, first = np.unique(read["time_s"], return_index=True)
    stamps = stamps - stamps[0]
    both, mine, theirs = np.intersect1d(stamps, model["time_s"], return_indices=True)
    read = {name: values[first][mine] for name, values in read.items()}
    error = np.stack([read[name] - model[name][theirs] for name in CHANNELS], axis=1)
    error[np.abs(error - np.nanmedian(error, axis=0)) > 15.0] = np.nan
    return by_speed(both, read["speed"], error)


def diagnose_riddle(folder: FilePath, result: FilePath, mesh: str, *, report: bool) -> dict[str, Any]:
    """Diagnose from the inputs alone."""
    from spindle_fem.commands.diagnose_command import diagnose, diagnose_without_report

    inputs = folder / "inputs" / NAME
    calibration = inputs / "calibration.toml"
    return (diagnose if report else diagnose_without_report)(
        "recorded_spindle",
        [inputs / "recording.toml"],
        result,
        calibrate=[calibration] if calibration.exists() else [],
        overrides=(f"mesh.preset={mesh}",),
    )


def held_against_answer(folder: FilePath, result: FilePath) -> dict[str, Any]:
    """Errors by speed before and after, and the score of what was named."""
    from .score import score_case

    answer = json.loads((folder / "answers" / f"{NAME}.json").read_text(encoding="utf-8"))
    diagnosis = json.loads((result / "diagnosis.json").read_text(encoding="utf-8"))
    inputs = folder / "inputs" / NAME
    return {
        "score": score_case(answer, diagnosis, None),
        "left_out": answer["left_out_K"],
        "before": errors_by_speed(inputs, result / "before.csv"),
        "after": errors_by_speed(inputs, result / "after.csv"),
    }


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m validation.riddle", description=__doc__)
    parser.add_argument("step", choices=["write", "diagnose", "report"])
    parser.add_argument("folder", type=FilePath)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--calibrated", action="store_true", help="an earlier run of the machine too")
    parser.add_argument("--mesh", default="coarse", choices=["coarse", "normal", "fine"])
    parser.add_argument("--cache", type=FilePath, default=None, help="folder of the reduced machine")
    given = parser.parse_args(arguments)
    result = given.folder / "results" / NAME
    if given.step == "write":
        answer = write(given.folder, given.seed, model=load_reduced(given.cache), calibrated=given.calibrated)
        for row in answer["left_out_K"]:
            print(f"{row['speed_rpm']:6.0f} rpm  left out {row['rms_K']:.2f} K")
    elif given.step == "diagnose":
        found = diagnose_riddle(given.folder, result, given.mesh, report=True)
        print(found["verdict"], [f"{f['effect']}@{f['component']}" for f in found["findings"]])
    else:
        held = held_against_answer(given.folder, result)
        for before, after in zip(held["before"], held["after"], strict=True):
            print(f"{before['speed_rpm']:6.0f} rpm  {before['rms_K']:.2f} K -> {after['rms_K']:.2f} K")


if __name__ == "__main__":
    main()
