"""Heat that depends on temperature: films, the coolant, bearing friction.

Each law maps all node temperatures to heat into every node and its analytic
derivative, as triplets. Film coefficients and friction heat enter as cubic
splines over temperature, so value and derivative belong to one function.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator, RectBivariateSpline

from spindle_fem.errors import OutOfValidityError
from spindle_fem.network.links import SurfacePatch

Array = NDArray[np.float64]
Triplets = tuple[NDArray[np.int64], NDArray[np.int64], Array]
_NEWTON_STEPS = 12


def require_inside(values: Array, low: float, high: float, where: str) -> None:
    """Refuse temperatures beyond the table of a law.

    Raises
    ------
    OutOfValidityError
    """
    if np.any(values < low) or np.any(values > high):
        raise OutOfValidityError(
            where,
            f"a temperature between {float(np.min(values)) - 273.15:.1f} and {float(np.max(values)) - 273.15:.1f} °C "
            f"leaves the range {low - 273.15:.0f} to {high - 273.15:.0f} °C.",
            "The machine runs hotter or colder than its films are known for.",
        )


@dataclass(frozen=True, slots=True)
class WallFilmLaw:
    """A film whose coefficient follows the wall temperature (natural convection, radiation).

    Attributes
    ----------
    patch : SurfacePatch
    flux : CubicSpline
        Heat flux from the wall [W/m²] over wall temperature [K].
    name : str
    """

    patch: SurfacePatch
    flux: CubicSpline
    name: str

    def heat(self, temperature: Array) -> tuple[Array, Array]:
        """Heat that leaves through each face [W] and its derivative to the node's temperature."""
        node = temperature[self.patch.node]
        low, high = self.flux.x[0], self.flux.x[-1]
        require_inside(node, low, high, self.name)
        wall, slope = node.copy(), self.flux.derivative()
        for _ in range(_NEWTON_STEPS):
            defect = wall + self.patch.resistance * self.patch.area * self.flux(wall) - node
            step = defect / (1.0 + self.patch.resistance * self.patch.area * slope(wall))
            wall = wall - step
            if np.abs(step).max(initial=0.0) < 1.0e-11:
                break
        by_wall = self.patch.area * slope(wall)
        return self.patch.area * self.flux(wall), by_wall / (1.0 + self.patch.resistance * by_wall)

    def __call__(self, temperature: Array) -> tuple[Array, Triplets]:
        """Heat into every node and its derivative."""
        heat, slope = self.heat(temperature)
        node = self.patch.node
        return np.bincount(node, -heat, len(temperature)), (node, node, -slope)


