"""Heat, films and exchange nodes at one instant, on the names of the mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class FilmLoad:
    """A film between a surface and a fluid of given temperature.

    Attributes
    ----------
    name : str
        What the heat balance calls it.
    coefficient : (n_facets,) ndarray, [W/(m²·K)]
    temperature : (n_facets,) ndarray, [K]
    """

    name: str
    coefficient: NDArray[np.float64]
    temperature: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LumpedLoad:
    """A body of one temperature that exchanges heat with named surfaces.

    Attributes
    ----------
    capacity : float, [J/K]
    heat : float, [W]
    connections : mapping of surface to (n_facets,) ndarray, [W/(m²·K)]
    """

    name: str
    capacity: float
    heat: float
    connections: Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class BearingHeat:
    """Friction heat of one bearing and what its contacts conduct.

    Angles in rad; ``preload`` in N is the axial force at this state without the external load,
    ``axial_load`` with it, ``axial_stiffness`` (N/m) that of its set; film in m; ``nan`` where a heat model
    does not give them. ``conductance_inner`` and ``conductance_outer`` (W/K) join the balls to each raceway
    and are ``nan`` where the model has no contacts. ``contact_pressure`` (Pa) is the largest
    between ball and raceway, ``ball_forces`` (N) what all balls press each raceway radially, None where
    unknown; ``seat_pressure`` (Pa) and ``seat_gap`` (m, radial) are those of the inner
    and the outer ring, None where no elastic bodies carry them.
    """

    total: float
    terms: Mapping[str, float]
    contact_angle_inner: float = float("nan")
    contact_angle_outer: float = float("nan")
    preload: float = float("nan")
    axial_load: float = float("nan")
    axial_stiffness: float = float("nan")
    film_thickness: float = float("nan")
    film_thickness_ratio: float = float("nan")
    conductance_inner: float = float("nan")
    conductance_outer: float = float("nan")
    contact_pressure: float = float("nan")
    ball_forces: tuple[float, float] | None = None
    seat_pressure: tuple[float, float] | None = None
    seat_gap: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class LoadChange:
    """Changes of a machine's loads by effects at one instant.

    Attributes
    ----------
    friction : mapping of bearing to float
        Factor on its friction heat.
    coefficients : mapping of str to float
        Factors on ``film.<surface>``, ``gap.<gap>``, ``balls.<bearing>.<side>``,
        ``joint.<contact>``, ``conductivity.<part>`` and ``channel.film``.
    fluids : mapping of surface to float, [K]
        Added to what the fluid of its film has.
    inlet : float, [K]
        Added to the coolant's inlet temperature.
    flow : float
        Factor on the coolant's flow.
    nodal_heat : mapping of str to (n_unknowns,) ndarray, [W]
    lumped_heat, lumped_capacity : mapping of lumped node to float, [W], [J/K]
    capacity_scale : (n_unknowns,) ndarray or None, [-]
    """

    friction: Mapping[str, float] = field(default_factory=dict)
    coefficients: Mapping[str, float] = field(default_factory=dict)
    fluids: Mapping[str, float] = field(default_factory=dict)
    inlet: float = 0.0
    flow: float = 1.0
    nodal_heat: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    lumped_heat: Mapping[str, float] = field(default_factory=dict)
    lumped_capacity: Mapping[str, float] = field(default_factory=dict)
    capacity_scale: NDArray[np.float64] | None = None

    def factor(self, name: str) -> float:
        """Factor on a coefficient."""
        return self.coefficients.get(name, 1.0)


NO_CHANGE = LoadChange()


@dataclass(frozen=True, slots=True)
class Loads:
    """Everything that the conduction problem needs beside mesh and materials.

    Attributes
    ----------
    surface_heat : mapping of surface to float, [W]
        Spread evenly over the surface.
    films : mapping of surface to FilmLoad
    bearing_heat : mapping of bearing to BearingHeat
    heat_to : mapping of bearing to {"inner", "outer", "balls"} shares in W
    source_heat : mapping of heat source to float, [W]
        Of the definition; where it enters is the conduction problem's.
    inlets : mapping of stream to float, [K]
        Where its fluid enters.
    change : LoadChange
        What is in them already, but for joints, conductivities, nodal heat
        and capacities, which are the conduction problem's.
    """

    surface_heat: Mapping[str, float]
    films: Mapping[str, FilmLoad]
    lumped: tuple[LumpedLoad, ...]
    bearing_heat: Mapping[str, BearingHeat]
    heat_to: Mapping[str, Mapping[str, float]]
    warnings: tuple = field(default=())
    change: LoadChange = NO_CHANGE
    source_heat: Mapping[str, float] = field(default_factory=dict)
    inlets: Mapping[str, float] = field(default_factory=dict)

    @property
    def total_heat(self) -> float:
        """All heat put in, W."""
        nodal = sum(float(heat.sum()) for heat in self.change.nodal_heat.values())
        given = sum(self.surface_heat.values()) + sum(self.source_heat.values())
        return given + sum(node.heat for node in self.lumped) + nodal
