"""One-dimensional enthalpy march of the coolant along its channel.

Within a cell the wall temperature is uniform and the bulk temperature follows
the exact exponential, so a march over few cells is as good as over many. The
heat is counted as rise of enthalpy: what the cells take up and what leaves
with the coolant agree to rounding, for either direction of the heat.

Arrays carry cells along their last axis, from inlet to outlet; axes before
it are channels in parallel (starts) with the same inlet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.errors import ConvergenceError, OutOfValidityError, did_you_mean
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.properties import Coolant
from spindle_fem.physics.coolant.regimes import ChannelState, FilmCoefficient, select_film
from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, require_range

_ITERATIONS = 50
_TEMPERATURE_TOLERANCE_K = 1.0e-10
# Channels of a march up to which plain numbers are quicker than arrays.
FEW_CHANNELS = 8
_GAUSS_POINTS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(5)


@dataclass(frozen=True, slots=True)
class MarchResult:
    """Bulk temperature and heat along the channel.

    Attributes
    ----------
    edge_temperature : (..., n + 1) ndarray, [K]
        Bulk temperature at the cell ends, the inlet first.
    edge_rise : (..., n + 1) ndarray, [K]
        The same above the inlet, without the rounding of absolute temperatures.
    bulk_temperature : (..., n) ndarray, [K]
        Mean of the exact profile in each cell: heat = h A (T_wall − T_bulk).
    heat : (..., n) ndarray, [W]
        From the wall into the coolant.
    pumping_heat : (..., n) ndarray, [W]
        Made by friction in the coolant.
    outlet_temperature : (...) ndarray, [K]
        Of each channel in parallel.
    mixed_outlet_temperature : float, [K]
        After all channels have joined.
    enthalpy_rise : float, [W]
        What leaves with the coolant less what came with it, all channels.
    specific_heat_capacity : (..., n) ndarray, [J/(kg·K)]
        The mean one of each cell, as used.
    """

    edge_temperature: NDArray[np.float64]
    edge_rise: NDArray[np.float64]
    bulk_temperature: NDArray[np.float64]
    heat: NDArray[np.float64]
    pumping_heat: NDArray[np.float64]
    outlet_temperature: NDArray[np.float64]
    mixed_outlet_temperature: float
    enthalpy_rise: float
    specific_heat_capacity: NDArray[np.float64]

    @property
    def imbalance_relative(self) -> float:
        """Heat taken up less enthalpy rise, over the sum of all heat moved."""
        taken = float(np.sum(self.heat) + np.sum(self.pumping_heat))
        moved = float(np.sum(np.abs(self.heat)) + np.sum(np.abs(self.pumping_heat)))
        return abs(taken - self.enthalpy_rise) / moved if moved > 0.0 else 0.0


def march_enthalpy(
    inlet_temperature: float,
    mass_flow: float,
    specific_heat_capacity: ArrayLike,
    wall_temperature: ArrayLike,
    wetted_area: ArrayLike,
    film_coefficient: ArrayLike,
    pumping_heat: ArrayLike = 0.0,
) -> MarchResult:
    """Bulk temperature and heat along a channel at given film coefficients.

    Parameters
    ----------
    inlet_temperature : float, [K]
    mass_flow : float, [kg/s]
        Of each channel in parallel.
    specific_heat_capacity : (..., n) array_like or float, [J/(kg·K)]
    wall_temperature : (..., n) array_like, [K]
        Area mean in each cell.
    wetted_area : (..., n) array_like, [m²]
    film_coefficient : (..., n) array_like or float, [W/(m²·K)]
    pumping_heat : (..., n) array_like or float, [W]
        Friction heat in each cell.

    Raises
    ------
    OutOfValidityError
        No flow, a negative area, film coefficient or heat capacity.

    Source: steady energy balance of plug flow, dT/dx = h P (T_wall − T)/(ṁ c).

    >>> march = march_enthalpy(288.15, 0.3, 1900.0, [300.0] * 4, [0.04] * 4, 250.0)
    >>> exact = 300.0 + (288.15 - 300.0) * np.exp(-250.0 * 0.16 / (0.3 * 1900.0))
    >>> bool(np.isclose(march.outlet_temperature, exact, rtol=0.0, atol=1e-12))
    True
    """
    wall, area, film, capacity, pumping = np.broadcast_arrays(
        np.atleast_1d(np.asarray(wall_temperature, dtype=np.float64)),
        np.asarray(wetted_area, dtype=np.float64),
        np.asarray(film_coefficient, dtype=np.float64),
        np.asarray(specific_heat_capacity, dtype=np.float64),
        np.asarray(pumping_heat, dtype=np.float64),
    )
    require_march(inlet_temperature, mass_flow, capacity, area, film, pumping, wall)
    capacity_rate = mass_flow * capacity
    units = film * area / capacity_rate
    reached, mean_share, second_share = exponential_shares(units)
    friction_rise = pumping / capacity_rate
    # Everything is counted from the inlet temperature: rounding then scales with
    # the temperature differences, not with 300 K.
    wall_difference = wall - inlet_temperature
    gain = reached * wall_difference + mean_share * friction_rise
    edges = _one_after_the_other(gain, 1.0 - reached)
    start = edges[..., :-1]
    heat = capacity_rate * (gain - reached * start) - pumping
    bulk = start + (1.0 - mean_share) * (wall_difference - start) + second_share * friction_rise
    edge_temperature = inlet_temperature + edges
    outlet = edge_temperature[..., -1]
    return MarchResult(
        edge_temperature=_frozen(edge_temperature),
        edge_rise=_frozen(edges),
        bulk_temperature=_frozen(inlet_temperature + bulk),
        heat=_frozen(heat),
        pumping_heat=_frozen(pumping),
        outlet_temperature=_frozen(outlet),
        mixed_outlet_temperature=float(np.mean(outlet)),
        enthalpy_rise=float(np.sum(capacity_rate * np.diff(edges, axis=-1))),
        specific_heat_capacity=_frozen(capacity),
    )


def require_march(
    inlet: ArrayLike,
    mass_flow: ArrayLike,
    capacity: NDArray[np.float64],
    area: NDArray[np.float64],
    film: NDArray[np.float64],
    pumping: NDArray[np.float64],
    wall: ArrayLike = 1.0,
) -> None:
    """Refuse a march without flow, or with a negative area, film coefficient or heat capacity."""
    require_range(
        "coolant march",
        inlet_temperature=(inlet, *POSITIVE),
        mass_flow=(mass_flow, *POSITIVE),
        specific_heat_capacity=(capacity, *POSITIVE),
        wall_temperature=(wall, *POSITIVE),
        wetted_area=(area, *NOT_NEGATIVE),
        film_coefficient=(film, *NOT_NEGATIVE),
        pumping_heat=(pumping, -POSITIVE[1], POSITIVE[1]),
        how_to_fix="Give SI values; without flow there is nothing to march.",
    )


@dataclass(frozen=True, slots=True)
class ChannelMarch:
    """A march with the film coefficient that its own temperatures give.

    Attributes
    ----------
    film : FilmCoefficient
        Before ``film_factor``; values of shape (..., n), or floats when
        nothing varies along the channel. Low and high are those of the value unless the march is settled.
    mass_flow : float, [kg/s]
        Of each start.
    """

    march: MarchResult
    film: FilmCoefficient
    mass_flow: ArrayLike


@dataclass(frozen=True, slots=True)
class FilmChoice:
    """Choice of film coefficient for a march.

    Attributes
    ----------
    model : str
        One of ``FILM_MODELS``.
    properties_at : {"local", "inlet"}
        Bulk temperature of each cell, corrected by the viscosity at the wall,
        or the inlet's everywhere.
    factor : (..., n) array_like or float, [-]
        Multiplies the film coefficient (fouling, calibration, ports).

    Raises
    ------
    OutOfValidityError
        An unknown option.
    """

    model: str = "helical"
    properties_at: str = "local"
    factor: ArrayLike = 1.0

    def __post_init__(self) -> None:
        if self.properties_at not in ("local", "inlet"):
            raise OutOfValidityError(
                "coolant march",
                f'properties_at is "{self.properties_at}".',
                did_you_mean(self.properties_at, ("local", "inlet")),
            )


@dataclass(frozen=True, slots=True)
class DrivenChannel:
    """A channel and the flow through it: what a march needs beside its walls.

    Attributes
    ----------
    volume_flow, inlet_temperature : float or (n, 1, 1) ndarray, [m³/s], [K]
        Total, all starts, at inlet temperature; every start takes its share.
        Arrays are of designs.
    wetted_area : (..., n) array_like, [m²]
        Of each cell, from inlet to outlet.
    pumping_power : float or (n, 1, 1) ndarray, [W]
        Friction heat of all starts, equal in each, spread over the wetted area.

    >>> from spindle_fem.physics.coolant.coolants.iso_vg_32 import OilIsoVg32
    >>> section = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0)
    >>> area = [0.1562 / 20] * 20
    >>> channel = DrivenChannel(section, OilIsoVg32(), 20e-3 / 60, 288.15, area, FilmChoice("sieder_tate"))
    >>> channel.settle([295.0] * 20).march.imbalance_relative < 1e-12
    True
    """

    section: ChannelSection
    coolant: Coolant
    volume_flow: ArrayLike
    inlet_temperature: ArrayLike
    wetted_area: ArrayLike
    choice: FilmChoice = FilmChoice()
    pumping_power: ArrayLike = 0.0

    def march(self, wall: ArrayLike, before: ChannelMarch | None = None) -> ChannelMarch:
        """One march, properties at the temperatures of the one before; at the inlet's without any.

        Parameters
        ----------
        wall : (..., n) array_like, [K]
            Area mean in each cell.

        Raises
        ------
        OutOfValidityError
            No flow, a temperature outside the coolant's range.
        """
        choice, inlet = self.choice, self.inlet_temperature
        local = choice.properties_at == "local"
        if before is not None and not local:
            film, mass_flow, capacity = before.film, before.mass_flow, before.march.specific_heat_capacity
        else:
            at_inlet = self.coolant.properties(inlet)
            mass_flow = at_inlet.density * self.volume_flow / self.section.starts
            bulk, capacity = inlet, at_inlet.specific_heat_capacity
            if before is not None:
                bulk, edges = before.march.bulk_temperature, before.march.edge_rise
                capacity = _mean_heat_capacity(self.coolant, inlet, edges[..., :-1], edges[..., 1:])
            film = self._film(wall, bulk, bounds=False)
        coefficient = np.asarray(choice.factor, dtype=np.float64) * np.asarray(film.value)
        area = np.asarray(self.wetted_area, dtype=np.float64)
        pumping = np.asarray(self.pumping_power) / self.section.starts
        pumping = pumping * area / area.sum(axis=-1, keepdims=True)
        march = march_enthalpy(inlet, mass_flow, capacity, wall, area, coefficient, pumping)
        return ChannelMarch(march=march, film=film, mass_flow=mass_flow)

    def settle(self, wall: ArrayLike, *, bounds: bool = True) -> ChannelMarch:
        """March of one design with properties at its own temperatures.

        Parameters
        ----------
        wall : (..., n) array_like, [K]
            An axis before the last one counts the starts; without it the
            result is that of one start.
        bounds : bool
            As :func:`select_film` takes it.

        Raises
        ------
        OutOfValidityError
            As :meth:`march`; walls of another number of starts.
        ConvergenceError
            The properties do not settle (they do within ten iterations).
        """
        given = np.atleast_1d(wall)[..., 0].size
        if given not in (1, self.section.starts):
            raise OutOfValidityError(
                "coolant march",
                f"walls of {given} starts are given, the channel has {self.section.starts}.",
                "Give every start, or one that stands for all.",
            )
        found, bulk = self._settled(wall)
        if bounds:
            found = replace(found, film=self._film(wall, bulk, bounds=True))
        if self.choice.properties_at == "inlet":
            return found
        return replace(found, march=_with_true_enthalpy(found.march, self.coolant, float(found.mass_flow)))

    def with_bounds(self, wall: ArrayLike, found: ChannelMarch) -> ChannelMarch:
        """A march with low and high of its film, which :meth:`march` leaves out.

        Parameters
        ----------
        wall : (..., n) array_like, [K]
            As for the march.
        """
        local = self.choice.properties_at == "local"
        bulk = found.march.bulk_temperature if local else self.inlet_temperature
        return replace(found, film=self._film(wall, bulk, bounds=True))

    def outlets(self, walls: ArrayLike) -> NDArray[np.float64]:
        """Mixed outlet temperature over many walls, (m,) [K], as :meth:`settle` has it for each.

        Parameters
        ----------
        walls : (m, n_starts, n) array_like, [K]

        Raises
        ------
        OutOfValidityError, ConvergenceError
            As :meth:`settle`.
        """
        outlet = self._settled(walls)[0].march.outlet_temperature
        mixed = outlet.mean(axis=-1)
        return mixed if self.choice.properties_at == "inlet" else _mixed(self.coolant, outlet, mixed)

    def _film(self, wall: ArrayLike, bulk: ArrayLike, *, bounds: bool) -> FilmCoefficient:
        """Film at bulk temperatures; low and high too if wanted."""
        wall = wall if self.choice.properties_at == "local" else None
        state = ChannelState(self.coolant, self.volume_flow, bulk, wall)
        return select_film(self.choice.model, self.section, state, bounds=bounds)

    def _settled(self, wall: ArrayLike) -> tuple[ChannelMarch, ArrayLike]:
        """A march with properties at its own temperatures, and the bulk temperatures its film is at.

        Raises
        ------
        ConvergenceError
        """
        found, bulk = self.march(wall), self.inlet_temperature
        if self.choice.properties_at == "inlet":
            return found, bulk
        for _ in range(_ITERATIONS):
            bulk = found.march.bulk_temperature
            found = self.march(wall, found)
            change = float(np.max(np.abs(found.march.bulk_temperature - bulk)))
            if change <= _TEMPERATURE_TOLERANCE_K:
                return found, bulk
        raise ConvergenceError(
            "coolant march",
            f"bulk temperature still changes by {change:.3g} K after {_ITERATIONS} iterations.",
            'Use properties_at = "inlet", or more cells.',
        )


def _with_true_enthalpy(march: MarchResult, coolant: Coolant, mass_flow: float) -> MarchResult:
    """Replace the enthalpy rise by that of the coolant itself, and mix by enthalpy."""
    inlet, outlet_rise = float(march.edge_temperature.flat[0]), march.edge_rise[..., -1:]
    capacity = _mean_heat_capacity(coolant, inlet, np.zeros_like(outlet_rise), outlet_rise)
    rise = mass_flow * float(np.sum(capacity * outlet_rise))
    mixed = float(_mixed(coolant, np.ravel(march.outlet_temperature), march.mixed_outlet_temperature))
    return replace(march, enthalpy_rise=rise, mixed_outlet_temperature=mixed)


def _mixed(coolant: Coolant, outlet: NDArray[np.float64], near: ArrayLike) -> NDArray[np.float64]:
    """Temperature of equal streams (..., n_starts) mixed, by enthalpy, from one near it (...)."""
    mixed_enthalpy = np.mean(coolant.specific_enthalpy(outlet), axis=-1)
    mixed = near
    for _ in range(3):
        error = coolant.specific_enthalpy(mixed) - mixed_enthalpy
        mixed = mixed - error / coolant.properties(mixed).specific_heat_capacity
    return mixed


def _mean_heat_capacity(
    coolant: Coolant, inlet: ArrayLike, start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Mean between two rises above the inlet, by Gauss points: no division by a small rise."""
    rise = 0.5 * (start + end)[..., None] + 0.5 * (end - start)[..., None] * _GAUSS_POINTS
    capacity = coolant.properties(np.asarray(inlet)[..., None] + rise).specific_heat_capacity
    return capacity @ (0.5 * _GAUSS_WEIGHTS)