@dataclass(frozen=True, slots=True)
class CoolantLaw:
    """Heat from walls into coolant cells whose nodes hold the cell's outlet temperature.

    A cell of uniform wall follows the exact exponential: with ``N`` transfer
    units the heat is ``g (T_wall - T_outlet) (e^N - 1) / N``, so a chain of
    streams and these conductances is the enthalpy march itself.

    Attributes
    ----------
    patch : SurfacePatch
    cell : (n,) int64 ndarray
        Coolant node of each face.
    upstream : (n_cells,) int64 ndarray
        Node that feeds each coolant node; -1 for the inlet.
    nodes : (n_cells,) int64 ndarray
        The coolant nodes, in the order of the flow.
    capacity_rate : float, [W/K]
        Mass flow times heat capacity, all starts.
    inlet : float, [K]
    film : RectBivariateSpline or float
        Film coefficient over bulk and wall temperature, or one value.
    bulk_range, wall_range : (low, high), [K]
    """

    patch: SurfacePatch
    cell: NDArray[np.int64]
    upstream: NDArray[np.int64]
    nodes: NDArray[np.int64]
    capacity_rate: float
    inlet: float
    film: RectBivariateSpline | float
    bulk_range: tuple[float, float]
    wall_range: tuple[float, float]

    def coefficients(self, temperature: Array) -> tuple[Array, Array, Array]:
        """Film coefficient of each coolant cell and its derivatives to bulk and wall temperature."""
        number = len(self.nodes)
        if isinstance(self.film, float):
            return np.full(number, self.film), np.zeros(number), np.zeros(number)
        bulk, wall = self.bulk_and_wall(temperature)
        require_inside(bulk, *self.bulk_range, "coolant film")
        require_inside(wall, *self.wall_range, "coolant film")
        return (
            self.film.ev(bulk, wall),
            self.film.ev(bulk, wall, dx=1),
            self.film.ev(bulk, wall, dy=1),
        )

    def bulk_and_wall(self, temperature: Array) -> tuple[Array, Array]:
        """Mean of each cell's ends, and area mean of the nodes around it, K."""
        before = np.where(self.upstream >= 0, temperature[self.upstream], self.inlet)
        area = np.bincount(self.cell, self.patch.area, len(self.nodes))
        wall = np.bincount(self.cell, self.patch.area * temperature[self.patch.node], len(self.nodes)) / area
        return 0.5 * (before + temperature[self.nodes]), wall

    def conductances(self, coefficient: Array) -> tuple[Array, Array]:
        """Conductance of each face to its cell's outlet temperature [W/K], and its derivative to h."""
        h = coefficient[self.cell]
        outer = 1.0 / (h * self.patch.area)
        plain = 1.0 / (self.patch.resistance + outer)
        plain_by_h = plain**2 * outer / h
        number = len(self.nodes)
        units = np.bincount(self.cell, plain, number) / self.capacity_rate
        units_by_h = np.bincount(self.cell, plain_by_h, number) / self.capacity_rate
        stretch = np.expm1(units) / units
        stretch_by_h = (np.exp(units) - stretch) / units * units_by_h
        value = stretch[self.cell] * plain
        return value, stretch[self.cell] * plain_by_h + stretch_by_h[self.cell] * plain

    def __call__(self, temperature: Array) -> tuple[Array, Triplets]:
        """Heat into every node (walls and coolant) and its derivative."""
        h, by_bulk, by_wall = self.coefficients(temperature)
        conductance, by_h = self.conductances(h)
        node, coolant = self.patch.node, self.nodes[self.cell]
        difference = temperature[node] - temperature[coolant]
        flow = conductance * difference
        heat = np.bincount(coolant, flow, len(temperature)) - np.bincount(node, flow, len(temperature))
        rows = [node, node, coolant, coolant]
        columns = [node, coolant, node, coolant]
        values = [-conductance, conductance, conductance, -conductance]
        if not isinstance(self.film, float):
            sensitivity = by_h * difference
            terms = [(coolant, 0.5 * by_bulk[self.cell])]
            fed = self.upstream[self.cell]
            terms.append((np.where(fed >= 0, fed, coolant), np.where(fed >= 0, 0.5 * by_bulk[self.cell], 0.0)))
            for column, weight in terms:
                rows += [coolant, node]
                columns += [column, column]
                values += [sensitivity * weight, -sensitivity * weight]
            # every face of a cell feels the mean wall of all its faces
            area = np.bincount(self.cell, self.patch.area, len(self.nodes))
            order = np.argsort(self.cell, kind="stable")
            counts = np.bincount(self.cell, minlength=len(self.nodes))
            starts = np.concatenate([[0], np.cumsum(counts)])
            for c in range(len(self.nodes)):
                own = order[starts[c] : starts[c + 1]]
                weight = by_wall[c] * self.patch.area[own] / area[c]
                block = np.outer(sensitivity[own], weight).ravel()
                repeated = np.repeat(own, len(own))
                column = np.tile(node[own], len(own))
                rows += [coolant[repeated], node[repeated]]
                columns += [column, column]
                values += [block, -block]
        return heat, (np.concatenate(rows), np.concatenate(columns), np.concatenate(values))


@dataclass(frozen=True, slots=True)
class FrictionLaw:
    """Friction heat of a bearing over the temperature of its lubricant film.

    The film's temperature is ``weights @ T + feedback * heat``: the raceways
    are hotter than the ring nodes by the heat that enters there.

    Attributes
    ----------
    nodes : (k,) int64 ndarray
    weights : (k,) ndarray, [-]
    feedback : float, [K/W]
    spread_nodes : (m,) int64 ndarray
    spread : (m,) ndarray, [-]
        Where the heat goes, sum 1.
    heat : PchipInterpolator
        W over film temperature in K.
    name : str
    """

    nodes: NDArray[np.int64]
    weights: Array
    feedback: float
    spread_nodes: NDArray[np.int64]
    spread: Array
    heat: PchipInterpolator
    name: str

    def film_temperature(self, temperature: Array) -> tuple[float, float]:
        """Temperature of the film [K] and the heat [W] that belongs to it."""
        base = float(self.weights @ temperature[self.nodes])
        film, slope = base, self.heat.derivative()
        for _ in range(_NEWTON_STEPS):
            require_inside(np.array([film]), self.heat.x[0], self.heat.x[-1], f"friction heat of {self.name}")
            step = (film - base - self.feedback * float(self.heat(film))) / (1.0 - self.feedback * float(slope(film)))
            film -= step
            if abs(step) < 1.0e-11:
                break
        return film, float(self.heat(film))

    def __call__(self, temperature: Array) -> tuple[Array, Triplets]:
        """Heat into every node and its derivative."""
        film, heat = self.film_temperature(temperature)
        slope = float(self.heat.derivative()(film))
        slope /= 1.0 - self.feedback * slope
        into = np.bincount(self.spread_nodes, heat * self.spread, len(temperature))
        block = np.outer(self.spread, slope * self.weights)
        rows = np.repeat(self.spread_nodes, len(self.nodes))
        return into, (rows, np.tile(self.nodes, len(self.spread_nodes)), block.ravel())


Law = WallFilmLaw | CoolantLaw | FrictionLaw
