"""Positions where heat would explain the residuals, drawn on the machine's half section."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.geometry.assembly import AssemblyGeometry, build_assembly
from spindle_fem.machine.view.meridian_places import regions_of
from spindle_fem.machine.view.place_names import NEAR, STANDARD_DISTANCE
from spindle_fem.report.figure_style import (
    FILM_MAP,
    INK,
    MUTED,
    ColourBar,
    draw_colour_bar,
    new_figure,
    pixel_axes,
    set_title,
    styled,
)
from spindle_fem.report.leader_labels import spread
from spindle_fem.report.meridian_axes import MM, box, draw_edges, extent, meridian_axes

if TYPE_CHECKING:
    import xarray as xr

# Drawn thickness of a wall, m.
WALL = 3.0e-3
PLAIN = "#e9ecef"
DOUBTED = "#c1121f"
BAR_LABEL = "evidence for heat missing here, in % of the best place's"


def explained_shares(data: xr.Dataset) -> dict[str, float]:
    """Evidence over nothing of every spot in per cent of the best spot's; 0 where it explains nothing."""
    evidence = data["spot_log_evidence"].values
    best = float(evidence.max())
    if best <= 0.0:
        return dict.fromkeys(map(str, data["spot"].values), 0.0)
    return {
        str(spot): 100.0 * max(float(value), 0.0) / best
        for spot, value in zip(data["spot"].values, evidence, strict=True)
    }


@styled
def located_on_machine(
    data: xr.Dataset,
    spec: MachineSpec,
    component: str,
    sensors: Sequence[str] = (),
    assembly: AssemblyGeometry | None = None,
) -> Figure | None:
    """Half section with its spots coloured by how well heat there explains the residual; None without spots.

    Parameters
    ----------
    data : Dataset
        As ``diagnosis.nc`` has it.
    component : str
        What is outlined: where the mismatch is; may be empty.
    sensors : sequence of str
        Probes whose readings the diagnosis doubts; their names are marked.
    """
    if "spot" not in data:
        return None
    notes = "Circles: about each probe. Grey: not asked."
    if component and regions_of(spec, component):
        notes += f" Orange frame: where the diagnosis puts it ({component.replace('_', ' ')})."
    if any(probe.kind == "point" and probe.name in sensors for probe in spec.probe):
        notes += " Red names: sensors that it doubts."
    figure = places_on_machine(
        explained_shares(data),
        ColourBar(FILM_MAP.reversed(), 0.0, 100.0, BAR_LABEL),
        spec,
        framed=component,
        doubted=sensors,
        assembly=assembly,
    )
    set_title(figure, "Where missing heat would explain the readings", notes)
    return figure


