"""Transient studies: phases of constant inputs, each for a time or until the machine has settled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator

from spindle_fem.definition.faults import validation_faults
from spindle_fem.definition.field_types import (
    Fault,
    Force,
    RotationalSpeed,
    SpecModel,
    Temperature,
    VolumeFlow,
    quantity_field,
    raise_faults,
)
from spindle_fem.definition.load import read_toml
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import FaultsError, SpecError
from spindle_fem.machine.geometry.coolant_path import delivered_flow
from spindle_fem.model.mesh.thermal_state import ThermalState
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.coupled_steady import solve_coupled
from spindle_fem.solvers.coupled_transient import CoupledInputs
from spindle_fem.solvers.input_history import FIELD_OF, OperatingHistory
from spindle_fem.solvers.machine_transient import (
    MachineTransient,
    TransientOptions,
    Watch,
    require_state,
    simulate_full,
    start_at,
    start_from,
)
from spindle_fem.solvers.mesh_terms import NO_PHYSICS, Physics, settled_memory, steady_physics, with_factors
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.solvers.readings import ReadingRows
from spindle_fem.solvers.transient_records import balanced

Array = NDArray[np.float64]

# Of the error of a step, to which loads and temperatures agree within it. Of the reference spindle's heat-up
# to 0.05 K readings then stay within 0.0001 K of those of a coupling to round-off, for half the solves.
COUPLING_SHARE = 2.0e-3
TRANSIENT_SCHEMA = "spindle-fem/transient/1"
Duration = quantity_field("s", above=0.0)
PositiveDifference = quantity_field("K", "temperature_difference", above=0.0)


class Until(SpecModel):
    """A phase ends when no probe changes by more than this."""

    change: PositiveDifference
    """Largest change of any probe."""
    within: Duration
    """Time over which the change is looked at."""
    look_every: Duration
    """How often readings are compared; divides ``within``."""
    at_most: Duration
    """Length of the phase if it does not settle."""

    @model_validator(mode="after")
    def _whole_looks(self) -> Until:
        looks = self.within / self.look_every
        if abs(looks - round(looks)) > 1e-9 or looks < 1.0 - 1e-9:
            raise_faults(
                [
                    Fault(
                        "look_every",
                        f"{self.look_every:g} s does not divide {self.within:g} s.",
                        "Allowed: a whole part of within.",
                    )
                ]
            )
        return self


class Phase(SpecModel):
    """A stretch of constant inputs; what is not given stays as before."""

    name: Annotated[str, Field(min_length=1)]
    """For tables and pictures."""
    speed: RotationalSpeed | None = None
    """Of the shaft."""
    thrust: Force | None = None
    """External axial force, positive towards the rear."""
    ambient_temperature: Temperature | None = None
    """Of the air around the machine."""
    coolant_inlet_temperature: Temperature | None = None
    """Mixed, where the coolant enters."""
    coolant_flow: VolumeFlow | None = None
    """Of all starts together; less flows where the pump's pressure does not suffice."""
    duration: Duration | None = None
    """Fixed length; else the phase ends as ``until`` says."""
    until: Until | None = None
    """Ends when settled; the study's own when absent."""


class TransientStudy(SpecModel):
    """A transient study file."""

    schema_: Annotated[Literal["spindle-fem/transient/1"], Field(alias="schema")]
    """Version of this format."""
    name: Annotated[str, Field(min_length=1)]
    """Title of the report."""
    machine: str = "wu_tan_2016"
    """Definition that is run unless another is given."""
    start: Literal["ambient", "steady"] = "ambient"
    """Everything at ambient temperature, or settled at the definition's own operating point."""
    sample_every: Duration = 60.0
    """Time between readings."""
    fields_every: Duration | None = None
    """Time between fields that are kept for ParaView, with those where phases begin and end."""
    error: PositiveDifference = 0.05
    """Largest estimated error of one time step at any node."""
    until: Until | None = None
    """For phases without a duration."""
    phase: Annotated[tuple[Phase, ...], Field(min_length=1)]
    """In order."""

    @model_validator(mode="after")
    def _every_phase_ends(self) -> TransientStudy:
        faults = [
            Fault(f"phase.{phase.name}", "has no end.", "Give a duration, or an [until] table.")
            for phase in self.phase
            if phase.duration is None and phase.until is None and self.until is None
        ]
        faults += [
            Fault(f"phase.{phase.name}", "has a duration and an until.", "Give one of both.")
            for phase in self.phase
            if phase.duration is not None and phase.until is not None
        ]
        raise_faults(faults)
        return self

    def options(self) -> TransientOptions:
        """How accurately it is followed: loads and temperatures agree far within the error of a step.

        A study that keeps fields couples to round-off: a run whose balance asks for closer coupling is
        done again, and fields that were written are not taken back.
        """
        if self.fields_every is not None:
            return TransientOptions(error=self.error)
        return TransientOptions(
            error=self.error, coupling_tolerance=COUPLING_SHARE * self.error, trust_contraction=True
        )

    def end_of(self, phase: Phase) -> Until | None:
        """Stop condition of a phase, None for a fixed length."""
        return None if phase.duration is not None else phase.until or self.until


