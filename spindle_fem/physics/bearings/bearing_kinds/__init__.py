"""Kinds of ball bearing, one file each; the file's name is the value of ``bearing_types.NAME.kind``."""

from spindle_fem.registry import registry

BEARING_KINDS = registry(__name__)
