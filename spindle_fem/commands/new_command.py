"""A machine to start from, written with a comment on everything that a user has to decide."""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from string import Template

from spindle_fem.definition.bearing_catalogue import (
    SHIPPED,
    boundary_dimensions,
    catalogue_bearing,
    preload_of_class,
)
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.results.output_folder import replace_text
from spindle_fem.units import to_si

TEMPLATE = "new_machine.toml"
DRIVES = {
    "belt": "A belt-driven milling spindle",
    "motor": "A milling spindle with a built-in motor",
    "coupling": "A milling spindle with a coupling",
}
COOLINGS = {"helix": "water in a helical channel", "none": "cooled by air alone"}
# mm: length of the nose, of spacers, between the sets, behind them.
_NOSE, _SPACER, _BETWEEN, _END = 40.0, 20.0, 160.0, 64.0


@dataclass(frozen=True, slots=True)
class NewMachine:
    """Options for a machine definition to start from.

    Attributes
    ----------
    front, rear : str
        Ball bearings that ship; those behind have a bore at least 5 mm smaller.
    drive, cooling : str
        Keys of ``DRIVES`` and ``COOLINGS``.
    speed : str
        With its unit.
    """

    front: str = "7014 C"
    rear: str = "7012 C"
    drive: str = "belt"
    cooling: str = "helix"
    speed: str = "4000 rpm"


def new_machine(file: Path, chosen: NewMachine | None = None) -> Path:
    """Write a commented machine that is called as its file is, valid as it stands.

    Raises
    ------
    SpecError
        The file is there already or does not end in .toml, or an option is not possible.
    """
    if file.suffix != ".toml":
        raise SpecError(str(file), "is no definition's name.", "Allowed: a name that ends in .toml.")
    if file.exists():
        raise SpecError(str(file), "is there already.", "Give another name, or remove it.")
    chosen = chosen or NewMachine()
    for where, value, known in (("--drive", chosen.drive, DRIVES), ("--cooling", chosen.cooling, COOLINGS)):
        if value not in known:
            raise SpecError(where, f'"{value}" is none.', did_you_mean(value, known))
    to_si(chosen.speed, "rad/s", where="--speed")
    text = resources.files("spindle_fem.commands").joinpath("templates", TEMPLATE).read_text("utf-8")
    name = re.sub(r"\W+", "_", file.stem, flags=re.ASCII).strip("_") or "machine"
    replace_text(file, Template(text).substitute(name=name, file=file.name, **_values(chosen)))
    return file


def _sizes(designation: str, where: str) -> tuple[float, float, float, float, float]:
    """Bore, outside, width, outside of the inner and inside of the outer ring, mm."""
    found, table = boundary_dimensions(designation), catalogue_bearing(designation)
    if found is None or "ball_count" not in table:
        raise SpecError(where, f'"{designation}" is no ball bearing that ships.', SHIPPED)
    bore, outside, width = (1e3 * value for value in found)
    rings = (table["inner_ring_outer_diameter"], table["outer_ring_inner_diameter"])
    inner, outer = (float(length.split()[0]) for length in rings)
    return bore, outside, width, inner, outer