@dataclass(frozen=True, slots=True)
class PhaseResult:
    """Result of one phase.

    Attributes
    ----------
    start, end : float, [s]
    settled : bool or None
        Whether it ended because the probes had settled; None for a phase of
        fixed length.
    """

    name: str
    point: OperatingPoint
    start: float
    end: float
    settled: bool | None
    transient: MachineTransient


@dataclass(frozen=True, slots=True)
class StudyResult:
    """A study as it ran."""

    study: TransientStudy
    phases: tuple[PhaseResult, ...]

    @property
    def state(self) -> ThermalState:
        """State at the end, to continue from."""
        return self.phases[-1].transient.state

    @property
    def memory(self) -> Array | None:
        """Memory of terms at the end; None without terms."""
        return self.phases[-1].transient.memory

    def joined(self, name: str) -> Array:
        """An array of :class:`MachineTransient` over all phases; a jump keeps the later sample."""
        parts = [getattr(phase.transient, name) for phase in self.phases]
        before = [
            part[: np.count_nonzero(phase.transient.times < phase.end)]
            for part, phase in zip(parts[:-1], self.phases[:-1], strict=True)
        ]
        return np.concatenate([*before, parts[-1]])

    def step_record(self, name: str) -> Array:
        """An array of :class:`StepRecord` over all phases."""
        return np.concatenate([getattr(phase.transient.steps, name) for phase in self.phases])


class Settled:
    """Stop condition: no probe has changed by more than the given tolerance over a window."""

    def __init__(
        self, rows: ReadingRows, history: OperatingHistory, until: Until, start: ThermalState
    ) -> None:
        self.rows, self.history, self.until = rows, history, until
        number = int(np.floor(until.at_most / until.look_every * (1.0 + 1e-9)))
        self.looks = start.time + until.look_every * np.arange(1, number + 1)
        self._window = round(until.within / until.look_every)
        self._seen = [self._read(start)]

    def __call__(self, state: ThermalState) -> bool:
        """Whether the probes have settled at this state; called after every step."""
        if not np.any(self.looks == state.time):
            return False
        self._seen.append(self._read(state))
        if len(self._seen) <= self._window:
            return False
        return bool(np.abs(self._seen[-1] - self._seen[-1 - self._window]).max() < self.until.change)

    def _read(self, state: ThermalState) -> Array:
        outputs = (self.rows.rows @ state.vector())[None, :]
        return self.rows.probe_readings(
            outputs, np.array([state.time]), lambda time: (self.history.at(time), 1.0)
        )[0]


def load_study(path: str | Path) -> TransientStudy:
    """Read a transient study; every fault at once.

    Raises
    ------
    FaultsError
    """
    content = read_toml(Path(path))
    return study_of(content, Path(path).name)


def study_of(content: Mapping[str, Any], source: str = "study") -> TransientStudy:
    """Study of raw tables; see :func:`load_study`."""
    if content.get("schema") != TRANSIENT_SCHEMA:
        what = f"{content['schema']!r} is not known." if "schema" in content else "is missing."
        raise FaultsError(source, [SpecError(f"{source}: schema", what, f'Allowed: "{TRANSIENT_SCHEMA}".')])
    try:
        return TransientStudy.model_validate(dict(content))
    except ValidationError as error:
        raise FaultsError(source, validation_faults(error, source, TransientStudy, content)) from error


def run_study(
    machine: PreparedMachine,
    study: TransientStudy,
    *,
    start: ThermalState | None = None,
    memory: Array | None = None,
    physics: Physics = NO_PHYSICS,
    progress: Callable[[str], None] = lambda text: None,
    keep: Callable[[ThermalState], None] = lambda state: None,
) -> StudyResult:
    """Run every phase of a study, one after the other.

    Parameters
    ----------
    start : ThermalState, optional
        A saved state to go on from, in place of the study's own start.
    memory : ndarray, optional
        What the terms remembered then.
    physics : Physics
        Terms and factors beyond the machine's own; their memory goes on from phase to phase.
    keep : callable, optional
        Given the state every ``fields_every``, and where phases begin and end; those there twice.
    """
    machine, physics = with_factors(machine, physics)
    point = OperatingPoint.of(machine.spec)
    if start is None and study.start == "steady":
        progress("steady start")
        start = start_from(solve_coupled(machine, point, beyond=steady_physics(machine, physics)))
        memory = settled_memory(machine, physics, point, start.temperature, start.lumped_temperature)
    if start is not None:
        require_state(machine, start)
    options = study.options()
    state, results = start, []
    for phase, values in zip(study.phase, phase_inputs(machine.spec, study), strict=True):
        beyond = (physics, memory)
        watch = _StudyWatch(progress, keep, study.fields_every)
        result = _run_phase(machine, study, phase, values, state, options, beyond, watch)
        results.append(result)
        memory = result.transient.memory
        # the step's size says nothing after the inputs jump
        last = result.transient.state
        state = ThermalState(last.time, last.temperature, last.lumped_temperature)
    return StudyResult(study, tuple(results))


