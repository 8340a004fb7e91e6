"""The state space of a machine, with geometry or a written network, by its definition."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from spindle_fem.definition import network_load as network_spec
from spindle_fem.definition.load import find_machine, load_machine, read_definition
from spindle_fem.machine.view.defined_point import at_the_defined_point
from spindle_fem.model.lumped.network_view import day_of_a_network
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.defined_effects import effects_on
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.model.reduced.recorded_model import fast_model_for, options_for
from spindle_fem.operation.bearing_heat import without_unasked_preload
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
    spec, left_out = without_unasked_preload(spec)
    fast = fast_model_for(spec, recordings, as_given=True, progress=progress)
    progress("tables over speed and coolant")
    effects = effects_on(spec.effects, fast, at_the_defined_point(spec))
    highest = options_for(spec, recordings).highest_speed_of(spec)
    space = geometry_state_space(fast, spec.name, highest, effects)
    if left_out:
        space.header["notes"][:0] = left_out
    return space
