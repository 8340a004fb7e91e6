"""Effects that are on in intervals of time."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence

from spindle_fem.effects.framework.effect import Candidate, Effect
from spindle_fem.effects.framework.machine_view import MachineView

Intervals = Sequence[tuple[float, float]]


class IntervalEffect(Effect):
    """An effect that is on in intervals of time, found in the data rather than searched blindly.

    Attributes
    ----------
    interval_forms : tuple of str
        Forms that :meth:`over` takes anywhere, the usual one first.
    takes_heat_away : bool
        Whether heat over the intervals leaves the machine.
    """

    interval_forms: tuple[str, ...] = ("",)
    takes_heat_away: bool = False

    def forms_at(self, machine: MachineView, spot: str) -> tuple[str, ...]:
        """Forms that :meth:`over` takes at a spot."""
        return self.interval_forms

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Candidates that follow laws; those for intervals come from the data."""
        return ()

    @abstractmethod
    def places(self, machine: MachineView) -> tuple[str, ...]:
        """Spots of the view where it can act, finer than the components that findings name."""

    def acts_on(self, machine: MachineView, spot: str) -> tuple[str, ...]:
        """Places of the model that a spot consists of."""
        return machine.spots[spot]

    def level_places(self, machine: MachineView) -> tuple[str, ...]:
        """Spots where a level may change once or a few times."""
        return self.places(machine)

    def link(self, machine: MachineView, spot: str) -> str:
        """Coefficient through which it acts at a spot; empty where it acts on places."""
        return ""

    def source(self, machine: MachineView, spot: str) -> str:
        """Source of a network whose heat it scales at a spot; empty where it acts on places."""
        return ""

    @abstractmethod
    def over(
        self,
        machine: MachineView,
        component: str,
        intervals: Intervals,
        form: str | None = None,
        course: str = "pulses",
        sizes: Sequence[float] = (),
        blurred: float = 0.0,
        apart: float = 0.0,
    ) -> Candidate:
        """Candidate that begins from intervals, [s].

        Parameters
        ----------
        component : str
            One of :meth:`places`.
        intervals : sequence of (float, float), [s]
        form : str, optional
            One of :meth:`forms_at`; the first when None.
        course : str
            What is free about them.
        sizes : sequence of float
            Usual size in each beside the common one.
        blurred, apart : float, [s]
            Least width of the edges; distance of the instants that they were sought at.
        """

    @abstractmethod
    def sizes(self, candidate: Candidate, values: Mapping[str, float]) -> list[float]:
        """Fitted size in every interval, in the unit of the amplitude."""

    @abstractmethod
    def intervals(self, candidate: Candidate, values: Mapping[str, float]) -> list[tuple[float, float]]:
        """Fitted intervals, [s]; none where it follows a law."""


def in_intervals(effect: Effect, candidate: Candidate) -> bool:
    """Whether a candidate of an effect is on in intervals."""
    return isinstance(effect, IntervalEffect) and bool(effect.intervals(candidate, {}))
