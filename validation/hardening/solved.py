"""Accepted machines solved: by elements, by their own network, or as the network that they are; with checks.

Each function returns a command's status: 0, or that of the error, which is printed.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path

import numpy as np

LARGEST_IMBALANCE = 1.0e-8
# Rounding error allowed in the rule that nothing is colder than all its surroundings, K.
BELOW_COLDEST = 0.01
# Inputs of a written network here: a room, and any source, in SI.
ROOM, SOURCE = 293.15, 10.0


class UnsoundResultError(Exception):
    """A result that its own checks should have refused."""


def _as_command(function: Callable[..., None]) -> Callable[..., int]:
    @wraps(function)
    def ended(*arguments: object) -> int:
        from spindle_fem.errors import SpindleFemError

        try:
            function(*arguments)
        except SpindleFemError as error:
            print(f"{type(error).__name__}: {error}", file=sys.stderr)
            return error.exit_status
        return 0

    return ended


@_as_command
def solve_elements(file: Path, overrides: list[str]) -> None:
    """Steady state by finite elements on the coarse mesh, every self-check required."""
    from spindle_fem.definition.load import load_machine
    from spindle_fem.studies.run_checks import require_checks
    from spindle_fem.studies.solve_machine import solve

    result = solve(load_machine(file, [*overrides, "mesh.preset=coarse"]))
    require_checks(result.checks, result.spec.name)
    _require_sound(result.temperature, result.energy.imbalance_relative)


@_as_command
def solve_lumped(file: Path, overrides: list[str]) -> None:
    """Steady state by the machine's own lumped network."""
    from spindle_fem.definition.load import load_machine
    from spindle_fem.model.lumped.machine_network import build_machine_network
    from spindle_fem.operation.bearing_heat import heat_model_of
    from spindle_fem.operation.operating_point import OperatingPoint
    from spindle_fem.solvers.machine_network_steady import solve_machine_network

    spec = load_machine(file, overrides)
    point = OperatingPoint.of(spec)
    state = solve_machine_network(build_machine_network(spec), point, heat_model=heat_model_of(spec))
    _require_sound(state.temperature, state.imbalance_relative)
    coldest = min([point.coldest, *(film.inlet_temperature for film in spec.circuits)])
    below = coldest - float(state.temperature.min())
    if below > BELOW_COLDEST:
        raise UnsoundResultError(f"{below:.3g} K below the coldest surroundings")


@_as_command
def solve_written(file: Path, overrides: list[str]) -> None:
    """Steady state of a network that the definition writes down."""
    from spindle_fem.definition.network_load import load_network_machine
    from spindle_fem.model.lumped.written_network import build_network
    from spindle_fem.solvers.network_steady import solve_steady

    network = build_network(load_network_machine(file, overrides).network)
    inputs = dict.fromkeys(network.input_names, SOURCE)
    inputs |= {name: ROOM for name in network.boundary_input if name is not None}
    state = solve_steady(network, inputs)
    _require_sound(state.temperature, state.imbalance_relative)
    heat, around = network.node_heat(network.source_values(inputs)), state.boundary_temperature
    below, above = (
        float(around.min() - state.temperature.min()),
        float(state.temperature.max() - around.max()),
    )
    for beyond, forbidden in ((below, (heat >= 0.0).all()), (above, (heat <= 0.0).all())):
        if forbidden and beyond > BELOW_COLDEST:
            raise UnsoundResultError(
                f"{beyond:.3g} K beyond its surroundings without a source that does this"
            )


def _require_sound(temperature: np.ndarray, imbalance: float) -> None:
    if not np.isfinite(temperature).all():
        raise UnsoundResultError("temperatures that are no numbers")
    if not abs(imbalance) <= LARGEST_IMBALANCE:
        raise UnsoundResultError(f"imbalance {imbalance:.1e}")
