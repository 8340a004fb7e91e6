"""Ducts that a circuit flows through, one file each; the file's name is the value of ``film.duct``.

A kind is a function of a :class:`spindle_fem.physics.coolant.ducts.DuctShape`, which gives a ``DuctSection``.
"""

from spindle_fem.registry import registry

DUCT_KINDS = registry(__name__)
