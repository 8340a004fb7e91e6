"""Every effect: those of the catalogue's files, found by walking it, those of programs and other packages."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

import spindle_fem.effects.catalogue as package
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.effect import Candidate, Effect, Reading
from spindle_fem.effects.framework.interval_effect import IntervalEffect, Intervals
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.framework.term import Term, TermParameter
from spindle_fem.effects.framework.unrecorded import EDGE_WIDTH
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.registry import ADDED, entry_points, load_entry_point
from spindle_fem.units import to_si

Owner = TypeVar("Owner", Term, Reading)
# Reynolds numbers of a channel without flow: any range does, as film laws leave such a channel alone.
STANDING_REYNOLDS = (100.0, 1000.0)
# Parameters that are moments from the start of a recording, and a moment of a period.
INSTANTS, PHASE = ("start", "time", "middle"), "phase"


GROUP = "effects"


@cache
def _shipped() -> Mapping[str, Effect]:
    effects: dict[str, Effect] = {}
    for module in sorted(item.name for item in iter_modules(package.__path__)):
        loaded = import_module(f"{package.__name__}.{module}")
        for _, kind in inspect.getmembers(loaded, inspect.isclass):
            own = kind.__module__ == loaded.__name__
            if own and issubclass(kind, Effect) and not inspect.isabstract(kind):
                if kind.name in effects:
                    raise SpecError("effects", f'two have the name "{kind.name}".', "Give each its own.")
                effects[kind.name] = kind()
    return MappingProxyType(effects)


@cache
def _installed() -> Mapping[str, Effect]:
    """Effects of other packages, announced by entry points of the group ``spindle_fem.effects``."""
    return {name: load_entry_point(entry)() for name, entry in entry_points(GROUP).items()}


def _found() -> Mapping[str, Effect]:
    return {**_installed(), **ADDED.get(GROUP, {}), **_shipped()}


def register_effect(kind: type[Effect]) -> type[Effect]:
    """Add an effect of one's own to the catalogue; a decorator of its class.

    Raises
    ------
    SpecError
        There is an effect of this name.
    """
    if kind.name in _shipped() or kind.name in ADDED.get(GROUP, {}):
        raise SpecError("effects", f'there is a "{kind.name}" already.', "Give yours another name.")
    ADDED.setdefault(GROUP, {})[kind.name] = kind()
    return kind


def catalogue() -> dict[str, Effect]:
    """Every effect by its id.

    >>> catalogue()["windage"].kind
    'missing_physics'
    """
    return dict(_found())


def effect_of(name: str, where: str = "effect") -> Effect:
    """An effect by its id.

    Raises
    ------
    SpecError
        The catalogue has no such effect.
    """
    if name not in _found():
        raise SpecError(where, f'"{name}" is not in the catalogue.', did_you_mean(name, _found()))
    return _found()[name]


def effects_in_definition(spec: MachineSpec) -> frozenset[str]:
    """Ids of the effects that a machine definition switches on without an ``[[effect]]``."""
    return frozenset(name for name, effect in _found().items() if effect.in_definition(spec))


def candidates_for(view: MachineView, recordings: int = 1) -> tuple[Candidate, ...]:
    """All effects but those of intervals, in all forms at all places of a machine.

    Of several recordings, whose times have nothing to do with each other, laws that know a moment stand in
    each of them by itself too.
    """
    found = tuple(candidate for effect in _found().values() for candidate in effect.candidates(view))
    timed = [c for c in found if any(item.name in (*INSTANTS, PHASE) for item in c.parameters.values())]
    each = range(recordings if recordings > 1 else 0)
    return (*found, *(in_recording(candidate, number) for number in each for candidate in timed))


def interval_effects() -> tuple[IntervalEffect, ...]:
    """Effects that are on in intervals of time."""
    return tuple(effect for effect in _found().values() if isinstance(effect, IntervalEffect))


def build(
    effect: str,
    component: str,
    form: str,
    values: Mapping[str, str | float],
    view: MachineView,
    intervals: Sequence[tuple[Any, Any]] = (),
    where: str = "effect",
) -> Candidate:
    """Candidate of an entry of a machine definition, its parameters fixed.

    What a definition says holds on every recording: limits that a recording
    sets to a search (half its length for a lag, the Reynolds numbers that
    occur) do not apply; those of the physics (signs, shares) do.

    Parameters
    ----------
    effect, component, form : str
        As a candidate and :func:`definition_entry` have them.
    values : mapping of str to str or float
        Text with a unit, or SI; by inner name (without ``<term>.``).
        Parameters that are missing keep their nominal values, but for the
        amplitude, which must be given.
    intervals : sequence of pairs, [s]
        For effects of intervals, text with a unit or SI.
    where : str
        For messages.

    Raises
    ------
    SpecError
        The effect, its place, form or a parameter does not exist; the amplitude is missing.
    UnitError
        A value without or with a wrong unit.
    """
    known = effect_of(effect, f"{where}.effect")
    candidate = _matching(known, component, form, _of_any_recording(view), _seconds(intervals, where), where)
    by_inner = {item.name: (outer, item) for outer, item in candidate.parameters.items()}
    edges = {name for name in by_inner if name.startswith(("start_", "end_"))} if intervals else set()
    allowed = sorted(set(by_inner) - edges)
    unknown = [name for name in values if name not in allowed]
    if unknown:
        raise SpecError(
            f"{where}.parameters", f'"{unknown[0]}" is unknown.', did_you_mean(unknown[0], allowed)
        )
    amplitude = candidate.parameters[candidate.amplitude].name
    if amplitude not in values:
        raise SpecError(
            f"{where}.parameters", f'"{amplitude}" is missing.', "It says how strong the effect is."
        )
    given = {}
    for name, value in values.items():
        item = by_inner[name][1]
        given[name] = _read(item, value, f"{where}.parameters.{name}")
        _require_possible(item, given[name], name == amplitude, f"{where}.parameters.{name}")
    return fixed(candidate, given)


def _of_any_recording(view: MachineView) -> MachineView:
    """The view with laws of the Reynolds number, also where no coolant flows and they do nothing."""
    if view.channel is None or view.reynolds[0] > 0.0:
        return view
    return replace(view, reynolds=STANDING_REYNOLDS)


def _require_possible(item: TermParameter, value: float, is_amplitude: bool, where: str) -> None:
    """Refuse a wrong sign, and beyond its limits a pure amplitude or a share of either sign.

    Other limits are those of a search.
    """
    either_sign = -np.inf < item.low == -item.high
    pure = not item.unit and (is_amplitude or either_sign)
    low = item.low if pure else 0.0 if item.low >= 0.0 else -np.inf
    high = item.high if pure else np.inf
    if not low <= value <= high:
        allowed = f"{low:g} to {high:g}" if np.isfinite(high) else f"{low:g} or more"
        raise SpecError(
            where,
            f"is {value:g} {item.unit}".rstrip() + ".",
            f"Allowed: {allowed} {item.unit}".rstrip() + ".",
        )


def fixed(candidate: Candidate, values: Mapping[str, float]) -> Candidate:
    """The candidate with every parameter fixed, at SI values by inner name where given."""

    def frozen(items: tuple[TermParameter, ...]) -> tuple[TermParameter, ...]:
        return tuple(
            replace(item, value=float(values.get(item.name, item.value)), sigma=0.0) for item in items
        )

    return replace(
        candidate,
        terms=tuple(_with(term, parameters=frozen(term.parameters)) for term in candidate.terms),
        factors=frozen(candidate.factors),
        reading=None
        if candidate.reading is None
        else _with(candidate.reading, parameters=frozen(candidate.reading.parameters)),
        starts=({},),
        shift_of_prior=False,
    )


def in_recording(candidate: Candidate, number: int) -> Candidate:
    """A candidate of terms or a reading in one recording only, with parameters of its own there.

    What is on in intervals of one recording may be on in others of another.
    """

    def renamed(owner: Owner) -> Owner:
        return _with(owner, name=f"{owner.name}.in_{number}")

    reading = None if candidate.reading is None else renamed(candidate.reading)
    own = replace(candidate, terms=tuple(map(renamed, candidate.terms)), reading=reading, recording=number)
    names = dict(zip(candidate.parameters, own.parameters, strict=True))
    starts = tuple({names[name]: value for name, value in start.items()} for start in candidate.starts)
    return replace(own, amplitude=names[candidate.amplitude], starts=starts)


def _with(owner: Owner, **changed: Any) -> Owner:
    """A copy of a term or a reading with some of its attributes changed."""
    copy = object.__new__(type(owner))
    copy.__dict__.update(owner.__dict__ | changed)
    return copy


def definition_entry(candidate: Candidate, values: Mapping[str, float]) -> dict[str, Any]:
    """Plain data of a fitted candidate for a machine definition; :func:`build` reads it back.

    Parameters
    ----------
    values : mapping of str to float
        By outer name, SI.
    """
    effect = effect_of(candidate.effect)
    entry: dict[str, Any] = {"effect": candidate.effect, "component": candidate.component}
    if candidate.form:
        entry["form"] = candidate.form
    edges: set[str] = set()
    if isinstance(effect, IntervalEffect):
        pairs = effect.intervals(candidate, values)
        if pairs:
            entry["intervals"] = [[f"{start:.10g} s", f"{end:.10g} s"] for start, end in pairs]
        edges = {f"{side}_{number}" for number in range(1, len(pairs) + 1) for side in ("start", "end")}
        # A lag that is fixed is the width of edges, which long steps of a fit blur, but not a definition.
        fixed = {o: p for o, p in candidate.parameters.items() if pairs and p.name == "lag" and not p.sigma}
        values = dict(values) | {o: min(values.get(o, p.value), EDGE_WIDTH) for o, p in fixed.items()}
    entry["parameters"] = {
        item.name: _text(item, values.get(outer, item.value))
        for outer, item in candidate.parameters.items()
        if item.name not in edges
    }
    return entry


def _is_temperature(item: TermParameter) -> bool:
    return item.unit == "K" and item.name.endswith("_temperature")


def _text(item: TermParameter, value: float) -> str:
    return f"{value:.10g} {item.unit}".strip()


def _read(item: TermParameter, value: str | float, where: str) -> float:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    return to_si(value, item.unit, where=where, kind="temperature" if _is_temperature(item) else "quantity")


def _seconds(intervals: Sequence[tuple[Any, Any]], where: str) -> Intervals:
    found = []
    for number, pair in enumerate(intervals, 1):
        ends = [
            float(end) if isinstance(end, (int, float)) else to_si(end, "s", where=f"{where}.intervals")
            for end in pair
        ]
        if len(ends) != 2 or ends[1] <= ends[0] or (found and ends[0] < found[-1][1]):
            raise SpecError(
                f"{where}.intervals[{number}]",
                f"is {list(pair)}.",
                "Allowed: start and end, one after the other, growing.",
            )
        found.append((ends[0], ends[1]))
    return found


def _matching(
    effect: Effect, component: str, form: str, view: MachineView, intervals: Intervals, where: str
) -> Candidate:
    laws = list(effect.forms(view))
    if isinstance(effect, IntervalEffect) and not intervals:
        known = dict.fromkeys(item.form for item in laws if item.component == component)
        if form not in known:
            own = f'form "{form}" follows nothing that is recorded, and ' if form else ""
            law = f", or a form that follows a law: {', '.join(map(repr, known))}" if known else ""
            raise SpecError(f"{where}.intervals", f"{own}{effect.name} has none.", f"Give at least one{law}.")
        offered = laws
    elif isinstance(effect, IntervalEffect):
        offered = [
            effect.over(view, place, intervals, kind)
            for place in dict.fromkeys((*effect.places(view), *effect.level_places(view)))
            for kind in effect.forms_at(view, place)
        ]
    else:
        if intervals:
            raise SpecError(f"{where}.intervals", f"{effect.name} takes none.", "Leave them out.")
        offered = laws
    for candidate in offered:
        if candidate.component == component and candidate.form == form:
            return candidate
    components = list(dict.fromkeys(item.component for item in offered))
    if component not in components:
        raise SpecError(
            f"{where}.component",
            f'"{component}" cannot have {effect.name}.',
            did_you_mean(component, components),
        )
    forms = [item.form for item in offered if item.component == component]
    raise SpecError(f"{where}.form", f'"{form}" is unknown.', f"Allowed: {', '.join(map(repr, forms))}.")
