"""A concealed effect with its part of the answer, and the scene from which it is drawn."""

from dataclasses import dataclass, field

import numpy as np

from .cycles import Plan
from .laws import Law
from .reduction import ReducedSpindle
from .sensor_errors import Sensor
from .stepping import Path

KINDS = {
    "joint_conductance": "parameter",
    "heat_split": "parameter",
    "heat_scale": "parameter",
    "heat_capacity": "parameter",
    "sensor_offset": "sensor",
    "sensor_gain": "sensor",
    "sensor_lag": "sensor",
    "sensor_drift": "sensor",
    "sensor_detached": "sensor",
    "clock_shift": "sensor",
}


@dataclass(slots=True)
class Concealed:
    """One effect in the machine, with its part of the answer."""

    effect: str
    component: str
    acceptable: list[str]
    amplitude: float
    machine: Law | None = None
    sensor: Sensor | None = None
    parameters: dict[str, tuple[float, str]] = field(default_factory=dict)
    intervals: list[list[float]] | None = None
    follows: str | None = None
    outside_catalogue: bool = False
    form: dict[str, object] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """Kind of the effect in the catalogue."""
        return KINDS.get(self.effect, "missing_physics")


@dataclass(frozen=True, slots=True)
class Scene:
    """Basis of a draw: the run of the same machine without any effect."""

    rng: np.random.Generator
    model: ReducedSpindle
    plan: Plan
    plain: Path
    strength: float

    def sign(self) -> float:
        """Plus or minus one."""
        return float(self.rng.choice([-1.0, 1.0]))

    def log(self, low: float, high: float) -> float:
        """Log-uniform draw."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def reading(self, name: str) -> np.ndarray:
        """Temperature over the plain run."""
        return self.plain.states @ self.model.readings[self.model.reading_names.index(name)]

    def factor(self, low: float, high: float) -> float:
        """Factor away from 1, drawn towards it with the strength."""
        return float(np.exp(self.sign() * self.log(low, high) * self.strength))
