"""Growth of a machine in three dimensions, on the tetrahedra of its thermal mesh.

Every body is free and grows by its own temperatures, with the channel and all holes as meshed. Rotation and
the pressures of the fits and balls act on it, as the contact problem of the meridian plane has them
(:mod:`spindle_fem.model.elastic.machine_growth`). Then the bodies are placed: the housing by the back of
its flange, outer rings on their seats, the shaft in the middle of its bearings, inner rings on the shaft,
spacers between rings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import GeometryError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.elastic.elastic_body import Face
from spindle_fem.model.elastic.machine_bodies import Seat, elastic_material
from spindle_fem.model.elastic.machine_growth import GrowthModel, Side, flange_back
from spindle_fem.model.elastic.solid_body import SolidBody, SolidMesh, rigid_motions
from spindle_fem.model.elastic.solid_facets import Facets, lie_on, met, on_face, outside_of
from spindle_fem.model.elastic.solid_readings import solid_readings

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SolidGrowth:
    """Shape of a machine against its assembled state, in three dimensions.

    Attributes
    ----------
    displacement : (n_nodes, 3) ndarray, [m]
        Of every node of the thermal mesh; the back of the flange stays in its place.
    seats, raceways : mapping of (bearing, side) to float, [m]
        Mean shift outwards of shaft or housing under the ring, and of the ring's raceway.
    nose_axial : float or None, [m]
        Forward shift of the shaft's front face; None without a flange.
    nose_radial, nose_tilt : (up, across) or None, [m], [rad]
        Of that face, and of the axis between two bearing sets; as in
        :class:`~spindle_fem.model.elastic.machine_growth.Growth`.
    displacements : mapping of str to float, [m]
        Readings of the displacement sensors.
    """

    displacement: Array
    seats: Mapping[tuple[str, Side], float]
    raceways: Mapping[tuple[str, Side], float]
    nose_axial: float | None
    nose_radial: tuple[float, float] | None
    nose_tilt: tuple[float, float] | None
    displacements: Mapping[str, float]


class _Placing:
    """Bodies of a machine, deformed and being placed."""

    def __init__(self, model: GrowthModel, mesh: TaggedMesh) -> None:
        self.model, self.mesh = model, mesh
        self.layout = Layout(model.spec, set())
        self.parts = dict(model.bodies.parts)
        inside = {part for parts in self.parts.values() for part in parts}
        #: Parts that are none of the bodies of the meridian plane: spacers.
        self.spacers = [part for part in mesh.part_names if part not in inside]
        self.parts |= {part: (part,) for part in self.spacers}
        self.nodes: dict[str, NDArray[np.bool_]] = {}
        self.shift = np.zeros_like(mesh.points)

    def face(self, body: str, face: Face) -> Facets:
        """Facets of a body on a face."""
        return on_face(self.mesh, self.parts[body], face)

    def deform(self, temperature: Array, speed: float, forces: Mapping[str, tuple[float, float]]) -> None:
        """Solve every body, free."""
        model, mesh = self.model, self.mesh
        rise = temperature - model.assembly_temperature
        materials = {part: elastic_material(model.spec.part_material(part)) for part in mesh.part_names}
        traction = self._contacts(speed, forces, temperature)
        for name, parts in self.parts.items():
            own = SolidMesh.of(mesh, parts)
            body = SolidBody.of(own, materials, rise)
            load = body.expansion.copy()
            if mesh.rotating[parts[0]]:
                load += speed**2 * body.turning
            nodes = own.local >= 0
            np.add.at(load, own.local[nodes], traction[nodes])
            self.nodes[name] = nodes
            self.shift[nodes] = body.solve(load)[own.local[nodes]]

    def _contacts(self, speed: float, forces: Mapping[str, tuple[float, float]], temperature: Array) -> Array:
        """Forces (n_nodes, 3) of what presses on seats and raceways more than as assembled, N."""
        model = self.model
        unknowns = temperature[: model.unknowns]
        pressing = model.pressures(unknowns, speed, forces) - model.assembled_pressures()
        found = np.zeros_like(self.shift)
        for ring, (on_seat, on_raceway) in zip(model.rings, pressing.T, strict=True):
            seat, sign = ring.seat, 1.0 if ring.seat.is_inner else -1.0
            for body, face, pressure in (
                (seat.ring, seat.face, sign * on_seat),
                (seat.ring, seat.raceway, -sign * on_raceway),
                (seat.carrier, seat.face, -sign * on_seat),
            ):
                facets = self.face(body, face)
                found += facets.load(pressure * facets.outwards)
        return found

    # -------------------------------------------------------------- placing
    def move(self, body: str, motion: Array) -> None:
        """Move a body rigidly by (6,) shifts and turns."""
        nodes = self.nodes[body]
        self.shift[nodes] += rigid_motions(self.mesh.points[nodes]) @ motion

    def place(self) -> Array:
        """Place every body; returns the turn of the axis, its shift (x, y) for each metre along z."""
        bodies, seats = self.model.bodies, self.model.bodies.seats
        held = self.layout.flange_ends() is not None
        back = (
            self.face(bodies.housing, flange_back(self.layout))
            if held
            else Facets(self.mesh.points, outside_of(self.mesh, self.parts[bodies.housing]))
        )
        self.move(bodies.housing, back.rigid_fit(-back.at(self.shift)))
        for seat in seats:
            if not seat.is_inner:
                self._put(seat.ring, {seat.carrier}, seat.face)
        turn = self._place_shaft()
        for seat in seats:
            if seat.is_inner:
                self._put(seat.ring, {seat.carrier}, seat.face)
        rings = {seat.ring for seat in seats}
        for spacer in self.spacers:
            self._put(spacer, rings)
        return turn

    def _put(self, body: str, others: set[str], face: Face | None = None) -> None:
        """Move a body nearest to others that it touches, on a face or wherever it does."""
        there = {part for other in others for part in self.parts[other]}
        mine, theirs = met(self.mesh, self.parts[body], there)
        if face is not None:
            on = lie_on(self.mesh.points[mine.nodes[:, :3]], face)
            mine, theirs = (Facets(self.mesh.points, each.nodes[on]) for each in (mine, theirs))
        if not len(mine.nodes):
            raise GeometryError(body, f"touches none of {', '.join(sorted(others))}.", "Let it touch one.")
        self.move(body, mine.rigid_fit(theirs.at(self.shift) - mine.at(self.shift)))

    def _place_shaft(self) -> Array:
        """Put the shaft in the middle of its bearings."""
        model, bodies = self.model, self.model.bodies
        sets = model.spec.bearing_set
        groups = [{bearing.name for bearing in group.bearing} for group in (sets[0], sets[-1])]
        places, apart = [], []
        for names in groups[: len(sets)]:
            own = [seat for seat in bodies.seats if seat.bearing in names]
            inner, outer = (
                [self.face(seat.carrier, seat.face) for seat in own if seat.is_inner is side]
                for side in (True, False)
            )
            middle = [
                np.mean([facets.shift(self.shift) for facets in each], axis=0) for each in (inner, outer)
            ]
            places.append(np.mean([facets.centre[2] for facets in inner]))
            apart.append((middle[1] - middle[0])[:2])
        turn = (apart[1] - apart[0]) / (places[1] - places[0]) if len(places) > 1 else np.zeros(2)
        shift = apart[0] - turn * places[0]
        self.move(bodies.shaft, np.array([*shift, 0.0, -turn[1], turn[0], 0.0]))
        held = [
            self.face(name, model.holding_seat(name)).shift(self.shift)
            for name in (bodies.shaft, bodies.housing)
        ]
        self.move(bodies.shaft, np.array([0.0, 0.0, (held[1] - held[0])[2], 0.0, 0.0, 0.0]))
        return turn


def solid_growth(
    model: GrowthModel,
    mesh: TaggedMesh,
    temperature: Array,
    speed: float,
    forces: Mapping[str, tuple[float, float]],
) -> SolidGrowth:
    """Solve and place every body of a machine.

    Parameters
    ----------
    temperature : (n_nodes,) ndarray, [K]
        At every node of the mesh, middles of edges too.
    speed : float, [rad/s]
    forces : mapping of str to (inner, outer), [N]
        Sum of the radial ball loads on both raceways of each bearing.

    Raises
    ------
    GeometryError
        A body in pieces, a seat or a flange that the mesh does not have, a part that touches nothing.
    ConvergenceError
    """
    machine = _Placing(model, mesh)
    machine.deform(temperature, speed, forces)
    turn = machine.place()
    shift, shaft = machine.shift, model.bodies.shaft
    first = min(machine.layout.shaft.segment, key=lambda segment: segment.z[0])
    front = Face((first.z[0],) * 2, (0.5 * first.inner_diameter, 0.5 * first.outer_diameter))
    x, y, z = machine.face(shaft, front).shift(shift).tolist()
    held = machine.layout.flange_ends() is not None
    bent = held and len(model.spec.bearing_set) > 1

    def key(seat: Seat) -> tuple[str, Side]:
        return seat.bearing, "shaft" if seat.is_inner else "housing"

    return SolidGrowth(
        shift,
        {key(seat): machine.face(seat.carrier, seat.face).growth(shift) for seat in model.bodies.seats},
        {key(seat): machine.face(seat.ring, seat.raceway).growth(shift) for seat in model.bodies.seats},
        -z if held else None,
        (y, -x) if bent else None,
        (float(turn[1]), -float(turn[0])) if bent else None,
        solid_readings(model, mesh, shift),
    )
