"""Sliding in both contacts and the balls' drag: equations 24 to 26 of Wu & Tan (2016)."""

from __future__ import annotations

from spindle_fem.physics.bearings.bearing_state import BearingHeat
from spindle_fem.physics.bearings.heat_model import HeatInputs, HeatOptions, friction_model, ring_terms
from spindle_fem.physics.bearings.heat_models import HEAT_MODELS


@HEAT_MODELS.register
@friction_model(ball_attitude="equilibrium")
def paper(inputs: HeatInputs, options: HeatOptions) -> BearingHeat:
    """Sliding along and across the rolling direction at each ring, and drag of the balls in the grease."""
    per_contact = {
        "sliding": inputs.traction.power_rolling,
        "transverse": inputs.traction.power_across,
    }
    terms = ring_terms(inputs, per_contact)
    drag_power = 0.5 * inputs.geometry.pitch_diameter * inputs.orbital * inputs.drag
    terms["ball_drag"] = float(drag_power @ inputs.system.weight)
    return BearingHeat("paper", terms, per_contact)
