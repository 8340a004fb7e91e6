"""Loads that follow the temperatures over time.

Each stage of a time step evaluates the loads at its own time and at its own
latest temperatures and is solved again until they agree, so the coupled
scheme keeps the second order of the time steps. The matrix serves until a film,
joint or contact of balls has moved by more than a small share; what they differ
by until then acts as heat. A step begins with what its predecessor ended with,
unless an input jumps or a term is switched.
"""

from __future__ import annotations

import bisect
import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import CHANNEL_FILM
from spindle_fem.errors import NoEquilibriumError, NoSteadyStateError, OutOfValidityError
from spindle_fem.model.mesh.conduction_problem import ConductionProblem
from spindle_fem.model.mesh.kept_coefficients import near, on_matrix_of
from spindle_fem.model.mesh.thermal_state import ThermalState
from spindle_fem.model.trbdf2 import WEIGHTS
from spindle_fem.operation.bearing_heat import BearingTemperatures, HeatModel
from spindle_fem.operation.coolant_loop import CoolantState
from spindle_fem.operation.loads import NO_CHANGE, BearingHeat, LoadChange, Loads
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.input_history import FIELD_OF, OperatingHistory
from spindle_fem.solvers.mesh_terms import NO_PHYSICS, FieldTerms, Physics
from spindle_fem.solvers.prepared_machine import PreparedMachine

Array = NDArray[np.float64]

# Bearings this close to their last temperatures make the same heat: some microwatts.
SAME_TEMPERATURE_K = 1.0e-6
# The end of a step is evaluated an instant before it: time and inputs then differ by rounding.
SAME = 1.0e-12


