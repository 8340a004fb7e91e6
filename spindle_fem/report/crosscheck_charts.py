"""Charts of a cross-check."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from spindle_fem.model.lumped.machine_network import MachineNetwork
from spindle_fem.report.figure_style import (
    CYCLE,
    INK,
    MUTED,
    TEMPERATURE_MAP,
    new_figure,
    plain_decades,
    save_png,
    styled,
)
from spindle_fem.studies.crosscheck.causes import CAUSES, CauseStudy
from spindle_fem.studies.crosscheck.crosscheck_study import Crosscheck
from spindle_fem.studies.crosscheck.node_comparison import Comparison

Array = NDArray[np.float64]
_MM = 1.0e3
_LARGEST = 24

CAPTIONS = {
    "difference": (
        "Network less elements at each node, on the upper half of the meridian section. White lines "
        "part the nodes; "
        "circles are balls, and diamonds gap air."
    ),
    "temperatures": "The same section coloured by temperature: network above, elements averaged over "
    "its nodes below.",
    "causes": "The nodes that differ most, and what makes them differ. The bars of a node add up to "
    "its mark.",
    "speeds": "Largest difference of any node against the elements over speed.",
    "convergence": "Refined network against axisymmetric elements of the same machine with the helix "
    "smeared, at the paper's nodes.",
}


def _patches(
    axes: Any, machine: MachineNetwork, values: Array, colour_map: Any, norm: Any, mirror: bool = False
) -> Any:
    cells, node = machine.cells, machine.partition.node_of_cell
    sign = -1.0 if mirror else 1.0
    boxes = [
        Rectangle((_MM * z[0], sign * _MM * r[0]), _MM * (z[1] - z[0]), sign * _MM * (r[1] - r[0]))
        for z, r in zip(cells.z, cells.r, strict=True)
    ]
    drawn = PatchCollection(boxes, cmap=colour_map, norm=norm, edgecolors="face", linewidths=0.4)
    drawn.set_array(values[node])
    axes.add_collection(drawn)
    faces = cells.conduction
    apart = node[faces.first] != node[faces.second]
    for radial, position, span in zip(
        faces.radial[apart], faces.position[apart], faces.span[apart], strict=True
    ):
        other = (position, position)
        z, r = (span, other) if radial else (other, span)
        axes.plot(_MM * np.array(z), sign * _MM * np.array(r), color="white", linewidth=0.6)
    contact = cells.contact
    for radial, position, span in zip(contact.radial, contact.position, contact.span, strict=True):
        other = (position, position)
        z, r = (span, other) if radial else (other, span)
        axes.plot(_MM * np.array(z), sign * _MM * np.array(r), color=INK, linewidth=0.7)
    for (group, bearing), value in zip(
        machine.spec.bearings, values[machine.n_solid : machine.air_start], strict=True
    ):
        kind = machine.spec.bearing_types[group.type_name(bearing)]
        axes.scatter(
            [_MM * np.mean(bearing.z)], [sign * 0.5 * _MM * kind.pitch], c=[value], cmap=colour_map,
            norm=norm, s=70,
            edgecolors=INK, linewidths=0.6, zorder=3,
        )  # fmt: skip
    start = machine.air_start
    for gap in machine.gaps.values():
        middle = 0.5 * (gap.edges[1:] + gap.edges[:-1])
        radius = 0.5 * sum(gap.radii)
        axes.scatter(
            _MM * middle, np.full(len(middle), sign * _MM * radius), c=values[start : start + gap.n_bands],
            cmap=colour_map, norm=norm, s=60, marker="D", edgecolors=INK, linewidths=0.6, zorder=3,
        )  # fmt: skip
        start += gap.n_bands
    return drawn


def _section_axes(figure: Figure, machine: MachineNetwork, both_halves: bool) -> Any:
    axes = figure.add_axes((0.06, 0.13, 0.82, 0.78))
    top = _MM * machine.cells.r.max() * 1.04
    axes.set(
        xlim=(_MM * machine.cells.z.min() - 8.0, _MM * machine.cells.z.max() + 8.0),
        ylim=(-top if both_halves else 0.0, top),
        xlabel="z / mm",
        ylabel="r / mm",
        aspect="equal",
    )
    axes.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    axes.grid(False)
    return axes


@styled
def difference_map(comparison: Comparison) -> Figure:
    """Network less elements on the machine."""
    figure = new_figure(760.0)
    machine = comparison.machine
    axes = _section_axes(figure, machine, False)
    values = comparison.difference
    limit = max(0.1, float(np.abs(values).max()))
    drawn = _patches(axes, machine, values, "RdBu_r", TwoSlopeNorm(0.0, -limit, limit))
    figure.colorbar(drawn, ax=axes, label="network − elements / K", fraction=0.03, pad=0.02)
    axes.set_title("Network less elements, node by node")
    return figure


@styled
def temperature_map(comparison: Comparison) -> Figure:
    """Temperature fields of network and FEM on one scale."""
    figure = new_figure(1150.0)
    machine = comparison.machine
    axes = _section_axes(figure, machine, True)
    network, fem = (
        values - 273.15 for values in (comparison.network_temperature, comparison.fem_temperature)
    )
    solid = slice(0, machine.coolant_start)
    low, high = min(network[solid].min(), fem[solid].min()), max(network[solid].max(), fem[solid].max())
    from matplotlib.colors import Normalize

    norm = Normalize(low, high)
    drawn = _patches(axes, machine, network, TEMPERATURE_MAP, norm)
    _patches(axes, machine, fem, TEMPERATURE_MAP, norm, mirror=True)
    figure.colorbar(drawn, ax=axes, label="temperature / °C", fraction=0.03, pad=0.02)
    axes.set_title("Network (above) and elements (below)")
    return figure


@styled
def causes_chart(comparison: Comparison, study: CauseStudy, titles: Mapping[str, str]) -> Figure:
    """Contributions at the nodes that differ most."""
    order = np.argsort(-np.abs(comparison.difference))[:_LARGEST][::-1]
    figure = new_figure(240.0 + 38.0 * len(order))
    axes = figure.add_axes((0.2, 0.1, 0.77, 0.74))
    place = np.arange(len(order))
    positive, negative = np.zeros(len(order)), np.zeros(len(order))
    for colour, (name, values) in zip(CYCLE, study.contribution.items(), strict=False):
        part = values[order]
        start = np.where(part >= 0.0, positive, negative)
        axes.barh(place, part, left=start, color=colour, label=titles[name].split(":")[0], height=0.72)
        positive, negative = positive + np.maximum(part, 0.0), negative + np.minimum(part, 0.0)
    axes.plot(comparison.difference[order], place, "D", color=INK, markersize=5, label="network − elements")
    axes.set_yticks(place, [comparison.machine.node_names[i] for i in order])
    axes.axvline(0.0, color=MUTED, linewidth=0.8)
    axes.set_xlabel("contribution / K")
    figure.legend(loc="upper left", bbox_to_anchor=(0.04, 0.99), ncols=2)
    return figure


@styled
def speed_chart(rows: list[Mapping[str, float]]) -> Figure:
    """Largest node difference over speed."""
    figure = new_figure(620.0, 1100.0)
    axes = figure.add_axes((0.1, 0.14, 0.86, 0.74))
    speed = [row["speed_rpm"] for row in rows]
    for key, label, colour, style in (
        ("unmatched_max_K", "network as computed", CYCLE[1], "o--"),
        ("fixed_max_K", "matched, conductances of the matched speed", CYCLE[4], "o:"),
        ("matched_max_K", "matched, films follow the speed", CYCLE[0], "o-"),
    ):
        axes.plot(speed, [row[key] for row in rows], style, color=colour, label=label)
    axes.set(xlabel="speed / rpm", ylabel="largest difference to the elements / K", ylim=(0.0, None))
    # above the curves, which may be anywhere
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=2,
        handlelength=3.0,
        columnspacing=1.2,
        fontsize=7.5,
    )
    return figure


@styled
def convergence_chart(rows: list[Mapping[str, float]]) -> Figure:
    """Difference to the axisymmetric elements over refinement."""
    figure = new_figure(560.0, 1100.0)
    axes = figure.add_axes((0.11, 0.15, 0.85, 0.76))
    nodes = [row["nodes"] for row in rows]
    axes.loglog(nodes, [row["max_difference_K"] for row in rows], "o-", color=CYCLE[0])
    plain_decades(axes.xaxis)
    plain_decades(axes.yaxis)
    axes.set(xlabel="nodes of the network", ylabel="largest difference / K")
    return figure


def write_crosscheck_figures(folder: Path, found: Crosscheck) -> None:
    """Draw ``figures/*.png`` of a cross-check."""
    figures = {
        "difference": difference_map(found.comparison),
        "temperatures": temperature_map(found.comparison),
        "causes": causes_chart(found.comparison, found.study, CAUSES),
        "speeds": speed_chart(found.content["matched"]["speeds"]),
        "convergence": convergence_chart(found.content["convergence"]["rows"]),
    }
    place = folder / "figures"
    place.mkdir(exist_ok=True)
    for name, figure in figures.items():
        save_png(figure, place / f"{name}.png")
