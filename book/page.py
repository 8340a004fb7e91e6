"""Pages of the book: a chapter, its blocks, and how they are rendered."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from spindle_fem.report.block_page import (
    Bullets,
    Columns,
    Commands,
    Heading,
    Illustration,
    Notice,
    Section,
    Text,
    illustration_of,
    render_document,
)
from spindle_fem.report.figure_style import save_png

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Chapter:
    """Results of a chapter.

    Attributes
    ----------
    outcome : str
        One sentence with the figures, for the page of contents.
    tone : {"good", "bad", ""}
        ``good`` if every required figure is met, ``bad`` if one is not.
    evidence, not_evidence : sequences of str
        What the chapter shows, and what it does not.
    left_out : str
        Why there is nothing, where there is nothing.
    """

    outcome: str
    sections: Sequence[Section] = ()
    commands: Sequence[str] = ()
    evidence: Sequence[str] = ()
    not_evidence: Sequence[str] = ()
    tone: str = ""
    left_out: str = ""


@dataclass(frozen=True, slots=True)
class Entry:
    """A chapter's place in the book: file name, title, and the function that makes it."""

    name: str
    title: str
    make: Callable[[Any, Any], Chapter]

    @property
    def page(self) -> str:
        """File of the page."""
        return f"{self.name}.html"


class Pictures:
    """Keeps the pictures of one chapter as PNG files and gives them to its page."""

    def __init__(self, folder: Path, chapter: str) -> None:
        self.folder, self.chapter = folder, chapter

    def add(self, name: str, figure: Figure, caption: str) -> Illustration:
        """Save a figure; returns the block for the page."""
        self.folder.mkdir(parents=True, exist_ok=True)
        save_png(figure, self.folder / f"{self.chapter}_{name}.png")
        return illustration_of(figure, caption)

    def copy(self, name: str, path: Path) -> None:
        """Keep a picture that a command made."""
        self.folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, self.folder / f"{self.chapter}_{name}.png")


def link(entry: Entry, words: str = "") -> Markup:
    """A link to a chapter's page, by its title or other words."""
    return Markup('<a href="{}">{}</a>').format(entry.page, words or entry.title)


def render_chapter(entry: Entry, chapter: Chapter, entries: Sequence[Entry]) -> str:
    """HTML of a chapter, with links to those before and after it."""
    at = list(entries).index(entry)
    opening: list[Any] = [Notice(chapter.outcome, chapter.tone)]
    if chapter.left_out:
        opening.append(Text(chapter.left_out))
    if chapter.evidence or chapter.not_evidence:
        shown = [Heading("What this is evidence of"), Bullets(chapter.evidence)]
        opening.append(Columns([shown, [Heading("What it is not"), Bullets(chapter.not_evidence)]]))
    sections = [Section("", "", opening), *chapter.sections]
    if chapter.commands:
        sections.append(Section("again", "Run it again", [Commands(chapter.commands)]))
    ways = [Markup('<a href="index.html">All chapters</a>')]
    if at:
        ways.append(link(entries[at - 1], f"before: {entries[at - 1].title}"))
    if at + 1 < len(entries):
        ways.append(link(entries[at + 1], f"next: {entries[at + 1].title}"))
    return render_document(
        "Verification and validation", f"{at + 1}  {entry.title}", sections, Markup(" · ").join(ways)
    )
