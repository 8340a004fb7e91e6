"""Heat that depends on temperature: films, the coolant, bearing friction.

Each law maps all node temperatures to heat into every node and its analytic
derivative, as triplets. Films of walls and friction heat enter as cubic splines over temperature, the
coolant's film in straight pieces, so value and derivative belong to one function.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from spindle_fem.errors import OutOfValidityError
from spindle_fem.model.lumped.links import SurfacePatch
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.linear_march import outlet_stretch
from spindle_fem.physics.coolant.properties import Coolant
from spindle_fem.physics.coolant.regimes import ChannelState, select_film

Array = NDArray[np.float64]
Triplets = tuple[NDArray[np.int64], NDArray[np.int64], Array]
# Between temperatures at which the channel's film model is asked, K.
FILM_STEP = 0.05
_NEWTON_STEPS = 12
_SETTLED = 1.0e-11


def require_inside(values: Array, low: float, high: float, where: str) -> None:
    """Refuse temperatures beyond the table of a law.

    Raises
    ------
    OutOfValidityError
    """
    least, most = values.min(), values.max()
    if least < low or most > high:
        raise OutOfValidityError(
            where,
            f"a temperature between {float(least) - 273.15:.1f} and {float(most) - 273.15:.1f} °C "
            f"leaves the range {low - 273.15:.0f} to {high - 273.15:.0f} °C.",
            "The machine runs hotter or colder than its films are known for.",
        )


@dataclass(frozen=True, slots=True)
class WallFilmLaw:
    """A film whose coefficient follows the wall temperature (natural convection, radiation).

    Attributes
    ----------
    flux, flux_slope : CubicSpline
        Heat flux from the wall [W/m²] over wall temperature [K], and its derivative.
    """

    patch: SurfacePatch
    flux: CubicSpline
    flux_slope: CubicSpline
    name: str

    @classmethod
    def of(cls, patch: SurfacePatch, wall: Array, flux: Array, name: str) -> WallFilmLaw:
        """Law of tabulated fluxes."""
        spline = CubicSpline(wall, flux)
        return cls(patch, spline, spline.derivative(), name)

    def wall(self, temperature: Array) -> Array:
        """Temperature of each face of the wall, K."""
        node = temperature[self.patch.node]
        wall, scale = node.copy(), self.patch.resistance * self.patch.area
        for _ in range(_NEWTON_STEPS):
            step = (wall + scale * self.flux(wall) - node) / (1.0 + scale * self.flux_slope(wall))
            wall = wall - step
            if np.abs(step).max(initial=0.0) < _SETTLED:
                break
        return wall

    def require_valid(self, temperature: Array) -> None:
        """Refuse a state beyond the law's table."""
        require_inside(temperature[self.patch.node], self.flux.x[0], self.flux.x[-1], self.name)

    def heat(self, temperature: Array) -> tuple[Array, Array]:
        """Heat that leaves through each face [W] and its derivative to the node's temperature."""
        wall = self.wall(temperature)
        by_wall = self.patch.area * self.flux_slope(wall)
        return self.patch.area * self.flux(wall), by_wall / (1.0 + self.patch.resistance * by_wall)

    def __call__(self, temperature: Array) -> tuple[Array, Triplets]:
        """Heat into every node and its derivative."""
        heat, slope = self.heat(temperature)
        node = self.patch.node
        return np.bincount(node, -heat, len(temperature)), (node, node, -slope)


