"""Drawing of a machine definition in the meridian plane: parts, bearings, channel, probes, films."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import hsv_to_rgb, to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spindle_fem.definition.drawn_tables import element_rows
from spindle_fem.definition.machine_spec import Channel, MachineSpec, Probe
from spindle_fem.machine.geometry.assembly import AssemblyGeometry, build_assembly
from spindle_fem.report.drawn_equipment import (
    draw_sensors,
    draw_sources,
    draw_streams,
    heat_swatch,
    sensor_spot,
    source_legend,
)
from spindle_fem.report.figure_style import CYCLE, INK, MUTED, new_figure, set_title, styled
from spindle_fem.report.leader_labels import Label, draw_labels
from spindle_fem.report.meridian_axes import MM, box, draw_edges, draw_elements, extent, meridian_axes
from spindle_fem.units import ZERO_CELSIUS_K

_BY_NAME = (
    ("inner_ring", "#8fbf8b"),
    ("outer_ring", "#7fa8d1"),
    ("spacer", "#c8b1d8"),
    ("shaft", "#b9c4cf"),
    ("housing", "#e6d7b8"),
    ("cover", "#e0b98a"),
    ("flange", "#d8c9a6"),
)
_OTHERS = (
    "#d9a7a0",
    "#a9d4cf",
    "#e3c1d7",
    "#c7cf9b",
    "#c9a27e",
    "#9fb3d9",
    "#efe3a0",
    "#a3a3a3",
    "#b08fb5",
    "#7fb0a8",
)
BALL_COLOUR = "#f2f2f2"
_NUMBER_SIZE = 8.5
# Letters of an entry of the legend that fit half the width.
_MOST_LETTERS = 62
# Room of "z / mm" at the end of the scale, and from the drawing to its labels and to the scale beneath them.
_UNIT_WIDTH_PX, _LABEL_DROP_PX, _SCALE_DROP_PX = 90.0, 34.0, 96.0
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
COOLANT_COLOUR = "#f0c419"


def part_colours(names: Sequence[str]) -> tuple[str, ...]:
    """Fill colours of parts: by the kind in the name, else in turn.

    >>> part_colours(["shaft", "F1.inner_ring", "sleeve"])
    ('#b9c4cf', '#8fbf8b', '#d9a7a0')
    """
    colours, others = [], 0
    for name in names:
        known = next((colour for text, colour in _BY_NAME if text in name), None)
        if known is None:
            known = _OTHERS[others % len(_OTHERS)]
            others += 1
        colours.append(known)
    return tuple(colours)


@styled
def machine_drawing(spec: MachineSpec, assembly: AssemblyGeometry | None = None) -> Figure:
    """Meridian section of the definition, θ = 0 above and θ = 180° below the axis, in mm.

    Parameters
    ----------
    assembly : AssemblyGeometry, optional
        Made from ``spec`` when left out.
    """
    assembly = build_assembly(spec) if assembly is None else assembly
    z_low, z_high, reach = extent(assembly)
    margin, width_px = 24.0, 1600.0
    z_margin = 0.05 * (z_high - z_low)
    scale = (width_px - 2.0 * margin - 70.0) / (z_high - z_low + 2.0 * z_margin)
    legend = _film_legend(spec)
    heated = source_legend(spec)
    columns = 1 if max(map(len, [*heated, *(text for _, text in legend)]), default=0) > _MOST_LETTERS else 2
    rows = math.ceil((len(legend) + len(heated)) / columns)
    drawing_height = 2.0 * reach * 1.03 * scale
    top, foot = 154.0, 138.0 + 30.0 * rows + 24.0
    figure = new_figure(top + drawing_height + foot, width_px)
    place = (margin + 70.0, top, width_px - 2.0 * margin - 70.0, drawing_height)
    limit = 1.03 * reach
    axes = meridian_axes(figure, place, (z_low - z_margin, z_high + z_margin), (-limit, limit))
    axes.set_xlabel("")
    axes.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
    axes.tick_params(axis="both", labelsize=_NUMBER_SIZE, labelbottom=False)
    axes.tick_params(axis="x", length=0.0)
    for spine in ("left", "bottom"):
        axes.spines[spine].set_visible(False)
    draw_streams(axes, spec, _film_colours(spec))
    _draw_parts(axes, assembly)
    draw_sources(axes, spec, assembly)
    _draw_channel(axes, spec)
    _draw_bearings(axes, spec)
    _draw_films(axes, spec, assembly)
    draw_sensors(axes, spec, assembly)
    axes.plot(
        [z_low - 0.6 * z_margin, z_high + 0.6 * z_margin],
        [0.0, 0.0],
        color=MUTED,
        linewidth=0.9,
        dashes=(12, 3, 2, 3),
    )
    head = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    total = top + drawing_height + foot
    head.set(xlim=(0.0, width_px), ylim=(total, 0.0))
    head.axis("off")
    head.patch.set_alpha(0.0)
    set_title(figure, spec.title or spec.name, _operating_point(spec))

    def pixels(z: float, radius: float) -> tuple[float, float]:
        left = margin + 70.0
        return left + (z - z_low + z_margin) * scale, top + (1.03 * reach - radius) * scale

    ends = (margin, width_px - margin)
    for labels, edge, sign in (
        (_above(spec, assembly), top - 18.0, -1.0),
        (_below(spec, assembly), top + drawing_height + _LABEL_DROP_PX, 1.0),
    ):
        draw_labels(head, labels, [pixels(*label.at) for label in labels], edge, sign, ends)
    _draw_scale(head, axes, lambda z: pixels(z, -1.03 * reach), ends[1])
    for number, (colour, text) in enumerate([*legend, *((None, text) for text in heated)]):
        column, row = divmod(number, max(rows, 1))
        x, y = margin + 10.0 + column * 0.5 * width_px, total - 24.0 - 30.0 * (rows - 1 - row)
        if colour is None:
            head.add_patch(heat_swatch(x, y))
        else:
            head.add_line(Line2D([x, x + 44.0], [y, y], color=colour, linewidth=3.6))
        head.text(x + 56.0, y, text, fontsize=8.8, va="center")
    return figure


def _draw_scale(head: Axes, axes: Axes, pixels: Callable[[float], tuple[float, float]], right: float) -> None:
    """Numbers along the axis and what they are, beneath the labels so that no leader crosses them."""
    low, high = axes.get_xlim()
    texts = [(*pixels(z), f"{z:g}", "center") for z in axes.get_xticks() if low <= z <= high]
    y = texts[0][1] + _SCALE_DROP_PX
    texts = [item for item in texts if item[0] < right - _UNIT_WIDTH_PX]
    for x, *_ in texts:
        head.add_line(Line2D([x, x], [y, y + 8.0], color=MUTED, linewidth=0.8))
    for x, _, text, side in [*texts, (right, y, "z / mm", "right")]:
        head.text(
            x,
            y + 12.0,
            text,
            fontsize=_NUMBER_SIZE,
            ha=side,
            va="top",
        )


def _operating_point(spec: MachineSpec) -> str:
    operation = spec.operation
    text = (
        f"{operation.speed * 30.0 / math.pi:.0f} rpm, thrust {operation.thrust:.0f} N, "
        f"ambient {operation.ambient_temperature - ZERO_CELSIUS_K:.1f} °C"
    )
    if spec.coolant is not None:
        text += (
            f", coolant {spec.coolant.flow * 6.0e4:.3g} L/min at "
            f"{spec.coolant.inlet_temperature - ZERO_CELSIUS_K:.1f} °C"
        )
    return text + ". Section through the axis: top θ = 0, bottom θ = 180°."


def _draw_parts(axes: Axes, assembly: AssemblyGeometry) -> None:
    colours = dict(zip(assembly.part_names, part_colours(assembly.part_names), strict=True))
    for part in assembly.parts:
        for segment in part.segments:
            z, radius = (segment.z_start, segment.z_end), (segment.inner_radius, segment.outer_radius)
            for sign in (1.0, -1.0):
                axes.add_patch(box(z, radius, sign, facecolor=colours[part.name], edgecolor="none"))
    draw_edges(axes, assembly, (1.0, -1.0), (0.7, 1.1), solid_capstyle="round")


def channel_sections(channel: Channel, theta: float) -> list[float]:
    """Axial places, m, at which the centre line of the channel passes the angle ``theta`` (rad).

    >>> from spindle_fem.definition.machine_spec import Channel
    >>> channel = Channel(part="housing", inner_radius="108 mm", depth="10 mm", width="12 mm", pitch="24 mm",
    ...                   turns=2, z_start="48 mm")
    >>> [round(1e3 * z) for z in channel_sections(channel, 0.0)]
    [48, 72, 96]
    """
    sign = 1.0 if channel.hand == "right" else -1.0
    total = 2.0 * math.pi * channel.turns
    places = []
    for start in range(channel.starts):
        angle = (sign * theta - 2.0 * math.pi * start / channel.starts) % (2.0 * math.pi)
        if angle > 2.0 * math.pi - 1.0e-9:
            angle = 0.0
        while angle <= total + 1.0e-9:
            places.append(channel.z_start + channel.pitch * angle / (2.0 * math.pi))
            angle += 2.0 * math.pi
    return sorted(places)


def _draw_channel(axes: Axes, spec: MachineSpec) -> None:
    channel = spec.channel
    if channel is None:
        return
    inner, outer = channel.inner_radius, channel.inner_radius + channel.depth
    style = {"facecolor": COOLANT_COLOUR, "edgecolor": INK, "linewidth": 0.8}
    for theta, sign in ((0.0, 1.0), (math.pi, -1.0)):
        for z in channel_sections(channel, theta):
            sides = (z - 0.5 * channel.width, z + 0.5 * channel.width)
            axes.add_patch(box(sides, (inner, outer), sign, **style))
    for z, sign in _ports_in_plane(spec):
        reach = _outside_radius(spec, z)
        sides = (z - 0.5 * channel.ports.diameter, z + 0.5 * channel.ports.diameter)
        axes.add_patch(box(sides, (inner + 0.5 * channel.depth, reach), sign, **style))


def _ports_in_plane(spec: MachineSpec) -> list[tuple[float, float]]:
    channel = spec.channel
    if channel is None or channel.ports is None:
        return []
    hand = 1.0 if channel.hand == "right" else -1.0
    found = []
    for start in range(channel.starts):
        for turns in (0.0, channel.turns):
            theta = hand * 2.0 * math.pi * (turns + start / channel.starts)
            if abs(math.sin(theta)) < 1.0e-6:
                place = channel.z_start + channel.pitch * turns
                found.append((place, math.copysign(1.0, math.cos(theta))))
    return found


def _outside_radius(spec: MachineSpec, z: float) -> float:
    radii = [
        0.5 * segment.outer_diameter
        for part in spec.part
        if part.name == spec.channel.part
        for segment in part.segment
        if segment.z[0] <= z <= segment.z[1]
    ]
    return max(radii, default=spec.channel.inner_radius + spec.channel.depth)


def _draw_bearings(axes: Axes, spec: MachineSpec) -> None:
    for group, bearing in spec.bearings:
        kind = spec.bearing_types[group.type_name(bearing)]
        for row in element_rows(bearing, kind):
            draw_elements(axes, row, BALL_COLOUR, linewidth=1.0)
        if bearing.takes_thrust is None:
            continue
        z = 0.5 * sum(bearing.z) * MM
        radius = 0.5 * kind.pitch * MM
        lean = 1.0 if bearing.takes_thrust == "towards_rear" else -1.0
        reach = 0.62 * (kind.outer_diameter - kind.bore_diameter) * MM
        step = np.array([lean * math.sin(kind.contact_angle), math.cos(kind.contact_angle)])
        for sign in (1.0, -1.0):
            line = np.array([z, radius])[:, None] + 0.5 * reach * step[:, None] * np.array([-1.0, 1.0])
            axes.plot(line[0], sign * line[1], color="#b00020", linewidth=0.9, zorder=5)


def film_colour(number: int) -> str:
    """Colour of a film by its number: none comes twice.

    >>> film_colour(0), len({film_colour(number) for number in range(40)})
    ('#0072B2', 40)
    """
    if number < len(CYCLE):
        return CYCLE[number]
    # the golden ratio keeps hues apart however many there are; darker than those of the cycle
    return to_hex(hsv_to_rgb((_GOLDEN * (number - len(CYCLE)) % 1.0, 0.75, 0.45)))


def _film_colours(spec: MachineSpec) -> dict[str, str]:
    surfaces: dict[str, str] = {}
    number = 0
    for film in spec.film:
        for name in film.surface:
            surfaces[name] = film_colour(number)
        number += 1
    for gap in spec.gap:
        for name in (gap.rotating, *gap.standing):
            surfaces[name] = film_colour(number)
        number += 1
    return surfaces


def _film_legend(spec: MachineSpec) -> list[tuple[str, str]]:
    colours = _film_colours(spec)
    owner = {surface.name: surface.part.replace("_", " ") for surface in spec.all_surfaces}
    entries = []
    for number, film in enumerate(spec.film):
        name = film.name or f"film {number + 1}"
        if film.kind == "constant":
            text = f"{film.coefficient.value:g} W/(m²·K)"
        elif film.kind == "rotating":
            text = f"by speed, at least {film.minimum:g} W/(m²·K)"
        elif film.kind in ("circuit", "wetted"):
            text = f"{film.fluid.replace('_', ' ')}, {film.flow * 6.0e4:.3g} L/min"
        elif film.kind == "lubrication":
            text = f"{film.lubrication.kind.replace('_', ' ')}, {film.flow * 6.0e4:.3g} L/min"
        else:
            text = f"natural convection and radiation, emissivity {film.emissivity:g}"
        to = "ambient" if film.temperature == "ambient" else f"{film.temperature - ZERO_CELSIUS_K:.1f} °C"
        entries.append((colours[film.surface[0]], f"{name.replace('_', ' ')}: {text} to {to}"))
    for gap in spec.gap:
        text = "by speed (annulus correlation)"
        if gap.kind == "power_law":
            text = f"{gap.at_rest:g} W/(m²·K) at rest"
            if gap.rise:
                speed = gap.reference_speed * 30.0 / math.pi
                text = f"{gap.at_rest:g} + {gap.rise:g} (n/{speed:.0f} rpm)^{gap.exponent:g} W/(m²·K)"
        between = f"{owner[gap.rotating]} to {owner[gap.standing[0]]}"
        entries.append((colours[gap.rotating], f"{gap.name.replace('_', ' ')}: {text}, {between}"))
    return entries


def _draw_films(axes: Axes, spec: MachineSpec, assembly: AssemblyGeometry) -> None:
    colours = _film_colours(spec)
    for edge in assembly.edges:
        if edge.name in colours:
            for sign in (1.0, -1.0):
                axes.plot(
                    np.array(edge.z) * MM,
                    sign * np.array(edge.r) * MM,
                    color=colours[edge.name],
                    linewidth=3.4,
                    solid_capstyle="butt",
                    zorder=3,
                )


def _probe_place(spec: MachineSpec, probe: Probe) -> tuple[float, float, float] | None:
    """Place along the axis and radius, m, and angle, rad; of the channel's outlet its end. None elsewhere."""
    if probe.kind == "point":
        return probe.z, probe.r, probe.angle
    channel = spec.channel
    if probe.kind != "coolant_outlet" or channel is None:
        return None
    hand = 1.0 if channel.hand == "right" else -1.0
    angle = hand * 2.0 * math.pi * channel.turns % (2.0 * math.pi)
    end = channel.z_start + channel.pitch * channel.turns
    return end, channel.inner_radius + 0.5 * channel.depth, angle


