"""How much shaft, housing and spacers give way to the preload that a locknut sets up between bearings.

The force runs from the bearings that face one way through the shaft, and through inner rings and
spacers beside it, to those that face the other way, and back through the housing, outer rings and
spacers. What lies side by side shares the force as stiff springs do, as long as the locknut and the
cover hold it together; both ways are in series.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import BearingSet, MachineSpec, Part, SetBearing
from spindle_fem.errors import SpecError
from spindle_fem.machine.geometry.part_shapes import AnnularSegment
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.elastic.elastic_body import ElasticBody, Face
from spindle_fem.model.elastic.growth_outputs import AXIAL
from spindle_fem.model.elastic.machine_bodies import (
    ELEMENT_SIZE,
    MachineBodies,
    Seat,
    carries_rings,
    elastic_material,
    machine_bodies,
)
from spindle_fem.model.elastic.meridian_mesh import MeridianMesh

Array = NDArray[np.float64]
# Ends of rings and spacers that touch differ by less than this, m.
TOUCHING = 1.0e-6


def loop_stiffness(spec: MachineSpec, group: BearingSet, bodies: MachineBodies | None = None) -> float:
    """Force by which the two sides of a set must be pressed together for them to come 1 m nearer, N/m.

    Bearings themselves are left out. Infinite in a set whose bearings all face one way.

    Raises
    ------
    SpecError
        A machine without a shaft or a housing.
    """
    if not carries_rings(spec):
        where = f"bearing_set.{group.name}.preload_kind"
        raise SpecError(
            where, '"elastic" asks for a shaft and a housing.', 'Allowed without: "rigid", "spring".'
        )
    bearings = sorted(group.bearing, key=lambda bearing: bearing.z[0])
    shares = _shares(bearings)
    if shares is None:
        return float("inf")
    bodies = machine_bodies(spec) if bodies is None else bodies
    give = 0.0
    for inner in (True, False):
        seats = {seat.bearing: seat for seat in bodies.seats if seat.is_inner is inner}
        own = [seats[bearing.name] for bearing in bearings]
        carrier = bodies.bodies[own[0].carrier]
        stiffness = 1.0 / carrier_give(carrier, [seat.face for seat in own], shares)
        beside = _stack_give(spec, bodies, own, np.cumsum(shares)[:-1])
        give += 1.0 / (stiffness + (0.0 if beside is None else 1.0 / beside))
    return 1.0 / give


def _shares(bearings: Sequence[SetBearing]) -> Array | None:
    """Share of the preload at each bearing, summing to 1 on one side and to -1 on the other."""
    front = np.array([bearing.takes_thrust == "towards_rear" for bearing in bearings])
    if front.all() or not front.any():
        return None
    return np.where(front, 1.0 / front.sum(), -1.0 / (~front).sum())


def carrier_give(body: ElasticBody, faces: Sequence[Face], shares: Array) -> float:
    """How far a body lets seats come together under a force of 1 N that they share, m/N.

    Parameters
    ----------
    faces : sequence of Face
        Seats; each takes its force evenly over its area.
    shares : (n,) ndarray
        Of the force along z at each, in balance.
    """
    load = sum(share * body.mean_shift(face, AXIAL) for share, face in zip(shares, faces, strict=True))
    return float(load @ body.solve(load))


def tube_give(body: ElasticBody, z: tuple[float, float], r: tuple[float, float]) -> float:
    """How much shorter a ring or a spacer becomes under 1 N evenly over both ends, m/N."""
    ends = [body.mean_shift(Face((at, at), r), AXIAL) for at in z]
    load = ends[1] - ends[0]
    return float(load @ body.solve(load))


def _stack_give(
    spec: MachineSpec, bodies: MachineBodies, seats: Sequence[Seat], through: Array
) -> float | None:
    """The same of rings with the spacers between them; None where a gap has no spacer.

    Parameters
    ----------
    through : (n - 1,) ndarray
        Share of the force between each bearing and the next.
    """
    rings = [
        tube_give(bodies.bodies[s.ring], s.face.z, tuple(sorted((s.face.r[0], s.raceway.r[0]))))
        for s in seats
    ]
    total = 0.0
    for index, share in enumerate(through):
        gap = seats[index].face.z[1], seats[index + 1].face.z[0]
        between = 0.0
        if gap[1] - gap[0] > TOUCHING:
            spacer = _spacer(spec, gap, rotating=seats[0].is_inner)
            if spacer is None:
                return None
            between = spacer_give(spec, spacer)
        total += share**2 * (0.5 * (rings[index] + rings[index + 1]) + between)
    return total or None


def _spacer(spec: MachineSpec, gap: tuple[float, float], *, rotating: bool) -> Part | None:
    """The spacer that fills a gap between two rings."""
    layout = Layout(spec, set())
    for part in spec.part:
        ends = [z for segment in part.segment for z in segment.z]
        fills = abs(min(ends) - gap[0]) < TOUCHING and abs(max(ends) - gap[1]) < TOUCHING
        if fills and part.rotating is rotating and layout.is_spacer(part):
            return part
    return None


def spacer_body(spec: MachineSpec, part: Part) -> ElasticBody:
    """A spacer as a body of its own."""
    shapes = [AnnularSegment(*s.z, 0.5 * s.inner_diameter, 0.5 * s.outer_diameter) for s in part.segment]
    section = MeridianMesh.of([shapes], ELEMENT_SIZE)
    return ElasticBody(part.name, section, [elastic_material(spec.part_material(part.name)).stiffness])


def spacer_ends(part: Part) -> tuple[Face, Face]:
    """Front and rear end of a spacer."""
    first, last = min(part.segment, key=lambda s: s.z[0]), max(part.segment, key=lambda s: s.z[1])
    return tuple(
        Face((z, z), (0.5 * s.inner_diameter, 0.5 * s.outer_diameter))
        for z, s in ((first.z[0], first), (last.z[1], last))
    )


def spacer_give(spec: MachineSpec, part: Part) -> float:
    """How much shorter a spacer becomes under 1 N evenly over both ends, m/N."""
    body = spacer_body(spec, part)
    front, rear = (body.mean_shift(face, AXIAL) for face in spacer_ends(part))
    return float((rear - front) @ body.solve(rear - front))
