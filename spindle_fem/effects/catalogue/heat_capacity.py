"""Thermal mass that the model lacks."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, capital, place_words
from spindle_fem.effects.framework.laws import Complex, amplitude, relaxed, rows, shape
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.spread import Spread
from spindle_fem.effects.framework.term import Term, TermContext

PLACES = ("housing", "flange", "nose", "drive_end", "shaft", "channel")
# Usual size beside what the component itself holds, and, since what is mounted on a small part need not
# be small, at least beside the largest one.
SHARE, SHARE_OF_LARGEST = 0.3, 0.15
BEHIND_CONTACT = "behind a contact"
ON_A_SIDE = "behind a contact on a side"


class HeatCapacityTerm(Term):
    """Heat capacity that follows the mean temperature of its places.

    Parameters
    ----------
    usual : float, [J/K]
    """

    def __init__(self, name: str, places: tuple[str, ...], usual: float) -> None:
        self.name, self._places = name, places
        self.parameters = (amplitude("capacity", usual, "J/K"),)

    def place_capacity(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Shared evenly."""
        return dict.fromkeys(self._places, parameters["capacity"] / len(self._places))


class ContactCapacityTerm(Term):
    """Heat capacity behind a contact: it follows the temperature of its places with a lag.

    It begins at their temperature. Heat into the places is ``C (T_mass - T) / τ``,
    evenly shared; where a place has sides the body may sit on one of them.

    Parameters
    ----------
    usual : float, [J/K]
    sides : tuple of str
        Of the place, as :class:`Spread` has them.
    """

    # its temperature, and whether it has one yet
    n_states = 2

    def __init__(self, name: str, places: tuple[str, ...], usual: float, sides: tuple[str, ...] = ()) -> None:
        self.name, self._spread = name, Spread(places, sides)
        self.heat_places = self.reads = self._spread.names
        self.parameters = (
            amplitude("capacity", usual, "J/K"),
            shape("contact_time", 1200.0, 0.8, "s", low=60.0, high=50000.0),
            *self._spread.parameters,
        )

    def heat(self, context: TermContext) -> Complex:
        """Heat into every place, (n, k) W."""
        own, (mass, place) = context.parameters, self._temperatures(context)
        return self._spread.heat(context, own["capacity"] * (mass - place) / own["contact_time"])

    def advance(self, context: TermContext, step: float) -> Complex:
        """The mass follows, (2, k)."""
        mass, place = self._temperatures(context)
        return rows(context, relaxed(mass, place, step, context.parameters["contact_time"]), 1.0)

    def _temperatures(self, context: TermContext) -> tuple[Complex, Complex]:
        place = self._spread.temperature(context)
        return np.where(context.state[1].real > 0.5, context.state[0], place), place


class HeatCapacity(Effect):
    """A fixture, tool or coolant hold-up, in good contact or behind a joint."""

    name = "heat_capacity"
    kind = "parameter"
    title = "there is thermal mass that the model lacks"
    check = (
        "What is mounted that the drawing does not show: fixture, tool and holder, adapter, standing coolant."
    )
    card = Card(
        group="Contacts and capacity",
        law=(
            "further capacity at the mean temperature of a place, or behind a contact that it follows "
            "with a lag, at the housing on any side"
        ),
        size="C ± 0.3 of the place's own, or 0.15 of the housing's; lag 1200 s ×/÷ e^0.8",
        acts_on="housing, flange, nose, drive end, shaft, channel, nodes",
        states={"capacity": "J/K"},
    )
    # A body on one side, or behind a contact of its own, takes up heat as a smaller or larger one all round.
    law_sigma = MappingProxyType({"capacity": 0.3})

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Large components; nodes of a network."""
        keys = machine.spots if machine.kind == "network" else PLACES
        largest = max(machine.capacity.values(), default=0.0)
        found = []
        for key in keys:
            if key in machine.heat and machine.capacity.get(key, 0.0) > 0.0:
                usual = max(SHARE * machine.capacity[key], SHARE_OF_LARGEST * largest)
                for form, kind in (("", HeatCapacityTerm), (BEHIND_CONTACT, ContactCapacityTerm)):
                    term = kind(self.term_name(key, form), machine.heat[key], usual)
                    found.append(
                        self.candidate(
                            machine.component(key),
                            term,
                            amplitude="capacity",
                            reference=usual,
                            form=form,
                            starts=[{"contact_time": t} for t in (600.0, 2400.0)] if form else ({},),
                        )
                    )
        for spot, sides in machine.sides.items():
            housing = machine.component(spot)
            # A ring through a probe has the sides of its segment, which is a spot itself.
            if housing == "housing" and spot not in machine.focal:
                usual = SHARE * machine.capacity[housing]
                term = ContactCapacityTerm(self.term_name(spot, ON_A_SIDE), machine.spots[spot], usual, sides)
                found.append(
                    self.candidate(
                        housing,
                        term,
                        amplitude="capacity",
                        reference=usual,
                        form=machine.form(spot, ON_A_SIDE),
                        starts=[{"contact_time": 600.0, "up": 0.3}, {"contact_time": 2400.0, "up": 0.3}],
                    )
                )
        return tuple(found)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the capacity and its equivalent mass of steel."""
        size = reported["capacity"].value
        lag = reported.get("contact_time")
        behind = f" It follows with {lag.value / 60.0:.0f} min." if lag is not None else ""
        return (
            f"{capital(place_words(candidate.component))}: {size / 1e3:.3g} kJ/K of heat capacity is "
            f"missing, as of {size / 470.0:.2g} kg of steel.{behind}"
        )
