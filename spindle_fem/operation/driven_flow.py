"""What pumps drive through channel and ducts of a machine, held against what pumps of coolers give."""

from __future__ import annotations

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.geometry.coolant_path import CoolantPath
from spindle_fem.operation.circuits import stream_answer, stream_warnings
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.pump import PUMP_PRESSURE
from spindle_fem.validity import CodedWarning

CODES = ("coolant_pressure", "coolant_flow_limited")


def channel_warnings(spec: MachineSpec, flow: float, pressure_drop: float) -> list[CodedWarning]:
    """A flow that the machine's pump does not give, or that of no cooler drives through its channel.

    Parameters
    ----------
    flow : float, [m³/s]
        That of the channel, at most the definition's.
    pressure_drop : float, [Pa]
    """
    if spec.has_pump_limit:
        if flow >= spec.coolant.flow:
            return []
        text = (
            f"The pump drives {6e4 * flow:.3g} L/min instead of {6e4 * spec.coolant.flow:.3g}: the "
            f"channel takes {1e-5 * pressure_drop:.3g} bar, all that is given at that flow."
        )
        return [CodedWarning("coolant_flow_limited", text)]
    if pressure_drop <= PUMP_PRESSURE:
        return []
    text = (
        f"The channel takes {1e-5 * pressure_drop:.0f} bar at {6e4 * flow:.3g} L/min; pumps "
        f"of coolers give up to {1e-5 * PUMP_PRESSURE:.0f} bar, so less will flow: coolant.pressure_limit or "
        "coolant.pump_curve says how much."
    )
    return [CodedWarning("coolant_pressure", text)]


def flow_warnings(spec: MachineSpec) -> list[CodedWarning]:
    """Warnings of channel and circuits at the definition's operating point, before anything is solved."""
    found: list[CodedWarning] = []
    if spec.channel is not None and spec.coolant is not None:
        point = OperatingPoint.of(spec)
        drop = CoolantPath.of(spec).pressure_drop(point.coolant_flow, point.coolant_inlet_temperature)
        found += channel_warnings(spec, point.coolant_flow, drop.total)
    for film in spec.circuits:
        said = stream_warnings(film, stream_answer(film, spec.operation.speed))
        found += [warning for warning in said if warning.code in CODES]
    return found
