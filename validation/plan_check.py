"""Compare predictions of ``diagnose --plan`` with diagnoses of the same recordings.

``python -m validation.plan_check RESULTS [--study DIR | --recordings DIR] [--only NAME ...]`` plans every
case that hides one effect and has a diagnosis in RESULTS, with the case's machine, sensors, inputs and
calibration recording, and compares. Answers are read for the concealed effect and its size only. Prints a
table, leaves ``RESULTS/plan_check.json``.

*Told apart*: the plan says that the concealed effect is seen and distinguished from every other; the
diagnosis must name it (``exactly``: and nothing beside it). *Not told apart*: the plan says that it is not
seen, or not told from something; the diagnosis must not claim one set alone, with probability
``tuned.DECIDED`` (``nothing_wrong_claimed``: not a wrong one).
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .asked import wilson
from .open_examples import MESH, accepted_sets, cases_of, examples
from .score import first_right, matches, ranked_sets


def cases(results: Path, study: Path | None, recordings: Path) -> Iterator[tuple[str, Path, str, Path]]:
    """Name, folder of inputs, machine and answer of every case that has a diagnosis."""
    found = examples(recordings) if study is None else cases_of(study)
    for name, (folder, machine, answer) in found.items():
        if (results / name / "diagnosis.json").exists() and answer.exists():
            yield name, folder, machine, answer


def concealed(answer: dict[str, Any]) -> dict[str, Any] | None:
    """The one effect that an answer holds; None for none or several."""
    effects = answer.get("effects", answer.get("acceptable", []))
    return effects[0] if len(effects) == 1 else None


def multiple_of(item: Any, effect: dict[str, Any]) -> float:
    """Concealed size over the usual one, where the answer states it in the effect's own parameter; else 1.

    A quantity whose logarithm counts is compared by its logarithm.
    """
    stated = {name: float(entry["value"]) for name, entry in effect.get("parameters", {}).items()}
    multiples = np.geomspace(0.01, 30.0, 400)
    name = item.reported(1.0)[0]
    if name not in stated:
        return 1.0
    told = [item.reported(float(multiple))[1] for multiple in multiples]
    wanted, null = stated[name], 1.0 if name in ("factor", "gain") else 0.0
    size, sizes = wanted - null, np.array(told) - null
    if name == "factor":
        size, sizes = np.log(wanted), np.log(np.maximum(told, 1e-9))
    # Less than nothing is as far from nothing the other way.
    return float(multiples[np.argmin(np.abs(np.abs(sizes) - abs(size)))])


def held_against(planned: Any, answer: dict[str, Any], diagnosis: dict[str, Any]) -> dict[str, Any] | None:
    """Prediction of the plan about the concealed effect of one case, and outcome of the diagnosis."""
    from spindle_fem.inference import tuned

    effect = concealed(answer)
    components = effect.get("acceptable_components", effect.get("components", effect["component"]))
    components = [components] if isinstance(components, str) else components
    plan = planned.plan
    own = [
        index
        for index, item in enumerate(plan.hypotheticals)
        if item.effect == effect["effect"] and item.component in components
    ]
    if not own:
        return None
    index = min(own, key=lambda i: components.index(plan.hypotheticals[i].component))
    multiple = multiple_of(plan.hypotheticals[index], effect)
    told_from = plan.separation.told_from[index]
    # Effects that also count as right need not be distinguished.
    accepted = [one for group in accepted_sets(answer) if len(group) == 1 for one in group]
    rivals = [
        j
        for j, item in enumerate(plan.hypotheticals)
        if plan.comparable[index, j]
        and j not in own
        and not any(matches([vars_of(item)], [_listed(one)], place=True) for one in accepted)
    ]
    confused = [j for j in rivals if not told_from[j] <= multiple]
    sets = ranked_sets(diagnosis)
    found, probability = sets[0]
    right = first_right({"acceptable_sets": [[_listed(o) for o in g] for g in accepted_sets(answer)]}, found)
    decided = diagnosis["verdict"] not in ("ambiguous", "unexplained") and probability >= tuned.DECIDED
    names = [f"{plan.hypotheticals[j].effect}@{plan.hypotheticals[j].component}" for j in confused]
    instead = [f"{f['effect']}@{f['component']}" for f in found]
    named = any(
        matches([finding], [_listed(effect | {"components": components})], place=True) for finding in found
    )
    return {
        "truth": f"{effect['effect']}@{effect['component']}",
        "multiple": multiple,
        "seen": bool(plan.separation.seen_from[index] <= multiple),
        "seen_from": float(plan.separation.seen_from[index]),
        "not_told_from": names,
        "told_apart": not confused and bool(plan.separation.seen_from[index] <= multiple),
        "found": instead,
        "verdict": diagnosis["verdict"],
        "probability": probability,
        "named": named or right,
        "right": right,
        "claimed": decided and bool(found),
        "claimed_wrong": decided and bool(found) and not right,
        "named_a_confused_one": not right and any(name in names for name in instead),
    }


def vars_of(item: Any) -> dict[str, str]:
    """Effect and place of a hypothetical as a finding has them."""
    return {"effect": item.effect, "component": item.component}


def _listed(one: dict[str, Any]) -> dict[str, Any]:
    wanted = one["components"]
    return one | {"components": [wanted] if isinstance(wanted, str) else wanted}


def summarise(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Required shares, with Wilson's intervals."""

    def share(kept: list[dict[str, Any]], of: list[dict[str, Any]]) -> dict[str, Any]:
        if not of:
            return {"of": 0, "share": None}
        low, high = wilson(len(kept) / len(of), len(of))
        return {"of": len(of), "share": len(kept) / len(of), "low": low, "high": high}

    told = [row for row in rows if row["told_apart"]]
    others = [row for row in rows if not row["told_apart"]]
    return {
        "told_apart_and_named": share([r for r in told if r["named"]], told),
        "told_apart_and_named_exactly": share([r for r in told if r["right"]], told),
        "not_told_apart_and_not_claimed": share([r for r in others if not r["claimed"]], others),
        "not_told_apart_and_nothing_wrong_claimed": share(
            [r for r in others if not r["claimed_wrong"]], others
        ),
        "not_told_apart_but_named": share([r for r in others if r["right"]], others),
    }


