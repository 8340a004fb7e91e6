"""``diagnosis.nc``: what a diagnosis rests on, as one xarray Dataset with units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference.belief import Coordinate
from spindle_fem.inference.diagnosis import overlapping_components
from spindle_fem.inference.findings import channel_noise
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.like_sets import are_alike
from spindle_fem.inference.mismatch_place import component_shares
from spindle_fem.inference.next_measurement import hypothesis_words
from spindle_fem.inference.set_odds import rank
from spindle_fem.inference.wrong_definition import stated_sigmas
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.conditions import operating_conditions
from spindle_fem.units import MICROMETRES, ZERO_CELSIUS_K

if TYPE_CHECKING:
    import xarray as xr

    from spindle_fem.inference.diagnosis import Diagnosis

Array = NDArray[np.float64]

DATA_SCHEMA = "spindle-fem/diagnosis-data/1"
COMPRESSED = {"zlib": True, "complevel": 4}


def diagnosis_dataset(diagnosis: Diagnosis, before: Sequence[Array], after: Sequence[Array]) -> xr.Dataset:
    """Readings, predictions, inputs, heat tracks, sets and parameters of a diagnosis.

    Recordings follow one another along ``stamp``; ``recording_index`` gives
    the recording of each stamp.

    Parameters
    ----------
    before, after : sequence of (N, c) ndarray, [K]
        Predictions at the stamps of every recording, without and with what was found; of a displacement
        in µm, from the sensor's zero.

    Returns
    -------
    Dataset
        Temperatures in °C, inputs in SI, displacements in m along ``displacement_name`` where there are any.
    """
    import xarray as xr

    recordings = diagnosis.predictor.recordings
    displaced = _channels(recordings, displaced=True)
    variables: dict[str, Any] = {}
    variables |= _readings(diagnosis, before, after)
    variables |= _displaced(diagnosis, before, after) if displaced else {}
    variables |= _inputs(recordings)
    probes = {n: p for item in recordings for n, p in zip(item.temperature_names, item.probes, strict=True)}
    variables["channel_probe"] = ("channel", [probes[name] for name in _channels(recordings)])
    variables |= _conditions(recordings)
    variables |= _heat(diagnosis)
    variables |= _sets(diagnosis)
    variables |= _parameters(diagnosis)
    data = xr.Dataset(
        variables,
        coords={
            "channel": list(_channels(recordings)),
            "recording": [item.name for item in recordings],
            **({"displacement_name": list(displaced)} if displaced else {}),
        },
        attrs={
            "schema": DATA_SCHEMA,
            "machine": getattr(diagnosis.predictor.fast.spec, "name", ""),
            "kind": diagnosis.view.kind,
            "verdict": diagnosis.judgement.verdict,
            "heldout": diagnosis.heldout,
            "slow_error_K": diagnosis.final.slow.sigma,
            "slow_error_s": diagnosis.final.slow.time,
        },
    )
    for name, variable in data.variables.items():
        if "stamp" in variable.dims and len(variable.dims) == 2:
            data[name].encoding |= COMPRESSED
    return data


def _part(recording: Recording, *, displaced: bool) -> slice:
    """Columns of the temperatures among a recording's readings, or of the displacements."""
    count = recording.temperature_count
    return slice(count, None) if displaced else slice(count)


def _channels(recordings: Sequence[Recording], *, displaced: bool = False) -> tuple[str, ...]:
    parts = [item.temperature_names[_part(item, displaced=displaced)] for item in recordings]
    return tuple(dict.fromkeys(name for part in parts for name in part))


def _joined(
    recordings: Sequence[Recording],
    values: Sequence[Array],
    empty: float,
    dtype: type = np.float32,
    *,
    displaced: bool = False,
) -> Array:
    """Columns of every recording under the channels of all, (stamps, channels)."""
    names = _channels(recordings, displaced=displaced)
    found = []
    for item, own in zip(recordings, values, strict=True):
        part = _part(item, displaced=displaced)
        table = np.full((item.times.size, len(names)), empty, dtype=dtype)
        table[:, [names.index(name) for name in item.temperature_names[part]]] = own[:, part]
        found.append(table)
    return np.concatenate(found)


