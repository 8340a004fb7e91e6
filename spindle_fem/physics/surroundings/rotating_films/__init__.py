"""Films of rotating surfaces in still air, one file each; the file's name is ``film.correlation``."""

from spindle_fem.registry import registry

ROTATING_FILMS = registry(__name__)
