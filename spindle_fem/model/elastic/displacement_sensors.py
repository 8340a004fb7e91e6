"""Readings of displacement sensors on the flange, as outputs of the elastic bodies.

A reading combines how far the shaft carries the spot from the bearing that holds it, how far the
housing carries that bearing from the flange, and the shift and tilt of the axis where the housing bends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import DisplacementSensor, MachineSpec
from spindle_fem.errors import SpecError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.machine.view.part_roles import Layout

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SensorSight:
    """Target of a sensor on the shaft, seen from the flange.

    Attributes
    ----------
    z, r : float, [m]
    angle : float or None, [rad]
        None: all round, where the sensor looks at a whole surface.
    axial : int
        0 for a radial sensor, else the direction along z that counts positive.
    """

    name: str
    z: float
    r: float
    angle: float | None
    axial: int

    @property
    def key(self) -> str:
        """Its name among the outputs of the bodies."""
        return f"sensor.{self.name}"

    def of_axis(self, nose: float) -> Array:
        """Shares (4,) of the axis's shift at ``nose`` (z in m) and tilt, up and across each, in a reading."""
        if self.angle is None:
            return np.zeros(4)
        sides = np.array([math.cos(self.angle), math.sin(self.angle)])
        if self.axial:
            return np.concatenate([np.zeros(2), -self.axial * self.r * sides])
        return np.concatenate([sides, (self.z - nose) * sides])


def sensor_sights(spec: MachineSpec, mesh: TaggedMesh) -> tuple[SensorSight, ...]:
    """Every displacement sensor of a machine.

    Raises
    ------
    SpecError
        A mount that is not the flange.
    """
    layout = Layout(spec, set())
    return tuple(_sight(sensor, layout, mesh) for sensor in spec.displacement_sensor)


def _sight(sensor: DisplacementSensor, layout: Layout, mesh: TaggedMesh) -> SensorSight:
    ends = layout.flange_ends()
    if ends is None or sensor.mount != layout.flange:
        raise SpecError(
            f"displacement_sensor.{sensor.name}.mount",
            f'"{sensor.mount}" is not the flange of the housing.',
            f"Allowed: {layout.flange}." if layout.flange else "Sensors need a housing with a flange.",
        )
    if isinstance(sensor.at, str):
        x, y, along = mesh.points[mesh.require_surface(sensor.at, sensor.name)[:, :3]].mean(axis=1).T
        z, r, angle = float(along.mean()), float(np.hypot(x, y).mean()), None
    else:
        z, r, angle = sensor.at.z, sensor.at.radius, sensor.at.angle
    away = 1 if z > max(ends) else -1
    return SensorSight(sensor.name, z, r, angle, away if sensor.direction == "axial" else 0)
