"""Charts of a run: meridian section, profiles, heat, coolant."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from spindle_fem.definition.drawn_tables import element_rows
from spindle_fem.report.figure_style import (
    BALLS,
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
    set_title,
    styled,
)
from spindle_fem.report.meridian_axes import MM, draw_elements, meridian_axes
from spindle_fem.report.profiles import (
    MeridianSection,
    axial_profile,
    draw_field,
    largest_part,
    radial_profile,
)
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.units import ZERO_CELSIUS_K


@styled
def meridian_temperature(result: ThermalResult, section: MeridianSection, bar: ColourBar) -> Figure:
    """Temperature in the vertical plane through the axis with isotherms, in mm."""
    faces = section.faces
    z, height = faces.points[:, 2] * MM, faces.points[:, 1] * MM
    width_px, left, right, top, foot = 1600.0, 96.0, 24.0, 100.0, 190.0
    pad = 0.015 * np.ptp(z)
    scale = (width_px - left - right) / (np.ptp(z) + 2.0 * pad)
    drawing = (np.ptp(height) + 2.0 * pad) * scale
    figure = new_figure(top + drawing + foot, width_px)
    axes = meridian_axes(
        figure,
        (left, top, width_px - left - right, drawing),
        (z.min() - pad, z.max() + pad),
        (height.min() - pad, height.max() + pad),
        "radius / mm (θ = 0 up)",
    )
    step = _isotherm_step(bar.high - bar.low)
    isotherms = np.arange(math.ceil(bar.low / step) * step, bar.high, step)
    draw_field(axes, section, bar, isotherms, numbered=True)
    for group, bearing in result.spec.bearings:
        colour = bar.colours(result.bearings[bearing.name].temperature_ball - ZERO_CELSIUS_K)
        for row in element_rows(bearing, result.spec.bearing_types[group.type_name(bearing)]):
            draw_elements(axes, row, colour, linewidth=0.8)
    for probe in result.spec.probe:
        if probe.kind == "point" and abs(math.sin(probe.angle)) < 0.02:
            axes.plot(
                probe.z * MM,
                probe.r * math.cos(probe.angle) * MM,
                marker="o",
                markersize=4.5,
                markerfacecolor="white",
                markeredgecolor=INK,
                zorder=5,
            )
    axes.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    draw_colour_bar(pixel_axes(figure, 0.5 * width_px - 380.0, top + drawing + foot - 92.0, 760.0, 20.0), bar)
    set_title(
        figure,
        "Temperature in the vertical plane through the axis",
        f"White isotherms every {step:g} K, numbers in °C; probes in this plane as white dots.",
    )
    return figure


def _isotherm_step(span: float) -> float:
    rough = span / 16.0
    power = 10.0 ** math.floor(math.log10(rough))
    return next(factor * power for factor in (1.0, 2.0, 2.5, 5.0, 10.0) if factor * power >= rough)


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
        left=0.066, right=0.99, top=1.0 - 138.0 / height, bottom=100.0 / height, wspace=0.08, hspace=0.36
    )
    kinds = {"rotating": CYCLE[1], "standing": CYCLE[0]}
    for axes, (group, bearing) in zip(grid.flat, bearings, strict=False):
        kind = result.spec.bearing_types[group.type_name(bearing)]
        profile = radial_profile(section, 0.5 * sum(bearing.z))
        for name, (radius, temperature) in profile.items():
            colour = kinds["rotating" if result.mesh.rotating[name] else "standing"]
            axes.plot(radius * MM, temperature - ZERO_CELSIUS_K, color=colour, linewidth=2.0)
            axes.axvspan(
                np.nanmin(radius) * MM, np.nanmax(radius) * MM, color=colour, alpha=0.06, linewidth=0.0
            )
        state = result.bearings[bearing.name]
        reach = 0.25 * (kind.outer_ring_inner_diameter - kind.inner_ring_outer_diameter)
        centre = 0.25 * (kind.outer_ring_inner_diameter + kind.inner_ring_outer_diameter)
        balls = np.array([centre - reach, centre + reach]) * MM
        axes.plot(
            balls,
            [state.temperature_ball - ZERO_CELSIUS_K] * 2,
            color=BALLS,
            linewidth=4.0,
            solid_capstyle="butt",
        )
        axes.set_title(f"{bearing.name}, {state.heat:.0f} W")
        axes.set_xlabel(f"radius / mm  (z = {0.5 * sum(bearing.z) * MM:.1f})")
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
    _legend(figure, handles, ["rotating parts", result.spec.rolling_elements, "stationary parts"])
    set_title(
        figure,
        "Radial profiles through the bearings",
        "At θ = 0, middle of each bearing; steps are joints (seats) and rolling contacts, gaps are coolant.",
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
    """Temperature along the machine: shaft surface, housing bore and outside, raceways, balls or rollers."""
    figure = new_figure(740.0)
    axes = pixel_axes(figure, 112.0, 150.0, 1464.0, 500.0)
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
        handles += axes.plot(z * MM, temperature - ZERO_CELSIUS_K, color=colour)
        texts.append(text)
    for name, colour, text in (
        ("temperature_inner", INNER, "inner raceway"),
        ("temperature_ball", BALLS, result.spec.rolling_elements),
        ("temperature_outer", OUTER, "outer raceway"),
    ):
        if not result.bearings:
            break
        places = [0.5 * sum(bearing.z) * MM for _, bearing in result.spec.bearings]
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
        axes.axvspan(bearing.z[0] * MM, bearing.z[1] * MM, color="#eef1f4", linewidth=0.0, zorder=0)
        axes.annotate(
            bearing.name,
            (0.5 * sum(bearing.z) * MM, 1.0),
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
        handles.append(axes.axhline(inlet, color=CYCLE[5], linewidth=1.4, linestyle=(0, (1, 1.5))))
        texts.append("coolant inlet")
    axes.set_xlabel("z / mm")
    axes.set_ylabel(TEMPERATURE_LABEL)
    axes.margins(x=0.01)
    figure.legend(
        handles,
        texts,
        ncols=len(texts),
        loc="upper left",
        bbox_to_anchor=(0.006, 0.89),
        columnspacing=1.0,
        handlelength=1.7,
    )
    races = "; raceways and rolling elements as means of each bearing" if result.bearings else ""
    set_title(figure, "Axial profiles", f"Surfaces at θ = 180°{races}.")
    return figure
