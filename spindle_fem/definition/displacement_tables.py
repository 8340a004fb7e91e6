"""Displacement sensors of a machine definition."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Tag

from spindle_fem.definition.field_types import Angle, Length, Name, Radius, SpecModel

# Mount on a stand beside the machine, on what the flange is bolted to.
FRAME = "frame"


def _named_or_spot(given: Any) -> str:
    return "name" if isinstance(given, str) else "spot"


class SensorSpot(SpecModel):
    """A spot on the outside of the turning body."""

    z: Length
    """Along the axis."""
    radius: Radius
    """Distance from the axis."""
    angle: Angle = 0.0
    """Around the axis; 0 is up."""


class MountSpot(SpecModel):
    """A spot on the outside of what stands, on the side on which the sensor looks."""

    z: Length
    """Along the axis."""
    radius: Radius
    """Distance from the axis."""


class DisplacementSensor(SpecModel):
    """A displacement sensor on the machine's mount that reads the shaft.

    Its reading is the movement of the shaft since assembly, by temperature and rotation.
    """

    name: Name
    """Name in results and recordings."""
    at: Annotated[
        Annotated[Name, Tag("name")] | Annotated[SensorSpot, Tag("spot")], Discriminator(_named_or_spot)
    ]
    """Target: a surface of the shaft, or a spot on it."""
    direction: Literal["axial", "radial"]
    """Axial readings grow away from the mount, radial ones outwards."""
    mount: Annotated[
        Annotated[Name, Tag("name")] | Annotated[MountSpot, Tag("spot")], Discriminator(_named_or_spot)
    ] = "flange"
    """What holds the sensor: the housing's segment that is its flange (the widest, by at least a tenth), or
    ``frame``, a stand on what the flange is bolted to (both count from that plane); a surface of a standing
    part, one plane or cylinder, or a spot on it, which the holder follows without turning."""
