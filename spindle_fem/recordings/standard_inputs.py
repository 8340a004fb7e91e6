"""Inputs that every machine with geometry has, and their values where a recording does not give them."""

from __future__ import annotations

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.geometry.coolant_path import delivered_flow


def standard_inputs(spec: MachineSpec) -> dict[str, float]:
    """Inputs as the definition has them, SI, for those that a recording does not give.

    The flow is what the pump drives at the definition's inlet temperature.
    """
    operation, coolant = spec.operation, spec.coolant
    inlet = coolant.inlet_temperature if coolant else operation.ambient_temperature
    return {
        "speed": operation.speed,
        "thrust": operation.thrust,
        "ambient": operation.ambient_temperature,
        "coolant_inlet": inlet,
        "coolant_flow": float(delivered_flow(spec, inlet)),
    }
