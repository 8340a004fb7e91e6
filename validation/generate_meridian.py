"""Conceal effects in other machines: ``python -m validation.generate_meridian --cases 24 --seed 4 -o DIR``.

Machines that ship without a channel, at their own size and larger, by finite elements in the meridian plane;
each case has its own ``machine.toml``. Every true machine has another outer diameter than its definition, a
tool, balls that conduct with speed, heat of another shape over speed; two to four probes are recorded.
"""

import gzip
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from .concealed_effect import Concealed
from .cycles import draw_drive
from .generate import effect_answer, judge
from .generate_rough import STRUCTURE_S, with_twins
from .meridian.conceal import EFFECTS, PHYSICS, Mounted, Scene, deviating, draw
from .meridian.definition import recorded, text_of, value
from .meridian.elements import assemble
from .meridian.run import Act, Array, Plant, draw_as_built, every, run
from .recorder import slow_error
from .stepping import Drive
from .study_writer import study_options, write_study

MACHINES = (("uncooled", 1.0), ("uncooled", 1.6), ("uncooled", 0.7))
TURNS = ("consistent", "single", "single", "pair", "single", "single")
COARSE = 9
RATIOS = (2.0, 10.0)
STEP_OF_FIT = 0.1


@dataclass(frozen=True, slots=True)
class Sensors:
    """Errors of a machine's sensors, K and s."""

    white_K: float
    slow_K: float
    slow_s: float
    rounding_K: float

    @property
    def total_K(self) -> float:
        """All of it."""
        return float(np.sqrt(self.white_K**2 + self.slow_K**2 + self.rounding_K**2 / 12.0))


class Fits:
    """Linear fits of one case: responses to parameters, priors, noise including structure."""

    def __init__(self, plant: Plant, drives: list[Drive], built: dict[str, float], always: list[Act]) -> None:
        self.plant, self.drives, self.built, self.always = (
            plant,
            [every(d, COARSE) for d in drives],
            built,
            always,
        )
        self.plain = [run(plant, d, built, always) for d in self.drives]
        self.priors = plant.priors()
        columns = []
        for name, sigma in self.priors.items():
            moved = dict(built)
            step = STEP_OF_FIT * sigma
            moved[name] = moved[name] + step if name == "split" else moved[name] * float(np.exp(step))
            answers = [run(plant, d, moved, always) for d in self.drives]
            columns.append([(a - p) / STEP_OF_FIT for a, p in zip(answers, self.plain, strict=True)])
        self.columns = columns

    def prepare(self, channels: tuple[int, ...], white: float, slow: float) -> None:
        """Whiten for the channels that are recorded and this noise, K."""
        self.channels = list(channels)
        self.factors = []
        for d in self.drives:
            apart = np.abs(d.time[:, None] - d.time[None, :])
            noise = white**2 / 3.0 * np.eye(d.time.size) + slow**2 * np.exp(-apart / STRUCTURE_S)
            self.factors.append(cholesky(noise, lower=True))
        self.jacobian = np.stack([self.white(c) for c in self.columns], axis=1)

    def white(self, parts: list[Array]) -> Array:
        """Whitened readings of all runs, one channel after the other."""
        return np.concatenate(
            [
                solve_triangular(f, p[:, c], lower=True)
                for p, f in zip(parts, self.factors, strict=True)
                for c in self.channels
            ]
        )

    def left(self, parts: list[Array], mimic: list[Array] | None = None) -> tuple[Array, float]:
        """(channels,) rms on the diagnosed run after a refit, K, and chi squared; with a mimic beside."""
        columns = [*self.columns, mimic] if mimic else self.columns
        jacobian = np.column_stack([self.jacobian, self.white(mimic)]) if mimic else self.jacobian
        prior = np.eye(len(columns))[: len(self.columns)]
        target = np.concatenate([self.white(parts), np.zeros(len(prior))])
        found = np.linalg.lstsq(np.vstack([jacobian, prior]), target, rcond=None)[0]
        rest = parts[0] - sum(x * c[0] for x, c in zip(found, columns, strict=True))
        chi2 = target - np.vstack([jacobian, prior]) @ found
        return np.sqrt((rest[:, self.channels] ** 2).mean(axis=0)), float(chi2 @ chi2)

    def change(self, effects: list[Concealed]) -> list[Array]:
        """Change of the diagnosed run by effects; none of the calibration."""
        d = self.drives[0]
        out = run(self.plant, d, self.built, [*self.always, *(e.machine for e in effects if e.machine)])
        for e in effects:
            out = e.sensor.apply(d.time, out) if e.sensor else out
        return [out - self.plain[0], *[np.zeros_like(p) for p in self.plain[1:]]]


