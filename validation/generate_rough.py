"""Conceal effects in machines known roughly: ``python -m validation.generate_rough --cases 60 -o DIR``.

Every machine differs from its definition as :mod:`validation.rough` draws it: a pool of shapes, what hangs
on each, two to six channels, clocks apart. ``DIR/inputs`` and ``DIR/answers`` as :mod:`validation.generate`
leaves them; answers count structure into ``noise.total_K``, by which effects are judged.
"""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from .concealed_effect import Concealed
from .cycles import Plan, draw_drive
from .draw import EVERY_EFFECT, FOREIGN_EFFECTS, MACHINE_EFFECTS
from .draw_sensor_errors import SENSOR_EFFECTS
from .generate import HEAVY, draw_stable, effect_answer, effects_set, judge, plan_for, what_is_known
from .identify import Study
from .machine import Deviation
from .recorder import Logger, Noise, record
from .reduction import ReducedSpindle, load_reduced
from .rough import GRID, AsMounted, deviating_machine, draw_channels, draw_mounting, what_is_open
from .stepping import draw_as_built, run
from .study_writer import study_options, write_study

# Contents of the cases, in turn.
TURNS = ("consistent", "single", "single", "pair", "consistent", "single", "triple", "sensor_beside")
# Slow differences between machine and definition last as long as the loads do, s.
STRUCTURE_S = 4000.0
MOST_MACHINES = 8


def choose(number: int, rng: np.random.Generator) -> tuple[str, list[str]]:
    """Family and effects of a case."""
    turn, slot = divmod(number - 1, len(TURNS))
    family = TURNS[slot]
    if family == "consistent":
        return family, []
    if family == "single":
        names = list(EVERY_EFFECT)
        order = np.random.default_rng(20_011).permutation(len(names))
        name = names[order[(3 * turn + {1: 0, 2: 1, 5: 2}[slot]) % len(names)]]
        return "outside_catalogue" if name in FOREIGN_EFFECTS else family, [name]
    physics = [n for n in MACHINE_EFFECTS if n not in FOREIGN_EFFECTS]
    chosen = [str(rng.choice([n for n in (*HEAVY, *physics) if n in physics]))]
    while len(chosen) < (3 if family == "triple" else 2):
        pool = list(SENSOR_EFFECTS) if family == "sensor_beside" else physics
        chosen.append(str(rng.choice([n for n in pool if n not in chosen])))
    return family, chosen


def draw_sensors(rng: np.random.Generator) -> Noise:
    """White and slow noise and rounding of one machine's sensors."""
    return Noise(
        float(rng.choice([0.03, 0.05, 0.08, 0.1])),
        0.05,
        float(rng.uniform(1800.0, 5000.0)),
        float(rng.choice([0.0, 0.0, 0.1])),
    )


