"""Effects that a machine definition switches on, made into terms, factors and readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.coupling import PreparedMachine
from spindle_fem.diagnosis.view import view_of, view_of_network
from spindle_fem.effects.base import Candidate, Reading
from spindle_fem.effects.catalogue import build, effect_of
from spindle_fem.effects.term import Term
from spindle_fem.effects.view import MachineView
from spindle_fem.errors import FaultsError, SpecError, SpindleFemError
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.checks import ChannelNoise
from spindle_fem.recordings.defects import DefectReport
from spindle_fem.reduced.affine import build_affine_system
from spindle_fem.reduced.coefficients import gap_radii_of
from spindle_fem.reduced.drive import standard_inputs
from spindle_fem.reduced.fast_model import FastModel
from spindle_fem.reduced.model import project
from spindle_fem.reduced.network_model import NetworkFastModel
from spindle_fem.spec.effects import EffectEntry
from spindle_fem.spec.model import MachineSpec
from spindle_fem.transients.terms import NO_PHYSICS, Physics

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


def _with_unread(view: MachineView, probes: Sequence[str], outlets: Sequence[str]) -> MachineView:
    """The view with a channel, whose name no recording has, for every probe without one."""
    unread = {f"{probe} (not recorded)": probe for probe in probes if probe not in view.probes.values()}
    if not unread:
        return view
    return replace(
        view,
        channels=(*view.channels, *unread),
        probes={**view.probes, **unread},
        outlets=view.outlets or tuple(name for name, probe in unread.items() if probe in outlets),
    )


def active_effects(
    entries: Sequence[EffectEntry],
    view: MachineView,
    probes: Sequence[str] = (),
    outlets: Sequence[str] = (),
) -> ActiveEffects:
    """Effects of a definition on its machine, every fault at once.

    Parameters
    ----------
    entries : sequence of EffectEntry
    view : MachineView
        Of the machine on what it is driven by.
    probes : sequence of str
        All that the machine has: a sensor that the recording lacks may have
        an effect too, which then does nothing.
    outlets : sequence of str
        Those of them that read the mixed coolant after the channel.

    Raises
    ------
    FaultsError
        An effect, place, form or parameter that does not exist, a value
        without or with a wrong unit, an entry given twice.
    """
    view = _with_unread(view, probes, outlets)
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
        return active_effects(entries, view_of_network(fast.network, recording), fast.channels)
    return active_effects(entries, view_of(fast, recording), fast.channels, _outlets(fast.spec))


def _outlets(spec: MachineSpec) -> tuple[str, ...]:
    return tuple(probe.name for probe in spec.probe if probe.kind == "coolant_outlet")


def physics_of(machine: PreparedMachine) -> Physics:
    """Effects of a definition as physics of its finite-element model.

    Sizes that a recording would give, such as the range of the Reynolds
    number, are those of the definition's own operating point.

    Raises
    ------
    FaultsError
    """
    entries = machine.spec.effects
    if not entries:
        return NO_PHYSICS
    effects = active_effects(entries, view_of(_names_of(machine), _at_the_defined_point(machine.spec)))
    return Physics(effects.terms, {}, effects.factors)


def _names_of(machine: PreparedMachine) -> FastModel:
    """A fast model of one unknown: its names are those of the machine."""
    affine = build_affine_system(machine)
    model = project(
        affine,
        np.ones((affine.size, 1)),
        np.ones(1),
        cells=machine.builder.cells,
        contacts=tuple(machine.mesh.joints),
        gap_radii=gap_radii_of(machine),
        ranges={},
        digest="names",
    )
    return FastModel(model, machine.spec)


def _at_the_defined_point(spec: MachineSpec) -> Recording:
    """A day about the operating point of a definition, all of it at the ambient temperature."""
    inputs = standard_inputs(spec)
    # Flow and speed have a range, as laws of the Reynolds number ask for one.
    low = {**inputs, **{name: 0.5 * inputs[name] for name in ("speed", "coolant_flow")}}
    high = {**inputs, **{name: 1.5 * inputs[name] for name in ("speed", "coolant_flow")}}
    probes = tuple(probe.name for probe in spec.probe)
    times = np.array([0.0, 86400.0])
    noise = ChannelNoise(0.0, 0.0, 0.0, 0.0)
    return Recording(
        name="defined operating point",
        source=spec.name,
        start=None,
        times=times,
        temperature_names=probes,
        probes=probes,
        temperature=np.full((2, len(probes)), inputs["ambient"]),
        flags=np.zeros((2, len(probes)), dtype=np.uint8),
        sigma=np.ones(len(probes)),
        noise=(noise,) * len(probes),
        input_names=tuple(inputs),
        input_columns=tuple(inputs),
        inputs=np.array([list(low.values()), list(high.values())]),
        held=np.ones(len(inputs), dtype=bool),
        input_units=("",) * len(inputs),
        covariate_names=(),
        covariates=np.empty((2, 0)),
        segments=np.array([[0, 2]]),
        defects=DefectReport(
            name=spec.name,
            rows=2,
            stamps=2,
            duration_s=float(times[-1]),
            rows_without_time=0,
            blank_rows=0,
            short_rows=0,
            truncated_last_row=False,
            unordered_rows=0,
            repeated_rows=0,
            conflicting_stamps=0,
            median_step_s=float(times[-1]),
            non_uniform_steps=0,
            gaps=(),
            long_gap_s=float(times[-1]),
            segments=1,
            unused_columns=(),
            channels=(),
        ),
    )
