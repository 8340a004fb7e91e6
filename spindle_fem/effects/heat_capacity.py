"""Thermal mass that the model lacks."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.effects.base import Candidate, Effect, Reported, capital, place_words
from spindle_fem.effects.laws import amplitude
from spindle_fem.effects.term import Term
from spindle_fem.effects.view import MachineView

PLACES = ("housing", "flange", "nose", "drive_end", "shaft", "channel")
# Usual size beside what the component itself holds.
SHARE = 0.3


class HeatCapacityTerm(Term):
    """Heat capacity that follows the mean temperature of its places.

    Parameters
    ----------
    name : str
    places : tuple of str
    usual : float, [J/K]
    """

    def __init__(self, name: str, places: tuple[str, ...], usual: float) -> None:
        self.name, self._places = name, places
        self.parameters = (amplitude("capacity", usual, "J/K"),)

    def place_capacity(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Shared evenly."""
        return dict.fromkeys(self._places, parameters["capacity"] / len(self._places))


class HeatCapacity(Effect):
    """A fixture, tool or coolant hold-up in good contact."""

    name = "heat_capacity"
    kind = "parameter"
    title = "there is thermal mass that the model lacks"
    check = (
        "What is mounted that the drawing does not show: fixture, tool and holder, adapter, standing coolant."
    )

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Large components; nodes of a network."""
        keys = machine.spots if machine.kind == "network" else PLACES
        found = []
        for key in keys:
            if key in machine.heat and machine.capacity.get(key, 0.0) > 0.0:
                usual = SHARE * machine.capacity[key]
                term = HeatCapacityTerm(self.term_name(key), machine.heat[key], usual)
                found.append(
                    self.candidate(machine.component(key), term, amplitude="capacity", reference=usual)
                )
        return tuple(found)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """How much, and what that is in steel."""
        size = reported["capacity"].value
        return (
            f"{capital(place_words(candidate.component))}: {size / 1e3:.3g} kJ/K of heat capacity is "
            f"missing, as of {size / 470.0:.2g} kg of steel."
        )
