"""Effects that a machine definition switches on, made into terms, factors and readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.diagnosis.view import view_of, view_of_network
from spindle_fem.effects.base import Candidate, Reading
from spindle_fem.effects.catalogue import build, effect_of
from spindle_fem.effects.term import Term
from spindle_fem.effects.view import MachineView
from spindle_fem.errors import FaultsError, SpecError, SpindleFemError
from spindle_fem.recordings.align import Recording
from spindle_fem.reduced.fast_model import FastModel
from spindle_fem.reduced.network_model import NetworkFastModel
from spindle_fem.spec.effects import EffectEntry

Array = NDArray[np.float64]

COMPLEX_STEP = 1e-30


@dataclass(frozen=True, slots=True)
class ActiveEffects:
    """Physics that a definition has beyond the machine's own; everything in it is fixed.

    Attributes
    ----------
    candidates : tuple of Candidate
        In file order.
    """

    candidates: tuple[Candidate, ...] = ()

    @property
    def terms(self) -> tuple[Term, ...]:
        """Terms of the thermal model."""
        return tuple(term for item in self.candidates for term in item.terms)

    @property
    def readings(self) -> tuple[Reading, ...]:
        """Sensors that do not tell the temperature at their place."""
        return tuple(item.reading for item in self.candidates if item.reading is not None)

    @property
    def factors(self) -> dict[str, float]:
        """Factors on the machine's parameters, by name."""
        found: dict[str, float] = {}
        for item in self.candidates:
            for parameter in item.factors:
                found[parameter.name] = found.get(parameter.name, 1.0) * parameter.value
        return found

    def times_parameters(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Factors of a machine's parameters with those of the effects."""
        return dict(parameters) | {
            name: value * parameters.get(name, 1.0) for name, value in self.factors.items()
        }

    def read(
        self,
        columns: Sequence[str],
        times: Array,
        temperature: Array,
        sensitivity: Array,
        inputs: Mapping[str, Array],
    ) -> tuple[Array, Array]:
        """What the sensors tell of temperatures, and derivatives.

        Parameters
        ----------
        columns : sequence of str
            Channels of the recording.
        times : (N,) ndarray, [s]
        temperature : (N, c) ndarray, [K]
        sensitivity : (N, c, p) ndarray
        inputs : mapping of str to (N,) ndarray

        Returns
        -------
        (N, c) ndarray, (N, c, p) ndarray
        """
        told, by = temperature, sensitivity
        for reading in self.readings:
            if reading.channel not in columns:
                continue
            if told is temperature:
                told, by = temperature.copy(), sensitivity.copy()
            column = columns.index(reading.channel)
            values = np.empty((len(times), 1 + by.shape[2]), dtype=complex)
            values[:, 0] = told[:, column]
            values[:, 1:] = told[:, column, None] + 1j * COMPLEX_STEP * by[:, column]
            width = values.shape[1]
            own = {item.name: np.full(width, item.value, dtype=complex) for item in reading.parameters}
            answer = reading.read(times, values, inputs, own)
            told[:, column] = answer[:, 0].real
            by[:, column] = answer[:, 1:].imag / COMPLEX_STEP
        return told, by


NO_EFFECTS = ActiveEffects()


def require_known_effects(entries: Sequence[EffectEntry]) -> None:
    """Refuse entries that the catalogue does not know, every one at once.

    Raises
    ------
    FaultsError
    """
    faults: list[SpindleFemError] = []
    for number, entry in enumerate(entries, 1):
        try:
            effect_of(entry.effect, f"effect[{number}].effect")
        except SpecError as error:
            faults.append(error)
    if faults:
        raise FaultsError("effect", faults)


def active_effects(entries: Sequence[EffectEntry], view: MachineView) -> ActiveEffects:
    """Effects of a definition on its machine, every fault at once.

    Parameters
    ----------
    entries : sequence of EffectEntry
    view : MachineView
        Of the machine on what it is driven by.

    Raises
    ------
    FaultsError
        An effect, place, form or parameter that does not exist, a value
        without or with a wrong unit, an entry given twice.
    """
    faults: list[SpindleFemError] = []
    found: list[Candidate] = []
    names: set[str] = set()
    for number, entry in enumerate(entries, 1):
        where = f"effect[{number}]"
        try:
            candidate = build(
                entry.effect,
                entry.component,
                entry.form,
                {name: str(value) for name, value in entry.values().items()},
                view,
                entry.intervals,
                where,
            )
        except SpindleFemError as error:
            faults += error.faults if isinstance(error, FaultsError) else [error]
            continue
        if candidate.label in names:
            faults.append(SpecError(where, f"{candidate.label} is given twice.", "Leave one out."))
        names.add(candidate.label)
        found.append(candidate)
    if faults:
        raise FaultsError("effect", faults)
    return ActiveEffects(tuple(found))


def effects_on(
    entries: Sequence[EffectEntry], fast: FastModel | NetworkFastModel, recording: Recording
) -> ActiveEffects:
    """Effects of a definition on a machine that a recording drives.

    Raises
    ------
    FaultsError
    """
    if not entries:
        return NO_EFFECTS
    if isinstance(fast, NetworkFastModel):
        return active_effects(entries, view_of_network(fast.network, recording))
    return active_effects(entries, view_of(fast, recording))
