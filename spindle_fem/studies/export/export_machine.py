"""The state space of a machine, with geometry or a written network, by its definition."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from spindle_fem.definition import network_load as network_spec
from spindle_fem.definition.load import find_machine, load_machine, read_definition
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import ConvergenceError
from spindle_fem.inference.followed_model import with_followed_preload
from spindle_fem.machine.view.defined_point import at_the_defined_point, through_its_speeds
from spindle_fem.model.lumped.network_view import day_of_a_network
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.defined_effects import ActiveEffects, effects_on
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.model.reduced.recorded_model import fast_model_for, options_for
from spindle_fem.operation.bearing_heat import at_assembly_size
from spindle_fem.recordings.align import Recording
from spindle_fem.studies.export.geometry_export import geometry_state_space
from spindle_fem.studies.export.network_export import network_inputs, network_state_space
from spindle_fem.studies.export.state_space import StateSpace

Progress = Callable[[str], None]


def machine_state_space(
    machine: str | Path,
    overrides: Sequence[str] = (),
    recordings: Sequence[Recording] = (),
    progress: Progress = lambda stage: None,
) -> StateSpace:
    """Model behind :func:`spindle_fem.studies.simulate.simulate_recordings`, for other programs.

    Parameters
    ----------
    machine : str or Path
        A definition file or the name of a machine that ships; with geometry or a ``[network]``.
    overrides : sequence of str
        ``path=value`` texts.
    recordings : sequence of Recording
        The range of a machine with geometry holds their speeds and thrusts; a network has no range.

    Raises
    ------
    SpindleFemError
    """
    is_network = network_spec.is_network_machine(read_definition(find_machine(machine)))
    load = network_spec.load_network_machine if is_network else load_machine
    spec = load(machine, overrides)
    if is_network:
        fast = fast_network(build_network(spec.network), spec)
        turning = [item.name for item in network_inputs(fast.network) if item.magnitude]
        day = day_of_a_network(fast.network, turning)
        return network_state_space(fast, spec.name, effects_on(spec.effects, fast, day))
    fast = fast_model_for(at_assembly_size(spec), recordings, as_given=True, progress=progress)
    effects = effects_on(spec.effects, fast, at_the_defined_point(spec))
    highest, note = options_for(spec, recordings).highest_speed_of(spec), None
    if spec.follows_preload:
        fast, highest, note = _with_preload(spec, fast, recordings, effects, highest, progress)
    progress("tables over speed and coolant")
    space = geometry_state_space(fast, spec.name, highest, effects)
    if note is not None:
        space.header["notes"].insert(0, note)
    return space


def _with_preload(
    spec: MachineSpec,
    fast: FastModel,
    recordings: Sequence[Recording],
    effects: ActiveEffects,
    highest: float,
    progress: Progress,
) -> tuple[FastModel, float, str]:
    """Model whose bearings follow expansion, the speed up to which they do [rad/s], and that in words.

    Along the recordings, else along a run through the machine's own speeds: to the highest one, or where the
    bearings have no equilibrium there to the definition's.
    """
    if recordings:
        fast, error = with_followed_preload(spec, fast, recordings, effects, progress=progress)
        return fast, highest, _preload_words("along the recordings", error)
    speeds = sorted({highest, spec.operation.speed}, reverse=True)
    for speed in speeds:
        run = through_its_speeds(spec, speed)
        try:
            followed, error = with_followed_preload(spec, fast, [run], effects, progress=progress)
            break
        except ConvergenceError:
            if speed == speeds[-1]:
                raise
    where = f"along a run to {speed * 30.0 / np.pi:.0f} rpm as the definition has room and coolant"
    if speed < highest:
        where += f" (at {highest * 30.0 / np.pi:.0f} rpm the bearings have no equilibrium)"
    return followed, speed, _preload_words(where, error)


def _preload_words(where: str, error: float) -> str:
    return (
        f"preload follows the temperatures, by bearing mechanics at states sampled {where}; between them "
        f"friction errs by {100.0 * error:.2g} % at most"
    )
