"""Picture of a definition before anything is solved: the section, or of a faulty one what there is of it.

Faults are numbered in the drawing at the part, bearing, surface or probe that they name, and listed below.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import SpindleFemError
from spindle_fem.report.figure_style import INK, MUTED, new_figure, save_png, set_title, styled
from spindle_fem.report.machine_drawing import machine_drawing, part_colours
from spindle_fem.report.meridian_axes import MM, box, meridian_axes

FAULT_COLOUR = "#c1121f"
WIDTH, MARGIN, TOP, LINE, LETTERS, FOOT, LEAST_HEIGHT = 1600.0, 94.0, 120.0, 30.0, 138, 130.0, 200.0
Box = tuple[tuple[float, float], tuple[float, float]]


def draw_definition(
    path: Path, spec: MachineSpec | None, faults: Sequence[SpindleFemError] = ()
) -> tuple[SpindleFemError, ...]:
    """Write the picture of a machine, with any faults marked.

    Parameters
    ----------
    spec : MachineSpec or None
        The machine, or its sound tables.

    Returns
    -------
    tuple of SpindleFemError
        Faults that have a place in the drawing.
    """
    if not faults and spec is not None:
        save_png(machine_drawing(spec), path, colours=256)
        return ()
    boxes = {} if spec is None else dict(_boxes(spec))
    places = [_place(fault, boxes, spec) for fault in faults]
    save_png(_faulty_figure(spec, boxes, faults, places), path, colours=256)
    return tuple(fault for fault, place in zip(faults, places, strict=True) if place is not None)


def _boxes(spec: MachineSpec) -> Iterator[tuple[str, Box]]:
    """Cylinders in the meridian plane by name, [m]: segments, and rings of bearings whose type is sound."""
    for part in spec.part:
        for segment in part.segment:
            radii = (0.5 * segment.inner_diameter, 0.5 * segment.outer_diameter)
            yield f"{part.name}.{segment.name}", (segment.z, radii)
    for group, bearing in spec.bearings:
        kind = spec.bearing_types.get(group.type_name(bearing))
        if kind is not None:
            inner = (0.5 * kind.bore_diameter, 0.5 * kind.inner_ring_outer_diameter)
            outer = (0.5 * kind.outer_ring_inner_diameter, 0.5 * kind.outer_diameter)
            yield f"{bearing.name}.inner_ring", (bearing.z, inner)
            yield f"{bearing.name}.outer_ring", (bearing.z, outer)


def _place(
    fault: SpindleFemError, boxes: dict[str, Box], spec: MachineSpec | None
) -> tuple[float, float] | None:
    """Position of a fault in the meridian plane, (z, r) [m], from its key or else from its text."""
    if spec is None:
        return None
    parts = {surface.name: surface.part for surface in spec.surface}
    parts |= {probe.name: probe.part or "" for probe in spec.probe}
    parts |= {source.name: source.part or parts.get(source.surface or "", "") for source in spec.source}
    parts |= {group.name: group.bearing[0].name for group in spec.bearing_set if group.bearing}
    if spec.channel is not None:
        parts["channel"] = spec.channel.part
    for text in (fault.where, fault.what):
        words = {tail for dotted in re.findall(r"[\w.]+", text) for tail in _tails(dotted)}
        # The longest name says most: a segment before its part.
        for word in sorted(words, key=lambda item: (-len(item), item)):
            named = parts.get(word, word)
            found = [b for name, b in boxes.items() if name == named or name.startswith(named + ".")]
            if named and found:
                z, r = np.mean([np.mean(item, axis=1) for item in found], axis=0)
                return float(z), float(r)
    return None


def _tails(word: str) -> Iterator[str]:
    """Every run of the dotted pieces of a key.

    >>> list(_tails("part.shaft.segment"))
    ['part', 'part.shaft', 'part.shaft.segment', 'shaft', 'shaft.segment', 'segment']
    """
    pieces = [piece for piece in word.split(".") if piece]
    for first in range(len(pieces)):
        for last in range(first + 1, len(pieces) + 1):
            yield ".".join(pieces[first:last])


@styled
def _faulty_figure(
    spec: MachineSpec | None,
    boxes: dict[str, Box],
    faults: Sequence[SpindleFemError],
    places: Sequence[tuple[float, float] | None],
) -> Figure:
    texts = [textwrap.wrap(f"{number}  {fault}", LETTERS) for number, fault in enumerate(faults, 1)]
    rows = sum(map(len, texts))
    height = 0.0
    if boxes:
        ends = np.array([item[0] for item in boxes.values()]) * MM
        pad = 0.03 * float(np.ptp(ends)) + 1.0
        z_range = (float(ends.min()) - pad, float(ends.max()) + pad)
        reach = 1.05 * max(abs(item[1][1]) for item in boxes.values()) * MM
        width = WIDTH - 2.0 * MARGIN
        height = max(LEAST_HEIGHT, width * reach / (z_range[1] - z_range[0]))
    figure = new_figure(TOP + height + FOOT + LINE * rows, WIDTH)
    number = f"{len(faults)} fault{'s' if len(faults) != 1 else ''}"
    named = (spec.title or spec.name) if spec is not None else ""
    set_title(figure, named or "A machine", f"{number}. Drawn are the sound parts and bearings.")
    if boxes:
        axes = meridian_axes(figure, (MARGIN, TOP, width, height), z_range, (0.0, reach))
        owners = [name if name.endswith("_ring") else name.partition(".")[0] for name in boxes]
        distinct = list(dict.fromkeys(owners))
        colours = dict(zip(distinct, part_colours(distinct), strict=True))
        for owner, (z, radii) in zip(owners, boxes.values(), strict=True):
            style = {"facecolor": colours[owner], "edgecolor": INK, "linewidth": 0.8, "alpha": 0.75}
            axes.add_patch(box(z, radii, 1.0, **style))
        stacked: dict[tuple[float, float], int] = {}
        for position, place in enumerate(places, 1):
            if place is None:
                continue
            beside = stacked[place] = stacked.get(place, -1) + 1
            at = (place[0] * MM, place[1] * MM)
            axes.annotate(
                str(position), at, (13.0 * beside, 0.0), textcoords="offset points", ha="center", va="center",
                fontsize=9.0, color="white", fontweight="bold", zorder=9,
                bbox={"boxstyle": "circle,pad=0.25", "facecolor": FAULT_COLOUR, "edgecolor": "none"},
            )  # fmt: skip
    total, line = TOP + height + FOOT + LINE * rows, TOP + height + FOOT - LINE
    for text, place in zip(texts, places, strict=True):
        for row in text:
            colour = MUTED if place is None else INK
            figure.text(30.0 / WIDTH, 1.0 - line / total, row, fontsize=9.0, color=colour, va="center")
            line += LINE
    return figure
