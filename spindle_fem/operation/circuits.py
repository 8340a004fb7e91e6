"""Streams beside the channel (circuits, oil or air through bearings): their films, and how they warm.

Properties and film are those of the inlet, so that at given coefficients everything is linear in the
temperatures of the walls. Every model takes the warming from here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.circuit_tables import CircuitFilm, WettedFilm
from spindle_fem.definition.lubrication_tables import LubricationFilm
from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.operation.bearing_lubricants import bearing_stream, lubrication_oil
from spindle_fem.physics.coolant.duct_films import DUCT_FILMS
from spindle_fem.physics.coolant.duct_kinds import DUCT_KINDS
from spindle_fem.physics.coolant.ducts import DuctFlow, DuctShape
from spindle_fem.physics.coolant.falling_film import falling_film
from spindle_fem.physics.coolant.linear_march import march_maps
from spindle_fem.physics.coolant.lubrication_kinds import LUBRICATION_KINDS
from spindle_fem.physics.coolant.properties import Coolant, coolant_by_name
from spindle_fem.physics.coolant.pump import PUMP_PRESSURE, Pump
from spindle_fem.physics.coolant.streams import StreamAnswer
from spindle_fem.validity import CodedWarning

Array = NDArray[np.float64]

# Pa; a tenth of the atmosphere.
AIR_PRESSURE_DROP = 1.0e4


def stream_fluid(film: StreamFilm) -> Coolant:
    """Liquid or air of a stream; of oil-air its oil."""
    if isinstance(film, LubricationFilm):
        return lubrication_oil(film.lubrication)
    return coolant_by_name(film.fluid)


def stream_answer(film: StreamFilm, speed: float) -> StreamAnswer:
    """Flow and film of a stream at a speed of the shaft [rad/s]."""
    if isinstance(film, LubricationFilm):
        return LUBRICATION_KINDS[film.lubrication.kind].film(bearing_stream(film, speed))
    if isinstance(film, WettedFilm):
        return falling_film(stream_fluid(film), film.flow, film.inlet_temperature, film.width, film.length)
    flow = duct_flow(film, speed)
    answer = DUCT_FILMS[film.law](flow)
    conductivity = float(flow.properties.thermal_conductivity)
    in_duct = answer.nusselt * conductivity / flow.section.hydraulic_diameter
    return StreamAnswer(
        coefficient=in_duct * flow.section.wetted_ratio,
        capacity_rate=flow.capacity_rate,
        volume_flow=flow.volume_flow,
        reynolds=flow.reynolds,
        prandtl=flow.prandtl,
        velocity=flow.velocity,
        regime=flow.regime,
        pressure_drop=flow.pressure_drop,
        source=answer.source,
        faults=(*answer.faults, *flow.friction_faults, *_expansion(film, flow)),
    )


def wall_coefficients(film: StreamFilm, answer: StreamAnswer) -> Array:
    """Coefficient on every wall of a stream, in the order of ``film.surface``, (k,) W/(m²·K)."""
    row = np.array([name == film.ball_row for name in film.surface])
    return film.factor.value * np.where(row, answer.element_coefficient, answer.coefficient)


def _expansion(film: CircuitFilm, flow: DuctFlow) -> tuple[str, ...]:
    """Air whose pressure falls by more than a tenth of an atmosphere is no fluid of constant density."""
    if film.fluid != "air" or flow.pressure_drop <= AIR_PRESSURE_DROP:
        return ()
    return (f"air expands as its pressure falls by {1e-5 * flow.pressure_drop:.2g} bar",)


def stream_warnings(film: StreamFilm, answer: StreamAnswer) -> tuple[CodedWarning, ...]:
    """Warnings of values outside the range of a stream's laws."""
    found = []
    pressure = f"{1e-5 * answer.pressure_drop:.3g} bar"
    if answer.volume_flow < film.flow * (1.0 - 1.0e-9):
        text = (
            f"Circuit {film.name}: the pump drives {6e4 * answer.volume_flow:.3g} L/min instead of "
            f"{6e4 * film.flow:.3g}: the duct takes {pressure}, all that is given at that flow."
        )
        found.append(CodedWarning("coolant_flow_limited", text))
    elif answer.pressure_drop > PUMP_PRESSURE:
        text = (
            f"Circuit {film.name} takes {pressure} at {6e4 * film.flow:.3g} L/min; pumps of coolers give up "
            f"to {1e-5 * PUMP_PRESSURE:.0f} bar, so less will flow: pressure_limit or pump_curve says what."
        )
        found.append(CodedWarning("coolant_pressure", text))
    if answer.faults:
        text = f"Circuit {film.name}: {'; '.join(answer.faults)} ({answer.source})."
        found.append(CodedWarning("circuit_film_extrapolated", text))
    return tuple(found)


