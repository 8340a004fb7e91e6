"""Concealed cases whose truth is preload coupled to temperatures by mechanics of its own (``ball_set``).

``python -m validation.generate_coupled --cases 40 --seed 91 -o DIR`` writes inputs and answers as
``validation.generate`` does. The outer rings of one set have a clearance of 5 to 30 µm; its friction
follows the ball loads, step by step. Half of the cases have a displacement sensor that sees the nose, every
fifth conceals nothing. Each case has a ``machine.toml``: the recorded spindle, and the sensor.
"""

import gzip
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray

from . import machine as m
from .ball_set import (
    ASSEMBLED_AT,
    FRONT,
    POISSON,
    REAR,
    YOUNG,
    BallSet,
    Warmth,
)
from .concealed_effect import Concealed
from .cycles import Plan, draw_drive
from .generate import effect_answer, judge, what_is_known
from .identify import Study
from .laws import SETS, HeatShape, Law
from .recorder import draw_noise, record
from .reduction import ReducedSpindle, load_reduced
from .stepping import Moment, Path, draw_as_built, run
from .study_writer import study_options, write_study

PRELOAD = 1137.2
# Largest factor on the friction of a bearing that a case is drawn for.
LARGEST = (1.12, 1.9)
# Share of the friction that follows the load: to begin with, at most; tries to find it.
SHARE, MOST_SHARE, TRIES = 0.3, 0.85, 8
# Power of the speed with which friction that does not follow the load rises over that which does: none where
# contacts rub, 2/3 by Palmgren (viscous moment over that of the load); share at this speed, rpm.
VISCOUS, AT, SLOWEST = (0.0, 2.0 / 3.0), 3000.0, 0.1
# Growth of the housing over that of its drawing and temperatures. Under a thin ring (4.4e-12 m/Pa) a seat
# gives 0.7e-12 m/Pa alone, with its neighbours pressed as well up to 1.4e-12.
WALL, YIELDING = (0.8, 1.2), (0.12, 0.25)
# Share by which heat over speed is off what its table says, highest speed of that in rpm.
TABLE, HIGHEST, SETS_OF_BEARINGS = 0.05, 4500.0, ("F", "R")
# s; ball loads are worked out anew this often.
EVERY = 60.0
PLACES = {"F": (0.057, 0.081, 0.125), "R": (0.441, 0.473)}
SIDES = {"F": (1, 1, -1), "R": (1, -1)}
NAMES = {"F": ["F1", "F2", "F3", "front_bearings"], "R": ["R1", "R2", "rear_bearings"]}
SPACER = {"F": "mean:front_spacer.inner", "R": "mean:rear_spacer.inner"}
DENSITY = 7850.0
# Segments of the shaft from the nose to F3 that a turning shaft shortens: length, bore, outside in m.
TURNING = ((0.045, 0.030, 0.090), (0.080, 0.030, 0.070))
# µm; of the displacement sensor.
WHITE, ROUNDING = 0.3, 0.1
SENSOR = """schema = "spindle-fem/machine/1"
base = "recorded_spindle"
name = "recorded_spindle"
"""
LOOK = """
[[displacement_sensor]]
name = "S1"
at = {z = "0 mm", radius = "60 mm", angle = "0 deg"}
direction = "axial"
mount = "flange"
"""
CHANNEL = """
[[channel]]
column = "S1"
role = "displacement"
probe = "S1"
unit = "um"
sigma = 0.3
"""


