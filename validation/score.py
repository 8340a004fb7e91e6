"""Score diagnoses against answers: ``python -m validation.score DIR RESULTS [--json FILE]``."""

import argparse
import itertools
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import kstest

from .asked import held_against_asked

VERDICTS = ("consistent", "parameter", "sensor", "missing_physics", "ambiguous", "unexplained")
FAULTY_ABOVE = 0.9


def matches(found: list[dict[str, Any]], wanted: list[dict[str, Any]], *, place: bool = False) -> bool:
    """Whether found effects are those of a set, each once; with ``place`` at an accepted component."""
    if len(found) != len(wanted):
        return False
    rest = list(wanted)
    for finding in found:
        for want in rest:
            here = not place or finding["component"] in want["components"]
            if finding["effect"] == want["effect"] and here:
                rest.remove(want)
                break
        else:
            return False
    return True


def true_set(answer: dict[str, Any]) -> list[dict[str, Any]]:
    """Concealed effects as a set with accepted components."""
    return [{"effect": e["effect"], "components": e["acceptable_components"]} for e in answer["effects"]]


def ranked_sets(diagnosis: dict[str, Any]) -> list[tuple[list[dict[str, Any]], float]]:
    """The findings and the alternatives with their probabilities, most probable first."""
    findings = diagnosis["findings"]
    # A finding's own probability is its share of its set's, which is stored beside it.
    stated = diagnosis.get("set_probability")
    if stated is None:
        stated = min((f["probability"] for f in findings), default=1.0)
    sets = [(findings, float(stated))]
    sets += [(a["findings"], float(a["probability"])) for a in diagnosis.get("alternatives", [])]
    return sets


def first_right(answer: dict[str, Any], found: list[dict[str, Any]]) -> bool:
    """Whether a set is one of the acceptable ones."""
    return any(matches(found, wanted) for wanted in answer["acceptable_sets"])


def score_case(answer: dict[str, Any], diagnosis: dict[str, Any], wall: float | None) -> dict[str, Any]:
    """Scores of one case."""
    truth = true_set(answer)
    sets = ranked_sets(diagnosis)
    found, probability = sets[0]
    within = next((i + 1 for i, (s, _) in enumerate(sets) if matches(s, truth)), None)
    named = next((f for f in found for t in truth if f["effect"] == t["effect"]), None)
    places = [f["component"] in t["components"] for f in found for t in truth if f["effect"] == t["effect"]]
    where = (diagnosis.get("mismatch") or {}).get("where") or {}
    all_places = {c for t in truth for c in t["components"]}
    located = None
    if truth and diagnosis["mismatch"]["detected"]:
        pointed = {f["component"] for f in found} or {where.get("component")}
        located = bool(pointed & all_places)
    fit = diagnosis["fit"]
    noise = noise_of(answer)
    after = fit["after"]["heldout_rmse_K"]
    return {
        "case": answer["case"],
        "truth": [f"{e['effect']}@{e['component']}" for e in answer["effects"]],
        "found": [f"{f['effect']}@{f['component']}" for f in found],
        "probability": probability,
        "alternatives": [
            {"set": [f"{f['effect']}@{f['component']}" for f in s], "probability": p} for s, p in sets[1:4]
        ],
        "verdict": diagnosis["verdict"],
        "true_verdict": answer["true_verdict"],
        "verdict_right": diagnosis["verdict"] in answer["acceptable_verdicts"],
        "detected": bool(diagnosis["mismatch"]["detected"]),
        "p_value": diagnosis["mismatch"].get("p_value"),
        "consistent": not truth,
        "clear": answer["clear"],
        "detectable": answer["detectable"],
        "ambiguous": bool(answer.get("indistinguishable")),
        "undecidable": undecidable(answer),
        "foreign": any(e.get("outside_catalogue") for e in answer["effects"]),
        "ratio": (answer["identifiability"] or {}).get("ratio"),
        "calibrated": answer["two_recordings"],
        "first": first_right(answer, found),
        "exact": matches(found, truth),
        "rank": within,
        "first_effect": named is not None,
        "place": all(places) if places else None,
        "located": located,
        "law": followed(answer, found),
        "coverage": coverage(answer, found),
        "after_over_noise": after / noise if noise and after is not None else None,
        "changes_unseen": changes_unseen(answer, diagnosis),
        "before_over_noise": fit["before"]["heldout_rmse_K"] / noise
        if noise and fit["before"]["heldout_rmse_K"]
        else None,
        "wall_s": wall,
    }