@dataclass(frozen=True, slots=True)
class ChannelFilm:
    """Film coefficient of a channel over bulk and wall temperature, with its derivatives.

    The film model itself at temperatures ``FILM_STEP`` apart and bilinear between: steep but continuous where
    the model jumps, within 0.5 % of it beside a kink and 1e-6 elsewhere. Beyond the coolant's range it keeps
    its last value: iterates may stray there, results may not (a wall beyond it counts as at its end, as the
    correlations take it too).

    Attributes
    ----------
    flow : float, [m³/s]
    factor : float, [-]
    """

    coolant: Coolant
    section: ChannelSection
    model: str
    flow: float
    factor: float

    @property
    def range(self) -> tuple[float, float]:
        """Lowest and highest temperature of the coolant, K."""
        return self.coolant.lowest_temperature, self.coolant.highest_temperature

    def __call__(self, bulk: Array, wall: Array) -> tuple[Array, Array, Array]:
        """Coefficient [W/(m²·K)] and its derivatives to bulk and wall temperature, (n,) each.

        Parameters
        ----------
        bulk, wall : (n,) ndarray, [K]
        """
        low, high = self.range
        ends, shares = [], []
        for temperature in (bulk, wall):
            position = (np.clip(temperature, low, high) - low) / FILM_STEP
            before = np.floor(position)
            ends.append(np.minimum(low + FILM_STEP * np.stack((before, before + 1.0)), high))
            shares.append(position - before)
        state = ChannelState(self.coolant, self.flow, ends[0][:, None], ends[1][None])
        value = self.factor * np.asarray(select_film(self.model, self.section, state, bounds=False).value)
        across = value[1] - value[0]
        at_walls = value[0] + shares[0] * across
        slopes = across[0] + shares[1] * (across[1] - across[0]), at_walls[1] - at_walls[0]
        by_bulk, by_wall = (
            np.where((at >= low) & (at <= high), slope / FILM_STEP, 0.0)
            for at, slope in zip((bulk, wall), slopes, strict=True)
        )
        return at_walls[0] + shares[1] * slopes[1], by_bulk, by_wall


@dataclass(frozen=True, slots=True)
class CoolantLaw:
    """Heat from walls into coolant cells whose nodes hold the cell's outlet temperature.

    A cell of uniform wall follows the exact exponential: with ``N`` transfer
    units the heat is ``g (T_wall - T_outlet) (e^N - 1) / N``, so a chain of
    streams and these conductances is the enthalpy march itself.

    Attributes
    ----------
    cell : (k,) int64 ndarray
        Coolant cell of each face.
    upstream : (n_cells,) int64 ndarray
        Node that feeds each coolant node; -1 for the inlet.
    nodes : (n_cells,) int64 ndarray
        The coolant nodes, in the order of the flow.
    share : (k,) ndarray, [-]
        Area of each face over that of its cell.
    pairs : (2, m) int64 ndarray
        Faces that feel each other through the mean wall temperature of their cell.
    capacity_rate : float, [W/K]
        Mass flow times heat capacity, all starts.
    inlet : float, [K]
    film : ChannelFilm or float
        Film coefficient over bulk and wall temperature, or one value.
    """

    patch: SurfacePatch
    cell: NDArray[np.int64]
    upstream: NDArray[np.int64]
    nodes: NDArray[np.int64]
    share: Array
    pairs: NDArray[np.int64]
    capacity_rate: float
    inlet: float
    film: ChannelFilm | float

    def require_valid(self, temperature: Array) -> None:
        """Refuse a state beyond the coolant's range."""
        if not isinstance(self.film, float):
            require_inside(self.bulk_and_wall(temperature)[0], *self.film.range, "coolant")

    def coefficients(self, temperature: Array) -> tuple[Array, Array, Array]:
        """Film coefficient of each coolant cell and its derivatives to bulk and wall temperature."""
        number = len(self.nodes)
        if isinstance(self.film, float):
            return np.full(number, self.film), np.zeros(number), np.zeros(number)
        return self.film(*self.bulk_and_wall(temperature))

    def bulk_and_wall(self, temperature: Array) -> tuple[Array, Array]:
        """Mean of each cell's ends, and area mean of the nodes around it, K."""
        before = np.where(self.upstream >= 0, temperature[self.upstream], self.inlet)
        wall = np.bincount(self.cell, self.share * temperature[self.patch.node], len(self.nodes))
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
        stretch, by_units = outlet_stretch(units)
        stretch_by_h = by_units * units_by_h
        value = stretch[self.cell] * plain
        return value, stretch[self.cell] * plain_by_h + stretch_by_h[self.cell] * plain

    def __call__(self, temperature: Array) -> tuple[Array, Triplets]:
        """Heat into every node (walls and coolant) and its derivative."""
        h, by_bulk, by_wall = self.coefficients(temperature)
        conductance, by_h = self.conductances(h)
        node, coolant = self.patch.node, self.nodes[self.cell]
        difference = temperature[node] - temperature[coolant]
        flow, n = conductance * difference, len(temperature)
        heat = np.bincount(coolant, flow, n) - np.bincount(node, flow, n)
        # derivative of the flow through each face: (face, column, value)
        faces = [np.arange(len(node))] * 2
        columns, values = [node, coolant], [conductance, -conductance]
        if not isinstance(self.film, float):
            sensitivity = by_h * difference
            half = 0.5 * sensitivity * by_bulk[self.cell]
            fed = self.upstream[self.cell]
            from_inlet = fed < 0
            faces += [faces[0], faces[0]]
            columns += [coolant, np.where(from_inlet, coolant, fed)]
            values += [half, np.where(from_inlet, 0.0, half)]
            one, other = self.pairs
            faces.append(one)
            columns.append(node[other])
            values.append(sensitivity[one] * by_wall[self.cell[one]] * self.share[other])
        face, column, slope = np.concatenate(faces), np.concatenate(columns), np.concatenate(values)
        rows = np.concatenate([coolant[face], node[face]])
        return heat, (rows, np.tile(column, 2), np.concatenate([slope, -slope]))