@dataclass(slots=True)
class CoupledPreload(Law):
    """Friction of a set by the ball loads that its own temperatures leave.

    ``share`` of the friction at even temperatures and 3000 rpm follows the load, with ``power``; what does
    not follow it rises with the speed to the power ``viscous`` over what does.
    """

    where: str
    clearance: float
    share: float
    power: float
    wall: float
    yielding: float
    viscous: float = 0.0
    _set: BallSet | None = field(default=None, init=False, repr=False)

    def start(self, model: ReducedSpindle) -> None:
        """Forget the run before."""
        self.memory.clear()
        kind = FRONT if self.where == "F" else REAR
        self._set = BallSet(
            kind, SIDES[self.where], PLACES[self.where], PRELOAD, self.clearance, self.wall, self.yielding
        )

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        due = self.memory.get("due", -np.inf)
        thrust = moment.thrust if self.where == "F" else 0.0
        if moment.time >= due or thrust != self.memory["thrust"]:
            self.memory |= {"due": moment.time + EVERY - 1e-6, "thrust": thrust}
            loads = self._set.ball_loads(self._warmth(moment), thrust)
            even = self.memory.get(("even", thrust))
            if even is None:
                count = len(SIDES[self.where])
                still = Warmth(*(np.full(count, ASSEMBLED_AT) for _ in range(4)))
                even = self.memory[("even", thrust)] = self._set.ball_loads(still, thrust)
            ratio = np.maximum(loads / even, 1e-3)
            self.memory["more"] = ratio**self.power - 1.0
        rest = (1.0 - self.share) * max(moment.speed / AT, SLOWEST) ** self.viscous
        factor = 1.0 + self.share / (self.share + rest) * self.memory["more"]
        if moment.speed > 0.0:
            self.memory["largest"] = max(self.memory.get("largest", 1.0), float(factor.max()))
        moment.bearing[list(SETS[self.where])] *= factor

    def _warmth(self, moment: Moment) -> Warmth:
        names = [m.BEARINGS[i] for i in SETS[self.where]]
        inner, outer, housing = (
            np.array([moment.read(form.format(name)) for name in names])
            for form in ("mean:{}.inner", "mean:{}.outer", "growth:{}")
        )
        return Warmth(inner, outer, np.full(len(names), moment.read(SPACER[self.where])), housing)


def stated_uncertainty() -> tuple[Callable[[float], Law], ...]:
    """What a table of heat over speed leaves open: 5 % for each set, in one and two half waves."""
    return tuple(partial(_shape, where, turns) for where in SETS_OF_BEARINGS for turns in (1, 2))


def _shape(where: str, turns: int, size: float) -> HeatShape:
    return HeatShape(where, TABLE * size, turns, HIGHEST)