def undecidable(answer: dict[str, Any]) -> bool:
    """Whether something reads like an effect that has to be named.

    What is so faint that the sets that count as right are without it may be left unsaid, and what reads
    like it as well.
    """
    names = [e["effect"] for e in answer["effects"]]
    right = [sorted(e["effect"] for e in accepted) for accepted in answer["acceptable_sets"]]
    for twin in answer.get("indistinguishable", []):
        left = list(names)
        left.remove(twin.get("instead_of", names[0]))
        if sorted(left) not in right:
            return True
    return False


def changes_unseen(answer: dict[str, Any], diagnosis: dict[str, Any]) -> bool:
    """Whether a sensor came off amid a held-out stretch, where no fitted reading shows the time.

    Heat that comes and goes shows in the readings after the stretch; a sensor error leaves no trace.
    """
    moments = [
        effect["truth_form"].get("onset", 0.0) for effect in answer["effects"] if effect["kind"] == "sensor"
    ]
    hidden = diagnosis["fit"].get("heldout_s") or [[]]
    return any(start < moment < end for moment in moments for start, end in hidden[0])


def noise_of(answer: dict[str, Any]) -> float:
    """All that was added to the readings: white noise, the slow part, rounding; K.

    >>> round(noise_of({"noise": {"white_K": 0.08, "slow_K": 0.06, "rounding_K": 0.0}}), 6)
    0.1
    """
    noise = answer["noise"]
    return float(np.sqrt(noise["white_K"] ** 2 + noise["slow_K"] ** 2 + noise["rounding_K"] ** 2 / 12.0))


def followed(answer: dict[str, Any], found: list[dict[str, Any]]) -> bool | None:
    """Whether findings name the recorded quantity that concealed heat follows; None where it follows none."""
    wanted = {effect["follows"] for effect in answer["effects"] if effect.get("follows")}
    return wanted <= {finding.get("follows") for finding in found} if wanted else None


