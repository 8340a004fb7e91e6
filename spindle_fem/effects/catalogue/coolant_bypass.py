"""Coolant that misses the channel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Array, Candidate, Effect, Reading, Reported
from spindle_fem.effects.framework.laws import Complex, amplitude
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import FLOW, Operating, Term

FRACTION = amplitude("fraction", 0.3, high=0.95)
MIXED = "outlet mixed"


class BypassTerm(Term):
    """Less flow through the channel."""

    def __init__(self, name: str) -> None:
        self.name, self.parameters = name, (FRACTION,)

    def operating_factor(self, point: Operating, parameters: Mapping[str, float]) -> dict[str, float]:
        """Factor on the flow through the channel."""
        return {FLOW: 1.0 - parameters["fraction"]}


class MixedOutlet(Reading):
    """The outlet sensor reads the channel's flow mixed with the bypass at inlet temperature.

    Parameters
    ----------
    channel, name : str
        The name is the term's: both share one fraction.
    """

    before_sensor = mixes_inlet = True

    def __init__(self, channel: str, name: str) -> None:
        self.channel, self.name, self.parameters = channel, name, (FRACTION,)

    def read(
        self,
        times: Array,
        values: NDArray[np.complex128],
        inputs: Mapping[str, Array],
        parameters: Mapping[str, NDArray[np.complex128]],
    ) -> Complex:
        """Mixed temperature, (N, k) K."""
        fraction = parameters["fraction"]
        return (1.0 - fraction) * values + fraction * np.asarray(inputs["coolant_inlet"])[:, None]


class CoolantBypass(Effect):
    """Part of the measured flow does not pass the channel."""

    name = "coolant_bypass"
    kind = "missing_physics"
    title = "part of the coolant misses the channel"
    check = (
        "O-rings between sleeve and body, relief valve, crossed hoses; measure the flow at the outlet and "
        "compare the pressure drop with that of the full flow."
    )
    card = Card(
        group="Coolant",
        law="flow × 1 - f; the outlet sensor reads the channel's flow, or both mixed",
        size="f ± 0.3 (below 0.95)",
        acts_on="channel",
        states={"fraction": ""},
        makes=Makes("warmer", probe="SP04", at="channel"),
    )
    # The share changes with the flow and the oil's viscosity.
    law_sigma = MappingProxyType({"fraction": 0.05})

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """The outlet sensor sits before the flows join, or behind."""
        if machine.channel is None:
            return ()
        name = self.term_name("channel")
        found = [self.candidate("channel", BypassTerm(name), amplitude="fraction", reference=0.3)]
        if machine.outlets:
            mixed = self.term_name("channel", MIXED)
            other = self.candidate(
                "channel", BypassTerm(mixed), amplitude="fraction", reference=0.3, form=MIXED
            )
            found.append(replace(other, reading=MixedOutlet(machine.outlets[0], mixed)))
        return tuple(found)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the share that bypasses the channel and where the flows join."""
        where = " and joins it before the outlet sensor" if candidate.form == MIXED else ""
        return (
            f"Channel: {100.0 * reported['fraction'].value:.0f} % of the coolant flow misses the "
            f"channel{where}."
        )