def main(arguments: list[str] | None = None) -> None:
    """Plan every case, compare, print."""
    from spindle_fem.commands.plan_command import planned_measurement
    from spindle_fem.errors import SpindleFemError

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("--study", type=Path, default=None, help="folder of a generated study")
    parser.add_argument("--recordings", type=Path, default=Path("../shared/recordings"))
    parser.add_argument("--only", nargs="*", default=[], help="names or beginnings of names")
    given = parser.parse_args(arguments)
    rows = []
    for name, folder, machine, path in cases(given.results, given.study, given.recordings):
        answer = json.loads(path.read_text(encoding="utf-8"))
        if concealed(answer) is None or (given.only and not name.startswith(tuple(given.only))):
            continue
        calibration = folder / "calibration.toml"
        try:
            planned = planned_measurement(
                machine,
                test=folder / "recording.toml",
                calibrate=[calibration] if calibration.exists() else [],
                overrides=() if machine.endswith(".toml") else MESH,
                compare=False,
            )
        except SpindleFemError as error:
            print(f"{name:12s} refused: {error}", flush=True)
            continue
        diagnosis = json.loads((given.results / name / "diagnosis.json").read_text(encoding="utf-8"))
        row = held_against(planned, answer, diagnosis)
        if row is None:
            print(f"{name:12s} the plan does not know the effect", flush=True)
            continue
        rows.append({"case": name} | row)
        confused = ", ".join(row["not_told_from"][:4]) + (" ..." if len(row["not_told_from"]) > 4 else "")
        print(
            f"{name:12s} {'told' if row['told_apart'] else 'not ':4s} "
            f"{'right' if row['right'] else 'among' if row['named'] else 'wrong':5s} "
            f"{row['truth']:44s} x {row['multiple']:5.2f} seen from {row['seen_from']:5.2f} "
            f"-> {row['verdict']} {row['probability']:.2f} {'+'.join(row['found'])} | not from: {confused}",
            flush=True,
        )
    summary = summarise(rows)
    (given.results / "plan_check.json").write_text(
        json.dumps({"summary": summary, "cases": rows}, indent=1), encoding="utf-8"
    )
    for key, value in summary.items():
        print(f"{key:44s} {json.dumps(value)}")


if __name__ == "__main__":
    main()
