"""Build the book: every chapter by running it, then the page of contents."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from book.chapters import ENTRIES
from book.page import Chapter, Entry, Pictures, link, render_chapter
from book.work import Desk, fingerprint
from spindle_fem.errors import BadInputError
from spindle_fem.report.block_page import Commands, Section, Table, Text, render_document
from spindle_fem.report.table_rows import column, rows_of
from spindle_fem.results.output_folder import replace_text

CLAIMS = Path(__file__).parent / "claims.toml"
AGAIN = (
    "make book                       # this book",
    "make study                      # the concealed study it reads, hours; STUDY=folder for another",
)


def read_claims(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """Claims of the README with the chapters that show them.

    Raises
    ------
    BadInputError
        A claim names a chapter that is not in the book.
    """
    by_name = {entry.name: entry for entry in entries}
    claims = []
    for number, claim in enumerate(tomllib.loads(CLAIMS.read_text(encoding="utf-8")).get("claim", [])):
        for name in claim["chapters"]:
            if name not in by_name:
                raise BadInputError(
                    f"{CLAIMS.name}: claim[{number}]",
                    f"names chapter {name!r}, which is not in the book.",
                    f"Allowed: {', '.join(by_name)}.",
                )
        claims.append({"text": claim["text"], "entries": [by_name[name] for name in claim["chapters"]]})
    return claims


def build(output: Path, desk: Desk, only: Sequence[str] = ()) -> list[tuple[Entry, Chapter]]:
    """Write the book.

    Parameters
    ----------
    output : Path
        Folder of the pages.
    desk : Desk
    only : sequence of str
        Names of chapters; all by default. The page of contents is written with all of them only.

    Raises
    ------
    BadInputError
    """
    wanted = set(only)
    unknown = wanted - {entry.name for entry in ENTRIES}
    if unknown:
        raise BadInputError(
            "--only", f"{', '.join(sorted(unknown))} is no chapter.", f"Allowed: {_names(ENTRIES)}."
        )
    claims = read_claims(ENTRIES)
    output.mkdir(parents=True, exist_ok=True)
    made = []
    for entry in ENTRIES:
        if wanted and entry.name not in wanted:
            continue
        desk.tell(entry.title)
        chapter = entry.make(desk, Pictures(output / "pictures", entry.name))
        replace_text(output / entry.page, render_chapter(entry, chapter, ENTRIES))
        made.append((entry, chapter))
    if not wanted:
        replace_text(output / "index.html", _contents(made, claims, desk))
    return made


def _names(entries: Sequence[Entry]) -> str:
    return ", ".join(entry.name for entry in entries)


def _contents(made: Sequence[tuple[Entry, Chapter]], claims: Sequence[dict[str, Any]], desk: Desk) -> str:
    when = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
    words = f"Written {when} from the source with fingerprint {fingerprint('tool')}."
    if desk.outdated:
        words += f" Made with an earlier version of the source: {', '.join(dict.fromkeys(desk.outdated))}."
    found = [
        [Markup("{}&nbsp; {}").format(number, link(entry)), chapter.outcome]
        for number, (entry, chapter) in enumerate(made, start=1)
    ]
    shown = [[claim["text"], Markup("; ").join(map(link, claim["entries"]))] for claim in claims]
    sections = [
        Section(
            "chapters", "Chapters", [Table((column("chapter"), column("what came out")), rows_of(found))]
        ),
        Section(
            "claims",
            "What the README claims, and where it is shown",
            [Table((column("claim"), column("chapter")), rows_of(shown))],
        ),
        Section("again", "Run it again", [Commands(AGAIN), Text(words)]),
    ]
    return render_document(
        "spindle_fem",
        "Verification and validation",
        sections,
        "Every figure in these pages was made by running the program; none is pasted by hand.",
        "The pages need no network; the pictures are also in the folder “pictures”.",
    )
