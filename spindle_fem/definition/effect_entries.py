"""Effects of the catalogue that a machine definition switches on.

Names, places and parameters of effects are defined by the
catalogue (:mod:`spindle_fem.effects.registry`); this module defines how
an entry is written.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainSerializer

from spindle_fem.definition.field_types import Fault, FreeQuantityRule, RangeRule, SpecModel, raise_faults
from spindle_fem.errors import SpindleFemError
from spindle_fem.units import to_si


def _read_free(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise_faults([Fault("", f"{value!r} is no quantity.", _FREE_ALLOWED)])
    return value


_FREE_ALLOWED = 'Allowed: a number, or a text such as "60 W".'
FreeQuantity = Annotated[str | float, BeforeValidator(_read_free), FreeQuantityRule()]


def _read_interval(value: Any) -> tuple[float, float]:
    if not isinstance(value, (list, tuple)) or len(value) != 2:
        raise_faults([Fault("", f"{value!r} is no interval.", _INTERVAL_ALLOWED)])
    ends, faults = [], []
    for position, item in enumerate(value, 1):
        try:
            ends.append(to_si(item, "s", where=""))
        except SpindleFemError as error:
            faults.append(Fault(f"[{position}]", error.what, error.how_to_fix, type(error).__name__))
    raise_faults(faults)
    if not ends[0] < ends[1]:
        what = f"runs from {ends[0]:g} s to {ends[1]:g} s."
        raise_faults([Fault("", what, "Allowed: an end after the start.")])
    return ends[0], ends[1]


_INTERVAL_EXAMPLE = '["0 s", "2 h"]'
_INTERVAL_ALLOWED = f"Allowed: start and end, such as {_INTERVAL_EXAMPLE}."
Interval = Annotated[
    tuple[Any, Any],
    BeforeValidator(_read_interval),
    PlainSerializer(lambda ends: [f"{end!r} s" for end in ends]),
    RangeRule(False, _INTERVAL_EXAMPLE),
]


class EffectEntry(SpecModel):
    """Physics beyond the machine's own, by a term of the effect catalogue.

    `spindle-fem diagnose` writes such entries into `improved_machine.toml`;
    they enter every simulation of the machine.
    """

    effect: str
    """Its id in the catalogue, such as thermal_preload."""
    component: str
    """Place where it acts, such as front_bearings, F2, channel, a probe, a network's node or link."""
    form: str = ""
    """Form of the effect, if it has several."""
    parameters: dict[str, FreeQuantity] = Field(default_factory=dict)
    """Parameters by name. The amplitude, which sets the strength, is required; others that are
    missing take their usual values."""
    intervals: tuple[Interval, ...] = ()
    """When it is on, from the start of a recording; only for effects of intervals."""

    def values(self) -> dict[str, str | float]:
        """Parameters as written, by name."""
        return dict(self.parameters)
