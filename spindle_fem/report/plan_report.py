"""Report of a planned measurement, from the files of its folder alone."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spindle_fem.definition.load import load_machine
from spindle_fem.inference.plan_content import SCHEMA
from spindle_fem.report.block_page import (
    Bullets,
    Cards,
    Section,
    Table,
    Text,
    illustration_of,
    render_document,
)
from spindle_fem.report.figure_style import save_png
from spindle_fem.report.plan_charts import detectable_sizes, options_chart, pair_matrix, sensor_places
from spindle_fem.report.table_rows import (
    Field,
    fixed,
    number,
    plain,
    rounded,
    significant,
    table_of,
    whole,
    words,
)
from spindle_fem.results.output_folder import read_content, replace_text

CAPTIONS = {
    "pairs": "Information between two effects: at 1 bit one test decides, at 0 they read alike. What the "
    "machine's uncertain numbers, the noise, and any size and shape of the other's law can imitate does not "
    "count. Effects that are not seen at their usual size are left out.",
    "sizes": "Effects that would be seen in five times their usual size or less.",
    "sensors": "One further sensor in the same test.",
    "places": "The sensors on the machine's half section, and what one more would add at each place.",
    "tests": "Other tests with the same sensors.",
}


def write_plan_report(folder: str | Path) -> Path:
    """``report.html`` and ``figures`` of a folder that holds ``plan.json``.

    Raises
    ------
    BadInputError
        ``plan.json`` is missing or of a version that this program does not know.
    """
    folder = Path(folder)
    content = read_content(folder / "plan.json", SCHEMA, "diagnose --plan")
    place = folder / "figures"
    place.mkdir(exist_ok=True)
    now = content["expected_information_bit"]
    figures = {"pairs": pair_matrix(content), "sizes": detectable_sizes(content)}
    if content["further_sensors"]:
        figures["sensors"] = options_chart(content["further_sensors"], now, "One more sensor")
    if content["tests"]:
        figures["tests"] = options_chart(content["tests"], now, "Other tests")
    definition = folder / "machine.toml"
    if definition.is_file() and content["further_sensors"]:
        figures["places"] = sensor_places(content, load_machine(definition))
    pictures = {
        name: illustration_of(save_png(figure, place / f"{name}.png"), CAPTIONS[name])
        for name, figure in figures.items()
    }
    sections = [
        Section(
            "summary", "What this test would tell", [Bullets(content["summary"]), Cards(_cards(content))]
        ),
        Section("pairs", "Which effects are told apart", [pictures["pairs"], _confused_table(content)]),
        Section("sizes", "From which size effects are seen", [pictures["sizes"], _size_table(content)]),
        Section("more", "What would tell more", [*_more(content, pictures)]),
        Section("how", "How it was worked out", [*_how(content)]),
    ]
    subtitle = f"{content['test']['description']}, {number(content['test']['length_s'] / 3600.0, 1)} h"
    page = render_document("Plan of a measurement", content["machine"], sections, subtitle)
    return replace_text(folder / "report.html", page)


def _summary(content: Mapping[str, Any]) -> list[Any]:
    notes = [Text(note) for note in content["notes"]]
    return [Bullets(content["summary"]), Cards(_cards(content)), *notes]


def _cards(content: Mapping[str, Any]) -> list[dict[str, str]]:
    counts = content["told"]
    return [
        {"value": str(counts["effects"]), "name": "effects at places were tried"},
        {"value": str(counts["seen"]), "name": "are seen at their usual size"},
        {"value": str(counts["told_from_all"]), "name": "of these are told from every other"},
        {"value": f"{number(content['expected_information_bit'], 2)} bit", "name": "mean over all pairs"},
    ]


def size_text(item: Mapping[str, Any], key: str = "from_size") -> str:
    """A size with its name and unit; a dash where there is none.

    >>> size_text({"from_size": {"heat_at_3000rpm": 78.4}, "unit": "W"})
    'heat at 3000rpm 78.4 W'
    """
    if item[key] is None:
        return "–"
    [(name, value)] = item[key].items()
    return f"{plain(name)} {significant(value)} {item['unit'].replace('degC', '°C')}".strip()


def _size_table(content: Mapping[str, Any]) -> Table:
    fields = (
        words("effect", lambda item: plain(item["effect"])),
        words("place", lambda item: plain(item["component"])),
        words("seen from", size_text),
        words("usual size", lambda item: size_text(item, "usual_size")),
        Field("seen at its usual size", "at_usual_size", lambda value: "yes" if value else "no"),
    )
    caption = (
        f"Seen in {100.0 * content['power']:.0f} % of such tests, with a false alarm in "
        f"{100.0 * content['false_alarm']:.0f} % of tests with nothing missing. A dash: not even at five "
        "times the usual size."
    )
    return table_of(fields, content["detectable"], caption, folded="Every effect with its sizes")


def _confused_table(content: Mapping[str, Any]) -> Table:
    """Effects that cannot be distinguished from each effect that is seen."""
    seen = {(d["effect"], d["component"]) for d in content["detectable"] if d["at_usual_size"]}
    found: dict[tuple[str, str], list[Mapping[str, Any]]] = {key: [] for key in seen}
    for pair in content["pairs"]:
        key = (pair["first"]["effect"], pair["first"]["component"])
        if key in seen and not pair["told_apart"]:
            found[key].append(pair)
    rows = [
        (key, sorted(pairs, key=lambda pair: pair["information_bit"]))
        for key, pairs in found.items()
        if pairs
    ]

    def named(row: tuple[tuple[str, str], list[Mapping[str, Any]]]) -> str:
        return "; ".join(
            f"{plain(pair['second']['effect'])} · {plain(pair['second']['component'])}"
            + (f" (from {size_text(pair | {'unit': pair['unit']})})" if pair["from_size"] else "")
            for pair in row[1]
        )

    fields = (
        words("effect", lambda row: plain(row[0][0])),
        words("place", lambda row: plain(row[0][1])),
        words("cannot be told from (from which size it can)", named),
    )
    return table_of(fields, sorted(rows, key=lambda row: -len(row[1])), folded="What is not told apart")


def _more(content: Mapping[str, Any], pictures: Mapping[str, Any]) -> list[Any]:
    blocks: list[Any] = []
    for key, picture, title in (
        ("sensors_in_turn", "sensors", "sensors to add, one after another"),
        ("tests", "tests", "test"),
    ):
        if not content[key]:
            continue
        fields = (
            words(title, "words"),
            fixed("information / bit", "information_bit", 3),
            fixed("gain / bit", "gain_bit", 3),
            whole("seen", "seen"),
            whole("told from all", "told_from_all"),
        )
        drawn = [pictures["places"]] if picture == "sensors" and "places" in pictures else []
        blocks += [*drawn, pictures[picture], table_of(fields, content[key])]
    return blocks


def _how(content: Mapping[str, Any]) -> list[Any]:
    fields = (
        words("sensor", "name"),
        words("reads", "probe"),
        words(
            "noise",
            lambda item: f"{item['noise_K']:.3f} K" if "noise_K" in item else f"{item['noise_um']:.3f} µm",
        ),
    )
    steps = [
        f"A reading every {content['test']['interval_s']:g} s; a quarter of the time is kept back, as a "
        "diagnosis does.",
        "Every effect is given its usual size and answers to first order about the machine as it is known. "
        "The machine's uncertain parameters, the places of the probes and errors that readings share over "
        "minutes move within what is known of them and take what they can.",
        "Another effect takes what it can with any size and with mixtures of the shapes that its law may "
        "have. What is left decides: as much as a diagnosis asks before it no longer names both.",
        f"Unrecorded heat and cooling come in {content['intervals']} intervals that stand for all others.",
    ]
    blocks = [table_of(fields, content["sensors"])]
    if content["test"]["inputs"]:
        given = (
            words("input", "name"),
            rounded("at full load", "value", 4),
            words("unit", lambda item: item["unit"].replace("degC", "°C")),
        )
        blocks.append(table_of(given, content["test"]["inputs"]))
    blocks.append(Bullets(steps))
    blocks += [
        Text(f"Not simulated: {item['description']}. {item['reason']}") for item in content["not_simulated"]
    ]
    return blocks
