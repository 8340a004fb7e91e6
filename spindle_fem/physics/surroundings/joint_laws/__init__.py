"""Laws of a joint's conductance, one file each; the file's name is ``law`` of a ``joint.conductance``."""

from spindle_fem.registry import registry

JOINT_LAWS = registry(__name__)
