"""Fields of the full model along a recording's inputs, on the coarse mesh, for views."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import RecordingError
from spindle_fem.inference.full_model_check import (
    COARSE,
    MOST_STEPS,
    options_to_read,
    spec_on,
)
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.evaluate import temperature_at_nodes
from spindle_fem.model.mesh.thermal_state import ThermalState
from spindle_fem.model.reduced.defined_effects import physics_of
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.input_history import OperatingHistory
from spindle_fem.solvers.machine_transient import Watch, simulate_full, start_at
from spindle_fem.solvers.prepared_machine import prepare_machine
from spindle_fem.solvers.transient_records import balanced
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

# Views are read to a tenth of a kelvin: as closely as a diagnosis follows channels of that noise.
READ_TO = 0.1
OPTIONS = options_to_read(READ_TO)


@dataclass(frozen=True, slots=True)
class RecordedFields:
    """Fields along a recording.

    Attributes
    ----------
    times : (t,) ndarray, [s]
    temperature : (t, n_nodes) ndarray, [degC]
    """

    mesh: TaggedMesh
    times: Array
    temperature: Array


def fields_of_recording(
    spec: MachineSpec,
    inputs: InputHistory,
    first_reading: float,
    times: Array,
    progress: Callable[[str], None] = lambda stage: None,
) -> RecordedFields:
    """Run a machine, the effects of its definition included, under recorded inputs.

    Parameters
    ----------
    inputs : InputHistory
        As :meth:`Recording.input_history` gives them.
    first_reading : float, [K]
        Mean of the first readings: where a machine begins that does not begin at the ambient temperature.
    times : (t,) ndarray, [s]
        At which fields are kept.

    Raises
    ------
    RecordingError
        The inputs change too often for the full model to follow within a minute or so.
    """
    history = OperatingHistory.of(spec, inputs)
    steps = len(history.breakpoints(OPTIONS.input_resolution))
    if steps > MOST_STEPS:
        raise RecordingError(
            "recording",
            f"its inputs ask for {steps} time steps.",
            f"At most {MOST_STEPS} are run for a view.",
        )
    machine = prepare_machine(spec_on(spec, COARSE), progress=progress)
    history = OperatingHistory.of(machine.spec, inputs)
    ambient = history.at(float(inputs.times[0])).ambient_temperature
    start = start_at(machine, history, ambient if spec.initial == "ambient" else first_reading)
    kept = {float(time): None for time in times}

    def look(state: ThermalState) -> bool:
        if state.time in kept:
            kept[state.time] = temperature_at_nodes(machine.operators, state.temperature) - ZERO_CELSIUS_K
        return False

    look(start)
    balanced(
        lambda options: simulate_full(
            machine,
            inputs,
            sample_times=inputs.times[-1:],
            start=start,
            options=options,
            physics=physics_of(machine),
            watch=Watch(look, tuple(time for time in kept if time > start.time), progress),
        ),
        OPTIONS,
    )
    found = {time: field for time, field in kept.items() if field is not None}
    return RecordedFields(machine.mesh, np.array(list(found)), np.array(list(found.values())))
