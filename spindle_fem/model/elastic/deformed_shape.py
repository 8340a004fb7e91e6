"""The deformed bodies of a machine in the meridian plane, for pictures: the mean round the axis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.elastic.elastic_body import ElasticBody, Face
from spindle_fem.model.elastic.growth_outputs import AXIAL
from spindle_fem.model.elastic.machine_growth import GrowthModel, Side, Spacer, flange_back, holding_bearing
from spindle_fem.model.elastic.preload_loop import TOUCHING, spacer_ends

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BodyShape:
    """One body before and after deformation.

    Attributes
    ----------
    points : (n, 2) ndarray, [m]
        z and r of the corners as assembled.
    cells : (m, 4) int64 ndarray
    sides : (k, 2) int64 ndarray
        Ends of the outline's pieces.
    shift : (n, 2) ndarray, [m]
        Along z and r since assembly.
    """

    points: Array
    cells: NDArray[np.int64]
    sides: NDArray[np.int64]
    shift: Array


class RacewayMotion(NamedTuple):
    """How a raceway has moved since assembly, beside its radial shift.

    Attributes
    ----------
    axial : float, [m]
        Mean shift towards the drive end, against :func:`still_place`.
    twist : float, [rad]
        Turn of the ring's section: how much more its raceway has widened each metre towards the drive end.
    """

    axial: float
    twist: float


def raceway_motions(
    model: GrowthModel, shapes: Mapping[str, BodyShape]
) -> dict[tuple[str, Side], RacewayMotion]:
    """Motion of every raceway, by bearing and side, from the shapes of :func:`deformed_shapes`."""
    found = {}
    for ring in model.rings:
        shape, radius = shapes[ring.seat.ring], ring.seat.raceway.r[0]
        own = np.abs(shape.points[:, 1] - radius) < TOUCHING
        z, shift = shape.points[own, 0], shape.shift[own]
        order = np.argsort(z)
        mean = np.trapezoid(shift[order, 0], z[order]) / np.ptp(z)
        side: Side = "shaft" if ring.seat.is_inner else "housing"
        found[ring.seat.bearing, side] = RacewayMotion(float(mean), float(np.polyfit(z, shift[:, 1], 1)[0]))
    return found


def still_place(spec: MachineSpec, *, solid: bool = False) -> str:
    """What stays in its place in pictures of growth, those in three dimensions included, in words."""
    if Layout(spec, set()).flange_ends() is not None:
        return "the back of the flange"
    held = None if solid else holding_bearing(spec)
    return "the outside of the housing" if held is None else f"the seat of {held}"


def deformed_shapes(
    model: GrowthModel, temperature: Array, speed: float, forces: Mapping[str, tuple[float, float]]
) -> dict[str, BodyShape]:
    """Every body of a machine at a state, against the assembled one; :func:`still_place` stays.

    Parameters as of :meth:`GrowthModel.at`. Bending is left out.
    """
    pressing = model.pressures(temperature, speed, forces) - model.assembled_pressures()
    found: dict[str, Array] = {}
    held: dict[str, float] = {}
    for name, outputs in reversed(model.seating.carriers.items()):
        own = model.seating.seats_on(name)
        inwards = -1.0 if name == model.bodies.shaft else 1.0
        push = np.array([inwards * model.rings[i].seat.face.area * pressing[0, i] for i in own])
        shift = _thermal(model, name, temperature) + outputs.solutions @ push
        if name == model.bodies.shaft:
            shift = shift + outputs.body.solve(outputs.body.spin_load) * speed**2
        seat = model.holding_seat(name)
        at_seat = None if seat is None else outputs.body.mean_shift(seat, AXIAL) @ shift
        layout = Layout(model.spec, set())
        place = 0.0
        if name == model.bodies.housing and layout.flange_ends() is not None:
            place = -float(outputs.body.mean_shift(flange_back(layout), AXIAL) @ shift)
        elif at_seat is not None:
            place = held.get("seat", 0.0) - float(at_seat)
        if at_seat is not None:
            held["seat"] = float(at_seat) + place
        found[name] = _moved(outputs.body, shift, place)
    for index, ring in enumerate(model.rings):
        body = ring.outputs.body
        shift = _thermal(model, ring.seat.ring, temperature) + ring.outputs.solutions @ (
            ring.areas * pressing[:, index]
        )
        if ring.seat.is_inner:
            shift = shift + body.solve(body.spin_load) * speed**2
        carrier = model.bodies.bodies[ring.seat.carrier]
        under = carrier.mean_shift(ring.seat.face, AXIAL) @ found[ring.seat.carrier]
        own = body.mean_shift(ring.seat.face, AXIAL)
        found[ring.seat.ring] = _moved(body, shift, float(under - own @ shift))
    shapes = {name: _shape(model.bodies.bodies[name], shift) for name, shift in found.items()}
    return shapes | {
        name: _spacer_shape(model, spacer, temperature, found) for name, spacer in model.spacers.items()
    }


def _spacer_shape(
    model: GrowthModel, spacer: Spacer, temperature: Array, moved: Mapping[str, Array]
) -> BodyShape:
    """A spacer at its temperatures, free, in the middle between the rings that it touches."""
    body, apart = spacer.body, []
    rise = spacer.temperatures.corner_values(temperature - model.assembly_temperature)
    shift = body.solve(body.expansion_load @ rise)
    for ring in model.rings:
        for end in spacer_ends(spacer.part):
            touches = min(abs(end.z[0] - z) for z in ring.seat.face.z) < TOUCHING
            if touches and ring.seat.is_inner is spacer.part.rotating:
                radii = tuple(sorted((ring.seat.face.r[0], ring.seat.raceway.r[0])))
                side = ring.outputs.body.mean_shift(Face(end.z, radii), AXIAL)
                apart.append(side @ moved[ring.seat.ring] - body.mean_shift(end, AXIAL) @ shift)
    return _shape(body, _moved(body, shift, float(np.mean(apart)) if apart else 0.0))


def _thermal(model: GrowthModel, name: str, temperature: Array) -> Array:
    body = model.bodies.bodies[name]
    rise = model.fields[name].corner_values(temperature - model.assembly_temperature)
    return body.solve(body.expansion_load @ rise)


def _moved(body: ElasticBody, shift: Array, distance: float) -> Array:
    """A displacement with the whole body moved along the axis."""
    shift = shift.copy()
    basis = body.basis
    for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        shift[dofs[0]] += distance
    return shift


def _shape(body: ElasticBody, shift: Array) -> BodyShape:
    mesh = body.section.mesh
    return BodyShape(
        mesh.p.T, mesh.t.T, mesh.facets[:, mesh.boundary_facets()].T, shift[body.basis.nodal_dofs[:2]].T
    )
