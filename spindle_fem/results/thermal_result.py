"""Result of a solved machine: the field and everything derived from it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError
from spindle_fem.results.presented import Presented
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from spindle_fem.definition.machine_spec import MachineSpec
    from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
    from spindle_fem.model.elastic.deformed_shape import BodyShape, RacewayMotion
    from spindle_fem.model.elastic.machine_growth import Growth, GrowthModel, Side
    from spindle_fem.model.elastic.solid_growth import SolidGrowth
    from spindle_fem.operation.bearing_heat import BearingTemperatures
    from spindle_fem.validity import CodedWarning


@dataclass(frozen=True, slots=True)
class BearingResult:
    """State of one bearing at the solution; temperatures in K.

    ``contact_angle_*`` in rad, ``film_thickness`` (central, thinner contact) in m; ``contact_pressure``
    (largest) in Pa; ``preload`` is the axial force without external load, ``axial_load`` with it,
    ``axial_stiffness`` (N/m) that of its set; ``nan`` where the heat model does not give them.
    ``ball_forces`` (N) is what all balls press each raceway radially, None where unknown.
    """

    heat: float
    terms: Mapping[str, float]
    heat_to: Mapping[str, float]
    temperature_inner: float
    temperature_outer: float
    temperature_ball: float
    contact_angle_inner: float
    contact_angle_outer: float
    preload: float
    film_thickness: float
    film_thickness_ratio: float
    contact_pressure: float = float("nan")
    axial_load: float = float("nan")
    axial_stiffness: float = float("nan")
    ball_forces: tuple[float, float] | None = None

    def lubricant_temperature(self, word: str) -> float:
        """Warmest that a lubricant, "grease" or "oil", is judged by, K.

        Limits of greases are said of bearings by their rings; oil takes on the temperature of all that it
        wets, balls or rollers too.
        """
        rings = (self.temperature_inner, self.temperature_outer)
        return max(rings if word == "grease" else (*rings, self.temperature_ball))

    @property
    def ring_difference(self) -> float:
        """Mean inner raceway minus mean outer raceway temperature, K."""
        return self.temperature_inner - self.temperature_outer


@dataclass(frozen=True, slots=True)
class CoolantResult:
    """Channel flow; arrays run along the helix, one entry per cell.

    Attributes
    ----------
    flow, asked_flow : float, [m³/s]
        Actual flow, and the flow that the definition requests from the pump.
    position : (n,) ndarray, [m]
        Developed length from the inlet to the cell centre.
    angle : (n,) ndarray, [rad]
        Helix angle of the cell centre from the inlet.
    bulk_temperature, wall_temperature : (n,) ndarray, [K]
    film_coefficient, film_low, film_high : (n,) ndarray, [W/(m²·K)]
    mean_film_coefficient, mean_film_low, mean_film_high : float, [W/(m²·K)]
        Area means over the channel's walls, without the ports.
    """

    flow: float
    asked_flow: float
    inlet_temperature: float
    outlet_temperature: float
    heat: float
    reynolds: float
    prandtl: float
    velocity: float
    regime: str
    source: str
    in_range: bool
    pressure_drop: float
    ports_pressure_drop: float
    pumping_power: float
    hydraulic_diameter: float
    length: float
    wetted_area: float
    position: NDArray[np.float64]
    angle: NDArray[np.float64]
    bulk_temperature: NDArray[np.float64]
    wall_temperature: NDArray[np.float64]
    film_coefficient: NDArray[np.float64]
    film_low: NDArray[np.float64]
    film_high: NDArray[np.float64]
    mean_film_coefficient: float
    mean_film_low: float
    mean_film_high: float


@dataclass(frozen=True, slots=True)
class CircuitResult:
    """A circuit beside the channel, SI; properties and film at its inlet temperature."""

    flow: float
    inlet_temperature: float
    outlet_temperature: float
    heat: float
    reynolds: float
    prandtl: float
    velocity: float
    regime: str
    source: str
    film_coefficient: float
    pressure_drop: float
    wetted_area: float


@dataclass(frozen=True, slots=True)
class EnergyBalance:
    """Heat in W; ``heat_out`` by surface or film name, positive when it leaves."""

    heat_in: float
    heat_in_by: Mapping[str, float]
    heat_out: Mapping[str, float]

    @property
    def imbalance_relative(self) -> float:
        """(in − out) over the larger of the heat put in and the largest flow."""
        scale = max(abs(self.heat_in), *(abs(value) for value in self.heat_out.values()), 1.0e-12)
        return (self.heat_in - sum(self.heat_out.values())) / scale


@dataclass(frozen=True, slots=True)
class Check:
    """One self-check of a run: its value, its limit and whether it held."""

    name: str
    value: float
    limit: float
    unit: str
    passed: bool
    explanation: str = ""


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """Distance of a running machine from runaway of its preload.

    Attributes
    ----------
    followed : bool
        Whether expansion changed the preload and with it the heat.
    preload_ratio : mapping of bearing to float
        Running over assembled.
    fold_speed : float or None, [rad/s]
        Where equilibria end because heat and preload feed each other; None where that was not looked for
        or lies beyond ``searched_to``.
    searched_to : float or None, [rad/s]
        Speed up to which equilibria were followed.
    limits : tuple of str
        What a bearing does not bear for long at this state, or above this speed, in words.
    """

    followed: bool
    preload_ratio: Mapping[str, float]
    fold_speed: float | None
    searched_to: float | None
    limits: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class ThermalResult(Presented):
    """Steady result of one machine.

    Attributes
    ----------
    speed : float, [rad/s]
    temperature : (n_nodes,) ndarray, [K]
        At every mesh point (linear solutions interpolated to edge middles).
    air_temperature : mapping of str to float, [K]
        Averaged air of each gap band, by lumped-node name.
    film_coefficient : mapping of str to (n_facets,) ndarray, [W/(m²·K)]
        Coefficient in force on each named surface.
    fluid_temperature : mapping of str to (n_facets,) ndarray, [K]
    probes : mapping of str to float, [K]
    temperature_maximum_at : (3,) ndarray, [m]
    heat_flows : mapping of str to float, [W]
        Through each joint, from the first-named part to the second.
    timings : mapping of str to float, [s]
    extra : mapping
        More entries of the summary.
    bearing_temperatures : mapping of bearing to BearingTemperatures
        What its friction follows.
    growth_model : GrowthModel or None
        Where the solution made one already.
    equilibrium : Equilibrium or None
        For a machine with preloaded bearings, if requested.
    solid_growth : SolidGrowth or None
        Growth in three dimensions, where :meth:`with_solid_growth` worked it out.
    """

    spec: MachineSpec
    speed: float
    mesh: TaggedMesh
    order: int
    n_unknowns: int
    temperature: NDArray[np.float64]
    air_temperature: Mapping[str, float]
    film_coefficient: Mapping[str, NDArray[np.float64]]
    fluid_temperature: Mapping[str, NDArray[np.float64]]
    bearings: Mapping[str, BearingResult]
    coolant: CoolantResult | None
    probes: Mapping[str, float]
    energy: EnergyBalance
    heat_flows: Mapping[str, float]
    area_error_relative: Mapping[str, float]
    volume_error_relative: Mapping[str, float]
    temperature_minimum: float
    temperature_maximum: float
    temperature_maximum_at: NDArray[np.float64]
    checks: tuple[Check, ...]
    warnings: tuple[CodedWarning, ...]
    iterations: Mapping[str, int]
    timings: Mapping[str, float]
    circuits: Mapping[str, CircuitResult] = field(default_factory=dict)
    extra: Mapping[str, Any] = field(default_factory=dict)
    bearing_temperatures: Mapping[str, BearingTemperatures] = field(default_factory=dict)
    growth_model: GrowthModel | None = None
    equilibrium: Equilibrium | None = None
    solid_growth: SolidGrowth | None = None

    @cached_property
    def growth(self) -> Growth | None:
        """Displacements due to temperatures, fits and ball loads; None without bearings on bodies.

        Computed on first use. Ball loads are those of the solution; those of the
        assembled preload where the heat model gives none.
        """
        from spindle_fem.model.elastic.machine_bodies import carries_rings

        if not carries_rings(self.spec):
            return None
        model = self._elastic
        return model.at(self.temperature[: self.n_unknowns], self.speed, self._ball_forces)

    @cached_property
    def shapes(self) -> dict[str, BodyShape]:
        """The elastic bodies before and after, by name; empty without bearings on bodies."""
        from spindle_fem.model.elastic.deformed_shape import deformed_shapes
        from spindle_fem.model.elastic.machine_bodies import carries_rings

        if not carries_rings(self.spec):
            return {}
        field = self.temperature[: self.n_unknowns]
        return deformed_shapes(self._elastic, field, self.speed, self._ball_forces)

    @property
    def raceway_motions(self) -> dict[tuple[str, Side], RacewayMotion]:
        """Axial shift and twist of every raceway, by bearing and side; empty without bearings on bodies."""
        from spindle_fem.model.elastic.deformed_shape import raceway_motions

        return raceway_motions(self._elastic, self.shapes) if self.shapes else {}

    @property
    def _ball_forces(self) -> dict[str, tuple[float, float]]:
        """Radial ball force on both raceways of every bearing, N; that of rollers is left out."""
        forces = dict(self._elastic.assembly_forces)
        known = {name: bearing.ball_forces for name, bearing in self.bearings.items()}
        return forces | {name: pair for name, pair in known.items() if pair is not None}

    @cached_property
    def displacements(self) -> dict[str, float]:
        """Reading of every displacement sensor since assembly, m."""
        if not self.spec.displacement_sensor:
            return {}
        return self._elastic.displacements(self.temperature[: self.n_unknowns], self.speed)

    @cached_property
    def _elastic(self) -> GrowthModel:
        from spindle_fem.model.elastic.machine_growth import GrowthModel

        return self.growth_model or GrowthModel(self.spec, self.mesh, self.order)

    def _headline(self) -> str:
        """The machine and its warmest place."""
        warmest = self.temperature_maximum - ZERO_CELSIUS_K
        return f"{self.spec.name} at {30.0 / math.pi * self.speed:.0f} rpm, warmest {warmest:.1f} °C"

    def _rows(self) -> dict[str, str]:
        """Probes, heat of the bearings, coolant, balance."""
        rows = {name: f"{value - ZERO_CELSIUS_K:.2f} °C" for name, value in self.probes.items()}
        for name, bearing in self.bearings.items():
            rows[name] = f"{bearing.heat:.1f} W, inner − outer ring {bearing.ring_difference:+.1f} K"
        if self.coolant is not None:
            rows["coolant"] = f"{self.coolant.heat:.0f} W"
        rows["heat in"] = f"{self.energy.heat_in:.1f} W, imbalance {self.energy.imbalance_relative:.0e}"
        return rows

    def with_solid_growth(self) -> Self:
        """Copy with the growth in three dimensions, on the mesh of the temperatures; takes some seconds.

        Raises
        ------
        SpecError
            A machine without bearings, shaft or housing.
        GeometryError
            A body in pieces, or a part that touches no other.
        """
        from spindle_fem.model.elastic.machine_bodies import carries_rings
        from spindle_fem.model.elastic.solid_growth import solid_growth

        if not carries_rings(self.spec):
            raise SpecError(
                self.spec.name,
                "has no bearings between a shaft and a housing.",
                "Growth in three dimensions places the bodies by them.",
            )
        found = solid_growth(self._elastic, self.mesh, self.temperature, self.speed, self._ball_forces)
        return replace(self, solid_growth=found)

    def with_timings(self, timings: Mapping[str, float]) -> ThermalResult:
        """Copy with the seconds of each stage."""
        return replace(self, timings=dict(timings))