def _noise(diagnosis: Diagnosis, *, displaced: bool = False) -> Array:
    """One sigma of a reading, rounding included, (recordings, channels) K or µm; NaN where it is not read."""
    recordings = diagnosis.predictor.recordings
    names = _channels(recordings, displaced=displaced)
    sigma = np.full((len(recordings), len(names)), np.nan)
    for row, item in enumerate(recordings):
        for column in range(len(item.temperature_names))[_part(item, displaced=displaced)]:
            own = names.index(item.temperature_names[column])
            sigma[row, own] = channel_noise(diagnosis.predictor, item, column)
    return sigma


def _readings(diagnosis: Diagnosis, before: Sequence[Array], after: Sequence[Array]) -> dict[str, Any]:
    recordings = diagnosis.predictor.recordings
    celsius = {"units": "degC"}

    def table(values: Sequence[Array], title: str) -> tuple:
        shifted = [item - ZERO_CELSIUS_K for item in values]
        return ("stamp", "channel"), _joined(recordings, shifted, np.nan), celsius | {"long_name": title}

    return {
        "time": (
            "stamp",
            np.concatenate([item.times for item in recordings]),
            {"units": "s", "long_name": "time from the first stamp of the recording"},
        ),
        "recording_index": ("stamp", np.repeat(range(len(recordings)), [r.times.size for r in recordings])),
        "held_out": (
            "stamp",
            np.concatenate([~mask for mask in diagnosis.predictor.use]).astype(np.int8),
            {"long_name": "1 where the fit did not see the readings"},
        ),
        "measured": table([item.temperature for item in recordings], "reading"),
        "usable": (
            ("stamp", "channel"),
            _joined(recordings, [item.usable for item in recordings], 0, np.int8),
            {"long_name": "1 where the reading carries no flag"},
        ),
        "before": table(before, "prediction, nothing added"),
        "after": table(after, "prediction with what was found"),
        "noise": (
            ("recording", "channel"),
            _noise(diagnosis),
            {"units": "K", "long_name": "1 sigma of one reading, rounding included"},
        ),
        "start_stamp": ("recording", [item.start or "" for item in recordings]),
    }


def _displaced(diagnosis: Diagnosis, before: Sequence[Array], after: Sequence[Array]) -> dict[str, Any]:
    """Displacements from the first reading of each."""
    recordings = diagnosis.predictor.recordings

    def table(values: Sequence[Array], title: str) -> tuple:
        metres = [item / MICROMETRES for item in values]
        along = ("stamp", "displacement_name")
        joined = _joined(recordings, metres, np.nan, displaced=True)
        return along, joined, {"units": "m", "long_name": title}

    read = [np.where(item.usable, item.temperature, np.nan) for item in recordings]
    return {
        "displacement": table(read, "reading; none where it carries a flag"),
        "displacement_before": table(before, "prediction, nothing added, from the sensor's estimated zero"),
        "displacement_after": table(
            after, "prediction with what was found, from the sensor's estimated zero"
        ),
        "displacement_noise": (
            ("recording", "displacement_name"),
            _noise(diagnosis, displaced=True) / MICROMETRES,
            {"units": "m", "long_name": "1 sigma of one reading, rounding included"},
        ),
    }


def _inputs(recordings: Sequence[Recording]) -> dict[str, Any]:
    names = tuple(dict.fromkeys(name for item in recordings for name in item.input_names))
    units = {n: u for item in recordings for n, u in zip(item.input_names, item.input_units, strict=True)}
    found = []
    for item in recordings:
        own = np.full((item.times.size, len(names)), np.nan, dtype=np.float32)
        own[:, [names.index(name) for name in item.input_names]] = item.input_history().values
        found.append(own)
    return {
        "input": (("stamp", "input_name"), np.concatenate(found), {"long_name": "inputs, SI"}),
        "input_name": list(names),
        "input_held": (
            "input_name",
            np.array([_is_held(recordings, name) for name in names]).astype(np.int8),
            {"long_name": "1 where a value holds until the next"},
        ),
        "input_unit": ("input_name", [units[name] for name in names]),
    }


def _is_held(recordings: Sequence[Recording], name: str) -> bool:
    return any(item.held[item.input_names.index(name)] for item in recordings if name in item.input_names)


def _conditions(recordings: Sequence[Recording]) -> dict[str, Any]:
    marks = [operating_conditions(item) for item in recordings]
    names = tuple(dict.fromkeys(name for item in marks for name in item.names))
    found = []
    for item in marks:
        own = np.zeros((len(item.marks), len(names)), dtype=np.int8)
        own[:, [names.index(name) for name in item.names]] = item.marks
        found.append(own)
    return {"condition_holds": (("stamp", "condition"), np.concatenate(found)), "condition": list(names)}


