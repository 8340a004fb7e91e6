"""What every channel of a recording should have read: the function behind ``spindle-fem simulate``."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from spindle_fem.definition import network_tables as network_spec
from spindle_fem.definition.load import find_machine, load_machine, read_definition, write_machine
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.inference.least_squares import LEVEL, Calibration, prediction_interval
from spindle_fem.inference.least_squares import calibrate as fit_parameters
from spindle_fem.inference.predictor import MachinePredictor, NetworkPredictor, Predictor
from spindle_fem.inference.reading_noise import SlowError
from spindle_fem.model.lumped.written_network import build_network, value_in_definition
from spindle_fem.model.reduced.build_reduced import ReductionOptions, reduced_model_of
from spindle_fem.model.reduced.defined_effects import ActiveEffects, effects_on
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.film_heat import (
    FilmHeat,
    needs_map,
    operators_machine,
    tabulate_friction,
    tabulated_machine,
    thrusts_between,
)
from spindle_fem.model.reduced.network_fast_model import NetworkFastModel
from spindle_fem.recordings.align import Recording, read_recording
from spindle_fem.recordings.compare import ALL, Comparison, compare, simulation_summary, write_simulated
from spindle_fem.report.simulation_pictures import draw_channels
from spindle_fem.report.simulation_report import write_simulation_report
from spindle_fem.results.output_folder import output_folder, replace_text
from spindle_fem.results.run_summary import package_versions
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
    recording : Recording
    predicted : (N, c) ndarray, [K]
    half_width : (N, c) ndarray, [K]
        Of the 90 % interval of a reading: noise, slow error and parameters,
        these as the calibration left them or as their priors say.
    comparison : Comparison
    calibration : Calibration or None
    machine_text : str or None
        Definition with the calibrated values.
    notes : tuple of str
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


def simulate_machine(
    machine: str | Path,
    recording: str | Path,
    folder: str | Path,
    calibrate: Iterable[str | Path] = (),
    overrides: Iterable[str] = (),
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Predict every temperature channel of a recording and write what came of it.

    Parameters
    ----------
    machine : str or Path
        A definition file or the name of a machine that ships; with geometry
        or a ``[network]``.
    recording : str or Path
        Folder or manifest.
    folder : str or Path
        Gets ``simulated.csv``, ``simulation.json``, ``error_table.csv``,
        ``figures/residual_<channel>.png``, ``report.html`` and, when
        calibrated, ``calibrated_machine.toml``.
    calibrate : iterable of str or Path
        Recordings that may move the uncertain parameters first.
    overrides : iterable of str
        ``path=value`` texts.
    progress : callable, optional
        Told each stage by name as it begins.

    Returns
    -------
    dict
        The content of ``simulation.json``.

    Raises
    ------
    SpindleFemError
    """
    started = time.perf_counter()
    tell = progress or (lambda stage: None)
    tell("reading")
    read = read_recording(recording)
    others = [read_recording(path) for path in calibrate]
    with output_folder(folder) as place:
        simulation = simulate_recordings(machine, read, others, overrides=tuple(overrides), progress=tell)
        tell("writing")
        return write_simulation(simulation, place, started=started)


def simulate_recordings(
    machine: str | Path,
    recording: Recording,
    calibration: Sequence[Recording] = (),
    *,
    overrides: Sequence[str] = (),
    progress: Progress = lambda stage: None,
) -> Simulation:
    """As :func:`simulate_machine`, on recordings in memory and without writing."""
    if network_spec.is_network_machine(read_definition(find_machine(machine))):
        return _simulate_network(machine, recording, calibration, overrides, progress)
    return _simulate_geometry(load_machine(machine, overrides), recording, calibration, progress)


def fast_model_for(
    spec: MachineSpec,
    recordings: Sequence[Recording],
    *,
    as_given: bool = False,
    progress: Progress = lambda stage: None,
) -> FastModel:
    """Reduced model whose range holds the speeds of some recordings.

    ``as_given`` says that the machine's coefficients will not be moved.

    Friction and ball contacts that follow their films are solved once over the
    speeds and thrusts of the recordings; the model's ``spec`` then has a heat
    table and constant ball rows, and a term among its own brings both to the
    film temperature of the moment.

    Raises
    ------
    SpecError
        Heat that follows expansion.
    """
    options = _options_for(spec, recordings)
    if not needs_map(spec):
        model = reduced_model_of(spec, options=options, as_given=as_given, progress=progress)
        return FastModel(model, spec)
    progress("friction over speed, thrust and film temperature")
    thrusts = thrusts_between(spec, *_recorded_range(recordings, "thrust", spec.operation.thrust))
    friction = tabulate_friction(spec, options.highest_speed_of(spec), thrusts)
    table = tabulated_machine(spec, friction)
    term = FilmHeat(friction, spec, table)
    made_of = operators_machine(table, term)
    model = reduced_model_of(made_of, options=options, as_given=as_given, progress=progress)
    return FastModel(model, table, (term,))