def _above(spec: MachineSpec, assembly: AssemblyGeometry) -> list[Label]:
    labels = []
    for probe in spec.probe:
        place = _probe_place(spec, probe)
        if place is None:
            continue
        z, radius, angle = place
        # A probe out of the plane is turned into the nearer half and labelled with its angle.
        side = math.copysign(1.0, round(math.cos(angle), 9)) if abs(math.cos(angle)) > 1e-9 else 1.0
        away = abs(math.sin(angle)) > 0.02
        text = f"{probe.name}\nθ = {math.degrees(angle):.0f}°" if away else probe.name
        labels.append(Label(text, np.array([z * MM, side * radius * MM])))
    for sensor in spec.displacement_sensor:
        spot = sensor_spot(sensor, assembly)
        if spot is not None:
            labels.append(Label(sensor.name, np.array(spot)))
    for z, sign in _ports_in_plane(spec):
        if sign > 0.0:
            text = "coolant in" if abs(z - spec.channel.z_start) < 1.0e-9 else "coolant out"
            labels.append(Label(text, np.array([z * MM, _outside_radius(spec, z) * MM])))
    return labels


def _below(spec: MachineSpec, assembly: AssemblyGeometry) -> list[Label]:
    labels = []
    for group, bearing in spec.bearings:
        kind = spec.bearing_types[group.type_name(bearing)]
        labels.append(Label(bearing.name, np.array([0.5 * sum(bearing.z) * MM, -0.5 * kind.pitch * MM])))
    rings = {
        f"{bearing.name}.{ring}" for _, bearing in spec.bearings for ring in ("inner_ring", "outer_ring")
    }
    for part in assembly.parts:
        if part.name in rings:
            continue
        longest = max(part.segments, key=lambda s: (s.z_end - s.z_start) * (s.outer_radius - s.inner_radius))
        place = np.array(
            [
                0.5 * (longest.z_start + longest.z_end) * MM,
                -(0.35 * longest.inner_radius + 0.65 * longest.outer_radius) * MM,
            ]
        )
        labels.append(Label(_two_lines(part.name.replace("_", " ")), place))
    return labels


def _two_lines(name: str) -> str:
    head, _, tail = name.rpartition(" ")
    return f"{head}\n{tail}" if head else tail