def _values(chosen: NewMachine) -> dict[str, str]:
    """Values of the template's placeholders."""
    bore, outside, width, shoulder, lip = _sizes(chosen.front, "--front")
    small, rear_outside, rear_width, rear_shoulder, _ = _sizes(chosen.rear, "--rear")
    if small > bore - 5.0:
        what = f"its bore of {small:g} mm does not go behind a shaft of {bore:g} mm."
        raise SpecError("--rear", what, f"Allowed: bores up to {bore - 5.0:g} mm.")
    motor = chosen.drive == "motor"
    front_end = _NOSE + 2.0 * width + _SPACER
    rear_from = front_end + _BETWEEN
    rear_end = rear_from + 2.0 * rear_width + _SPACER
    inside = max(outside, bore + 70.0) if motor else max(outside - 12.0, lip)
    whole = max(outside, rear_outside, inside if motor else 0.0) + 70.0
    middle = min(bore - 4.0, float(int(rear_shoulder)))
    hollow = 5.0 * round(0.3 * small / 5.0)
    shaft = [
        ("nose", 0.0, _NOSE, hollow, float(int(shoulder))),
        ("front_seat", _NOSE, front_end, hollow, bore),
        ("middle", front_end, rear_from, hollow, middle),
        ("rear_seat", rear_from, rear_end, hollow, small),
        ("drive_end", rear_end, rear_end + _END, hollow, small - 10.0),
    ]
    housing = [
        ("flange", _NOSE, _NOSE + 20.0, outside, whole + 40.0),
        ("front", _NOSE + 20.0, front_end, outside, whole),
        ("middle", front_end, rear_from, inside, whole),
        ("rear", rear_from, rear_end, rear_outside, whole),
    ]
    parts = [_part("shaft", "case_hardening_steel", shaft, turns=True), _part("housing", "steel", housing)]
    if motor:
        sheets, split = (front_end + 25.0, rear_from - 25.0), 0.5 * (bore + inside) - 4.0
        rotor, stator = ("sheets", *sheets, middle, split), ("sheets", *sheets, split + 1.0, inside)
        parts.append(_part("rotor", "electrical_steel", [rotor], turns=True))
        parts.append(_part("stator", "electrical_steel", [stator]))
    water = chosen.cooling == "helix"
    words = {"belt": "belt", "motor": "built-in motor", "coupling": "coupling"}[chosen.drive]
    title = f"Milling spindle, {chosen.front} in front, {chosen.rear} behind, {words}"
    return {
        "kind": DRIVES[chosen.drive],
        "cooled": COOLINGS[chosen.cooling],
        "title": title + (", water in the housing" if water else ""),
        "speed": chosen.speed,
        "front": chosen.front,
        "rear": chosen.rear,
        "front_preload": _preload(chosen.front, "medium"),
        "rear_preload": _preload(chosen.rear, "light"),
        "parts": "\n".join(parts),
        "F1": f"{_NOSE:g}",
        "F2": f"{_NOSE + width + _SPACER:g}",
        "R1": f"{rear_from:g}",
        "R2": f"{rear_from + rear_width + _SPACER:g}",
        "load": _load(rear_end) if chosen.drive == "belt" else "",
        "source": _source(chosen.drive),
        "cooling": _cooling(0.5 * inside + (16.0 if not motor else 10.0), front_end + 10.0) if water else "",
        "outlet": '    {name = "COOLANT_OUT", kind = "coolant_outlet"},\n' if water else "",
        "front_z": f"{_NOSE + width + 0.5 * _SPACER:g}",
        "front_r": f"{0.5 * outside + 3.0:g}",
        "rear_z": f"{rear_from + rear_width + 0.5 * _SPACER:g}",
        "rear_r": f"{0.5 * rear_outside + 4.5:g}",
    }


def _preload(designation: str, name: str) -> str:
    """A class where the bearing has classes, else a force that keeps deep grooves from rattling."""
    return name if preload_of_class(designation, name) is not None else "200 N"


def _part(
    name: str, material: str, segments: list[tuple[str, float, float, float, float]], *, turns: bool = False
) -> str:
    rows = [
        f'        {{name = "{label}", z = ["{low:g} mm", "{high:g} mm"], '
        f'inner_diameter = "{inner:g} mm", outer_diameter = "{outer:g} mm"}},'
        for label, low, high, inner, outer in segments
    ]
    turning = "rotating = true, " if turns else ""
    head = f'    {{name = "{name}", material = "{material}", {turning}segment = ['
    return "\n".join([head, *rows, "    ]},"])


def _load(rear_end: float) -> str:
    place = f'z = "{rear_end + 34.0:g} mm", angle = "180 deg"'
    return f'radial_load = [{{name = "belt", force = "400 N", {place}}}]\n'


def _source(drive: str) -> str:
    if drive == "motor":
        return (
            'source = [{name = "stator_losses", part = "stator", heat = "500 W"},\n'
            '          {name = "rotor_losses", part = "rotor", heat = "50 W"}]'
        )
    heat = '{speed = ["0 rpm", "6000 rpm"], heat = ["0 W", "40 W"]}'
    return f'source = [{{name = "{drive}", part = "shaft.drive_end", heat = {heat}}}]'


def _cooling(inner_radius: float, start: float) -> str:
    words = "a helical channel milled into the housing; ethylene_glycol_30, iso_vg_32 and others flow too."
    place = f'part = "housing", inner_radius = "{inner_radius:g} mm", depth = "8 mm", width = "10 mm"'
    turns = f'pitch = "25 mm", turns = 5, z_start = "{start:g} mm"'
    flow = 'fluid = "water", inlet_temperature = "20 degC", flow = "8 L/min"'
    film = "film_factor = {value = 1.0, sigma_rel = 0.2}"
    return f"# Cooling: {words}\nchannel = {{{place}, {turns}}}\ncoolant = {{{flow}, {film}}}\n\n"
