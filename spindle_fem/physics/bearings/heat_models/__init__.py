"""Heat models of a bearing, one file each; the file's name is the value of ``heat.model``.

A model but ``table`` is a function of a bearing's equilibrium, made by
:func:`spindle_fem.physics.bearings.heat_model.friction_model`.
"""

from spindle_fem.registry import registry

HEAT_MODELS = registry(__name__)