def capacity_rate(film: StreamFilm) -> float:
    """Mass flow times heat capacity of a whole stream, W/K; the same at every speed."""
    return stream_answer(film, 0.0).capacity_rate


def duct_flow(film: CircuitFilm, speed: float = 0.0) -> DuctFlow:
    """Flow through the duct of a circuit at a speed of the shaft [rad/s]."""
    shape = DuctShape(
        diameter=film.diameter,
        length=film.length,
        outer_diameter=film.outer_diameter,
        width=film.width,
        depth=film.depth,
        number=film.number,
        passes=film.passes,
        turns=film.turns,
        bore_diameter=film.bore_diameter,
        covered=film.is_covered,
    )
    coolant = stream_fluid(film)
    section = DUCT_KINDS[film.duct](shape)
    asked = DuctFlow(section, film.length, coolant, film.flow, film.inlet_temperature, speed)
    curve = film.pump_curve
    pump = Pump(
        film.flow,
        np.inf if film.pressure_limit is None else film.pressure_limit,
        () if curve is None else curve.flow,
        () if curve is None else curve.pressure,
    )
    return replace(
        asked, volume_flow=pump.delivered(lambda flow: replace(asked, volume_flow=flow).pressure_drop)
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
    bulk_from_wall : (n, n) ndarray, [-]
        Mean coolant of each cell above the inlet, for each kelvin of each cell's wall above it.
    outlet_from_wall : (n,) ndarray, [-]
        Mixed outlet likewise.
    capacity_rate : float, [W/K]
    """

    cell: NDArray[np.int64]
    share: Array
    bulk_from_wall: Array
    outlet_from_wall: Array
    capacity_rate: float

    @classmethod
    def of(cls, film: StreamFilm, conductance: Array, cell: NDArray[np.int64]) -> CircuitMarch:
        """March of a circuit.

        Parameters
        ----------
        conductance : (k,) ndarray, [W/K]
            Of each piece of wall to the coolant; may be complex, for derivatives by a complex step.
        cell : (k,) int ndarray
            Cell of each, from the inlet.
        """
        total = np.zeros(film.n_cells, dtype=conductance.dtype)
        np.add.at(total, cell, conductance)
        share = np.zeros((film.n_cells, len(cell)), dtype=conductance.dtype)
        # A wall that does not conduct gives nothing; its share is of no account.
        there = total[cell] != 0.0
        share[cell, np.arange(len(cell))] = np.where(
            there, conductance / np.where(there, total[cell], 1.0), 0.0
        )
        rate = capacity_rate(film)
        if film.in_parallel:
            alone = march_maps(rate / film.n_cells, np.ones((film.n_cells, 1)), total[:, None])
            bulk = np.diag(alone.bulk_from_wall[:, 0, 0])
            return cls(cell, share, bulk, alone.outlet_from_wall[:, 0] / film.n_cells, rate)
        maps = march_maps(rate, np.ones(film.n_cells), total)
        return cls(cell, share, maps.bulk_from_wall, maps.outlet_from_wall, rate)

    @property
    def warming(self) -> Array:
        """Coolant at each wall above the inlet, for each kelvin of each wall above the inlet, (k, k)."""
        return (self.bulk_from_wall @ self.share)[self.cell]

    @property
    def outlet(self) -> Array:
        """Outlet above the inlet, for each kelvin of each wall above the inlet, (k,)."""
        return self.outlet_from_wall @ self.share


def wall_cells(film: StreamFilm) -> NDArray[np.int64]:
    """Cell of each wall of a circuit, in the order of ``film.surface``."""
    return np.array([n for n, names in enumerate(film.cell_surfaces) for _ in names], dtype=np.int64)


def coolant_temperatures(
    film: StreamFilm, conductance: Mapping[str, float], wall: Mapping[str, float], inlet: float
) -> tuple[dict[str, float], float]:
    """Coolant at every wall of a circuit and at its outlet, K.

    Parameters
    ----------
    conductance, wall : mapping of surface to float, [W/K], [K]
        Film times area, mean temperature.
    inlet : float, [K]
    """
    names = film.surface
    march = CircuitMarch.of(film, np.array([conductance[name] for name in names]), wall_cells(film))
    rise = np.array([wall[name] for name in names]) - inlet
    found = inlet + march.warming @ rise
    return dict(zip(names, found.tolist(), strict=True)), inlet + float(march.outlet @ rise)
