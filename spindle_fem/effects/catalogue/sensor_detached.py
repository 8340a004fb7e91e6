"""A sensor that has come off."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.catalogue.sensor_lag import SensorLag
from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Array, Candidate, Reading, Reported
from spindle_fem.effects.framework.filters import first_order_lag
from spindle_fem.effects.framework.laws import Complex, amplitude, linear, shape, smooth_step
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.sensor import Form, SensorEffect
from spindle_fem.effects.framework.term import TermParameter

LOOSE = "from the start"
# Width of the edge with which it comes off, s, and 1 σ of its logarithm: a clamp opens, glue creeps.
EDGE = (30.0, 1.0)
# Readings whose means are compared where it may have come off: at least, and parts of a recording.
JUMP_ROWS, JUMP_PARTS = 5, 100
# Time constant of a small sensor in still air, s (4 g of steel on 5 cm² at 6 W/(m²K)); 1 σ of its logarithm.
TIME_IN_AIR = (600.0, 0.8)


class DetachedReading(Reading):
    """From a given time the sensor follows a mix of its place and the ambient air, with a lag.

    With a contact ``G`` to its place, a loss ``L`` to the air and a capacity
    ``C`` it relaxes towards ``T + s (T_air - T)``, ``s = L / (G + L)``, in
    ``C / (G + L) = s C / L``: both grow as it comes off, ``C / L`` is the
    time in which it would follow the air alone.

    Parameters
    ----------
    ambient : float, [K]
        Used if no input gives it.
    """

    def __init__(
        self, channel: str, name: str, parameters: tuple[TermParameter, ...], ambient: float
    ) -> None:
        self.channel, self.name, self.parameters = channel, name, parameters
        self._ambient = ambient

    def read(
        self,
        times: Array,
        values: NDArray[np.complex128],
        inputs: Mapping[str, Array],
        parameters: Mapping[str, NDArray[np.complex128]],
    ) -> Complex:
        """Reading, (N, k) K."""
        ambient = np.asarray(inputs.get("ambient", self._ambient), dtype=float)
        air = np.broadcast_to(ambient, times.shape)[:, None]
        share = parameters["share_of_air"]
        if "time" in parameters:
            share = share * smooth_step((times[:, None] - parameters["time"]) / parameters["coming_off"])
        share = np.broadcast_to(share, values.shape)
        lag = 0.5 * (share[1:] + share[:-1]) * parameters["time_in_air"]
        return first_order_lag(times, values + share * (air - values), lag)


def sharpest_jumps(times: Array, residual: Array) -> list[float]:
    """Instant of the largest difference between the means shortly after and before it, of every channel [s].

    Parameters
    ----------
    times : (N,) ndarray, [s]
    residual : (N, c) ndarray, [K]
        NaN where nothing was read.

    Examples
    --------
    >>> sharpest_jumps(np.arange(100.0), np.where(np.arange(100.0) < 63, 0.0, 2.0)[:, None])
    [63.0]
    """
    found = []
    for column in residual.T:
        rows = np.flatnonzero(np.isfinite(column))
        width = max(JUMP_ROWS, rows.size // JUMP_PARTS)
        if rows.size < 2 * width:
            continue
        total = np.concatenate(([0.0], np.cumsum(column[rows])))
        means = (total[width:] - total[:-width]) / width
        apart = np.abs(means[width:] - means[:-width])
        found.append(float(times[rows[width + int(np.argmax(apart))]]))
    return found


class SensorDetached(SensorEffect):
    """A sensor that has lost its contact reads a mix of the part and the air."""

    name = "sensor_detached"
    repeats = SensorLag.name
    title = "the sensor has come off and reads partly the air"
    check = (
        "Is the sensor still in its bore or glued on? Pull gently at the cable; look at the clamp and "
        "the paste."
    )
    card = Card(
        group="Sensors",
        law="m τ y' = T + m (T_air - T) - y, m from t₀ on over a width w; or from the start",
        size=(
            "m ± 0.4 (0 to 1); t₀ searched; w 30 s ×/÷ e; τ, the time to follow the air alone, 600 s ×/÷ "
            "e^0.8"
        ),
        acts_on="every sensor",
    )

    def __init__(self) -> None:
        self._ambient = 293.15

    def of_forms(self, machine: MachineView) -> dict[str, Form]:
        """Comes off at an instant, or was loose all the time."""
        self._ambient = machine.reference_temperature
        span = machine.duration
        share = amplitude("share_of_air", 0.4, high=1.0)
        time = linear("time", 0.5 * span, 0.35 * span, "s", low=0.0, high=span)
        in_air = shape("time_in_air", *TIME_IN_AIR, "s", low=1.0, high=20000.0)
        edge = shape("coming_off", *EDGE, "s", low=5.0, high=3600.0)
        starts = [{"time": float(part) * span} for part in np.linspace(0.08, 0.92, 8)]
        return {
            "": ((share, time, edge, in_air), 0.5, starts),
            LOOSE: ((share, in_air), 0.3, ({},)),
        }

    def starts_from(
        self, candidate: Candidate, times: Array, residual: Array
    ) -> tuple[Mapping[str, float], ...]:
        """Beside even instants those of the most abrupt departures: a fit does not move an edge far."""
        if candidate.form == LOOSE:
            return candidate.starts
        outer = f"{candidate.reading.name}.time"
        sharp = [{outer: moment} for moment in sharpest_jumps(times, residual)]
        return (*candidate.starts, *sharp)

    def reading(self, channel: str, name: str, form: str, parameters: tuple[TermParameter, ...]) -> Reading:
        """Reading of a channel; the air is at the reference temperature if no input gives it."""
        return DetachedReading(channel, name, parameters, self._ambient)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State since when and to which share the sensor reads the air."""
        since = f"since {reported['time'].value / 60.0:.0f} min" if "time" in reported else "from the start"
        return (
            f"Sensor {candidate.component} has been off its place {since}: it reads the air to "
            f"{100.0 * reported['share_of_air'].value:.0f} %."
        )
