"""A machine opened for diagnosis: its fast model on its recordings, with or without geometry."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from spindle_fem.definition import network_load as network_spec
from spindle_fem.definition.load import (
    find_machine,
    load_machine,
    read_definition,
    validate,
    write_machine,
)
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.network_tables import NetworkMachineSpec
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.registry import effects_in_definition
from spindle_fem.errors import ConvergenceError, RecordingError
from spindle_fem.inference.followed_model import require_solved_friction, with_followed_preload
from spindle_fem.inference.heldout import heldout_stamps
from spindle_fem.inference.input_sampling import unseen_power
from spindle_fem.inference.recording_gaps import with_changes_amid
from spindle_fem.machine.view.usual_sizes import common_quantities
from spindle_fem.model.lumped.network_view import view_of_network
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.defined_effects import ActiveEffects, effects_on
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.model.reduced.recorded_model import fast_model_for
from spindle_fem.operation.bearing_heat import at_assembly_size
from spindle_fem.operation.preload_mechanics import machine_view
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.channel_checks import Flag
from spindle_fem.recordings.displaced_readings import with_displacements
from spindle_fem.recordings.smooth_inputs import without_input_noise
from spindle_fem.recordings.thin import thinned_recording

Progress = Callable[[str], None]

# Most stamps of a network's recording, which is stepped from one to the next in every fit, and once where
# hidden states are followed on its rows; more are averaged.
MOST_STAMPS, MOST_ROWS = 3_000, 30_000


@dataclass(frozen=True, slots=True)
class DiagnosedMachine:
    """Machine, recordings and settings of a diagnosis.

    Attributes
    ----------
    effects : ActiveEffects
        Effects of the definition: nominal, not diagnosed.
    view : MachineView
        View of the first recording, its ranges over all.
    recordings, calibration : tuple of Recording
        As they are used: measured inputs smoothed, long ones of networks thinned.
    rows : tuple of Recording
        Of a network whose recordings were averaged: those with as many rows as hidden states are followed on.
    notes : tuple of str
        What was done to them.
    unseen : tuple of (n_sources,) ndarray
        Of the recordings, then the calibration: :func:`spindle_fem.inference.input_sampling.unseen_power`.
    too_coarse : object or None
        :class:`spindle_fem.inference.coarse_machine.TooCoarse`, where the machine's own calibration says so.
    redefined : object or None
        :class:`spindle_fem.inference.wrong_definition.Redefined`, where the definition was put right.
    heldout : str
        What the view was made without, as :func:`spindle_fem.inference.heldout.heldout_stamps` takes it.
    """

    name: str
    spec: MachineSpec | NetworkMachineSpec
    fast: FastModel
    effects: ActiveEffects
    view: MachineView
    recordings: tuple[Recording, ...]
    calibration: tuple[Recording, ...]
    notes: tuple[str, ...] = ()
    unseen: tuple[np.ndarray, ...] = ()
    rows: tuple[Recording, ...] = ()
    too_coarse: Any = None
    redefined: Any = None
    heldout: str = "blocks"

    @property
    def given(self) -> MachineSpec | NetworkMachineSpec:
        """The definition before it was put right."""
        return self.spec if self.redefined is None else self.redefined.given

    @property
    def is_network(self) -> bool:
        """Whether the machine has no geometry."""
        return self.fast.network is not None


def open_machine(
    machine: str | Path,
    overrides: Sequence[str],
    recordings: Sequence[Recording],
    calibration: Sequence[Recording],
    *,
    heldout: str = "blocks",
    progress: Progress = lambda stage: None,
) -> DiagnosedMachine:
    """Read a machine and make or fetch its fast model.

    What is held out (``heldout`` as :func:`heldout_stamps` takes it) does not
    enter what is usual on the recordings either.

    Raises
    ------
    SpindleFemError
        A broken definition, or a recording that does not fit it.
    """
    if not recordings:
        raise RecordingError("recordings", "there are none.", "Give at least one to be diagnosed.")
    if network_spec.is_network_machine(read_definition(find_machine(machine))):
        return _open_network(machine, overrides, recordings, calibration, heldout)
    given = load_machine(machine, overrides)
    recordings, notes = _denoised(recordings)
    calibration, more = _denoised(calibration)
    opened = _with_geometry(given, recordings, calibration, heldout, progress)
    return replace(opened, notes=(*notes, *more, *opened.notes))


def _with_geometry(
    given: MachineSpec,
    recordings: Sequence[Recording],
    calibration: Sequence[Recording],
    heldout: str,
    progress: Progress,
) -> DiagnosedMachine:
    """A machine with geometry on recordings as they are used."""
    spec, notes = at_assembly_size(given), ()
    every = (*recordings, *calibration)
    fast = fast_model_for(spec, every, progress=progress)
    for recording in every:
        fast.require_channels(recording.probes, recording.source)
    effects = effects_on(spec.effects, fast, recordings[0])
    view = _widest([machine_view(fast.names, _seen(recording, heldout)) for recording in recordings])
    if given.follows_preload:
        try:
            fast, error = with_followed_preload(given, fast, every, effects, progress=progress)
        except ConvergenceError as failed:
            notes = (f"thermal preload is left out, bearings keep the size of assembly: {failed.what}",)
        else:
            spec, view = given, replace(view, has=view.has | effects_in_definition(given))
            notes = (
                "preload follows the temperatures, by bearing mechanics at states of the machine as defined "
                f"along these recordings; between them friction errs by {100.0 * error:.2g} % at most",
            )
    require_solved_friction(fast, every, effects)
    return DiagnosedMachine(
        spec.name,
        spec,
        fast,
        effects,
        view,
        tuple(recordings),
        tuple(calibration),
        notes,
        heldout=heldout,
    )


def with_definition(
    machine: DiagnosedMachine, spec: MachineSpec, progress: Progress = lambda stage: None
) -> DiagnosedMachine:
    """The recordings with another definition of a machine with geometry, whose fast model is made or fetched.

    Raises
    ------
    SpindleFemError
        A definition that is none, or that cannot be meshed or solved.
    """
    given = validate(tomllib.loads(write_machine(spec)), spec.name)
    opened = _with_geometry(given, machine.recordings, machine.calibration, machine.heldout, progress)
    notes = tuple(dict.fromkeys((*machine.notes, *opened.notes)))
    return replace(opened, name=machine.name, view=machine.view, notes=notes)


def _open_network(
    machine: str | Path,
    overrides: Sequence[str],
    recordings: Sequence[Recording],
    calibration: Sequence[Recording],
    heldout: str,
) -> DiagnosedMachine:
    spec = network_spec.load_network_machine(machine, overrides)
    network = build_network(spec.network)
    fast = fast_network(network, spec)
    exponents = {
        name: float(power)
        for name, power in zip(network.source_input, network.source_exponent, strict=True)
        if name is not None
    }

    def thinned(recording: Recording, most: int) -> Recording:
        count = recording.times.size
        if count <= most:
            return recording
        # Gaps take no stamps: the step follows from the time that was recorded.
        covered = sum(recording.times[end - 1] - recording.times[begin] for begin, end in recording.segments)
        return thinned_recording(recording, float(covered) / most, exponents=exponents)

    smooth, notes = _denoised(recordings)
    smooth_earlier, more = _denoised(calibration)
    whole = [with_changes_amid(item) for item in smooth]
    own = tuple(thinned(item, MOST_STAMPS) for item in whole)
    earlier = tuple(thinned(with_changes_amid(item), MOST_STAMPS) for item in smooth_earlier)
    averaged = [
        f"{item.name}: {item.times.size} rows averaged to {short.times.size}"
        for item, short in zip((*smooth, *smooth_earlier), (*own, *earlier), strict=True)
        if short.times.size < item.times.size
    ]
    has = frozenset(f"{entry.effect} @ {entry.component}" for entry in spec.effects)
    view = _widest([view_of_network(network, _seen(recording, heldout), has=has) for recording in own])
    return DiagnosedMachine(
        spec.name,
        spec,
        fast,
        effects_on(spec.effects, fast, own[0]),
        view,
        own,
        earlier,
        (*notes, *more, *averaged),
        tuple(unseen_power(network, item) for item in (*smooth, *smooth_earlier)),
        tuple(thinned(item, MOST_ROWS) for item in whole) if averaged else (),
        heldout=heldout,
    )


def with_growth(machine: DiagnosedMachine) -> DiagnosedMachine:
    """The machine with displacements among the readings to explain, if it has geometry.

    The view stays that of the temperatures: usual sizes and sensor effects follow from them alone.
    """
    if machine.is_network:
        return machine
    own, earlier = (
        tuple(with_displacements(item) for item in items)
        for items in (machine.recordings, machine.calibration)
    )
    for recording in (*own, *earlier):
        machine.fast.require_channels(recording.probes, recording.source)
    return replace(machine, recordings=own, calibration=earlier)


def with_network(machine: DiagnosedMachine, spec: NetworkMachineSpec) -> DiagnosedMachine:
    """The recordings with another written network."""
    network = build_network(spec.network)
    fast = fast_network(network, spec)
    has = frozenset(f"{entry.effect} @ {entry.component}" for entry in spec.effects)
    recordings = machine.recordings
    view = _widest([view_of_network(network, _seen(item, machine.heldout), has=has) for item in recordings])
    effects = effects_on(spec.effects, fast, recordings[0])
    return replace(machine, spec=spec, fast=fast, effects=effects, view=view)


def _denoised(recordings: Sequence[Recording]) -> tuple[list[Recording], list[str]]:
    """Recordings without the noise of their measured inputs, and what was done in words."""
    found, notes = [], []
    for recording in recordings:
        smooth, done = without_input_noise(recording)
        found.append(smooth)
        notes += [f"{recording.name}: {text}" for text in done]
    return found, notes


def _seen(recording: Recording, heldout: str) -> Recording:
    """The recording with what is held out marked as not to be used."""
    held, _ = heldout_stamps(recording, heldout)
    flags = recording.flags.copy()
    flags[held] |= int(Flag.MISSING)
    return replace(recording, flags=flags)


def _widest(views: Sequence[MachineView]) -> MachineView:
    """The first view with ranges over all recordings."""
    first = views[0]
    return replace(
        first,
        duration=max(view.duration for view in views),
        highest_speed=max(view.highest_speed for view in views),
        lowest_speed=min((view.lowest_speed for view in views if view.lowest_speed > 0.0), default=0.0),
        channels=tuple(dict.fromkeys(name for view in views for name in view.channels)),
        quantities=common_quantities([view.quantities for view in views]),
        reynolds=(
            float(np.min([view.reynolds[0] for view in views])),
            float(np.max([view.reynolds[1] for view in views])),
        ),
    )
