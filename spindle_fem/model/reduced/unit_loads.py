"""Loads whose solutions a reduced basis is made from, each as large as it occurs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.thermal_model import ThermalModel

Array = NDArray[np.float64]

# Friction heat of one place [W], rise of a fluid [K].
FRICTION_HEAT, FLUID_RISE = 80.0, 10.0


def friction_loads(model: ThermalModel, groups: Sequence[Sequence[str]], ends: Sequence[str]) -> Array:
    """Friction heat of each group of bearings on each of some ends, (n, groups · ends) [W].

    Parameters
    ----------
    groups : sequence of sequence of str
        Bearings that heat together.
    ends : sequence of str
        Of ``inner_raceway``, ``outer_raceway``, ``balls``.
    """
    columns = [
        FRICTION_HEAT * model.place_rows([f"{name}.{end}" for name in group]).sum(axis=0)
        for group in groups
        for end in ends
    ]
    return np.array(columns).reshape(-1, model.size).T


def fluid_loads(model: ThermalModel, coefficients: Mapping[str, float], *, together: bool) -> Array:
    """Films to fluids of 10 K, each alone or all at once, (n, m) [W]."""
    values = np.array([coefficients[name] for name in model.fluid_names])
    columns = FLUID_RISE * values[:, None] * model.fluid_load
    if together and len(columns):
        columns = columns.sum(axis=0, keepdims=True)
    return columns.reshape(-1, model.size).T


def coolant_loads(model: ThermalModel, film: Array, degree: int) -> Array:
    """Coolant of 10 K in polynomial shapes along each start, (n, m) [W].

    Parameters
    ----------
    film : (n_cells,) ndarray, [W/(m²·K)]
    degree : int
        Highest, of Legendre polynomials.
    """
    if not model.cell_area.size:
        return np.zeros((model.size, 0))
    profiles = FLUID_RISE * helix_profiles(*model.cell_area.shape, degree)
    return np.asarray(model.cell_load.T @ (film[:, None] * profiles))


def helix_profiles(n_starts: int, n_along: int, degree: int) -> Array:
    """Bulk temperature shapes along each start, Legendre polynomials, (n_cells, m)."""
    along = (np.arange(n_along) + 0.5) / n_along * 2.0 - 1.0
    shapes = np.polynomial.legendre.legvander(along, degree)
    profiles = np.zeros((n_starts * n_along, n_starts * (degree + 1)))
    for start in range(n_starts):
        rows = slice(start * n_along, (start + 1) * n_along)
        profiles[rows, start * (degree + 1) : (start + 1) * (degree + 1)] = shapes
    return profiles