def _options_for(spec: MachineSpec, recordings: Sequence[Recording]) -> ReductionOptions:
    """A range that ends at the highest recorded speed where that is beyond the definition's."""
    _, highest = _recorded_range(recordings, "speed", 0.0)
    options = ReductionOptions()
    if highest > options.highest_speed_of(spec) * (1.0 + 1e-6):
        options = ReductionOptions(highest_speed=highest)
    return options


def _recorded_range(recordings: Sequence[Recording], name: str, otherwise: float) -> tuple[float, float]:
    """Lowest and highest value of an input in all recordings that have it; speeds have no sign."""
    columns = [
        item.inputs[:, item.input_names.index(name)] for item in recordings if name in item.input_names
    ]
    if not columns:
        return otherwise, otherwise
    values = np.concatenate(columns)
    if name == "speed":
        values = np.abs(values)
    return float(np.nanmin(values)), float(np.nanmax(values))


def _centred(
    fast: FastModel, factors: Mapping[str, float], options: ReductionOptions, progress: Progress
) -> FastModel:
    """The same machine on a reduced model that was made at some factors."""
    terms = fast.extra_terms
    film_heat = next((term for term in terms if isinstance(term, FilmHeat)), None)
    made_of = fast.spec if film_heat is None else operators_machine(fast.spec, film_heat)
    model = reduced_model_of(with_parameters(made_of, factors), options=options, progress=progress)
    return FastModel(model, fast.spec, terms)


def _simulate_geometry(
    spec: MachineSpec, recording: Recording, calibration: Sequence[Recording], progress: Progress
) -> Simulation:
    fast = fast_model_for(spec, (recording, *calibration), as_given=not calibration, progress=progress)
    effects = effects_on(spec.effects, fast, recording)
    result = None
    if calibration:
        result = fit_parameters(MachinePredictor(fast, calibration, effects=effects), progress=progress)
    predictor = MachinePredictor(fast, [recording], effects=effects)
    factors = {} if result is None else result.factors
    outside = _outside_range(predictor, factors)
    if outside:
        progress("reduced model: outside its range, made anew")
        fast = _centred(fast, factors, _options_for(spec, (recording, *calibration)), progress)
        predictor = MachinePredictor(fast, [recording], effects=effects)
        outside = _outside_range(predictor, factors)
    progress("simulation")
    log_factors = np.zeros(len(predictor.priors)) if result is None else result.log_factors
    predicted, sensitivity = predictor.predict(log_factors)[0]
    notes = [*predictor.drives[0].notes, *_effect_notes(effects)]
    if fast.extra_terms:
        what = (
            "ball contacts"
            if spec.heat.model == "table"
            else f'"{spec.heat.model}" friction and ball contacts'
        )
        notes.append(f"{what} from a map over speed, thrust and film temperature")
    if spec.coolant is not None and spec.coolant.properties_at == "bulk":
        notes.append("the coolant's film is taken at its inlet temperature, not along the channel")
    if outside:
        notes.append(f"coefficients outside the reduced model's range: {', '.join(outside)}")
    if len(recording.segments) > 1:
        notes.append(
            f"{len(recording.segments) - 1} gaps above {recording.defects.long_gap_s:g} s: "
            "the inputs are bridged and the temperatures go on through them"
        )
    text = None if result is None else write_machine(with_parameters(spec, result.factors))
    model = {
        "basis": fast.model.size,
        "full_unknowns": fast.model.n_full,
        "checked_error_K": dict(fast.model.errors),
        "mesh_preset": spec.mesh.preset,
    }
    return _simulation(spec.name, recording, predictor, predicted, sensitivity, result, text, notes, model)


def _outside_range(predictor: MachinePredictor, parameters: Mapping[str, float]) -> tuple[str, ...]:
    fast = predictor.fast
    factors = fast.table.factors(predictor.effects.times_parameters(parameters))
    found: dict[str, None] = {}
    for drive in predictor.drives:
        for point in drive.points:
            found |= dict.fromkeys(fast.model.outside_range(fast.coefficients(point, factors)))
    return tuple(found)


def _simulate_network(
    machine: str | Path,
    recording: Recording,
    calibration: Sequence[Recording],
    overrides: Sequence[str],
    progress: Progress,
) -> Simulation:
    spec = network_spec.load_network_machine(machine, overrides)
    network = build_network(spec.network)
    effects = effects_on(spec.effects, NetworkFastModel(network, spec), recording)
    result, text = None, None
    if calibration:
        result = fit_parameters(
            NetworkPredictor(network, calibration, spec.initial, effects), progress=progress
        )
    predictor = NetworkPredictor(network, [recording], spec.initial, effects)
    progress("simulation")
    # Starting temperatures belong to each recording: those of the calibration say nothing here.
    learned = {} if result is None else result.factors
    log_factors = np.array(
        [
            np.log(learned.get(p.name, 1.0)) if not p.name.startswith("initial.") else 0.0
            for p in predictor.priors
        ]
    )
    predicted, sensitivity = predictor.predict(log_factors)[0]
    if result is not None:
        own = {p.name for p in network.parameters}
        values = {
            e.name: Uncertain(value_in_definition(spec, network, e.name, e.factor), e.prior_sigma_log)
            for e in result.estimates
            if e.name in own
        }
        text = network_spec.write_network_machine(network_spec.with_parameters(spec, values))
    notes = _effect_notes(effects)
    return _simulation(spec.name, recording, predictor, predicted, sensitivity, result, text, notes, {})


