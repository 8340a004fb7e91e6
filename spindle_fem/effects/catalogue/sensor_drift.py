"""A sensor that drifts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Array, Candidate, Reported
from spindle_fem.effects.framework.laws import Complex, linear, softplus
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.sensor import ChannelReading, Form, SensorEffect

LATER = "from a time on"
# Width of the bend where a drift begins, s.
BEND = 60.0


class DriftReading(ChannelReading):
    """Temperature plus an error that grows in proportion to time, from zero or from an instant on."""

    def read(
        self,
        times: Array,
        values: NDArray[np.complex128],
        inputs: Mapping[str, Array],
        parameters: Mapping[str, NDArray[np.complex128]],
    ) -> Complex:
        """Reading, (N, k) K."""
        since = times[:, None]
        if "start" in parameters:
            since = BEND * softplus((since - parameters["start"]) / BEND)
        return values + parameters["rate"] * since


class SensorDrift(SensorEffect):
    """Error in proportion to time."""

    name = "sensor_drift"
    reading_kind = DriftReading
    title = "the sensor drifts with time"
    check = "Cable, plug and moisture of the sensor; supply and cold junction of the logger; recalibrate."
    card = Card(
        group="Sensors",
        law="T + rate t, from the first stamp or an instant on",
        size="± 2 K over the span",
        acts_on="every sensor",
        states={"rate": "K/h"},
    )

    def of_forms(self, machine: MachineView) -> dict[str, Form]:
        """Drift from the first stamp, or from a later time."""
        span = machine.duration
        rate = linear("rate", 0.0, 2.0 / span, "K/s")
        start = linear("start", 0.5 * span, 0.3 * span, "s", low=0.0, high=span)
        reference = 1.0 / span
        return {
            "": ((rate,), reference, ({},)),
            LATER: ((rate, start), reference, [{"start": share * span} for share in (0.2, 0.4, 0.6, 0.8)]),
        }

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the drift rate and its start."""
        since = f" from {reported['start'].value / 60.0:.0f} min on" if "start" in reported else ""
        return f"Sensor {candidate.component} drifts by {reported['rate'].value:+.2g} K/h{since}."
