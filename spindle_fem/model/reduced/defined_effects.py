"""Effects that a machine definition switches on, made into terms, factors and readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from spindle_fem.definition.effect_entries import EffectEntry
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.effect import Candidate, Reading
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.sensor import as_felt
from spindle_fem.effects.framework.term import Term
from spindle_fem.effects.registry import build, effect_of
from spindle_fem.errors import BadInputError, FaultsError, SpecError, SpindleFemError
from spindle_fem.machine.view.defined_point import at_the_defined_point
from spindle_fem.machine.view.machine_names import MachineNames
from spindle_fem.machine.view.place_names import GROWTH
from spindle_fem.model.lumped.network_view import day_of_a_network, view_of_network
from spindle_fem.model.lumped.thermal_network import ThermalNetwork
from spindle_fem.model.reduced.drive import Drive, inputs_at
from spindle_fem.operation.preload_mechanics import machine_view
from spindle_fem.recordings.align import Recording

# `check` uses this module and needs no solver, whose compiled loops take a second to load.
if TYPE_CHECKING:
    from spindle_fem.model.reduced.fast_model import FastModel
    from spindle_fem.solvers.mesh_terms import Physics
    from spindle_fem.solvers.prepared_machine import PreparedMachine


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
        """Sensors whose reading differs from the temperature at their place."""
        return tuple(item.reading for item in self.candidates if item.reading is not None)

    @property
    def factors(self) -> dict[str, float]:
        """Factors on the machine's parameters, by name."""
        found: dict[str, float] = {}
        for item in self.candidates:
            for parameter in item.factors:
                found[parameter.name] = found.get(parameter.name, 1.0) * parameter.value
        return found

    def felt(self, recording: Recording, drive: Drive) -> Recording:
        """A recording of such a machine with what its sensors must have felt."""
        if not self.readings:
            return recording
        return as_felt(recording, self.readings, inputs_at(drive, recording.times))

    def times_parameters(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Factors of a machine's parameters with those of the effects."""
        return dict(parameters) | {
            name: value * parameters.get(name, 1.0) for name, value in self.factors.items()
        }


NO_EFFECTS = ActiveEffects()


def require_known_effects(entries: Sequence[EffectEntry | None]) -> None:
    """Refuse entries that are not in the catalogue, all at once.

    Parameters
    ----------
    entries : sequence of EffectEntry or None
        None marks one that was refused already.

    Raises
    ------
    FaultsError
    """
    faults: list[SpindleFemError] = []
    for number, entry in enumerate(entries, 1):
        if entry is None:
            continue
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
    entries: Sequence[EffectEntry | None],
    view: MachineView,
    probes: Sequence[str] = (),
    outlets: Sequence[str] = (),
) -> ActiveEffects:
    """Effects of a definition on its machine, every fault at once.

    Parameters
    ----------
    entries : sequence of EffectEntry or None
        None marks one that was refused already.
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
    return _built(entries, lambda entry, where: _candidate(entry, view, where))


def _built(
    entries: Sequence[EffectEntry | None], candidate_of: Callable[[EffectEntry, str], Candidate]
) -> ActiveEffects:
    """Candidates of entries, every fault at once; None marks an entry that was refused already."""
    faults: list[SpindleFemError] = []
    found: list[Candidate] = []
    names: set[str] = set()
    for number, entry in enumerate(entries, 1):
        if entry is None:
            continue
        where = f"effect[{number}]"
        try:
            candidate = candidate_of(entry, where)
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


def _candidate(entry: EffectEntry, view: MachineView, where: str) -> Candidate:
    values = {name: str(value) for name, value in entry.values().items()}
    return build(entry.effect, entry.component, entry.form, values, view, entry.intervals, where)


def check_effects(entries: Sequence[EffectEntry | None], spec: MachineSpec) -> None:
    """Refuse entries that a machine with geometry cannot have, without mesh or recording, all at once.

    Sizes that a recording would give are those of the defined operating point.

    Parameters
    ----------
    entries : sequence of EffectEntry or None
        None marks one that was refused already.

    Raises
    ------
    FaultsError
        As :func:`active_effects` has it.
    """
    if any(entry is not None for entry in entries):
        names = MachineNames.of(spec)
        view = machine_view(names, at_the_defined_point(spec))
        active_effects(entries, view, names.channels, _outlets(spec))


def check_network_effects(entries: Sequence[EffectEntry | None], network: ThermalNetwork) -> None:
    """Refuse entries that a written network cannot have, without a recording, all at once.

    Which inputs are speeds is for a recording to say, and effects that follow
    a speed have forms by their names: an entry passes where a recording could
    make it right.

    Parameters
    ----------
    entries : sequence of EffectEntry or None
        None marks one that was refused already.

    Raises
    ------
    FaultsError
        As :func:`active_effects` has it.
    """
    views: dict[tuple[str, ...], MachineView] = {}

    def candidate_of(entry: EffectEntry, where: str) -> Candidate:
        faults: list[BadInputError] = []
        for speeds in _possible_speeds(network, entry.form):
            if speeds not in views:
                views[speeds] = view_of_network(network, day_of_a_network(network, speeds))
            try:
                return _candidate(entry, views[speeds], where)
            except BadInputError as error:
                faults.append(error)
        # Where some recording offers the place and form, what else is wrong says more.
        raise next((f for f in faults if not f.where.endswith((".component", ".form"))), faults[0])

    _built(entries, candidate_of)


def _possible_speeds(network: ThermalNetwork, form: str) -> list[tuple[str, ...]]:
    """Inputs that may be speeds, the most likely choice first."""
    units = zip(network.source_input, network.source_gain_unit, strict=True)
    turning = dict.fromkeys(name for name, unit in units if name is not None and "rad" in unit)
    likely = tuple(turning) or ("speed",)
    named = form.split()[-1:]
    choices = [likely, *((name,) for name in likely), tuple(dict.fromkeys((*likely, *named, "speed")))]
    return list(dict.fromkeys(choices))


def effects_on(entries: Sequence[EffectEntry], fast: FastModel, recording: Recording) -> ActiveEffects:
    """Effects of a definition on a machine that a recording drives.

    Raises
    ------
    FaultsError
    """
    if not entries:
        return NO_EFFECTS
    if fast.network is not None:
        return active_effects(entries, view_of_network(fast.network, recording), fast.channels)
    return active_effects(entries, machine_view(fast.names, recording), fast.channels, _outlets(fast.spec))


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
    from spindle_fem.solvers.mesh_terms import NO_PHYSICS, Physics

    entries = machine.spec.effects
    if not entries:
        return NO_PHYSICS
    effects = active_effects(entries, machine_view(_names_of(machine), at_the_defined_point(machine.spec)))
    return Physics(effects.terms, {}, effects.factors)


def _names_of(machine: PreparedMachine) -> MachineNames:
    """Names of a machine without the slices of parts that its mesh cannot distinguish."""
    from spindle_fem.operation.named_places import named_places

    names = MachineNames.of(machine.spec)
    balls = tuple(
        node for _, bearing in machine.spec.bearings for node in machine.builder.ball_nodes(bearing.name)
    )
    meshed = {name for name, _ in named_places(machine, balls, machine.operators.n_unknowns + len(balls))}
    own = (name for name in names.place_names if name in meshed or name.startswith(GROWTH))
    return replace(names, place_names=tuple(own))
