"""Bearing sets of a machine that grows: friction, ball contacts, joints and preload at any state of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import BearingSet, MachineSpec
from spindle_fem.errors import NoEquilibriumError, OutOfValidityError
from spindle_fem.model.elastic.machine_bodies import machine_bodies
from spindle_fem.model.elastic.ring_seats import RingSeats
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.bearing_heat import BearingMechanics, BearingTemperatures, grows
from spindle_fem.operation.friction_map import FrictionMap, film_temperature
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.seat_joints import SIDES, SeatJoints

Array = NDArray[np.float64]

# Numbers of a bearing's state: temperatures, and shifts where elastic bodies carry its rings.
KELVINS, SHIFTS = 5, 4


@dataclass(frozen=True, slots=True)
class MountedSet:
    """One bearing set and what is worked out of it.

    Attributes
    ----------
    rows : tuple of int
        Its bearings among those of the machine.
    bearings : tuple of str
    joints : tuple of str
        Coefficients of the contacts under its rings that follow their fits.
    """

    name: str
    rows: tuple[int, ...]
    bearings: tuple[str, ...]
    joints: tuple[str, ...]

    @property
    def number(self) -> int:
        """Quantities: three logarithms and the preload of every bearing, the logarithm of every joint."""
        return 4 * len(self.bearings) + len(self.joints)


class MountedStates:
    """Bearing sets of a machine whose preload follows its temperatures.

    Parameters
    ----------
    contacts : sequence of str
        Of its mesh.
    friction : FrictionMap
        The same bearings at the size of assembly: quantities are relative to it.

    Attributes
    ----------
    width : int
        Numbers of one bearing's state, as ``BearingTemperatures.state`` has them.
    """

    def __init__(self, spec: MachineSpec, contacts: Sequence[str], friction: FrictionMap) -> None:
        self.spec, self.contacts, self.friction = spec, tuple(contacts), friction
        elastic = grows(spec)
        self.width = KELVINS + (SHIFTS if elastic else 0)
        seats = RingSeats(spec, machine_bodies(spec)).of_sets(spec) if elastic else None
        self._mechanics = BearingMechanics(spec, seats)
        self._joints = SeatJoints(spec, contacts, self._mechanics.assembled_seats()) if elastic else None
        self._names = [bearing.name for _, bearing in spec.bearings]
        self._factors = np.array([group.heat_factor.value for group, _ in spec.bearings])
        self.sets = tuple(self._set_of(group) for group in spec.bearing_set)

    def _set_of(self, group: BearingSet) -> MountedSet:
        bearings = tuple(bearing.name for bearing in group.bearing)
        rings = {f"{name}.{side}_ring" for name in bearings for side in SIDES}
        known = () if self._joints is None else self._joints.contacts
        own = tuple(f"joint.{contact}" for contact in known if rings & set(contact.split("|")))
        return MountedSet(group.name, tuple(map(self._names.index, bearings)), bearings, own)

    # ------------------------------------------------------------------ states of a model
    def rows(self, model: ThermalModel) -> tuple[Array, Array]:
        """Rows (n_bearings, width, n) and offsets (n_bearings, width): states are ``rows @ u - offsets``.

        ``u`` are the unknowns of a model; temperatures in K, shifts in µm from the assembled state.
        """
        found = np.zeros((len(self._names), self.width, model.size))
        offsets = np.zeros((len(self._names), self.width))
        for index, (group, bearing) in enumerate(self.spec.bearings):
            name = bearing.name
            raceways = [f"{name}.{side}_raceway" for side in SIDES]
            seats = [
                self._beside(f"{name}.{side}_ring") or raceway
                for side, raceway in zip(SIDES, raceways, strict=True)
            ]
            found[index, :KELVINS] = model.place_rows([*raceways, f"{name}.balls", *seats])
            if self.width > KELVINS:
                own = np.asarray(model.ring_shifts[SHIFTS * index : SHIFTS * (index + 1)])
                found[index, KELVINS:] = own
                offsets[index, KELVINS:] = group.assembly_temperature * (own @ model.one)
        return found, offsets

    def _beside(self, ring: str) -> str | None:
        """Place of the model that is the seat of a ring; None for one that is fused."""
        for contact in self.contacts:
            parts = contact.split("|")
            if ring in parts and not contact.endswith(":face"):
                return f"{contact}@{1 - parts.index(ring)}"
        return None

    # ------------------------------------------------------------------ mechanics
    def at(self, speed: float, thrust: float, states: Array) -> dict[str, Array] | None:
        """Quantities of every set at one state of the machine; None where the bearings have no equilibrium.

        Logarithms of friction and of both ball conductances over those at the size of assembly, and the
        preload [N], bearing by bearing; then of the conductance of every joint over that as assembled.

        Parameters
        ----------
        speed : float, [rad/s]
            Above zero.
        states : (n_bearings, width) ndarray
        """
        around = {
            name: BearingTemperatures.of_state(state) for name, state in zip(self._names, states, strict=True)
        }
        point = replace(OperatingPoint.of(self.spec), speed=speed, thrust=thrust)
        try:
            heats, _ = self._mechanics(point, around)
        except (NoEquilibriumError, OutOfValidityError):
            return None
        films = film_temperature(*states[:, :3].T)
        cold = self.friction.at(speed, thrust).at(films[:, None])[:, :, 0]
        cold[:, 0] += np.log(speed * self._factors)
        joints = {} if self._joints is None else self._joints.factors(heats)
        found = {}
        for group in self.sets:
            values = []
            for row, name in zip(group.rows, group.bearings, strict=True):
                heat = heats[name]
                now = np.log((heat.total, heat.conductance_inner, heat.conductance_outer))
                values += [*(now - cold[row]), heat.preload]
            found[group.name] = np.array([*values, *np.log([joints[name] for name in group.joints])])
        return found
