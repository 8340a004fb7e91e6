"""Tests that could be run on a machine, and where on it a further sensor can be put."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import COVARIATE
from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.coordinate_names import NO_VALUES, OF_ONE_RECORDING
from spindle_fem.inference.hypothesis_fit import Fit
from spindle_fem.inference.misdescription_columns import direction_columns
from spindle_fem.inference.planned_test import DISPLACEMENT_NOISE
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.reading_noise import SlowError
from spindle_fem.inference.schedules import HOLD, geometry_schedules, network_schedules
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.reduced.drive import STANDARD, Drive, make_drive
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.units import MICROMETRES

Array = NDArray[np.float64]

# Longest step of a simulated test, s: tests are compared between hypotheses, not with readings.
TEST_STEP = 120.0
# Name of the test that repeats the recorded operation.
AGAIN = "the same operation again"
# White noise [µm] and slow error of a displacement sensor that is not there yet.
FURTHER_DISPLACEMENT = MICROMETRES * DISPLACEMENT_NOISE
FURTHER_SLOW = SlowError(tuned.DISPLACEMENT_SLOW_SIGMA, tuned.EXPECTED_SLOW_TIME)


@dataclass(frozen=True, slots=True)
class Trial:
    """One way to operate the machine for an hour or a few.

    Attributes
    ----------
    name : str
        In plain words.
    quantity : str
        What is varied.
    effort : int
        0: as it ran anyway; 1: a test of its own; 2: one that needs more than the control panel.
    """

    name: str
    quantity: str
    drive: Drive
    effort: int


@dataclass(frozen=True, slots=True)
class Place:
    """Somewhere a sensor can be put.

    Attributes
    ----------
    name : str
        Place of the reduced model; a probe or a displacement sensor where ``is_probe``.
    displaced : bool
        Whether it reads a displacement, in µm.
    """

    name: str
    words: str
    component: str
    is_probe: bool = False
    displaced: bool = False


class TrialPredictor(Predictor):
    """The machine of a diagnosis in another operation, from a uniform temperature at its start."""

    def __init__(self, predictor: Predictor, drive: Drive) -> None:
        self.__dict__.update(copy.copy(predictor.__dict__))
        self.drives = (replace(drive, times=drive.grid),)
        # Directions act differently in another operation.
        self.misdescribed, self._stacked = (), {}
        self.recordings, self.columns = predictor.recordings[:1], predictor.columns[:1]
        self.observations, self.heldout = (), ()

    def start(
        self, number: int, values: Mapping[str, float] = NO_VALUES, derivatives: Sequence[str] = ()
    ) -> float | Start:
        """Ambient temperature at the start; the recording's first readings where there is none, K.

        An operation with long gaps begins again after each, as it did in the recording.
        """
        drive = self.drives[0]
        if drive.restarts:
            return super().start(number, values, derivatives)
        if "ambient" in drive.names:
            return drive.first("ambient")
        return float(np.mean(list(self.recordings[0].first_readings().values())))


@dataclass(frozen=True, slots=True)
class Answer:
    """Prediction of a hypothesis for a trial.

    Attributes
    ----------
    times : (n,) ndarray, [s]
    readings : (n, c) ndarray, [K, µm]
        Channels of the recording, then places; displacements count from the start of the trial.
    slopes : (n, c, p) ndarray
        To the coordinates of the fit.
    """

    times: Array
    readings: Array
    slopes: Array


def answer(
    predictor: Predictor,
    fit: Fit,
    trial: Trial,
    places: Sequence[Place],
    spacing: float,
    known: list[Array] | None = None,
) -> Answer:
    """Simulate a trial under a hypothesis.

    Parameters
    ----------
    spacing : float, [s]
        Interval between the instants of the readings.
    known : list of ndarray, optional
        What directions do in this trial to channels and places, as another hypothesis left it here; filled
        where it is empty. They do nearly the same under all hypotheses that fit the same readings.

    Raises
    ------
    ConvergenceError
        The hypothesis runs away in this operation.
    """
    own = TrialPredictor(predictor, trial.drive)
    # What was found in one recording, whichever it was, comes and goes in a trial as it did there.
    candidates = tuple(replace(item, recording=None) for item in fit.candidates)
    chosen = [(c, i) for i, c in enumerate(fit.coordinates) if not c.name.startswith(OF_ONE_RECORDING)]
    names = [c.name for c, _ in chosen]
    values = {name: value for name, value in fit.values.items() if not name.startswith(OF_ONE_RECORDING)}
    predicted = own.predict(0, values, candidates, names)
    readings, slopes = [predicted.temperature], [predicted.sensitivity]
    if places:
        means = np.array([_weights(predictor, place) for place in places])
        readings.append(predicted.states @ means.T + _stretch(predictor, own.drives[0], places))
        slopes.append(predicted.slopes_at(means))
    directions = [item for item in predictor.misdescribed if item.coordinate in values]
    if directions:
        changes = [] if known is None else known
        if not changes:
            changes += direction_columns(BaseRun(own, 0, values, candidates), directions)
            if places:
                changes[1] = means @ changes[1]
        amounts = np.array([values[item.coordinate] for item in directions])
        rows = [names.index(item.coordinate) for item in directions]
        for reading, slope, change in zip(readings, slopes, changes, strict=False):
            reading += change @ amounts
            slope[:, :, rows] += change
    grid = own.drives[0].grid
    times = np.arange(grid[0] + spacing, grid[-1] + 0.5 * spacing, spacing)
    times = times[times <= grid[-1]]
    whole = np.concatenate(readings, axis=1)
    by = np.concatenate(slopes, axis=1) * np.array([c.sigma for c, _ in chosen])
    read = range(predictor.recordings[0].temperature_count, predicted.temperature.shape[1])
    displaced = [*read, *(read.stop + i for i, place in enumerate(places) if place.displaced)]
    for values in (whole, by):
        values[:, displaced] -= values[0, displaced].copy()
    full = np.zeros((len(times), whole.shape[1], len(fit.coordinates)))
    full[:, :, [i for _, i in chosen]] = _at(times, grid, by)
    return Answer(times, _at(times, grid, whole), full)


def _weights(predictor: Predictor, place: Place) -> Array:
    model = predictor.fast.model
    return model.probes[model.probe_names.index(place.name)] if place.is_probe else model.place(place.name)


def _stretch(predictor: Predictor, drive: Drive, places: Sequence[Place]) -> Array:
    """What rotation adds to the reading of displacement sensors at the ends of the steps, (G + 1, k) µm."""
    model, column = predictor.fast.model, drive.column("speed") if "speed" in drive.names else None
    spins = np.zeros(len(places))
    for index, place in enumerate(places if model.probe_spins.size else ()):
        if place.displaced:
            spins[index] = model.probe_spins[model.probe_names.index(place.name)]
    if column is None:
        return np.zeros((1, len(places)))
    return np.square(np.append(drive.start[:, column], drive.end[-1:, column]))[:, None] * spins


def _at(times: Array, grid: Array, values: Array) -> Array:
    right = np.clip(np.searchsorted(grid, times, side="left"), 1, len(grid) - 1)
    part = ((times - grid[right - 1]) / (grid[right] - grid[right - 1])).reshape(
        -1, *([1] * (values.ndim - 1))
    )
    return values[right - 1] + part * (values[right] - values[right - 1])


# --------------------------------------------------------------------- places
def reachable_places(spec: MachineSpec, names: Sequence[str]) -> tuple[Place, ...]:
    """Places of a reduced model at which a person can put a sensor.

    Standing parts and their segments, outer rings through a bore in the
    housing, and both ends of the shaft (an infrared sensor on the turning
    surface). Places that a probe already reads differ from it and stay.

    Parameters
    ----------
    names : sequence of str
        Places of the model.
    """
    layout = Layout(spec, set(names))
    known = set(names)
    found: list[Place] = []
    for part in spec.part:
        if part.rotating or layout.is_spacer(part):
            continue
        segments = [s for s in part.segment if f"{part.name}.{s.name}" in known]
        component = layout.component_of(part.name)
        if part is layout.housing and len(segments) > 1:
            for segment in segments:
                name = f"{part.name}.{segment.name}"
                own = "flange" if segment.name == layout.flange else component
                found.append(Place(name, f"{_plain(part.name)}, {_plain(segment.name)}", own))
        elif part.name in known:
            found.append(Place(part.name, _plain(part.name), component))
    for _, bearing in spec.bearings:
        name = f"{bearing.name}.outer_ring"
        if name in known:
            found.append(Place(name, f"outer ring of {bearing.name} (bore in the housing)", bearing.name))
    for key, words in (("nose", "nose"), ("drive_end", "drive end")):
        place = next(iter(layout.heat().get(key, ())), "")
        if place in known:
            found.append(Place(place, f"shaft, {words} (infrared)", key))
    return tuple(found)


def beside_probes(names: Sequence[str], probes: Sequence[str]) -> tuple[Place, ...]:
    """A second sensor beside each of some probes, those of ``names`` that a model has as points."""
    return tuple(
        Place(name, f"a second sensor beside {name}", name, True) for name in names if name in probes
    )


def unread_displacements(spec: MachineSpec, read: Sequence[str]) -> tuple[Place, ...]:
    """Displacement sensors of a definition that are not read."""
    return tuple(
        Place(item.name, f"displacement sensor {item.name} of the definition", "shaft", True, True)
        for item in spec.displacement_sensor
        if item.name not in read
    )


def network_places(names: Sequence[str], read: Sequence[str]) -> tuple[Place, ...]:
    """Nodes of a network that are not read yet."""
    return tuple(Place(name, _plain(name), name) for name in names if name not in read)


def _plain(name: str) -> str:
    return name.replace("_", " ")


# --------------------------------------------------------------------- trials
def trials_of(predictor: Predictor, view: MachineView) -> tuple[Trial, ...]:
    """Tests worth considering on a machine, the recorded operation first."""
    again = Trial(AGAIN, "temperature", predictor.drives[0], 0)
    if view.kind == "network":
        return (again, *_network_trials(predictor))
    return (again, *_geometry_trials(predictor, view))


def _geometry_trials(predictor: Predictor, view: MachineView) -> list[Trial]:
    names = predictor.drives[0].names
    usual = _usual(predictor)
    high = max(float(np.max(drive.start[:, drive.column("speed")])) for drive in predictor.drives)
    has_channel = predictor.fast.spec.channel is not None
    return [
        Trial(item.name, item.quantity, _staged(names, usual, item.stages), item.effort)
        for item in geometry_schedules(usual, high or view.highest_speed, has_channel=has_channel)
    ]


def _usual(predictor: Predictor) -> dict[str, float]:
    """Mean over all recordings by name; while they are on of a network's inputs and of the standard ones."""
    found = {}
    for name in predictor.drives[0].names:
        values = np.concatenate(
            [drive.start[:, drive.column(name)] for drive in predictor.drives if name in drive.names]
        )
        lengths = np.concatenate([drive.steps for drive in predictor.drives if name in drive.names])
        drives_it = not name.startswith(COVARIATE) if predictor.is_network else name in STANDARD
        on = values > 0.0
        chosen = on if drives_it and on.any() else np.ones(len(values), dtype=bool)
        found[name] = float(np.average(values[chosen], weights=lengths[chosen]))
    return found


