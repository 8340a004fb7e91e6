"""Common base of the effects on sensors, whose reading differs from the temperature at their place."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence

from spindle_fem.effects.framework.effect import Candidate, Effect, Reading
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import TermParameter

# Parts of a form: parameters with the amplitude first, reference, starts.
Form = tuple[tuple[TermParameter, ...], float, Sequence[Mapping[str, float]]]


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
