"""Pages put together from blocks: the report of every command, and the book.

A page is a list of sections, a section a list of blocks; one template draws
them. What is inside a page needs no network and no other file. Texts and
cells are escaped but where they are ``markupsafe.Markup``.

>>> from spindle_fem.report.table_rows import column, rows_of
>>> table = Table((column("design"), column("°C", number=True)), rows_of([["a", "31.5"]]))
>>> section = Section("results", "Results", [Text("One design."), table])
>>> html = render_document("Sweep", "Channel depth", [section])
>>> "31.5" in html and 'id="results">Results</h2>' in html
True
"""

from __future__ import annotations

import base64
import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from spindle_fem import __version__

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure
    from PIL.Image import Image

# A word of more letters than a narrow column has room for.
LONG_KEY = re.compile(r"[\w.]{20,}")


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph, plain text."""

    text: str
    kind: str = field(default="text", init=False)


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading within a section."""

    text: str
    kind: str = field(default="heading", init=False)


@dataclass(frozen=True, slots=True)
class Commands:
    """Lines for a shell."""

    lines: Sequence[str]
    kind: str = field(default="commands", init=False)


@dataclass(frozen=True, slots=True)
class Bullets:
    """A list of sentences."""

    items: Sequence[str]
    kind: str = field(default="bullets", init=False)


@dataclass(frozen=True, slots=True)
class Notice:
    """A highlighted paragraph; with a ``lead`` in bold, an alert."""

    text: str
    tone: Literal["good", "bad", ""] = ""
    lead: str = ""
    kind: str = field(default="notice", init=False)


@dataclass(frozen=True, slots=True)
class Cards:
    """Numbers with their names: mappings with ``value`` and ``name``."""

    items: Sequence[Mapping[str, str]]
    kind: str = field(default="cards", init=False)


@dataclass(frozen=True, slots=True)
class Warnings:
    """Coded warnings: objects or mappings with ``code`` and ``text``."""

    items: Sequence[Any]
    kind: str = field(default="warnings", init=False)


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of :func:`~spindle_fem.report.table_rows.column`, rows of ``rows_of``.

    With ``folded``, its summary, it is shut until it is clicked, but where ``open``.
    """

    columns: Sequence[Mapping[str, Any]]
    rows: Sequence[Mapping[str, Any]]
    caption: str = ""
    folded: str = ""
    open: bool = False
    kind: str = field(default="table", init=False)


@dataclass(frozen=True, slots=True)
class Illustration:
    """A picture inside the page; make it with :func:`illustration_of`."""

    source: str
    caption: str
    alt: str
    width: int
    height: int
    kind: str = field(default="figure", init=False)


@dataclass(frozen=True, slots=True)
class Columns:
    """Blocks side by side where the page is wide enough."""

    columns: Sequence[Sequence[Any]]
    kind: str = field(default="columns", init=False)


@dataclass(frozen=True, slots=True)
class Interactive:
    """A template with its data as JSON and the script that runs it."""

    template: str
    script: str
    data: Any
    kind: str = field(default="part", init=False)

    @property
    def payload(self) -> str:
        """The data as JSON that is safe inside a page."""
        return json.dumps(self.data).replace("</", "<\\/")


@dataclass(frozen=True, slots=True)
class Section:
    """A heading with its blocks; ``id`` is the anchor. Without a title it is not among the contents."""

    id: str
    title: str
    blocks: Sequence[Any]
    screen_only: bool = False


def illustration_of(picture: Figure | Image | Path, caption: str, alt: str = "") -> Illustration:
    """Picture for a report, from a figure, an image of one, or an image file.

    Pictures in true colour become WebP, at this quality a fifth of the PNG, which stays the original.
    Charts with a palette are smaller as PNG, and sharp.
    """
    # loaded here: pages are read by processes that draw nothing
    from PIL import Image

    from spindle_fem.report.figure_style import PNG_LEVEL, rasterise

    if hasattr(picture, "canvas"):
        image = Image.fromarray(rasterise(picture))
    elif isinstance(picture, Image.Image):
        image = picture
    else:
        with Image.open(picture) as opened:
            opened.load()
            image = opened
    buffer = io.BytesIO()
    kind = "png" if image.mode == "P" else "webp"
    if kind == "png":
        image.save(buffer, "PNG", compress_level=PNG_LEVEL)
    else:
        image.convert("RGB").save(buffer, "WEBP", quality=76, method=1)
    source = f"data:image/{kind};base64," + base64.b64encode(buffer.getvalue()).decode()
    return Illustration(source, caption, alt or caption, *image.size)


def render_document(
    kind: str,
    title: str,
    sections: Sequence[Section],
    subtitle: str = "",
    footer: str = "This file needs no network and no other file.",
) -> str:
    """HTML of a page.

    Parameters
    ----------
    kind : str
        What the page is of, set above the title: "Sweep", "Diagnosis".
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("spindle_fem.report", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["breakable"] = breakable
    scripts = [block.script for section in sections for block in section.blocks if block.kind == "part"]
    return environment.get_template("page.html.j2").render(
        kind=kind,
        title=title,
        subtitle=subtitle,
        sections=sections,
        footer=footer,
        scripts=scripts,
        program_version=__version__,
    )


def breakable(cell: object) -> object:
    """A cell in which a long key of a definition may go on in the next line after each of its dots.

    >>> print(breakable("part.housing.segment.length < 0.5"))
    part.<wbr>housing.<wbr>segment.<wbr>length &lt; 0.5
    """
    from markupsafe import Markup, escape

    if isinstance(cell, Markup):
        return cell
    return Markup(LONG_KEY.sub(lambda found: found[0].replace(".", ".<wbr>"), escape(cell)))
