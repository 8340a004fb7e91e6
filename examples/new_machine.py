"""A new machine written in Python: tables as the definition file has them, checked all at once, then solved."""

import spindle_fem
from spindle_fem.errors import FaultsError

SHAFT, HOUSING = "steel_shaft", "steel_housing"


def ring(name, inner, outer, *z):
    """A segment between two diameters."""
    return {"name": name, "z": list(z), "inner_diameter": inner, "outer_diameter": outer}


STEEL = {"density": "7850 kg/m**3", "specific_heat_capacity": "470 J/kg/K"}
