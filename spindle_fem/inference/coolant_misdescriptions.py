"""Coolant that stood in hoses and channels before a recording; in the model it is in step from the start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.misdescription import Change, Misdescription
from spindle_fem.inference.predictor import Predictor
from spindle_fem.machine.view.build_view import outlet_channels

# Times in which it is rinsed out, s: a litre of hoses and channel at some litres a minute, and a
# pocket that is rinsed slowly. Together they cover any time between.
RINSING_TIMES = (20.0, 100.0)


@dataclass(frozen=True, slots=True)
class StandingCoolant:
    """Error of the outlet readings in the first moments, by coolant that stood there.

    Attributes
    ----------
    channel : str
    rinsing_time : float, [s]
        In which the difference falls to 1/e.
    """

    channel: str
    rinsing_time: float

    def __call__(self, base: BaseRun) -> Change:
        """Change by one kelvin at the recording's first moment."""
        column = base.predictor.recordings[base.number].temperature_names.index(self.channel)
        readings = np.zeros_like(base.predicted())
        grid = base.drive.grid
        readings[:, column] = np.exp(-(grid - grid[0]) / self.rinsing_time)
        return Change(direct=readings)


def coolant_misdescriptions(predictor: Predictor) -> Iterator[Misdescription]:
    """A direction for every outlet that is read; width ``STANDING_COOLANT_SIGMA``."""
    if predictor.is_network:
        return
    for number, recording in enumerate(predictor.recordings):
        for channel in outlet_channels(predictor.fast.spec, recording):
            for time in RINSING_TIMES:
                yield Misdescription(
                    f"standing_coolant.{channel}.{time:.0f}s",
                    f"coolant before {channel}",
                    "K",
                    tuned.STANDING_COOLANT_SIGMA,
                    f"how much warmer what stood before {channel} was than what flows, gone in {time:.0f} s",
                    StandingCoolant(channel, time),
                    number,
                    of_sensor=True,
                )
