"""Growth by other expansion coefficients than the definition has, where displacements are recorded."""

from __future__ import annotations

from collections.abc import Iterator

from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.misdescription import Change, Misdescription
from spindle_fem.inference.predictor import Predictor

# Handbooks give steels of one name 11.5 to 12.5 µm/(m K).
EXPANSION_SIGMA = 0.04


def expansion(base: BaseRun) -> Change:
    """Displacements since assembly for as much growth again; temperatures stay."""
    grown = base.before_sensors().copy()
    grown[:, : base.predictor.recordings[base.number].temperature_count] = 0.0
    return Change(direct=grown)


def growth_misdescriptions(predictor: Predictor) -> Iterator[Misdescription]:
    """One share for the whole machine: a sensor sees the growth of the shaft, nine tenths of all."""
    counts = [(item.temperature_count, len(item.temperature_names)) for item in predictor.recordings]
    if any(kelvins < every for kelvins, every in counts):
        yield Misdescription(
            "expansion",
            "materials.thermal_expansion",
            "",
            EXPANSION_SIGMA,
            "share by which the machine grows more with each kelvin than the expansion coefficients say",
            expansion,
        )
