"""Boundary temperatures and source heat of a network over the history of its inputs."""

from __future__ import annotations

import numpy as np

from spindle_fem.errors import OutOfValidityError
from spindle_fem.model.lumped.thermal_network import Array, ThermalNetwork
from spindle_fem.recordings.input_samples import InputHistory


def boundary_history(network: ThermalNetwork, history: InputHistory, values: Array) -> Array:
    """Boundary temperatures, ``(N, b) [K]``, of input values ``(N, m)``."""
    result = np.tile(network.boundary_temperature, (len(values), 1))
    for position, name in enumerate(network.boundary_input):
        if name is not None:
            result[:, position] = values[:, history.column(name)]
    return result


def source_history(network: ThermalNetwork, history: InputHistory, values: Array) -> Array:
    """Heat of each source, ``(N, s) [W]``, of input values ``(N, m)``.

    Raises
    ------
    OutOfValidityError
        A negative input under an exponent that is not a whole number.
    """
    result = np.tile(network.source_gain, (len(values), 1))
    for position, name in enumerate(network.source_input):
        if name is None:
            continue
        driven, exponent = values[:, history.column(name)], float(network.source_exponent[position])
        if exponent == 1.0:
            result[:, position] *= driven
            continue
        if not exponent.is_integer() and np.any(driven < 0.0):
            raise OutOfValidityError(
                f'source "{network.source_names[position]}"',
                f'input "{name}" falls to {driven.min():g}, which has no power {exponent:g}.',
                "Give the magnitude of the input, or a whole exponent.",
            )
        result[:, position] *= driven**exponent
    return result
