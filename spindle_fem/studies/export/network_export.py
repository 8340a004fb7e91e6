"""A written network as a state space: constant matrices, every node an output, steps exact."""

from __future__ import annotations

import numpy as np

from spindle_fem.errors import SpecError
from spindle_fem.model.lumped.thermal_network import ThermalNetwork
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS, ActiveEffects
from spindle_fem.model.reduced.drive import LARGEST_STEP
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.studies.export.effect_export import ExportedEffects, heat_powers
from spindle_fem.studies.export.state_space import (
    CELSIUS,
    CONSTANT,
    EXACT,
    USUAL_TEMPERATURE,
    ModelInput,
    PowerLoad,
    StateSpace,
    header_of,
    modal_basis,
    power_load_arrays,
    unit_of_input,
)
from spindle_fem.units import ZERO_CELSIUS_K


def network_state_space(fast: FastModel, name: str, effects: ActiveEffects = NO_EFFECTS) -> StateSpace:
    """State space of a network's fast model, as the definition has it.

    Parameters
    ----------
    name : str
        Of the machine.

    Raises
    ------
    SpecError
        A network that nothing drives.
    FaultsError
        Effects that an exported model cannot hold.
    """
    network, held = fast.network, ExportedEffects(fast, effects)
    inputs = network_inputs(network)
    if not inputs:
        raise SpecError(
            "network", "has no input to be driven by.", "Let an input drive a source or a boundary."
        )
    position = {item.name: number for number, item in enumerate(inputs)}
    scales, _ = fast.inputs.friction_loads(np.ones((1, len(network.source_names))), held.factors)
    loads = [
        PowerLoad(
            f"source.{source}",
            "W",
            -1 if driven is None else position[driven],
            float(gain * scale),
            float(exponent),
            ZERO_CELSIUS_K if driven is not None and inputs[position[driven]].unit == CELSIUS else 0.0,
        )
        for source, driven, gain, scale, exponent in zip(
            network.source_names,
            network.source_input,
            network.source_gain,
            scales[0],
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
    added = heat_powers(held, inputs)
    nothing = [PowerLoad(CONSTANT, "1", -1)] if held.sensors else []
    loads += [*(load for _, load in added), *nothing]
    storage = fast.storage(held.factors, held.capacities)
    nowhere = OperatingPoint(*[np.nan] * 5)
    operators = fast.operators(
        nowhere, held.factors, changes=held.changes(nowhere), conductances=held.conductances
    )
    modes = modal_basis(storage, operators.conduction)
    header = header_of(
        name,
        EXACT,
        LARGEST_STEP,
        inputs,
        dict.fromkeys(fast.channels, CELSIUS),
        {load.name: load.unit for load in loads},
    )
    header["notes"] += held.notes
    more = [*(fast.model.place(place) for place, _ in added), *(np.zeros(fast.model.size) for _ in nothing)]
    entering = np.array(more).reshape(-1, fast.model.size).T
    output = operators.outputs @ modes
    direct = np.pad(operators.output_inputs, ((0, 0), (0, len(more))))
    held.read(fast.channels, [load.name for load in loads], output, direct)
    arrays = power_load_arrays(loads) | {
        # Rounding apart, a diagonal matrix.
        "conduction": np.diag(np.diag(modes.T @ operators.conduction @ modes)),
        "load": modes.T @ np.hstack((operators.loads, entering)),
        "output": output,
        "feedthrough": direct,
        "uniform": modes.T @ storage @ fast.model.one,
    }
    return StateSpace(header, arrays)


def network_inputs(network: ThermalNetwork) -> list[ModelInput]:
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
