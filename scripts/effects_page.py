"""Tables of docs/effects.md, written from the effects themselves.

``python -m scripts.effects_page`` renews them; the text around them stays.
"""

from __future__ import annotations

import re
from pathlib import Path

from spindle_fem.effects.framework.card import GROUPS
from spindle_fem.effects.registry import catalogue

PAGE = Path(__file__).parents[1] / "docs" / "effects.md"
HEAD = "| effect | law | amplitude, shape (prior) | acts on | source |\n|---|---|---|---|---|"


def renewed(page: str) -> str:
    """The page with the table of every group as the effects have it.

    Raises
    ------
    ValueError
        The page has no place for a group.
    """
    for group in GROUPS:
        rows = [
            f"| `{name}` | {effect.card.law} | {effect.card.size} | {effect.card.acts_on} | "
            f"{effect.card.source} |".replace("|  |", "| |")
            for name, effect in sorted(catalogue().items())
            if effect.card.group == group
        ]
        table = "\n".join([f"<!-- {group} -->", HEAD, *rows, "<!-- end -->"])
        found = re.search(rf"<!-- {group} -->\n.*?<!-- end -->", page, flags=re.DOTALL)
        if found is None:
            raise ValueError(f"docs/effects.md has no table of {group}")
        page = page[: found.start()] + table + page[found.end() :]
    return page


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
