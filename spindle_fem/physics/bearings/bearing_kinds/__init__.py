"""Kinds of bearing, one file each; the file's name is the value of ``bearing_types.NAME.kind``.

A name that ends in ``_roller`` is that of a :class:`RollerKind`, all others of a :class:`BearingKind`
with balls: the name alone decides, so that reading a definition loads no kind.
"""

from spindle_fem.registry import registry

BEARING_KINDS = registry(__name__)
