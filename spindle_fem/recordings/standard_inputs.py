"""Inputs that every machine with geometry has, and their values where a recording does not give them."""

from __future__ import annotations

from spindle_fem.definition.machine_spec import MachineSpec


def standard_inputs(spec: MachineSpec) -> dict[str, float]:
    """Inputs as the definition has them, SI, for those that a recording does not give."""
    operation, coolant = spec.operation, spec.coolant
    return {
        "speed": operation.speed,
        "thrust": operation.thrust,
        "ambient": operation.ambient_temperature,
        "coolant_inlet": coolant.inlet_temperature if coolant else operation.ambient_temperature,
        "coolant_flow": coolant.flow if coolant else 0.0,
    }