@dataclass(frozen=True, slots=True)
class CircuitLaw:
    """Heat from walls into a circuit, whose coolant follows its walls at constant films.

    Attributes
    ----------
    conductance : (k,) ndarray, [W/K]
        Of each face, from its node to the coolant beside it.
    warming : (k, k) ndarray, [-]
        Coolant beside each face above the inlet, for each kelvin of each node above the inlet.
    inlet : float, [K]
    """

    patch: SurfacePatch
    conductance: Array
    warming: Array
    inlet: float
    name: str

    def require_valid(self, temperature: Array) -> None:
        """Constant films hold at every temperature."""

    def heat(self, temperature: Array) -> Array:
        """Heat that leaves through each face, W."""
        rise = temperature[self.patch.node] - self.inlet
        return self.conductance * (rise - self.warming @ rise)

    def __call__(self, temperature: Array) -> tuple[Array, Triplets]:
        """Heat into every node and its derivative."""
        node = self.patch.node
        slope = self.conductance[:, None] * (np.eye(len(node)) - self.warming)
        rows, columns = np.repeat(node, len(node)), np.tile(node, len(node))
        return np.bincount(node, -self.heat(temperature), len(temperature)), (rows, columns, -slope.ravel())


def faces_by_cell(cell: NDArray[np.int64]) -> NDArray[np.int64]:
    """All ordered pairs of faces that share a cell, (2, m).

    >>> faces_by_cell(np.array([0, 1, 0])).tolist()
    [[0, 0, 2, 2, 1], [0, 2, 0, 2, 1]]
    """
    order = np.argsort(cell, kind="stable")
    counts = np.bincount(cell)
    starts = np.concatenate([[0], np.cumsum(counts)])
    groups = [order[low:high] for low, high in itertools.pairwise(starts)]
    one = np.concatenate([np.repeat(group, len(group)) for group in groups])
    other = np.concatenate([np.tile(group, len(group)) for group in groups])
    return np.stack([one, other])


