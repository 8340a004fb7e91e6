"""Rings on the bodies that carry them: how every seat of a machine yields and grows, without a thermal mesh.

Shaft and housing are solved once for the mean radial shift of each seat, every ring for those of its
seat and its raceway. Seats of one body yield together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.solid_tables import Fit
from spindle_fem.model.elastic.growth_outputs import RADIAL, BodyOutputs
from spindle_fem.model.elastic.machine_bodies import MachineBodies, Seat
from spindle_fem.physics.bearings.seat_contact import SeatBodies

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Ring:
    """A ring between its seat and its balls; outputs are the shifts of seat and raceway."""

    seat: Seat
    outputs: BodyOutputs

    @property
    def areas(self) -> Array:
        """Areas of seat and raceway, signed: pressure pushes the outside inwards."""
        outwards = 1.0 if self.seat.is_inner else -1.0
        return np.array([outwards * self.seat.face.area, -outwards * self.seat.raceway.area])


class RingSeats:
    """Every ring of a machine on its seat: inner and outer of each bearing in turn.

    Attributes
    ----------
    rings : tuple of Ring
    carriers : mapping of body to BodyOutputs
        Shifts of the seats on shaft and housing, by the names of their rings.
    bearings : tuple of str
    inwards : (n,) ndarray
        Which way a gap opens by its seat's shift outwards: -1 on the shaft, +1 in the housing.
    bodies : SeatBodies
    by_seats : (n, n) ndarray, [m/Pa]
        Shift of every seat of shaft and housing by a pressure in each.
    spin_of_seats : (n,) ndarray, [m s²]
        Shift of the same at 1 rad/s.
    """

    def __init__(self, spec: MachineSpec, bodies: MachineBodies) -> None:
        self._machine = bodies
        self.rings = tuple(self._ring(seat) for seat in bodies.seats)
        self.carriers = {name: self._carrier(name) for name in (bodies.shaft, bodies.housing) if name}
        self.bearings = tuple(dict.fromkeys(ring.seat.bearing for ring in self.rings))
        self.inwards = np.array([-1.0 if ring.seat.is_inner else 1.0 for ring in self.rings])
        fits = {bearing.name: group.fit for group, bearing in spec.bearings}
        self._clearance = np.array([_clearance(fits[ring.seat.bearing], ring.seat) for ring in self.rings])
        count = len(self.rings)
        self.by_seats, self.spin_of_seats = np.zeros((count, count)), np.zeros(count)
        areas = np.array([ring.seat.face.area for ring in self.rings])
        for name, outputs in self.carriers.items():
            own = self.seats_on(name)
            self.by_seats[np.ix_(own, own)] = outputs.compliance(areas[own]) * self.inwards[own]
            if name == bodies.shaft:
                self.spin_of_seats[own] = outputs.by_spin

    def _ring(self, seat: Seat) -> Ring:
        body = self._machine.bodies[seat.ring]
        faces = {"seat": seat.face, "raceway": seat.raceway}
        return Ring(
            seat,
            BodyOutputs.of(body, {key: body.mean_shift(face, RADIAL) for key, face in faces.items()}),
        )

    def _carrier(self, name: str) -> BodyOutputs:
        body = self._machine.bodies[name]
        own = [seat for seat in self._machine.seats if seat.carrier == name]
        return BodyOutputs.of(body, {seat.ring: body.mean_shift(seat.face, RADIAL) for seat in own})

    def seats_on(self, carrier: str) -> list[int]:
        """Indices of the rings that sit on a body, in the order of its outputs."""
        return [i for i, ring in enumerate(self.rings) if ring.seat.carrier == carrier]

    @cached_property
    def bodies(self) -> SeatBodies:
        """Compliance of all seats, in the order of the rings."""
        count, inwards = len(self.rings), self.inwards
        bearing = np.arange(count) // 2
        own = np.array([ring.outputs.compliance(ring.areas) for ring in self.rings])
        by_load = own[:, :, 1] / np.array([ring.seat.raceway.area for ring in self.rings])[:, None]
        turning = np.where(inwards < 0.0, 1.0, 0.0)
        rings_spin = turning[:, None] * np.array([ring.outputs.by_spin for ring in self.rings])
        by_force, by_pressure = np.zeros((count, count // 2)), np.zeros((count // 2, count))
        by_force[np.arange(count), bearing] = -inwards * by_load[:, 0]
        by_pressure[bearing, np.arange(count)] = -inwards * own[:, 1, 0]
        return SeatBodies(
            self._clearance,
            inwards[:, None] * self.by_seats - np.diag(inwards * own[:, 0, 0]),
            by_force,
            np.array([ring.seat.face.area for ring in self.rings]),
            by_pressure,
            (inwards * by_load[:, 1]).reshape(-1, 2),
            inwards * (self.spin_of_seats - rings_spin[:, 0]),
            rings_spin[::2, 1],
            np.array([ring.seat.raceway.r[0] for ring in self.rings]).reshape(-1, 2),
        )

    def of_set(self, names: Sequence[str]) -> SeatBodies:
        """Seats of a set; what the seats of other sets press on the same bodies is left out."""
        return self.bodies.of([self.bearings.index(name) for name in names])

    def of_sets(self, spec: MachineSpec) -> dict[str, SeatBodies]:
        """Seats of every bearing set that has fits."""
        return {
            group.name: self.of_set([bearing.name for bearing in group.bearing])
            for group in spec.bearing_set
            if group.fit is not None
        }

    def thermal_rows(self, seat_rows: Array, ring_rows: Array) -> Array:
        """Rows (k, 4, m) whose products with temperatures are shifts, as ``SeatBodies.law`` takes them.

        Parameters
        ----------
        seat_rows : (2k, m) ndarray, [m/K]
            Shift of shaft or housing under every ring by each of m temperatures.
        ring_rows : (2k, 2, m) ndarray, [m/K]
            Shift of every ring's own seat face and raceway.
        """
        pairs = (len(self.rings) // 2, 2, seat_rows.shape[-1])
        rows = np.empty((pairs[0], 4, pairs[2]))  # filled in place: they are large
        np.subtract(seat_rows.reshape(pairs), ring_rows[:, 0].reshape(pairs), out=rows[:, :2])
        rows[:, :2] *= self.inwards.reshape(-1, 2, 1)
        rows[:, 2:] = ring_rows[:, 1].reshape(pairs)
        return rows

    def rows_over(self, values: Mapping[str, Array | sparse.csr_array]) -> tuple[Array, Array]:
        """Seat and ring rows, as :meth:`thermal_rows` takes them, over m temperatures.

        Parameters
        ----------
        values : mapping of body to (n_corners, m) ndarray or sparse array
            Temperature at every corner of the body's section by each of them.
        """

        def gathered(outputs: BodyOutputs) -> Array:
            return outputs.by_temperature() @ values[outputs.body.name]

        size = next(iter(values.values())).shape[1]
        seats = np.zeros((len(self.rings), size))
        for name, outputs in self.carriers.items():
            seats[self.seats_on(name)] = gathered(outputs)
        return seats, np.array([gathered(ring.outputs) for ring in self.rings])


def _clearance(fit: Fit | None, seat: Seat) -> float:
    """Radial clearance of a ring on its seat as assembled, m; a set without a fit just touches."""
    if fit is None:
        return 0.0
    return 0.5 * (-fit.inner_interference if seat.is_inner else fit.outer_clearance)