def coverage(answer: dict[str, Any], found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Comparable parameters of rightly named effects: whether the stated interval holds the truth."""
    rows = []
    for effect in answer["effects"]:
        for finding in (f for f in found if f["effect"] == effect["effect"]):
            stated = finding["parameters"]
            for name, true in effect["parameters"].items():
                got = stated.get(name)
                if got is None or got.get("low") is None or got.get("high") is None:
                    continue
                rows.append(
                    {
                        "case": answer["case"],
                        "effect": effect["effect"],
                        "parameter": name,
                        "same_extent": same_extent(effect["component"], finding["component"]),
                        "true": true["value"],
                        "value": got["value"],
                        "low": got["low"],
                        "high": got["high"],
                        "inside": got["low"] <= true["value"] <= got["high"],
                    }
                )
    return rows


def same_extent(concealed: str, named: str) -> bool:
    """Whether a parameter means the same at both places: a factor of one bearing is not that of its set.

    >>> same_extent("rear_bearings", "R2"), same_extent("housing", "SP05"), same_extent("F1", "F1")
    (False, True, True)
    """
    both = {concealed, named}
    sets = both & {"front_bearings", "rear_bearings"}
    return len(both) == 1 or not sets or not any(name[0] in "FR" and name[1:].isdigit() for name in both)


def evenness(levels: list[float]) -> dict[str, Any]:
    """Distance of the p-values of consistent recordings from uniform (Kolmogorov-Smirnov), and low ones.

    >>> evenness([0.1, 0.3, 0.5, 0.7, 0.9])["below_0.05"]
    0.0
    """
    if not levels:
        return {"of": 0}
    return {
        "of": len(levels),
        "even": round(float(kstest(levels, "uniform").pvalue), 3),
        **{f"below_{level}": round(float(np.mean(np.array(levels) < level)), 4) for level in (0.01, 0.05)},
    }


def _share(rows: list[dict[str, Any]], key: str) -> dict[str, Any]:
    values = [bool(r[key]) for r in rows if r[key] is not None]
    return {"share": round(float(np.mean(values)), 4) if values else None, "of": len(values)}


def reliability(
    rows: list[dict[str, Any]], edges: tuple[float, ...] = (0, 0.3, 0.5, 0.7, 0.9, 0.97, 1.0001)
) -> list:
    """Stated probability of the first set against how often it was right."""
    out = []
    for low, high in itertools.pairwise(edges):
        here = [r for r in rows if low <= r["probability"] < high]
        if here:
            out.append(
                {
                    "from": low,
                    "to": min(high, 1.0),
                    "cases": len(here),
                    "stated": round(float(np.mean([r["probability"] for r in here])), 3),
                    "right": round(float(np.mean([r["first"] or r["exact"] for r in here])), 3),
                }
            )
    return out


def summarise(rows: list[dict[str, Any]], failed: list[str]) -> dict[str, Any]:
    """Figures over all cases, each with its number of cases."""
    null = [r for r in rows if r["consistent"]]
    single = [r for r in rows if len(r["truth"]) == 1 and not r["foreign"]]
    clear = [r for r in single if r["clear"]]
    pairs = [r for r in rows if len(r["truth"]) == 2]
    clear_pairs = [r for r in pairs if r["clear"]]
    visible = [r for r in rows if r["truth"] and r["detectable"]]
    twins = [r for r in visible if r["ambiguous"]]
    undecidable_ones = [r for r in twins if r["undecidable"]]
    for row in clear + clear_pairs:
        row["within_three"] = row["rank"] is not None and row["rank"] <= 3
    for row in twins:
        row["truth_kept"] = row["rank"] is not None
        row["called_ambiguous"] = row["verdict"] == "ambiguous" and row["truth_kept"]
    for row in rows:
        row["false_alarm"] = row["consistent"] and row["verdict"] != "consistent"
        row["confident_wrong"] = (
            bool(row["found"])
            and row["probability"] > FAULTY_ABOVE
            and not row["first"]
            and not row["foreign"]
            and row["verdict"] != "ambiguous"
        )
    covered = [c for r in rows for c in r["coverage"] if c["same_extent"]]
    after = [
        r["after_over_noise"]
        for r in rows
        if r["truth"] and r["exact"] and r["detectable"] and r["after_over_noise"] and not r["changes_unseen"]
    ]
    after_unseen = [r["after_over_noise"] for r in visible if r["changes_unseen"] and r["after_over_noise"]]
    after_all = [r["after_over_noise"] for r in visible if r["after_over_noise"]]
    walls = [r["wall_s"] for r in rows if r["wall_s"]]
    confusion = {true: dict.fromkeys(VERDICTS, 0) for true in VERDICTS[:4]}
    for row in rows:
        confusion[row["true_verdict"]][row["verdict"]] += 1
    wrong = [r for r in rows if not r["verdict_right"] or not (r["first"] or r["exact"] or r["foreign"])]
    return {
        "cases": len(rows),
        "failed": failed,
        "false_alarms": _share(null, "false_alarm"),
        "p_value_of_consistent": evenness([r["p_value"] for r in null if r["p_value"] is not None]),
        "verdict_acceptable": _share(rows, "verdict_right"),
        "clear_single_first": _share(clear, "exact"),
        "clear_single_within_three": _share(clear, "within_three"),
        "every_single_acceptable": _share(single, "first"),
        "clear_pair_exact": _share(clear_pairs, "exact"),
        "clear_pair_within_three": _share(clear_pairs, "within_three"),
        "every_pair_acceptable": _share(pairs, "first"),
        "pair_one_effect_named": _share(pairs, "first_effect"),
        "place_of_named": _share([r for r in rows if r["detectable"]], "place"),
        "located": _share(visible, "located"),
        "law_of_recorded_quantity": _share(visible, "law"),
        "ambiguous_truth_kept": _share(undecidable_ones, "truth_kept"),
        "ambiguous_called": _share(undecidable_ones, "called_ambiguous"),
        "ambiguous_called_faint_ones_too": _share(twins, "called_ambiguous"),
        "confident_wrong": _share(rows, "confident_wrong"),
        "reliability": reliability(rows),
        "by_strength": by_strength(rows),
        "effect_confusion": effect_confusion(rows),
        "interval_coverage": _share(covered, "inside")
        | {
            "by_parameter": {
                name: _share([c for c in covered if c["effect"] + "." + c["parameter"] == name], "inside")
                for name in sorted({c["effect"] + "." + c["parameter"] for c in covered})
            }
        },
        "heldout_after_over_noise": _quantiles(after),
        "heldout_after_over_noise_sensor_changes_unseen": _quantiles(after_unseen),
        "heldout_after_over_noise_every_visible": _quantiles(after_all),
        "wall_s": _quantiles(walls),
        "confusion": confusion,
        "wrong": [
            {
                k: r[k]
                for k in (
                    "case",
                    "truth",
                    "found",
                    "probability",
                    "alternatives",
                    "verdict",
                    "true_verdict",
                    "ratio",
                    "clear",
                    "calibrated",
                    "p_value",
                    "after_over_noise",
                    "rank",
                )
            }
            for r in wrong
        ],
        "wrong_by_truth": dict(Counter(e.split("@")[0] for r in wrong for e in (r["truth"] or ["none@"]))),
    }


def by_strength(
    rows: list[dict[str, Any]], edges: tuple[float, ...] = (0.0, 0.3, 0.6, 1.0, 2.0, 4.0, 8.0, 1e9)
) -> list[dict[str, Any]]:
    """Outcome for concealed effects, by the ratio of what they leave after a re-fit to the noise."""
    out = []
    for low, high in itertools.pairwise(edges):
        here = [r for r in rows if r["truth"] and r["ratio"] is not None and low <= r["ratio"] < high]
        if here:
            right = [r["exact"] for r in here]
            kept = [not r["exact"] and r["rank"] is not None for r in here]
            silent = [not r["exact"] and r["rank"] is None and r["verdict"] == "consistent" for r in here]
            out.append(
                {
                    "from": low,
                    "to": high,
                    "cases": len(here),
                    "named": sum(right),
                    "among_the_sets": sum(kept),
                    "consistent": sum(silent),
                    "other": len(here) - sum(right) - sum(kept) - sum(silent),
                }
            )
    return out


def effect_confusion(rows: list[dict[str, Any]]) -> dict[str, dict[str, int]]:
    """What was named first for every concealed single effect, counted."""
    out: dict[str, Counter[str]] = {}
    for row in rows:
        if len(row["truth"]) > 1:
            continue
        true = row["truth"][0].split("@")[0] if row["truth"] else "nothing"
        named = " + ".join(sorted(f.split("@")[0] for f in row["found"])) or row["verdict"]
        named = "nothing" if named == "consistent" else named
        out.setdefault(true, Counter())[named] += 1
    return {true: dict(counts) for true, counts in sorted(out.items())}


def _quantiles(values: list[float]) -> dict[str, Any]:
    if not values:
        return {"of": 0}
    q = np.quantile(values, [0.5, 0.9, 1.0])
    return {
        "of": len(values),
        "median": round(float(q[0]), 3),
        "p90": round(float(q[1]), 3),
        "worst": round(float(q[2]), 3),
    }


def score_study(study: Path, results: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Score whatever has both an answer and a diagnosis."""
    rows, failed = [], []
    for path in sorted((study / "answers").glob("*.json")):
        answer = json.loads(path.read_text(encoding="utf-8"))
        folder = results / answer["case"]
        if (folder / "failed.json").exists():
            failed.append(answer["case"])
        if not (folder / "diagnosis.json").exists():
            continue
        timing = folder / "timing.json"
        wall = json.loads(timing.read_text(encoding="utf-8"))["wall_s"] if timing.exists() else None
        rows.append(
            score_case(answer, json.loads((folder / "diagnosis.json").read_text(encoding="utf-8")), wall)
        )
    return summarise(rows, failed), rows


def _print(summary: dict[str, Any]) -> None:
    for key, value in summary.items():
        if key in ("wrong", "confusion", "reliability", "by_strength", "effect_confusion"):
            continue
        print(f"{key:42s} {json.dumps(value) if isinstance(value, (dict, list)) else value}")
    print("\nreliability of the first set")
    for row in summary["reliability"]:
        print(
            f"  {row['from']:.2f}-{row['to']:.2f}  cases {row['cases']:4d}  "
            f"stated {row['stated']:.3f}  right {row['right']:.3f}"
        )
    print("\nverdicts (rows: truth)\n" + " " * 18 + "".join(f"{v[:12]:>14s}" for v in VERDICTS))
    for true, counts in summary["confusion"].items():
        print(f"{true:18s}" + "".join(f"{counts[v]:14d}" for v in VERDICTS))
    print("\nwrong")
    for row in summary["wrong"]:
        rest = "; ".join(
            f"{'+'.join(a['set']) or 'nothing'} {a['probability']:.2f}" for a in row["alternatives"]
        )
        print(
            f"  {row['case']} {'+'.join(row['truth']) or 'nothing'} "
            f"(ratio {row['ratio']}, {'clear' if row['clear'] else 'hard'})"
            f" -> {row['verdict']}: {'+'.join(row['found']) or 'nothing'} {row['probability']:.2f} | {rest}"
        )


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m validation.score", description=__doc__)
    parser.add_argument("study", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("--json", type=Path, default=None, help="default: RESULTS/score.json")
    given = parser.parse_args(arguments)
    summary, rows = score_study(given.study, given.results)
    target = given.json or given.results / "score.json"
    target.write_text(json.dumps({"summary": summary, "cases": rows}, indent=1), encoding="utf-8")
    _print(summary)
    print("\nasked for")
    for row in held_against_asked(summary):
        met = {True: "met", False: "NOT MET", None: "no case"}[row["met"]]
        bound = f"{row['relation']} {row['bound']}"
        print(f"  {row['words']:62s} {row['value']!s:>8} {bound}  of {row['of']}  {met}")


if __name__ == "__main__":
    main()
