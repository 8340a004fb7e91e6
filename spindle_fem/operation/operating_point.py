"""The instantaneous inputs of a machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.recordings.standard_inputs import standard_inputs


@dataclass(frozen=True, slots=True)
class OperatingPoint:
    """Inputs of the machine at one instant, SI.

    Attributes
    ----------
    speed : float, [rad/s]
    thrust : float, [N]
    ambient_temperature, coolant_inlet_temperature : float, [K]
    coolant_flow : float, [m³/s]
        Actual flow, not the flow requested from a pump.
    extra_heat : mapping of source name to float, [W]
    beside : mapping of str to float
        What was recorded beside the inputs and only terms follow, ``covariate.<column>``, or what
        the machine's own heat sources follow.
    """

    speed: float
    thrust: float
    ambient_temperature: float
    coolant_inlet_temperature: float
    coolant_flow: float
    extra_heat: Mapping[str, float] = field(default_factory=dict)
    beside: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, spec: MachineSpec) -> OperatingPoint:
        """The steady operating point of the definition."""
        return cls(*standard_inputs(spec).values())

    @property
    def inputs(self) -> dict[str, float]:
        """Inputs by the names that terms know."""
        return {
            "speed": self.speed,
            "thrust": self.thrust,
            "ambient": self.ambient_temperature,
            "coolant_inlet": self.coolant_inlet_temperature,
            "coolant_flow": self.coolant_flow,
            **{f"heat.{name}": heat for name, heat in self.extra_heat.items()},
            **self.beside,
        }

    def inlet_of(self, film: StreamFilm) -> float:
        """Inlet temperature of a stream, K: as recorded, else the definition's."""
        return self.beside.get(film.inlet_input, film.inlet_temperature)

    @property
    def coldest(self) -> float:
        """Lowest temperature that anything outside the solids has, K."""
        return min(self.ambient_temperature, self.coolant_inlet_temperature)