def displacement(model: ReducedSpindle, path: Path, speed: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far the nose has moved forward from the flange's back since assembly, µm.

    By ``nose_growth``; a turning shaft becomes shorter as it spreads.
    """
    row = model.readings[model.reading_names.index("growth:nose")]
    found = (path.states - ASSEMBLED_AT * model.uniform) @ row
    turning = (speed * np.pi / 30.0) ** 2
    for length, bore, outside in TURNING:
        found -= length * POISSON * DENSITY * turning * (bore**2 + outside**2) / (2.0 * YOUNG)
    return 1e6 * found


def draw_coupled(rng: np.random.Generator, model: ReducedSpindle, plan: Plan, built: dict) -> Concealed:
    """One set that follows its mechanics, by a share of its friction that keeps the machine alive."""
    where = "F" if rng.random() < 0.7 else "R"
    clearance = float(rng.uniform(5e-6, 30e-6))
    form = {
        "share": SHARE,
        "power": float(rng.uniform(0.4, 0.6)),
        "wall": float(rng.uniform(*WALL)),
        "yielding": float(rng.uniform(*YIELDING)),
        "viscous": float(rng.uniform(*VISCOUS)),
    }
    wanted = float(np.exp(rng.uniform(*np.log(LARGEST))))
    for _ in range(TRIES):
        law = CoupledPreload(where, clearance, **form)
        try:
            run(model, plan.drive, built, (law,))
            largest = law.memory["largest"]
        except ArithmeticError:
            largest = np.inf
        if 0.9 < (largest - 1.0) / (wanted - 1.0) < 1.1:
            break
        change = np.clip((wanted - 1.0) / max(largest - 1.0, 1e-3), 0.3, 2.0)
        form["share"] = float(min(form["share"] * change, MOST_SHARE))
    return Concealed(
        "thermal_preload",
        NAMES[where][-1],
        NAMES[where],
        form["share"],
        law,
        parameters={"outer_clearance": (1e6 * clearance, "um")},
        form=form | {"clearance_um": 1e6 * clearance},
    )


def add_displacement(
    folder: FilePath, stem: str, plan: Plan, values: NDArray[np.float64], rng: np.random.Generator
) -> None:
    """Put a displacement channel beside the others of a recording."""
    path = folder / f"{stem}.csv.gz"
    with gzip.open(path, "rt", encoding="utf-8") as stream:
        header, *rows = stream.read().splitlines()
    time = np.array([float(row.split(",", 1)[0]) for row in rows])
    read = (
        np.interp(time, plan.drive.time, values)
        + WHITE * rng.standard_normal(time.size)
        + rng.uniform(50, 400)
    )
    read = np.round(read / ROUNDING) * ROUNDING
    lines = [f"{header},S1", *(f"{row},{value:.1f}" for row, value in zip(rows, read, strict=True))]
    with gzip.GzipFile(path, "wb", mtime=0) as stream:
        stream.write(("\n".join(lines) + "\n").encode())
    with (folder / f"{stem}.toml").open("a", encoding="utf-8") as stream:
        stream.write(CHANNEL)


def make_case(
    model: ReducedSpindle, folder: FilePath, seed: int, number: int, *, identify: bool = True
) -> dict[str, object]:
    """Draw, simulate and write one case; return its answer."""
    rng = np.random.default_rng([seed, number])
    name, sees_nose = f"case_{number:04d}", number % 2 == 1
    as_built, noise = draw_as_built(rng), draw_noise(rng)
    plan = draw_drive(rng)
    calibration = draw_drive(rng) if rng.random() < 0.5 else None
    effects = [] if number % 5 == 0 else [draw_coupled(rng, model, plan, as_built)]
    path = run(model, plan.drive, as_built, tuple(e.machine for e in effects))
    inputs = folder / "inputs" / name
    told = {"recording": (plan, path)}
    if calibration is not None:
        told["calibration"] = calibration, run(model, calibration.drive, as_built)
    rows = {}
    for stem, (own, course) in told.items():
        rows[stem] = record(inputs, stem, f"{name} {stem}", own, course.readings, noise, rng)
        if sees_nose:
            add_displacement(inputs, stem, own, displacement(model, course, own.drive.speed), rng)
    (inputs / "machine.toml").write_text(SENSOR + (LOOK if sees_nose else ""), encoding="utf-8")
    known = None
    if effects and identify:
        known = what_is_known(
            Study(model, plan, calibration, as_built, noise, loose=stated_uncertainty()), effects
        )
    answer = {
        "schema": "spindle-fem/answer/1",
        "case": name,
        "family": "with displacement" if sees_nose else "temperatures alone",
        "two_recordings": calibration is not None,
        "noise": noise.answer(),
        "as_built": {k: round(v, 4) for k, v in as_built.items()},
        "identifiability": known,
        **judge(effects, known, calibration is not None),
        "effects": [effect_answer(e) for e in effects],
        "primary_component": [e.component for e in effects],
        "cycle": plan.cycle,
        "oil": plan.oil,
        "rows": rows,
    }
    answers = folder / "answers"
    answers.mkdir(parents=True, exist_ok=True)
    (answers / f"{name}.json").write_text(json.dumps(answer, indent=1), encoding="utf-8")
    return answer


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = study_options(__doc__, cases=40, seed=91)
    parser.add_argument("--cache", type=FilePath, default=None, help="folder of the reduced machine")
    parser.add_argument("--no-identifiability", action="store_true")
    given = parser.parse_args(arguments)
    model = load_reduced(given.cache)
    identify = not given.no_identifiability
    write_study(given, lambda number: make_case(model, given.output, given.seed, number, identify=identify))


if __name__ == "__main__":
    main()
