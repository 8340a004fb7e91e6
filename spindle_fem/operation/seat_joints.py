"""Conductance of the seats of rings as their fits press or open, relative to the assembled state."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.geometry.joint_groups import group_of_contacts
from spindle_fem.operation.loads import BearingHeat
from spindle_fem.physics.surroundings.joint_laws.tight_seat import seat_conductance

SIDES = ("inner", "outer")


@dataclass(frozen=True, slots=True)
class _Joint:
    """One contact: its ring, the surfaces, and the law's value as assembled, W/(m²·K)."""

    bearing: str
    side: int
    surfaces: Mapping[str, float]
    assembled: float


class SeatJoints:
    """Joints of a machine that follow their fits.

    Parameters
    ----------
    contacts : iterable of str
        Of the mesh.
    assembled : mapping of bearing to ((pressure, gap), (pressure, gap))
        Of the inner and the outer seat, Pa and m.
    """

    def __init__(
        self,
        spec: MachineSpec,
        contacts: Iterable[str],
        assembled: Mapping[str, tuple[tuple[float, float], ...]],
    ) -> None:
        self._joints: dict[str, _Joint] = {}
        groups = group_of_contacts(spec, contacts)
        for contact, group in groups.items():
            # plane faces are pressed by the locknut, not by the fit
            if group.seat is None or group.conductance == "perfect" or contact.endswith(":face"):
                continue
            parts = contact.split("|")
            for bearing, seats in assembled.items():
                for side, (pressure, gap) in enumerate(seats):
                    if f"{bearing}.{SIDES[side]}_ring" not in parts:
                        continue
                    conductivities = [spec.part_material(part).thermal_conductivity for part in parts]
                    surfaces = {
                        "conductivity": 2.0 / sum(1.0 / value for value in conductivities),
                        "roughness": group.seat.roughness,
                        "slope": group.seat.slope,
                        "microhardness": group.seat.microhardness,
                    }
                    value = float(seat_conductance(pressure, radial_gap=gap, **surfaces))
                    self._joints[contact] = _Joint(bearing, side, surfaces, value)

    @property
    def contacts(self) -> tuple[str, ...]:
        """Contacts that follow their fits."""
        return tuple(self._joints)

    def factors(self, heats: Mapping[str, BearingHeat]) -> dict[str, float]:
        """Factor on the conductance of every such joint, by its coefficient's name."""
        found = {}
        for contact, joint in self._joints.items():
            heat = heats[joint.bearing]
            if heat.seat_pressure is None or heat.seat_gap is None:
                continue
            value = seat_conductance(
                heat.seat_pressure[joint.side], radial_gap=heat.seat_gap[joint.side], **joint.surfaces
            )
            found[f"joint.{contact}"] = float(value) / joint.assembled
        return found
