"""The finite elements alone: a hollow cylinder between two films, by the package's forms and scikit-fem.

Nothing but the forms is taken from the package: mesh, basis, assembly and solution are scikit-fem's. The
temperature is held against the exact one, which falls with the logarithm of the radius.
"""

from dataclasses import replace

import numpy as np
from skfem import Basis, ElementTriP2, FacetBasis, MeshTri, MeshTri2, solve

from spindle_fem.model.mesh.forms import conduction, film, source

INNER, OUTER = 0.025, 0.060  # m
CONDUCTIVITY = 42.0  # W/(m·K)
OIL, AIR = (800.0, 60.0), (25.0, 20.0)  # film coefficient W/(m²·K), temperature °C

# A quarter of the ring: quadratic triangles laid out over radius and angle, then bent.
flat = MeshTri2.from_mesh(
    MeshTri.init_tensor(np.linspace(INNER, OUTER, 13), np.linspace(0.0, np.pi / 2.0, 25))
)
radius, angle = flat.doflocs
mesh = replace(flat, doflocs=np.array([radius * np.cos(angle), radius * np.sin(angle)])).with_boundaries(
    {
        "inside": lambda x: np.hypot(*x) < INNER + 1e-3,
        "outside": lambda x: np.hypot(*x) > OUTER - 1e-3,
    }
)

# Conduction in the ring, a film on each wall; the two cuts are symmetry planes and need nothing.
body = Basis(mesh, ElementTriP2())
matrix, load = CONDUCTIVITY * conduction.assemble(body), body.zeros()
for wall, (coefficient, fluid) in {"inside": OIL, "outside": AIR}.items():
    surface = FacetBasis(mesh, ElementTriP2(), facets=wall)
    matrix += coefficient * film.assemble(surface)
    load += coefficient * fluid * source.assemble(surface)
temperature = solve(matrix, load)

# Exact: three resistances in series for a metre of the whole ring.
resistances = [
    1.0 / (2.0 * np.pi * INNER * OIL[0]),
    np.log(OUTER / INNER) / (2.0 * np.pi * CONDUCTIVITY),
    1.0 / (2.0 * np.pi * OUTER * AIR[0]),
]
heat = (OIL[1] - AIR[1]) / sum(resistances)
distance = np.hypot(*body.doflocs)
exact = OIL[1] - heat * (resistances[0] + np.log(distance / INNER) / (2.0 * np.pi * CONDUCTIVITY))

error = np.abs(temperature - exact).max()
print(f"{heat:.1f} W/m; wall {temperature.max():.3f} to {temperature.min():.3f} degC, error {error:.1e} K")
assert error < 1e-4
