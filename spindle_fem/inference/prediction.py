"""Predicted readings of every channel of one recording, with derivatives and the underlying states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate, Reading
from spindle_fem.effects.registry import effect_of
from spindle_fem.inference.coordinate_names import DIRECTIONS, EFFECT_PREFIX, PROBE_PREFIX
from spindle_fem.model.reduced.drive import Drive, inputs_at
from spindle_fem.model.reduced.reduced_transient import TransientRun
from spindle_fem.model.thermal_model import ThermalModel

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Prediction:
    """Readings of all channels of one recording, on the model's grid or at the stamps.

    Attributes
    ----------
    temperature : (G + 1, c) ndarray, [K]
        In the order of the recording's channels, sensor effects included.
    sensitivity : (G + 1, c, p) ndarray
        By the requested coordinates.
    states : (G + 1, r) ndarray
        Unknowns of the model.
    run : TransientRun or None
        Whose states they are; None at the stamps.
    tangents : (G + 1, r, q) ndarray or None
        Derivatives of the states by the coordinates that enter the run; None if none were requested.
    columns : (p,) int ndarray
        Index in the tangents of each requested coordinate, -1 for none.
    inlet : (G + 1,) ndarray or None, [K]
        Coolant inlet with what effects do to it; None without a coolant.
    inlet_by : (G + 1, p) ndarray or None
        By the requested coordinates.
    """

    temperature: Array
    sensitivity: Array
    states: Array
    run: TransientRun | None = None
    tangents: Array | None = None
    columns: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    inlet: Array | None = None
    inlet_by: Array | None = None

    def moved(self, move: Array) -> Prediction:
        """The run with its states moved to first order with the coordinates (p,)."""
        if self.tangents is None or self.run is None or self.run.dynamic is None:
            # A linear run is solved in one go: a nearer start gains nothing.
            return self
        inside = self.columns >= 0
        own = np.zeros(self.tangents.shape[2])
        np.add.at(own, self.columns[inside], move[inside])
        return replace(self, states=self.states + self.tangents @ own, tangents=None)

    def add(
        self, names: Sequence[str], slopes: Array, values: Mapping[str, float], derivatives: Sequence[str]
    ) -> None:
        """Add what coordinates with constant slopes (G + 1, c, n) do, and derivatives by them, in place.

        Those without a name do nothing.
        """
        if any(names):
            by = np.array([values.get(name, 0.0) for name in names])
            # Of one matrix: there may be hundreds of directions.
            change = slopes.reshape(-1, len(names)) @ by
            self.temperature[:] += change.reshape(self.temperature.shape)
            asked = [index for index, name in enumerate(names) if name in derivatives]
            self.sensitivity[:, :, [derivatives.index(names[i]) for i in asked]] += slopes[:, :, asked]

    def displace(
        self,
        model: ThermalModel,
        probes: Sequence[str],
        values: Mapping[str, float],
        derivatives: Sequence[str],
    ) -> None:
        """Read each probe where it sits, to first order in its displacement, in place."""
        for name in {name for name in (*values, *derivatives) if name.startswith(PROBE_PREFIX)}:
            probe, _, direction = name.removeprefix(PROBE_PREFIX).rpartition(".")
            if probe not in probes:
                continue
            gradient = model.probe_gradients[model.probe_names.index(probe), DIRECTIONS.index(direction)]
            slope = self.states @ gradient
            column = probes.index(probe)
            self.temperature[:, column] += values.get(name, 0.0) * slope
            if name in derivatives:
                self.sensitivity[:, column, derivatives.index(name)] += slope

    def read(
        self,
        reading: Reading,
        channels: Sequence[str],
        drive: Drive,
        values: Mapping[str, float],
        derivatives: Sequence[str],
    ) -> None:
        """Pass the channel of an effect of a sensor through it, in place; nothing where none has its name."""
        if reading.channel not in channels:
            return
        column = channels.index(reading.channel)
        inputs, inlet_slopes = inputs_at(drive, drive.times), None
        if reading.mixes_inlet and self.inlet is not None:
            inputs, inlet_slopes = dict(inputs) | {"coolant_inlet": self.inlet}, self.inlet_by
        own = {f"{reading.name}.{item.name}": item.name for item in reading.parameters}
        asked = {own[name]: position for position, name in enumerate(derivatives) if name in own}
        shown, slopes, by = reading.read_with_derivatives(
            drive.times,
            self.temperature[:, column],
            self.sensitivity[:, column],
            inputs,
            {inner: values[outer] for outer, inner in own.items() if outer in values},
            tuple(asked),
            inlet_slopes,
        )
        self.temperature[:, column], self.sensitivity[:, column] = shown, slopes
        self.sensitivity[:, column, list(asked.values())] += by

    def slopes_at(self, places: Array) -> Array:
        """Derivatives (G + 1, n, p) of the temperatures of places (n, r) by the requested coordinates."""
        found = np.zeros((len(self.states), len(places), len(self.columns)))
        if self.tangents is not None:
            inside = self.columns >= 0
            found[:, :, inside] = (places @ self.tangents)[:, :, self.columns[inside]]
        return found


def acting_in(candidates: Sequence[Candidate], number: int) -> tuple[tuple[Candidate, ...], set[str]]:
    """Candidates that act in a recording, and names that belong to the others only."""
    acting = tuple(c for c in candidates if c.recording in (None, number))
    idle = {
        EFFECT_PREFIX + name if name in {f.name for f in c.factors} else name
        for c in candidates
        if c.recording not in (None, number)
        for name in c.parameters
    }
    return acting, idle


def readings_of(candidates: Sequence[Candidate]) -> list[Reading]:
    """What candidates do to sensors, in their order."""
    return [c.reading for c in candidates if c.reading is not None]


def late_channels(candidates: Sequence[Candidate], number: int) -> set[str]:
    """Channels that candidates make late in a recording.

    To first order that is what each sensor may be late by anyway. Beside a law for it nothing is left open:
    readings would tell apart two delays that nobody can.
    """
    return {
        c.reading.channel
        for c in acting_in(candidates, number)[0]
        if c.reading is not None and effect_of(c.effect).delays
    }
