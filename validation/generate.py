"""Write concealed cases: inputs for the diagnosis, answers apart from them.

``python -m validation.generate --cases 200 --seed 7 -o DIR`` writes ``DIR/inputs/case_0001`` and so
on, and ``DIR/answers/case_0001.json``. A case depends on the seed and its number alone.
"""

import json
from pathlib import Path as FilePath

import numpy as np

from .concealed_effect import Concealed, Scene
from .cycles import Plan, draw_drive
from .draw import EVERY_EFFECT, MACHINE_EFFECTS
from .draw_sensor_errors import SENSOR_EFFECTS
from .identify import Study, machine_mimics, sensor_mimics
from .recorder import draw_noise, record
from .reduction import ReducedSpindle, load_reduced
from .stepping import Path, draw_as_built, run
from .study_writer import study_options, write_study

UNSEEN_RATIO, UNSEEN_CHI2 = 0.3, 20.0
CLEAR_RATIO, CLEAR_CHI2 = 1.0, 120.0
# What one of several effects leaves without the others hardly shows below this.
FAINT_RATIO = 0.6
# No effect moves a reading by more, K; what does is an explicit law that its steps cannot follow.
LARGEST_CHANGE = 300.0
# A mimic that leaves a residual below this is indistinguishable from the truth.
TWIN_RATIO, TWIN_CHI2 = 0.4, 14.0
HEAVY = ("thermal_preload", "gap_closure", "grease_churning", "unrecorded_heat_source", "starvation")


def choose_effects(number: int, rng: np.random.Generator) -> list[str]:
    """Effects that the case conceals: a quarter none, half one, a quarter two.

    Single effects go through the whole catalogue in turn so that none is left to chance.
    """
    slot = (number - 1) % 8
    turn = (number - 1) // 8
    if slot in (0, 4):
        return []
    if slot in (3, 7):
        first = str(rng.choice([*HEAVY, *MACHINE_EFFECTS]))
        rest = [n for n in (SENSOR_EFFECTS if rng.random() < 0.35 else MACHINE_EFFECTS) if n != first]
        return [first, str(rng.choice(rest))]
    names = list(EVERY_EFFECT)
    order = np.random.default_rng(20_001).permutation(len(names))
    return [names[order[(4 * turn + {1: 0, 2: 1, 5: 2, 6: 3}[slot]) % len(names)]]]


def _apply(
    model: ReducedSpindle, plan: Plan, as_built: dict[str, float], effects: list[Concealed]
) -> np.ndarray:
    laws = tuple(e.machine for e in effects if e.machine is not None)
    readings = run(model, plan.drive, as_built, laws).readings
    for effect in effects:
        if effect.sensor is not None:
            readings = effect.sensor.apply(plan.drive.time, readings, plan.drive.ambient)
    return readings


