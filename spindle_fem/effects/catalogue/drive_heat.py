"""Heat of motor, belt or gear that reaches the drive end."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from spindle_fem.effects.catalogue.heat_scale import HeatScale
from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, place_words, quantity
from spindle_fem.effects.framework.laws import RPM
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.speed_heat import SpeedHeatTerm, turning_places

NAME = "heat_at_3000rpm"


class DriveHeat(Effect):
    """Drive losses that grow with speed and arrive late, through pulley or coupling.

    Source: belt hysteresis and windage between the first and second power of
    speed (Childs & Cowburn (1987), Proc. IMechE 201, 41-53); the lag is that
    of a pulley or motor of some kilograms.
    """

    name = "drive_heat"
    kind = "missing_physics"
    repeats = HeatScale.name
    title = "heat from the motor, belt or gear reaches the drive end"
    check = (
        "Belt tension and pulley temperature, coupling, motor flange: compare their temperatures with the "
        "rear bearings after an hour at constant speed; run uncoupled if possible."
    )
    card = Card(
        group="Heat by speed",
        law="P (n/3000 rpm)^m, lagged τ or prompt",
        size="P ± 0.25 Q; m 1.3 ± 0.35; τ 900 s ×/÷ e^0.8",
        acts_on="drive end, nodes",
        source="Childs & Cowburn (1987), Proc. IMechE 201, 41",
        states={"heat_at_3000rpm": "W"},
        makes=Makes("warmer", probe="SP05", at="drive_end"),
    )
    # It enters at more than one place.
    law_sigma = MappingProxyType({"heat_at_3000rpm": 0.1})

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Lagging, or at once; nodes of a network with something turning."""
        size = (NAME, max(10.0, 0.25 * machine.typical_heat), 3000.0 * RPM)
        found = []
        for key, speed, own in turning_places(machine, ("drive_end",)):
            for word, lag in (("lag", 900.0), ("prompt", 0.0)):
                form = f"{own} {word}".strip()
                name = self.term_name(key, form)
                term = SpeedHeatTerm(name, machine.heat[key], speed, size, exponent=(1.3, 0.35), lag=lag)
                found.append(
                    self.candidate(
                        machine.component(key),
                        term,
                        amplitude=NAME,
                        reference=size[1],
                        form=machine.form(key, form),
                        starts=[{"lag": 300.0}, {"lag": 900.0}, {"lag": 2500.0}] if lag else ({},),
                    )
                )
        return tuple(found)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State heat, power of speed and lag."""
        late = f", {reported['lag'].value / 60.0:.0f} min behind it" if "lag" in reported else ""
        return (
            f"Heat from the drive reaches {place_words(candidate.component)}: {quantity(reported[NAME])} at "
            f"3000 rpm, with the power {reported['exponent'].value:.1f} of speed{late}."
        )
