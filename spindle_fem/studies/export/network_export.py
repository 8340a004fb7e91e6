"""A written network as a state space: constant matrices, every node an output, steps exact."""

from __future__ import annotations

import numpy as np

from spindle_fem.errors import SpecError
from spindle_fem.model.lumped.thermal_network import ThermalNetwork
from spindle_fem.model.reduced.drive import LARGEST_STEP
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.studies.export.state_space import (
    CELSIUS,
    EXACT,
    USUAL_TEMPERATURE,
    ModelInput,
    PowerLoad,
    StateSpace,
    header_of,
    modal_basis,
    power_load_arrays,
)
from spindle_fem.units import ZERO_CELSIUS_K, registry

# How units of inputs are written where they have these dimensions.
USUAL_UNITS = ("", "W", "rad/s", "N", "N*m", "A", "V", "m/s", "m**3/s", "Pa")


def network_state_space(fast: FastModel, name: str) -> StateSpace:
    """State space of a network's fast model, as the definition has it.

    Parameters
    ----------
    name : str
        Of the machine.

    Raises
    ------
    SpecError
        A network that nothing drives.
    """
    network = fast.network
    inputs = _inputs(network)
    if not inputs:
        raise SpecError(
            "network", "has no input to be driven by.", "Let an input drive a source or a boundary."
        )
    position = {item.name: number for number, item in enumerate(inputs)}
    loads = [
        PowerLoad(
            f"source.{source}",
            "W",
            -1 if driven is None else position[driven],
            float(gain),
            float(exponent),
            ZERO_CELSIUS_K if driven is not None and inputs[position[driven]].unit == CELSIUS else 0.0,
        )
        for source, driven, gain, exponent in zip(
            network.source_names,
            network.source_input,
            network.source_gain,
            network.source_exponent,
            strict=True,
        )
    ]
    loads += [
        PowerLoad(f"boundary.{boundary}", CELSIUS, -1, float(temperature) - ZERO_CELSIUS_K)
        if driven is None
        else PowerLoad(f"boundary.{boundary}", CELSIUS, position[driven])
        for boundary, driven, temperature in zip(
            network.boundary_names, network.boundary_input, network.boundary_temperature, strict=True
        )
    ]
    storage = fast.storage({})
    operators = fast.operators(OperatingPoint(*[np.nan] * 5), {})
    modes = modal_basis(storage, operators.conduction)
    header = header_of(
        name,
        EXACT,
        LARGEST_STEP,
        inputs,
        dict.fromkeys(fast.channels, CELSIUS),
        {load.name: load.unit for load in loads},
    )
    arrays = power_load_arrays(loads) | {
        # Rounding apart, a diagonal matrix.
        "conduction": np.diag(np.diag(modes.T @ operators.conduction @ modes)),
        "load": modes.T @ operators.loads,
        "output": operators.outputs @ modes,
        "feedthrough": operators.output_inputs,
        "uniform": modes.T @ storage @ fast.model.one,
    }
    return StateSpace(header, arrays)


def _inputs(network: ThermalNetwork) -> list[ModelInput]:
    """Inputs in the network's order; a temperature where one drives a boundary."""
    return [
        ModelInput(name, CELSIUS, USUAL_TEMPERATURE)
        if name in network.boundary_input
        else _source_input(network, name)
        for name in network.input_names
    ]


def _source_input(network: ThermalNetwork, name: str) -> ModelInput:
    """Input that only sources follow: its unit is what makes their gain a heat."""
    followed = [number for number, driven in enumerate(network.source_input) if driven == name]
    gain, exponent = network.source_gain_unit[followed[0]], float(network.source_exponent[followed[0]])
    unit = unit_of_input(gain, exponent)
    whole = all(float(network.source_exponent[number]).is_integer() for number in followed)
    turning = unit == "rad/s"
    return ModelInput(name, unit or "1", 0.0, None if whole and not turning else 0.0, magnitude=turning)


def unit_of_input(gain_unit: str, exponent: float) -> str:
    """SI unit of an input whose power times a gain is a heat; empty for a pure number.

    >>> unit_of_input("W/(rad/s)**1.5", 1.5)
    'rad/s'
    """
    units = registry()
    known = units.Quantity(1.0, gain_unit or "dimensionless")
    wanted = ((units.Quantity(1.0, "W") / known) ** (1.0 / exponent)).to_base_units()
    for unit in USUAL_UNITS:
        # Dimensions with rounded exponents.
        own = units.Quantity(1.0, unit or "dimensionless").to_base_units()
        ratio = (wanted / own).dimensionality
        if all(abs(power) < 1e-9 for power in dict(ratio).values()):
            return unit
    return f"{wanted.units:~C}"
