"""Conceal effects in networks: ``python -m validation.generate_networks --cases 100 --seed 5 -o DIR``.

``DIR/inputs/case_0001`` holds ``machine.toml`` (estimates), ``recording.toml`` with its data and perhaps a
``calibration``; ``DIR/answers/case_0001.json`` what was concealed and what could be known of it. Machines are
drawn by family, solved by :mod:`validation.networks.truth`, and differ from their files in what files lack.
"""

import itertools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .networks.conceal import CONCEALED, Concealed, Lie, Scene, kind_of
from .networks.families import FAMILIES
from .networks.files import machine_text, write_run
from .networks.known import Study, mimics_of, own_mimic
from .networks.scene import Owner, Run, draw_owner, run_machine
from .networks.truth import Array, Change
from .study_writer import study_options, write_study

# Composition of the cases: every fifth case consistent, a seventh pairs, the families in turn.
CYCLE = 5
PAIR_SHARE = 0.18
STRENGTHS = ((3.0, 20.0), (0.8, 2.5))
FAINT_SHARE = 0.08
MOST_MACHINES, TRIES_OF_FAMILY = 16, 4
WEAKEST, STRONGEST = 0.15, 1.8  # times what the families draw
# A mimic is indistinguishable from the truth if its further residual is a third of noise and structure.
SAME_AS_TRUTH = 0.35
UNSEEN_RATIO, FAINT_RATIO, CLEAR_RATIO = 0.5, 1.2, 2.5
SECOND = ("hidden_heat", "changed_cooling", "changed_heat", "follows_load", "lying_sensor", "slow_sensor")
DRIFT = {"effect": "ambient_drift", "components": ["ambient", "room"]}


@dataclass(slots=True)
class Case:
    """One machine with its runs before anything is written."""

    owner: Owner
    plain: Run
    calibration: Run | None
    structure_K: Array
    sensor_K: Array

    @property
    def total_K(self) -> float:
        """Sensors and structure together over the channels, K."""
        return float(np.sqrt((self.structure_K**2 + self.sensor_K**2).mean()))


def choose(number: int, rng: np.random.Generator) -> list[str]:
    """Effects that a case conceals: none in every fifth, a pair in some, else one of the families in turn."""
    turn, slot = divmod(number - 1, CYCLE)
    if slot == CYCLE - 1:
        return []
    names = list(CONCEALED)
    order = np.random.default_rng(31_001).permutation(len(names))
    first = names[order[((CYCLE - 1) * turn + slot) % len(names)]]
    if rng.random() < PAIR_SHARE:
        return [first, str(rng.choice([n for n in SECOND if n != first]))]
    return [first]


def applied(owner: Owner, run: Run, lies: list[Lie]) -> Run:
    """The run as lying sensors read it."""
    for lie in lies:
        k = owner.channels.index(lie.channel)
        run.truth[:, k] = lie.applied(run.time, run.truth[:, k], run.logged[owner.machine.room])
    return run


def run_with(owner: Owner, effects: list[Concealed]) -> Run:
    """The diagnosed run with effects."""
    change = Change()
    for effect in effects:
        change = change.beside(effect.change)
    return applied(owner, run_machine(owner, True, change), [e.lie for e in effects if e.lie])


def draw_machine(rng: np.random.Generator, family: str, calibrated: bool) -> Case:
    """A machine, its plain run and what the file's network leaves of it."""
    owner = draw_owner(rng, FAMILIES[family](rng), calibrated)
    plain = run_machine(owner, True)
    calibration = run_machine(owner, False) if calibrated else None
    sensor = np.array([s.total_K for s in owner.sensors.values()])
    study = Study(owner, [r for r in (plain, calibration) if r], sensor)
    _, left = study.fit(study.true)
    return Case(owner, plain, calibration, study.diagnosed(left) * sensor, sensor)


def _study(case: Case, run: Run) -> Study:
    runs = [r for r in (run, case.calibration) if r]
    return Study(case.owner, runs, np.full(len(case.sensor_K), case.total_K))


def _ratio(study: Study) -> tuple[Array, Array, Array]:
    x, left = study.fit(study.true)
    return study.diagnosed(left), x, left


def draw_effects(
    case: Case, wanted: list[str], rng: np.random.Generator
) -> list[tuple[Concealed, Array]] | None:
    """Effects, each so strong that alone it leaves about a drawn ratio; None where none of the draws does."""
    low, high = STRENGTHS[int(rng.random() < FAINT_SHARE)]
    out = []
    for name in wanted:
        make, _ = CONCEALED[name]
        if name == "changed_joint" and len(case.owner.machine.network.nodes) < 2:
            return None
        goal = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        for _ in range(3):
            child, strength, found = int(rng.integers(2**31)), 1.0, None
            for _ in range(3):
                drawn = make(Scene(case.owner, np.random.default_rng(child), strength))
                if drawn.intervals is not None and not drawn.intervals:
                    break
                try:
                    by_channel = _ratio(_study(case, run_with(case.owner, [drawn])))[0]
                except ArithmeticError:
                    break
                got = float(by_channel.max())
                if 0.75 * goal < got < 1.35 * goal or (got > low and got < high):
                    found = drawn
                    break
                strength = float(np.clip(strength * goal / max(got, 0.05), 0.3 * strength, 2.5 * strength))
                if not WEAKEST < strength < STRONGEST:
                    break
            if found:
                out.append((found, by_channel))
                break
        else:
            return None
        low, high = max(low, 2.0), max(high, 8.0)
    return out


