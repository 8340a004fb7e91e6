"""What a machine's drawing shows beside its parts: coolant in ducts, heat sources, displacement sensors."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle

from spindle_fem.definition.circuit_tables import CircuitFilm
from spindle_fem.definition.displacement_tables import FRAME, DisplacementSensor
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.source_heat import source_heat
from spindle_fem.report.figure_style import INK
from spindle_fem.report.meridian_axes import MM, box

HEAT_COLOUR = "#c1121f"
# A stand on the frame is drawn that much further out than the flange.
FRAME_BESIDE = 1.02
_GROOVES = ("groove", "grooves")
Span = tuple[float, float]


def draw_streams(axes: Axes, spec: MachineSpec, colours: Mapping[str, str]) -> None:
    """Coolant and air of circuits in the tint of their walls; whatever is solid is drawn over it."""
    for film in spec.film:
        if not isinstance(film, CircuitFilm):
            continue
        tint = 0.45 * np.array(to_rgb(colours[film.surface[0]])) + 0.55
        for sign in (1.0, -1.0):
            for z, radius in _sections(film, sign):
                axes.add_patch(box(z, radius, sign, facecolor=tint, edgecolor="none", zorder=0.5))
                if film.duct.endswith(_GROOVES):
                    style = {"edgecolor": INK, "linewidth": 0.5, "zorder": 0.6}
                    axes.add_patch(box(z, radius, sign, facecolor="none", **style))


def _sections(film: CircuitFilm, sign: float) -> Iterator[tuple[Span, Span]]:
    """Where the plane cuts a duct, above (1) or below (-1) the axis: along it and radii, m."""
    wall = 0.5 * film.diameter
    outside = (film.wall or ("outside" if film.duct.endswith(_GROOVES) else "inside")) == "outside"
    if film.duct == "bore":
        yield film.z, (0.0, wall)
    elif film.duct == "annulus":
        yield film.z, (wall, 0.5 * film.outer_diameter)
    elif film.duct == "axial_bores":
        yield film.z, (wall, wall + film.bore_diameter) if outside else (wall - film.bore_diameter, wall)
    elif film.width is not None and film.depth is not None:
        radius = (wall, wall + film.depth) if outside else (wall - film.depth, wall)
        shift = 0.0
        number = float(film.number)
        if film.turns is not None:
            number *= film.turns
            shift = 0.25 if sign > 0.0 else -0.25
        pitch = film.length / number
        for place in range(math.ceil(number - 1e-9)):
            middle = film.z[0] + (place + 0.5 + shift) * pitch
            low = max(film.z[0], middle - 0.5 * film.width)
            high = min(film.z[1], middle + 0.5 * film.width)
            if low < high:
                yield (low, high), radius


def draw_sources(axes: Axes, spec: MachineSpec, assembly: AssemblyGeometry) -> None:
    """Hatching of what a source heats, a broken line along a surface."""
    segments = {
        f"{part.name}.{segment.name}": (
            segment.z,
            (0.5 * segment.inner_diameter, 0.5 * segment.outer_diameter),
        )
        for part in spec.part
        for segment in part.segment
    }
    shapes = {part.name: part.segments for part in assembly.parts}
    for place in heated_places(spec):
        boxes = [segments[place]] if place in segments else []
        boxes += [
            ((piece.z_start, piece.z_end), (piece.inner_radius, piece.outer_radius))
            for piece in shapes.get(place, ())
        ]
        edges = [edge for edge in assembly.edges if edge.name == place and not edge.is_contact]
        for sign in (1.0, -1.0):
            for z, radius in boxes:
                style = {"edgecolor": HEAT_COLOUR, "linewidth": 0.0, "hatch": "///", "alpha": 0.55}
                axes.add_patch(box(z, radius, sign, facecolor="none", zorder=1.5, **style))
            for edge in edges:
                line = np.array(edge.z) * MM, sign * np.array(edge.r) * MM
                axes.plot(*line, color=HEAT_COLOUR, linewidth=2.2, dashes=(2, 1), zorder=3.5)


def heated_places(spec: MachineSpec) -> dict[str, list[str]]:
    """Sources of the machine by the part, segment or surface that they heat."""
    found: dict[str, list[str]] = defaultdict(list)
    for source in spec.source:
        found[source.place].append(source.name)
    return found


def source_legend(spec: MachineSpec) -> list[str]:
    """A line for each heated place: what it gets at the operating point."""
    inputs = OperatingPoint.of(spec).inputs
    heat = {source.name: float(source_heat(source, inputs)) for source in spec.source}
    return [
        f"{sum(heat[name] for name in names):.4g} W into {_readable(place)}: "
        f"{', '.join(map(_readable, names))}"
        for place, names in heated_places(spec).items()
    ]


def heat_swatch(x: float, y: float) -> Rectangle:
    """Hatching beside an entry of a legend, in its pixels."""
    style = {"edgecolor": HEAT_COLOUR, "linewidth": 0.0, "hatch": "//////"}
    return Rectangle((x, y - 7.0), 44.0, 14.0, facecolor="none", **style)


def _readable(name: str) -> str:
    return name.replace("_", " ")


def draw_sensors(axes: Axes, spec: MachineSpec, assembly: AssemblyGeometry) -> None:
    """Displacement sensors: a square on the mount, open on a frame, and an arrow to the spot they look at."""
    for sensor in spec.displacement_sensor:
        target, mount = sensor_spot(sensor, assembly), _mount_spot(sensor, spec, assembly)
        if target is None or mount is None:
            continue
        arrow = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.0, "linestyle": (0, (4, 2))}
        axes.annotate("", target, mount, arrowprops=arrow | {"shrinkA": 0.0, "shrinkB": 0.0}, zorder=6)
        inside = "none" if sensor.mount == FRAME else INK
        axes.plot(*mount, marker="s", markersize=6.5, color=INK, markerfacecolor=inside, zorder=6)


def sensor_spot(sensor: DisplacementSensor, assembly: AssemblyGeometry) -> tuple[float, float] | None:
    """Spot that a sensor looks at, mm; of a surface the middle of its longest face."""
    if not isinstance(sensor.at, str):
        side = math.copysign(1.0, round(math.cos(sensor.at.angle), 9))
        return sensor.at.z * MM, side * sensor.at.radius * MM
    return _middle(sensor.at, assembly)


def _middle(surface: str, assembly: AssemblyGeometry) -> tuple[float, float] | None:
    edges = [edge for edge in assembly.edges if edge.name == surface]
    if not edges:
        return None
    widest = max(edges, key=lambda edge: edge.area)
    return 0.5 * sum(widest.z) * MM, 0.5 * sum(widest.r) * MM


def _mount_spot(
    sensor: DisplacementSensor, spec: MachineSpec, assembly: AssemblyGeometry
) -> tuple[float, float] | None:
    """What holds a sensor, mm: of a frame a spot just beside the flange in the plane that it is bolted to.

    None on a flange or a frame of a machine whose flange is not known.
    """
    if not isinstance(sensor.mount, str):
        return sensor.mount.z * MM, sensor.mount.radius * MM
    surface = _middle(sensor.mount, assembly)
    if surface is not None:
        return surface
    layout = Layout(spec, set())
    segments = [s for s in layout.housing.segment if s.name == layout.flange] if layout.housing else []
    if not segments:
        return None
    beside = FRAME_BESIDE if sensor.mount == FRAME else 1.0
    return segments[0].z[1] * MM, 0.5 * beside * segments[0].outer_diameter * MM
