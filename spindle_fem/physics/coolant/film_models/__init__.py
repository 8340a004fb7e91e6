"""Film models of the cooling channel, one file each; the file's name is the value of ``coolant.film_model``.

A model is a function of the flow's groups, or a Nusselt correlation, which
then counts in the band of the helical model too.
"""

from spindle_fem.registry import registry

FILM_MODELS = registry(__name__)
