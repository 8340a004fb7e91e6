"""The concealed study: how often the diagnosis is right, and every case in which it is not."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from book import charts
from book.asked_tables import asked_table, earlier_table, short
from book.causes import CAUSES, cause_counts, read_causes, study_seed, wrong_table
from book.makeup import makeup_tables
from book.page import Chapter, Pictures
from book.work import Desk
from spindle_fem.report.block_page import Bullets, Notice, Section, Table, Text
from spindle_fem.report.table_rows import column, number, rows_of, significant
from spindle_fem.results.output_folder import replace_text
from validation.asked import held_against_asked
from validation.score import score_study

TITLE = "Concealed study: an independent machine, answers hidden"


def make(desk: Desk, pictures: Pictures) -> Chapter:
    """Score what there is of the study and show every wrong case with its cause."""
    commands = [
        "python -m validation.generate --cases 200 --seed SEED -o runs/study",
        "python -m validation.run_study runs/study runs/study/results --jobs 2 --mesh coarse",
        "python -m validation.score runs/study runs/study/results",
        "python -m validation.run_study runs/study runs/looked_into --case case_0001 --report  # one case "
        "with pictures",
        "make study book STUDY=runs/study",
    ]
    if not (desk.study / "answers").is_dir():
        return Chapter(
            outcome=f"Left out: there is no study in {desk.study.name}; “make study” makes it.",
            commands=commands,
            left_out="The study is made apart from the book because it takes hours.",
            tone="bad",
        )
    summary, rows = score_study(desk.study, desk.results)
    seed = study_seed(desk.study)
    cases = len(list((desk.study / "answers").glob("*.json")))
    if not rows:
        return Chapter(
            outcome=f"Left out: none of the {cases} cases has been diagnosed yet.",
            commands=commands,
            left_out="validation.run_study goes on where it stopped.",
            tone="bad",
        )
    keep = desk.work / "concealed"
    keep.mkdir(parents=True, exist_ok=True)
    replace_text(keep / "score.json", json.dumps({"summary": summary, "cases": rows}, indent=1))
    asked = held_against_asked(summary)
    unmet = [row for row in asked if row["met"] is False]
    causes = read_causes(CAUSES, seed)
    wrong = summary["wrong"]
    sections = [
        Section(
            "asked",
            "What is asked for, and what came out",
            [asked_table(asked), *earlier_table(desk, asked)],
        ),
        Section("drawn", "What was drawn", makeup_tables(desk.study)),
        Section(
            "confusion",
            "Verdicts and effects",
            [
                pictures.add(
                    "verdicts",
                    charts.matrix(
                        summary["confusion"],
                        "Verdicts",
                        f"{len(rows)} cases; rows add up to what was concealed",
                        "concealed",
                        "verdict of the diagnosis",
                    ),
                    "Confusion matrix of the verdicts. Ambiguous and unexplained are right answers where "
                    "the generator's own identifiability study found a twin, or nothing of the catalogue.",
                ),
                pictures.add(
                    "effects",
                    charts.matrix(
                        _ordered(summary["effect_confusion"]),
                        "Effects",
                        "cases with none or one concealed effect, every strength; ambiguous: first of the "
                        "sets named",
                        "concealed",
                        "named first",
                    ),
                    "What was named first, for every concealed single effect.",
                ),
                pictures.add(
                    "strength",
                    charts.outcome_by_strength(summary["by_strength"]),
                    "Below a third of the noise an effect cannot be seen and consistent is the right answer.",
                ),
            ],
        ),
        Section("probabilities", "Stated probabilities", _probabilities(summary, pictures)),
        Section("alarms", "False alarms", _alarms(summary, rows)),
        Section("place", "Place", _places(summary, rows)),
        Section("intervals", "Intervals of parameters", _intervals(summary, rows, pictures)),
        Section("errors", "Error after, against noise", _errors(summary, rows, pictures)),
        Section("time", "Time", _times(summary, rows, pictures)),
        Section(
            "wrong",
            "Every wrong case, with its cause",
            [
                Text(
                    "Wrong is a verdict that is not acceptable for the case, or a set that is neither "
                    "what was concealed nor one that the generator found indistinguishable from it. Ratio "
                    "is what the concealed effects leave on the most affected channel after a re-fit, "
                    "over noise."
                ),
                wrong_table(wrong, causes),
                *cause_counts(wrong, causes),
            ],
        ),
        *_earlier_sections(desk),
    ]
    if summary["failed"]:
        failed = f"{len(summary['failed'])} cases ended with an error: {', '.join(summary['failed'])}."
        sections.insert(1, Section("failed", "Cases that raised", [Notice(failed, "bad")]))
    part = "" if len(rows) == cases else f" {cases - len(rows)} of {cases} are not diagnosed yet."
    seeded = f" (seed {seed})" if seed is not None else ""
    met = sum(row["met"] is True for row in asked)
    outcome = (
        f"{len(rows)} concealed cases{seeded}: {met} of {len(asked)} figures asked for are met"
        + (f"; not met: {'; '.join(short(row) for row in unmet)}" if unmet else "")
        + f".{part}"
    )
    return Chapter(
        outcome=outcome,
        sections=sections,
        commands=commands,
        evidence=[
            "Recordings come from a finite-volume model written for this alone: another discretisation, "
            "other channel, film and friction code, richer laws than the catalogue's, noise that is "
            "correlated in time, rounding, gaps, spikes, doubled rows.",
            "The diagnosis reads inputs only; answers are opened by the scoring.",
            "As-built values are drawn from the priors, effects from the whole catalogue and beyond, at "
            "strengths down to ones that nobody could see.",
        ],
        not_evidence=[
            "Both models know the same drawings and the same heat table: a machine whose drawing is wrong "
            "is not in the study.",
            "The shares hold for this mix of cases; another mix has others.",
            "What is called clear is decided by the generator's own re-fit, by thresholds that are a choice. "
            "Undecidable is a case in which another effect's plain law comes as near to the truth as the "
            "true effect's own plain law.",
        ],
        tone="good" if not unmet else "",
    )


def _earlier_sections(desk: Desk) -> list[Section]:
    sections = []
    for study in desk.earlier:
        seed = study_seed(study)
        wrong = score_study(study, study / "results")[0]["wrong"]
        causes = read_causes(CAUSES, seed)
        blocks = [wrong_table(wrong, causes), *cause_counts(wrong, causes)]
        sections.append(Section(f"wrong-{seed}", f"Wrong cases of the earlier study, seed {seed}", blocks))
    return sections


def _ordered(confusion: Mapping[str, Mapping[str, int]]) -> dict[str, dict[str, int]]:
    """Rows by name; columns with the same names first, in the same order, then other findings."""
    down = sorted(confusion, key=lambda name: (name != "nothing", name))
    said = {name for row in confusion.values() for name in row}
    across = [name for name in down if name in said] + sorted(said - set(down))
    return {name: {key: confusion[name].get(key, 0) for key in across} for name in down}


def _probabilities(summary: Mapping[str, Any], pictures: Pictures) -> list[Any]:
    bins = summary["reliability"]
    return [
        pictures.add(
            "calibration",
            charts.calibration_curve(bins),
            "Calibration curve of the stated probability of the first set (a consistent verdict is a set "
            "too).",
        ),
        Table(
            (
                column("stated between"),
                column("cases", number=True),
                column("mean stated", number=True),
                column("right", number=True),
            ),
            rows_of(
                [
                    f"{row['from']:.2f} and {row['to']:.2f}",
                    str(row["cases"]),
                    f"{row['stated']:.3f}",
                    f"{row['right']:.3f}",
                ]
                for row in bins
            ),
        ),
    ]


def _alarms(summary: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> list[Any]:
    null = [row for row in rows if row["consistent"]]
    alarms = [row for row in null if row["false_alarm"]]
    values = sorted(row["p_value"] for row in null if row["p_value"] is not None)
    blocks: list[Any] = [
        Text(f"{len(alarms)} of {len(null)} recordings of machines with nothing missing were flagged.")
    ]
    if values:
        blocks.append(
            Text(
                f"Their p-values: median {significant(float(np.median(values)), 2)}, smallest "
                f"{', '.join(significant(value, 2) for value in values[:5])}. Were they drawn from even "
                f"levels, they would be farther from even with probability "
                f"{significant(summary['p_value_of_consistent']['even'], 2)} (Kolmogorov and Smirnov)."
            )
        )
    if alarms:
        blocks.append(
            Bullets([f"{row['case']}: {row['verdict']}, {', '.join(row['found'])}" for row in alarms])
        )
    return blocks


def _places(summary: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> list[Any]:
    table: dict[str, Counter[str]] = {}
    for row in rows:
        for truth in row["truth"]:
            effect, _, place = truth.partition("@")
            for found in row["found"]:
                name, _, here = found.partition("@")
                if name == effect:
                    table.setdefault(place, Counter())[here] += 1
    places = summary["place_of_named"]
    located = summary["located"]
    law = summary["law_of_recorded_quantity"]
    listed = [
        [place, ", ".join(f"{name} {count}" for name, count in counts.most_common())]
        for place, counts in sorted(table.items())
    ]
    return [
        Text(
            f"Of {places['of']} cases with an effect named rightly, {_percent(places)} have it at an "
            f"acceptable place (a bearing of the set counts for the set). Of {located['of']} detectable "
            f"cases with any mismatch found, {_percent(located)} point at a place where something was "
            "concealed, whatever it was called."
            + (
                f" In {law['of']} cases heat follows a recorded quantity by a law that no effect has; "
                f"{_percent(law)} of them are answered with that quantity."
                if law["of"]
                else ""
            )
        ),
        Table(
            (column("concealed at"), column("named at, with the number of cases")),
            rows_of(listed),
            "Effects that were named rightly.",
        ),
    ]


def _percent(found: Mapping[str, Any]) -> str:
    return "none" if found["share"] is None else f"{100 * found['share']:.1f} %"


def _intervals(
    summary: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], pictures: Pictures
) -> list[Any]:
    every = [item for row in rows for item in row["coverage"]]
    covered = [item for item in every if item["same_extent"]]
    other = len(every) - len(covered)
    outside = [
        [
            item["case"],
            f"{item['effect']}: {item['parameter']}".replace("_", " "),
            significant(item["true"]),
            significant(item["value"]),
            f"{significant(item['low'])} to {significant(item['high'])}",
        ]
        for item in covered
        if not item["inside"]
    ]
    if not covered:
        return [Text("No rightly named effect has a parameter that can be compared yet.")]
    held = summary["interval_coverage"]
    listed = [
        [
            name.replace("_", " ").replace(".", ": "),
            str(value["of"]),
            f"{100 * value['share']:.0f} %",
        ]
        for name, value in held["by_parameter"].items()
    ]
    return [
        Text(
            f"{_percent(held)} of {held['of']} stated 90 % intervals hold the truth. {other} more are left "
            "out, where a factor of one bearing was stated and that of its whole set is the truth, or the "
            "other way round."
        ),
        pictures.add(
            "coverage",
            charts.coverage_chart(covered),
            "Every comparable parameter of a rightly named effect.",
        ),
        Table(
            (column("parameter"), column("estimates", number=True), column("hold the truth", number=True)),
            rows_of(listed),
        ),
        Table(
            (
                column("case"),
                column("parameter"),
                column("truth", number=True),
                column("estimate", number=True),
                column("stated 90 % interval", number=True),
            ),
            rows_of(outside),
            "Intervals that miss the truth.",
        ),
    ]


def _errors(summary: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], pictures: Pictures) -> list[Any]:
    named, every = summary["heldout_after_over_noise"], summary["heldout_after_over_noise_every_visible"]
    listed = [
        [words, str(item["of"]), *(number(item.get(key), 3) for key in ("median", "p90", "worst"))]
        for words, item in (("all effects found", named), ("every detectable case", every))
    ]
    return [
        pictures.add(
            "errors",
            charts.errors_against_noise(rows),
            "Held-out error over all that was added to a reading (white noise, a slow part, rounding), "
            "before and after; where nothing was found both are the same.",
        ),
        Table(
            (
                column("held-out error after / noise"),
                column("cases", number=True),
                column("median", number=True),
                column("90 %", number=True),
                column("worst", number=True),
            ),
            rows_of(listed),
            "Noise is all that was added to the readings: the sensor's own, a slow error of 0.02 to 0.05 K, "
            "rounding.",
        ),
    ]


def _times(summary: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], pictures: Pictures) -> list[Any]:
    walls = [row["wall_s"] for row in rows if row["wall_s"]]
    if not walls:
        return [Text("No times were kept.")]
    found = summary["wall_s"]
    return [
        Text(
            "One process a case, one thread, coarse mesh, reduced model from the cache: median "
            f"{found['median']:.0f} s, 90 % below {found['p90']:.0f} s, slowest {found['worst']:.0f} s. "
            "Whatever else ran on the machine is in it."
        ),
        pictures.add("times", charts.times_chart(walls, 60.0), "Wall time of every case."),
    ]
