"""Boundary temperatures and source heat of a network from its inputs over time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spindle_fem.errors import OutOfValidityError
from spindle_fem.model.lumped.thermal_network import Array, ThermalNetwork


def boundary_temperatures(network: ThermalNetwork, inputs: Mapping[str, Array], number: int) -> Array:
    """Boundary temperatures, ``(number, b) [K]``, of inputs that are ``(number,)`` each."""
    result = np.tile(network.boundary_temperature, (number, 1))
    for position, name in enumerate(network.boundary_input):
        if name is not None:
            result[:, position] = inputs[name]
    return result


def source_heat(network: ThermalNetwork, inputs: Mapping[str, Array], number: int) -> Array:
    """Heat of each source, ``(number, s) [W]``, of inputs that are ``(number,)`` each.

    Raises
    ------
    OutOfValidityError
        A negative input under an exponent that is not a whole number.
    """
    result = np.tile(network.source_gain, (number, 1))
    for position, name in enumerate(network.source_input):
        if name is None:
            continue
        driven, exponent = inputs[name], float(network.source_exponent[position])
        if not exponent.is_integer() and np.any(driven < 0.0):
            raise OutOfValidityError(
                f'source "{network.source_names[position]}"',
                f'input "{name}" falls to {driven.min():g}, which has no power {exponent:g}.',
                "Give the magnitude of the input, or a whole exponent.",
            )
        result[:, position] *= driven**exponent
    return result
