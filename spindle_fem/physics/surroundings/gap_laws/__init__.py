"""Laws of an air gap around the shaft, one file each; the file's name is the value of ``gap.kind``.

A law is a function of an :class:`spindle_fem.physics.surroundings.air_gaps.AirGap`.
"""

from spindle_fem.registry import registry

GAP_LAWS = registry(__name__)
