"""A sensor whose scale is wrong."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Array, Candidate, Reported
from spindle_fem.effects.framework.laws import Complex, amplitude
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.sensor import ChannelReading, Form, SensorEffect

PIVOT = 293.15


class GainReading(ChannelReading):
    """Temperature with a wrong scale about 20 °C."""

    def read(
        self,
        times: Array,
        values: NDArray[np.complex128],
        inputs: Mapping[str, Array],
        parameters: Mapping[str, NDArray[np.complex128]],
    ) -> Complex:
        """Reading, (N, k) K."""
        return PIVOT + parameters["gain"] * (values - PIVOT)


class SensorGain(SensorEffect):
    """Wrong scale, or a sensor that is badly coupled to what it measures."""

    name = "sensor_gain"
    reading_kind = GainReading
    title = "the sensor's scale is wrong: it errs the more the further it is from 20 °C"
    check = "Sensor type and scaling set in the logger; calibrate at two temperatures (ice and 60 °C)."
    card = Card(
        group="Sensors",
        law="20 °C + gain (T - 20 °C)",
        size="1 ± 0.15",
        acts_on="every sensor",
        states={"gain": ""},
    )

    def of_forms(self, machine: MachineView) -> dict[str, Form]:
        """The gain."""
        return {"": ((amplitude("gain", 0.15, null=1.0, low=0.0, high=5.0),), 1.1, ({},))}

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """The scale."""
        return (
            f"Sensor {candidate.component} has a wrong scale: it shows {reported['gain'].value:.3f} times "
            "the distance from 20 °C."
        )
