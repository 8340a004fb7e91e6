"""Preload that follows temperatures in the fast model: bearing mechanics at sampled states of its own runs.

The sets are solved where runs of the machine go, the farthest from what is known first, until what lies
between the samples is right too. Samples stay in the cache for later runs.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from spindle_fem.cache import cache_directory, load_record, save_record, source_digest
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.term import TermContext
from spindle_fem.errors import ConvergenceError
from spindle_fem.model.reduced.sampled_response import SampledResponse
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.friction_map import FrictionMap
from spindle_fem.operation.mounted_states import KELVINS, MountedSet, MountedStates

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

FORMAT = "spindle-fem/mounted-samples/1"
# Scaled units: a micrometre of a ring, four kelvins, a third of the speed and 200 N of thrust change friction
# about alike.
PER_KELVIN, PER_LOG_SPEED, PER_NEWTON = 0.25, 3.0, 0.005
# Samples solved in one round, those that a response takes, those in the cache; rounds.
FRESH, MOST_SAMPLES, MOST_KEPT, MOST_ROUNDS = 16, 320, 1000, 20
# Samples to begin with are this far apart at least; nearer ones than the second say nothing more.
FIRST_APART, NEAREST = 0.5, 0.05
# Errors between samples that are left: of the logarithms of friction, conductances and joints, N and share of
# the preload.
FRICTION_ERROR, CONDUCTANCE_ERROR, PRELOAD_ERROR, PRELOAD_SHARE = 2.0e-3, 1.0e-2, 10.0, 5.0e-3
# The largest error of friction with which a run is given.
LARGEST_ERROR = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class MountedRun:
    """What a run of a machine went through.

    Attributes
    ----------
    times : (g,) ndarray, [s]
    unknowns : (g, r) ndarray
        Of the fast model.
    speed, thrust : (g,) ndarray, [rad/s], [N]
    """

    times: Array
    unknowns: Array
    speed: Array
    thrust: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Samples:
    """Solved states, in the order of the machine's bearings and sets.

    Attributes
    ----------
    speed, thrust : (n,) ndarray
    states : (n, n_bearings, width) ndarray
    values : (n, m) ndarray
        Quantities of all sets side by side; nan where the bearings have no equilibrium.
    """

    speed: Array
    thrust: Array
    states: Array
    values: Array

    def joined(self, other: _Samples) -> _Samples:
        """These and others."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in self.__slots__)
        return _Samples(*(np.concatenate(pair) for pair in pairs))

    def at(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> _Samples:
        """Some of them."""
        return _Samples(*(getattr(self, name)[rows] for name in self.__slots__))


class FollowedPreload:
    """Friction, ball conductances, joints and preload of the bearings as mounted, over unknowns of a model.

    Parameters
    ----------
    mounted : MountedStates
    samples
        Solved states.
    offsets : (n_bearings, width) ndarray
        What the states of a model count from, as ``MountedStates.rows`` gives it.

    Attributes
    ----------
    responses : list of (MountedSet, SampledResponse, (q,) ndarray)
        Of every set, with the coordinates of the state in which all unknowns are zero, less those that they
        are given as.
    reads : tuple of str
        Coordinates of every set's states.
    joints : tuple of str
        Coefficients that follow the fits.
    """

    def __init__(self, mounted: MountedStates, samples: _Samples, offsets: Array) -> None:
        self.mounted = mounted
        self.lowest_speed = float(mounted.friction.speed[0])
        inputs = self._inputs(samples.speed, samples.thrust)
        self.responses: list[tuple[MountedSet, SampledResponse, Array]] = []
        first = 0
        for group in mounted.sets:
            own = samples.values[:, first : first + group.number]
            states = _scaled(samples.states[:, list(group.rows)]).reshape(len(own), -1)
            response = SampledResponse.through(states, inputs, own)
            from_zero = response.middle + _scaled(offsets[list(group.rows)]).ravel()
            self.responses.append((group, response, from_zero @ response.directions))
            first += group.number
        self.reads = tuple(
            f"mounted.{group.name}.{number}"
            for group, response, _ in self.responses
            for number in range(response.directions.shape[1])
        )
        self.joints = tuple(name for group in mounted.sets for name in group.joints)
        self._known: tuple[Complex, Complex] | None = None

    def _inputs(self, speed: Array, thrust: Array) -> Array:
        """Speed and thrust as the responses take them, (n, 2)."""
        turning = np.log(np.maximum(speed, self.lowest_speed))
        return np.column_stack((PER_LOG_SPEED * turning, PER_NEWTON * np.asarray(thrust)))

    def read_row(self, model: ThermalModel, name: str) -> Array:
        """Coordinate of one of :attr:`reads` from the unknowns, (r,)."""
        _, group, number = name.rsplit(".", 2)
        rows, _ = self.mounted.rows(model)
        for own, response, _ in self.responses:
            if own.name == group:
                scaled = _scaled(rows[list(own.rows)], axis=1).reshape(-1, model.size)
                return response.directions[:, int(number)] @ scaled
        raise KeyError(name)

    def at_states(self, speed: Array, thrust: Array, states: Array) -> Array:
        """Quantities of all sets side by side (n, m) at states (n, n_bearings, width)."""
        inputs = self._inputs(speed, thrust)
        found = []
        for group, response, _ in self.responses:
            flat = _scaled(states[:, list(group.rows)]).reshape(len(states), -1)
            at = (flat - response.middle) @ response.directions
            found.append(response.within(at, inputs)[0])
        return np.hstack(found)

    def quantities(self, coordinates: NDArray, context: TermContext) -> NDArray:
        """Quantities of all sets one after the other, (m, k), with derivatives that complex steps carry.

        Parameters
        ----------
        coordinates : (n_reads, k) ndarray
            Of :attr:`reads`.
        """
        if self._known is not None and self._known[0] is context.temperatures:
            return self._known[1]
        count = coordinates.shape[1]
        speed, thrust = (np.broadcast_to(context.inputs[name], count) for name in ("speed", "thrust"))
        inputs = self._inputs(speed, thrust)
        asked = np.vstack((coordinates.real, inputs.T))
        # Perturbations of one instant lie side by side and differ in their imaginary parts only.
        fresh = np.append(True, np.any(asked[:, 1:] != asked[:, :-1], axis=0))
        own = np.cumsum(fresh) - 1
        found, first = [], 0
        for _, response, zero in self.responses:
            rows = slice(first, first + response.directions.shape[1])
            value, slope = response.within(coordinates[rows][:, fresh].real.T - zero, inputs[fresh])
            moved = coordinates[rows].imag.T
            found.append(value[own].T + 1j * np.einsum("kmq,kq->mk", slope[own], moved))
            first = rows.stop
        answer = np.concatenate(found)
        self._known = context.temperatures, answer
        return answer

    def logarithms(self, quantities: NDArray) -> NDArray:
        """Logarithms of friction and both ball conductances, over those at assembly, (n_bearings, 3, k)."""
        found = np.empty((len(self.mounted.friction.bearings), 3, quantities.shape[1]), quantities.dtype)
        first = 0
        for group in self.mounted.sets:
            own = quantities[first : first + 4 * len(group.bearings)]
            found[list(group.rows)] = own.reshape(len(group.bearings), 4, -1)[:, :3]
            first += group.number
        return found

    def of_joints(self, quantities: NDArray) -> NDArray:
        """Logarithm of every joint's conductance over that as assembled, (n_joints, k)."""
        found, first = [], 0
        for group in self.mounted.sets:
            found.append(quantities[first + 4 * len(group.bearings) : first + group.number])
            first += group.number
        return np.concatenate(found)

    def preload(self, model: ThermalModel, run: MountedRun) -> Array:
        """Preload of every bearing along a run, (g, n_bearings) [N]."""
        values = self.at_states(run.speed, run.thrust, _states_of(self.mounted, model, run)).T
        found, first = np.empty((len(run.speed), len(self.mounted.friction.bearings))), 0
        for group in self.mounted.sets:
            own = values[first : first + 4 * len(group.bearings)]
            found[:, list(group.rows)] = own[3::4].T
            first += group.number
        return found


def _scaled(states: Array, axis: int = -1) -> Array:
    """States in units that matter alike."""
    width = states.shape[axis]
    shape = [1] * states.ndim
    shape[axis] = width
    return states * np.where(np.arange(width) < KELVINS, PER_KELVIN, 1.0).reshape(shape)


def _states_of(mounted: MountedStates, model: ThermalModel, run: MountedRun) -> Array:
    """States of all bearings along a run, (g, n_bearings, width)."""
    rows, offsets = mounted.rows(model)
    return np.einsum("bwr,gr->gbw", rows, run.unknowns, optimize=True) - offsets


def sample_preload(
    spec: MachineSpec,
    model: ThermalModel,
    friction: FrictionMap,
    march: Callable[[FollowedPreload | None], Sequence[MountedRun]],
    progress: Callable[[str], None] = lambda stage: None,
) -> tuple[FollowedPreload, float]:
    """Response of a machine's bearings along its own runs, and the largest relative error of friction left.

    Parameters
    ----------
    march : callable
        Runs with a response; without one at the size of assembly.

    Raises
    ------
    ConvergenceError
        The bearings have no equilibrium where the machine goes.
    """
    progress("preload: bearings along the run")
    mounted = MountedStates(spec, model.contacts, friction)
    path = cache_directory() / f"mounted-{_digest(spec, mounted)}.npz"
    samples, known, error = _kept(path), None, np.inf
    _, offsets = mounted.rows(model)
    if samples is not None:
        known = FollowedPreload(mounted, _latest(samples), offsets)
    try:
        for _ in range(MOST_ROUNDS):
            runs = march(known)
            seen = _instants(mounted, model, runs, float(friction.speed[0]))
            chosen = _farthest(mounted, seen, samples)
            settled = known is not None
            if len(chosen):
                fresh = _solve(mounted, seen.at(chosen))
                samples = fresh if samples is None else samples.joined(fresh)
                if known is not None:
                    error, enough = _mismatch(mounted, known, fresh.at(_solved(fresh)))
                    settled = enough and bool(_solved(fresh).all())
            if settled:
                error = min(error, FRICTION_ERROR) if not len(chosen) else error
                doubtful = _doubtful(mounted, seen, samples)
                if not len(doubtful):
                    return known, error
                fresh = _solve(mounted, seen.at(doubtful))
                samples = samples.joined(fresh)
                if not _solved(fresh).all():
                    raise _runaway(spec, runs, int(doubtful[np.flatnonzero(~_solved(fresh))[0]]))
            if not _solved(samples).any():
                raise _runaway(spec, runs, int(chosen[0]))
            known = FollowedPreload(mounted, _latest(samples), offsets)
    finally:
        if samples is not None:
            save_record(samples.at(np.arange(len(samples.speed))[-MOST_KEPT:]), path, FORMAT)
    if error > LARGEST_ERROR:
        lost = np.flatnonzero(~_solved(fresh))
        raise _runaway(spec, runs, int(chosen[lost[0] if len(lost) else 0]))
    return known, error


def _latest(samples: _Samples) -> _Samples:
    """The last solved ones, as many as a response takes."""
    return samples.at(np.flatnonzero(_solved(samples))[-MOST_SAMPLES:])


def _doubtful(mounted: MountedStates, seen: _Samples, samples: _Samples) -> NDArray[np.int64]:
    """Some instants nearest to states without equilibrium, which may have none either: the nearest first."""
    apart = _apart(mounted, seen, samples)
    near = np.flatnonzero(~_solved(samples)[apart.argmin(axis=1)])
    return near[np.argsort(apart[near].min(axis=1, initial=np.inf), kind="stable")][:FRESH]


def _runaway(spec: MachineSpec, runs: Sequence[MountedRun], instant: int) -> ConvergenceError:
    """Refusal of a run at one of its instants."""
    times, speed = (np.concatenate([getattr(run, name) for run in runs]) for name in ("times", "speed"))
    return ConvergenceError(
        f"{spec.name}: preload",
        f"after {times[instant] / 3600.0:.2f} h at {speed[instant] * 30.0 / np.pi:.0f} rpm the bearings have "
        "no equilibrium.",
        "Preload runs away: lower the speed, loosen the fits, or run at the size of assembly "
        "(--set heat.thermal_preload=false).",
    )


def _solved(samples: _Samples) -> NDArray[np.bool_]:
    return np.isfinite(samples.values).all(axis=1)


def _instants(
    mounted: MountedStates, model: ThermalModel, runs: Sequence[MountedRun], lowest_speed: float
) -> _Samples:
    """All instants of some runs, not solved yet."""
    states = np.concatenate([_states_of(mounted, model, run) for run in runs])
    speed, thrust = (np.concatenate([getattr(run, name) for run in runs]) for name in ("speed", "thrust"))
    return _Samples(np.maximum(speed, lowest_speed), thrust, states, np.zeros((len(speed), 0)))


def _positions(mounted: MountedStates, samples: _Samples) -> Array:
    """Scaled states and inputs, (n, d)."""
    return np.hstack(
        (
            _scaled(samples.states).reshape(len(samples.speed), -1),
            PER_LOG_SPEED * np.log(samples.speed)[:, None],
            PER_NEWTON * samples.thrust[:, None],
        )
    )


def _apart(mounted: MountedStates, seen: _Samples, samples: _Samples) -> Array:
    """Distances of instants from samples, (n, m)."""
    return cdist(_positions(mounted, seen), _positions(mounted, samples))


def _farthest(mounted: MountedStates, seen: _Samples, samples: _Samples | None) -> NDArray[np.int64]:
    """Instants to solve next: each the farthest from all samples and from those before it."""
    where = _positions(mounted, seen)
    nearest = np.full(len(where), np.inf)
    if samples is not None:
        nearest = _apart(mounted, seen, samples).min(axis=1)
    chosen: list[int] = []
    for _ in range(FRESH if samples is not None else 2 * FRESH):
        best = int(np.argmax(nearest))
        if nearest[best] < (NEAREST if samples is not None else FIRST_APART):
            break
        chosen.append(best)
        nearest = np.minimum(nearest, np.linalg.norm(where - where[best], axis=1))
    return np.array(chosen, dtype=np.int64)


def _solve(mounted: MountedStates, asked: _Samples) -> _Samples:
    """Solve the bearings at some states."""
    values = np.full((len(asked.speed), sum(group.number for group in mounted.sets)), np.nan)
    for row in range(len(values)):
        found = mounted.at(float(asked.speed[row]), float(asked.thrust[row]), asked.states[row])
        if found is not None:
            values[row] = np.concatenate([found[group.name] for group in mounted.sets])
    return _Samples(asked.speed, asked.thrust, asked.states, values)


def _mismatch(mounted: MountedStates, known: FollowedPreload, fresh: _Samples) -> tuple[float, bool]:
    """Largest error of friction at states that the response did not know; whether all errors are small."""
    if not len(fresh.speed):
        return np.inf, False
    apart = np.abs(known.at_states(fresh.speed, fresh.thrust, fresh.states) - fresh.values)
    bearing = [FRICTION_ERROR, CONDUCTANCE_ERROR, CONDUCTANCE_ERROR, PRELOAD_ERROR]
    limits = np.concatenate(
        [len(group.bearings) * bearing + len(group.joints) * [CONDUCTANCE_ERROR] for group in mounted.sets]
    )
    heat = apart[:, limits == FRICTION_ERROR]
    allowed = limits + np.where(limits == PRELOAD_ERROR, PRELOAD_SHARE * np.abs(fresh.values), 0.0)
    return float(heat.max(initial=0.0)), bool(np.all(apart <= allowed))


def _kept(path: Path) -> _Samples | None:
    """Samples of earlier runs."""
    found = load_record(path, FORMAT, _Samples)
    if found is None or not len(found["speed"]) or not np.isfinite(found["values"]).all(axis=1).any():
        return None
    return _Samples(**found)


def _digest(spec: MachineSpec, mounted: MountedStates) -> str:
    """Hash of all on which a solved state depends."""
    content = spec.model_dump(mode="json")
    for key in ("operation", "name", "title", "description", "initial", "effects", "mesh", "film", "coolant"):
        content.pop(key, None)
    own = [source_digest(__name__), mounted.contacts, content]
    return hashlib.sha256(json.dumps(own, sort_keys=True, default=str).encode()).hexdigest()