def what_is_known(study: Study, effects: list[Concealed]) -> dict[str, object]:
    """Ratio of the effect after a re-fit, what is left without each and by each of three alone, mimics."""
    parts = [[e.machine or e.sensor for e in effects if e is not left] for left in effects]
    whole = [e.machine or e.sensor for e in effects]
    truth = study.simulate(whole)
    change = study.diagnosed_only(truth)
    none = np.empty((change.size, 0))
    ratio, chi2 = study.fit_through_model(truth, None, none)
    each = []
    if len(effects) > 1:
        for effect, rest in zip(effects, parts, strict=True):
            direction = study.diagnosed_only(study.simulate(rest))
            left = study.fit_linear(change, direction[:, None])
            each.append({"effect": effect.effect, "ratio": round(left[0], 3), "chi2": round(left[1], 1)})
    alone = []
    if len(effects) > 2:
        for effect in effects:
            direction = study.diagnosed_only(study.simulate([effect.machine or effect.sensor]))
            left = study.fit_linear(change, direction[:, None])
            alone.append({"effect": effect.effect, "ratio": round(left[0], 3), "chi2": round(left[1], 1)})
    mimics = [*machine_mimics(study.model, study.plan), *sensor_mimics()]
    columns = [study.mimic_column(mimic, []) for mimic in mimics]
    table = []
    for mimic, column in zip(mimics, columns, strict=True):
        left = study.fit_mimic(change, mimic, column)
        table.append([mimic, column, *left])
    table.sort(key=lambda row: row[3])
    # Far from an explanation already in the linear fit, a mimic is not worth runs of the model.
    for row in [row for row in table[:5] if row[2] < 2.5]:
        through = study.fit_through_model(truth, row[0], row[1])
        if through[1] < row[3]:
            row[2:] = through
    table.sort(key=lambda row: row[3])
    best, seen = [], set()
    own = {(e.effect) for e in effects}
    for mimic, _, left_ratio, left_chi2 in table:
        key = (mimic.effect, mimic.component)
        if mimic.effect in own or key in seen:
            continue
        seen.add(key)
        best.append(
            {
                "effect": mimic.effect,
                "component": mimic.component,
                "form": mimic.form,
                "ratio": round(left_ratio, 3),
                "chi2": round(left_chi2, 1),
            }
        )
    same = [row for row in table if row[0].effect in own]
    twins = []
    if len(effects) == 2:
        twins = _pair_twins(study, effects, parts, change, mimics, columns)
    return {
        "ratio": round(ratio, 3),
        "chi2": round(chi2, 1),
        "each": each,
        "alone": alone,
        "own_simple_form": {"ratio": round(same[0][2], 3), "chi2": round(same[0][3], 1)} if same else None,
        "best_mimics": best[:6],
        "pair_mimics": twins,
    }


def _pair_twins(study, effects, parts, change, mimics, columns) -> list[dict[str, object]]:
    out = []
    for (effect, rest), kept in zip(zip(effects, parts, strict=True), effects[::-1], strict=True):
        direction = study.diagnosed_only(study.simulate(rest))
        rows = []
        for mimic, column in zip(mimics, columns, strict=True):
            if mimic.effect in (effect.effect, kept.effect):
                continue
            left = study.fit_mimic(change, mimic, column, direction[:, None])
            rows.append((left[1], left[0], mimic))
        chi2, ratio, mimic = min(rows, key=lambda row: row[0])
        out.append(
            {
                "kept": kept.effect,
                "instead_of": effect.effect,
                "effect": mimic.effect,
                "component": mimic.component,
                "ratio": round(ratio, 3),
                "chi2": round(chi2, 1),
            }
        )
    return out


def _unseen(ratio: float, chi2: float) -> bool:
    return ratio < UNSEEN_RATIO or chi2 < UNSEEN_CHI2


def _twin(left: dict[str, float], total_chi2: float) -> bool:
    return left["ratio"] < TWIN_RATIO or left["chi2"] < max(
        TWIN_CHI2, 0.01 * total_chi2 if left["ratio"] < 0.6 else 0
    )


def _draw_effects(
    wanted: list[str], study: Study, plain: Path, plan: Plan, rng: np.random.Generator
) -> tuple[list[Concealed], float]:
    """Draw each effect so strong that it leaves about a drawn ratio to the noise after a re-fit."""
    low, high = [(2.0, 14.0), (0.8, 2.0), (0.1, 0.8)][int(rng.choice(3, p=[0.68, 0.2, 0.12]))]
    effects: list[Concealed] = []
    target = 0.0
    for effect in wanted:
        target = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        child = int(rng.integers(2**31))
        strength = 1.0
        for _ in range(4):
            scene = Scene(np.random.default_rng(child), study.model, plan, plain, strength)
            drawn = EVERY_EFFECT[effect](scene)
            change = study.diagnosed_only(study.simulate([drawn.machine or drawn.sensor]))
            ratio = study.fit_linear(change, np.empty((change.size, 0)))[0]
            if 0.85 < ratio / target < 1.2 or (ratio < target and strength >= 1.5):
                break
            strength = float(
                np.clip(strength * target / max(ratio, 1e-3), 0.25 * strength, min(1.5, 3.0 * strength))
            )
        effects.append(drawn)
        # The second of a pair has to be seen, or the pair is none.
        low, high = max(low, 1.5), max(high, 8.0)
    return effects, target


