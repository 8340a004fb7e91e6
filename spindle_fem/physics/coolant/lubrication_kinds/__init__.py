"""Kinds of oil lubrication, one file each; the file's name is the value of ``lubrication.kind``.

A kind is a :class:`spindle_fem.physics.coolant.lubrication_kind.LubricationKind`.
"""

from spindle_fem.registry import registry

LUBRICATION_KINDS = registry(__name__)
