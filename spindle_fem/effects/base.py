"""What an effect of the catalogue is, and what one candidate for it looks like.

An *effect* (``thermal_preload``, ``sensor_lag``, ...) knows where in a machine
it can act and in which mathematical forms. One form at one place is a
*candidate*: terms for the thermal model, factors on the machine's own
parameters, or a transformation of a reading, with free parameters and priors.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.term import Term, TermParameter
from spindle_fem.effects.view import MachineView

Array = NDArray[np.float64]
Kind = Literal["missing_physics", "parameter", "sensor"]


@dataclass(frozen=True, slots=True)
class Reported:
    """One parameter as a finding states it.

    Attributes
    ----------
    value : float
        In ``unit``.
    unit : str
        Empty for a pure number.
    """

    value: float
    unit: str


class Reading(ABC):
    """A sensor that tells something else than the temperature at its place.

    Attributes
    ----------
    channel : str
        Column of the recording.
    name : str
        Outer names of the parameters are ``<name>.<parameter>``.
    parameters : tuple of TermParameter
    """

    channel: str = ""
    name: str = ""
    parameters: tuple[TermParameter, ...] = ()

    @abstractmethod
    def read(
        self,
        times: Array,
        values: NDArray[np.complex128],
        inputs: Mapping[str, Array],
        parameters: Mapping[str, NDArray[np.complex128]],
    ) -> NDArray[np.complex128]:
        """What the sensor tells.

        Affine in ``values``, analytic in the parameters (complex steps).

        Parameters
        ----------
        times : (N,) ndarray, [s]
            Increasing, not uniform.
        values : (N, k) ndarray, [K]
            Temperature at the sensor's place.
        inputs : mapping of str to (N,) ndarray
            ``ambient`` [K] and the other inputs.
        parameters : mapping of str to (k,) ndarray
            By inner name.
        """


@dataclass(frozen=True, slots=True)
class Candidate:
    """One effect at one place in one form.

    Attributes
    ----------
    effect, component, form : str
        Catalogue id; place as :mod:`spindle_fem.effects.view` names it; form,
        empty where there is one only.
    kind : str
    terms : tuple of Term
        Added to the thermal model.
    factors : tuple of TermParameter
        Factors on the machine's own parameters, named as these
        (``heat.front``, ``joint.flange``); logarithmic, value 1 without effect.
    reading : Reading or None
    amplitude : str
        Outer name of the parameter that switches the effect on; the response
        is nearly proportional to its distance from ``null``.
    null : float
        Value of the amplitude without the effect (0, or 1 for factors).
    reference : float
        Typical value of the amplitude, at which responses are screened.
    starts : tuple of mapping of outer name to float
        Values of the other parameters to begin searches from (onset speeds,
        time constants, periods, ...); the nominal ones where a mapping is empty.
    shift_of_prior : bool
        Whether the candidate is a wider prior for something that the machine
        definition itself calls uncertain (kind ``parameter``).
    """

    effect: str
    component: str
    form: str
    kind: Kind
    amplitude: str
    null: float
    reference: float
    terms: tuple[Term, ...] = ()
    factors: tuple[TermParameter, ...] = ()
    reading: Reading | None = None
    starts: tuple[Mapping[str, float], ...] = field(default=(MappingProxyType({}),))
    shift_of_prior: bool = False

    @property
    def label(self) -> str:
        """Effect and place, one word each, for tables."""
        form = f" ({self.form})" if self.form else ""
        return f"{self.effect} @ {self.component}{form}"

    @property
    def parameters(self) -> dict[str, TermParameter]:
        """Every parameter by outer name; fixed ones (``sigma`` 0) included."""
        found: dict[str, TermParameter] = {}
        for term in self.terms:
            found |= term.names()
        found |= {item.name: item for item in self.factors}
        if self.reading is not None:
            found |= {f"{self.reading.name}.{item.name}": item for item in self.reading.parameters}
        return found

    @property
    def free(self) -> dict[str, TermParameter]:
        """Those that are fitted."""
        return {name: item for name, item in self.parameters.items() if item.sigma > 0.0}


class Effect(ABC):
    """One row of the catalogue.

    Attributes
    ----------
    name : str
        Catalogue id.
    kind : str
    title : str
        In plain words, for reports: "the grease thins as it warms".
    check : str
        What a maintenance engineer should look at when it is found.
    """

    name: str
    kind: Kind
    title: str
    check: str

    @abstractmethod
    def candidates(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Every form at every place of a machine; none where the definition already has it."""

    @abstractmethod
    def report(self, candidate: Candidate, values: Mapping[str, float]) -> dict[str, Reported]:
        """Fitted values under the names and in the units that a finding states.

        Parameters
        ----------
        candidate : Candidate
        values : mapping of str to float
            By outer name, SI.
        """

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """One sentence for a report."""
        numbers = ", ".join(
            f"{name.replace('_', ' ')} {item.value:.3g}{' ' + item.unit if item.unit else ''}"
            for name, item in reported.items()
        )
        return f"{candidate.component.replace('_', ' ')}: {self.title} ({numbers})."


Intervals = Sequence[tuple[float, float]]


class IntervalEffect(Effect):
    """An effect that is on in intervals of time, found in the data rather than searched blindly."""

    @abstractmethod
    def places(self, machine: MachineView) -> tuple[str, ...]:
        """Components where it can act."""

    @abstractmethod
    def over(self, machine: MachineView, component: str, intervals: Intervals) -> Candidate:
        """Candidate that begins from intervals, [s]; their ends are free."""

    @abstractmethod
    def intervals(self, candidate: Candidate, values: Mapping[str, float]) -> list[tuple[float, float]]:
        """Fitted intervals, [s]."""
