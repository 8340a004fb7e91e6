"""Base class of the effects in the catalogue, and the candidates that an effect proposes.

An *effect* (``thermal_preload``, ``sensor_lag``, ...) determines where in a machine
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

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.card import Card
from spindle_fem.effects.framework.laws import RPM
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Term, TermParameter
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]
# Imaginary step of a derivative by a complex argument: exact to rounding, as nothing is subtracted.
COMPLEX_STEP = 1e-30
Kind = Literal["missing_physics", "parameter", "sensor"]


@dataclass(frozen=True, slots=True)
class Reported:
    """One parameter as a finding reports it.

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
    """A sensor whose reading differs from the temperature at its place.

    Attributes
    ----------
    channel : str
        Column of the recording.
    name : str
        Outer names of the parameters are ``<name>.<parameter>``.
    before_sensor : bool
        Whether it is what reaches the sensor that differs, which the sensor reads as any other.
    mixes_inlet : bool
        Whether the coolant's inlet reaches the sensor too, with what effects do to it: the input
        ``coolant_inlet`` is that of the run then, where there is one.
    """

    channel: str = ""
    name: str = ""
    parameters: tuple[TermParameter, ...] = ()
    before_sensor: bool = False
    mixes_inlet: bool = False

    @abstractmethod
    def read(
        self,
        times: Array,
        values: NDArray[np.complex128],
        inputs: Mapping[str, Array],
        parameters: Mapping[str, NDArray[np.complex128]],
    ) -> NDArray[np.complex128]:
        """Reading of the sensor.

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

    def read_with_derivatives(
        self,
        times: Array,
        temperature: Array,
        slopes: Array,
        inputs: Mapping[str, Array],
        values: Mapping[str, float],
        differentiate_by: Sequence[str] = (),
        inlet_slopes: Array | None = None,
    ) -> tuple[Array, Array, Array]:
        """Reading of the sensor and its derivatives.

        Parameters
        ----------
        times : (N,) ndarray, [s]
        temperature : (N,) ndarray, [K]
            At the sensor's place.
        slopes : (N, p) ndarray
            Its derivatives by p parameters.
        inputs : mapping of str to (N,) ndarray
        values : mapping of str to float
            Own parameters by inner name; nominal where absent.
        differentiate_by : sequence of str
            Own parameters to differentiate by; logarithmic ones by their logarithm.
        inlet_slopes : (N, p) ndarray, optional
            Derivatives of the coolant's inlet; for readings that mix it in, moment by moment.

        Returns
        -------
        (N,), (N, p) and, by own parameters, (N, len(differentiate_by)) ndarray
        """
        width = slopes.shape[1]
        columns = 1 + width + len(differentiate_by)
        own = {item.name: values.get(item.name, item.value) for item in self.parameters}
        # Affine in the temperature: differences of whole columns; complex steps for own parameters.
        series = np.repeat(temperature[:, None].astype(complex), columns, axis=1)
        series[:, 1 : 1 + width] += slopes
        parameters = {name: np.full(columns, value, dtype=complex) for name, value in own.items()}
        for item in self.parameters:
            if item.name in differentiate_by:
                scale = own[item.name] if item.logarithmic else 1.0
                parameters[item.name][1 + width + differentiate_by.index(item.name)] += (
                    1j * COMPLEX_STEP * scale
                )
        found = self.read(times, series, inputs, parameters)
        by = (found[:, 1 : 1 + width] - found[:, :1]).real
        if inlet_slopes is not None:
            moved = dict(inputs) | {"coolant_inlet": inputs["coolant_inlet"] + 1j * COMPLEX_STEP}
            alone = {name: values[:1] for name, values in parameters.items()}
            by += self.read(times, series[:, :1], moved, alone).imag / COMPLEX_STEP * inlet_slopes
        return found[:, 0].real, by, found[:, 1 + width :].imag / COMPLEX_STEP


@dataclass(frozen=True, slots=True)
class Candidate:
    """One effect at one place in one form.

    Attributes
    ----------
    effect, component, form : str
        Catalogue id; place as :mod:`spindle_fem.effects.framework.machine_view` names it; form,
        empty where there is one only.
    terms : tuple of Term
        Added to the thermal model.
    factors : tuple of TermParameter
        Factors on the machine's own parameters, named as these
        (``heat.front``, ``joint.flange``); logarithmic, value 1 without effect.
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
    recording : int or None
        The only recording in which it acts, of several; all of them when None.
    constants : mapping of str to float
        Numbers of the machine that a report needs.
    likelihood : float
        How likely this form is before the data, beside the others at its place; of intervals, beside places.
    sized_by : str
        Parameter of the machine whose factor the amplitude is fitted in units of; none when empty.
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
    recording: int | None = None
    constants: Mapping[str, float] = field(default_factory=dict)
    likelihood: float = 1.0
    sized_by: str = ""

    @property
    def label(self) -> str:
        """Effect and place, one word each, for tables."""
        form = f" ({self.form})" if self.form else ""
        return f"{self.effect} @ {self.component}{form}"

    @property
    def key(self) -> tuple[str, str, int | None]:
        """Effect and place, and the only recording in which it acts, of several."""
        return self.effect, self.component, self.recording

    def meets(self, other: Candidate) -> bool:
        """Whether there may be a recording in which both act."""
        return self.recording == other.recording or None in (self.recording, other.recording)

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
        """Parameters that are fitted, by name."""
        return {name: item for name, item in self.parameters.items() if item.sigma > 0.0}


