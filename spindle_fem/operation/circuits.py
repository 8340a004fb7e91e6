"""Circuits beside the channel: their films, and how their coolant warms on its way.

Properties and film are those of the inlet, so that at given coefficients everything is linear in the
temperatures of the walls. Every model takes the warming from here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.circuit_tables import CircuitFilm
from spindle_fem.physics.coolant.duct_films import DUCT_FILMS
from spindle_fem.physics.coolant.duct_kinds import DUCT_KINDS
from spindle_fem.physics.coolant.ducts import DuctFlow
from spindle_fem.physics.coolant.linear_march import MarchMaps, march_maps
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.validity import CodedWarning

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CircuitAnswer:
    """Film of a circuit before its factor [W/(m²·K)], and what leaves the range of its law."""

    coefficient: float
    source: str
    warnings: tuple[CodedWarning, ...]


def duct_flow(film: CircuitFilm) -> DuctFlow:
    """Flow through the duct of a circuit."""
    section = DUCT_KINDS[film.duct](film.diameter, film.outer_diameter)
    return DuctFlow(section, film.length, coolant_by_name(film.fluid), film.flow, film.inlet_temperature)


def circuit_film(film: CircuitFilm) -> CircuitAnswer:
    """Mean film of a circuit by its law."""
    flow = duct_flow(film)
    answer = DUCT_FILMS[film.law](flow)
    conductivity = float(flow.properties.thermal_conductivity)
    warnings: tuple[CodedWarning, ...] = ()
    if answer.faults:
        text = f"Circuit {film.name}: {'; '.join(answer.faults)} ({answer.source})."
        warnings = (CodedWarning("circuit_film_extrapolated", text),)
    return CircuitAnswer(
        answer.nusselt * conductivity / flow.section.hydraulic_diameter, answer.source, warnings
    )


@dataclass(frozen=True, slots=True)
class CircuitMarch:
    """Coolant temperatures of one circuit from its walls, at given conductances.

    Attributes
    ----------
    cell : (k,) int ndarray
        Cell of each wall.
    share : (n, k) ndarray, [-]
        Of each wall's temperature in the one that its cell has.
    maps : MarchMaps
        Over the cells.
    capacity_rate : float, [W/K]
    """

    cell: NDArray[np.int64]
    share: Array
    maps: MarchMaps
    capacity_rate: float

    @classmethod
    def of(cls, film: CircuitFilm, conductance: Array, cell: NDArray[np.int64]) -> CircuitMarch:
        """March of a circuit.

        Parameters
        ----------
        conductance : (k,) ndarray, [W/K]
            Of each piece of wall to the coolant; may be complex, for derivatives by a complex step.
        cell : (k,) int ndarray
            Cell of each, from the inlet.
        """
        total = np.zeros(film.cells, dtype=conductance.dtype)
        np.add.at(total, cell, conductance)
        share = np.zeros((film.cells, len(cell)), dtype=conductance.dtype)
        # A wall that does not conduct gives nothing; its share is of no account.
        there = total[cell] != 0.0
        share[cell, np.arange(len(cell))] = np.where(
            there, conductance / np.where(there, total[cell], 1.0), 0.0
        )
        rate = duct_flow(film).capacity_rate
        return cls(cell, share, march_maps(rate, np.ones(film.cells), total), rate)

    @property
    def warming(self) -> Array:
        """Coolant at each wall above the inlet, for each kelvin of each wall above the inlet, (k, k)."""
        return (self.maps.bulk_from_wall @ self.share)[self.cell]

    @property
    def outlet(self) -> Array:
        """Outlet above the inlet, for each kelvin of each wall above the inlet, (k,)."""
        return self.maps.outlet_from_wall @ self.share


def wall_cells(film: CircuitFilm) -> NDArray[np.int64]:
    """Cell of each wall of a circuit, in the order of ``film.surface``."""
    return np.array([n for n, names in enumerate(film.cell_surfaces) for _ in names], dtype=np.int64)


def coolant_temperatures(
    film: CircuitFilm, conductance: Mapping[str, float], wall: Mapping[str, float]
) -> tuple[dict[str, float], float]:
    """Coolant at every wall of a circuit and at its outlet, K.

    Parameters
    ----------
    conductance, wall : mapping of surface to float, [W/K], [K]
        Film times area, mean temperature.
    """
    names, inlet = film.surface, film.inlet_temperature
    march = CircuitMarch.of(film, np.array([conductance[name] for name in names]), wall_cells(film))
    rise = np.array([wall[name] for name in names]) - inlet
    found = inlet + march.warming @ rise
    return dict(zip(names, found.tolist(), strict=True)), inlet + float(march.outlet @ rise)
