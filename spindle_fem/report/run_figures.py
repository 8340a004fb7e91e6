"""Names, order and captions of a run's pictures and charts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

FIGURE_FOLDER = "figures"

OVER_SPEED = "over_speed_"
# Charts of bearings over speed, also of the command ``heat``.
HEAT_CAPTIONS = {
    "heat_terms": "Friction heat over speed, stacked by term.",
    "heat_models": "The same bearings by every heat model: the spread a designer should expect.",
    "film_thickness": "Central film: flooded and isothermal (dashed), and as it is at these temperatures.",
    "film_ratio": "Film thickness over composite roughness; from 3 on the film carries alone.",
    "thrust": "Axial load and displacement of the set that carries the thrust.",
    "contacts": "Deformation, contact angle and ellipse: inner contact solid, outer dashed.",
    "ball_speeds": "Orbit and spin of the balls, centrifugal force and gyroscopic moment.",
}
CAPTIONS = {
    **{f"{OVER_SPEED}{name}": caption for name, caption in HEAT_CAPTIONS.items()},
    "machine_definition": (
        "The machine as defined: parts by colour, contact lines of the bearings in red, coolant in yellow, "
        "surfaces with a film as thick lines, probes as dots."
    ),
    "temperature_cut": "The machine cut open along the vertical plane through its axis.",
    "meridian_temperature": "Temperature in the vertical plane through the axis, dimensions in mm.",
    "axial_profiles": "Temperature along the machine on its main surfaces.",
    "radial_profiles": "Temperature from the bore to the outside through each bearing; steps are joints.",
    "heat_by_bearing": "Friction heat of each bearing by its terms, and the bodies that it enters.",
    "coolant": "Coolant along the channel: temperatures, the film coefficient with its low and high value.",
    "channel_walls": "Walls of the channel, seen without the housing.",
    "heat_balance": "Where the heat comes from and where it goes.",
    "deformed_machine": "The machine as it has grown since assembly, exaggerated as its title says.",
    "deformed_section": "The same in three dimensions, cut along the vertical plane through the axis.",
    "mesh": "The mesh, opened along the vertical plane; colours are parts.",
}


def in_order(drawn: Mapping[str, Any]) -> dict[str, Any]:
    """Illustrations in the order of the captions, others by name after them; None for those that lack."""
    return {**dict.fromkeys(CAPTIONS), **{name: drawn[name] for name in sorted(drawn)}}


def caption_of(stem: str) -> str:
    """Caption of a figure by the name of its file."""
    if stem in CAPTIONS:
        return CAPTIONS[stem]
    kind, _, name = stem.partition("_")
    if kind == "bearings" and name:
        return f"Bearing set {name}: where its heat goes, and the temperatures of races and rolling elements."
    return stem.replace("_", " ").capitalize() + "."
