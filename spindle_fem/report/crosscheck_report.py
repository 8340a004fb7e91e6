"""Report of a cross-check, from its files alone."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spindle_fem.report.block_page import (
    Bullets,
    Cards,
    Section,
    Table,
    Text,
    illustration_of,
    render_document,
)
from spindle_fem.report.crosscheck_charts import CAPTIONS
from spindle_fem.report.table_rows import fixed, number, rounded, significant, table_of, whole, words
from spindle_fem.results.output_folder import read_content, replace_text
from spindle_fem.studies.crosscheck.causes import CAUSES, CHECKS
from spindle_fem.studies.crosscheck.crosscheck_study import SCHEMA

_SHOWN_LINKS = 20


def write_crosscheck_report(folder: str | Path) -> Path:
    """``report.html`` of a folder that holds ``crosscheck.json`` and ``figures``.

    Raises
    ------
    BadInputError
        The file is missing or of a version that this program does not know.
    """
    folder = Path(folder)
    content = read_content(folder / "crosscheck.json", SCHEMA, "crosscheck")
    return replace_text(folder / "report.html", render(content, folder / "figures"))


def render(content: Mapping[str, Any], figures: Path) -> str:
    """HTML of a cross-check."""

    def picture(name: str) -> list[Any]:
        path = figures / f"{name}.png"
        return [illustration_of(path, CAPTIONS[name])] if path.is_file() else []

    summary, network = content["summary"], content["network"]
    at_match = min(content["matched"]["speeds"], key=lambda row: row["matched_max_K"])
    worst = max(content["matched"]["speeds"], key=lambda row: row["matched_max_K"])
    finest = content["convergence"]["rows"][-1]
    headline = Cards(
        [
            {"name": "largest difference, network − elements",
             "value": f"{number(summary['max_difference_K'], 2)} K"},
            {"name": "root mean square over the nodes",
             "value": f"{number(summary['rms_difference_K'], 2)} K"},
            {"name": f"refined {finest['refinement']}×, to axisymmetric elements",
             "value": f"{number(finest['max_difference_K'], 3)} K"},
            {"name": "after flux matching, matched state",
             "value": f"{significant(at_match['matched_max_K'], 2)} K"},
            {"name": "after flux matching, other speeds", "value": f"{number(worst['matched_max_K'], 2)} K"},
            {"name": "network’s energy balance", "value": significant(network["imbalance_relative"], 2)},
        ]
    )  # fmt: skip
    sections = [
        Section("headline", "Headline numbers", [headline, Text(_sentence(content)), *picture("difference")]),
        Section("nodes", "Node by node", [*picture("temperatures"), _node_table(content)]),
        Section("links", "Heat along the links", [Text(_LINKS), *_link_tables(content)]),
        Section("causes", "Why they differ", [Text(_CAUSES), *picture("causes"), _cause_table(content)]),
        Section("convergence", "Refinement", [*picture("convergence"), _convergence_table(content)]),
        Section("matched", "Reduced network by flux matching",
                [Text(_MATCHED), *picture("speeds"), _speed_table(content)]),
    ]  # fmt: skip
    if content["claim"]:
        sections.append(Section("claim", "The paper’s optimum", _claim_blocks(content["claim"])))
    subtitle = (
        f"{network['nodes']} nodes in {len(network['columns'])} columns beside {content['fem']['unknowns']} "
        f"temperature unknowns, {content['operating_point']['speed_rpm']:.0f} rpm."
    )
    return render_document("Cross-check", f"{content['machine']}: network and elements", sections, subtitle)


_LINKS = (
    "Heat from the first to the second end of each link. Where two bodies touch or a film ends a "
    "link, the elements’ "
    "heat is that of the same surface, as their balance has it. Where a link is cut through one body "
    "there is no "
    "surface of the mesh: there the gradient of the field is integrated over the cut. Links through "
    "the channel’s "
    "depth along the axis exist in the elements only (the turns are joined by their lands)."
)
_CAUSES = (
    "Between both models stand others, each different from its neighbour in one assumption: nodes "
    "refined along z, "
    "then along r too (axisymmetric elements), then closed rings instead of the smeared helix, then "
    "the helix itself "
    "without ports, then the machine as defined. The differences of neighbours add up to the whole."
)
_MATCHED = (
    "Every conductance is multiplied by a constant so that the elements’ node temperatures balance "
    "exactly at the "
    "matched state. Other speeds were not fitted: they test it. The state-space has matrices for "
    "every speed; the TOML "
    "network holds the conductances of the matched one."
)


def _sentence(content: Mapping[str, Any]) -> str:
    summary = content["summary"]
    title = CAUSES[summary["worst_node_cause"]]
    return (
        f"The node that differs most is {summary['worst_node']}; "
        f"{number(summary['worst_node_cause_K'], 2)} K of it come "
        f"from this: {title}."
    )


def _node_table(content: Mapping[str, Any]) -> Table:
    fields = (
        words("node", "node"),
        fixed("network °C", "network_degC", 2),
        fixed("elements °C", "fem_degC", 2),
        fixed("difference K", "difference_K", 2),
        words("largest cause", lambda item: CAUSES[item["largest_cause"]].split(":")[0]),
        fixed("of it K", "largest_cause_K", 2),
    )
    return table_of(fields, content["nodes"], "Elements are averaged over each node’s region.")


def _link_tables(content: Mapping[str, Any]) -> list[Table]:
    def difference(item: Mapping[str, Any]) -> float:
        return item["network_W"] - item["fem_W"]

    fields = (
        words("link", lambda item: item["link"].replace("|", " → ")),
        fixed("network W", "network_W", 2),
        fixed("elements W", "fem_W", 2),
        fixed("difference W", difference, 2),
        words("over", "surface"),
    )
    links = content["links"]
    ranked = sorted(links, key=lambda item: -abs(difference(item)))
    return [
        table_of(fields, ranked[:_SHOWN_LINKS], f"The {_SHOWN_LINKS} links that differ most."),
        table_of(fields, links, "Every link.", folded=f"All {len(links)} links"),
    ]


def _cause_table(content: Mapping[str, Any]) -> Table:
    titles = {**CAUSES, **CHECKS}
    fields = (
        words("assumption exchanged", lambda item: titles[item["cause"]]),
        words("kind", lambda item: "step" if item["kind"] == "step" else "by itself"),
        fixed("at most K", "max_K", 3),
        fixed("rms K", "rms_K", 3),
    )
    caption = "Steps add up to the difference; the others change one assumption by itself."
    return table_of(fields, content["causes"], caption)


def _convergence_table(content: Mapping[str, Any]) -> Table:
    found = content["convergence"]
    fields = (
        words("refinement", lambda item: f"{item['refinement']}×"),
        whole("nodes", "nodes"),
        fixed("largest difference K", "max_difference_K", 3),
    )
    caption = f"Against axisymmetric elements with {found['axisymmetric_unknowns']} unknowns."
    return table_of(fields, found["rows"], caption)


def _speed_table(content: Mapping[str, Any]) -> Table:
    fields = (
        fixed("rpm", "speed_rpm", 0),
        rounded("matched K", "matched_max_K", 2),
        fixed("matched, conductances fixed K", "fixed_max_K", 2),
        fixed("not matched K", "unmatched_max_K", 2),
    )
    said = "Largest difference of any node to the elements."
    for item in content["matched"].get("not_reached", ()):
        said += f" At {item['speed_rpm']:.0f} rpm there is nothing to compare: {item['reason']}"
    return table_of(fields, content["matched"]["speeds"], said)


def _claim_blocks(claim: Mapping[str, Any]) -> list[Any]:
    if "not_possible" in claim:
        return [Text(claim["not_possible"])]
    fields = (
        words("model", "model"),
        words("design", "design"),
        fixed("maximum °C", "max_degC"),
        words("inner − outer K", lambda item: _by_name(item["ring_difference_K"])),
        fixed("film W/(m²·K)", "film_coefficient_W_m2K", 0),
        fixed("to the coolant W", "coolant_heat_W", 0),
        fixed("friction W", "friction_heat_W", 0),
    )
    return [table_of(fields, claim["cases"], claim["source"]), Bullets(claim["explanation"])]


def _by_name(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {number(value, 1)}" for name, value in values.items())
