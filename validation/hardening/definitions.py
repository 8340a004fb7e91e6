"""Spoilt definitions of machines: checked, and solved where they are accepted."""

from __future__ import annotations

import random
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from .child import run_command, run_function, run_process
from .judged import ACCEPTED, BAD_INPUT, OTHER_REFUSAL, Record
from .mutations import HOSTILE, NUMBERS, UNITS, mutated

ROOT = Path(__file__).parents[2]
# Numbers that these divide are checked by an interpreter of their own, and solved by finite elements.
EVERY_PROCESS, EVERY_ELEMENTS = 50, 20
SHARE_OVERRIDES = 0.1
OVERRIDDEN = ("operation.speed", "operation.thrust", "channel.depth", "channel.pitch", "coolant.flow")
OVERRIDDEN = (*OVERRIDDEN, "mesh.preset", "heat.model", "channel.turns", "part.0.name", "name", "x.y.z", "")
LARGEST_IMBALANCE = 1.0e-8
# What rounding leaves of the rule that nothing is colder than all its surroundings, K.
BELOW_COLDEST = 0.01


@cache
def sources() -> dict[str, dict[str, Any]]:
    """Tables of every definition that is at hand, by name; those with a base as they are written."""
    files = [*sorted((ROOT / "geometry").glob("*.toml")), ROOT / "examples" / "pump.toml"]
    return {path.stem: tomllib.loads(path.read_text(encoding="utf-8")) for path in files}


def try_definition(number: int, chance: random.Random, folder: Path) -> Record:
    """Check one spoilt definition; solve it where it is accepted."""
    record = Record("definitions", number)
    name = chance.choice(sorted(sources()))
    content, record.done = mutated(chance, sources()[name])
    record.done.insert(0, name)
    file = folder / "machine.toml"
    file.write_bytes(content)
    given = ["--set", _override(chance)] if chance.random() < SHARE_OVERRIDES else []
    record.done += given
    run = run_process if number % EVERY_PROCESS == 0 else run_command
    if record.step("check", run(["check", file.name, *given], folder)) == ACCEPTED:
        _run_accepted(record, file, given, folder)
    return record


def _override(chance: random.Random) -> str:
    value = chance.choice([f"{chance.choice(NUMBERS)} {chance.choice(UNITS)}", *HOSTILE])
    return f"{chance.choice(OVERRIDDEN)}{chance.choice(('=', '=', '==', ' '))}{value}".replace("\0", "")


def _run_accepted(record: Record, file: Path, given: list[str], folder: Path) -> None:
    refusals = (BAD_INPUT, OTHER_REFUSAL)
    if "[[network" in file.read_text(encoding="utf-8"):
        return
    if record.number % EVERY_ELEMENTS == 0:
        record.ran = "elements"
        arguments = ["run", file.name, "-o", "out", *given, "--set", "mesh.preset=coarse"]
        record.step("run", run_command(arguments, folder), refusals)
    else:
        record.ran = "network"
        record.step("network", run_function(lambda: solve_network(file, given[1:]), folder), refusals)


def solve_network(file: Path, overrides: list[str]) -> int:
    """Steady state of a machine by its own lumped network, with its checks; the exit status of a command."""
    import sys

    from spindle_fem.definition.load import load_machine
    from spindle_fem.errors import SpindleFemError
    from spindle_fem.model.lumped.machine_network import build_machine_network
    from spindle_fem.operation.bearing_heat import heat_model_of
    from spindle_fem.operation.operating_point import OperatingPoint
    from spindle_fem.solvers.machine_network_steady import solve_machine_network

    try:
        spec = load_machine(file, overrides)
        point = OperatingPoint.of(spec)
        state = solve_machine_network(build_machine_network(spec), point, heat_model=heat_model_of(spec))
        if not np.isfinite(state.temperature).all():
            raise AssertionError("temperatures that are no numbers")
        below = point.coldest - float(state.temperature.min())
        if not abs(state.imbalance_relative) <= LARGEST_IMBALANCE or below > BELOW_COLDEST:
            raise AssertionError(f"imbalance {state.imbalance_relative:.1e}, {below:.3f} K below the coldest")
    except SpindleFemError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return error.exit_status
    return 0
