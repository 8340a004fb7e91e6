"""The coolant's march along the channel as small linear maps.

At given film coefficients the bulk temperature is linear in wall and inlet
temperature. Eliminating it adds to the reduced operator a matrix that is not
symmetric (a cell feels those upstream) and of low rank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.physics.coolant.linear_march import march_maps

Array = NDArray[np.float64]

COMPLEX_STEP = 1e-30


@dataclass(frozen=True, slots=True)
class CoolantMaps:
    """Coolant of one operating class in reduced coordinates.

    Attributes
    ----------
    conduction : (r, r) ndarray, [W/K]
        Channel film with the coolant eliminated.
    inlet_load : (r,) ndarray, [W/K]
        Heat into the wall for each kelvin of the inlet.
    constant_load : (r,) ndarray, [W]
        From friction heat in the coolant.
    outlet : (r,) ndarray
        Outlet temperature from the reduced unknowns.
    outlet_inlet, outlet_constant : float
        Share of the inlet temperature in it, and K from friction heat.
    """

    conduction: Array
    inlet_load: Array
    constant_load: Array
    outlet: Array
    outlet_inlet: float
    outlet_constant: float


def coolant_maps(
    model: ThermalModel, film: Array, capacity_rate: float, pumping_heat: float = 0.0
) -> CoolantMaps:
    """Maps of given films.

    Parameters
    ----------
    film : (n_cells,) ndarray, [W/(m²·K)]
        May be complex, for derivatives.
    capacity_rate : float, [W/K]
        Mass flow times heat capacity of each start.
    pumping_heat : float, [W]
        Friction heat of all starts, spread over the wetted area.
    """
    area, wetted = model.cell_area.ravel(), model.cell_area
    starts = len(wetted)
    friction = pumping_heat / starts * wetted / wetted.sum(axis=1, keepdims=True)
    maps = march_maps(capacity_rate, wetted, film.reshape(wetted.shape), friction)
    bulk_wall = block_diag(*maps.bulk_from_wall)
    load = model.cell_load
    weighted = film[:, None] * load
    conduction = np.tensordot(film, model.cell_film, axes=1) - weighted.T @ (
        bulk_wall @ (load / area[:, None])
    )
    return CoolantMaps(
        conduction,
        weighted.T @ maps.bulk_from_inlet.ravel(),
        weighted.T @ maps.bulk_from_friction.ravel(),
        (maps.outlet_from_wall.ravel() / starts / area) @ load,
        maps.outlet_from_inlet.mean(),
        maps.outlet_from_friction.mean(),
    )


def film_derivative(
    model: ThermalModel, film: Array, capacity_rate: float, pumping_heat: float = 0.0
) -> CoolantMaps:
    """Derivative of :func:`coolant_maps` to the logarithm of a factor on the film, by a complex step."""
    maps = coolant_maps(model, film * (1.0 + 1j * COMPLEX_STEP), capacity_rate, pumping_heat)
    return CoolantMaps(*(np.imag(getattr(maps, name)) / COMPLEX_STEP for name in CoolantMaps.__slots__))


# Spacing of nodes in the logarithm of film over capacity rate, and nodes per interpolation.
SPACING, STENCIL = 0.05, 10
# Interpolations that are kept, for the classes of a run.
MOST_STENCILS = 8


class UniformFilmMaps:
    """Maps for films that are the same in every cell, interpolated between some that are worked out once.

    With a film h and a capacity rate C they depend on h / C alone, but for a
    factor of C or of the friction heat: one variable, whose logarithm carries
    polynomials of degree nine through even nodes.
    """

    def __init__(self, model: ThermalModel) -> None:
        self._model = model
        self._nodes: dict[int, Array] = {}
        self._stencils: dict[int, Array] = {}

    def maps(self, film: float, capacity_rate: float, pumping_heat: float = 0.0) -> CoolantMaps:
        """Interpolate :func:`coolant_maps`, to 1e-8 of the largest up to some ten units of transfer."""
        at, stencil = self._place(film, capacity_rate)
        return self._scaled(_lagrange(at) @ stencil, capacity_rate, pumping_heat)

    def film_derivative(self, film: float, capacity_rate: float, pumping_heat: float = 0.0) -> CoolantMaps:
        """Interpolate :func:`film_derivative`: the derivative of what :meth:`maps` interpolates."""
        at, stencil = self._place(film, capacity_rate)
        return self._scaled(_lagrange_slope(at) / SPACING @ stencil, capacity_rate, pumping_heat)

    def _place(self, film: float, capacity_rate: float) -> tuple[float, Array]:
        """Position of a film in its stencil, in nodes, and the maps at the nodes (STENCIL, n)."""
        position = float(np.log(film / capacity_rate)) / SPACING
        first = int(np.floor(position)) - STENCIL // 2 + 1
        if first not in self._stencils:
            for node in range(first, first + STENCIL):
                if node not in self._nodes:
                    self._nodes[node] = self._worked_out(node)
            if len(self._stencils) >= MOST_STENCILS:
                self._stencils.clear()
            self._stencils[first] = np.array([self._nodes[first + i] for i in range(STENCIL)])
        return position - first, self._stencils[first]

    def _worked_out(self, node: int) -> Array:
        film = np.full(self._model.cell_area.size, np.exp(SPACING * node))
        maps = coolant_maps(self._model, film, 1.0, 1.0)
        parts = (getattr(maps, name) for name in CoolantMaps.__slots__)
        return np.concatenate([np.ravel(part) for part in parts])

    def _scaled(self, values: Array, capacity_rate: float, pumping_heat: float) -> CoolantMaps:
        size = self._model.cell_load.shape[1]
        conduction, inlet, constant, outlet, rest = np.split(
            values, np.cumsum([size * size, size, size, size])
        )
        return CoolantMaps(
            capacity_rate * conduction.reshape(size, size),
            capacity_rate * inlet,
            pumping_heat * constant,
            outlet,
            float(rest[0]),
            float(rest[1]) * pumping_heat / capacity_rate,
        )


_EVEN = np.arange(STENCIL)
# All nodes but one, (STENCIL, STENCIL - 1), and but one more of these, (STENCIL, STENCIL - 1, STENCIL - 2).
_OTHERS = np.array([np.delete(_EVEN, i) for i in _EVEN])
_BUT_TWO = np.array([[np.delete(_EVEN, [i, j]) for j in _EVEN if j != i] for i in _EVEN])
_SCALE = np.prod(_EVEN[:, None] - _OTHERS, axis=1).astype(float)


def _lagrange(at: float) -> Array:
    """Weights of even nodes 0, 1, 2, ... for the value in between, (STENCIL,).

    >>> bool(abs(_lagrange(3.4) @ _EVEN**3 - 3.4**3) < 1e-12)
    True
    """
    return (at - _OTHERS).prod(axis=1) / _SCALE


def _lagrange_slope(at: float) -> Array:
    """Weights of even nodes for the slope, (STENCIL,).

    >>> bool(abs(_lagrange_slope(3.4) @ _EVEN**3 - 3.0 * 3.4**2) < 1e-12)
    True
    """
    return (at - _BUT_TWO).prod(axis=2).sum(axis=1) / _SCALE
