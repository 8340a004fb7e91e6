"""Common base of the effects on sensors, whose reading differs from the temperature at their place."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Array, Candidate, Effect, Reading
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import TermParameter
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.channel_checks import Flag

# Parts of a form: parameters with the amplitude first, reference, starts.
Form = tuple[tuple[TermParameter, ...], float, Sequence[Mapping[str, float]]]

# A sensor that shows less than this share of a change says nothing of the temperature at its place.
LEAST_SHOWN = 0.1
# Sizes of a delay from which searches begin beside its reference, each so many times the one before: readings
# follow one that is longer than a change of load takes to nothing like first order. None is farther off than
# this many standard deviations: an hour, as of another time zone, is nine.
DELAY_RATIO, FARTHEST_DELAY = 4.0, 10.0


def as_felt(
    recording: Recording, readings: Sequence[Reading], inputs: Mapping[str, NDArray[np.float64]]
) -> Recording:
    """A recording with the temperatures that its sensors must have felt, if they read as known.

    A sensor that answers late is taken to have felt what it shows. Where one shows next to nothing of its
    place, its temperature is not known.

    Parameters
    ----------
    readings : sequence of Reading
        In the order in which a temperature passes through them.
    inputs : mapping of str to (N,) ndarray
        At the stamps of the recording.
    """
    temperature, flags = recording.temperature.copy(), recording.flags.copy()
    for reading in reversed(readings):
        if reading.channel not in recording.temperature_names:
            continue
        column = recording.temperature_names.index(reading.channel)
        own = {item.name: np.full(2, item.value, dtype=complex) for item in reading.parameters}
        # Affine in the temperature at the place, which is first taken to be 0 K and then 1 K throughout.
        none = np.tile(np.array([0.0, 1.0], dtype=complex), (recording.times.size, 1))
        shown = reading.read(recording.times, none, inputs, own).real
        share = shown[:, 1] - shown[:, 0]
        blind = share < LEAST_SHOWN
        flags[blind, column] |= np.uint8(Flag.MISSING)
        temperature[:, column] = (temperature[:, column] - shown[:, 0]) / np.where(blind, 1.0, share)
    return replace(recording, temperature=temperature, flags=flags)


class ChannelReading(Reading):
    """A reading that needs only its channel and its parameters."""

    def __init__(self, channel: str, name: str, parameters: tuple[TermParameter, ...]) -> None:
        self.channel, self.name, self.parameters = channel, name, parameters


class SensorEffect(Effect):
    """One candidate for every channel and form.

    Attributes
    ----------
    reading_kind : type of ChannelReading
        Class of the reading; an effect whose reading needs more overrides ``reading``.
    """

    kind = "sensor"
    reading_kind: type[ChannelReading]

    @abstractmethod
    def of_forms(self, machine: MachineView) -> dict[str, Form]:
        """Parameters, reference and starts of every form."""

    def reading(self, channel: str, name: str, form: str, parameters: tuple[TermParameter, ...]) -> Reading:
        """The reading of a channel."""
        return self.reading_kind(channel, name, parameters)

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Every channel."""
        found = []
        for channel in machine.channels:
            for form, (parameters, reference, starts) in self.of_forms(machine).items():
                reading = self.reading(channel, self.term_name(channel, form), form, parameters)
                found.append(
                    self.candidate(
                        machine.probes.get(channel, channel),
                        reading,
                        amplitude=parameters[0].name,
                        reference=reference,
                        form=form,
                        starts=starts,
                    )
                )
        return tuple(found)

    def starts_from(
        self, candidate: Candidate, times: Array, residual: Array
    ) -> tuple[Mapping[str, float], ...]:
        """What makes a channel late, or early, also from larger sizes and from the other sign."""
        if not self.delays:
            return candidate.starts
        item = candidate.parameters[candidate.amplitude]
        least, longest = abs(candidate.reference), min(item.high, FARTHEST_DELAY * item.sigma)
        sizes = least * DELAY_RATIO ** np.arange(1 + int(np.log(longest / least) / np.log(DELAY_RATIO)))
        further = [size for size in (*sizes[1:], *-sizes) if size >= item.low]
        return (*candidate.starts, *({candidate.amplitude: float(size)} for size in further))