def _effect_notes(effects: ActiveEffects) -> list[str]:
    return [f"with {candidate.label}, as the definition says" for candidate in effects.candidates]


def _simulation(
    machine: str,
    recording: Recording,
    predictor: Predictor,
    predicted: Array,
    sensitivity: Array,
    result: Calibration | None,
    text: str | None,
    notes: Sequence[str],
    model: Mapping[str, Any],
) -> Simulation:
    half_width = _half_width(recording, predictor, sensitivity, result)
    comparison = compare(recording, predicted)
    return Simulation(
        machine, recording, predicted, half_width, comparison, result, text, tuple(notes), model
    )


def _half_width(
    recording: Recording, predictor: Predictor, sensitivity: Array, result: Calibration | None
) -> Array:
    names = [prior.name for prior in predictor.priors]
    sigma = np.array([prior.sigma_log for prior in predictor.priors])
    covariance = np.diag(sigma**2)
    slow = SlowError()
    if result is not None:
        slow = result.slow
        known = {prior.name: i for i, prior in enumerate(result.priors)}
        shared = [
            (i, known[name])
            for i, name in enumerate(names)
            if name in known and not name.startswith("initial.")
        ]
        mine = [i for i, _ in shared]
        theirs = [j for _, j in shared]
        covariance[np.ix_(mine, mine)] = result.covariance[np.ix_(theirs, theirs)]
    return prediction_interval(covariance, slow, sensitivity, recording.sigma)


def write_simulation(simulation: Simulation, folder: Path, *, started: float) -> dict[str, Any]:
    """Write everything that ``simulate`` leaves in its folder.

    Returns
    -------
    dict
        The content of ``simulation.json``.
    """
    recording, comparison = simulation.recording, simulation.comparison
    write_simulated(folder / "simulated.csv", recording, simulation.predicted)
    figures = draw_channels(folder / "figures", recording, simulation.predicted, simulation.half_width)
    _write_error_table(folder / "error_table.csv", comparison)
    summary = simulation_summary(comparison)
    inside = np.abs(comparison.residual) <= simulation.half_width
    for entry in summary["channels"]:
        index = recording.temperature_names.index(entry["channel"])
        read = np.isfinite(comparison.residual[:, index])
        entry["inside_90_percent_interval"] = float(np.mean(inside[read, index]))
        entry["interval_half_width_K"] = float(np.mean(simulation.half_width[:, index]))
    summary |= {
        "recording": recording.name,
        "notes": list(simulation.notes),
        "machine": simulation.machine,
        "defects": recording.defects.to_json(),
        "defects_text": recording.defects.lines(),
        "reduced_model": dict(simulation.model),
        "calibration": None
        if simulation.calibration is None
        else calibration_summary(simulation.calibration),
        "figures": [str(path.relative_to(folder)) for path in figures],
        "versions": package_versions(),
    }
    if simulation.machine_text is not None:
        replace_text(folder / "calibrated_machine.toml", simulation.machine_text)
    summary["wall_time_s"] = time.perf_counter() - started
    replace_text(folder / "simulation.json", json.dumps(summary, indent=1) + "\n")
    write_simulation_report(folder)
    return summary


def _write_error_table(path: Path, comparison: Comparison) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["channel", "condition", "readings", "rmse_K", "mean_K", "max_K", "noise_K"])
        for row in comparison.rows:
            values = (row.rmse, row.mean, row.largest, row.noise)
            writer.writerow([row.channel, row.condition or ALL, row.readings, *(f"{v:.4f}" for v in values)])


def calibration_summary(result: Calibration) -> dict[str, Any]:
    """A calibration as plain data with units in the keys."""
    return {
        "level": LEVEL,
        "parameters": [
            {
                "name": item.name,
                "value": item.value,
                "low": item.low,
                "high": item.high,
                "unit": item.unit,
                "prior": item.prior,
                "factor": item.factor,
                "prior_sigma_log": item.prior_sigma_log,
                "sigma_log": item.sigma_log,
                "learned": item.learned,
                "prior_two_sided_p": float(2.0 * norm.sf(abs(np.log(item.factor)) / item.prior_sigma_log)),
            }
            for item in result.estimates
        ],
        "correlation": np.round(result.correlation, 4).tolist(),
        "cannot_tell_apart": [list(pair) for pair in result.cannot_tell_apart()],
        "not_learned": list(result.unlearned()),
        "slow_error": {"sigma_K": result.slow.sigma, "time_s": result.slow.time},
        "chi_square_per_value": result.chi_square,
        "outlier_share": result.outlier_share,
        "evaluations": result.evaluations,
    }
