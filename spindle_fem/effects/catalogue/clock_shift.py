"""A channel that is displaced in time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Array, Candidate, Reported
from spindle_fem.effects.framework.filters import delayed
from spindle_fem.effects.framework.laws import Complex, linear
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.sensor import ChannelReading, Form, SensorEffect


class ShiftedReading(ChannelReading):
    """The temperature of some seconds earlier."""

    def read(
        self,
        times: Array,
        values: NDArray[np.complex128],
        inputs: Mapping[str, Array],
        parameters: Mapping[str, NDArray[np.complex128]],
    ) -> Complex:
        """Reading, (N, k) K."""
        return delayed(times, values, parameters["shift"])


class ClockShift(SensorEffect):
    """A logger whose clock is off against that of the inputs."""

    name = "clock_shift"
    reading_kind = ShiftedReading
    delays = True
    title = "the channel's clock is off"
    check = (
        "Clocks and time zones of the loggers, buffering and averaging on the way; give both one common mark."
    )
    card = Card(
        group="Sensors",
        law="T(t - shift)",
        size="± 400 s",
        acts_on="every sensor",
        states={"shift": "s"},
    )

    def of_forms(self, machine: MachineView) -> dict[str, Form]:
        """The shift, in s."""
        most = 0.25 * machine.duration
        shift = linear("shift", 0.0, min(400.0, most), "s", low=-most, high=most)
        return {"": ((shift,), min(200.0, 0.5 * most), ({},))}

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State by how many seconds the channel is late or early."""
        shift = reported["shift"].value
        word = "late" if shift >= 0.0 else "early"
        return f"Channel {candidate.component} is {abs(shift):.0f} s {word}."
