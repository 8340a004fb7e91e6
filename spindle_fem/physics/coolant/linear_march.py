"""The coolant's march as linear maps of its walls, its inlet and its friction heat.

At given film coefficients every temperature and heat along the channel is
linear in what drives it. A solver that takes the maps in needs no iteration
between wall and coolant.

Arrays carry cells along their last axis, from inlet to outlet; axes before it
are channels in parallel or designs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.physics.coolant.march import exponential_shares


@dataclass(frozen=True, slots=True)
class MarchMaps:
    """Linear maps of a march from its walls, its inlet and its friction heat, each by itself.

    All are linear in temperatures at given film coefficients:
    ``bulk = bulk_from_wall @ wall + bulk_from_inlet * inlet + bulk_from_friction``,
    likewise the outlet, and
    ``heat = heat_from_wall @ (wall - inlet) + heat_from_friction``.

    Attributes
    ----------
    bulk_from_wall : (..., n, n) ndarray, [-]
        Lower triangular: a cell feels its own wall and those upstream.
    bulk_from_inlet, bulk_from_friction : (..., n) ndarray, [-], [K]
    outlet_from_wall : (..., n) ndarray, [-]
    outlet_from_inlet, outlet_from_friction : (...) ndarray, [-], [K]
    heat_from_wall : (..., n, n) ndarray, [W/K]
    heat_from_friction : (..., n) ndarray, [W]
        From the wall into the coolant, negative where friction warms the coolant.
    """

    bulk_from_wall: NDArray
    bulk_from_inlet: NDArray
    bulk_from_friction: NDArray
    outlet_from_wall: NDArray
    outlet_from_inlet: NDArray
    outlet_from_friction: NDArray
    heat_from_wall: NDArray
    heat_from_friction: NDArray


def march_maps(
    capacity_rate: ArrayLike,
    wetted_area: ArrayLike,
    film_coefficient: ArrayLike,
    pumping_heat: ArrayLike = 0.0,
) -> MarchMaps:
    """Linear maps of a march at given film coefficients.

    Parameters
    ----------
    capacity_rate : (..., n) array_like or float, [W/K]
        Mass flow of one channel times heat capacity.
    wetted_area : (..., n) array_like, [m²]
    film_coefficient : (..., n) array_like, [W/(m²·K)]
        May be complex, for derivatives by a complex step.
    pumping_heat : (..., n) array_like or float, [W]

    >>> from spindle_fem.physics.coolant.march import march_enthalpy
    >>> maps = march_maps(570.0, [0.04] * 4, 250.0)
    >>> march = march_enthalpy(288.15, 0.3, 1900.0, [300.0, 310.0, 305.0, 290.0], [0.04] * 4, 250.0)
    >>> bulk = maps.bulk_from_wall @ [300.0, 310.0, 305.0, 290.0] + 288.15 * maps.bulk_from_inlet
    >>> bool(np.allclose(bulk, march.bulk_temperature, rtol=0.0, atol=1e-11))
    True
    """
    rate, area, film, pumping = np.broadcast_arrays(
        np.asarray(capacity_rate), np.atleast_1d(wetted_area), np.asarray(film_coefficient), pumping_heat
    )
    units = film * area / rate
    reached, mean, second = exponential_shares(units)
    passed = np.cumsum(units, axis=-1)
    before = passed - units
    lower = np.tril(np.ones((units.shape[-1],) * 2), k=-1)
    # Share of what the coolant has at the end of cell j that is left at the start of cell i, for j < i.
    left = lower * np.exp(lower * (passed[..., None, :] - before[..., :, None]))
    start_from_wall = left * reached[..., None, :]
    rise = mean * pumping / rate
    start_from_friction = np.einsum("...ij,...j->...i", left, rise)
    own = np.eye(units.shape[-1])
    to_end = np.exp(passed - passed[..., -1:])
    return MarchMaps(
        bulk_from_wall=mean[..., :, None] * start_from_wall + own * (1.0 - mean)[..., None, :],
        bulk_from_inlet=mean * np.exp(-before),
        bulk_from_friction=mean * start_from_friction + second * pumping / rate,
        outlet_from_wall=to_end * reached,
        outlet_from_inlet=np.exp(-passed[..., -1]),
        outlet_from_friction=(to_end * rise).sum(axis=-1),
        heat_from_wall=(rate * reached)[..., :, None] * (own - start_from_wall),
        heat_from_friction=rate * (rise - reached * start_from_friction) - pumping,
    )


def outlet_stretch(transfer_units: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Factor on film times area to refer a cell's heat to its outlet temperature, and its derivative.

    With N transfer units the heat of a cell of uniform wall is
    ``h A (T_wall - T_outlet) (e^N - 1) / N``.

    Parameters
    ----------
    transfer_units : (n,) array_like, [-]
        Film times area over capacity rate; above zero.
    """
    units = np.asarray(transfer_units, dtype=np.float64)
    stretch = np.expm1(units) / units
    return stretch, (np.exp(units) - stretch) / units
