"""A helical groove around a sleeve, as around a stator, that the mesh has as a plain cylinder."""

from __future__ import annotations

from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.duct_kinds import DUCT_KINDS
from spindle_fem.physics.coolant.ducts import DuctSection, DuctShape
from spindle_fem.physics.coolant.rectangular_duct import laminar_numbers, required


@DUCT_KINDS.register
def helical_groove(shape: DuctShape) -> DuctSection:
    """Floor and sides of the groove give their heat at the drawn floor, and at the cover where one is drawn.

    >>> section = helical_groove(DuctShape(0.1, 0.06, width=8e-3, depth=5e-3, turns=5.0))
    >>> round(section.path_length, 3), round(section.wetted_ratio, 2)
    (1.65, 1.5)
    """
    required("helical_groove", shape, "width", "depth", "turns")
    pitch = shape.length / shape.turns
    helix = ChannelSection(0.5 * shape.diameter, shape.depth, shape.width, pitch, shape.turns, shape.number)
    nusselt, friction = laminar_numbers(shape.width, shape.depth)
    return DuctSection(
        area=shape.width * shape.depth,
        perimeter=2.0 * (shape.width + shape.depth),
        laminar_nusselt=nusselt,
        laminar_friction=friction,
        paths=shape.number,
        path_length=helix.length,
        wetted_ratio=shape.number * shape.turns * shape.groove_wall / shape.length,
        helix=helix,
    )
