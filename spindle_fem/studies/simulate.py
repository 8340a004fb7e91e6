"""Predict every channel of a recording, with the machine as defined or calibrated on others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition import network_load as network_spec
from spindle_fem.definition.load import find_machine, load_machine, read_definition, write_machine
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.effects.framework.term import CHANNEL_FILM
from spindle_fem.inference.calibration import Calibration, prediction_interval
from spindle_fem.inference.calibration import calibrate as fit_parameters
from spindle_fem.inference.coordinate_names import START_PREFIX
from spindle_fem.inference.followed_model import preload_along, require_solved_friction, with_followed_preload
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.reading_noise import SlowError
from spindle_fem.model.lumped.written_network import build_network, value_in_definition
from spindle_fem.model.reduced.defined_effects import ActiveEffects, effects_on
from spindle_fem.model.reduced.drive import drive_of_recording
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.model.reduced.recorded_model import fast_model_for, options_for, recentred_model
from spindle_fem.model.reduced.resolved_jumps import with_resolved_jumps
from spindle_fem.operation.bearing_heat import at_assembly_size
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.compare import Comparison, compare
from spindle_fem.recordings.displaced_readings import with_displacements
from spindle_fem.units import Uncertain

Array = NDArray[np.float64]
Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Simulation:
    """A machine on one recording, calibrated or as defined.

    Attributes
    ----------
    machine : str
        Its name.
    predicted : (N, c) ndarray, [K]
    half_width : (N, c) ndarray, [K]
        Half of the 90 % interval of a reading: noise, slow error and parameters,
        these as the calibration left them or as their priors say.
    machine_text : str or None
        Definition with the calibrated values.
    displacements : (N, d) ndarray, [m]
        Of the recording's displacement channels, from where each has its first reading.
    preload : mapping of bearing to (2 G,) ndarray, [N]
        As :func:`preload_along` gives it; empty where it does not follow the temperatures.
    model : mapping
        Size and checked error of the reduced model; empty for a network.
    """

    machine: str
    recording: Recording
    predicted: Array
    half_width: Array
    comparison: Comparison
    calibration: Calibration | None
    machine_text: str | None
    notes: tuple[str, ...]
    model: Mapping[str, Any]
    displacements: Array = field(default_factory=lambda: np.empty((0, 0)))
    preload: Mapping[str, Array] = field(default_factory=dict)


def simulate_recordings(
    machine: str | Path,
    recording: Recording,
    calibration: Sequence[Recording] = (),
    *,
    overrides: Sequence[str] = (),
    progress: Progress = lambda stage: None,
) -> Simulation:
    """Predict every temperature channel of a recording, calibrated or as defined.

    Parameters
    ----------
    machine : str or Path
        A definition file or the name of a machine that ships; with geometry or a ``[network]``.
    calibration : sequence of Recording
        These may move the uncertain parameters first.
    overrides : sequence of str
        ``path=value`` texts.
    progress : callable
        Called with the name of each stage as it begins.

    Raises
    ------
    SpindleFemError
    """
    if network_spec.is_network_machine(read_definition(find_machine(machine))):
        return _simulate_network(machine, recording, calibration, overrides, progress)
    return _simulate_geometry(load_machine(machine, overrides), recording, calibration, progress)


def _simulate_geometry(
    spec: MachineSpec, recording: Recording, calibration: Sequence[Recording], progress: Progress
) -> Simulation:
    followed, spec = spec, at_assembly_size(spec)
    recordings = (recording, *calibration)
    fast = fast_model_for(spec, recordings, as_given=not calibration, progress=progress)
    effects = effects_on(spec.effects, fast, recording)
    error = None
    assembled, result = fast, None
    if followed.follows_preload:
        fast, error = with_followed_preload(followed, fast, recordings, effects, progress=progress)
    if calibration:
        earlier_recordings = [with_displacements(item) for item in calibration]
        earlier = Predictor(fast, earlier_recordings, effects=effects, at_stamps=True)
        result = fit_parameters(earlier, progress=progress)
    drives = (with_resolved_jumps(drive_of_recording(spec, recording), fast.model.size),)
    predictor = Predictor(fast, [recording], effects=effects, at_stamps=True, drives=drives)
    factors = {} if result is None else result.factors
    if result is not None and followed.follows_preload:
        # a calibrated machine goes elsewhere
        fast, error = with_followed_preload(
            followed, assembled, (recording,), effects, factors, progress=progress
        )
        predictor = Predictor(fast, [recording], effects=effects, at_stamps=True, drives=drives)
    outside = _outside_range(predictor, factors)
    if outside:
        progress("reduced model: outside its range, made anew")
        fast = recentred_model(fast, factors, options_for(spec, recordings), progress)
        predictor = Predictor(fast, [recording], effects=effects, at_stamps=True, drives=drives)
        outside = _outside_range(predictor, factors)
    progress("simulation")
    require_solved_friction(fast, [recording], effects, factors)
    predicted, half_width = _prediction(predictor, result)
    notes = [*predictor.drives[0].notes, *_effect_notes(effects)]
    if fast.inputs.extra_terms:
        what = (
            "ball contacts"
            if spec.heat.model == "table"
            else f'"{spec.heat.model}" friction and ball contacts'
        )
        notes.append(f"{what} from a map over speed, thrust and film temperature")
    if error is not None:
        notes.append(
            "preload follows the temperatures, by bearing mechanics at sampled states of this run; "
            f"between them friction errs by {100.0 * error:.2g} % at most"
        )
    if outside:
        notes.append(_beyond_words(outside))
    if len(recording.segments) > 1:
        notes.append(
            f"{len(recording.segments) - 1} gaps above {recording.defects.long_gap_s:g} s: "
            "the inputs are bridged and the temperatures go on through them"
        )
    return Simulation(
        spec.name,
        recording,
        predicted,
        half_width,
        compare(recording, predicted),
        result,
        None if result is None else write_machine(with_parameters(followed, result.factors)),
        tuple(notes),
        {
            "basis": fast.model.size,
            "full_unknowns": fast.model.n_full,
            "checked_error_K": dict(fast.model.errors),
            "mesh_preset": spec.mesh.preset,
        },
        _displacements(predictor, factors),
        preload_along(predictor, 0, factors),
    )


def _displacements(predictor: Predictor, factors: Mapping[str, float]) -> Array:
    """Predicted displacement channels of one recording, (N, d) [m] from each first reading."""
    recording = predictor.recordings[0]
    if not recording.displacement_names:
        return recording.displacements
    read = 1e6 * recording.displacements
    seen = replace(
        recording,
        temperature_names=recording.displacement_names,
        probes=recording.displacement_sensors,
        temperature=read,
        flags=np.isnan(read).astype(np.uint8),
        sigma=np.ones(read.shape[1]),
    )
    growing = Predictor(
        predictor.fast, [seen], effects=predictor.effects, at_stamps=True, drives=predictor.drives
    )
    found = 1e-6 * growing.predict(0, factors, (), ()).temperature
    first = np.argmax(np.isfinite(read), axis=0)
    return found - found[first, np.arange(len(first))]


def _outside_range(predictor: Predictor, parameters: Mapping[str, float]) -> dict[str, float]:
    """Coefficients beyond the range of the reduced model, and by which share of its end."""
    fast = predictor.fast
    factors = fast.table.factors(predictor.effects.times_parameters(parameters))
    found: dict[str, float] = {}
    for drive in predictor.drives:
        for point in drive.points:
            values = fast.coefficients(point, factors)
            for name in fast.model.outside_range(values):
                low, high = fast.model.ranges[name]
                share = max(values[name] / high, low / values[name]) - 1.0 if values[name] > 0.0 else 1.0
                found[name] = max(share, found.get(name, 0.0))
    return found


def _beyond_words(outside: Mapping[str, float]) -> str:
    """Name the coefficients beyond the model's range, by how much, and how to widen it."""
    named = ", ".join(f"{name} by {100.0 * share:.2g} %" for name, share in outside.items())
    return (
        f"the recorded inputs take coefficients beyond what the reduced model was made for: {named}. "
        "What is uncertain in the definition has a wider range"
        + (" (coolant.film_factor)" if CHANNEL_FILM in outside else "")
        + ": give it a sigma_rel"
    )