def _heat(diagnosis: Diagnosis) -> dict[str, Any]:
    tracks = diagnosis.explanations
    if not tracks:
        return {}
    spots = list(dict.fromkeys(item.spot for item in tracks))
    evidence = {spot: sum(t.log_evidence for t in tracks if t.spot == spot) for spot in spots}
    shares, _ = component_shares(tracks, {})
    reported = diagnosis.view.reported
    watts = {"units": "W"}
    return {
        "heat_time": (("track", "onset"), np.array([t.times for t in tracks]), {"units": "s"}),
        "heat": (
            ("track", "onset"),
            np.array([t.heat for t in tracks]),
            watts | {"long_name": "heat at one place alone that explains what the model leaves"},
        ),
        "heat_sigma": (("track", "onset"), np.array([t.sigma for t in tracks]), watts),
        "track_spot": ("track", [t.spot for t in tracks]),
        "track_recording": ("track", np.array([t.recording for t in tracks])),
        "spot": spots,
        "spot_component": ("spot", [reported.get(spot, spot) for spot in spots]),
        "spot_log_evidence": ("spot", np.array([evidence[spot] for spot in spots])),
        "spot_share": (
            "spot",
            np.array([shares[spot] for spot in spots]),
            {"long_name": "probability that heat is missing here, if at one place"},
        ),
    }


def _sets(diagnosis: Diagnosis) -> dict[str, Any]:
    """Sets that were fitted to the end with the probability that is stated of them: the told one first.

    Without those that are one answer with a stated one, as a bearing with its set.
    """
    judgement, overlapping = diagnosis.judgement, overlapping_components(diagnosis.view)
    told = (judgement.chosen, *judgement.alternatives)
    stated = {item.fit.keys: item.probability for item in told}
    others = [item.fit for item in rank(diagnosis.hypotheses, diagnosis.coarseness)]
    fits = [item.fit for item in told]
    fits += [fit for fit in others if not any(are_alike(fit, one.fit, overlapping) for one in told)]
    return {
        "set_name": ("set", [hypothesis_words(fit, diagnosis.predictor.recordings) for fit in fits]),
        "set_probability": (
            "set",
            np.array([stated.get(fit.keys, 0.0) for fit in fits]),
            {"long_name": "0 where it is ruled out or too small to be stated"},
        ),
        "set_misfit": (
            "set",
            np.array([np.sqrt(fit.reduced_misfit) for fit in fits]),
            {"long_name": "root mean square of whitened residuals"},
        ),
        "set_chosen": ("set", np.array([fit is told[0].fit for fit in fits]).astype(np.int8)),
    }


def _parameters(diagnosis: Diagnosis) -> dict[str, Any]:
    belief = diagnosis.calibrated.belief
    own = belief.coordinates
    known = np.linalg.inv(belief.root.T @ belief.root) if own else np.zeros((0, 0))
    fit = diagnosis.stated_fit
    rows = [_index(fit, item) for item in own]
    spread = stated_sigmas(fit, diagnosis.without_prior)
    sigmas = {"units": "1", "long_name": "in prior standard deviations from nominal"}
    # What was put right counts from the definition as it was given.
    off = np.array([diagnosis.put_right.get(item.name, 0.0) for item in own])
    return {
        "parameter": [item.name for item in own],
        "parameter_nominal": ("parameter", np.array([item.value for item in own])),
        "parameter_prior_sigma": ("parameter", np.array([item.sigma for item in own])),
        "parameter_low": ("parameter", off + [item.low for item in own], sigmas),
        "parameter_high": ("parameter", off + [item.high for item in own], sigmas),
        "parameter_logarithmic": ("parameter", np.array([item.logarithmic for item in own]).astype(np.int8)),
        "parameter_unit": ("parameter", [item.unit for item in own]),
        "parameter_known": ("parameter", off + belief.mean, sigmas),
        "parameter_known_sigma": ("parameter", np.sqrt(np.diag(known)), sigmas),
        "parameter_fitted": ("parameter", off + [fit.position[i] for i in rows], sigmas),
        "parameter_fitted_sigma": ("parameter", np.array([spread[i] for i in rows]), sigmas),
    }


def _index(fit: Fit, coordinate: Coordinate) -> int:
    return next(i for i, item in enumerate(fit.coordinates) if item.name == coordinate.name)
