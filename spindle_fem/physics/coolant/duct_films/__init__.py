"""Film laws of straight ducts, one file each; the file's name is the value of ``film.law``.

A law is a function of a :class:`spindle_fem.physics.coolant.ducts.DuctFlow`.
"""

from spindle_fem.registry import registry

DUCT_FILMS = registry(__name__)
