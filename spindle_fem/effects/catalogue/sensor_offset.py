"""A sensor that reads a constant too much or too little."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Array, Candidate, Reported
from spindle_fem.effects.framework.laws import Complex, linear
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.sensor import ChannelReading, Form, SensorEffect


class OffsetReading(ChannelReading):
    """Temperature plus a constant."""

    def read(
        self,
        times: Array,
        values: NDArray[np.complex128],
        inputs: Mapping[str, Array],
        parameters: Mapping[str, NDArray[np.complex128]],
    ) -> Complex:
        """Reading, (N, k) K."""
        return values + parameters["offset"]


class SensorOffset(SensorEffect):
    """Constant error; class B resistance sensors err by 0.3 K + 0.005 |t| (IEC 60751)."""

    name = "sensor_offset"
    reading_kind = OffsetReading
    title = "the sensor reads a constant too much or too little"
    check = (
        "Compare the sensor with a reference in one bath or before the start, when everything has one "
        "temperature."
    )
    card = Card(
        group="Sensors",
        law="T + offset",
        size="± 1.5 K",
        acts_on="every sensor",
        states={"offset": "K"},
    )

    def of_forms(self, machine: MachineView) -> dict[str, Form]:
        """The offset, in K."""
        return {"": ((linear("offset", 0.0, 1.5, "K", low=-50.0, high=50.0),), 1.0, ({},))}

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the offset and its sign."""
        offset = reported["offset"].value
        word = "too high" if offset >= 0.0 else "too low"
        return (
            f"Sensor {candidate.component} reads {abs(offset):.2g} K {word} all the time; the machine is as "
            "modelled."
        )
