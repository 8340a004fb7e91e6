"""Share of the bearing heat that enters the inner rings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, capital, place_words
from spindle_fem.effects.framework.laws import Complex, amplitude, factor, rows
from spindle_fem.effects.framework.machine_view import FrictionTable, MachineView
from spindle_fem.effects.framework.term import Term, TermContext

EVERY = "every bearing"
INNER_SHARE = "heat.inner_share"


class HeatSplitTerm(Term):
    """Moves friction heat from the outer raceways to the inner ones.

    The heat is that of the definition's table; a factor on it that is fitted
    at the same time changes what is moved only in second order.

    Parameters
    ----------
    tables : mapping of bearing to FrictionTable
    ring_share : float
        Of the heat that enters the rings.
    """

    def __init__(self, name: str, tables: Mapping[str, FrictionTable], ring_share: float) -> None:
        self.name = name
        self._tables, self._ring_share = dict(tables), ring_share
        self.heat_places = tuple(f"{b}.{side}_raceway" for b in tables for side in ("inner", "outer"))
        self.parameters = (amplitude("inner_share_change", 0.15, low=-1.0, high=1.0),)

    def heat(self, context: TermContext) -> Complex:
        """Heat of every raceway, (2 n, k) W."""
        share = context.parameters["inner_share_change"] * self._ring_share
        moved = [
            share * table.heat_at(abs(context.inputs["speed"]), context.inputs["thrust"])
            for table in self._tables.values()
        ]
        return rows(context, *(sign * value for value in moved for sign in (1.0, -1.0)))


class HeatSplit(Effect):
    """Another share of the heat enters the inner rings.

    Source: which raceway the balls spin on decides it, Harris & Kotzalas
    (2006), Advanced Concepts of Bearing Technology, ch. 2.
    """

    name = "heat_split"
    kind = "parameter"
    title = "the bearing heat is shared differently between inner and outer rings"
    check = (
        "Nothing to repair as such: compare shaft and housing temperatures beside the bearings, and ask "
        "whether preload or contact angle differ from the drawing."
    )
    card = Card(
        group="Bearings",
        law="moves a share of the friction heat from outer to inner raceways",
        size="change ± 0.15; all bearings: the machine's own share",
        acts_on="set, all bearings",
        source="Harris & Kotzalas (2006)",
        states={"inner_share_change": ""},
    )
    # A share moves with speed and load, and what of it the rings see depends on where their heat is made.
    law_sigma = MappingProxyType({"inner_share_change": 0.08})

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """All bearings by one share (the machine's own parameter if it has one), or one set."""
        if machine.kind == "network" or not machine.sets:
            return ()
        own = machine.parameters.get(INNER_SHARE)
        common = replace(factor(INNER_SHARE, own, 0.3), high=1.0 / machine.inner_share)
        found = [
            replace(
                self.factor_candidate(machine.groups[0], (common,), EVERY, 1.25, shift=own is not None),
                constants={"inner_share": machine.inner_share},
            )
        ]
        for group in machine.groups:
            tables = {b: machine.friction[b] for b in machine.sets[group] if b in machine.friction}
            if tables:
                term = HeatSplitTerm(self.term_name(group), tables, machine.ring_share)
                found.append(self.candidate(group, term, amplitude="inner_share_change", reference=0.12))
        return tuple(found)

    def report(self, candidate: Candidate, values: Mapping[str, float]) -> dict[str, Reported]:
        """Change of the inner rings' share."""
        value = values.get(candidate.amplitude, candidate.null)
        if candidate.factors:
            value = candidate.constants["inner_share"] * (value - 1.0)
        return {"inner_share_change": Reported(value, "")}

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the change of the inner rings' share."""
        place = EVERY if candidate.form == EVERY else place_words(candidate.component)
        return (
            f"{capital(place)}: the share of the friction heat that enters the inner rings differs from "
            f"nominal by {100.0 * reported['inner_share_change'].value:+.0f} percentage points."
        )
