"""Natural convection by the shape of a surface, one file each; the file's name is ``film.orientation``.

Each is the Nusselt number of a Rayleigh and a Prandtl number on one length.
"""

from spindle_fem.registry import registry

NATURAL_FILMS = registry(__name__)