def moved_over_noise(case: Case, effect: Concealed) -> float | None:
    """Largest response of a sensor to a hidden state over its noise, median of intervals."""
    if effect.shape is None or effect.intervals is None:
        return None
    change = run_with(case.owner, [effect]).truth - case.plain.truth
    rows = np.searchsorted(case.plain.time, np.array(effect.intervals)).clip(max=len(change) - 1)
    moves = np.abs(change[rows[:, 1]] - change[rows[:, 0]])
    return float((np.median(moves, axis=0) / case.sensor_K).max())


def identify(case: Case, effects: list[Concealed], each: list[Array]) -> dict[str, Any]:
    """Residuals before, with the truth beside the file's network, and with the best other effects."""
    study = _study(case, run_with(case.owner, effects))
    by_channel, x, left = _ratio(study)
    worst = int(by_channel.argmax())
    out: dict[str, Any] = {
        "ratio": round(float(by_channel[worst]), 3),
        "channel": case.owner.channels[worst],
        "each": [round(float(v.max()), 3) for v in each],
        "by_channel": dict(zip(case.owner.channels, np.round(by_channel, 3).tolist(), strict=True)),
        "own_simple_form": _left(by_channel),
        "best_mimics": [],
    }
    reached = np.inf
    if effects:
        lies = tuple(e.lie for e in effects if e.lie)
        _, rest = study.fit(study.true, own_mimic(study, effects), lies)
        own = study.diagnosed(rest)
        reached = float(own @ own)
        out["own_simple_form"] = _left(own)
    mimics = mimics_of(study, effects[0] if effects else None, case.calibration is not None)
    if len(effects) > 1:
        return out
    rows = study.table(mimics, x, left, best=6)
    seen = set()
    for mimic, v in rows:
        key = (mimic.effect, mimic.components)
        if key in seen or len(seen) == 8:
            continue
        seen.add(key)
        beyond = np.sqrt(max(0.0, (float(v @ v) - reached) / v.size))
        told = {"effect": mimic.effect, "components": list(mimic.components), **_left(v)}
        out["best_mimics"].append(told | {"accepted": bool(effects and beyond < SAME_AS_TRUTH)})
    return out


def _left(v: Array) -> dict[str, float]:
    return {"ratio": round(float(v.max()), 3), "rms": round(float(np.sqrt((v**2).mean())), 3)}


def judge(effects: list[Concealed], known: dict[str, Any], room_recorded: bool) -> dict[str, Any]:
    """Verdict, sets that count as right, and whether the effect shows."""
    kinds = [kind_of(e.effect) for e in effects]
    truth = next((k for k in ("missing_physics", "parameter", "sensor") if k in kinds), "consistent")
    verdicts = [truth]
    sets: list[list[dict[str, Any]]] = []
    # Every effect as itself, or as what else is the same at its place; a part of several counts, too.
    choices = []
    for effect in effects:
        sames = [
            [{"effect": name, "components": effect.acceptable}] * times
            for name in (effect.effect, *effect.also)
            for times in range(1, effect.most + 1)
        ]
        choices.append(sames)
        verdicts += [kind_of(name) for name in effect.also if len(effects) == 1]
    if effects:
        sets = [list(itertools.chain(*one)) for one in itertools.product(*choices)]
    listed = {(s[0]["effect"], tuple(s[0]["components"])) for s in sets if len(s) == 1}
    twins = [
        m
        for m in known["best_mimics"]
        if m["accepted"] and not any(m["effect"] == e and set(m["components"]) & set(c) for e, c in listed)
    ]
    for twin in twins:
        sets.append([{"effect": twin["effect"], "components": twin["components"]}])
        verdicts += ["ambiguous", kind_of(twin["effect"])]
    if effects and not room_recorded:
        sets += [[*one, DRIFT] for one in sets]
    shows = [r for r in known["each"] if r < FAINT_RATIO]
    detectable = bool(effects) and known["ratio"] >= UNSEEN_RATIO
    if effects and known["ratio"] < FAINT_RATIO:
        sets.append([])
        verdicts += ["consistent", "ambiguous"]
    if len(effects) > 1 and shows:
        sets += [[{"effect": e.effect, "components": e.acceptable}] for e in effects]
        verdicts += ["ambiguous", *kinds]
    if any(e.also for e in effects):
        verdicts.append("ambiguous")
    return {
        "verdict": "ambiguous" if twins else truth,
        "true_verdict": truth,
        "acceptable_verdicts": sorted(set(verdicts)),
        "detectable": detectable,
        "clear": bool(effects and min([known["ratio"], *known["each"]]) >= CLEAR_RATIO and not twins),
        "acceptable_sets": sets,
        "primary_component": effects[0].acceptable if effects else [],
    }