class HeatInMemory:
    """A heat model that caches its last evaluation.

    Parameters
    ----------
    tolerance : float, [K]
        Temperatures closer than this are the same.
    """

    def __init__(self, model: HeatModel, tolerance: float = SAME_TEMPERATURE_K) -> None:
        self.model, self.tolerance = model, tolerance
        self.calls = 0
        self._last: tuple | None = None

    def __call__(
        self, point: OperatingPoint, temperatures: Mapping[str, BearingTemperatures]
    ) -> tuple[Mapping[str, BearingHeat], tuple]:
        """Heat of every bearing; see :mod:`spindle_fem.operation.bearing_heat`."""
        values = np.array([item.state for item in temperatures.values()])
        if self._last is not None:
            last_point, last_values, answer = self._last
            if point == last_point and np.abs(values - last_values).max(initial=0.0) <= self.tolerance:
                return answer
        answer = self.model(point, temperatures)
        self.calls += 1
        self._last = (point, values, answer)
        return answer


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Loads evaluated for the solver at one time."""

    time: float
    point: OperatingPoint
    loads: Loads
    coolant: CoolantState | None


@dataclass(frozen=True, slots=True)
class _Answer:
    """Last evaluation for the solver."""

    evaluation: Evaluation
    problem: ConductionProblem


@dataclass(frozen=True, slots=True)
class _ChannelStep:
    """Effect of the terms on the channel in one step: inlet [K], factors on flow and film, at both ends."""

    begin: float
    end: float
    first: tuple[float, float, float]
    last: tuple[float, float, float]

    @classmethod
    def of(cls, begin: float, end: float, first: Loads, last: Loads) -> _ChannelStep:
        def channel(change: LoadChange) -> tuple[float, float, float]:
            return change.inlet, change.flow, change.factor(CHANNEL_FILM)

        return cls(begin, end, channel(first.change), channel(last.change))

    def at(self, time: float) -> tuple[float, float, float]:
        part = min(max((time - self.begin) / (self.end - self.begin), 0.0), 1.0)
        return tuple(a + part * (b - a) for a, b in zip(self.first, self.last, strict=True))


class CoupledInputs:
    """Callable ``(time, state) -> ConductionProblem`` of a machine.

    Parameters
    ----------
    coefficient_tolerance : float, [-]
        Relative change of a film or contact coefficient below which the
        matrix keeps the old one and the difference is heat; 0 renews it at every stage.
    physics : Physics, optional
        Terms beyond the machine's own.
    memory : ndarray, optional
        What they remember of an earlier run.
    """

    def __init__(
        self,
        machine: PreparedMachine,
        history: OperatingHistory,
        coefficient_tolerance: float,
        physics: Physics = NO_PHYSICS,
        memory: Array | None = None,
    ) -> None:
        self._physics, self._memory = physics, memory
        self._switches = frozenset(physics.breakpoints())
        self._latest: _Answer | None = None
        self._ended: _Answer | None = None
        self._steps: list[_ChannelStep] = []
        self.terms: FieldTerms | None = None
        builder = copy.copy(machine.builder)
        builder.heat_model = HeatInMemory(machine.builder.heat_model)
        builder.film_bounds = False
        self.machine = replace(machine, builder=builder)
        self.history = history
        self.coefficient_tolerance = coefficient_tolerance
        self._kept: ConductionProblem | None = None
        self._names: tuple[str, ...] | None = None
        self._asked: list[Evaluation] = []
        self.evaluations = 0

    def lumped_names(self, start: Array) -> tuple[str, ...]:
        """Names of the lumped nodes, in the order of their unknowns."""
        first = float(self.history.inputs.times[0])
        return tuple(node.name for node in self._loads(first, self.history.at(first), start, {})[0].lumped)

    def __call__(self, time: float, state: ThermalState) -> ConductionProblem:
        """Problem at a time and a state.

        Raises
        ------
        NoSteadyStateError
            A bearing has no equilibrium at these temperatures.
        """
        if self._names is None:
            self._begin(time, state)
        point = self.history.at(time)
        if self._goes_on(time, point):
            self._asked.append(replace(self._ended.evaluation, time=time, point=point))
            return self._ended.problem
        lumped = dict(zip(self._names, state.lumped_temperature.tolist(), strict=True))
        change = NO_CHANGE
        if self.terms is not None:
            change = self.terms.at(time, point, state.temperature, state.lumped_temperature)
        loads, coolant = self._loads(time, point, state.temperature, lumped, change)
        self.evaluations += 1
        problem = self._on_kept_matrix(self.machine.problem(loads, self._kept), state)
        self._asked.append(Evaluation(time, point, loads, coolant))
        self._latest = _Answer(self._asked[-1], problem)
        return problem

    def stages_of_step(self, begin: float) -> tuple[Evaluation, Evaluation, Evaluation]:
        """Evaluations of the three stages of the step that was just accepted; forgets older ones.

        Parameters
        ----------
        begin : float, [s]
            Start of the step.
        """
        found = [self._asked[-1]]
        for evaluation in reversed(self._asked):
            if evaluation.time != found[-1].time:
                found.append(evaluation)
            if found[-1].time <= begin:
                break
        self._asked.clear()
        last, middle, first = found
        return first, middle, last

    def accept(self, state: ThermalState, stages: tuple[Evaluation, Evaluation, Evaluation]) -> None:
        """Let the terms remember the end of an accepted step with these stages."""
        self._ended = self._latest
        if self.terms is not None:
            self._steps.append(_ChannelStep.of(stages[0].time, state.time, stages[0].loads, stages[-1].loads))
            before = self.history.at(float(np.nextafter(state.time, -np.inf)))
            after = self.history.at(state.time)
            self.terms.accept(state.time, before, after, state.temperature, state.lumped_temperature)

    def coolant_at(self, time: float) -> tuple[OperatingPoint, float]:
        """Operating point of the channel at a time that has passed, and factor on its film."""
        point = self.history.at(time)
        if not self._steps:
            return point, 1.0
        # Where two steps meet, take the later one: inputs jump at the start of a step.
        later = bisect.bisect_right(self._steps, time, key=lambda step: step.begin)
        inlet, flow, film = self._steps[max(later - 1, 0)].at(time)
        moved = replace(
            point,
            coolant_inlet_temperature=point.coolant_inlet_temperature + inlet,
            coolant_flow=point.coolant_flow * flow,
        )
        return moved, film

    # -------------------------------------------------------------- details
    def _begin(self, time: float, state: ThermalState) -> None:
        self._names = self.lumped_names(state.temperature)
        if self._physics.is_there:
            self.terms = FieldTerms(self.machine, self._names, self._physics)
            now = self.history.at(time)
            self.terms.begin(time, now, state.temperature, state.lumped_temperature, self._memory)

    def _goes_on(self, time: float, point: OperatingPoint) -> bool:
        """Whether a step begins here as the last one ended."""
        if self._ended is None or time in self._switches:
            return False
        last = self._ended.evaluation
        return math.isclose(time, last.time, rel_tol=SAME) and _same_inputs(point, last.point)

    def _loads(
        self,
        time: float,
        point: OperatingPoint,
        temperature: Array,
        lumped: Mapping[str, float],
        change: LoadChange = NO_CHANGE,
    ) -> tuple[Loads, CoolantState | None]:
        try:
            field = self.machine.field_state(temperature, lumped)
            return self.machine.builder.at(point, field, change)
        except (NoEquilibriumError, OutOfValidityError) as error:
            raise NoSteadyStateError(
                f"{self.machine.spec.name} after {time / 3600.0:.2f} h",
                f"no loads at {point.speed * 30.0 / np.pi:.0f} rpm with these temperatures: {error}",
            ) from error

    def _on_kept_matrix(self, fresh: ConductionProblem, state: ThermalState) -> ConductionProblem:
        """The problem on the matrix that serves, or on its own where that is too far off."""
        if self._kept is None or not near(fresh, self._kept, self.coefficient_tolerance):
            self._kept = fresh
            return fresh
        return on_matrix_of(self._kept, fresh, state.temperature, state.lumped_temperature)


def _same_inputs(one: OperatingPoint, other: OperatingPoint) -> bool:
    """Whether two operating points are the same but for rounding."""
    return (one.extra_heat, one.beside) == (other.extra_heat, other.beside) and all(
        math.isclose(getattr(one, name), getattr(other, name), rel_tol=SAME) for name in FIELD_OF.values()
    )


def coolant_heat(stages: tuple[Evaluation, Evaluation, Evaluation], step: float) -> tuple[float, float]:
    """Enthalpy that the coolant carried away in a step, and friction heat made in it, both in J.

    Weighted as the time step weights its stages.
    """
    rise = pumping = 0.0
    for weight, stage in zip(WEIGHTS, stages, strict=True):
        if stage.coolant is not None:
            march = stage.coolant.march.march
            rise += step * weight * march.enthalpy_rise
            pumping += step * weight * float(np.sum(march.pumping_heat))
    return rise, pumping
