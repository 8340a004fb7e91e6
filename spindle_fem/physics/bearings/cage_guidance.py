"""Friction of a cage that a ring guides."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from spindle_fem.errors import SpecError


@dataclass(frozen=True, slots=True)
class CageGuidance:
    """A cage that runs on a ring's land: Petroff shear of a film.

    Attributes
    ----------
    land_diameter, land_width, clearance : float, [m]
        ``clearance`` is radial.
    land : {"inner", "outer"}
        Ring that guides it.
    """

    land_diameter: float
    land_width: float
    clearance: float
    land: Literal["inner", "outer"] = "outer"

    def __post_init__(self) -> None:
        for key in ("land_diameter", "land_width", "clearance"):
            if not getattr(self, key) > 0.0:
                raise SpecError(f"cage.{key}", f"it is {getattr(self, key):g} m.", "It must be above 0.")

    def power(self, viscosity: float, speed: float, orbital: float) -> float:
        """Heat of the guiding land, P = η π w d³ ω_rel²/(4c), W."""
        relative = speed - orbital if self.land == "inner" else orbital
        shear = viscosity * math.pi * self.land_width * self.land_diameter**3 * relative**2
        return shear / (4.0 * self.clearance)