def _effect_answer(case: Case, effect: Concealed) -> dict[str, Any]:
    moved = moved_over_noise(case, effect)
    return {
        "effect": effect.effect,
        "statement": effect.statement,
        "kind": kind_of(effect.effect),
        "component": effect.component,
        "acceptable_components": effect.acceptable,
        "parameters": {k: {"value": float(f"{v:.6g}"), "unit": u} for k, (v, u) in effect.parameters.items()},
        "intervals": effect.intervals,
        "moves_over_noise": None if moved is None else round(moved, 2),
        "follows": effect.follows,
        "truth_form": effect.form,
    }


def make_case(folder: Path, seed: int, number: int) -> dict[str, Any]:
    """Draw, run and write one case; return its answer.

    Raises
    ------
    ArithmeticError
        No draw of many shows what is wanted.
    """
    rng = np.random.default_rng([seed, number])
    wanted = choose(number, rng)
    needs = any(CONCEALED[name][1] for name in wanted)
    for attempt in range(MOST_MACHINES):
        # Several machines of a family are tried before another, so that none is rare for being hard.
        if attempt % TRIES_OF_FAMILY == 0:
            family = list(FAMILIES)[int(rng.integers(len(FAMILIES)))]
        calibrated = needs or bool(rng.random() < 0.3)
        try:
            case = draw_machine(rng, family, calibrated)
            drawn = draw_effects(case, wanted, rng)
            if drawn is not None:
                return _write(
                    folder, f"case_{number:04d}", case, drawn, "+".join(wanted) or "consistent", rng
                )
        except ArithmeticError:
            continue
    raise ArithmeticError(f"case {number}: no machine shows {wanted}")


def _write(
    folder: Path,
    name: str,
    case: Case,
    drawn: list[tuple[Concealed, Array]],
    family: str,
    rng: np.random.Generator,
) -> dict[str, Any]:
    effects, owner = [e for e, _ in drawn], case.owner
    network = owner.machine.network
    inputs = folder / "inputs" / name
    # First: where it fails another machine is drawn, which must not find this one's files.
    known = identify(case, effects, [v for _, v in drawn])
    rows = {"recording": write_run(rng, owner, run_with(owner, effects), inputs, "recording")}
    if case.calibration is not None:
        rows["calibration"] = write_run(rng, owner, case.calibration, inputs, "calibration")
    (inputs / "machine.toml").write_text(machine_text(owner, name), encoding="utf-8")
    sensors = list(owner.sensors.values())
    built = {f"capacity.{k}": v for k, v in network.capacity.items()}
    built |= {f"conductance.{k}": v for k, v in network.conductance.items()}
    built |= {f"gain.{s.name}": s.gain for s in network.sources}
    if not owner.room_recorded:
        built["temperature.room"] = float(case.plain.logged[owner.machine.room].mean())

    def mean(values) -> float:
        return round(float(np.sqrt(np.mean(np.square(values)))), 4)

    answer = {
        "schema": "spindle-fem/answer/1",
        "case": name,
        "family": family,
        "machine": owner.machine.family,
        "two_recordings": case.calibration is not None,
        "ambient_recorded": owner.room_recorded,
        "duration_s": float(case.plain.time[-1]),
        "noise": {
            "white_K": mean([s.white_K for s in sensors]),
            "slow_K": mean([s.slow_K for s in sensors]),
            "rounding_K": mean([s.rounding_K for s in sensors]),
            "sensor_K": mean(case.sensor_K),
            "structure_K": mean(case.structure_K),
            "total_K": round(case.total_K, 4),
        },
        "channels": {
            n: {
                "noise_K": round(s.total_K, 4),
                "structure_K": round(float(k), 4),
                "whole_degree": s.whole_degree,
            }
            for (n, s), k in zip(owner.sensors.items(), case.structure_K, strict=True)
        },
        "as_built": {k: round(v, 4) for k, v in built.items()},
        "initial_degC": dict(zip(network.nodes, np.round(case.plain.start, 4).tolist(), strict=True)),
        "structure": {
            **owner.lacks,
            "coarse_inputs": owner.coarse,
            "means": owner.means,
            "row_s": owner.row_s,
        },
        "rows": rows,
        "identifiability": known,
        **judge(effects, known, owner.room_recorded),
        "effects": [_effect_answer(case, e) for e in effects],
    }
    answers = folder / "answers"
    answers.mkdir(parents=True, exist_ok=True)
    (answers / f"{name}.json").write_text(json.dumps(answer, indent=1), encoding="utf-8")
    return answer


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    given = study_options(__doc__, cases=100, seed=5).parse_args(arguments)
    write_study(given, lambda number: make_case(given.output, given.seed, number), generator="networks")


if __name__ == "__main__":
    main()
