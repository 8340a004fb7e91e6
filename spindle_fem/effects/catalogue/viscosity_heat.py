"""Friction that follows the viscosity of the warming grease."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.effect import Candidate, Effect
from spindle_fem.effects.framework.laws import Complex, amplitude, linear, repeated
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Term, TermContext
from spindle_fem.units import ZERO_CELSIUS_K

# Where the temperature of nominal friction is sought from, °C.
NOMINAL_TEMPERATURES = (22.0, 35.0, 50.0)


class Walther:
    """Viscosity of an oil against temperature, ``log log (ν + 0.7) = A - B log T``, ν in mm²/s.

    Parameters
    ----------
    at_40, at_100 : float, [m²/s]

    Source: ASTM D341, ISO/TR 26522; Walther (1931).

    >>> round(float(Walther(21e-6, 4.7e-6).log_viscosity(313.15).real), 4) == round(math.log(21.0), 4)
    True
    """

    def __init__(self, at_40: float, at_100: float) -> None:
        ends = [math.log10(math.log10(value * 1e6 + 0.7)) for value in (at_40, at_100)]
        logs = [math.log10(ZERO_CELSIUS_K + t) for t in (40.0, 100.0)]
        self.slope = (ends[0] - ends[1]) / (logs[1] - logs[0])
        self.level = ends[0] + self.slope * logs[0]

    def log_viscosity(self, temperature: ArrayLike) -> Complex:
        """Natural logarithm of the viscosity in mm²/s at a temperature [K]."""
        logarithm = 10.0 ** (self.level - self.slope * np.log10(np.asarray(temperature, dtype=complex)))
        return np.log(10.0**logarithm - 0.7)


class ViscosityHeatTerm(Term):
    """Friction as a power of the viscosity at the temperature of the rings.

    Parameters
    ----------
    places : tuple of tuple of str
        For each bearing, those whose mean temperature its grease has.
    viscosity : (float, float), [m²/s]
        At 40 and 100 °C.
    """

    def __init__(
        self,
        name: str,
        bearings: tuple[str, ...],
        places: tuple[tuple[str, ...], ...],
        viscosity: tuple[float, float],
    ) -> None:
        self.name, self.bearings = name, bearings
        self.reads = tuple(place for own in places for place in own)
        self._counts = tuple(len(own) for own in places)
        self._law = Walther(*viscosity)
        self.parameters = (
            amplitude("viscosity_exponent", 0.4, high=2.0),
            linear("nominal_temperature", ZERO_CELSIUS_K + 35.0, 10.0, "K", low=253.15, high=373.15),
        )

    def friction(self, context: TermContext) -> Complex:
        """Factor on every bearing, (n, k)."""
        own = context.parameters
        nominal = self._law.log_viscosity(own["nominal_temperature"])
        found, first = [], 0
        for count in self._counts:
            grease = context.temperatures[first : first + count].mean(axis=0)
            found.append(np.exp(own["viscosity_exponent"] * (self._law.log_viscosity(grease) - nominal)))
            first += count
        return np.array(found) * repeated(context, 1.0, len(self.bearings))


class ViscosityHeat(Effect):
    """Friction moment with viscosity^n, n = 2/3 for Palmgren's load-free part.

    Source: Palmgren (1959), Grundlagen der Wälzlagertechnik; SKF (2018) friction model.
    """

    name = "viscosity_heat"
    kind = "missing_physics"
    title = "friction falls as the grease warms and thins, and is higher than modelled when cold"
    check = (
        "Grease: grade, viscosity and quantity; compare the drag torque of the cold spindle with that of the "
        "warm one at the same speed."
    )
    card = Card(
        group="Bearings",
        law="friction × (ν(T)/ν(T₀))^p; ν of the grease's oil by Walther, T of the rings",
        size="p ± 0.4; T₀ 35 ± 10 °C",
        acts_on="set, source",
        source="ASTM D341; Palmgren (1959): moment with ν^(2/3)",
    )

    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """One candidate per bearing set or source."""
        found = []
        for group in machine.groups:
            bearings = tuple(b for b in machine.sets[group] if b in machine.inner)
            if not bearings or not machine.running(group):
                continue
            term = ViscosityHeatTerm(
                self.term_name(group),
                bearings,
                tuple(machine.grease_places(b) for b in bearings),
                machine.viscosity,
            )
            found.append(
                self.candidate(
                    machine.component(group),
                    term,
                    amplitude="viscosity_exponent",
                    reference=0.4,
                    form=machine.form(group),
                    starts=[{"nominal_temperature": ZERO_CELSIUS_K + t} for t in NOMINAL_TEMPERATURES],
                )
            )
        return tuple(found)
