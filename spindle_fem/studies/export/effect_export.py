"""Effects of a definition in an exported model: factors, heats over inputs, and sensors.

A model that other programs step has no clock of a recording, no memory but its temperatures, and only the
machine's own inputs: effects that need more are refused, each with what it needs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate, Reading
from spindle_fem.effects.framework.term import COVARIATE, FLUID_PREFIX, Term, TermContext
from spindle_fem.errors import FaultsError, SpecError, SpindleFemError
from spindle_fem.model.reduced.class_operators import NO_CHANGES
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS, ActiveEffects
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.run_operators import SteadyChanges
from spindle_fem.operation.effect_terms import multiplied
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.studies.export.interpolation_axes import refined_axis, values_on
from spindle_fem.studies.export.source_export import SourceTableLoad
from spindle_fem.studies.export.state_space import CELSIUS, CONSTANT, ModelInput, PowerLoad
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

# Instants (s) and temperatures (K) that test whether a sensor depends on more than its place's temperature.
TIMES = np.array([0.0, 20.0, 700.0, 9000.0, 2.0e5])
WANDERING = np.array([290.0, 341.0, 303.0, 318.0, 296.0])
# Ambient and coolant temperature in these tests, K; other inputs do not affect a reading.
AROUND = 293.15
# Points that differ in the coolant only, to test whether films follow it.
COOLANTS = tuple(OperatingPoint(100.0, 1000.0, AROUND, inlet, 3e-4) for inlet in (283.15, 293.15, 303.15))
# Tolerance of readings, K; of heat between the points of a table.
EXACT, TOLERANCE = 1e-9, 5e-5


@dataclass(frozen=True, slots=True)
class SensorLine:
    """Affine reading of a sensor: ``gain`` times the temperature at its place, plus the rest, in °C.

    Attributes
    ----------
    offset : float, [K]
    by_input : mapping of str to float
        Share of a temperature among the inputs.
    """

    gain: float
    offset: float
    by_input: Mapping[str, float]


class ExportedEffects:
    """Effects that an exported model holds.

    Attributes
    ----------
    factors : mapping of str to float
        On what parameters scale, as :class:`FastModel` takes them.
    capacities, conductances : mapping of str to float
        Added to places, J/K and W/K.
    heats : tuple of Term
        Heat that follows inputs alone.
    sensors : tuple of (str, SensorLine)
        Outputs, in file order.
    notes : list of str

    Raises
    ------
    FaultsError
        Every effect that needs what an exported model does not have.
    """

    def __init__(self, fast: FastModel, effects: ActiveEffects = NO_EFFECTS) -> None:
        faults: list[SpindleFemError] = []
        for number, candidate in enumerate(effects.candidates, 1):
            if needs := _needs(candidate):
                faults.append(
                    SpecError(
                        f"effect[{number}]",
                        f"{candidate.label} {needs}.",
                        "Export the machine without it; simulate takes it.",
                    )
                )
        if faults:
            raise FaultsError("effect", faults)
        self.notes = [f"with {candidate.label}, as the definition says" for candidate in effects.candidates]
        self.factors = fast.table.factors(effects.factors)
        self._changes = SteadyChanges(fast, effects.terms)
        self.capacities = self._changes.capacities({})
        self.conductances = self._changes.conductances({})
        self.heats = tuple(term for term in effects.terms if term.heat_places)
        self.sensors = tuple(
            (candidate.reading.channel, _line(candidate.reading))
            for candidate in effects.candidates
            if candidate.reading is not None
        )

    def changes(self, point: OperatingPoint, beside: Mapping[str, float] = NO_CHANGES) -> dict[str, float]:
        """Factors on coefficients at an operating point, with others beside."""
        return multiplied((*self._changes.parts(point, {}), beside))

    def read(self, outputs: Sequence[str], loads: Sequence[str], output: Array, direct: Array) -> None:
        """Apply the sensors' lines to the output matrices, in place.

        Parameters
        ----------
        outputs, loads : sequence of str
        output, direct : (p, r), (p, k) ndarray
            Of states and loads.
        """
        for name, line in self.sensors:
            row = outputs.index(name)
            output[row] *= line.gain
            direct[row] *= line.gain
            direct[row, loads.index(CONSTANT)] += line.offset
            for wanted, share in line.by_input.items():
                direct[row, loads.index(wanted)] += share


def heat_of(term: Term, inputs: Mapping[str, float], time: float = 0.0) -> Array:
    """Heat of every place of a term, (n,) W, or K of a fluid."""
    values = {name: np.full(1, value, dtype=complex) for name, value in term.values({}).items()}
    context = TermContext(time, inputs, np.zeros((0, 1), complex), np.zeros((0, 1), complex), values)
    return np.real(term.heat(context))[:, 0]


def heat_tables(effects: ExportedEffects, inputs: Sequence[ModelInput]) -> list[SourceTableLoad]:
    """Heat of effects over the speed, a load and a table for each place.

    Parameters
    ----------
    inputs : sequence of ModelInput
        The first is the speed.
    """
    speed, found = inputs[0], []
    usual = {item.name: item.default + ZERO_CELSIUS_K * (item.unit == CELSIUS) for item in inputs}
    for number, term in enumerate(effects.heats):

        def at(value: float, term: Term = term) -> Array:
            return heat_of(term, {**usual, speed.name: value})

        axes = (refined_axis(at, speed.low, speed.high, TOLERANCE),)
        for row, (place, values) in enumerate(zip(term.heat_places, values_on(at, axes).T, strict=True)):
            key, load = f"effect{number}.{row}", f"effect.{term.name}.{place}"
            found.append(SourceTableLoad(key, load, place, (speed.name,), axes, values[:, None]))
    return found


def heat_powers(effects: ExportedEffects, inputs: Sequence[ModelInput]) -> list[tuple[str, PowerLoad]]:
    """Heat of effects as powers of one input each, with the place where it enters.

    Raises
    ------
    SpecError
        Heat that is no power of an input.
    """
    found = []
    for term in effects.heats:
        ones = {item.name: 1.0 for item in inputs}
        base = heat_of(term, ones)
        moving = [name for name in ones if np.any(heat_of(term, {**ones, name: 2.0}) != base)]
        name = moving[0] if moving else ""
        doubled, other = (heat_of(term, {**ones, name: value}) for value in (2.0, 37.0))
        for place, gain, twice, far in zip(term.heat_places, base, doubled, other, strict=True):
            exponent = float(np.log2(twice / gain)) if gain else 0.0
            if len(moving) > 1 or not np.isclose(far, gain * 37.0**exponent, rtol=1e-9):
                raise SpecError(
                    "effect", f"the heat of {term.name} is no power of one input.", "Export without it."
                )
            position = list(ones).index(name) if moving else -1
            found.append(
                (place, PowerLoad(f"effect.{term.name}.{place}", "W", position, float(gain), exponent))
            )
    return found


def _needs(candidate: Candidate) -> str:
    """Dependence of an effect that an exported model cannot represent; empty if it can be exported."""
    for term in candidate.terms:
        if term.n_states:
            return "remembers what was, which the model's states do not hold"
        if term.reads or term.coefficients or term.bearings:
            return "follows temperatures of the machine by a law of its own"
        if any(name.startswith(COVARIATE) for name in term.follows):
            return "follows a column of a recording that drives nothing else"
        if any(place.startswith(FLUID_PREFIX) for place in term.heat_places):
            return "shifts the temperature of one fluid, which is no load of the model"
        if _follows_coolant(term):
            return (
                "follows the Reynolds number as it moves with the inlet temperature, which simulate takes in "
                "steps of a kelvin: the two would be some millikelvin apart"
            )
        if term.heat_places and _depends_on_time(term):
            return "follows the clock of one recording"
    reading = candidate.reading
    if reading is None:
        return ""
    read = _readings(reading, WANDERING)
    line = _line(reading)
    expected = line.gain * (WANDERING - ZERO_CELSIUS_K) + line.offset
    expected += sum(share * (AROUND - ZERO_CELSIUS_K) for share in line.by_input.values())
    if np.abs(read - ZERO_CELSIUS_K - expected).max() > EXACT:
        return "follows the clock of one recording, or what its sensor read before"
    return ""


def _follows_coolant(term: Term) -> bool:
    """Whether factors on coefficients change with the coolant's inlet temperature."""
    values = term.values({})
    first, *others = (term.operating_factor(point, values) for point in COOLANTS)
    return any(other != first for other in others)