def _staged(
    names: tuple[str, ...],
    usual: Mapping[str, float],
    stages: Sequence[tuple[float, Mapping[str, float]]],
) -> Drive:
    """Inputs that hold from stage to stage; what a stage does not name keeps its usual value."""
    ends = np.cumsum([length for length, _ in stages])
    times = np.concatenate(([0.0], ends))
    rows = [[{**usual, **changed}[name] for name in names] for _, changed in stages]
    values = np.array([*rows, rows[-1]])
    return make_drive(times, names, values, np.ones(len(names), dtype=bool), largest_step=TEST_STEP)


def _network_trials(predictor: Predictor) -> list[Trial]:
    """Every input that varied: half its range, the highest, then the lowest; the others as usual."""
    drive = predictor.drives[0]
    usual = _usual(predictor)
    hold = float(np.clip(0.25 * (drive.grid[-1] - drive.grid[0]), HOLD, 4.0 * HOLD))
    lows, highs = drive.start.min(axis=0).tolist(), drive.start.max(axis=0).tolist()
    ranges = dict(zip(drive.names, zip(lows, highs, strict=True), strict=True))
    found = []
    for item in network_schedules(ranges, hold):
        # Equal steps: one matrix of the model.
        count = int(np.ceil(item.length / TEST_STEP / len(item.stages))) * len(item.stages)
        grid = np.linspace(0.0, item.length, count + 1)
        owner = np.repeat(np.arange(len(item.stages)), count // len(item.stages))
        rows = np.array([[{**usual, **changed}[n] for n in drive.names] for _, changed in item.stages])
        own = replace(
            drive,
            times=grid,
            grid=grid,
            start=rows[owner],
            end=rows[owner],
            step_class=np.zeros(len(owner), dtype=np.int64),
            restarts=(),
        )
        found.append(Trial(item.name, item.quantity, own, item.effort))
    return found
