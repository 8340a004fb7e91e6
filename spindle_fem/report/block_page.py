"""Reports put together from blocks: for every command that is not a single run.

A report is a list of sections, a section a list of blocks (text, table,
figure, cards, warnings). All look like the report of a run and are as
self-contained.

>>> from spindle_fem.report.run_tables import column, rows_of
>>> table = Table((column("design"), column("°C", number=True)), rows_of([["a", "31.5"]]))
>>> section = Section("results", "Results", [Text("One design."), table])
>>> html = render_document("Sweep", "Channel depth", [section])
>>> "31.5" in html and 'id="results">Results</h2>' in html
True
"""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from spindle_fem.report.figure_style import rasterise
from spindle_fem.report.page_templates import render_page

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure
    from PIL.Image import Image


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph, plain text."""

    text: str
    kind: str = field(default="text", init=False)


@dataclass(frozen=True, slots=True)
class Bullets:
    """A list of sentences."""

    items: Sequence[str]
    kind: str = field(default="bullets", init=False)


@dataclass(frozen=True, slots=True)
class Notice:
    """A paragraph that stands out."""

    text: str
    tone: Literal["good", "bad", ""] = ""
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
    """Columns of :func:`~spindle_fem.report.run_tables.column`, rows of ``rows_of``."""

    columns: Sequence[Mapping[str, Any]]
    rows: Sequence[Mapping[str, Any]]
    caption: str = ""
    folded: str = ""
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
class Section:
    """A heading with its blocks; ``id`` is the anchor."""

    id: str
    title: str
    blocks: Sequence[Any]


def illustration_of(picture: Figure | Image | Path, caption: str, alt: str = "") -> Illustration:
    """Picture for a report, from a figure, an image of one, or an image file.

    WebP at this quality is a fifth of the PNG, which stays the original.
    """
    from PIL import Image

    if hasattr(picture, "canvas"):
        image = Image.fromarray(rasterise(picture))
    elif isinstance(picture, Image.Image):
        image = picture.convert("RGB")
    else:
        with Image.open(picture) as opened:
            image = opened.convert("RGB")
    buffer = io.BytesIO()
    image.save(buffer, "WEBP", quality=76, method=1)
    source = "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()
    return Illustration(source, caption, alt or caption, *image.size)


def render_document(kind: str, title: str, sections: Sequence[Section], subtitle: str = "") -> str:
    """HTML of a report.

    Parameters
    ----------
    kind : str
        What the report is of, set above the title: "Sweep", "Diagnosis".
    title : str
    sections : sequence of Section
    subtitle : str
    """
    return render_page("document.html.j2", kind=kind, title=title, subtitle=subtitle, sections=sections)
