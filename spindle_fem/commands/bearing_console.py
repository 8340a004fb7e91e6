"""Terminal output of ``spindle-fem bearing``: a row per bearing, heat by term, each ball or roller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console

from spindle_fem.commands.console import headed_table, open_console

# Key of a ball or roller: heading, digits. Terminals of 80 columns hold them all.
_ELEMENT = {
    "row": ("row", 0),
    "azimuth_deg": ("azimuth °", 1),
    "contact_angle_inner_deg": ("α in °", 2),
    "contact_angle_outer_deg": ("α out °", 2),
    "load_inner_N": ("Q in N", 1),
    "load_outer_N": ("Q out N", 1),
    "pressure_inner_GPa": ("p in GPa", 3),
    "pressure_outer_GPa": ("p out GPa", 3),
    "film_central_um": ("film µm", 3),
    "lambda": ("Λ", 1),
}
# Relative difference of loads from which balls count as different.
_ALIKE = 1.0e-6


def print_bearing(content: Mapping[str, Any], *, every: bool = False) -> None:
    """Bearings in columns, their heat term by term, and balls or rollers where they differ around the row.

    Parameters
    ----------
    content : mapping
        As ``bearing_report`` returns it.
    every : bool
        Show balls and rollers that are equal too.
    """
    console = open_console()
    bearings = content.get("bearings") or [{"name": "bearing", **content}]
    _print_rows(console, content, bearings)
    _print_heat(console, content, bearings)
    for bearing in bearings:
        _print_elements(console, bearing, every)
    for warning in content["warnings"]:
        console.print(warning["text"], style="dim")


def elements_of(bearing: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Balls or rollers of a reported bearing."""
    return bearing["balls"] if "balls" in bearing else bearing["rollers"]


def _print_rows(console: Console, content: Mapping[str, Any], bearings: Sequence[Mapping[str, Any]]) -> None:
    """A column for each bearing, a line for each quantity that any has."""
    table = headed_table("Bearings", "", *(str(bearing["name"]) for bearing in bearings))
    lines = {
        "axial load N": lambda item: _shown(item.get("axial_load_N"), 0),
        "preload N": lambda item: _shown(item.get("preload_N"), 0),
        "axial deflection µm": lambda item: _shown(item.get("axial_deflection_um"), 2),
        "radial deflection µm": lambda item: _shown(item.get("radial_deflection_um"), 2),
        "load of a contact N": lambda item: _span(item, ("load_inner_N", "load_outer_N"), 1),
        "contact angle inner °": lambda item: _span(item, ("contact_angle_inner_deg",), 2),
        "contact angle outer °": lambda item: _span(item, ("contact_angle_outer_deg",), 2),
        "highest pressure GPa": lambda item: _span(
            item, ("pressure_inner_GPa", "pressure_outer_GPa"), 3, only=max
        ),
        "least film µm": lambda item: _span(item, ("film_central_um",), 3, only=min),
        "least Λ": lambda item: _span(item, ("lambda",), 1, only=min),
        "heat W": lambda item: _shown(item.get("heat_W"), 2),
        "rating life h": lambda item: _shown(item.get("rating_life_h"), 0),
    }
    for name, tell in lines.items():
        texts = [tell(bearing) for bearing in bearings]
        if any(text != "–" for text in texts):
            table.add_row(name, *texts)
    console.print(table)
    words = {
        "axial_stiffness_N_um": "axial stiffness {:.4g} N/µm",
        "radial_stiffness_N_um": "radial stiffness {:.4g} N/µm",
    }
    if len(bearings) > 1:
        words |= {"heat_W": "heat of the set {:.4g} W", "rating_life_h": "rating life of the set {:,.0f} h"}
    texts = [text.format(content[key]) for key, text in words.items() if content.get(key) is not None]
    if texts:
        console.print(", ".join(texts))


def _print_heat(console: Console, content: Mapping[str, Any], bearings: Sequence[Mapping[str, Any]]) -> None:
    if content["heat_W"] is None:
        return
    names = list(dict.fromkeys(term for bearing in bearings for term in bearing["terms_W"]))
    table = headed_table("Heat W", "", *(str(bearing["name"]) for bearing in bearings))
    for name in names:
        texts = (_shown(bearing["terms_W"].get(name), 2) for bearing in bearings)
        table.add_row(name.replace("_", " "), *texts)
    console.print(table)


def _print_elements(console: Console, bearing: Mapping[str, Any], every: bool) -> None:
    elements = elements_of(bearing)
    loads = [element["load_inner_N"] for element in elements]
    word = "balls" if "balls" in bearing else "rollers"
    if not every and max(loads) - min(loads) <= _ALIKE * max(1.0, max(loads)):
        return
    keys = [key for key in _ELEMENT if key in elements[0]]
    keys = [key for key in keys if any(element[key] is not None for element in elements)]
    table = headed_table(f"{bearing['name']}, {word}", *(_ELEMENT[key][0] for key in keys))
    for element in elements:
        table.add_row(*(_shown(element[key], _ELEMENT[key][1]) for key in keys))
    console.print(table)


def _shown(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:,.{digits}f}"


def _span(bearing: Mapping[str, Any], keys: Sequence[str], digits: int, only: Any = None) -> str:
    """Range of a quantity over balls or rollers, or the value of the one that counts."""
    elements = elements_of(bearing)
    values = [element[key] for element in elements for key in keys if element.get(key) is not None]
    if not values:
        return "–"
    if only is not None:
        return _shown(only(values), digits)
    low, high = (_shown(end(values), digits) for end in (min, max))
    return low if low == high else f"{low} to {high}"
