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

    Angles in rad; ``preload`` in N is the axial force at this state without the
    external load, ``axial_load`` with it; film in m; ``nan`` where a heat model does not give them.
    ``conductance_inner`` and ``conductance_outer`` (W/K) join the balls to
    each raceway and are ``nan`` where the model has no contacts.
    """

    total: float
    terms: Mapping[str, float]
    contact_angle_inner: float = float("nan")
    contact_angle_outer: float = float("nan")
    preload: float = float("nan")
    axial_load: float = float("nan")
    film_thickness: float = float("nan")
    film_thickness_ratio: float = float("nan")
    conductance_inner: float = float("nan")
    conductance_outer: float = float("nan")


@dataclass(frozen=True, slots=True)
class Loads:
    """Everything that the conduction problem needs beside mesh and materials.

    Attributes
    ----------
    surface_heat : mapping of surface to float, [W]
        Spread evenly over the surface.
    films : mapping of surface to FilmLoad
    lumped : tuple of LumpedLoad
    bearing_heat : mapping of bearing to BearingHeat
    heat_to : mapping of bearing to {"inner", "outer", "balls"} shares in W
    """

    surface_heat: Mapping[str, float]
    films: Mapping[str, FilmLoad]
    lumped: tuple[LumpedLoad, ...]
    bearing_heat: Mapping[str, BearingHeat]
    heat_to: Mapping[str, Mapping[str, float]]
    warnings: tuple = field(default=())

    @property
    def total_heat(self) -> float:
        """All heat put in, W."""
        return sum(self.surface_heat.values()) + sum(node.heat for node in self.lumped)