def draw_stable(
    wanted: list[str], study: Study, plain: Path, plan: Plan, rng: np.random.Generator
) -> tuple[list[Concealed], float]:
    """Effects whose explicit laws stay finite in the steps of the identification, too.

    Raises
    ------
    ArithmeticError
        None of several draws does.
    """
    for _ in range(8):
        effects, target = _draw_effects(wanted, study, plain, plan, rng)
        change = study.diagnosed_only(study.simulate([e.machine or e.sensor for e in effects]))
        if np.isfinite(change).all() and np.abs(change).max() < LARGEST_CHANGE:
            return effects, target
    raise ArithmeticError(f"{', '.join(wanted)}: no draw stays finite.")


def _verdict_of(effects: list[Concealed]) -> str:
    kinds = {e.kind for e in effects}
    for kind in ("missing_physics", "parameter", "sensor"):
        if kind in kinds:
            return kind
    return "consistent"


def effects_set(effects: list[Concealed]) -> list[dict[str, object]]:
    """A set in the form of the answers."""
    return [{"effect": e.effect, "components": e.acceptable} for e in effects]


def judge(effects: list[Concealed], known: dict[str, object] | None, calibrated: bool) -> dict[str, object]:
    """Verdict, what else counts as right, and how clear the case is."""
    verdict = _verdict_of(effects)
    out: dict[str, object] = {
        "verdict": verdict,
        "true_verdict": verdict,
        "acceptable_verdicts": [verdict],
        "detectable": True,
        "clear": bool(effects),
        "acceptable_sets": [effects_set(effects)],
        "indistinguishable": [],
    }
    if not effects or known is None:
        return out
    verdicts = out["acceptable_verdicts"]
    total = float(known["chi2"])
    if _unseen(known["ratio"], total):
        out["detectable"] = out["clear"] = False
        verdicts += ["consistent", "ambiguous"]
        out["acceptable_sets"].append([])
        return out
    faint = known["ratio"] < CLEAR_RATIO or total < CLEAR_CHI2
    if faint:
        out["clear"] = False
        if known["ratio"] < 0.6 or total < 50.0:
            verdicts.append("consistent")
            out["acceptable_sets"].append([])
    for effect, part in zip(effects, known["each"], strict=False):
        rest = [e for e in effects if e is not effect]
        if _unseen(part["ratio"], part["chi2"]):
            out["clear"] = False
            out["acceptable_sets"].append(effects_set(rest))
            if _verdict_of(rest) not in verdicts:
                verdicts.append(_verdict_of(rest))
        elif part["ratio"] < FAINT_RATIO or part["chi2"] < CLEAR_CHI2 / 2:
            out["clear"] = False
            out["acceptable_sets"].append(effects_set(rest))
            verdicts.append(_verdict_of(rest))
    # Of three, one alone may leave nothing that shows of the other two together.
    for effect, part in zip(effects, known.get("alone", ()), strict=False):
        if part["ratio"] < FAINT_RATIO or part["chi2"] < CLEAR_CHI2 / 2:
            out["clear"] = False
            out["acceptable_sets"].append(effects_set([effect]))
            verdicts.append(_verdict_of([effect]))
    twins = [t for t in (*known["best_mimics"], *known["pair_mimics"]) if _twin(t, total)]
    if twins:
        out["clear"] = False
        verdicts.append("ambiguous")
    own, best = known["own_simple_form"], known["best_mimics"]
    if all(not _unseen(part["ratio"], part["chi2"]) for part in known["each"]):
        # As near as the truth's own plain law comes; unrecorded heat is the fallback where no other law fits.
        plain = float(own["chi2"]) if own and len(effects) == 1 else 0.0
        out["indistinguishable"] = [
            t for t in twins if t["chi2"] < plain + TWIN_CHI2 and not t["effect"].startswith("unrecorded_")
        ]
    out["simple_form_loses"] = bool(
        own and best and len(effects) == 1 and best[0]["chi2"] < own["chi2"] + 10.0
    )
    if out["simple_form_loses"]:
        # The truth's law is so rich that another effect's plain law comes as close as its own.
        out["clear"] = False
    if any(e.outside_catalogue for e in effects):
        out["clear"] = False
        verdicts += ["unexplained", "ambiguous"]
    elif not calibrated and verdict == "parameter" and faint:
        verdicts.append("consistent")
    out["acceptable_verdicts"] = list(dict.fromkeys(verdicts))
    return out


