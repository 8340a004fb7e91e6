"""Operating point of a machine: speed and its range, loads, air."""

from __future__ import annotations

from typing import Annotated

from pydantic import model_validator

from spindle_fem.definition.field_types import (
    AllowedText,
    Fault,
    Force,
    Power,
    RotationalSpeed,
    SpecModel,
    Temperature,
    Torque,
    raise_faults,
)

SpeedRange = Annotated[
    tuple[RotationalSpeed, RotationalSpeed], AllowedText('two speeds such as ["500 rpm", "12000 rpm"]')
]


class Operation(SpecModel):
    """Steady operating point."""

    speed: RotationalSpeed
    """Speed of the shaft."""
    thrust: Force
    """External axial force on the shaft, positive towards the rear."""
    ambient_temperature: Temperature
    """Temperature of the air around the machine."""
    torque: Torque | None = None
    """Torque of the drive, for heat sources that follow it; an input that drives ``torque`` replaces it."""
    power: Power | None = None
    """Mechanical power of the drive in place of `torque`, which then is this over `speed`."""
    speed_range: SpeedRange | None = None
    """Lowest and highest speed at which the machine runs: charts and tables over speed, fast and exported
    models, and the search for the end of equilibria go by it. Without it by `speed` alone, half as fast again
    in charts."""

    @model_validator(mode="after")
    def _check(self) -> Operation:
        faults, ends = [], self.speed_range
        if self.power is not None:
            if self.torque is not None:
                faults.append(Fault("power", "is given beside torque.", "Allowed: one of both."))
            if self.speed == 0.0:
                faults.append(Fault("power", "is given at rest.", "Give torque instead."))
        if ends is not None and ends[1] <= ends[0]:
            faults.append(Fault("speed_range", "its entries do not grow.", "Allowed: lowest, then highest."))
        raise_faults(faults)
        return self

    @property
    def load_torque(self) -> float | None:
        """Torque of the drive, N m; None where the operation does not say it."""
        return self.torque if self.power is None else self.power / self.speed


__all__ = ["Operation"]
