"""Pages of the book: a chapter, its blocks, and how they are rendered."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spindle_fem import __version__
from spindle_fem.report.block_page import Illustration, Section, illustration_of
from spindle_fem.report.figure_style import save_png

if TYPE_CHECKING:
    from matplotlib.figure import Figure


TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True, slots=True)
class Commands:
    """Lines for a shell."""

    lines: Sequence[str]
    kind: str = field(default="commands", init=False)


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading within a section."""

    text: str
    kind: str = field(default="heading", init=False)


@dataclass(frozen=True, slots=True)
class Links:
    """Sentences with a link each: pairs of words and address."""

    items: Sequence[tuple[str, str]]
    kind: str = field(default="links", init=False)


@dataclass(frozen=True, slots=True)
class Chapter:
    """What a chapter found.

    Attributes
    ----------
    outcome : str
        One sentence with the figures, for the page of contents.
    tone : {"good", "bad", ""}
        ``good`` where every figure asked for is met, ``bad`` where one is not.
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


def environment() -> Any:
    """The report's templates with those of the book on top, everything escaped."""
    import jinja2

    made = jinja2.Environment(
        loader=jinja2.ChoiceLoader(
            [
                jinja2.FileSystemLoader(TEMPLATES),
                jinja2.PackageLoader("spindle_fem.report", "templates"),
            ]
        ),
        autoescape=jinja2.select_autoescape(["html", "j2"]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals["program_version"] = __version__
    return made


def render_chapter(entry: Entry, chapter: Chapter, entries: Sequence[Entry]) -> str:
    """HTML of a chapter, with links to those before and after it."""
    at = list(entries).index(entry)
    sections = list(chapter.sections)
    if chapter.commands:
        sections.append(Section("again", "Run it again", [Commands(chapter.commands)]))
    return (
        environment()
        .get_template("chapter.html.j2")
        .render(
            kind="Verification and validation",
            title=f"{at + 1}  {entry.title}",
            chapter=chapter,
            sections=sections,
            before=entries[at - 1] if at else None,
            after=entries[at + 1] if at + 1 < len(entries) else None,
        )
    )