@styled
def places_on_machine(
    values: Mapping[str, float],
    bar: ColourBar,
    spec: MachineSpec,
    *,
    framed: str = "",
    doubted: Sequence[str] = (),
    assembly: AssemblyGeometry | None = None,
) -> Figure:
    """Half section with places coloured by a value each, and the names of the probes; without a title.

    Parameters
    ----------
    values : mapping of str to float
        By place, as :func:`regions_of` takes it.
    framed : str
        Component that is outlined.
    doubted : sequence of str
        Probes whose names are red.
    """
    assembly = build_assembly(spec) if assembly is None else assembly
    z_low, z_high, outside = extent(assembly)
    reach = 1.06 * outside
    pad = 0.03 * (z_high - z_low)
    left, width = 100.0, 1470.0
    scale = width / (z_high - z_low + 2.0 * pad)
    top, height = 190.0, (reach + 4.0) * scale
    total = top + height + 220.0
    figure = new_figure(total)
    axes = meridian_axes(figure, (left, top, width, height), (z_low - pad, z_high + pad), (-4.0, reach))
    for segment in (segment for part in assembly.parts for segment in part.segments):
        z, radius = (segment.z_start, segment.z_end), (segment.inner_radius, segment.outer_radius)
        axes.add_patch(box(z, radius, facecolor=PLAIN, edgecolor="none"))
    # Large spots first: what lies within them is drawn on top.
    areas = {
        spot: (regions_of(spec, spot), share) for spot, share in values.items() if not spot.startswith(NEAR)
    }
    for regions, share in sorted(areas.values(), key=lambda item: -sum(r.volume for r in item[0])):
        for region in regions:
            inner, outer = region.r
            thick = (inner, max(outer, inner + WALL))
            axes.add_patch(box(region.z, thick, facecolor=bar.colours(share), edgecolor="none"))
    draw_edges(axes, assembly, (1.0,), (0.5, 0.9))
    for spot, share in values.items():
        for region in regions_of(spec, spot) if spot.startswith(NEAR) else ():
            radius, place = region.middle
            axes.add_patch(
                Circle(
                    (place * MM, radius * MM),
                    0.35 * STANDARD_DISTANCE * MM,
                    facecolor=bar.colours(share),
                    edgecolor=INK,
                    linewidth=0.7,
                    zorder=5,
                )
            )
    for region in regions_of(spec, framed) if framed else ():
        axes.add_patch(
            Rectangle(
                (region.z[0] * MM - 1.5, region.r[0] * MM - 1.5),
                (region.z[1] - region.z[0]) * MM + 3.0,
                (region.r[1] - region.r[0]) * MM + 3.0,
                facecolor="none",
                edgecolor="#D55E00",
                linewidth=2.6,
                zorder=6,
            )
        )
    axes.axhline(0.0, color=MUTED, linewidth=0.9, dashes=(12, 3, 2, 3))
    _label_probes(axes, spec, (reach, scale), doubted)
    draw_colour_bar(pixel_axes(figure, 420.0, total - 92.0, 760.0, 20.0), bar)
    return figure


def _label_probes(axes: Axes, spec: MachineSpec, height: tuple[float, float], doubted: Sequence[str]) -> None:
    """Names of point probes above the section, with leaders; ``height``: largest radius, px a mm."""
    reach, scale = height
    probes = [probe for probe in spec.probe if probe.kind == "point"]
    if not probes:
        return
    low, high = axes.get_xlim()
    centres = spread(
        [probe.z * MM for probe in probes],
        [(12.5 * len(probe.name) + 20.0) / scale for probe in probes],
        low,
        high,
    )
    for probe, centre in zip(probes, centres, strict=True):
        at = (probe.z * MM, probe.r * MM)
        lift = reach + 26.0 / scale
        axes.plot([at[0], centre], [at[1], lift], color=INK, linewidth=0.7, clip_on=False, zorder=6)
        axes.plot(*at, marker="o", markersize=3.6, markerfacecolor="white", markeredgecolor=INK, zorder=7)
        colour = DOUBTED if probe.name in doubted else INK
        name = axes.text(centre, lift + 4.0 / scale, probe.name, ha="center", va="bottom", fontsize=9.0)
        name.set(color=colour, fontweight="bold" if probe.name in doubted else "normal")


@styled
def located_on_network(data: xr.Dataset) -> Figure | None:
    """Nodes by how well heat there explains the residual; None without spots."""
    if "spot" not in data:
        return None
    shares = sorted(explained_shares(data).items(), key=lambda item: -item[1])
    figure = new_figure(110.0 + 44.0 * len(shares) + 90.0)
    left = 60.0 + 11.0 * max(len(name) for name, _ in shares)
    axes = pixel_axes(figure, left, 100.0, 1540.0 - left, 44.0 * len(shares))
    bar = ColourBar(FILM_MAP.reversed(), 0.0, 100.0, BAR_LABEL)
    axes.barh(
        range(len(shares)), [share for _, share in shares], color=[bar.colours(share) for _, share in shares]
    )
    axes.set_yticks(range(len(shares)), [name.replace("_", " ") for name, _ in shares])
    axes.set(ylim=(len(shares) - 0.5, -0.5), xlim=(0.0, 100.0), xlabel=BAR_LABEL)
    axes.grid(axis="y", visible=False)
    set_title(figure, "Where missing heat would explain the readings", "Each node alone.")
    return figure
