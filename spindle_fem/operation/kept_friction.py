"""States of friction maps, kept in the cache: with radial loads they take minutes to solve."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.cache import cache_directory, load_record, save_record, source_digest
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import NoEquilibriumError, OutOfValidityError
from spindle_fem.operation.friction_map import FrictionStates, solve_friction

Array = NDArray[np.float64]

FORMAT = "spindle-fem/friction-states/1"
# Tables of a definition that no bearing feels.
_APART = {"name", "title", "description", "initial", "effects", "mesh", "probe", "factor"}
_ERRORS = {kind.__name__: kind for kind in (NoEquilibriumError, OutOfValidityError)}


def kept_friction(spec: MachineSpec, speeds: Array, thrusts: Array) -> FrictionStates:
    """As :func:`solve_friction`; solved once for a machine, its speeds and thrusts."""
    path = cache_directory() / f"friction-{_digest(spec, speeds, thrusts)}.npz"
    found = load_record(path, FORMAT, FrictionStates)
    if found is None:
        states = solve_friction(spec, speeds, thrusts)
        # JSON has neither positions as keys nor exceptions.
        refused = {
            " ".join(map(str, state)): [type(error).__name__, *error.args]
            for state, error in states.refused.items()
        }
        save_record(replace(states, refused=refused), path, FORMAT)
        return states
    refused = {
        tuple(map(int, state.split())): _ERRORS[kind](*texts)
        for state, (kind, *texts) in found.pop("refused").items()
    }
    return FrictionStates(**found, refused=refused)


def _digest(spec: MachineSpec, speeds: Array, thrusts: Array) -> str:
    """Hash of all on which the states depend."""
    content = spec.model_dump(mode="json", exclude=_APART)
    own = [source_digest(__name__), speeds.tolist(), thrusts.tolist(), content]
    return hashlib.sha256(json.dumps(own, sort_keys=True, default=str).encode()).hexdigest()
