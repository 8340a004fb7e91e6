"""The proof in the open: ``python -m validation.proof STUDY... -o reports/proof`` from finished studies.

Every ``STUDY`` is a folder of one of the generators with ``answers`` and ``results``. Writes ``proof.json``
(the rows of every case, the figures that follow from them, a worked case, real recordings), pictures, and
``README.md``, which is rendered from ``proof.json`` alone, so that every number on it is stored there. Real
recordings, riddles and other programs that are not given again stay as they stand there, with ``--keep``
other studies and the worked case too.
"""

import argparse
import json
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from . import riddle
from .causes import OPEN, SPINDLE, read_causes, read_note, study_seed
from .score import reliability
from .score_families import percent, score_study, states_of, summary

SCHEMA = "spindle-fem/proof/1"
HERE = Path(__file__).parent
CAUSES = HERE.parent / "book" / "causes.toml"
TITLES = {
    SPINDLE: "The recorded spindle, known up to its uncertain parameters",
    "rough": "The recorded spindle, known roughly",
    "meridian": "Belt-driven spindles of other sizes, without cooling",
    "networks": "Machines without drawings",
}
# Order of the studies on the page: by generator, of each the latest seed first.
ORDER = ("rough", "networks", "meridian", SPINDLE)
DIGITS = 4


