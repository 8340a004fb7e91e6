"""Readings of displacement sensors, as outputs of the elastic bodies.

A reading combines how far the shaft carries the spot from the bearing that holds it, how far the
housing carries that bearing from the sensor's mount, and the shift and tilt of the axis where the
housing bends. A holder on the housing follows the place where it is fixed and does not turn with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.displacement_tables import DisplacementSensor
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import SpecError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.machine.view.part_roles import Layout, require_mounts
from spindle_fem.model.elastic.elastic_body import ElasticBody, Face

Array = NDArray[np.float64]
# Sides of a face that is a plane or a cylinder differ by less than this in z, or in r, m.
_FLAT = 1.0e-6


@dataclass(frozen=True, slots=True)
class SensorSight:
    """Target of a sensor on the shaft, and what the sensor hangs on.

    Attributes
    ----------
    z, r : float, [m]
    angle : float or None, [rad]
        None: all round, where the sensor looks at a whole surface.
    axial : int
        0 for a radial sensor, else the direction along z that counts positive.
    mount : Face or None
        Place on the housing that its holder follows; None: the plane behind the flange.
    hangs_at : (z, r) or None, [m]
        That place where it is a single spot.
    """

    name: str
    z: float
    r: float
    angle: float | None
    axial: int
    mount: Face | None = None
    hangs_at: tuple[float, float] | None = None

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


def sensor_sights(spec: MachineSpec, mesh: TaggedMesh, housing: ElasticBody) -> tuple[SensorSight, ...]:
    """Every displacement sensor of a machine.

    Raises
    ------
    SpecError
        A mount that is a segment, but not the flange, or a surface of several faces; a machine without a
        flange whose sensor hangs on it.
    """
    layout = Layout(spec, set())
    require_mounts(layout)
    return tuple(_sight(sensor, layout, mesh, housing) for sensor in spec.displacement_sensor)


def _mount(sensor: DisplacementSensor, layout: Layout, mesh: TaggedMesh, housing: ElasticBody) -> Face | None:
    where = f"displacement_sensor.{sensor.name}.mount"
    if not isinstance(sensor.mount, str):
        return housing.side_at(sensor.mount.z, sensor.mount.radius)
    if sensor.mount in {surface.name for surface in layout.spec.surface}:
        x, y, z = mesh.points[mesh.require_surface(sensor.mount, sensor.name)[:, :3]].reshape(-1, 3).T
        bounds = [(float(values.min()), float(values.max())) for values in (z, np.hypot(x, y))]
        if min(high - low for low, high in bounds) > _FLAT:
            raise SpecError(
                where,
                f'"{sensor.mount}" is more than one plane or cylinder.',
                "Give z and radius of the spot on it to which the sensor is fixed.",
            )
        return Face(*bounds)
    return None


def _sight(sensor: DisplacementSensor, layout: Layout, mesh: TaggedMesh, housing: ElasticBody) -> SensorSight:
    mount = _mount(sensor, layout, mesh, housing)
    behind = max(layout.flange_ends()) if mount is None else housing.middle_of(mount)[0]
    if isinstance(sensor.at, str):
        x, y, along = mesh.points[mesh.require_surface(sensor.at, sensor.name)[:, :3]].mean(axis=1).T
        z, r, angle = float(along.mean()), float(np.hypot(x, y).mean()), None
    else:
        z, r, angle = sensor.at.z, sensor.at.radius, sensor.at.angle
    away = 1 if z > behind else -1
    spot = None if isinstance(sensor.mount, str) else (sensor.mount.z, sensor.mount.radius)
    return SensorSight(sensor.name, z, r, angle, away if sensor.direction == "axial" else 0, mount, spot)