@dataclass(frozen=True, slots=True)
class FrictionLaw:
    """Friction heat of every bearing over the temperature of its lubricant film.

    A film's temperature is ``weights @ T + feedback * heat``: the raceways are
    hotter than the ring nodes by the heat that enters there. The heat is
    therefore tabulated over ``weights @ T``.

    Attributes
    ----------
    names : tuple of str
        Bearings.
    weights : (n_bearings, n_nodes) ndarray, [-]
    feedback : (n_bearings,) ndarray, [K/W]
    spread : (n_nodes, n_bearings) ndarray, [-]
        Where the heat goes, columns sum to 1.
    breaks : (n_bearings, k + 1) ndarray, [K]
    coefficients : (4, k, n_bearings) ndarray
        Of the cubic pieces, highest power first, W.
    pattern : bearing, row, column and spread times weight, each (p,)
        Of the derivative.
    """

    names: tuple[str, ...]
    weights: Array
    feedback: Array
    spread: Array
    breaks: Array
    coefficients: Array
    pattern: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array]

    @classmethod
    def of(
        cls, tables: Mapping[str, CubicHermiteSpline], weights: Array, feedback: Array, spread: Array
    ) -> FrictionLaw:
        """Law of tables of heat over film temperature."""
        kelvin = np.stack([table.x for table in tables.values()])
        heat = np.stack([table(table.x) for table in tables.values()])
        slope = np.stack([table(table.x, 1) for table in tables.values()])
        gain = feedback[:, None]
        breaks, slope = kelvin - gain * heat, slope / (1.0 - gain * slope)
        width, before, after = np.diff(breaks, axis=1), slope[:, :-1], slope[:, 1:]
        secant = np.diff(heat, axis=1) / width
        cubic = (before + after - 2.0 * secant) / width**2
        square = (3.0 * secant - 2.0 * before - after) / width
        ends = [(np.flatnonzero(spread[:, b]), np.flatnonzero(weights[b])) for b in range(len(feedback))]
        bearing = np.repeat(np.arange(len(ends)), [len(into) * len(feels) for into, feels in ends])
        rows = np.concatenate([np.repeat(into, len(feels)) for into, feels in ends])
        columns = np.concatenate([np.tile(feels, len(into)) for into, feels in ends])
        return cls(
            tuple(tables),
            weights,
            feedback,
            spread,
            breaks,
            np.stack([cubic, square, before, heat[:, :-1]]).transpose(0, 2, 1),
            (bearing, rows, columns, spread[rows, bearing] * weights[bearing, columns]),
        )

    def heat(self, temperature: Array) -> tuple[Array, Array]:
        """Heat [W] of each bearing and its slope to ``weights @ T`` [W/K]."""
        base = self.weights @ temperature
        # Iterates may stray beyond the table, results may not. There the heat stays: going straight on, it
        # would fall below nothing in cold grease that rubs more as it warms, and balance below the room.
        at = np.minimum(np.maximum(base, self.breaks[:, 0]), self.breaks[:, -1])
        piece = (at[:, None] >= self.breaks[:, 1:-1]).sum(axis=1)
        bearing = np.arange(len(at))
        x = at - self.breaks[bearing, piece]
        c3, c2, c1, c0 = self.coefficients[:, piece, bearing]
        slope = np.where(at == base, (3.0 * c3 * x + 2.0 * c2) * x + c1, 0.0)
        return ((c3 * x + c2) * x + c1) * x + c0, slope

    def film_temperature(self, temperature: Array) -> Array:
        """Film temperature of each bearing, K."""
        return self.weights @ temperature + self.feedback * self.heat(temperature)[0]

    def require_valid(self, temperature: Array) -> None:
        """Refuse a state beyond the law's table."""
        base = self.weights @ temperature
        for name, value, breaks in zip(self.names, base, self.breaks, strict=True):
            require_inside(np.array([value]), breaks[0], breaks[-1], f"friction heat of {name}, film")

    def __call__(self, temperature: Array) -> tuple[Array, Triplets]:
        """Heat into every node and its derivative."""
        heat, slope = self.heat(temperature)
        bearing, rows, columns, product = self.pattern
        return self.spread @ heat, (rows, columns, slope[bearing] * product)
