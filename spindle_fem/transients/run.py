"""The coupled transient of a machine by the full finite-element model."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.conduction.transient import StepControl, ThermalState, TransientResult, integrate
from spindle_fem.coupling import RUNAWAY_TEMPERATURE, CoupledState, PreparedMachine
from spindle_fem.errors import EnergyBalanceError, NoSteadyStateError, SpecError
from spindle_fem.network.history import InputHistory
from spindle_fem.transients.coupled import CoupledInputs, coolant_heat
from spindle_fem.transients.history import OperatingHistory
from spindle_fem.transients.readings import ReadingRows
from spindle_fem.transients.terms import NO_PHYSICS, Physics, with_factors
from spindle_fem.units import kelvin_to_celsius

Array = NDArray[np.float64]
ENERGY_TOLERANCE = 1.0e-8


@dataclass(frozen=True, slots=True)
class TransientOptions:
    """How accurately a transient is followed.

    Attributes
    ----------
    error : float, [K]
        Largest estimated error of one time step at any node.
    coupling_tolerance : float, [K]
        Change at which loads and temperatures of a stage agree.
    coefficient_tolerance : float, [-]
        Relative change of a film or contact coefficient that renews the
        matrix; 0 renews it at every stage.
    first_step : float, [s]
        After the start and after every jump of the inputs.
    fixed_step : float or None, [s]
        Steps of one size without control, for convergence studies.
    """

    error: float = 0.05
    coupling_tolerance: float = 3.0e-8
    coefficient_tolerance: float = 5.0e-4
    first_step: float = 0.1
    fixed_step: float | None = None

    def __post_init__(self) -> None:
        for name in ("error", "coupling_tolerance", "first_step"):
            if not getattr(self, name) > 0.0:
                raise SpecError(
                    f"transient options: {name}", f"{getattr(self, name)!r}.", "Allowed: above 0."
                )
        if not self.coefficient_tolerance >= 0.0:
            raise SpecError(
                "transient options: coefficient_tolerance",
                f"{self.coefficient_tolerance!r}.",
                "Allowed: 0 or more.",
            )

    def control(self) -> StepControl:
        """Step control of the integrator."""
        return StepControl(
            tolerance=None if self.fixed_step else self.error,
            first_step=self.fixed_step or self.first_step,
            temperature_dependent=True,
            nonlinear_tolerance=self.coupling_tolerance,
            linear_tolerance=0.2 * self.coupling_tolerance,
        )


DEFAULT_OPTIONS = TransientOptions()


@dataclass(frozen=True, slots=True)
class MachineEnergy:
    """Heat over a transient, [J].

    Attributes
    ----------
    heat_in : float
        Friction and other sources in the machine, friction in the coolant included.
    heat_out : mapping of str to float
        Through each film to the air and ``coolant``: what the coolant carried
        away, by its own enthalpy.
    stored : float
        Change of the heat content of parts and balls.
    """

    heat_in: float
    heat_out: Mapping[str, float]
    stored: float

    @property
    def imbalance_relative(self) -> float:
        """Heat in − heat out − stored, relative to the heat that was moved."""
        moved = 0.5 * (abs(self.heat_in) + abs(self.stored) + sum(map(abs, self.heat_out.values())))
        imbalance = self.heat_in - sum(self.heat_out.values()) - self.stored
        return abs(imbalance) / moved if moved else 0.0

    def __add__(self, other: MachineEnergy) -> MachineEnergy:
        names = dict.fromkeys((*self.heat_out, *other.heat_out))
        out = {name: self.heat_out.get(name, 0.0) + other.heat_out.get(name, 0.0) for name in names}
        return MachineEnergy(self.heat_in + other.heat_in, out, self.stored + other.stored)


@dataclass(frozen=True, slots=True)
class StepRecord:
    """State of the machine at the end of every accepted step.

    Attributes
    ----------
    times, sizes, errors : (n_steps,) ndarray, [s], [s], [K]
    hottest, coldest : (n_steps,) ndarray, [K]
    speed : (n_steps,) ndarray, [rad/s]
        At the end of the step, before a jump there.
    bearing_heat : (n_steps, n_bearings) ndarray, [W]
    preload : (n_steps, n_bearings) ndarray, [N]
        NaN where the heat model has none.
    coolant_heat : (n_steps,) ndarray, [W]
        Mean over the step.
    """

    times: Array
    sizes: Array
    errors: Array
    hottest: Array
    coldest: Array
    speed: Array
    bearing_heat: Array
    preload: Array
    coolant_heat: Array


@dataclass(frozen=True, slots=True)
class MachineTransient:
    """A machine from start to end.

    Attributes
    ----------
    times : (n,) ndarray, [s]
        Sample times.
    probes : tuple of str
    readings : (n, n_probes) ndarray, [K]
    bearings : tuple of str
    inner, outer, balls : (n, n_bearings) ndarray, [K]
        Raceway means and ball rows.
    steps : StepRecord
    energy : MachineEnergy
    state : ThermalState
        At the end, to go on from.
    counts : mapping of str to int
        ``rejected``, ``linear_iterations``, ``matrix_builds``, ``evaluations``.
    cpu_seconds : float
    stopped : bool
        Whether the stop condition ended it, not the end time.
    memory : ndarray or None
        What terms remember at the end.
    """

    times: Array
    probes: tuple[str, ...]
    readings: Array
    bearings: tuple[str, ...]
    inner: Array
    outer: Array
    balls: Array
    steps: StepRecord
    energy: MachineEnergy
    state: ThermalState
    counts: Mapping[str, int]
    cpu_seconds: float
    stopped: bool = False
    memory: Array | None = None

    def reading(self, probe: str) -> Array:
        """Readings of one probe, (n,) [K]."""
        return self.readings[:, self.probes.index(probe)]


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


def simulate_full(
    machine: PreparedMachine,
    inputs: InputHistory,
    *,
    sample_times: ArrayLike | None = None,
    start: ThermalState | None = None,
    options: TransientOptions = DEFAULT_OPTIONS,
    stop: Callable[[ThermalState], bool] | None = None,
    breakpoints: Sequence[float] = (),
    physics: Physics = NO_PHYSICS,
    memory: Array | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> MachineTransient:
    """Temperatures of a machine under inputs that change in time.

    Heat, films, coolant and preload follow speed, load, surroundings and the
    temperatures themselves.

    Parameters
    ----------
    machine : PreparedMachine
    inputs : InputHistory
        ``speed``, ``thrust``, ``ambient``, ``coolant_inlet``, ``coolant_flow``
        in SI, held or on straight lines; such as ``Recording.input_history()``.
    sample_times : (n,) array_like, optional, [s]
        Rising; the times of ``inputs`` when absent.
    start : ThermalState, optional
        Everything at the first ambient temperature when absent; a saved state
        to restart from.
    options : TransientOptions
    stop : callable, optional
        Asked after every accepted step; True ends the run there.
    breakpoints : sequence of float, [s]
        Times at which a step has to end besides those of the inputs.
    physics : Physics
        Terms and factors beyond the machine's own.
    memory : ndarray, optional
        What the terms remember where ``start`` goes on from an earlier run.
    progress : callable

    Returns
    -------
    MachineTransient

    Raises
    ------
    NoSteadyStateError
        The temperatures run away.
    EnergyBalanceError
        Heat stored, in and out differ by more than 1e-8, the coolant's
        enthalpy included.
    """
    began = clock.process_time()
    machine, physics = with_factors(machine, physics)
    history = OperatingHistory.of(machine.spec, inputs)
    if start is None:
        first = history.at(float(inputs.times[0]))
        start = start_at(machine, history, first.ambient_temperature)
    require_state(machine, start)
    samples = np.asarray(inputs.times if sample_times is None else sample_times, dtype=float)
    end = float(max(inputs.times[-1], samples.max(initial=-np.inf), max(breakpoints, default=-np.inf)))
    marks = np.concatenate(
        (history.breakpoints(), np.asarray(breakpoints, dtype=float), np.array(physics.breakpoints()))
    )
    source = CoupledInputs(machine, history, options.coefficient_tolerance, physics, memory)
    names = source.lumped_names(start.temperature)
    if len(start.lumped_temperature) != len(names):
        raise SpecError(
            "start state", f"it has {len(start.lumped_temperature)} lumped nodes, the machine {len(names)}."
        )
    rows = ReadingRows.of(machine, names)
    restarts = history.restarts()
    edges = [start.time, *restarts[(restarts > start.time) & (restarts < end)].tolist(), end]
    legs: list[_Leg] = []
    state = start
    for stop_time in edges[1:]:
        inside = (samples >= state.time) & (samples < stop_time)
        if stop_time == end:
            inside |= samples == end
        leg = _Leg(machine, source, state, stop)
        leg.run(stop_time, options, marks, rows, samples[inside])
        legs.append(leg)
        # the last step's size says nothing after a jump
        state = leg.result.state if stop_time == end else replace(leg.result.state, step=0.0)
        progress(f"{state.time / 3600.0:.2f} h, {kelvin_to_celsius(leg.hottest[-1]):.1f} °C")
        if leg.stopped:
            break
    return _joined(source, rows, legs, clock.process_time() - began)


class _Leg:
    """One stretch without large jumps."""

    def __init__(
        self,
        machine: PreparedMachine,
        source: CoupledInputs,
        start: ThermalState,
        stop: Callable[[ThermalState], bool] | None,
    ) -> None:
        self.machine, self.source, self.start, self.stop = machine, source, start, stop
        self.hottest: list[float] = []
        self.coldest: list[float] = []
        self.ends: list[tuple] = []
        self.coolant: list[tuple[float, float]] = []
        self.stopped = False
        self._time = start.time
        self.result: TransientResult
        self.sample_times: Array

    def run(
        self, end: float, options: TransientOptions, marks: Array, rows: ReadingRows, samples: Array
    ) -> None:
        self.result = integrate(
            self.source,
            self.start,
            end,
            control=options.control(),
            breakpoints=marks[(marks > self.start.time) & (marks < end)].tolist(),
            outputs=rows.rows,
            sample_times=samples,
            observer=self._observe,
        )
        self.sample_times = samples

    def _observe(self, state: ThermalState) -> bool:
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
        self.stopped = self.stop is not None and self.stop(state)
        return self.stopped

    def energy(self) -> MachineEnergy:
        account, cells = self.result.energy, self.machine.builder.cells
        own = () if cells is None else cells.surfaces
        out = {name: heat for name, heat in account.films.items() if name not in own}
        heat_in = account.heat_in
        if cells is not None:
            out["coolant"] = sum(rise for rise, _, _ in self.coolant)
            heat_in += sum(pumping for _, pumping, _ in self.coolant)
        return MachineEnergy(heat_in, out, account.stored)


def _joined(source: CoupledInputs, rows: ReadingRows, legs: list[_Leg], seconds: float) -> MachineTransient:
    reached = legs[-1].result.state.time
    times = np.concatenate([leg.sample_times for leg in legs])
    outputs = np.concatenate([leg.result.samples for leg in legs])
    times, outputs = times[times <= reached], outputs[times <= reached]
    energy = legs[0].energy()
    for leg in legs[1:]:
        energy = energy + leg.energy()
    if energy.imbalance_relative > ENERGY_TOLERANCE:
        raise EnergyBalanceError(
            "transient",
            f"heat stored, in and out differ by {energy.imbalance_relative:.2e}, coolant included.",
            f"Allowed: {ENERGY_TOLERANCE:.0e}; lower coupling_tolerance.",
        )
    inner, outer, balls = rows.bearing_temperatures(outputs)
    step_times = [leg.result.step_times for leg in legs]
    ends = [item for leg in legs for item in leg.ends]
    taken = np.array([(rise - pumping) / size for leg in legs for rise, pumping, size in leg.coolant])
    steps = StepRecord(
        times=np.concatenate([item[1:] for item in step_times]),
        sizes=np.concatenate([np.diff(item) for item in step_times]),
        errors=np.concatenate([leg.result.step_errors for leg in legs]),
        hottest=np.array([value for leg in legs for value in leg.hottest]),
        coldest=np.array([value for leg in legs for value in leg.coldest]),
        speed=np.array([item[0] for item in ends]),
        bearing_heat=np.array([item[1] for item in ends]),
        preload=np.array([item[2] for item in ends]),
        coolant_heat=taken,
    )
    counts = {
        name: sum(getattr(leg.result, name) for leg in legs)
        for name in ("rejected", "linear_iterations", "matrix_builds")
    }
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
        state=legs[-1].result.state,
        counts={**counts, "evaluations": source.evaluations},
        cpu_seconds=seconds,
        stopped=legs[-1].stopped,
        memory=None if source.terms is None else source.terms.memory,
    )