def effect_answer(effect: Concealed) -> dict[str, object]:
    """Answer about one effect."""
    return {
        "effect": effect.effect,
        "kind": effect.kind,
        "component": effect.component,
        "acceptable_components": effect.acceptable,
        "amplitude": float(f"{effect.amplitude:.4g}"),
        "parameters": {n: {"value": float(v), "unit": u} for n, (v, u) in effect.parameters.items()},
        "intervals": effect.intervals,
        "follows": effect.follows,
        "outside_catalogue": effect.outside_catalogue,
        "truth_form": effect.form,
    }


def make_case(
    model: ReducedSpindle, folder: FilePath, seed: int, number: int, *, identify: bool = True
) -> dict[str, object]:
    """Draw, simulate and write one case; return its answer."""
    rng = np.random.default_rng([seed, number])
    name = f"case_{number:04d}"
    as_built = draw_as_built(rng)
    noise = draw_noise(rng)
    wanted = choose_effects(number, rng)
    plan = plan_for(wanted, rng)
    calibration = draw_drive(rng) if rng.random() < 0.5 else None
    plain = run(model, plan.drive, as_built)
    study = Study(model, plan, calibration, as_built, noise) if wanted else None
    effects, target = draw_stable(wanted, study, plain, plan, rng) if study else ([], 0.0)
    readings = _apply(model, plan, as_built, effects)
    inputs = folder / "inputs" / name
    rows = {"recording": record(inputs, "recording", name, plan, readings, noise, rng)}
    if calibration is not None:
        clean = run(model, calibration.drive, as_built).readings
        rows["calibration"] = record(
            inputs, "calibration", f"{name} calibration", calibration, clean, noise, rng
        )
    known = None
    if effects and identify:
        known = what_is_known(study, effects)
    answer = {
        "schema": "spindle-fem/answer/1",
        "case": name,
        "two_recordings": calibration is not None,
        "noise": noise.answer(),
        "as_built": {k: round(v, 4) for k, v in as_built.items()},
        "identifiability": known,
        **judge(effects, known, calibration is not None),
        "effects": [effect_answer(e) for e in effects],
        "primary_component": [e.component for e in effects],
        "target_ratio": round(target, 3),
        "cycle": plan.cycle,
        "oil": plan.oil,
        "rows": rows,
    }
    answers = folder / "answers"
    answers.mkdir(parents=True, exist_ok=True)
    (answers / f"{name}.json").write_text(json.dumps(answer, indent=1), encoding="utf-8")
    return answer


def plan_for(wanted: list[str], rng: np.random.Generator) -> Plan:
    """A cycle that excites the wanted effects, most of the time."""
    cycle, oil = None, None
    if rng.random() < 0.7:
        if "coolant_film" in wanted:
            oil = str(rng.choice(["stairs", "step"]))
        if any(e in wanted for e in ("starvation", "windage", "thrust_heat")):
            cycle = str(rng.choice(["staircase", "random"])) if "thrust_heat" not in wanted else "random"
        if "grease_churning" in wanted or "ambient_drift" in wanted:
            cycle = str(rng.choice(["hold", "random", "two_level"]))
        if "clock_shift" in wanted or "sensor_lag" in wanted:
            cycle = str(rng.choice(["intermittent", "random"]))
    return draw_drive(rng, cycle=cycle, oil=oil)


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = study_options(__doc__, cases=200, seed=7)
    parser.add_argument("--cache", type=FilePath, default=None, help="folder of the reduced machine")
    parser.add_argument("--no-identifiability", action="store_true")
    given = parser.parse_args(arguments)
    model = load_reduced(given.cache)
    identify = not given.no_identifiability
    write_study(given, lambda number: make_case(model, given.output, given.seed, number, identify=identify))


if __name__ == "__main__":
    main()
