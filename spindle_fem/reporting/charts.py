"""Charts of a run: meridian section, profiles, heat, coolant."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, PathPatch, Rectangle
from matplotlib.path import Path
from matplotlib.tri import Triangulation

from spindle_fem.reporting.figures import (
    BALLS,
    BODY_COLOURS,
    BODY_NAMES,
    CYCLE,
    DPI,
    INK,
    INNER,
    MUTED,
    OUTER,
    TEMPERATURE_LABEL,
    ColourBar,
    draw_colour_bar,
    new_figure,
    pixel_axes,
    spread,
    styled,
)
from spindle_fem.reporting.profiles import MeridianSection, axial_profile, largest_part, radial_profile
from spindle_fem.reporting.tables import heat_by_source, readable
from spindle_fem.results.thermal_result import CoolantResult, EnergyBalance, ThermalResult
from spindle_fem.units import ZERO_CELSIUS_K

_MM = 1.0e3


@styled
def meridian_temperature(result: ThermalResult, section: MeridianSection, bar: ColourBar) -> Figure:
    """Temperature in the vertical plane through the axis with isotherms, in mm."""
    faces = section.faces
    z, height = faces.points[:, 2] * _MM, faces.points[:, 1] * _MM
    width_px, left, right, top, foot = 1600.0, 96.0, 24.0, 100.0, 190.0
    pad = 0.015 * np.ptp(z)
    scale = (width_px - left - right) / (np.ptp(z) + 2.0 * pad)
    drawing = (np.ptp(height) + 2.0 * pad) * scale
    figure = new_figure(top + drawing + foot, width_px)
    axes = pixel_axes(figure, left, top, width_px - left - right, drawing)
    axes.set(
        xlim=(z.min() - pad, z.max() + pad), ylim=(height.min() - pad, height.max() + pad), aspect="equal"
    )
    axes.grid(False)
    triangulation = Triangulation(z, height, faces.triangles)
    celsius = faces.values[:, 0] - ZERO_CELSIUS_K
    axes.tripcolor(
        triangulation, celsius, cmap=bar.colour_map, norm=bar.norm, shading="gouraud", rasterized=True
    )
    step = _isotherm_step(bar.high - bar.low)
    levels = np.arange(math.ceil(bar.low / step) * step, bar.high, step)
    if levels.size:
        axes.tricontour(triangulation, celsius, levels=levels, colors="white", linewidths=0.55, alpha=0.8)
    lines = section.outlines.points[..., [2, 1]] * _MM
    axes.add_collection(LineCollection(lines, colors=INK, linewidths=0.8))
    for group, bearing in result.spec.bearings:
        kind = result.spec.bearing_types[group.bearing_type]
        colour = bar.colours(result.bearings[bearing.name].temperature_ball - ZERO_CELSIUS_K)
        for sign in (1.0, -1.0):
            axes.add_patch(
                Circle(
                    (0.5 * sum(bearing.z) * _MM, sign * 0.5 * kind.pitch * _MM),
                    0.5 * kind.ball_diameter * _MM,
                    facecolor=colour,
                    edgecolor=INK,
                    linewidth=0.8,
                    zorder=4,
                )
            )
    for probe in result.spec.probe:
        if probe.kind == "point" and abs(math.sin(probe.angle)) < 0.02:
            axes.plot(
                probe.z * _MM,
                probe.r * math.cos(probe.angle) * _MM,
                marker="o",
                markersize=4.5,
                markerfacecolor="white",
                markeredgecolor=INK,
                zorder=5,
            )
    axes.set_xlabel("z / mm")
    axes.set_ylabel("radius / mm (θ = 0 up)")
    axes.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    draw_colour_bar(pixel_axes(figure, 0.5 * width_px - 380.0, top + drawing + foot - 92.0, 760.0, 20.0), bar)
    _title(
        figure,
        "Temperature in the vertical plane through the axis",
        f"White isotherms every {step:g} K; probes in this plane as white dots.",
    )
    return figure


def _isotherm_step(span: float) -> float:
    rough = span / 16.0
    power = 10.0 ** math.floor(math.log10(rough))
    return next(factor * power for factor in (1.0, 2.0, 2.5, 5.0, 10.0) if factor * power >= rough)


def _title(figure: Figure, title: str, notes: str = "") -> None:
    width, height = figure.get_size_inches() * DPI
    figure.text(24.0 / width, 1.0 - 34.0 / height, title, fontsize=12.5, fontweight="bold", va="center")
    if notes:
        figure.text(24.0 / width, 1.0 - 66.0 / height, notes, fontsize=9.0, color=MUTED, va="center")


@styled
def radial_profiles(result: ThermalResult, section: MeridianSection) -> Figure | None:
    """Temperature from bore to outside through the middle of each bearing; None without bearings."""
    bearings = result.spec.bearings
    if not bearings:
        return None
    columns = len(bearings) if len(bearings) <= 6 else 4
    rows = math.ceil(len(bearings) / columns)
    figure = new_figure(100.0 + 400.0 * rows + 80.0)
    grid = figure.subplots(rows, columns, sharey=True, squeeze=False)
    height = 100.0 + 400.0 * rows + 80.0
    figure.subplots_adjust(
        left=0.055, right=0.99, top=1.0 - 138.0 / height, bottom=100.0 / height, wspace=0.08, hspace=0.36
    )
    kinds = {"rotating": CYCLE[1], "standing": CYCLE[0]}
    for axes, (group, bearing) in zip(grid.flat, bearings, strict=False):
        kind = result.spec.bearing_types[group.bearing_type]
        profile = radial_profile(section, 0.5 * sum(bearing.z))
        for name, (radius, temperature) in profile.items():
            colour = kinds["rotating" if result.mesh.rotating[name] else "standing"]
            axes.plot(radius * _MM, temperature - ZERO_CELSIUS_K, color=colour, linewidth=2.0)
            axes.axvspan(
                np.nanmin(radius) * _MM, np.nanmax(radius) * _MM, color=colour, alpha=0.06, linewidth=0.0
            )
        state = result.bearings[bearing.name]
        reach = 0.25 * (kind.outer_ring_inner_diameter - kind.inner_ring_outer_diameter)
        centre = 0.25 * (kind.outer_ring_inner_diameter + kind.inner_ring_outer_diameter)
        balls = np.array([centre - reach, centre + reach]) * _MM
        axes.plot(
            balls,
            [state.temperature_ball - ZERO_CELSIUS_K] * 2,
            color=BALLS,
            linewidth=4.0,
            solid_capstyle="butt",
        )
        axes.set_title(f"{bearing.name}, {state.heat:.0f} W")
        axes.set_xlabel(f"radius / mm  (z = {0.5 * sum(bearing.z) * _MM:.1f})")
        axes.tick_params(labelbottom=True)
    for axes in list(grid.flat)[len(bearings) :]:
        axes.axis("off")
    for row in grid:
        row[0].set_ylabel(TEMPERATURE_LABEL)
    handles = [
        Rectangle((0, 0), 1, 1, color=kinds["rotating"]),
        Rectangle((0, 0), 1, 1, color=BALLS),
        Rectangle((0, 0), 1, 1, color=kinds["standing"]),
    ]
    _legend(figure, handles, ["turning parts", "balls", "standing parts"])
    _title(
        figure,
        "Radial profiles through the bearings",
        "At θ = 0, middle of each bearing; steps are joints (seats) and the ball contacts, gaps are oil.",
    )
    return figure


def _legend(figure: Figure, handles: list[object], texts: list[str]) -> None:
    height = figure.get_size_inches()[1] * DPI
    figure.legend(
        handles,
        texts,
        ncols=len(texts),
        loc="upper right",
        bbox_to_anchor=(0.99, 1.0 - 14.0 / height),
        handlelength=1.4,
        columnspacing=1.6,
        borderaxespad=0.0,
    )


@styled
def axial_profiles(result: ThermalResult, section: MeridianSection) -> Figure:
    """Temperature along the machine: shaft surface, housing bore and outside, raceways and balls."""
    figure = new_figure(740.0)
    axes = pixel_axes(figure, 96.0, 150.0, 1480.0, 500.0)
    mesh = result.mesh
    shaft = largest_part(mesh.cad_volume, mesh.rotating, turning=True)
    housing = largest_part(mesh.cad_volume, mesh.rotating, turning=False)
    lines = []
    if shaft is not None:
        lines.append((shaft, "outer", f"{shaft}, surface", CYCLE[1]))
    if housing is not None:
        lines += [
            (housing, "inner", f"{housing}, bore", CYCLE[0]),
            (housing, "outer", f"{housing}, outside", CYCLE[2]),
        ]
    handles, texts = [], []
    for part, side, text, colour in lines:
        z, temperature = axial_profile(section, part, side)
        handles += axes.plot(z * _MM, temperature - ZERO_CELSIUS_K, color=colour)
        texts.append(text)
    for name, colour, text in (
        ("temperature_inner", INNER, "inner raceway"),
        ("temperature_ball", BALLS, "balls"),
        ("temperature_outer", OUTER, "outer raceway"),
    ):
        if not result.bearings:
            break
        places = [0.5 * sum(bearing.z) * _MM for _, bearing in result.spec.bearings]
        values = [
            getattr(result.bearings[bearing.name], name) - ZERO_CELSIUS_K
            for _, bearing in result.spec.bearings
        ]
        handles += axes.plot(
            places,
            values,
            linestyle="none",
            marker="o",
            markersize=6.5,
            color=colour,
            markeredgecolor="white",
        )
        texts.append(text)
    for _, bearing in result.spec.bearings:
        axes.axvspan(bearing.z[0] * _MM, bearing.z[1] * _MM, color="#eef1f4", linewidth=0.0, zorder=0)
        axes.annotate(
            bearing.name,
            (0.5 * sum(bearing.z) * _MM, 1.0),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="bottom",
            fontsize=8.5,
            color=MUTED,
        )
    ambient = result.spec.operation.ambient_temperature - ZERO_CELSIUS_K
    handles.append(axes.axhline(ambient, color=MUTED, linewidth=1.0, linestyle=(0, (4, 3))))
    texts.append("ambient")
    if result.coolant is not None:
        inlet = result.coolant.inlet_temperature - ZERO_CELSIUS_K
        handles.append(axes.axhline(inlet, color=CYCLE[5], linewidth=1.0, linestyle=(0, (4, 3))))
        texts.append("oil inlet")
    axes.set_xlabel("z / mm")
    axes.set_ylabel(TEMPERATURE_LABEL)
    axes.margins(x=0.01)
    figure.legend(
        handles,
        texts,
        ncols=len(texts),
        loc="upper left",
        bbox_to_anchor=(0.012, 0.89),
        columnspacing=1.4,
        handlelength=1.6,
    )
    _title(figure, "Axial profiles", "Surfaces at θ = 180°; raceways and balls as means of each bearing.")
    return figure


@styled
def heat_balance(energy: EnergyBalance, bearings: Iterable[str] = ()) -> Figure:
    """Where heat comes from and where it goes, widths in proportion to W; bearings as wholes."""
    sources = {
        name: value for name, value in heat_by_source(energy.heat_in_by, bearings).items() if value > 0.0
    }
    sources |= {f"{name} (gains)": -value for name, value in energy.heat_out.items() if value < 0.0}
    sinks = {name: value for name, value in energy.heat_out.items() if value > 0.0}
    sources = dict(sorted(sources.items(), key=lambda item: -item[1]))
    sinks = dict(sorted(sinks.items(), key=lambda item: -item[1]))
    figure = new_figure(632.0)
    axes = pixel_axes(figure, 24.0, 100.0, 1552.0, 520.0)
    axes.axis("off")
    axes.set(xlim=(0.0, 1552.0), ylim=(520.0, 0.0))
    total = max(sum(sources.values()), sum(sinks.values()))
    _title(
        figure,
        "Where the heat comes from and where it goes",
        f"{energy.heat_in:.1f} W put in; imbalance {energy.imbalance_relative:.1e} of it.",
    )
    if total <= 0.0:
        axes.text(776.0, 260.0, "No heat flows.", ha="center", va="center")
        return figure
    body = 410.0
    _bands(axes, sources, body, total, left=True)
    _bands(axes, sinks, body, total, left=False)
    top = 0.5 * (520.0 - body)
    axes.add_patch(
        Rectangle(
            (710.0, top), 132.0, body * sum(sources.values()) / total, facecolor="#c9d2da", linewidth=0.0
        )
    )
    axes.text(
        776.0,
        top + 0.5 * body,
        f"machine\n{sum(sources.values()):.0f} W",
        ha="center",
        va="center",
        fontweight="bold",
    )
    return figure


def _bands(axes: Axes, flows: Mapping[str, float], body: float, total: float, *, left: bool) -> None:
    if not flows:
        return
    heights = np.array(list(flows.values())) / total * body
    top = 0.5 * (520.0 - body)
    at_body = top + np.cumsum(heights) - 0.5 * heights
    at_end = spread(at_body, np.maximum(heights + 8.0, 32.0), 0.0, 520.0)
    near, far = (710.0, 480.0) if left else (842.0, 1072.0)
    middle = 0.5 * (near + far)
    palette = (CYCLE[1], CYCLE[4]) if left else (CYCLE[0], CYCLE[5])
    for number, (name, value) in enumerate(flows.items()):
        half = 0.5 * heights[number]
        start, end = at_body[number], at_end[number]
        vertices = [
            (near, start - half),
            (middle, start - half),
            (middle, end - half),
            (far, end - half),
            (far, end + half),
            (middle, end + half),
            (middle, start + half),
            (near, start + half),
            (near, start - half),
        ]
        codes = [
            Path.MOVETO,
            Path.CURVE4,
            Path.CURVE4,
            Path.CURVE4,
            Path.LINETO,
            Path.CURVE4,
            Path.CURVE4,
            Path.CURVE4,
            Path.CLOSEPOLY,
        ]
        axes.add_patch(
            PathPatch(Path(vertices, codes), facecolor=palette[number % 2], alpha=0.72, linewidth=0.0)
        )
        text = f"{readable(name)}   {value:.1f} W ({100.0 * value / total:.1f} %)"
        axes.text(
            far + (-14.0 if left else 14.0),
            end,
            text,
            ha="right" if left else "left",
            va="center",
            fontsize=9.2,
        )


@styled
def heat_by_bearing(result: ThermalResult) -> Figure | None:
    """Heat term by term, and where it enters, for each bearing; None without bearings."""
    if not result.bearings:
        return None
    names = list(result.bearings)
    panels = (
        ("Friction heat term by term", _large_terms([result.bearings[name].terms for name in names]), None),
        ("Where it enters", [dict(result.bearings[name].heat_to) for name in names], BODY_COLOURS),
    )
    limit = 1.2 * max(max(sum(item.values()) for item in panel[1]) for panel in panels)
    legend_rows = max(math.ceil(len({key for row in panel[1] for key in row}) / 4) for panel in panels)
    top = 128.0 + 28.0 * legend_rows
    height = top + 60.0 * len(names) + 80.0
    figure = new_figure(height)
    for number, (title, rows, colours) in enumerate(panels):
        axes = pixel_axes(figure, 70.0 + 784.0 * number, top, 730.0, 60.0 * len(names))
        keys = list(dict.fromkeys(key for row in rows for key in row))
        left = np.zeros(len(names))
        for index, key in enumerate(keys):
            values = np.array([row.get(key, 0.0) for row in rows])
            colour = CYCLE[index % len(CYCLE)] if colours is None else colours[key]
            axes.barh(
                names,
                values,
                left=left,
                color=colour,
                height=0.62,
                label=BODY_NAMES.get(key, key.replace("_", " ")),
            )
            for row, value in enumerate(values):
                if value > 0.07 * limit:
                    axes.text(
                        left[row] + 0.5 * value,
                        row,
                        f"{value:.0f}",
                        ha="center",
                        va="center",
                        color="white",
                        fontsize=8.5,
                    )
            left += values
        for row, value in enumerate(left):
            axes.text(value + 0.012 * limit, row, f"{value:.1f} W", va="center", fontsize=8.8)
        axes.invert_yaxis()
        axes.set(xlim=(0.0, max(limit, 1.0e-9)), xlabel="heat / W")
        axes.grid(axis="y", visible=False)
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(-0.01, 1.0),
            ncols=4,
            handlelength=1.0,
            columnspacing=1.2,
            borderaxespad=0.1,
        )
        place = 1.0 - (top - 28.0 * legend_rows - 26.0) / height
        figure.text(
            (70.0 + 784.0 * number) / 1600.0, place, title, fontsize=10.5, fontweight="bold", va="center"
        )
    _title(figure, "Heat of the bearings")
    return figure


def _large_terms(rows: list[Mapping[str, float]], share: float = 0.03) -> list[dict[str, float]]:
    """Terms above a share of the largest heat; the small ones together as "other"."""
    total = max((sum(row.values()) for row in rows), default=0.0)
    keys = list(dict.fromkeys(key for row in rows for key in row))
    large = [key for key in keys if max(row.get(key, 0.0) for row in rows) > share * total]
    merged = []
    for row in rows:
        kept = {key: row.get(key, 0.0) for key in large}
        rest = sum(row.values()) - sum(kept.values())
        if len(large) < len(keys):
            kept["other"] = rest
        merged.append(kept)
    if merged and all(row.get("other", 1.0) == 0.0 for row in merged):
        merged = [{key: value for key, value in row.items() if key != "other"} for row in merged]
    return merged


@styled
def coolant_along_channel(coolant: CoolantResult, *, ports: bool = False) -> Figure:
    """Oil and wall temperature, and the film coefficient with its range, along the channel.

    Parameters
    ----------
    coolant : CoolantResult
    ports : bool
        Whether the first and the last cell are the drilled ports: another
        section with another film, so they are told in words.
    """
    figure = new_figure(620.0)
    order = np.argsort(coolant.position, kind="stable")
    place = coolant.position[order]
    turns = coolant.angle[order] / (2.0 * math.pi)
    left = pixel_axes(figure, 90.0, 130.0, 680.0, 400.0)
    left.plot(place, coolant.wall_temperature[order] - ZERO_CELSIUS_K, color=CYCLE[1], label="wall")
    left.plot(place, coolant.bulk_temperature[order] - ZERO_CELSIUS_K, color=CYCLE[0], label="oil (bulk)")
    left.set(xlabel="length along the channel / m", ylabel=TEMPERATURE_LABEL, title="Oil and wall")
    left.legend(loc="best")
    right = pixel_axes(figure, 890.0, 130.0, 680.0, 400.0)
    inside = np.ones(place.size, dtype=bool)
    if ports and place.size > 2:
        inside = (place > place.min()) & (place < place.max())
    along = place[inside]
    film, low, high = (
        item[order][inside] for item in (coolant.film_coefficient, coolant.film_low, coolant.film_high)
    )
    right.fill_between(along, low, high, color=CYCLE[2], alpha=0.2, linewidth=0.0, label="low to high")
    right.plot(along, film, color=CYCLE[2], label="value")
    right.axhline(
        coolant.mean_film_coefficient,
        color=INK,
        linewidth=0.9,
        linestyle=(0, (4, 3)),
        label="mean with ports" if ports else "mean",
    )
    right.set(
        xlabel="length along the channel / m", ylabel="film coefficient / W/(m²·K)", title="Film coefficient"
    )
    right.set_ylim(0.0, 1.3 * high.max())
    right.legend(loc="upper right", ncols=3, columnspacing=1.2)
    notes = "Dotted lines: full turns."
    if ports and place.size > 2:
        ends = coolant.film_coefficient[order][~inside]
        notes += f" Ports: {ends.min():.0f} to {ends.max():.0f} W/(m²·K)."
    for axes in (left, right):
        axes.margins(x=0.01)
        for turn in range(1, math.floor(turns.max()) + 1):
            axes.axvline(np.interp(turn, turns, place), color="#cfd6dc", linewidth=0.8, linestyle=":")
    _title(figure, "Oil along the helical channel", notes)
    return figure