class Effect(ABC):
    """One row of the catalogue.

    Attributes
    ----------
    name : str
        Catalogue id.
    title : str
        In plain words, for reports: "the grease thins as it warms".
    check : str
        What a maintenance engineer should look at when it is found.
    card : Card
        Row of the documentation, and what tests hold it to.
    prior_weight : float
        How likely the effect is before the data, beside the others of the catalogue.
    law_sigma : mapping of str to float
        1 σ of the logarithm of what a finding states, by name, that a fit of so simple a law cannot
        know of; widens the stated interval.
    law_shift : mapping of str to float
        Likewise 1 σ of what may have either sign or be nothing, in the unit that it is stated in.
    starts_are_answers : bool
        Whether fits from different starts may end in answers of their own, of which a single fit knows one:
        final fits then begin from every start.
    delays : bool
        Whether its amplitude is a time by which a channel is late, as that of every sensor is by a little.
    repeats : str
        Effect that its law is, at the same place, at some of its values; empty for none. (A gap that is
        closed conducts as a contact; a film on top of a link is a factor on it; churning that never ends,
        starvation at all speeds, or heat by the power of speed that a node's own heat follows, is a factor
        on that heat; a sensor that hardly reads the air is late.)
    """

    name: str
    kind: Kind
    title: str
    check: str
    card: Card
    prior_weight: float = 1.0
    law_sigma: Mapping[str, float] = MappingProxyType({})
    law_shift: Mapping[str, float] = MappingProxyType({})
    starts_are_answers: bool = False
    delays: bool = False
    repeats: str = ""

    def in_definition(self, spec: MachineSpec) -> bool:
        """Whether the definition of a machine with geometry switches it on without an ``[[effect]]``."""
        return False

    def candidates(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Every form at every place of a machine; none where the definition already has it."""
        return tuple(
            item
            for item in self.forms(machine)
            if not machine.switched_on(self.name, item.component) and self.can_show(machine, item)
        )

    def can_show(self, machine: MachineView, candidate: Candidate) -> bool:
        """Whether a recording of this range and length could show it at all."""
        return True

    @abstractmethod
    def forms(self, machine: MachineView) -> tuple[Candidate, ...]:
        """Every form at every place, whatever the definition already has."""

    def candidate(
        self,
        component: str,
        owner: Term | Reading,
        *,
        amplitude: str,
        reference: float,
        form: str = "",
        starts: Sequence[Mapping[str, float]] = ({},),
        constants: Mapping[str, float] | None = None,
        likelihood: float = 1.0,
    ) -> Candidate:
        """Candidate of one term or reading; ``amplitude`` and ``starts`` by inner names."""
        own = {item.name: item for item in owner.parameters}
        return Candidate(
            self.name,
            component,
            form,
            self.kind,
            f"{owner.name}.{amplitude}",
            own[amplitude].value,
            reference,
            terms=(owner,) if isinstance(owner, Term) else (),
            reading=owner if isinstance(owner, Reading) else None,
            starts=tuple({f"{owner.name}.{key}": value for key, value in start.items()} for start in starts),
            constants=constants or {},
            likelihood=likelihood,
        )

    def term_name(self, key: str, form: str = "") -> str:
        """Name of a term, unique over effects, places and forms."""
        return ".".join(part.replace(" ", "_") for part in (self.name, key, form) if part)

    def factor_candidate(
        self, component: str, parameters: Sequence[TermParameter], form: str, reference: float, *, shift: bool
    ) -> Candidate:
        """Candidate that multiplies a parameter of the machine."""
        return Candidate(
            self.name,
            component,
            form,
            self.kind,
            parameters[0].name,
            1.0,
            reference,
            factors=tuple(parameters),
            shift_of_prior=shift,
        )

    def starts_from(
        self, candidate: Candidate, times: Array, residual: Array
    ) -> tuple[Mapping[str, float], ...]:
        """Starting points of searches, given the residual of a model without the effect.

        Parameters
        ----------
        times : (N,) ndarray, [s]
        residual : (N, c) ndarray, [K]
            Measured less predicted; NaN where nothing was read.
        """
        return candidate.starts

    def report(self, candidate: Candidate, values: Mapping[str, float]) -> dict[str, Reported]:
        """Fitted values under the names and in the units that a finding states, the amplitude first.

        Parameters
        ----------
        values : mapping of str to float
            By outer name, SI.
        """
        own = candidate.parameters
        order = [candidate.amplitude, *(name for name in candidate.free if name != candidate.amplitude)]
        return {own[name].name: stated(own[name], values.get(name, own[name].value)) for name in order}

    def check_of(self, candidate: Candidate) -> str:
        """What to check on the machine if this candidate is found."""
        return self.check

    def statement(self, candidate: Candidate, reported: Mapping[str, Reported]) -> str:
        """One sentence for a report."""
        numbers = ", ".join(f"{name.replace('_', ' ')} {quantity(item)}" for name, item in reported.items())
        return f"{capital(place_words(candidate.component))}: {self.title} ({numbers})."


def stated(parameter: TermParameter, value: float) -> Reported:
    """A parameter in the unit in which engineers state it.

    >>> stated(TermParameter("onset_speed", 0.0, unit="rad/s"), 100.0 * np.pi)
    Reported(value=3000.0, unit='rpm')
    """
    if parameter.unit == "rad/s":
        return Reported(float(round(value / RPM, 6)), "rpm")
    if parameter.unit == "m":
        return Reported(1.0e6 * value, "um")
    if parameter.unit == "K/s":
        return Reported(value * 3600.0, "K/h")
    if parameter.unit == "K" and parameter.name.endswith("_temperature"):
        return Reported(value - ZERO_CELSIUS_K, "degC")
    return Reported(value, parameter.unit)


def quantity(item: Reported) -> str:
    """Value and unit in words.

    >>> quantity(Reported(20.0, "degC"))
    '20 °C'
    """
    value = f"{item.value:.3g}" if abs(item.value) < 1000.0 else f"{item.value:.0f}"
    return f"{value} {item.unit.replace('degC', '°C')}".strip()


def place_words(component: str) -> str:
    """A component as written in a sentence.

    >>> place_words("front_bearings"), place_words("F2"), place_words("drive_end")
    ('the front bearings', 'F2', 'the drive end')
    """
    plain = component.replace("_", " ")
    return plain if plain.upper() == plain or "|" in plain else f"the {plain}"


def capital(text: str) -> str:
    """Capitalise the first letter; leave the rest unchanged."""
    return text[:1].upper() + text[1:]
