"""The coupled transient of a machine by the full finite-element model."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.errors import EnergyBalanceError, NoSteadyStateError, SpecError
from spindle_fem.model.mesh.thermal_state import ThermalState
from spindle_fem.model.mesh.time_stepper import EnergyAccount, StopTimes, TransientResult, integrate
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.coupled_steady import RUNAWAY_TEMPERATURE, CoupledState
from spindle_fem.solvers.coupled_transient import CoupledInputs, coolant_heat
from spindle_fem.solvers.input_history import OperatingHistory
from spindle_fem.solvers.mesh_terms import NO_PHYSICS, Physics, with_factors
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.solvers.readings import ReadingRows
from spindle_fem.solvers.transient_records import (
    DEFAULT_OPTIONS,
    MachineEnergy,
    MachineTransient,
    StepRecord,
    TransientOptions,
)
from spindle_fem.units import kelvin_to_celsius

Array = NDArray[np.float64]


def start_at(machine: PreparedMachine, history: OperatingHistory, temperature: float) -> ThermalState:
    """State of one temperature [K] at the first time of a history."""
    unknowns = np.full(machine.operators.n_unknowns, float(temperature))
    names = CoupledInputs(machine, history, 0.0).lumped_names(unknowns)
    return ThermalState(float(history.inputs.times[0]), unknowns, np.full(len(names), float(temperature)))


def start_from(coupled: CoupledState, time: float = 0.0) -> ThermalState:
    """State of a steady solution."""
    solution = coupled.solution
    return ThermalState(time, solution.temperature.copy(), solution.lumped_temperature.copy())


def require_state(machine: PreparedMachine, state: ThermalState) -> None:
    """Refuse a state of another mesh.

    Raises
    ------
    SpecError
    """
    needed = machine.operators.n_unknowns
    if len(state.temperature) != needed:
        raise SpecError(
            "start state",
            f"it has {len(state.temperature)} temperatures and belongs to another mesh.",
            f"Allowed: a state of this machine, {needed} temperatures.",
        )


@dataclass(frozen=True, slots=True)
class Watch:
    """Observers of a running transient.

    Attributes
    ----------
    stop : callable, optional
        Asked after every accepted step; True ends the run there.
    looks : sequence of float, [s]
        Times at which a step has to end besides those of the inputs.
    progress : callable
        Called with the progress of the run in words.
    """

    stop: Callable[[ThermalState], bool] | None = None
    looks: Sequence[float] = ()
    progress: Callable[[str], None] = lambda text: None


NO_WATCH = Watch()


def simulate_full(
    machine: PreparedMachine,
    inputs: InputHistory,
    *,
    sample_times: ArrayLike | None = None,
    start: ThermalState | None = None,
    options: TransientOptions = DEFAULT_OPTIONS,
    physics: Physics = NO_PHYSICS,
    memory: Array | None = None,
    watch: Watch = NO_WATCH,
) -> MachineTransient:
    """Temperatures of a machine under inputs that change in time.

    Heat, films, coolant and preload follow speed, load, surroundings and the
    temperatures themselves.

    Parameters
    ----------
    inputs : InputHistory
        ``speed``, ``thrust``, ``ambient``, ``coolant_inlet``, ``coolant_flow``
        and ``heat.<place>`` in SI, held or on straight lines; such as
        ``Recording.input_history()``.
    sample_times : (n,) array_like, optional, [s]
        Rising; the times of ``inputs`` when absent.
    start : ThermalState, optional
        Everything at the first ambient temperature when absent; a saved state
        to restart from.
    physics : Physics
        Terms and factors beyond the machine's own.
    memory : ndarray, optional
        What the terms remember where ``start`` goes on from an earlier run.
    watch : Watch
        What may end the run, times at which a step has to end, and the progress callback.

    Raises
    ------
    NoSteadyStateError
        The temperatures run away.
    EnergyBalanceError
        Heat stored, in and out differ by more than 1e-8, or than what the
        coupling tolerance allows, the coolant's enthalpy included.
    """
    began = clock.process_time()
    machine, physics = with_factors(machine, physics)
    history = OperatingHistory.of(machine.spec, inputs)
    physics = replace(physics, terms=(*physics.terms, *history.given_heat()))
    if start is None:
        first = history.at(float(inputs.times[0]))
        start = start_at(machine, history, first.ambient_temperature)
    require_state(machine, start)
    samples = np.asarray(inputs.times if sample_times is None else sample_times, dtype=float)
    end = float(max(inputs.times[-1], samples.max(initial=-np.inf), max(watch.looks, default=-np.inf)))
    marks = np.concatenate(
        (
            history.breakpoints(options.input_resolution),
            np.array(physics.breakpoints()),
        )
    )
    source = CoupledInputs(
        machine,
        history,
        options.coefficient_tolerance,
        physics,
        memory,
    )
    names = source.lumped_names(start.temperature)
    if len(start.lumped_temperature) != len(names):
        raise SpecError(
            "start state", f"it has {len(start.lumped_temperature)} lumped nodes, the machine {len(names)}."
        )
    rows = ReadingRows.of(machine, names)
    restarts = history.restarts()
    run = _Run(machine, source, start, watch, frozenset((*restarts.tolist(), end)))
    result = integrate(
        source,
        start,
        end,
        control=options.control(),
        stops=StopTimes(marks.tolist(), restarts.tolist(), watch.looks),
        outputs=rows.rows,
        sample_times=samples[samples >= start.time],
        observer=run.observe,
    )
    return run.result(result, rows, options, clock.process_time() - began)


class _Run:
    """Records of every accepted step."""

    def __init__(
        self,
        machine: PreparedMachine,
        source: CoupledInputs,
        start: ThermalState,
        watch: Watch,
        reported: frozenset[float],
    ) -> None:
        self.machine, self.source, self.stop = machine, source, watch.stop
        self._reported, self._progress = reported, watch.progress
        self.hottest: list[float] = []
        self.coldest: list[float] = []
        self.ends: list[tuple] = []
        self.coolant: list[tuple[float, float, float]] = []
        self.stopped = False
        self._time = start.time

    def observe(self, state: ThermalState) -> bool:
        """Note a step; True ends the run."""
        stages = self.source.stages_of_step(self._time)
        self.source.accept(state, stages)
        size = state.time - self._time
        self.coolant.append((*coolant_heat(stages, size), size))
        last = stages[-1]
        heats = last.loads.bearing_heat
        self.ends.append(
            (last.point.speed, [h.total for h in heats.values()], [h.preload for h in heats.values()])
        )
        self.hottest.append(float(state.temperature.max()))
        self.coldest.append(float(state.temperature.min()))
        self._time = state.time
        if not self.hottest[-1] < RUNAWAY_TEMPERATURE:
            raise NoSteadyStateError(
                f"{self.machine.spec.name} after {state.time / 3600.0:.2f} h",
                f"the temperatures run away: {kelvin_to_celsius(self.hottest[-1]):.0f} °C.",
                "Lower the speed or the preload, or cool more.",
            )
        if state.time in self._reported:
            self._progress(f"{state.time / 3600.0:.2f} h, {kelvin_to_celsius(self.hottest[-1]):.1f} °C")
        self.stopped = self.stop is not None and self.stop(state)
        return self.stopped

    def result(
        self, found: TransientResult, rows: ReadingRows, options: TransientOptions, seconds: float
    ) -> MachineTransient:
        """The machine from start to end.

        Raises
        ------
        EnergyBalanceError
        """
        reached = found.state.time
        times, outputs = found.times[found.times <= reached], found.samples[found.times <= reached]
        energy = self._energy(found.energy)
        if energy.imbalance_relative > options.energy_tolerance:
            raise EnergyBalanceError(
                "transient",
                f"heat stored, in and out differ by {energy.imbalance_relative:.2e}, coolant included.",
                f"Allowed: {options.energy_tolerance:.0e}; lower coupling_tolerance.",
            )
        inner, outer, balls = rows.bearing_temperatures(outputs)
        steps = StepRecord(
            times=found.step_times[1:],
            sizes=np.diff(found.step_times),
            errors=found.step_errors,
            hottest=np.array(self.hottest),
            coldest=np.array(self.coldest),
            speed=np.array([item[0] for item in self.ends]),
            bearing_heat=np.array([item[1] for item in self.ends]),
            preload=np.array([item[2] for item in self.ends]),
            coolant_heat=np.array([(rise - pumping) / size for rise, pumping, size in self.coolant]),
        )
        counts = {
            name: getattr(found, name)
            for name in ("rejected", "linear_iterations", "matrix_builds", "preconditioner_builds")
        }
        source = self.source
        return MachineTransient(
            times=times,
            probes=rows.probes,
            readings=rows.probe_readings(outputs, times, source.coolant_at),
            bearings=rows.bearings,
            inner=inner,
            outer=outer,
            balls=balls,
            steps=steps,
            energy=energy,
            state=found.state,
            counts={**counts, "evaluations": source.evaluations},
            cpu_seconds=seconds,
            stopped=self.stopped,
            memory=None if source.terms is None else source.terms.memory,
            motions=() if rows.motions is None else (*rows.motions.nose, *rows.motions.sensors),
            motion=rows.displacements(outputs, times, source.coolant_at),
        )

    def _energy(self, account: EnergyAccount) -> MachineEnergy:
        """Heat over the run, the coolant's by its own enthalpy."""
        cells = self.machine.builder.cells
        own = () if cells is None else cells.surfaces
        out = {name: heat for name, heat in account.films.items() if name not in own}
        heat_in = account.heat_in
        if cells is not None:
            out["coolant"] = sum(rise for rise, _, _ in self.coolant)
            heat_in += sum(pumping for _, pumping, _ in self.coolant)
        return MachineEnergy(heat_in, out, account.stored)