def draw_work(rng: np.random.Generator, plant: Plant) -> Drive:
    """A load cycle of hours, scaled to the machine's speeds and thrusts."""
    plan = draw_drive(rng, oil="constant")
    table = plant.tables["heat"]["table"]
    top, thrust = value(table["speed"][-1]), value(table["reference_thrust"])
    speed = np.round(plan.drive.speed * top / 4500.0 / 50.0) * 50.0
    return replace(plan.drive, speed=speed, thrust=np.round(plan.drive.thrust * thrust / 1750.0))


def choose(number: int, rng: np.random.Generator) -> tuple[str, list[str]]:
    """Family and effects of a case."""
    turn, slot = divmod(number - 1, len(TURNS))
    family = TURNS[slot]
    if family == "consistent":
        return family, []
    if family == "pair":
        return family, [str(x) for x in rng.choice(PHYSICS, 2, replace=False)]
    order = np.random.default_rng(41_003).permutation(len(EFFECTS))
    return family, [EFFECTS[order[(4 * turn + {1: 0, 2: 1, 4: 2, 5: 3}[slot]) % len(EFFECTS)]]]


def draw_effects(fits: Fits, wanted: list[str], total: float, rng: np.random.Generator) -> list[Concealed]:
    """Effects so strong that each leaves about a drawn ratio to noise and structure after a refit."""
    out = []
    for name in wanted:
        goal = float(np.exp(rng.uniform(*np.log(RATIOS))))
        child, strength = int(rng.integers(2**31)), 1.0
        for _ in range(4):
            scene = Scene(
                np.random.default_rng(child), fits.plant, fits.drives[0], tuple(fits.channels), strength
            )
            drawn = draw(name, scene)
            got = float(fits.left(fits.change([drawn]))[0].max()) / total
            if 0.8 < got / goal < 1.25:
                break
            strength = float(
                np.clip(strength * goal / max(got, 1e-3), 0.2 * strength, min(2.5, 3.0 * strength))
            )
        out.append(drawn)
    return out


def what_is_known(fits: Fits, effects: list[Concealed], total: float) -> dict[str, Any]:
    """Ratio after a refit, the parts' own, and what else would explain the effects, to first order."""
    change = fits.change(effects)
    by_channel, chi2 = fits.left(change)
    each = []
    for e in effects if len(effects) > 1 else []:
        beside = fits.change([o for o in effects if o is not e])
        rms, rest = fits.left(change, beside)
        each.append({"effect": e.effect, "ratio": round(float(rms.max()) / total, 3), "chi2": round(rest, 1)})
    mimics = []
    for name in EFFECTS if len(effects) == 1 else ():
        for child in range(4):
            scene = Scene(np.random.default_rng(child), fits.plant, fits.drives[0], tuple(fits.channels), 0.3)
            drawn = draw(name, scene)
            if name == effects[0].effect or (name, drawn.component) in [
                (m["effect"], m["component"]) for m in mimics
            ]:
                continue
            rms, rest = fits.left(change, fits.change([drawn]))
            told = {
                "effect": name,
                "component": drawn.component,
                "form": "",
                "ratio": round(float(rms.max()) / total, 3),
            }
            mimics.append(told | {"chi2": round(rest, 1)})
    return {
        "ratio": round(float(by_channel.max()) / total, 3),
        "chi2": round(chi2, 1),
        "each": each,
        "own_simple_form": None,
        "best_mimics": sorted(mimics, key=lambda m: m["chi2"])[:6],
        "pair_mimics": [],
    }


def write_run(folder: Path, stem: str, drive: Drive, readings: Array, about: tuple) -> int:
    """Write ``stem.toml`` and its data; returns the number of rows."""
    probes, channels, sensors, rng = about
    step = float(rng.choice([20.0, 30.0, 60.0]))
    time = np.arange(0.0, drive.time[-1], step)
    columns, held = [], np.minimum((time / drive.step).astype(int), drive.time.size - 1)
    for c in channels:
        y = np.interp(time, drive.time, readings[:, c]) + sensors.white_K * rng.standard_normal(time.size)
        y += slow_error(rng, time, sensors.slow_K, sensors.slow_s)
        columns.append(np.round(y / sensors.rounding_K) * sensors.rounding_K)
    ambient = np.interp(time, drive.time, drive.ambient) + 0.05 * rng.standard_normal(time.size)
    names = [probes[c] for c in channels]
    lines = [",".join(["time_s", *names, "ambient", "speed", "thrust"])]
    for k, t in enumerate(time):
        lines.append(
            f"{t:g}," + ",".join(f"{y[k]:.2f}" for y in columns)
            + f",{ambient[k]:.2f},{drive.speed[held[k]]:g},{drive.thrust[held[k]]:g}"
        )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    with gzip.GzipFile(folder / f"{stem}.csv.gz", "wb", mtime=0) as stream:
        stream.write(("\n".join(lines) + "\n").encode())
    entries = [
        {"column": n, "role": "temperature", "probe": n, "unit": "degC", "sigma": sensors.white_K}
        for n in names
    ]
    entries.append({"column": "ambient", "role": "input", "drives": "ambient", "unit": "degC"})
    for name, unit in (("speed", "rpm"), ("thrust", "N")):
        entries.append({"column": name, "role": "input", "drives": name, "hold": "previous", "unit": unit})
    manifest = {
        "schema": "spindle-fem/recording/1",
        "name": f"{folder.name} {stem}",
        "data": f"{stem}.csv.gz",
        "time": {"column": "time_s", "unit": "s"},
        "channel": entries,
    }
    (folder / f"{stem}.toml").write_text(text_of(manifest), encoding="utf-8")
    return len(lines) - 1