def _simulate_network(
    machine: str | Path,
    recording: Recording,
    calibration: Sequence[Recording],
    overrides: Sequence[str],
    progress: Progress,
) -> Simulation:
    spec = network_spec.load_network_machine(machine, overrides)
    network = build_network(spec.network)
    fast = fast_network(network, spec)
    effects = effects_on(spec.effects, fast, recording)
    result, text = None, None
    if calibration:
        earlier = Predictor(fast, calibration, effects=effects, at_stamps=True)
        result = fit_parameters(earlier, progress=progress)
    predictor = Predictor(fast, [recording], effects=effects, at_stamps=True)
    progress("simulation")
    predicted, half_width = _prediction(predictor, result)
    if result is not None:
        own = {p.name for p in network.parameters}
        values = {
            e.name: Uncertain(value_in_definition(spec, network, e.name, e.factor), e.prior_sigma_log)
            for e in result.estimates
            if e.name in own
        }
        text = network_spec.write_network_machine(network_spec.with_parameters(spec, values))
    notes = tuple(_effect_notes(effects))
    comparison = compare(recording, predicted)
    return Simulation(spec.name, recording, predicted, half_width, comparison, result, text, notes, {})


def _effect_notes(effects: ActiveEffects) -> list[str]:
    return [f"with {candidate.label}, as the definition says" for candidate in effects.candidates]


def _prediction(predictor: Predictor, result: Calibration | None) -> tuple[Array, Array]:
    """Predicted readings of one recording, and half the width of the interval of a reading, both (N, c) K.

    Starting temperatures are specific to each recording, so a calibration's own do not apply.
    """
    priors = (*predictor.uncertain(), *predictor.starts())
    learned = {} if result is None else result.factors
    factors = {
        prior.name: learned.get(prior.name, 1.0)
        for prior in priors
        if not prior.name.startswith(START_PREFIX)
    }
    predicted = predictor.predict(0, factors, (), [prior.name for prior in priors])
    covariance = np.diag([prior.sigma_log**2 for prior in priors])
    if result is not None:
        known = {prior.name: i for i, prior in enumerate(result.priors)}
        mine = [i for i, prior in enumerate(priors) if prior.name in known]
        theirs = [known[priors[i].name] for i in mine]
        covariance[np.ix_(mine, mine)] = result.covariance[np.ix_(theirs, theirs)]
    slow = SlowError() if result is None else result.slow
    white = predictor.recordings[0].sigma
    return predicted.temperature, prediction_interval(covariance, slow, predicted.sensitivity, white)
