"""Interface of streams past walls, whatever they flow through."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class StreamAnswer:
    """Flow and film of a stream, properties at its inlet.

    Attributes
    ----------
    coefficient : float, [W/(m²·K)]
        On the walls as they are drawn, before the film's own factor.
    capacity_rate : float, [W/K]
        Mass flow times heat capacity.
    volume_flow : float, [m³/s]
        What flows, at the inlet.
    reynolds, prandtl : float, [-]
    velocity : float, [m/s]
    pressure_drop : float, [Pa]
    source : str
        Of the film.
    faults : tuple of str
        What leaves the range of a law.
    element_coefficient : float, [W/(m²·K)]
        On the rolling elements that a stream through a bearing flows around; 0 where it meets none.
    """

    coefficient: float
    capacity_rate: float
    volume_flow: float
    reynolds: float
    prandtl: float
    velocity: float
    regime: str
    pressure_drop: float
    source: str
    faults: tuple[str, ...] = ()
    element_coefficient: float = 0.0
