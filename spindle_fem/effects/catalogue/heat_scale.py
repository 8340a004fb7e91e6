"""Friction heat that differs by a constant factor."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, capital, place_words
from spindle_fem.effects.framework.laws import factor
from spindle_fem.effects.framework.machine_view import MachineView


class HeatScale(Effect):
    """Constant factor on the heat of a set, a bearing or a source."""

    name = "heat_scale"
    kind = "parameter"
    title = "bearing heat differs from nominal by a constant factor"
    check = (
        "Preload, grease quantity and the drag torque of the set against its data sheet; where the heat "
        "comes from a measured power, the calibration of that measurement."
    )
    card = Card(
        group="Bearings",
        law="heat × factor",
        size="factor ×/÷ e^0.4, wider than the definition's own",
        acts_on="set, bearing, source",
        states={"factor": ""},
    )

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Every set, bearing and source."""
        found = []
        for key in machine.sets:
            name = f"gain.{key}" if machine.kind == "network" else f"heat.{key.removesuffix('_bearings')}"
            own = machine.parameters.get(name)
            found.append(
                self.factor_candidate(
                    machine.component(key),
                    (factor(name, own, 0.4),),
                    machine.form(key),
                    1.2,
                    shift=own is not None,
                )
            )
        return tuple(found)

    def report(self, candidate: Candidate, values: Mapping[str, float]) -> dict[str, Reported]:
        """The factor."""
        return {"factor": Reported(values.get(candidate.amplitude, 1.0), "")}

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the factor on the heat, of one source where a node has several."""
        name = candidate.form.removeprefix(f"{candidate.component}.").replace("_", " ")
        source = f" of {name}" if name else ""
        return (
            f"{capital(place_words(candidate.component))}: the heat{source} is "
            f"{reported['factor'].value:.2f} times the modelled one at every speed and temperature."
        )
