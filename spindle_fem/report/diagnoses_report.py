"""``report.html`` of the diagnoses of many recordings: a row each, with a link to its own page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from spindle_fem.report.block_page import Cards, Section, Text, render_document
from spindle_fem.report.table_rows import Field, fixed, plain, table_of, words
from spindle_fem.results.output_folder import read_content, replace_text

DIAGNOSES, DIAGNOSES_SCHEMA = "diagnoses.json", "spindle-fem/diagnoses/1"


def write_diagnoses_report(folder: Path) -> Path:
    """Write the page that lists the diagnoses of a folder.

    Raises
    ------
    BadInputError
        ``diagnoses.json`` is missing or unknown.
    """
    content = read_content(folder / DIAGNOSES, DIAGNOSES_SCHEMA, "diagnose")
    rows, verdicts = content["rows"], Counter(row["verdict"] for row in content["rows"] if row["verdict"])
    cards = [{"value": str(content["recordings"]), "name": "recordings"}]
    cards += [{"value": str(number), "name": plain(verdict)} for verdict, number in verdicts.most_common()]
    if content["failed"]:
        cards.append({"value": str(content["failed"]), "name": "failed"})
    sections = [
        Section("recordings", "Recordings", [Cards(cards), table_of(_FIELDS, rows), Text(_BELOW)]),
    ]
    failed = [row for row in rows if row["reason"]]
    if failed:
        sections.append(
            Section("reasons", "Reasons", [table_of([_RECORDING, words("reason", "reason")], failed)])
        )
    html = render_document("Diagnoses", content["machine"], sections, "Each recording by itself.")
    return replace_text(folder / "report.html", html)


def _link(row: Mapping[str, Any]) -> Any:
    name = row["recording"]
    if row["status"] != "ok":
        return name
    return Markup('<a href="{}/report.html">{}</a>').format(quote(name), name)


_BELOW = (
    "Before and after: root mean square of what is held out, the machine as defined (or calibrated) and with "
    "what was found. Probability is that of the whole set of findings."
)
_RECORDING = Field("recording", _link, lambda value: value)
_FIELDS = (
    _RECORDING,
    words("verdict", lambda row: plain(row["verdict"] or row["status"])),
    words("findings", lambda row: plain(row["findings"] or "")),
    fixed("probability", "probability", 2),
    fixed("before K", "before_rmse_K", 3),
    fixed("after K", "after_rmse_K", 3),
    fixed("noise K", "noise_K", 3),
    fixed("s", "wall_s", 0),
)