def rounded(value: Any) -> Any:
    """Content with every real number rounded to a few significant digits.

    >>> rounded({"a": [1.234567, True, "x"]})
    {'a': [1.235, True, 'x']}
    """
    if isinstance(value, dict):
        return {k: rounded(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(v) for v in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def read_study(study: Path, results: Path) -> dict[str, Any]:
    """Rows and figures of one study, with the causes of its wrong cases.

    Raises
    ------
    FileNotFoundError
        No case of it has been diagnosed.
    """
    rows = [rounded(row) for row in score_study(study, results)]
    if not rows:
        raise FileNotFoundError(f"{results}: holds no diagnosis of {study}.")
    drawn = json.loads((study / "study.json").read_text(encoding="utf-8"))
    run = results / "run.json"
    generator = drawn.get("generator", SPINDLE)
    return {
        "name": study.name,
        "title": TITLES[generator],
        "generator": generator,
        "seed": drawn["seed"],
        "drawn": len(list((study / "answers").glob("*.json"))),
        "commit": json.loads(run.read_text(encoding="utf-8"))["commit"] if run.exists() else None,
        "rows": rows,
        **figures_of(rows),
        **written_of(rows, study_seed(study), generator),
        **rounded({"kept_back": kept_back(results), "plan": planned(results)}),
    }


def kept_back(results: Path) -> dict[str, Any] | None:
    """What improved machines leave of further runs over noise and structure (:mod:`validation.kept_back`)."""
    table = results / "kept_back" / "kept_back.json"
    if not table.exists():
        return None
    ratios = [row["over_noise"] for row in json.loads(table.read_text(encoding="utf-8"))]
    return {"of": len(ratios), "median": float(np.median(ratios)), "p90": float(np.quantile(ratios, 0.9))}


def planned(results: Path) -> dict[str, Any] | None:
    """Whether effects that a plan tells apart were named (:mod:`validation.plan_check`)."""
    table = results / "plan_check.json"
    return json.loads(table.read_text(encoding="utf-8"))["summary"] if table.exists() else None


def causes_of(rows: list[dict[str, Any]], seed: int | None, generator: str) -> dict[str, dict[str, str]]:
    """Kind and cause of every wrong case, as written down by hand."""
    causes = read_causes(CAUSES, seed, generator)
    wrong = [row["case"] for row in rows if is_wrong(row)]
    return {case: {k: causes.get(case, {}).get(k, OPEN) for k in ("kind", "cause")} for case in wrong}


def written_of(rows: list[dict[str, Any]], seed: int | None, generator: str) -> dict[str, Any]:
    """What is written down by hand of a study: causes of its wrong cases, and what is to be known of it."""
    return {"causes": causes_of(rows, seed, generator), "note": read_note(CAUSES, seed, generator)}


def kept_studies(known: list[dict[str, Any]], given: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Studies of an earlier page that are not given again, with the causes and notes that are known now."""
    names = {study["name"] for study in given}
    return [
        study | figures_of(study["rows"]) | written_of(study["rows"], study["seed"], study["generator"])
        for study in known
        if study["name"] not in names
    ]


def figures_of(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Figures computed from the rows: by family, and reliability of stated probabilities."""
    seen = [r for r in rows if r["detectable"] and not r["failed"]]
    stated = [r | {"first": r["right"], "exact": False} for r in seen]
    return rounded({"summary": summary(rows), "reliability": reliability(stated)})


def is_wrong(row: dict[str, Any]) -> bool:
    """Whether a case counts as wrong: a detectable effect was missed, or an absent one claimed."""
    return bool(row["failed"] or (not row["right"] if row["detectable"] else row["confident_wrong"]))


def worked_case(studies: dict[str, tuple[Path, Path, dict]], chosen: str | None) -> dict[str, Any] | None:
    """One case from recording to held-out fit: the requested one (STUDY/CASE), else the best with states."""
    rows = [
        (name, row)
        for name, (_, _, told) in studies.items()
        for row in told["rows"]
        if (chosen == f"{name}/{row['case']}" if chosen else row["right"] and not row["consistent"])
    ]
    if not rows and chosen:
        known = ", ".join(studies)
        raise ValueError(f"--worked {chosen}: no such case. Name one as STUDY/case_0001 of {known}.")
    if not rows:
        return None

    def worth(item: tuple[str, dict]) -> tuple:
        row = item[1]
        gain = (row["before_over_noise"] or 0.0) / max(row["after_over_noise"] or 1.0, 0.1)
        return (row.get("states_f1") or 0.0, gain)

    name, row = max(rows, key=worth)
    study, results, _ = studies[name]
    answer = json.loads((study / "answers" / f"{row['case']}.json").read_text(encoding="utf-8"))
    folder = results / row["case"]
    diagnosis = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    return rounded(
        {
            "study": name,
            "case": row["case"],
            "row": row,
            "truth": [e.get("statement") or f"{e['effect']} at {e['component']}" for e in answer["effects"]],
            "noise_K": answer["noise"],
            "fit": {k: diagnosis["fit"][k] for k in ("before", "after", "heldout")},
            "findings": diagnosis["findings"],
            "set_probability": diagnosis.get("set_probability"),
            "true_states": [span for e in answer["effects"] for span in e.get("intervals") or []],
            "found_states": states_of(folder, diagnosis),
            "channels": diagnosis["mismatch"]["channels"],
            "next": (diagnosis.get("next_measurement") or {}).get("why"),
        }
    )


def real_machines(results: Path | None, recordings: Path | None) -> list[dict[str, Any]]:
    """Findings on recordings of real machines, with what they are evidence of."""
    entries = tomllib.loads((HERE / "proof_real.toml").read_text(encoding="utf-8"))["recording"]
    out = []
    for entry in entries:
        path = (results / entry["folder"] / "diagnosis.json") if results else None
        if path is None or not path.exists():
            continue
        diagnosis = json.loads(path.read_text(encoding="utf-8"))
        known = (recordings / entry["answer"]) if recordings and "answer" in entry else None
        out.append(
            entry
            | {
                "verdict": diagnosis["verdict"],
                "set_probability": diagnosis.get("set_probability"),
                "reason": diagnosis["reason"] if diagnosis["verdict"] == "unexplained" else "",
                "findings": [
                    {k: f.get(k) for k in ("effect", "component", "statement")} for f in diagnosis["findings"]
                ],
                "fit": {k: diagnosis["fit"][k] for k in ("before", "after", "noise_K")},
                "known": json.loads(known.read_text(encoding="utf-8")) if known and known.exists() else None,
            }
        )
    return rounded(out)


def riddles(book: Path | None) -> list[dict[str, Any]]:
    """Diagnoses of machines with the paper's two effects, from the folders that the book left."""
    out = []
    for folder in sorted(book.glob("riddle_*")) if book else ():
        result = folder / "results" / riddle.NAME
        held = riddle.held_against_answer(folder, result)
        diagnosis = json.loads((result / "diagnosis.json").read_text(encoding="utf-8"))
        out.append(
            {
                "machine": folder.name,
                "right": held["score"]["exact"],
                "verdict": diagnosis["verdict"],
                "found": [f"{f['effect']}@{f['component']}" for f in diagnosis["findings"]],
                "set_probability": diagnosis.get("set_probability"),
                "noise_K": diagnosis["fit"]["noise_K"],
                "speeds": [
                    {"speed_rpm": before["speed_rpm"], "before_K": before["rms_K"], "after_K": after["rms_K"]}
                    for before, after in zip(held["before"], held["after"], strict=True)
                ],
            }
        )
    return rounded(out)


def other_programs(book: Path | None) -> dict[str, Any] | None:
    """Temperatures of other programs on the same mesh, from the folder that the book left."""
    table = book / "peers" / "peers.json" if book else None
    if table is None or not table.exists():
        return None
    return rounded(json.loads(table.read_text(encoding="utf-8")))


def build(
    studies: list[tuple[Path, Path]],
    worked: str | None = None,
    real: tuple[Path | None, Path | None] = (None, None),
    book: Path | None = None,
) -> dict[str, Any]:
    """All content of the page, as one table of data."""
    told = {study.name: (study, results, read_study(study, results)) for study, results in studies}
    return {
        "schema": SCHEMA,
        "interval_percent": 90,
        "studies": [data for _, _, data in told.values()],
        "worked": worked_case(told, worked),
        "riddles": riddles(book),
        "programs": other_programs(book),
        "real": real_machines(*real),
    }


def number(value: float | None, digits: int = 2) -> str:
    """A number as text, a dash where there is none."""
    return "–" if value is None else f"{value:.{digits}f}"


def spaced(text: str) -> str:
    """Names as words.

    >>> spaced("heat_scale@oil")
    'heat scale at oil'
    """
    return text.replace("_", " ").replace("@", " at ").replace("+", " + ").replace("|", "–")


def joined(names: list[str]) -> str:
    """A set of effects in words."""
    return spaced("+".join(names)) or "nothing"


def wrong_of(study: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows that are accounted for, each with its cause."""
    return [row | study["causes"][row["case"]] for row in study["rows"] if is_wrong(row)]


def kinds_of(study: dict[str, Any]) -> list[tuple[str, int]]:
    """Number of wrong cases of each kind of cause."""
    return Counter(cause["kind"] for cause in study["causes"].values()).most_common()


def render(data: dict[str, Any]) -> str:
    """The page, from the data alone."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {"share": percent, "number": number, "spaced": spaced, "joined": joined}
    environment.filters |= {"wrong": wrong_of, "kinds": kinds_of, "hours": lambda s: number(s / 3600.0, 1)}
    return environment.get_template("proof_page.md.j2").render(data)


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", type=Path, nargs="+", help="folder with answers and results")
    parser.add_argument("-o", "--output", type=Path, default=Path("reports/proof"))
    parser.add_argument("--results", default="results", help="name of the results' folder in each study")
    parser.add_argument("--worked", default=None, help="STUDY/case_0001 to show from end to end")
    parser.add_argument("--real", type=Path, default=None, help="folder with diagnoses of real recordings")
    parser.add_argument("--recordings", type=Path, default=Path("../shared/recordings"))
    parser.add_argument(
        "--book", type=Path, default=None, help="work folder of the book, with its riddles and peers"
    )
    parser.add_argument("--keep", action="store_true", help="what else is on the page stays")
    given = parser.parse_args(arguments)
    studies = [(study, study / given.results) for study in given.study]
    data = build(studies, given.worked, (given.real, given.recordings), given.book)
    given.output.mkdir(parents=True, exist_ok=True)
    table = given.output / "proof.json"
    if table.exists():
        known = json.loads(table.read_text(encoding="utf-8"))
        data |= {part: known[part] for part in ("riddles", "programs", "real") if not data[part]}
        if given.keep:
            data["studies"] += kept_studies(known["studies"], data["studies"])
            data["worked"] = data["worked"] if given.worked else known["worked"]
    data["studies"].sort(key=lambda study: (ORDER.index(study["generator"]), -study["seed"]))
    from .proof_pictures import draw_all

    draw_all(data, {study.name: (study, results) for study, results in studies}, given.output)
    table.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    (given.output / "README.md").write_text(render(data), encoding="utf-8")
    print(f"{given.output / 'README.md'}: {sum(len(s['rows']) for s in data['studies'])} cases")


if __name__ == "__main__":
    main()
