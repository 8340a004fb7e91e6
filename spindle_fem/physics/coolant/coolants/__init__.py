"""Coolants, one file each; the file's name is the value of ``coolant.fluid``."""

from spindle_fem.registry import registry

COOLANTS = registry(__name__)
