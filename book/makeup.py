"""Composition of a concealed study, counted in its answers."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from spindle_fem.report.block_page import Table
from spindle_fem.report.table_rows import column, rows_of

_DONE = ("gaps", "empty", "spikes", "doubled", "swapped")


def makeup_tables(study: Path) -> list[Table]:
    """Kinds of cases, how they were recorded, and how often each effect was concealed.

    Parameters
    ----------
    study : Path
        Folder with ``answers``.
    """
    answers = [
        json.loads(path.read_text(encoding="utf-8")) for path in sorted((study / "answers").glob("*.json"))
    ]
    columns = (column("what"), column("cases", number=True))
    concealed = Counter(effect["effect"] for answer in answers for effect in answer["effects"])
    return [
        Table(columns, rows_of(counted(answers)), f"{len(answers)} cases."),
        Table(
            (column("effect"), column("times concealed", number=True)),
            rows_of([name.replace("_", " "), str(count)] for name, count in concealed.most_common()),
            "",
            "How often each effect was concealed",
        ),
    ]


def counted(answers: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Rows of words and numbers of cases.

    >>> counted([{"effects": [], "detectable": True, "two_recordings": True}])[0]
    ['nothing concealed', '1']
    """

    def number(chosen: Iterable[Any]) -> str:
        return str(sum(map(bool, chosen)))

    def of(key: str) -> list[Any]:
        return [answer.get(key) for answer in answers]

    effects = of("effects")
    rows = [
        ["nothing concealed", number(not items for items in effects)],
        ["one effect", number(len(items) == 1 for items in effects)],
        ["two effects", number(len(items) == 2 for items in effects)],
        [
            "an effect outside the catalogue",
            number(any(item.get("outside_catalogue") for item in items) for items in effects),
        ],
        ["too weak to be seen by anyone", number(value is False for value in of("detectable"))],
        [
            "clear: strong, and nothing else comes near",
            number(a["effects"] and a.get("clear") for a in answers),
        ],
        ["with another effect that explains as much", number(of("indistinguishable"))],
        ["with an earlier run for calibration", number(of("two_recordings"))],
    ]
    for key, words in (("cycle", "load cycle"), ("oil", "oil temperature")):
        kinds = Counter(str(value) for value in of(key) if value)
        rows += [[f"{words}: {name.replace('_', ' ')}", str(count)] for name, count in kinds.most_common()]
    rounded = Counter(
        answer["noise"]["rounding_K"] for answer in answers if answer.get("noise", {}).get("rounding_K")
    )
    rows += [[f"rounded to {step:g} K", str(count)] for step, count in sorted(rounded.items())]
    for fault in _DONE:
        hit = [any(part.get(fault) for part in (a.get("rows") or {}).values()) for a in answers]
        words = {"empty": "empty cells", "doubled": "doubled rows", "swapped": "swapped rows"}.get(
            fault, fault
        )
        rows.append([f"with {words}", number(hit)])
    return rows
