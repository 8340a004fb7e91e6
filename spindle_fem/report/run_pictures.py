"""The three-dimensional pictures of a run: cut machine, channel, bearings, mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.report.drawn_surfaces import (
    SegmentSet,
    TriangleSet,
    element_faces,
    exposed_triangles,
    facet_edges,
    facet_triangles,
    sharp_edges,
)
from spindle_fem.report.figure_style import (
    BODY_NAMES,
    FILM_MAP,
    TEMPERATURE_MAP,
    ColourBar,
    grouped,
    scale_of,
)
from spindle_fem.report.leader_labels import Label
from spindle_fem.report.machine_drawing import part_colours
from spindle_fem.report.picture_sheets import picture_figure, pictures_side_by_side
from spindle_fem.report.plane_sections import behind, clip_segments, clip_triangles
from spindle_fem.report.profiles import MeridianSection
from spindle_fem.report.scenes import SceneRenderer, View, ball_triangles
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.units import ZERO_CELSIUS_K

# Of the length of a machine: a third of a pixel.
BEHIND = 2.0e-4
TOWARDS_HALF = (-1.0, 0.28, -0.45)
UP = (0.0, 1.0, 0.0)


def _kept_points(result: ThermalResult, section: MeridianSection) -> NDArray[np.float64]:
    points = result.mesh.points
    return np.concatenate([points[points[:, 0] >= 0.0], section.outlines.points.reshape(-1, 3)])


def _half_of_balls(result: ThermalResult) -> TriangleSet:
    # Whole balls: those with their centre on the kept side, and the ones that the cut goes through.
    return ball_triangles(
        result.spec,
        {name: item.temperature_ball - ZERO_CELSIUS_K for name, item in result.bearings.items()},
        lambda centres: centres[:, 0] > -1.0e-6,
    )


def _celsius(shape: TriangleSet) -> TriangleSet:
    return TriangleSet(
        shape.points, shape.triangles, shape.values - ZERO_CELSIUS_K, shape.label, shape.normals
    )


def add_half_machine(
    renderer: SceneRenderer,
    result: ThermalResult,
    section: MeridianSection,
    edges: SegmentSet,
    bar: ColourBar,
) -> None:
    """Layers of the machine with its near half removed, coloured by temperature."""
    outside = exposed_triangles(result.mesh, result.temperature - ZERO_CELSIUS_K)
    # with the section closed: faces turned away are behind others
    renderer.add_coloured(clip_triangles(outside, outside.points[:, 0]), bar, closed=True)
    faces = _celsius(section.faces)
    renderer.add_coloured(behind(faces, BEHIND * float(np.ptp(faces.points[:, 2]))), bar, lit=False)
    renderer.add_coloured(faces, bar, lit=False)
    if result.bearings:
        renderer.add_coloured(_half_of_balls(result), bar, closed=True)
    renderer.add_lines(section.outlines)
    renderer.add_lines(clip_segments(edges, edges.points[..., 0]), width=1.0)


def probe_labels(spec: MachineSpec, probes: Mapping[str, float]) -> tuple[list[Label], str]:
    """Name and reading of every probe on the kept half, and a sentence for those on the removed one."""
    labels, removed = [], []
    for probe in spec.probe:
        if probe.kind != "point" or probe.name not in probes:
            continue
        place = np.array([-probe.r * np.sin(probe.angle), probe.r * np.cos(probe.angle), probe.z])
        reading = f"{probes[probe.name] - ZERO_CELSIUS_K:.1f} °C"
        if place[0] > -1.0e-6:
            labels.append(Label(f"{probe.name}\n{reading}", place))
        else:
            removed.append(f"{probe.name} (θ = {np.degrees(probe.angle):.0f}°) {reading}")
    return labels, f" On the removed half: {', '.join(removed)}." if removed else ""


def ball_labels(result: ThermalResult) -> list[Label]:
    """Name and temperature of the balls or rollers of every bearing, at the lowest of them."""
    labels = []
    for group, bearing in result.spec.bearings:
        kind = result.spec.bearing_types[group.type_name(bearing)]
        warm = result.bearings[bearing.name].temperature_ball - ZERO_CELSIUS_K
        labels.append(
            Label(
                f"{bearing.name} {kind.element_word}s\n{warm:.1f} °C",
                np.array([0.0, -0.5 * kind.pitch, 0.5 * sum(bearing.z)]),
            )
        )
    return labels


def temperature_cut(
    renderer: SceneRenderer, result: ThermalResult, section: MeridianSection, bar: ColourBar
) -> Figure:
    """Whole machine cut open; expects the layers of :func:`add_half_machine`."""
    view = View(TOWARDS_HALF, UP, _kept_points(result, section))
    hottest = result.temperature_maximum - ZERO_CELSIUS_K
    place = result.temperature_maximum_at * 1.0e3
    labels, removed = probe_labels(result.spec, result.probes)
    notes = (
        f"Near half removed. Warmest place of the solid {hottest:.1f} °C "
        f"at r = {np.hypot(*place[:2]):.0f} mm, z = {place[2]:.0f} mm; "
        f"{result.spec.rolling_elements} at their own temperature."
    )
    return picture_figure(
        renderer.render(view),
        "Temperature of the machine, cut open",
        bars=[bar],
        above=labels,
        below=ball_labels(result),
        notes=notes + removed,
    )


def bearing_close_ups(renderer: SceneRenderer, result: ThermalResult, bar: ColourBar) -> dict[str, Figure]:
    """A picture of each bearing set, upper half; expects the layers of :func:`add_half_machine`."""
    figures = {}
    for group in result.spec.bearing_set:
        kind = result.spec.bearing_types[group.bearing_type]
        z_low = min(bearing.z[0] for bearing in group.bearing)
        z_high = max(bearing.z[1] for bearing in group.bearing)
        margin = 0.14 * (z_high - z_low)
        section = 0.5 * (kind.outer_diameter - kind.bore_diameter)
        radii = (0.5 * kind.bore_diameter - 0.55 * section, 0.5 * kind.outer_diameter + 0.65 * section)
        ends = np.array([[0.0, radii[0], z_low - margin], [0.0, radii[1], z_high + margin]])
        picture = renderer.render(View((-1.0, 0.0, 0.0), UP, ends), margin_px=0.0)
        labels = []
        below = []
        for bearing in group.bearing:
            state = result.bearings[bearing.name]
            middle = 0.5 * sum(bearing.z)
            names = BODY_NAMES | {"balls": f"{kind.element_word}s"}
            parts = "\n".join(f"{value:.0f} W to {names[name]}" for name, value in state.heat_to.items())
            labels.append(
                Label(
                    f"{bearing.name}: {state.heat:.0f} W\n{parts}",
                    np.array([0.0, 0.5 * kind.pitch, middle]),
                )
            )
            below.append(
                Label(
                    f"inner race {state.temperature_inner - ZERO_CELSIUS_K:.1f} °C\n"
                    f"{kind.element_word}s {state.temperature_ball - ZERO_CELSIUS_K:.1f} °C\n"
                    f"outer race {state.temperature_outer - ZERO_CELSIUS_K:.1f} °C\n"
                    f"inner − outer {state.ring_difference:.1f} K",
                    np.array([0.0, 0.25 * (kind.bore_diameter + kind.inner_ring_outer_diameter), middle]),
                )
            )
        figures[group.name] = picture_figure(
            picture,
            f"Bearing set {group.name}: heat and temperatures",
            bars=[bar],
            above=labels,
            below=below,
            notes="Section at the top (θ = 0): friction heat above, temperatures below.",
        )
    return figures


def channel_walls(renderer: SceneRenderer, result: ThermalResult) -> Figure | None:
    """Channel walls with film coefficient and coolant temperature side by side; None without a channel."""
    spec, mesh = result.spec, result.mesh
    if result.coolant is None or spec.channel is None:
        return None
    names = [
        name
        for name in (f"{spec.channel.part}.channel_wall", f"{spec.channel.part}.channel_ports")
        if name in mesh.surfaces and name in result.film_coefficient
    ]
    facets = np.concatenate([mesh.surfaces[name] for name in names])
    film = np.concatenate([result.film_coefficient[name] for name in names])
    helix = result.film_coefficient[names[0]]
    bulk = np.concatenate([result.fluid_temperature[name] for name in names]) - ZERO_CELSIUS_K
    values = np.repeat(np.column_stack([film, bulk])[:, None, :], 6, axis=1)
    shape = facet_triangles(mesh.points, facets, values, np.zeros(len(facets), dtype=np.int32))
    bars = (
        _film_scale(helix, film),
        scale_of(bulk, TEMPERATURE_MAP, "coolant temperature / °C"),
    )
    view = View((-1.0, 0.55, -0.75), UP, shape.points)
    lines = sharp_edges_of_facets(mesh.points, facets)
    pictures = []
    for column, bar in enumerate(bars):
        renderer.clear()
        renderer.add_coloured(shape, bar, column=column)
        renderer.add_lines(lines, width=0.8)
        pictures.append(renderer.render(view, 756))
    coolant = result.coolant
    inlet, outlet = _channel_ends(spec)
    labels = (
        [Label(f"in {coolant.inlet_temperature - ZERO_CELSIUS_K:.1f} °C", inlet)],
        [Label(f"out {coolant.outlet_temperature - ZERO_CELSIUS_K:.2f} °C", outlet)],
    )
    return pictures_side_by_side(
        pictures,
        "Walls of the channel",
        bars,
        [labels[0] + labels[1]] * 2,
        notes=f"{coolant.flow * 6.0e4:.3g} L/min, Re = {coolant.reynolds:.0f}, {coolant.regime}; film "
        f"{helix.min():.0f} to {helix.max():.0f} W/(m²·K) along the helix"
        + (f", {film.max():.0f} in the ports" if film.max() > helix.max() else "")
        + f"; {coolant.heat:.0f} W to the coolant.",
    )


def _film_scale(helix: NDArray[np.float64], film: NDArray[np.float64]) -> ColourBar:
    # Ports are another section: on one scale with them the helix would be of one colour. A scale
    # narrower than a tenth either way would make a uniform film look uneven.
    mean = float(helix.mean())
    ends = [min(float(helix.min()), 0.9 * mean), max(float(helix.max()), 1.1 * mean)]
    bar = scale_of(ends, FILM_MAP, "film coefficient / W/(m²·K)")
    above, below = film.max() > bar.high, film.min() < bar.low
    extend = {(True, True): "both", (True, False): "max", (False, True): "min"}.get((above, below), "neither")
    return replace(bar, extend=extend)


def _channel_ends(spec: MachineSpec) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    channel = spec.channel
    sign = 1.0 if channel.hand == "right" else -1.0
    radius = channel.inner_radius + channel.depth
    outer = max(
        segment.outer_diameter for part in spec.part if part.name == channel.part for segment in part.segment
    )
    places = []
    for turns in (0.0, channel.turns):
        theta = sign * 2.0 * np.pi * turns
        z = channel.z_start + channel.pitch * turns
        reach = radius
        if channel.ports is not None:
            reach = max(
                (
                    0.5 * segment.outer_diameter
                    for part in spec.part
                    if part.name == channel.part
                    for segment in part.segment
                    if segment.z[0] <= z <= segment.z[1]
                ),
                default=0.5 * outer,
            )
        places.append(np.array([-reach * np.sin(theta), reach * np.cos(theta), z]))
    return places[0], places[1]


def sharp_edges_of_facets(points: NDArray[np.float64], facets: NDArray[np.int64]) -> SegmentSet:
    """Sharp edges of one surface alone."""
    return sharp_edges(points, facets, np.zeros(len(facets), dtype=np.int32))


def mesh_picture(renderer: SceneRenderer, mesh: TaggedMesh, n_unknowns: int) -> Figure:
    """Whole elements behind the vertical plane, coloured by part; alone in the scene."""
    centre = mesh.points[mesh.tetrahedra[:, :4], 0].mean(axis=1)
    facets, part = element_faces(mesh, centre > 0.0)
    shape = facet_triangles(mesh.points, facets, np.zeros((len(facets), 6, 0)), part)
    renderer.clear()
    renderer.add_parts(shape, part_colours(mesh.part_names), closed=True)
    renderer.add_lines(facet_edges(mesh.points, facets), width=0.7, opacity=0.75)
    view = View(TOWARDS_HALF, UP, shape.points)
    return picture_figure(
        renderer.render(view),
        "Mesh: whole elements behind the vertical plane, coloured by part",
        notes=f"{grouped(mesh.n_elements)} quadratic tetrahedra, {grouped(n_unknowns)} temperature "
        f"unknowns, worst element quality (minSICN) {mesh.min_quality:.2f}.",
    )