def structure_left(
    nominal: ReducedSpindle,
    plans: list[Plan],
    truths: list[np.ndarray],
    known: tuple[dict, Noise, tuple[int, ...]],
) -> np.ndarray:
    """(channels,) K that the definition, refitted, leaves of a machine without any effect."""
    as_built, noise, channels = known
    study = Study(nominal, plans[0], plans[1] if len(plans) > 1 else None, as_built, noise, (), channels)
    every = [
        t[:: t.shape[0] // d.time.size][: d.time.size] for t, d in zip(truths, study.drives, strict=True)
    ]
    study.earlier = every[1:]
    study.fit_through_model(every[0], None, np.empty((0, 0)))
    return study.by_channel(study.left)


def read_channels(effects: list[Concealed], channels: tuple[int, ...]) -> bool:
    """Whether every sensor that lies is one that is recorded."""
    return all(e.sensor is None or e.sensor.channel in channels for e in effects)


def with_twins(effects: list[Concealed], judged: dict[str, Any]) -> dict[str, Any]:
    """Count effects indistinguishable from the truth as right, and mark the case as ambiguous."""
    names = [e.effect for e in effects]
    for twin in judged["indistinguishable"]:
        at = names.index(twin.get("instead_of", names[0]))
        other = {"effect": twin["effect"], "components": _place_names(twin["component"])}
        whole = effects_set(effects)
        judged["acceptable_sets"].append([*whole[:at], other, *whole[at + 1 :]])
        judged["verdict"] = "ambiguous"
    return judged


def _place_names(component: str) -> list[str]:
    sets = {"front_bearings": ["F1", "F2", "F3"], "rear_bearings": ["R1", "R2"]}
    places = {"housing_middle_top": "housing", "housing_rear_top": "housing", "housing_front_top": "housing"}
    places |= {"shaft_middle": "shaft"}
    return [component, *sets.get(component, []), *([places[component]] if component in places else [])]


@dataclass(frozen=True, slots=True)
class Drawn:
    """One case before it is written: a machine, its sensors and runs, and what is concealed in it.

    ``rng`` goes on where the draw ended; ``left`` in K by channel: what the refitted definition leaves of it.
    """

    rng: np.random.Generator
    family: str
    wanted: list[str]
    deviation: Deviation
    model: ReducedSpindle
    mounted: AsMounted
    as_built: dict[str, float]
    sensors: Noise
    logger: Logger
    plans: list[Plan]
    truths: list[np.ndarray]
    left: np.ndarray
    effects: list[Concealed] = field(default_factory=list)

    @property
    def noise_and_structure_K(self) -> tuple[float, float]:
        """What sensors leave, and what the machine's shape leaves of the definition, each as RMS."""
        sensor = np.sqrt(self.sensors.total_K**2 + self.sensors.rounding_K**2 / 12.0)
        return float(sensor), float(np.sqrt((self.left**2).mean()))

    def study(self, *open_to: Any) -> Study:
        """The identification of what is concealed; directions that are open may be given."""
        # Structural residuals are as slow as the loads: effects are judged against both.
        slow = float(np.hypot(self.sensors.slow_K, self.noise_and_structure_K[1]))
        judged_by = Noise(self.sensors.white_K, slow, STRUCTURE_S)
        calibration = self.plans[1] if len(self.plans) > 1 else None
        laws = (self.mounted,)
        told = (self.model, self.plans[0], calibration, self.as_built, judged_by, laws, self.logger.channels)
        return Study(*told, *open_to)

    def readings(self, plan: Plan) -> np.ndarray:
        """(n, channels) K that the sensors show in a run, with everything concealed."""
        laws = (self.mounted, *(e.machine for e in self.effects if e.machine))
        read = run(self.model, plan.drive, self.as_built, laws).readings
        for lie in (e.sensor for e in self.effects if e.sensor):
            read = lie.apply(plan.drive.time, read, plan.drive.ambient)
        return read


def draw_case(nominal: ReducedSpindle, pool: list, seed: int, number: int) -> Drawn:
    """The first of several machines that shows what the case is to show.

    Raises
    ------
    ArithmeticError
        None of them does.
    """
    for attempt in range(MOST_MACHINES):
        try:
            return _attempt(nominal, pool, (seed, number, attempt))
        except ArithmeticError:
            continue
    raise ArithmeticError(f"case {number}: no machine shows what is wanted")


def _attempt(nominal: ReducedSpindle, pool: list, seeds: tuple[int, int, int]) -> Drawn:
    rng = np.random.default_rng(seeds)
    family, wanted = choose(seeds[1], rng)
    deviation, model = pool[int(rng.integers(len(pool)))]
    mounted: AsMounted = draw_mounting(rng)
    as_built, sensors, channels = draw_as_built(rng), draw_sensors(rng), draw_channels(rng)
    logger = Logger((15.0, 20.0, 30.0, 45.0, 60.0, 120.0), channels)
    if rng.random() < 0.3:
        logger = replace(logger, late=float(rng.uniform(-40.0, 40.0)))
    plans = [plan_for(wanted, rng)]
    if rng.random() < 0.6:
        plans.append(draw_drive(rng))
    paths = [run(model, p.drive, as_built, (mounted,)) for p in plans]
    truths = [p.readings for p in paths]
    left = structure_left(nominal, plans, truths, (as_built, sensors, channels))
    machine = (deviation, model, mounted, as_built)
    case = Drawn(rng, family, wanted, *machine, sensors, logger, plans, truths, left)
    if wanted:
        study = case.study()
        for _ in range(20):
            effects, _ = draw_stable(wanted, study, paths[0], plans[0], rng)
            if read_channels(effects, channels):
                break
        case = replace(case, effects=effects)
    return case


def make_case(
    folder: FilePath, nominal: ReducedSpindle, pool: list, seed: int, number: int, identified: bool = True
) -> dict[str, Any]:
    """Draw, simulate and write one case; return its answer.

    Raises
    ------
    ArithmeticError
        None of several machines shows what is wanted.
    """
    name = f"case_{number:04d}"
    case = draw_case(nominal, pool, seed, number)
    effects, plans, logger, sensors = case.effects, case.plans, case.logger, case.sensors
    known = what_is_known(case.study(what_is_open()), effects) if effects and identified else None
    inputs, rest = folder / "inputs" / name, (sensors, case.rng, logger)
    rows = {"recording": record(inputs, "recording", name, plans[0], case.readings(plans[0]), *rest)}
    if len(plans) > 1:
        rows["calibration"] = record(
            inputs, "calibration", f"{name} calibration", plans[1], case.truths[1], *rest
        )
    sensor, structure = case.noise_and_structure_K
    answer = {
        "schema": "spindle-fem/answer/1",
        "case": name,
        "family": case.family,
        "machine": "recorded_spindle",
        "profile": plans[0].cycle,
        "two_recordings": len(plans) > 1,
        "noise": sensors.answer()
        | {"sensor_K": sensor, "structure_K": structure, "total_K": float(np.hypot(sensor, structure))},
        "channels": logger.names,
        "clock_offset_s": logger.late,
        "as_built": {k: round(v, 4) for k, v in case.as_built.items()},
        "structure": case.mounted.answer(case.deviation)
        | {"refitted_residual_K": dict(zip(logger.names, np.round(case.left, 4).tolist(), strict=True))},
        "identifiability": known,
        **with_twins(effects, judge(effects, known, len(plans) > 1)),
        "effects": [effect_answer(e) for e in effects],
        "primary_component": [e.component for e in effects],
        "rows": rows,
    }
    answers = folder / "answers"
    answers.mkdir(parents=True, exist_ok=True)
    (answers / f"{name}.json").write_text(json.dumps(answer, indent=1), encoding="utf-8")
    return answer


def machines(seed: int, shapes: int, cache: FilePath | None) -> tuple[ReducedSpindle, list]:
    """The machine as defined, and the pool of deviating ones."""
    pool = []
    for number in range(shapes):
        pool.append(deviating_machine(seed, number, cache))
        print(f"shape {number + 1} of {shapes}", flush=True)
    return load_reduced(cache, **GRID), pool


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = study_options(__doc__, cases=60, seed=3)
    parser.add_argument("--shapes", type=int, default=6, help="machines of deviating shape in the pool")
    parser.add_argument("--cache", type=FilePath, default=None, help="folder of the reduced machines")
    given = parser.parse_args(arguments)
    nominal, pool = machines(given.seed, given.shapes, given.cache)
    write_study(
        given,
        lambda number: make_case(given.output, nominal, pool, given.seed, number),
        generator="rough",
        shapes=given.shapes,
    )


if __name__ == "__main__":
    main()
