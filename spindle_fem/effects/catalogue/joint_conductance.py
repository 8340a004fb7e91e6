"""Contacts that conduct differently from nominal."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Candidate, Effect, Reported, capital, place_words
from spindle_fem.effects.framework.laws import factor
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Operating, Term

# Of what a tight seat conducts, 5400 W/(m²·K), a gap of 20 µm of air has a quarter, one of 50 µm a tenth.
SIGMA = 1.2
REFERENCE = 0.6
# Factor at which the answer to a lost contact is taken, from the machine changed so far: as heat finds other
# ways, it is not many times that to a slightly worse contact.
LOOSE = 0.1


class JointTerm(Term):
    """One common factor on several coefficients.

    Parameters
    ----------
    scaled : tuple of str
        Coefficients.
    """

    def __init__(self, name: str, scaled: tuple[str, ...]) -> None:
        self.name, self._scaled = name, scaled
        self.parameters = (factor("factor", None, SIGMA),)

    def operating_factor(self, point: Operating, parameters: Mapping[str, float]) -> dict[str, float]:
        """The factor on every one."""
        return dict.fromkeys(self._scaled, parameters["factor"])


class JointConductance(Effect):
    """A constant factor on a seat, flange, spacer or link.

    Source: contact conductance scatters by a factor of two with flatness, pressure
    and interstitial medium: Yovanovich (2005), IEEE Trans. Compon. Packag. Technol. 28, 182-206;
    a fit that is lost leaves a tenth and less.
    """

    name = "joint_conductance"
    kind = "parameter"
    title = "a contact conducts differently from nominal"
    check = (
        "Fit, flatness and cleanliness of the contact, bolt torque, filler or grease in the gap; compare the "
        "temperatures on both sides at steady state."
    )
    card = Card(
        group="Contacts and capacity",
        law="conductance × factor",
        size="factor ×/÷ e^1.2, wider than the definition's own",
        acts_on="outer and inner seats of a set or bearing, joint groups, flange to frame, links",
        source="Yovanovich (2005), IEEE CPT 28, 182",
        states={"factor": ""},
    )

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Every group of contacts that the view names; by the machine's own parameter where it has one."""
        found = []
        for seat in machine.seats:
            if seat.parameter:
                own = machine.parameters.get(seat.parameter)
                found.append(
                    self.factor_candidate(
                        seat.component,
                        (factor(seat.parameter, own, SIGMA),),
                        seat.form,
                        REFERENCE,
                        shift=own is not None,
                    )
                )
            else:
                term = JointTerm(self.term_name(seat.component, seat.form), seat.coefficients)
                found.append(
                    self.candidate(
                        seat.component,
                        term,
                        amplitude="factor",
                        reference=REFERENCE,
                        form=seat.form,
                        starts=({}, {"factor": LOOSE}),
                    )
                )
        return tuple(found)

    def report(self, candidate: Candidate, values: Mapping[str, float]) -> dict[str, Reported]:
        """The factor."""
        return {"factor": Reported(values.get(candidate.amplitude, 1.0), "")}

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """State the factor on the contact conductance."""
        contact = f" ({candidate.form})" if candidate.form else ""
        return (
            f"{capital(place_words(candidate.component))}{contact}: the contact conducts "
            f"{reported['factor'].value:.2f} times its nominal value, at every temperature."
        )