class _AnyInput(dict):
    """Inputs of one value whatever they are called."""

    def __missing__(self, name: str) -> float:
        return AROUND


def _depends_on_time(term: Term) -> bool:
    known = _AnyInput()
    return any(np.any(heat_of(term, known, time) != heat_of(term, known, TIMES[-1])) for time in TIMES)


def _readings(reading: Reading, temperatures: Array, **shifted: float) -> Array:
    """Readings of a sensor along temperatures [K] of its place, with some inputs shifted [K]."""
    around = {name: np.full(TIMES.size, AROUND) for name in ("ambient", "coolant_inlet")}
    around |= {name: around[name] + shift for name, shift in shifted.items()}
    own = {item.name: np.full(1, item.value, dtype=complex) for item in reading.parameters}
    return np.real(reading.read(TIMES, temperatures[:, None].astype(complex), around, own))[:, 0]


def _line(reading: Reading) -> SensorLine:
    """A sensor that follows its place and inputs in a straight line, seen at the first instant."""
    still = np.full(TIMES.size, ZERO_CELSIUS_K)
    base = _readings(reading, still)[0]
    gain = _readings(reading, still + 1.0)[0] - base
    by_input = {
        name: _readings(reading, still, **{name: 1.0})[0] - base for name in ("ambient", "coolant_inlet")
    }
    by_input = {name: share for name, share in by_input.items() if share}
    offset = base - ZERO_CELSIUS_K - sum(by_input.values()) * (AROUND - ZERO_CELSIUS_K)
    return SensorLine(gain, offset, by_input)
