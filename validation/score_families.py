"""Score a study family by family: ``python -m validation.score_families STUDY RESULTS [--json FILE]``.

For studies of networks and of machines with geometry alike. A case is right where the first set is one that
its answer accepts, places and verdict, too; a consistent one where the verdict is ``consistent``. Shares come
with Wilson's 90 % interval. Whatever has both an answer and a diagnosis counts; a case that failed is wrong.
"""

import argparse
import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from .asked import wilson
from .score import coverage, first_right, matches, ranked_sets, undecidable

SURE = 0.9
SEEN_OVER_NOISE = 3.0
SENSOR = "sensor_"


def merged(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Spans in order, those that touch as one.

    >>> merged([(5, 7), (0, 2), (1, 3)])
    [(0, 3), (5, 7)]
    """
    out: list[tuple[float, float]] = []
    for start, end in sorted(spans):
        if out and start <= out[-1][1]:
            out[-1] = (out[-1][0], max(out[-1][1], end))
        elif end > start:
            out.append((start, end))
    return out


def overlap_score(true: list[tuple[float, float]], found: list[tuple[float, float]]) -> float:
    """F1 by time: twice the common time over the sum of both.

    >>> overlap_score([(0, 10)], [(5, 15)])
    0.5
    """
    first, second = merged(true), merged(found)
    both = sum(max(0.0, min(b, d) - max(a, c)) for a, b in first for c, d in second)
    length = sum(b - a for a, b in (*first, *second))
    return 2.0 * both / length if length else 0.0


def states_of(folder: Path, diagnosis: dict[str, Any]) -> list[tuple[float, float]]:
    """When the machine was found in a state that no input explains, from the table or from the findings."""
    table = folder / "states.csv"
    if table.exists():
        with table.open(encoding="utf-8") as stream:
            rows = [r for r in csv.DictReader(stream) if not r["effect"].startswith(SENSOR)]
        return [(float(r["start"]), float(r["end"])) for r in rows]
    return [
        (float(span["start"]), float(span["end"]))
        for finding in diagnosis["findings"]
        if not finding["effect"].startswith(SENSOR)
        for span in finding.get("intervals") or []
    ]


def accepted(answer: dict[str, Any]) -> dict[str, Any]:
    """The answer with sets that count as right; nothing found, for a consistent machine."""
    return answer if answer["acceptable_sets"] else answer | {"acceptable_sets": [[]]}


def must_be_told(answer: dict[str, Any]) -> bool:
    """Whether what reads like a case's effects has to be named: what is too faint may be left unsaid."""
    if answer.get("indistinguishable"):
        return undecidable(answer)
    return [] not in answer["acceptable_sets"]


def family_of(answer: dict[str, Any]) -> str:
    """Family of a case; several families together are a pair, whichever they are."""
    return "pair" if "+" in answer["family"] else answer["family"]


def score_row(answer: dict[str, Any], diagnosis: dict[str, Any], folder: Path) -> dict[str, Any]:
    """What one case says."""
    sets = ranked_sets(diagnosis)
    found, probability = sets[0]
    consistent = answer["true_verdict"] == "consistent"
    right_sets = accepted(answer)
    rank = next((k + 1 for k, (one, _) in enumerate(sets) if first_right(right_sets, one)), None)
    verdict_right = diagnosis["verdict"] in answer["acceptable_verdicts"]
    first = rank == 1
    in_place = any(matches(found, wanted, place=True) for wanted in right_sets["acceptable_sets"])
    here = [
        f
        for f in found
        if any(
            f["effect"] == e["effect"] and f["component"] in e["acceptable_components"]
            for e in answer["effects"]
        )
    ]
    fit, noise = diagnosis["fit"], answer["noise"]["total_K"]
    before, after = (fit[when]["heldout_rmse_K"] for when in ("before", "after"))
    hidden = [e for e in answer["effects"] if e.get("intervals")]
    spans = [(a, b) for e in hidden for a, b in e["intervals"]]
    moves = [e["moves_over_noise"] for e in hidden if e.get("moves_over_noise") is not None]
    timing = folder / "timing.json"
    return {
        "case": answer["case"],
        "family": family_of(answer),
        "machine": answer.get("machine", answer.get("profile", "")),
        "truth": [f"{e['effect']}@{e['component']}" for e in answer["effects"]],
        "found": [f"{f['effect']}@{f['component']}" for f in found],
        "probability": probability,
        "verdict": diagnosis["verdict"],
        "true_verdict": answer["true_verdict"],
        "consistent": consistent,
        "detectable": consistent or answer["detectable"],
        "clear": bool(answer.get("clear")),
        "undecidable": answer["verdict"] == "ambiguous",
        "ratio": (answer.get("identifiability") or {}).get("ratio"),
        "right": (diagnosis["verdict"] == "consistent") if consistent else in_place and verdict_right,
        "set_first": first,
        "verdict_right": verdict_right,
        "within_three": rank is not None and rank <= 3,
        "flagged": diagnosis["verdict"] != "consistent",
        "confident_wrong": bool(found)
        and probability > SURE
        and not first
        and diagnosis["verdict"] != "ambiguous",
        "called_undecidable": diagnosis["verdict"] == "ambiguous" and rank is not None
        if must_be_told(answer)
        else None,
        "place": all(f in here for f in found if f["effect"] in {e["effect"] for e in answer["effects"]})
        if any(f["effect"] in {e["effect"] for e in answer["effects"]} for f in found)
        else None,
        "states_f1": overlap_score(spans, states_of(folder, diagnosis)) if spans else None,
        "states_seen": bool(moves) and max(moves) >= SEEN_OVER_NOISE,
        "intervals": [c for c in coverage(answer, here) if c["same_extent"]],
        "before_over_noise": before / noise if before else None,
        "after_over_noise": after / noise if after else None,
        "cpu_s": json.loads(timing.read_text(encoding="utf-8"))["cpu_s"] if timing.exists() else None,
        "failed": False,
    }


def failed_row(answer: dict[str, Any]) -> dict[str, Any]:
    """A case whose diagnosis raised: wrong, and nothing more."""
    consistent = answer["true_verdict"] == "consistent"
    return {
        "case": answer["case"],
        "family": family_of(answer),
        "machine": answer.get("machine", answer.get("profile", "")),
        "truth": [f"{e['effect']}@{e['component']}" for e in answer["effects"]],
        "found": [],
        "probability": 0.0,
        "verdict": "failed",
        "true_verdict": answer["true_verdict"],
        "consistent": consistent,
        "detectable": consistent or answer["detectable"],
        "clear": bool(answer.get("clear")),
        "undecidable": False,
        "right": False,
        "set_first": False,
        "verdict_right": False,
        "within_three": False,
        "flagged": consistent,
        "confident_wrong": False,
        "failed": True,
    }


def share(rows: list[dict[str, Any]], key: str) -> dict[str, Any]:
    """Share of the rows with a value for which it is true, of how many, Wilson's 90 % interval."""
    values = [bool(r[key]) for r in rows if r.get(key) is not None]
    part = float(np.mean(values)) if values else None
    low, high = wilson(part, len(values)) if values else (None, None)
    return {"share": part, "of": len(values), "low": low, "high": high}


def middle(values: list[float | None]) -> dict[str, Any]:
    """Median, ninth decile and worst of what is there."""
    kept = [v for v in values if v is not None]
    if not kept:
        return {"of": 0, "median": None, "p90": None, "worst": None}
    q = np.quantile(kept, [0.5, 0.9, 1.0])
    return {"of": len(kept), "median": float(q[0]), "p90": float(q[1]), "worst": float(q[2])}


def figures(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of some rows; with effects that cannot be seen left out of what has to be named."""
    shown = [r for r in rows if not r["consistent"] and r["detectable"]]
    clear = [r for r in shown if not r["undecidable"]]
    doubtful = [r for r in shown if r["undecidable"] and r.get("called_undecidable") is not None]
    # A guess among sets that read alike would name the right one in half of the cases at most.
    decided = [
        r | {"as_it_is": sorted(r["found"]) == sorted(r["truth"])}
        for r in doubtful
        if r["found"] and r["verdict"] != "ambiguous"
    ]
    stated = [c for r in rows for c in r.get("intervals", [])]
    return {
        "cases": len(rows),
        "failed": sum(r["failed"] for r in rows),
        "right": share([r for r in rows if r["detectable"]], "right"),
        "clear_right": share([r for r in shown if r.get("clear")], "right"),
        "set_first": share(shown, "set_first"),
        "within_three": share(shown, "within_three"),
        "flagged_of_consistent": share([r for r in rows if r["consistent"]], "flagged"),
        "place": share(shown, "place"),
        "confident_wrong": share(rows, "confident_wrong"),
        "undecidable_called": share(doubtful, "called_undecidable"),
        "undecidable_named": share(decided, "as_it_is"),
        "intervals_hold": share(stated, "inside"),
        "states_f1": middle([r.get("states_f1") for r in shown if r.get("states_seen")]),
        "after_over_noise": middle([r.get("after_over_noise") for r in clear if r["set_first"]]),
        "cpu_s": middle([r.get("cpu_s") for r in rows]),
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Figures of all, by family, by kind of machine, by number of effects."""

    def split(key) -> dict[str, Any]:
        return {str(k): figures([r for r in rows if key(r) == k]) for k in sorted({key(r) for r in rows})}

    return {
        "all": figures(rows),
        "by_family": split(lambda r: r["family"]),
        "by_machine": split(lambda r: r["machine"]),
        "by_number": split(lambda r: len(r["truth"])),
    }


def score_study(study: Path, results: Path) -> list[dict[str, Any]]:
    """Rows of every case that was tried, in order."""
    rows = []
    for path in sorted((study / "answers").glob("*.json")):
        answer = json.loads(path.read_text(encoding="utf-8"))
        folder = results / answer["case"]
        if (folder / "diagnosis.json").exists():
            diagnosis = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
            rows.append(score_row(answer, diagnosis, folder))
        elif (folder / "failed.json").exists():
            rows.append(failed_row(answer))
    return rows


def percent(one: dict[str, Any]) -> str:
    """A share as text.

    >>> percent({"share": 0.5, "of": 10, "low": 0.27, "high": 0.73})
    '50 % (27–73) of 10'
    """
    if not one["of"]:
        return "–"
    return f"{100 * one['share']:.0f} % ({100 * one['low']:.0f}–{100 * one['high']:.0f}) of {one['of']}"


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("--json", type=Path, default=None, help="default: RESULTS/families.json")
    given = parser.parse_args(arguments)
    rows = score_study(given.study, given.results)
    found = summary(rows)
    target = given.json or given.results / "families.json"
    target.write_text(json.dumps({"summary": found, "cases": rows}, indent=1), encoding="utf-8")
    for row in rows:
        print(
            f"{'+' if row['right'] else '-'} {row['case']} {row['family']:32s} {row['verdict']:15s} "
            f"p {row['probability']:.2f} {', '.join(row['found']) or '(nothing)'}"
            f"   truth: {', '.join(row['truth']) or '(nothing)'}"
            + (f"   F1 {row['states_f1']:.2f}" if row.get("states_f1") is not None else "")
        )
    columns = ("right", "clear_right", "within_three", "flagged_of_consistent")
    columns += ("intervals_hold", "confident_wrong")
    print(f"\n{'':34s}" + "".join(f"{c:>24s}" for c in columns) + f"{'F1':>8s}")
    for name, part in {"all": found["all"], **found["by_family"], **found["by_machine"]}.items():
        f1 = part["states_f1"]["median"]
        line = "".join(f"{percent(part[c]):>24s}" for c in columns)
        print(f"{name:34s}{line}{'' if f1 is None else f'{f1:8.2f}'}")


if __name__ == "__main__":
    main()
