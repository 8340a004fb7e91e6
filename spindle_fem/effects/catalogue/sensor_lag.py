"""A sensor that follows late."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Array, Candidate, Reported
from spindle_fem.effects.framework.filters import first_order_lag
from spindle_fem.effects.framework.laws import Complex, amplitude
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.sensor import ChannelReading, Form, SensorEffect


class LagReading(ChannelReading):
    """First-order lag from the first value."""

    def read(
        self,
        times: Array,
        values: NDArray[np.complex128],
        inputs: Mapping[str, Array],
        parameters: Mapping[str, NDArray[np.complex128]],
    ) -> Complex:
        """Reading, (N, k) K."""
        return first_order_lag(times, values, parameters["time_constant"])


class SensorLag(SensorEffect):
    """A sensor in a thick well or with a dry contact.

    Source: a sheathed sensor with air in its bore has time constants of
    minutes, with thermal paste seconds (VDI/VDE 3522, dynamic behaviour of
    contact thermometers).
    """

    name = "sensor_lag"
    reading_kind = LagReading
    delays = True
    title = "the sensor follows the temperature late"
    check = (
        "Seat of the sensor: is it pushed home, with thermal paste, and not in a thick well? Touch it "
        "with a hot tip."
    )
    card = Card(
        group="Sensors",
        law="τ y' = T - y from the first value, exact on any stamps",
        size="τ ± 300 s (above 0)",
        acts_on="every sensor",
        states={"time_constant": "s"},
    )

    def of_forms(self, machine: MachineView) -> dict[str, Form]:
        """The time constant, in s."""
        longest = 0.5 * machine.duration
        size = amplitude("time_constant", min(300.0, longest), "s", high=longest)
        return {"": ((size,), min(200.0, 0.5 * longest), ({},))}

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the time constant."""
        return (
            f"Sensor {candidate.component} follows the temperature with a time constant of "
            f"{reported['time_constant'].value:.0f} s."
        )