def phase_inputs(spec: MachineSpec, study: TransientStudy) -> list[dict[str, float]]:
    """Inputs of every phase by name: what a phase leaves out stays as before."""
    point = OperatingPoint.of(spec)
    values = {name: getattr(point, field) for name, field in FIELD_OF.items()}
    asked = spec.coolant.flow if spec.coolant else None
    found = []
    for phase in study.phase:
        given = {name: getattr(phase, field) for name, field in FIELD_OF.items()}
        values |= {name: value for name, value in given.items() if value is not None}
        asked = asked if phase.coolant_flow is None else phase.coolant_flow
        if asked is not None and spec.has_pump_limit:
            values["coolant_flow"] = float(delivered_flow(spec, values["coolant_inlet"], asked))
        found.append(dict(values))
    return found


def last_point(spec: MachineSpec, study: TransientStudy) -> OperatingPoint:
    """Operating point of the last phase."""
    inputs = InputHistory.constant(np.array([0.0, 1.0]), phase_inputs(spec, study)[-1])
    return OperatingHistory.of(spec, inputs).at(0.0)


@dataclass(frozen=True, slots=True)
class _StudyWatch:
    """Callbacks for progress and for keeping fields."""

    progress: Callable[[str], None]
    keep: Callable[[ThermalState], None]
    every: float | None

    def field_times(self, begin: float, end: float) -> tuple[float, ...]:
        """Whole multiples of the time between fields within a phase."""
        if self.every is None:
            return ()
        every = self.every
        return tuple((every * np.arange(np.floor(begin / every) + 1.0, np.ceil(end / every))).tolist())

    def observed(
        self, stop: Callable[[ThermalState], bool] | None, times: tuple[float, ...]
    ) -> Callable[[ThermalState], bool] | None:
        """A stop condition that keeps the states at some times as they pass."""
        if not times:
            return stop
        wanted = frozenset(times)

        def look(state: ThermalState) -> bool:
            if state.time in wanted:
                self.keep(state)
            return stop is not None and stop(state)

        return look


def _run_phase(
    machine: PreparedMachine,
    study: TransientStudy,
    phase: Phase,
    values: Mapping[str, float],
    state: ThermalState | None,
    options: TransientOptions,
    beyond: tuple[Physics, Array | None],
    watch: _StudyWatch,
) -> PhaseResult:
    until = study.end_of(phase)
    length = phase.duration if until is None else until.at_most
    begin = 0.0 if state is None else state.time
    inputs = InputHistory.constant(np.array([begin, begin + length]), values)
    history = OperatingHistory.of(machine.spec, inputs)
    if state is None:
        state = start_at(machine, history, values["ambient"])
    number = int(np.floor(length / study.sample_every * (1.0 + 1e-9)))
    samples = np.union1d(begin + study.sample_every * np.arange(number + 1), [begin + length])
    kept = watch.field_times(begin, begin + length)
    watch.progress(f"{phase.name}, from {begin / 3600.0:.2f} h")
    watch.keep(state)

    def run(options: TransientOptions) -> MachineTransient:
        stop, looks = None, ()
        if until is not None:
            names = CoupledInputs(machine, history, 0.0).lumped_names(state.temperature)
            stop = Settled(ReadingRows.of(machine, names), history, until, state)
            looks = tuple(stop.looks)
        return simulate_full(
            machine,
            inputs,
            sample_times=samples[samples <= begin + length],
            start=state,
            options=options,
            physics=beyond[0],
            memory=beyond[1],
            watch=Watch(watch.observed(stop, kept), (*looks, *kept), watch.progress),
        )

    transient = balanced(run, options) if study.fields_every is None else run(options)
    watch.keep(transient.state)
    settled = None if until is None else transient.stopped
    return PhaseResult(phase.name, history.at(begin), begin, transient.state.time, settled, transient)


def time_to_stay_within(times: Array, readings: Array, final: Array, band: float) -> float:
    """Time after which every reading stays within a band of its final value, [s].

    Parameters
    ----------
    times : (n,) ndarray, [s]
    readings : (n, c) ndarray, [K]
    final : (c,) ndarray, [K]
    band : float, [K]

    Returns
    -------
    float
        Counted from the first time; nan when the last reading is outside.

    >>> t = np.arange(0.0, 10.0)
    >>> time_to_stay_within(t, 10.0 * (1.0 - np.exp(-t))[:, None], np.array([10.0]), 0.5)
    3.0
    """
    outside = np.flatnonzero(np.any(np.abs(readings - final) > band, axis=1))
    if not outside.size:
        return 0.0
    if outside[-1] == len(times) - 1:
        return float("nan")
    return float(times[outside[-1] + 1] - times[0])