def make_case(folder: Path, seed: int, number: int) -> dict[str, Any]:
    """Draw, run and write one case; return its answer."""
    rng = np.random.default_rng([seed, number])
    name = f"case_{number:04d}"
    family, wanted = choose(number, rng)
    tables = recorded(*MACHINES[int(rng.integers(len(MACHINES)))])
    outer = float(rng.uniform(-0.03, 0.03)) if rng.random() < 0.7 else 0.0
    true, drawn_plant = Plant(assemble(deviating(tables, outer)), tables), Plant(assemble(tables), tables)
    top = value(tables["heat"]["table"]["speed"][-1])
    waves = tuple((float(rng.normal(0.0, 0.03)), float(rng.uniform(0.0, 2.0 * np.pi))) for _ in range(2))
    mounted = Mounted(
        float(rng.choice([0.0, 0.02, 0.05])) * float(true.model.capacity.sum()),
        float(rng.choice([0.0, 0.1, 0.2])),
        waves,
        top,
    )
    built = draw_as_built(rng, true)
    probes = list(true.model.probes)
    number_read = int(rng.choice([len(probes), len(probes), 3, 2]))
    channels = tuple(sorted(int(c) for c in rng.choice(len(probes), number_read, replace=False)))
    sensors = Sensors(float(rng.choice([0.05, 0.08, 0.1])), 0.04, float(rng.uniform(1800, 5000)), 0.05)
    drives = [draw_work(rng, true), *([draw_work(rng, true)] if rng.random() < 0.6 else [])]
    nominal, fits = Fits(drawn_plant, drives, built, []), Fits(true, drives, built, [mounted])
    nominal.prepare(channels, sensors.white_K, sensors.slow_K)
    left, _ = nominal.left([a - b for a, b in zip(fits.plain, nominal.plain, strict=True)])
    structure = float(np.sqrt((left**2).mean()))
    total = float(np.hypot(sensors.total_K, structure))
    fits.prepare(channels, sensors.white_K, float(np.hypot(sensors.slow_K, structure)))
    effects = draw_effects(fits, wanted, total, rng)
    known = what_is_known(fits, effects, total) if effects else None
    runs = {"recording": [e.machine for e in effects if e.machine], "calibration": []}
    inputs, rows = folder / "inputs" / name, {}
    for (stem, acts), drive in zip(runs.items(), drives, strict=False):
        fine = every(drive, 2)
        readings = run(true, fine, built, [mounted, *acts])
        for e in effects if stem == "recording" else []:
            readings = e.sensor.apply(fine.time, readings) if e.sensor else readings
        rows[stem] = write_run(inputs, stem, fine, readings, (probes, channels, sensors, rng))
    (inputs / "machine.toml").write_text(text_of(tables), encoding="utf-8")
    answer = {
        "schema": "spindle-fem/answer/1",
        "case": name,
        "family": family,
        "machine": tables["name"],
        "two_recordings": len(drives) > 1,
        "noise": {"white_K": sensors.white_K, "slow_K": sensors.slow_K, "rounding_K": sensors.rounding_K,
                  "sensor_K": sensors.total_K, "structure_K": structure, "total_K": total},
        "channels": [probes[c] for c in channels],
        "as_built": {k: round(v, 4) for k, v in built.items()},
        "structure": {"od": outer, "tool_J_K": mounted.tool_J_K, "ball": mounted.ball, "shape": waves,
                      "refitted_residual_K": [round(float(x), 4) for x in left]},
        "identifiability": known,
        **with_twins(effects, judge(effects, known, len(drives) > 1)),
        "effects": [effect_answer(e) for e in effects],
        "primary_component": [e.component for e in effects],
        "rows": rows,
    }  # fmt: skip
    (folder / "answers").mkdir(parents=True, exist_ok=True)
    (folder / "answers" / f"{name}.json").write_text(json.dumps(answer, indent=1), encoding="utf-8")
    return answer


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    given = study_options(__doc__, cases=24, seed=4).parse_args(arguments)
    write_study(given, lambda number: make_case(given.output, given.seed, number), generator="meridian")


if __name__ == "__main__":
    main()