def exponential_shares(
    units: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """1 − e^−N, (1 − e^−N)/N and (1 − (1 − e^−N)/N)/N, exact for small N too; N may be complex."""
    reached = -np.expm1(-units)
    small = np.abs(units) < 1.0e-2
    divisor = np.where(small, 1.0, units)
    series_mean = 1.0 - units / 2.0 * (1.0 - units / 3.0 * (1.0 - units / 4.0 * (1.0 - units / 5.0)))
    mean_share = np.where(small, series_mean, reached / divisor)
    series_second = 0.5 * (
        1.0 - units / 3.0 * (1.0 - units / 4.0 * (1.0 - units / 5.0 * (1.0 - units / 6.0)))
    )
    second_share = np.where(small, series_second, (1.0 - mean_share) / divisor)
    return reached, mean_share, second_share


def _one_after_the_other(gain: NDArray[np.float64], kept: NDArray[np.float64]) -> NDArray[np.float64]:
    """``e[i + 1] = gain[i] + kept[i] e[i]`` from ``e[0] = 0`` along the last axis, (..., n + 1)."""
    edges = np.zeros((*gain.shape[:-1], gain.shape[-1] + 1))
    if gain.size > FEW_CHANNELS * gain.shape[-1]:
        for cell in range(gain.shape[-1]):
            edges[..., cell + 1] = gain[..., cell] + kept[..., cell] * edges[..., cell]
        return edges
    for channel in np.ndindex(gain.shape[:-1]):
        at = zip(gain[channel].tolist(), kept[channel].tolist(), strict=True)
        edges[channel] = list(accumulate(at, lambda edge, cell: cell[0] + cell[1] * edge, initial=0.0))
    return edges


def _frozen(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array = np.array(array)
    array.flags.writeable = False
    return array
