"""Rubbing heat of a lip or labyrinth."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from spindle_fem.effects.catalogue.heat_scale import HeatScale
from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, place_words, quantity
from spindle_fem.effects.framework.laws import RPM
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.speed_heat import SpeedHeatTerm, turning_places

NAME = "heat_per_1000rpm"
# Forms, and how likely they are: most machines have run before.
LASTING, RUNS_IN = "", "runs in"
LIKELIHOODS = {LASTING: 0.75, RUNS_IN: 0.25}


class SealFriction(Effect):
    """Constant torque at a seal, so heat in proportion to speed; more of it while a new lip runs in.

    What holds the seal takes a share of it.

    Source: Freudenberg, Simrit catalogue of radial shaft seals: power loss in
    proportion to speed at given contact force; 20-60 W per 1000 rpm at 100-180 mm.
    """

    name = "seal_friction"
    kind = "missing_physics"
    repeats = HeatScale.name
    title = "a seal rubs: heat in proportion to speed"
    check = (
        "Seal lip or labyrinth for contact marks, wear dust, misalignment and excess grease; turn the "
        "spindle by hand with and without the seal."
    )
    card = Card(
        group="Heat by speed",
        law="P (n/1000 rpm)^m, lasting, or × 1 + b e^(-t/τ) while a lip runs in",
        size=(
            "P ± 0.1 Q; m 1 ± 0.1; share of what holds the seal 0.15 ± 0.15; b 0.3 ± 0.3, τ 5000 s ×/÷ e^0.8"
        ),
        acts_on="nose, drive end, nodes",
        source="constant torque; makers' data of radial seals",
        states={"heat_per_1000rpm": "W"},
        makes=Makes("warmer", probe="SP01", at="nose"),
    )
    # Contact force and grease of a lip change with temperature; how much of it the shaft takes is guessed.
    law_sigma = MappingProxyType({"heat_per_1000rpm": 0.2})

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Lasting or running in, at both shaft ends; every node of a network that has something turning."""
        size = (NAME, max(5.0, 0.1 * machine.typical_heat), 1000.0 * RPM)
        found = []
        for key, speed, own in turning_places(machine, ("nose", "drive_end")):
            for word, likelihood in LIKELIHOODS.items():
                form = f"{own} {word}".strip()
                term = SpeedHeatTerm(
                    self.term_name(key, form),
                    machine.heat[key],
                    speed,
                    size,
                    exponent=(1.0, 0.1),
                    beside=machine.heat.get(f"standing_{key}", ()),
                    runs_in=word == RUNS_IN,
                )
                found.append(
                    self.candidate(
                        machine.component(key),
                        term,
                        amplitude=NAME,
                        reference=size[1],
                        form=machine.form(key, form),
                        likelihood=likelihood,
                    )
                )
        return tuple(found)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the heat at each end and the extra heat of a new seal."""
        new = ""
        if "more_when_new" in reported:
            new = (
                f" once it has run in ({100.0 * reported['more_when_new'].value:.0f} % more at first, "
                f"fading with {reported['run_in_time'].value / 60.0:.0f} min)"
            )
        return (
            f"A seal rubs at {place_words(candidate.component)}: {quantity(reported[NAME])} per 1000 rpm "
            f"of heat that the model lacks, in proportion to speed{new}."
        )
