"""Ranges of validity: refusal outside them, and warnings that carry a code."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from spindle_fem.errors import OutOfValidityError

# Ranges to unpack: ``require_range("here", length=(length, *POSITIVE))``.
POSITIVE = (float(np.finfo(np.float64).tiny), float(np.finfo(np.float64).max))
NOT_NEGATIVE = (0.0, float(np.finfo(np.float64).max))
# Temperatures on and about machines, K: an open thermocouple reads above or below; no sensor does in earnest.
PLAUSIBLE_KELVIN = (213.15, 673.15)


@dataclass(frozen=True, slots=True)
class CodedWarning:
    """Something the reader of a result must know, although it is no error.

    Attributes
    ----------
    code : str
        Stable, lower case with underscores, for programs:
        ``"coolant_property_extrapolated"``.
    text : str
        One sentence with the value and the range, for people.
    """

    code: str
    text: str


def require_range(where: str, *, how_to_fix: str = "", **quantities: tuple[ArrayLike, float, float]) -> None:
    """Refuse values outside the range of a source; NaN is outside every range.

    Parameters
    ----------
    where : str
        Name of the correlation or function that was called.
    how_to_fix : str
        What to do instead; the allowed range is always named in the message.
    **quantities : tuple of (array_like, float, float)
        Value, lowest and highest allowed value (both allowed) by name. Give
        ``-numpy.inf`` or ``numpy.inf`` for an open side.

    Raises
    ------
    OutOfValidityError
        Any value outside; the message names every offending quantity.

    >>> require_range("nusselt_gnielinski", reynolds=([4.0e3, 1.0e4], 3.0e3, 5.0e6))
    >>> require_range("nusselt_gnielinski", reynolds=(290.0, 3.0e3, 5.0e6))
    Traceback (most recent call last):
        ...
    spindle_fem.errors.OutOfValidityError: nusselt_gnielinski: reynolds is 290, allowed 3000 to 5e+06.
    """
    faults = [text for name, entry in quantities.items() if (text := range_fault(name, *entry))]
    if faults:
        raise OutOfValidityError(where, "; ".join(faults) + ".", how_to_fix)


def range_fault(name: str, value: ArrayLike, lowest: float, highest: float) -> str:
    """Part of a sentence on which value leaves its range; empty when none does.

    For code that warns instead of refusing.

    >>> range_fault("prandtl", [0.7, 3000.0, 2500.0], 0.5, 2.0e3)
    'prandtl is 3000, allowed 0.5 to 2000 (2 of 3 values outside)'
    >>> range_fault("prandtl", 7.0, 0.5, 2.0e3)
    ''
    """
    values = np.atleast_1d(np.asarray(value, dtype=np.float64))
    outside = ~((values >= lowest) & (values <= highest))
    if not outside.any():
        return ""
    offending = values[outside]
    overshoot = np.maximum(lowest - offending, offending - highest)
    worst = offending[np.argmax(np.where(np.isnan(overshoot), np.inf, overshoot))]
    allowed = range_text(lowest, highest)
    number = f" ({offending.size} of {values.size} values outside)" if values.size > 1 else ""
    return f"{name} is {worst:.6g}, allowed {allowed}{number}"


def range_text(lowest: float, highest: float) -> str:
    """A range in words: "0.5 to 2000", "above 0", "any finite number"."""
    above_zero = lowest == POSITIVE[0]
    if highest >= POSITIVE[1]:
        if lowest <= -POSITIVE[1]:
            return "any finite number"
        return "above 0" if above_zero else f"at least {lowest:.6g}"
    if lowest <= -POSITIVE[1]:
        return f"at most {highest:.6g}"
    return f"above 0, at most {highest:.6g}" if above_zero else f"{lowest:.6g} to {highest:.6g}"


# Warnings that change the result, those of harm to the machine, laws that disagree; other warnings follow.
CHANGES_RESULT = (
    "no_equilibrium",
    "thermal_preload_omitted",
    "coolant_pressure",
    "coolant_flow_limited",
    "balls_unloaded",
    "no_heat_to_air",
    "gap_without_exchange",
)
_HARMS = (
    "grease_temperature",
    "oil_temperature",
    "speed_above_catalogue",
    "counter_bearing_unloaded",
    "gross_sliding",
    "contact_pressure",
    "seat_loose",
    "ring_sticks",
    "film_not_separating",
    "boundary_lubrication",
)
_UNSURE = ("film_uncertain", "wetting_assumed")
_NOTES = ("mesh_note", "geometry_note")


def by_consequence(warnings: Iterable[CodedWarning]) -> tuple[CodedWarning, ...]:
    """Warnings that change the result first, notes last, otherwise in the order given.

    >>> given = [CodedWarning("mesh_note", ""), CodedWarning("no_equilibrium", "")]
    >>> [item.code for item in by_consequence(given)]
    ['no_equilibrium', 'mesh_note']
    """
    first = (*CHANGES_RESULT, *_HARMS, *_UNSURE)
    rank = {code: place for place, code in enumerate(first)} | dict.fromkeys(_NOTES, len(first) + 1)
    return tuple(sorted(warnings, key=lambda item: rank.get(item.code, len(first))))


def fold_warnings(warnings: Iterable[CodedWarning], names: Collection[str]) -> tuple[CodedWarning, ...]:
    """Each warning once; a warning common to several things is given by the first for all.

    Parameters
    ----------
    names : collection of str
        A text that begins with one of them and a colon is about that thing.

    >>> said = [CodedWarning("hot", "F1: 130 °C."), CodedWarning("hot", "F2: 128 °C.")]
    >>> fold_warnings(said, ("F1", "F2"))[0].text
    'F1: 130 °C. Likewise F2.'
    """
    first: dict[str, CodedWarning] = {}
    likewise: dict[str, dict[str, None]] = {}
    for warning in warnings:
        name = warning.text.partition(": ")[0]
        key = warning.code if name in names else warning.text
        if key not in first:
            first[key] = warning
        elif name in names and not first[key].text.startswith(f"{name}: "):
            likewise.setdefault(key, {})[name] = None
    return tuple(
        CodedWarning(warning.code, f"{warning.text} Likewise {', '.join(likewise[key])}.")
        if key in likewise
        else warning
        for key, warning in first.items()
    )
