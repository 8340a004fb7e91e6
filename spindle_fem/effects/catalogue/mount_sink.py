"""Heat exchanged with a machine frame that is not at ambient temperature."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from spindle_fem.effects.framework.card import Card, Makes
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, quantity
from spindle_fem.effects.framework.laws import Complex, amplitude, linear, repeated, shape
from spindle_fem.effects.framework.machine_view import MachineView, fluid_place
from spindle_fem.effects.framework.term import Term, TermContext

NAME = "temperature_above_ambient"
# Share of it that is there from the start where the rest builds up: value and standard deviation.
SHARE_AT_ONCE = (0.5, 0.35)


class MountSinkTerm(Term):
    """The frame is some kelvin above (below) the ambient, at once or partly warming up.

    Parameters
    ----------
    films : tuple of str
        Those to the frame.
    """

    def __init__(self, name: str, films: tuple[str, ...], *, warming: bool) -> None:
        self.name = name
        self.heat_places = tuple(fluid_place(film) for film in films)
        self._warming = warming
        self.parameters = (amplitude(NAME, 5.0, "K", low=-50.0, high=80.0),)
        if warming:
            self.parameters += (
                shape("warm_up_time", 7200.0, 0.8, "s", low=300.0, high=2.0e5),
                linear("share_at_once", *SHARE_AT_ONCE, low=0.0, high=1.0),
            )

    def heat(self, context: TermContext) -> Complex:
        """Shift of the frame's temperature, (n, k) K."""
        share: Complex | float = 1.0
        if self._warming:
            own = context.parameters
            later = 1.0 - np.exp(-np.maximum(context.time, 0.0) / own["warm_up_time"])
            share = own["share_at_once"] + (1.0 - own["share_at_once"]) * later
        return repeated(context, context.parameters[NAME] * share, len(self.heat_places))


class MountSink(Effect):
    """A frame warmed by hydraulics or motor, or cooled by the floor."""

    name = "mount_sink"
    kind = "missing_physics"
    title = "the frame behind the flange is not at ambient temperature"
    check = (
        "Temperature of the machine frame beside the flange: a contact thermometer over one shift; "
        "hydraulic unit, motor or coolant tank on the same casting."
    )
    card = Card(
        group="Surroundings",
        law="frame ΔT above the ambient, at once, or a share s of it and the rest with 1 - e^(-t/τ)",
        size="ΔT ± 5 K, both signs; s 0.5 ± 0.35, τ 2 h ×/÷ e^0.8",
        acts_on="film between flange and frame, boundary links",
        states={"temperature_above_ambient": "K"},
        makes=Makes("warmer", probe="SP04", at="flange"),
    )
    # A frame is not at one temperature.
    law_sigma = MappingProxyType({"temperature_above_ambient": 0.1})

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """The flange's film to the frame; boundary links of a network."""
        keys = machine.films if machine.kind == "network" else ("flange",)
        found = []
        for key in keys:
            films = machine.films.get(key, ())
            for form, warming in (("", False), ("warming up", True)) if films else ():
                term = MountSinkTerm(self.term_name(key, form), films, warming=warming)
                found.append(
                    self.candidate(
                        machine.component(key),
                        term,
                        amplitude=NAME,
                        reference=5.0,
                        form=form,
                        starts=[
                            {"warm_up_time": time, "share_at_once": at_once}
                            for time, at_once in ((3600.0, 0.1), (12000.0, 0.1), (6000.0, 0.7))
                        ]
                        if warming
                        else ({},),
                    )
                )
        return tuple(found)

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the temperature difference of the frame and its onset."""
        value = reported[NAME]
        word = "above" if value.value >= 0.0 else "below"
        size = quantity(Reported(abs(value.value), "K"))
        since = ""
        if "warm_up_time" in reported:
            since = (
                f", {100.0 * reported['share_at_once'].value:.0f} % of it from the start and the rest over "
                f"{reported['warm_up_time'].value / 3600.0:.1f} h"
            )
        what = "flange" if candidate.component == "flange" else candidate.component
        return f"The frame that the {what} is joined to is {size} {word} the ambient temperature{since}."
