"""An own heat model: a function from what a bearing does to the heat it makes, beside one that ships."""

import numpy as np

import spindle_fem
from spindle_fem.physics.bearings.bearing_state import BearingHeat

COEFFICIENT = 1.5e-3  # of friction, on the pitch circle: a rule of thumb for angular contact ball bearings


@spindle_fem.HEAT_MODELS.register
@spindle_fem.friction_model()
def rubbing(inputs, options):
    """Coulomb friction: moment = coefficient times load times half the pitch diameter."""
    load = np.hypot(inputs.axial_force, inputs.radial_force)
    moment = COEFFICIENT * load * 0.5 * inputs.geometry.pitch_diameter
    return BearingHeat("rubbing", {"rubbing": float(moment * inputs.speed)}, {})


# The name of the function is now a value of heat.model, in definitions and in overrides.
heat = {}
for model in ("palmgren", "rubbing"):
    machine = spindle_fem.load_machine(
        "small_two_start", [f"heat.model={model}", "mesh.preset=coarse", "mesh.order=1"]
    )
    result = spindle_fem.solve(machine)
    heat[model] = {name: bearing.heat for name, bearing in result.bearings.items()}
    text = ", ".join(f"{name} {watts:.1f} W" for name, watts in heat[model].items())
    print(f"{model}: {text}; warmest {result.temperature_maximum - 273.15:.1f} degC")

assert 0.0 < heat["rubbing"]["B2"] < heat["palmgren"]["B2"]
