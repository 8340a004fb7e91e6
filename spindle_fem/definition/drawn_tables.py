"""Geometry from the tables of a definition: parts, rings, balls and rollers of bearings, named surfaces."""

from __future__ import annotations

import math
from dataclasses import replace

from spindle_fem.definition.bearing_types import BearingType
from spindle_fem.definition.circuit_tables import CircuitFilm
from spindle_fem.definition.exchange_tables import Surface
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.solid_tables import Part, SetBearing
from spindle_fem.machine.geometry.part_shapes import (
    AnnularSegment,
    BallRowGeometry,
    FaceBox,
    PartGeometry,
    SurfaceDefinition,
)


def part_geometry(part: Part) -> PartGeometry:
    """Geometry of a ``[[part]]``."""
    segments = tuple(
        AnnularSegment(*segment.z, 0.5 * segment.inner_diameter, 0.5 * segment.outer_diameter)
        for segment in part.segment
    )
    return PartGeometry(part.name, segments, part.rotating)


def ring_geometries(bearing: SetBearing, kind: BearingType) -> tuple[PartGeometry, PartGeometry]:
    """Inner and outer ring of a bearing."""
    inner = AnnularSegment(*bearing.z, 0.5 * kind.bore_diameter, 0.5 * kind.inner_ring_outer_diameter)
    outer = AnnularSegment(*bearing.z, 0.5 * kind.outer_ring_inner_diameter, 0.5 * kind.outer_diameter)
    return (
        PartGeometry(f"{bearing.name}.inner_ring", (inner,), True),
        PartGeometry(f"{bearing.name}.outer_ring", (outer,), False),
    )


def element_rows(bearing: SetBearing, kind: BearingType) -> tuple[BallRowGeometry, ...]:
    """Rows of balls or rollers of a bearing; two share its width and are staggered by half a pitch."""
    middle, number = 0.5 * sum(bearing.z), kind.element_count
    return tuple(
        BallRowGeometry(
            bearing.name,
            middle + kind.width * ((row + 0.5) / kind.rows - 0.5),
            0.5 * kind.pitch,
            kind.element_diameter,
            number,
            kind.element_length,
            row * math.pi / number,
            1 + row * number,
        )
        for row in range(kind.rows)
    )


def surface_definition(surface: Surface) -> SurfaceDefinition:
    """Faces selected by a ``[[surface]]``."""
    boxes = tuple(FaceBox(box.facing, box.z, box.r) for box in surface.where)
    return SurfaceDefinition(surface.name, surface.part, boxes)


def surface_definitions(spec: MachineSpec) -> list[SurfaceDefinition]:
    """Faces of every surface of a machine; walls of circuits with the key of their diameter."""
    keys = {
        name: f"film.{film.name}.{key}"
        for film in spec.circuits
        if isinstance(film, CircuitFilm)
        for names in film.cell_surfaces
        for name, key in zip(
            names, ("diameter", "depth" if film.is_covered else "outer_diameter"), strict=False
        )
    }
    found = map(surface_definition, spec.all_surfaces)
    return [replace(surface, key=keys.get(surface.name, "")) for surface in found]
