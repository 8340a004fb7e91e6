"""The coolant along the helix, between the correlations and the wetted facets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.geometry.coolant_path import CoolantPath
from spindle_fem.operation.channel_cells import ChannelCells
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.duct_films.straight import nusselt_straight
from spindle_fem.physics.coolant.duct_friction import PressureDrop
from spindle_fem.physics.coolant.duct_kinds.bore import bore
from spindle_fem.physics.coolant.ducts import DuctShape
from spindle_fem.physics.coolant.march import ChannelMarch, DrivenChannel, FilmChoice
from spindle_fem.physics.coolant.regimes import ChannelState, select_film
from spindle_fem.validity import CodedWarning


@dataclass(frozen=True, slots=True)
class CoolantState:
    """March along every start with the film it used.

    Attributes
    ----------
    film_coefficient, film_low, film_high : (n_starts, n) ndarray, [W/(m²·K)]
        Port cells and the film factor included.
    """

    march: ChannelMarch
    film_coefficient: NDArray[np.float64]
    film_low: NDArray[np.float64]
    film_high: NDArray[np.float64]
    pressure: PressureDrop
    warnings: tuple[CodedWarning, ...]


class CoolantLoop:
    """Marches the coolant of one machine over given wall temperatures.

    Parameters
    ----------
    cell_factor : (n_along,) ndarray, optional
        Further factor on the film of each cell along the channel.
    """

    def __init__(
        self, spec: MachineSpec, cells: ChannelCells, cell_factor: NDArray[np.float64] | None = None
    ) -> None:
        self.cell_factor = np.ones(cells.is_port.shape) if cell_factor is None else cell_factor
        self.spec = spec
        self.cells = cells
        self.path = CoolantPath.of(spec)
        self.coolant, self.section = self.path.coolant, self.path.section
        # Length of the film's first and last cells, which include the ends of the channel.
        self.port_length = 0.0
        if cells.is_port.any():
            wetted = cells.cell_area[:, cells.is_port].mean()
            self.port_length = float(wetted / (np.pi * self.path.port_diameter))

    def at(
        self,
        point: OperatingPoint,
        wall_temperature: NDArray[np.float64],
        *,
        film_factor: float = 1.0,
        bounds: bool = True,
    ) -> CoolantState:
        """March at an operating point.

        Parameters
        ----------
        wall_temperature : (n_starts, n) ndarray, [K]
            Area mean of each cell.
        film_factor : float
            Beside that of the definition.
        bounds : bool
            Whether the spread of correlations about the film is wanted, most of the work.
        """
        driven, factor, pressure = self._driven(point, film_factor)
        march = driven.settle(wall_temperature, bounds=bounds)
        shape = self.cells.cell_area.shape
        value, low, high = (
            np.broadcast_to(factor * np.asarray(item), shape)
            for item in (march.film.value, march.film.low, march.film.high)
        )
        warnings = (
            *march.film.warnings,
            *pressure.warnings,
            *self._port_warnings(point.coolant_flow, point.coolant_inlet_temperature),
        )
        return CoolantState(march, value, low, high, pressure, warnings)

    def outlets(
        self, point: OperatingPoint, walls: NDArray[np.float64], *, film_factor: float = 1.0
    ) -> NDArray[np.float64]:
        """Mixed outlet temperature at one operating point over many walls, (m,) [K].

        Parameters
        ----------
        walls : (m, n_starts, n) ndarray, [K]
        """
        return self._driven(point, film_factor)[0].outlets(walls)

    def _driven(
        self, point: OperatingPoint, film_factor: float
    ) -> tuple[DrivenChannel, NDArray[np.float64], PressureDrop]:
        """The channel with its flow, the factor on the film of each cell, and the pressure drop."""
        settings = self.spec.coolant
        inlet = point.coolant_inlet_temperature
        pressure = self.pressure_drop(point.coolant_flow, inlet)
        factor = film_factor * settings.film_factor.value * self.cell_factors(point.coolant_flow, inlet)
        driven = DrivenChannel(
            self.section,
            self.coolant,
            point.coolant_flow,
            inlet,
            self.cells.cell_area,
            self.film_choice(factor),
            pressure.pumping_power if settings.pumping_heat else 0.0,
        )
        return driven, factor, pressure

    def film_choice(self, factor: ArrayLike) -> FilmChoice:
        """Film of the definition, times a factor."""
        local = self.spec.coolant.properties_at == "bulk"
        return FilmChoice(self.spec.coolant.film_model, "local" if local else "inlet", factor)

    def pressure_drop(self, flow: float, inlet: float) -> PressureDrop:
        """Pressure drop of the channel at a flow (m³/s), properties at the inlet temperature (K)."""
        return self.path.pressure_drop(flow, inlet)

    def pumping_power(self, flow: float, inlet: float) -> float:
        """Friction heat that the definition gives to the coolant, W."""
        return self.pressure_drop(flow, inlet).pumping_power if self.spec.coolant.pumping_heat else 0.0

    def cell_factors(self, flow: ArrayLike, inlet: ArrayLike) -> NDArray[np.float64]:
        """Factor on the film of each cell along the channel, (..., n_along).

        Where the coolant enters and leaves by drillings, their film (short straight ducts, of any
        regime) over that of the channel.

        Parameters
        ----------
        flow, inlet : (...) array_like, [m³/s], [K]
        """
        flow, inlet = np.broadcast_arrays(np.asarray(flow, dtype=float), np.asarray(inlet, dtype=float))
        factor = np.tile(self.cell_factor, (*flow.shape, 1))
        if not self.cells.is_port.any():
            return factor
        state = ChannelState(self.coolant, flow, inlet)
        channel = select_film(self.spec.coolant.film_model, self.section, state, bounds=False).value
        ratio = np.asarray(self._port_film(flow, inlet)[0] / channel)
        factor[..., self.cells.is_port] *= ratio[..., None]
        return factor

    def _port_film(self, flow: ArrayLike, inlet: ArrayLike) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        """Film of the drillings, (...) [W/(m²·K)], and violations of its range; as :meth:`cell_factors`."""
        drilling = bore(DuctShape(self.path.port_diameter, self.port_length))
        properties = self.coolant.properties(inlet)
        velocity = np.asarray(flow) / self.section.starts / drilling.area
        diameter = drilling.hydraulic_diameter
        nusselt, faults = nusselt_straight(
            velocity * diameter / properties.kinematic_viscosity,
            properties.prandtl,
            self.port_length / diameter,
            drilling.laminar_nusselt,
        )
        return nusselt * properties.thermal_conductivity / diameter, faults

    def _port_warnings(self, flow: float, inlet: float) -> tuple[CodedWarning, ...]:
        """What the film of the drillings warns of."""
        faults = self._port_film(flow, inlet)[1] if self.cells.is_port.any() else ()
        if not faults:
            return ()
        text = f"Film of the coolant's drillings (Gnielinski 2013) is extrapolated: {'; '.join(faults)}."
        return (CodedWarning("coolant_film_extrapolated", text),)
