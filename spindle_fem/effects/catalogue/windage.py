"""Air friction of the turning shaft."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, place_words, quantity
from spindle_fem.effects.framework.laws import RPM
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.speed_heat import SpeedHeatTerm, turning_places

NAME = "heat_at_4500rpm"


class Windage(Effect):
    """Turbulent air friction in the gap, power with about the third power of speed.

    Source: Bilgen & Boulos (1973), J. Fluids Eng. 95, 122-126: moment
    coefficient of annuli with Re^-0.3 (low) and Re^-0.2 (high), so power with
    speed^2.7 to 2.8; Saari (1998), Helsinki Univ. of Technology, windage of
    high-speed rotors; 3 where shape resistance rules. The gap's standing wall
    takes a share of it, some 15 % before any data.
    """

    name = "windage"
    kind = "missing_physics"
    title = "air friction heats the shaft with about the third power of speed"
    check = (
        "Parts that stir air (clamping unit, fan, bolt heads, rotor), gap widths; measure the power at "
        "the highest speed without load, and at half of it: an eighth should be left."
    )
    card = Card(
        group="Heat by speed",
        law="P (n/4500 rpm)^m, a share s at the standing wall of the gap",
        size="P ± 0.25 Q; m 3 ± 0.15; s 0.15 ± 0.15",
        acts_on="shaft in the air gap, nodes",
        source="Bilgen & Boulos (1973), J. Fluids Eng. 95, 122",
        states={"heat_at_4500rpm": "W"},
        makes=Makes("warmer", probe="SP04", at="shaft"),
    )
    # The exponent changes with the regime.
    law_sigma = MappingProxyType({"heat_at_4500rpm": 0.1})

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """The shaft; every node of a network that has something turning."""
        size = (NAME, max(10.0, 0.25 * machine.typical_heat), 4500.0 * RPM)
        found = []
        for key, speed, form in turning_places(machine, ("shaft_gap",)):
            term = SpeedHeatTerm(
                self.term_name(key, form),
                machine.heat[key],
                speed,
                size,
                exponent=(3.0, 0.15),
                beside=machine.heat.get("standing_gap", ()) if key == "shaft_gap" else (),
            )
            component = "shaft" if machine.kind == "geometry" else machine.component(key)
            found.append(self.candidate(component, term, amplitude=NAME, reference=size[1], form=form))
        return tuple(found)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the heat and its power of speed."""
        return (
            f"Air friction heats {place_words(candidate.component)}: {quantity(reported[NAME])} at 4500 "
            f"rpm, with the power {reported['exponent'].value:.1f} of speed."
        )
