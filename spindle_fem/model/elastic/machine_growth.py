"""Growth of a machine: seats, raceways and nose at any temperatures, fits and ball loads.

Every elastic body is solved once for its outputs. After that a state is a few inner products with the
temperatures and one small contact problem over all seats.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import BearingSet, MachineSpec, Part, SetBearing
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.elastic.displacement_sensors import SensorSight, sensor_sights
from spindle_fem.model.elastic.elastic_body import ElasticBody, Face
from spindle_fem.model.elastic.growth_outputs import AXIAL, RADIAL, SIDEWAYS, BodyOutputs
from spindle_fem.model.elastic.machine_bodies import MachineBodies, machine_bodies
from spindle_fem.model.elastic.meridian_field import MeridianField
from spindle_fem.model.elastic.preload_loop import spacer_body, spacer_ends
from spindle_fem.model.elastic.ring_seats import RingSeats
from spindle_fem.physics.bearings.mounting import ROOM_TEMPERATURE

Array = NDArray[np.float64]
Side = Literal["shaft", "housing"]


@dataclass(frozen=True, slots=True)
class SeatState:
    """One ring on its seat, relative to the assembled state.

    Attributes
    ----------
    pressure : float, [Pa]
        Mean over the seat; 0 where a gap is open.
    gap : float, [m]
        Radial; 0 where the ring is tight.
    seat_growth, raceway_growth : float, [m]
        Radial shift of shaft or housing under the ring, and of the ring's raceway, from the assembled state.
    """

    pressure: float
    gap: float
    seat_growth: float
    raceway_growth: float


@dataclass(frozen=True, slots=True)
class Growth:
    """Shape of a machine against its assembled state.

    Attributes
    ----------
    seats : mapping of (bearing, side) to SeatState
        Side ``shaft`` or ``housing``.
    nose_axial : float or None, [m]
        How far the nose has moved forward from the frame the flange is bolted to; None where the
        machine has no shaft, no flange or no bearing.
    nose_radial : (up, across) or None, [m]
        Shift of the nose's middle, where the housing bends; None without a second set of bearings.
        Across is where θ = 90°: to the right of who looks along the axis from the nose.
    nose_tilt : (up, across) or None, [rad]
        Turn of the axis: its shift for each metre towards the drive end.
    spacers : mapping of str to float, [m]
        How much longer each spacer has become, free of the force of the locknut.
    """

    seats: Mapping[tuple[str, Side], SeatState]
    nose_axial: float | None
    nose_radial: tuple[float, float] | None = None
    nose_tilt: tuple[float, float] | None = None
    spacers: Mapping[str, float] = field(default_factory=dict)


class Spacer(NamedTuple):
    """A ring between two bearings, the fit of its temperatures, and its length by each of them [m/K]."""

    part: Part
    body: ElasticBody
    temperatures: MeridianField
    length: Array


# Motions of the nose, m and rad.
NOSE = ("nose_axial", "nose_radial_up", "nose_radial_across", "nose_tilt_up", "nose_tilt_across")


@dataclass(frozen=True, slots=True, eq=False)
class Motions:
    """Displacements of a machine since assembly as sums over its temperatures.

    Attributes
    ----------
    nose : tuple of str
        Those of :data:`NOSE` that are defined, m and rad.
    sensors : tuple of str
        Displacement sensors, m.
    rows : (k, n_unknowns) ndarray
        Of the nose's motions, then of the sensors, by each temperature [1/K].
    assembled : (k,) ndarray
        Their products with the temperature of assembly.
    spins : (k,) ndarray
        What 1 rad/s adds; it grows with the square of the speed.
    """

    nose: tuple[str, ...]
    sensors: tuple[str, ...]
    rows: Array
    assembled: Array
    spins: Array

    def at(self, products: Array, speed: Array) -> Array:
        """Motions (n, k) from the products of the rows with temperatures (n, k), at speeds (n,) [rad/s]."""
        return products - self.assembled + np.square(speed)[:, None] * self.spins


def _assembled_radial_force(spec: MachineSpec, group: BearingSet, bearing: SetBearing) -> float:
    """Radial force between the rings of a bearing from its assembled preload, N; rollers carry none."""
    if not group.preload > 0.0:
        return 0.0
    share = group.preload / sum(other.takes_thrust == bearing.takes_thrust for other in group.bearing)
    return share / math.tan(spec.bearing_types[group.type_name(bearing)].contact_angle)


def flange_back(layout: Layout) -> Face:
    """The plane behind the flange that is bolted to the frame."""
    flange = next(s for s in layout.housing.segment if s.name == layout.flange)
    below = max(s.outer_diameter for s in layout.housing.segment if s is not flange)
    return Face((max(flange.z),) * 2, (0.5 * below, 0.5 * flange.outer_diameter))


def holding_bearing(spec: MachineSpec) -> str | None:
    """The bearing that holds the shaft in place: the last of the set that carries thrust."""
    sets = [group for group in spec.bearing_set if group.carries_thrust] or spec.bearing_set
    return max(sets[0].bearing, key=lambda bearing: bearing.z[1]).name if sets else None


class GrowthModel:
    """Elastic outputs of a machine over the unknowns of its thermal mesh.

    Parameters
    ----------
    mesh : TaggedMesh
        On which temperatures are given.
    order : int
        Of the temperature, 1 or 2.
    bodies : MachineBodies, optional
        The machine's own by default.
    """

    def __init__(
        self, spec: MachineSpec, mesh: TaggedMesh, order: int, bodies: MachineBodies | None = None
    ) -> None:
        self.spec = spec
        self.bodies = machine_bodies(spec) if bodies is None else bodies

        self.unknowns = mesh.n_corners if order == 1 else len(mesh.points)
        housing = self.bodies.bodies.get(self.bodies.housing)
        self.sights = () if housing is None else sensor_sights(spec, mesh, housing)
        self.fields = {
            name: MeridianField(mesh, order, parts, self.bodies.bodies[name].section)
            for name, parts in self.bodies.parts.items()
        }
        self.seating = RingSeats(spec, self.bodies)
        self.rings, self.bearings = self.seating.rings, self.seating.bearings
        #: Outputs of shaft and housing beside their seats.
        self.carriers = {name: found for name in self.seating.carriers if (found := self._carrier(name))}
        self.bending = self._bending()
        #: Every spacer and the field of its temperatures.
        self.spacers = dict(self._spacers(mesh, order))
        sets = spec.bearing_set
        groups = {bearing.name: group for group, bearing in spec.bearings}
        self._assembled_at = np.array([groups[name].assembly_temperature for name in self.bearings])
        held = [group for group in sets if group.carries_thrust] or list(sets)
        self.assembly_temperature = held[0].assembly_temperature if held else ROOM_TEMPERATURE
        self.assembly_forces = {
            bearing.name: (force, force)
            for group, bearing in spec.bearings
            for force in [_assembled_radial_force(spec, group, bearing)]
        }
        self.seat_rows = np.zeros((len(self.rings), self.unknowns))
        for name, outputs in self.seating.carriers.items():
            self.seat_rows[self.seating.seats_on(name)] = self._rows(outputs)
        ring_rows = np.array([self._rows(ring.outputs) for ring in self.rings])
        self.thermal_rows = self.seating.thermal_rows(
            self.seat_rows, ring_rows.reshape(len(self.rings), 2, self.unknowns)
        )

    def _spacers(self, mesh: TaggedMesh, order: int) -> Iterator[tuple[str, Spacer]]:
        layout = Layout(self.spec, set())
        for part in self.spec.part:
            if layout.is_spacer(part) and part.name in mesh.part_names:
                body = spacer_body(self.spec, part)
                front, rear = (body.mean_shift(face, AXIAL) for face in spacer_ends(part))
                outputs = BodyOutputs.of(body, {"length": rear - front})
                temperatures = MeridianField(mesh, order, (part.name,), body.section)
                length = temperatures.rows(outputs.by_temperature())[0]
                yield part.name, Spacer(part, body, temperatures, length)

    def _rows(self, outputs: BodyOutputs) -> Array:
        return self.fields[outputs.body.name].rows(outputs.by_temperature())

    def _carrier(self, name: str) -> tuple[BodyOutputs, Array] | None:
        body = self.bodies.bodies[name]
        outputs = {}
        forward = self._forward_of(name)
        if forward is not None:
            outputs["forward"] = forward
        for sight in self.sights:
            outputs[sight.key] = self._seen(name, sight)
        if not outputs:
            return None
        solved = BodyOutputs.of(body, outputs)
        return solved, self._rows(solved)

    def _forward_of(self, name: str) -> Array | None:
        """Forward shift of the nose from its bearing (shaft), or of the bearing from the flange (housing)."""
        layout, body = Layout(self.spec, set()), self.bodies.bodies[name]
        held = self.holding_seat(name)
        ends = layout.flange_ends()
        if held is None or ends is None or not self.bodies.shaft:
            return None
        at_bearing = body.mean_shift(held, AXIAL)
        if name == self.bodies.shaft:
            first = min(layout.shaft.segment, key=lambda s: s.z[0])
            radii = (0.5 * first.inner_diameter, 0.5 * first.outer_diameter)
            return at_bearing - body.mean_shift(Face((first.z[0],) * 2, radii), AXIAL)
        return body.mean_shift(flange_back(layout), AXIAL) - at_bearing

    def _seen(self, name: str, sight: SensorSight) -> Array:
        """Contribution of a body (shaft, or housing below it) to the reading of a sensor."""
        body, held = self.bodies.bodies[name], self.holding_seat(name)
        turning = name == self.bodies.shaft
        if not sight.axial:
            if turning:
                return body.mean_shift(body.side_at(sight.z, sight.r), RADIAL)
            return np.zeros(body.basis.N) if sight.mount is None else -body.mean_shift(sight.mount, RADIAL)
        at_bearing = body.mean_shift(held, AXIAL)
        if turning:
            return sight.axial * (body.mean_shift(body.side_at(sight.z, sight.r), AXIAL) - at_bearing)
        behind = flange_back(Layout(self.spec, set())) if sight.mount is None else sight.mount
        return sight.axial * (at_bearing - body.mean_shift(behind, AXIAL))

    def displacements(self, temperature: Array, speed: float) -> dict[str, float]:
        """Reading of every displacement sensor since assembly, m, at a field [K] and a speed [rad/s]."""
        rise = temperature - self.assembly_temperature
        return {
            sight.name: float(row @ rise + spin * speed**2)
            for sight, row, spin in zip(self.sights, *self.sensor_rows, strict=True)
        }

    @cached_property
    def sensor_rows(self) -> tuple[Array, Array]:
        """Reading of every sensor by a kelvin of each unknown (n, n_unknowns), and at 1 rad/s (n,), m s²."""
        nose = min(segment.z[0] for segment in Layout(self.spec, set()).shaft.segment)
        rows, spins = np.zeros((len(self.sights), self.unknowns)), np.zeros(len(self.sights))
        for index, sight in enumerate(self.sights):
            for name, (outputs, weights) in self.carriers.items():
                place = outputs.names.index(sight.key)
                rows[index] += weights[place]
                if name == self.bodies.shaft:
                    spins[index] = outputs.by_spin[place]
            if len(self.bending):
                rows[index] += sight.of_axis(nose) @ self.bending
                if sight.mount is not None and sight.angle is not None:
                    rows[index] -= self._bent_mount(sight)
        return rows, spins

    def _bent_mount(self, sight: SensorSight) -> Array:
        """Shift of a sensor's holder along its direction where the housing bends, (n_unknowns,) m/K.

        From the plane behind the flange; the holder is on the side on which the sensor looks.
        """
        body, (back, mount, turn) = self._bent_housing, self._frame
        z, r = body.middle_of(sight.mount)
        if sight.axial:
            own = sight.axial * (body.mean_shift(sight.mount, (1.0, 0.0, 0.0)) + r * turn)
        else:
            own = body.mean_shift(sight.mount, (0.0, 1.0, 0.0)) - mount - turn * (z - back.z[0])
        sides = self._bent_rows(BodyOutputs.of(body, {sight.key: own}))
        return np.array([math.cos(sight.angle), math.sin(sight.angle)]) @ sides[0]

    @cached_property
    def _bent_housing(self) -> ElasticBody:
        """The housing, its sections shifted sideways."""
        return replace(self.bodies.bodies[self.bodies.housing], harmonic=1)

    @cached_property
    def _frame(self) -> tuple[Face, Array, Array]:
        """The plane behind the flange; its shift sideways and its turn, outputs of the bent housing."""
        body, back = self._bent_housing, flange_back(Layout(self.spec, set()))
        square = 0.5 * (back.r[0] ** 2 + back.r[1] ** 2)
        turn = -body.mean_shift(back, (1.0, 0.0, 0.0), lever=True) / square
        return back, body.mean_shift(back, SIDEWAYS), turn

    def _bent_rows(self, outputs: BodyOutputs) -> Array:
        """Rows (k, 2, n_unknowns) of outputs of the bent housing, up and across each."""
        temperatures, shifts = self.fields[outputs.body.name], outputs.by_temperature()
        return np.stack([temperatures.rows(shifts, around) for around in ("up", "across")], axis=1)

    def _bending(self) -> Array:
        """Rows (4, n_unknowns): nose up, across; tilt up, across. Empty if they are not defined."""
        layout, sets = Layout(self.spec, set()), self.spec.bearing_set
        if len(sets) < 2 or not self.bodies.shaft or layout.flange_ends() is None:
            return np.zeros((0, self.unknowns))
        body, (back, mount, turn) = self._bent_housing, self._frame
        places, shifts = [], []
        for group in (sets[0], sets[-1]):
            names = {bearing.name for bearing in group.bearing}
            own = [s.face for s in self.bodies.seats if s.bearing in names and not s.is_inner]
            places.append(float(np.mean([face.z for face in own])))
            centre = np.mean([body.mean_shift(face, SIDEWAYS) for face in own], axis=0)
            shifts.append(centre - mount - turn * (places[-1] - back.z[0]))
        tilt = (shifts[1] - shifts[0]) / (places[1] - places[0])
        nose = min(segment.z[0] for segment in layout.shaft.segment)
        outputs = BodyOutputs.of(body, {"nose": shifts[0] + tilt * (nose - places[0]), "tilt": tilt})
        return self._bent_rows(outputs).reshape(4, -1)

    def holding_seat(self, carrier: str) -> Face | None:
        """Seat of the bearing that holds the shaft in place."""
        held = holding_bearing(self.spec)
        return next((s.face for s in self.bodies.seats if (s.bearing, s.carrier) == (held, carrier)), None)

    # ------------------------------------------------------------------ seats
    def shifts(self, temperature: Array) -> dict[str, Array]:
        """Shifts of each bearing due to temperature alone, (4,) m, as ``SeatBodies.law`` takes them."""
        rises = self.thermal_rows @ temperature - self._unit_shifts * self._assembled_at[:, None]
        return dict(zip(self.bearings, rises, strict=True))

    @cached_property
    def _unit_shifts(self) -> Array:
        """Shifts (k, 4) of a kelvin everywhere, m/K."""
        return self.thermal_rows.sum(axis=2)

    # ------------------------------------------------------------------ a state
    def at(self, temperature: Array, speed: float, forces: Mapping[str, tuple[float, float]]) -> Growth:
        """Growth at a temperature field (n_unknowns,) [K], a speed [rad/s] and radial ball forces.

        Parameters
        ----------
        forces : mapping of str to (inner, outer), [N]
            Sum of the radial ball loads on both raceways of each bearing.
        """
        seat_shifts = self.seat_rows @ temperature - self.seat_rows.sum(axis=1) * np.repeat(
            self._assembled_at, 2
        )
        now = self._state(np.stack(list(self.shifts(temperature).values())), seat_shifts, speed, forces)
        assembled = self._state(
            np.zeros((len(self.bearings), 4)), 0.0 * seat_shifts, 0.0, self.assembly_forces
        )
        found: dict[tuple[str, Side], SeatState] = {}
        for ring, (pressure, gap, seat, raceway), before in zip(self.rings, now.T, assembled.T, strict=True):
            side: Side = "shaft" if ring.seat.is_inner else "housing"
            found[ring.seat.bearing, side] = SeatState(
                float(pressure), float(gap), float(seat - before[2]), float(raceway - before[3])
            )
        bent = self.bending @ (temperature - self.assembly_temperature)
        radial, tilt = (tuple(pair) for pair in bent.reshape(2, 2).tolist()) if len(bent) else (None, None)
        rise = temperature - self.assembly_temperature
        spacers = {name: float(spacer.length @ rise) for name, spacer in self.spacers.items()}
        return Growth(found, self._nose(temperature, speed), radial, tilt, spacers)

    def pressures(self, temperature: Array, speed: float, forces: Mapping[str, tuple[float, float]]) -> Array:
        """Pressures on the seat and on the raceway of every ring, (2, n) Pa; arguments as of :meth:`at`."""
        thermal = np.stack(list(self.shifts(temperature).values()))
        return self._pressures(thermal, speed, forces)

    def assembled_pressures(self) -> Array:
        """Pressures as assembled."""
        return self._pressures(np.zeros((len(self.bearings), 4)), 0.0, self.assembly_forces)

    def _pressures(self, thermal: Array, speed: float, forces: Mapping[str, tuple[float, float]]) -> Array:
        both = np.array([forces[name] for name in self.bearings])
        law = self.seating.bodies.law(thermal, speed, both[:, 1] - both[:, 0])
        area = np.array([ring.seat.raceway.area for ring in self.rings])
        return np.array([law.seats(both[:, 0])[0], both.ravel() / area])

    def _state(
        self, thermal: Array, seat: Array, speed: float, forces: Mapping[str, tuple[float, float]]
    ) -> Array:
        """Pressure, gap, seat and raceway shift (4, n) of every ring, from no pressure or load."""
        both = np.array([forces[name] for name in self.bearings])
        bodies = self.seating.bodies
        law = bodies.law(thermal, speed, both[:, 1] - both[:, 0])
        pressure, gap = law.seats(both[:, 0])
        outwards = -self.seating.inwards
        spin = np.where(outwards > 0.0, np.repeat(bodies.spin_growth, 2), 0.0)
        raceway = (
            thermal[:, 2:].ravel()
            + spin * speed**2
            + outwards * (bodies.by_pressure.sum(axis=0) * pressure - (bodies.by_load * both).ravel())
        )
        return np.array(
            [
                pressure,
                gap,
                seat + self.seating.spin_of_seats * speed**2 + self.seating.by_seats @ pressure,
                raceway,
            ]
        )

    def _nose(self, temperature: Array, speed: float) -> float | None:
        if self._forward is None:
            return None
        row, spin = self._forward
        return float(row @ (temperature - self.assembly_temperature) + spin * speed**2)

    @cached_property
    def _forward(self) -> tuple[Array, float] | None:
        """Forward shift of the nose by each temperature, (n_unknowns,) m/K, and at 1 rad/s, m s².

        None where it is not defined.
        """
        known = [pair for pair in self.carriers.values() if "forward" in pair[0].names]
        if not known or len(known) < len(self.seating.carriers):
            return None
        turning, _ = self.carriers[self.bodies.shaft]
        rows = sum(rows[outputs.names.index("forward")] for outputs, rows in known)
        return rows, float(turning.by_spin[turning.names.index("forward")])

    @cached_property
    def motions(self) -> Motions:
        """Everything that a machine shows of its growth from outside: the nose, then every sensor."""
        names, blocks, spins = [], [], np.zeros(0)
        if self._forward is not None:
            row, spin = self._forward
            names, blocks, spins = [NOSE[0]], [row[None]], np.array([spin])
        if len(self.bending):
            names, blocks = [*names, *NOSE[1:]], [*blocks, self.bending]
            spins = np.append(spins, np.zeros(len(self.bending)))
        seen, of_seen = self.sensor_rows if self.sights else (np.zeros((0, self.unknowns)), np.zeros(0))
        rows = np.concatenate([*blocks, seen])
        return Motions(
            tuple(names),
            tuple(sight.name for sight in self.sights),
            rows,
            rows.sum(axis=1) * self.assembly_temperature,
            np.concatenate((spins, of_seen)),
        )
