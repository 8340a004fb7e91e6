"""Blocks that chapters with a diagnosis share: the tool's own tables and pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from book.page import Pictures
from spindle_fem.report.block_page import Bullets, Notice, Text, illustration_of
from spindle_fem.report.diagnosis_report import CAPTIONS
from spindle_fem.report.diagnosis_tables import (
    cards,
    channel_table,
    fit_table,
    next_blocks,
    place_tables,
    set_tables,
    where_text,
)
from spindle_fem.report.diagnosis_words import confidence_words, verdict_sentence
from spindle_fem.results.output_folder import is_complete


def finished(folder: Path) -> bool:
    """Whether a folder has a diagnosis."""
    return (folder / "diagnosis.json").is_file() and is_complete(folder)


def verdict_blocks(content: Mapping[str, Any]) -> list[Any]:
    """Verdict of the tool in its own words, and its numbers."""
    return [Notice(verdict_sentence(content)), cards(content), fit_table(content), *channel_table(content)]


def found_blocks(content: Mapping[str, Any]) -> list[Any]:
    """Findings, alternatives and certainty, in the tool's own words."""
    return [*set_tables(content), Text("How sure this is, by the tool:"), Bullets(confidence_words(content))]


def place_blocks(content: Mapping[str, Any]) -> list[Any]:
    """Place and time of the mismatch, if anything was found."""
    if content["verdict"] == "consistent":
        return []
    return [*where_text(content), *place_tables(content)]


def next_step_blocks(content: Mapping[str, Any]) -> list[Any]:
    """Proposed next measurement."""
    return list(next_blocks(content))


def own_pictures(folder: Path, names: Sequence[str], pictures: Pictures, prefix: str = "") -> list[Any]:
    """Pictures that the diagnosis made itself, those that are there."""
    blocks = []
    for name in names:
        path = folder / "figures" / f"{name}.png"
        if path.is_file():
            pictures.copy(f"{prefix}{name}", path)
            blocks.append(illustration_of(path, CAPTIONS.get(name, name)))
    return blocks
