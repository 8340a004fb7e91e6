"""The coolant's march along the channel as small linear maps.

At given film coefficients the bulk temperature is linear in wall and inlet
temperature. Eliminating it adds to the reduced operator a matrix that is not
symmetric (a cell feels those upstream) and of low rank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.reduced.model import ReducedModel

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
    model: ReducedModel, film: Array, capacity_rate: float, pumping_heat: float = 0.0
) -> CoolantMaps:
    """Maps of given films.

    Parameters
    ----------
    model : ReducedModel
    film : (n_cells,) ndarray, [W/(m²·K)]
        May be complex, for derivatives.
    capacity_rate : float, [W/K]
        Mass flow times heat capacity of each start.
    pumping_heat : float, [W]
        Friction heat of all starts, spread over the wetted area.
    """
    shape = model.cell_area.shape
    area = model.cell_area.ravel()
    bulk_wall, bulk_inlet, bulk_friction, outlet = _march(
        film.reshape(shape), model.cell_area, capacity_rate, pumping_heat
    )
    load = model.cell_load
    weighted = film[:, None] * load
    conduction = np.tensordot(film, model.cell_film, axes=1) - weighted.T @ (
        bulk_wall @ (load / area[:, None])
    )
    return CoolantMaps(
        conduction,
        weighted.T @ bulk_inlet,
        weighted.T @ bulk_friction,
        (outlet[0] / area) @ load,
        outlet[1],
        outlet[2],
    )


def film_derivative(
    model: ReducedModel, film: Array, capacity_rate: float, pumping_heat: float = 0.0
) -> CoolantMaps:
    """Derivative of :func:`coolant_maps` to the logarithm of a factor on the film, by a complex step."""
    maps = coolant_maps(model, film * (1.0 + 1j * COMPLEX_STEP), capacity_rate, pumping_heat)
    return CoolantMaps(*(np.imag(getattr(maps, name)) / COMPLEX_STEP for name in CoolantMaps.__slots__))


def flow_derivative(
    model: ReducedModel, film: Array, film_slope: float, capacity_rate: float, pumping_heat: float = 0.0
) -> CoolantMaps:
    """Derivative to the logarithm of the flow; ``film_slope`` is d ln(film) / d ln(flow)."""
    step = 1j * COMPLEX_STEP
    maps = coolant_maps(model, film * (1.0 + film_slope * step), capacity_rate * (1.0 + step), pumping_heat)
    return CoolantMaps(*(np.imag(getattr(maps, name)) / COMPLEX_STEP for name in CoolantMaps.__slots__))


def _march(
    film: Array, area: Array, capacity_rate: complex, pumping_heat: float
) -> tuple[Array, Array, Array, tuple[Array, complex, complex]]:
    """Plug flow with exponential cells: bulk from wall, inlet and friction; the same for the mixed outlet."""
    n_starts, n = film.shape
    kind = np.result_type(film, np.asarray(capacity_rate))
    bulk_wall = np.zeros((n_starts * n, n_starts * n), kind)
    bulk_inlet = np.zeros(n_starts * n, kind)
    bulk_friction = np.zeros(n_starts * n, kind)
    outlet_wall = np.zeros(n_starts * n, kind)
    outlet_inlet = outlet_friction = 0.0
    for start in range(n_starts):
        units = film[start] * area[start] / capacity_rate
        # The mean of e^-x over a cell; a cell with no area passes the coolant on unchanged.
        reached = 1.0 - np.exp(-units)
        mean = np.where(np.abs(units) > 1e-8, reached / np.where(units == 0.0, 1.0, units), 1.0 - 0.5 * units)
        second = np.where(
            np.abs(units) > 1e-4, (1.0 - mean) / np.where(units == 0.0, 1.0, units), 0.5 - units / 6.0
        )
        friction = pumping_heat / n_starts * area[start] / area[start].sum() / capacity_rate
        passed = np.cumsum(units)
        before = passed - units
        own = slice(start * n, (start + 1) * n)
        lower = np.tril(np.ones((n, n)), -1)
        # What is left at the inlet of cell i of what the coolant took up in cell j < i.
        left = lower * np.exp(lower * (passed[None, :] - before[:, None]))
        bulk_wall[own, own] = mean[:, None] * left * reached + np.diag(1.0 - mean)
        at_inlet = np.exp(-before)
        bulk_inlet[own] = mean * at_inlet
        bulk_friction[own] = mean * (left @ (mean * friction)) + second * friction
        to_end = np.exp(passed - passed[-1])
        outlet_wall[own] = to_end * reached / n_starts
        outlet_inlet = outlet_inlet + np.exp(-passed[-1]) / n_starts
        outlet_friction = outlet_friction + (to_end * mean * friction).sum() / n_starts
    return bulk_wall, bulk_inlet, bulk_friction, (outlet_wall, outlet_inlet, outlet_friction)
