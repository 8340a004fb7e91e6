"""Machines drawn at random over kinds of bearing, arrangement, drive, cooling and oil, as raw definitions.

``python -m scripts.random_machines --number 300 --seed 1`` draws them, checks, meshes and solves each by
elements and by the machine's own network, and ends with status 1 if one neither solves nor is refused with a
reason.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

import spindle_fem
from scripts.random_kinds import add_kinds
from spindle_fem.commands.checked_machine import load_buildable
from spindle_fem.definition.bearing_catalogue import boundary_dimensions, catalogue_bearing
from spindle_fem.errors import (
    BadInputError,
    NoEquilibriumError,
    NoSteadyStateError,
    OutOfValidityError,
    SpindleFemError,
)
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.machine_network_steady import solve_machine_network

LAYOUTS = ("pairs", "triplex", "unlike", "grooves", "rollers")
COOLINGS = ("none", "helix", "two helices", "bore", "annulus", "helix and bore")
DRIVES = ("motor", "belt", "coupling")
FLUIDS = ("water", "ethylene_glycol_30", "ethylene_glycol_50", "iso_vg_10", "iso_vg_32", "iso_vg_46")
# Checks that a machine fails by what it is, not by how it is solved.
TOO_HOT = {"grease temperature", "oil temperature"}
# Fast enough for hundreds, fine enough for every face: linear elements on a coarse mesh.
MESH = ("mesh.preset=coarse", "mesh.order=1", "mesh.size_factor=1.6")
_CODES = (6, 8, 10, 12, 14, 16, 18, 20)
_Z_FRONT = 40.0


def draw_machine(generator: np.random.Generator) -> dict[str, Any]:
    """Raw tables of one machine; most can be built, some are not possible."""
    layout, cooling = (str(generator.choice(names)) for names in (LAYOUTS, COOLINGS))
    drive = str(generator.choice(DRIVES))
    code = int(generator.choice(_CODES))
    sets, end_of_front = _front_sets(generator, layout, code)
    middle = float(generator.uniform(110.0, 260.0))
    rear, end_of_rear = _rear_set(generator, layout, code - 2, end_of_front + middle)
    places = {"front": end_of_front, "rear": end_of_front + middle, "end": end_of_rear}
    content: dict[str, Any] = {
        "schema": "spindle-fem/machine/1",
        "name": f"{layout}_{drive}_{cooling}".replace(" ", "_"),
        "surroundings": "workshop",
        "operation": _operation(generator, code),
        "bearing_set": [*sets, rear],
        "grease": {"catalogue": str(generator.choice(["high_speed_grease", "general_grease"]))},
        "heat": {"model": _friction(generator, layout, drive)},
    }
    content |= _bodies(generator, content, places, (drive, cooling))
    if drive == "belt":
        force = f"{generator.uniform(100.0, 1500.0):.0f} N"
        content["radial_load"] = [{"name": "belt", "force": force, "z": f"{end_of_rear + 25.0:.1f} mm"}]
    return content


def _front_sets(generator: np.random.Generator, layout: str, code: int) -> tuple[list[dict[str, Any]], float]:
    """The sets in front, mm; where they end."""
    angle = str(generator.choice(["C", "E", "AC"]))
    hybrid = " HC" if generator.random() < 0.3 else ""
    series = str(generator.choice(["719", "70"] if layout == "rollers" else ["719", "70", "72"]))
    z, sets = _Z_FRONT, []
    if layout == "rollers":
        name = f"NN30{code:02d} K"
        width = _size(name)[2]
        sets.append({"name": "front", "bearing_type": name, "bearing": [{"name": "F1", "z": f"{z:g} mm"}]})
        z += width
        series = "70"
    name = f"{series}{code:02d} {angle}{hybrid}"
    width = _size(name)[2]
    directions = ["towards_rear", "towards_rear", "towards_nose"] if layout == "triplex" else None
    directions = directions or ["towards_rear", "towards_nose"]
    gap = float(generator.choice([0.0, generator.uniform(5.0, 40.0)])) if layout != "rollers" else 0.0
    rows = []
    for number, direction in enumerate(directions):
        row = {"name": f"{'L' if sets else 'F'}{number + 1}", "z": f"{z:.4f} mm", "takes_thrust": direction}
        if layout == "unlike" and number == 1:
            row["bearing_type"] = f"{series}{code:02d} {'E' if angle == 'C' else 'C'}"
        rows.append(row)
        z += width + (gap if number == 0 else 0.0)
    light = layout == "unlike" or generator.random() < 0.3
    sets.append(
        {
            "name": "locating" if sets else "front",
            "bearing_type": name,
            "preload": f"{generator.uniform(50.0, 600.0):.0f} N" if light else _class(generator),
            "preload_kind": str(generator.choice(["rigid", "spring"])),
            "spacers": "steel",
            "carries_thrust": True,
            "carries_radial": layout != "rollers",
            "bearing": rows,
        }
    )
    return sets, z


def _class(generator: np.random.Generator) -> str:
    return str(generator.choice(["light", "medium", "heavy"]))


def _rear_set(
    generator: np.random.Generator, layout: str, code: int, z: float
) -> tuple[dict[str, Any], float]:
    if layout == "rollers":
        name = f"{generator.choice(['NN30', 'N10'])}{code:02d} K"
        row = {"name": "R1", "z": f"{z:.4f} mm"}
        clearance = {"name": "rear", "bearing_type": name, "bearing": [row]}
        return clearance, z + _size(name)[2]
    series = "60" if layout == "grooves" else str(generator.choice(["719", "70"]))
    name = f"{series}{code:02d}" + ("" if layout == "grooves" else f" {generator.choice(['C', 'E'])}")
    width = _size(name)[2]
    rows = [
        {"name": f"R{number + 1}", "z": f"{z + number * width:.4f} mm", "takes_thrust": direction}
        for number, direction in enumerate(("towards_rear", "towards_nose"))
    ]
    return {
        "name": "rear",
        "bearing_type": name,
        "preload": f"{generator.uniform(30.0, 300.0):.0f} N",
        "preload_kind": "spring" if layout == "grooves" else str(generator.choice(["rigid", "spring"])),
        "bearing": rows,
    }, z + 2.0 * width


def _operation(generator: np.random.Generator, code: int) -> dict[str, str]:
    pitch = 1.25 * 5.0 * code
    speed = 10.0 ** generator.uniform(4.5, 5.7) / pitch
    thrust = float(generator.choice([0.0, generator.uniform(-500.0, 1500.0)]))
    return {"speed": f"{speed:.0f} rpm", "thrust": f"{thrust:.0f} N", "ambient_temperature": "22 degC"}


def _friction(generator: np.random.Generator, layout: str, drive: str) -> str:
    if drive == "belt":
        # friction that each ball settles by itself takes minutes of a machine under radial load
        return str(generator.choice(["palmgren", "skf"]))
    models = ["palmgren", "skf"] if layout == "rollers" else ["palmgren", "skf", "full", "paper"]
    return str(generator.choice(models))


def _size(name: str) -> tuple[float, float, float]:
    """Bore, outside and width, mm."""
    found = boundary_dimensions(name)
    if found is None:
        raise ValueError(f"{name} does not ship.")
    bore, outside, width = (1e3 * value for value in found)
    return bore, outside, width


def _shoulder(name: str, ring: str) -> float:
    return float(catalogue_bearing(name)[ring].split()[0])


def _bodies(
    generator: np.random.Generator, content: dict[str, Any], places: dict[str, float], kinds: tuple[str, str]
) -> dict[str, Any]:
    """Shaft, housing and what is cooled and driven."""
    drive, cooling = kinds
    groups = content["bearing_set"]
    front, rear = groups[-2]["bearing_type"], groups[-1]["bearing_type"]
    bore, outside, _ = _size(front)
    small, rear_outside, _ = _size(rear)
    hollow = 0.0 if generator.random() < 0.3 and "bore" not in cooling else round(0.35 * small, 1)
    z_front, z_rear, z_end = places["front"], places["rear"], places["end"]
    nose = 0.5 * (bore + _shoulder(groups[0]["bearing_type"], "inner_ring_outer_diameter"))
    shaft = [
        ("nose", 0.0, _Z_FRONT, hollow, nose),
        ("front_seat", _Z_FRONT, z_front, hollow, bore),
        ("middle", z_front, z_rear, hollow, bore - 2.0),
        ("rear_seat", z_rear, z_end, hollow, small),
        ("drive_end", z_end, z_end + 50.0, hollow, small - 5.0),
    ]
    wall = float(generator.uniform(22.0, 60.0))
    whole = max(outside, rear_outside) + 2.0 * wall
    lip = 0.5 * (outside + _shoulder(front, "outer_ring_inner_diameter"))
    clear = bore + 24.0 if drive != "motor" else max(outside, bore + 70.0)
    clear = min(clear, whole - 20.0)
    housing = [
        ("front", _Z_FRONT, z_front, outside, whole),
        ("lip", z_front, z_front + 8.0, min(lip, outside - 1.0), whole),
        ("middle", z_front + 8.0, z_rear, clear, whole),
        ("rear", z_rear, z_end, rear_outside, whole),
    ]
    found: dict[str, Any] = {"film": []}
    if cooling == "annulus":
        inside = 0.5 * (clear + whole)
        slit = min(float(generator.uniform(2.0, 6.0)), 0.5 * (whole - inside) - 3.0)
        housing[2:3] = [
            ("middle", z_front + 8.0, z_rear, clear, inside),
            ("jacket", z_front + 8.0, z_rear, inside + 2.0 * slit, whole),
        ]
        found["film"].append(
            _circuit(generator, "jacket_flow", "housing", (z_front + 8.0, z_rear), inside)
            | {"duct": "annulus", "outer_diameter": f"{inside + 2.0 * slit:.4f} mm"}
        )
    if "bore" in cooling:
        found["film"].append(_circuit(generator, "bore_flow", "shaft", (0.0, z_end + 50.0), hollow))
    if "heli" in cooling:
        found |= _helix(generator, (z_front + 8.0, z_rear), 0.5 * clear, 0.5 * whole, cooling)
    parts = [_part("shaft", "case_hardening_steel", shaft, rotating=True), _part("housing", "steel", housing)]
    if drive == "motor":
        from_z, to_z = z_front + 25.0, z_rear - 20.0
        split = 0.5 * (bore + clear) - 4.0
        parts.append(
            _part("rotor", "electrical_steel", [("sheets", from_z, to_z, bore - 2.0, split)], rotating=True)
        )
        parts.append(_part("stator", "electrical_steel", [("sheets", from_z, to_z, split + 1.0, clear)]))
        losses = float(generator.uniform(100.0, 1500.0))
        found["source"] = [
            {"name": "stator_losses", "part": "stator", "heat": f"{losses:.0f} W"},
            {"name": "rotor_losses", "part": "rotor", "heat": f"{0.1 * losses:.0f} W"},
        ]
    if not found["film"]:
        del found["film"]
    return {"part": parts, **found}


def _part(
    name: str,
    material: str,
    segments: list[tuple[str, float, float, float, float]],
    *,
    rotating: bool = False,
) -> dict[str, Any]:
    rows = [
        {
            "name": label,
            "z": [f"{low:.4f} mm", f"{high:.4f} mm"],
            "inner_diameter": f"{inner:.4f} mm",
            "outer_diameter": f"{outer:.4f} mm",
        }
        for label, low, high, inner, outer in segments
    ]
    return {"name": name, "material": material, "rotating": rotating, "segment": rows}


def _circuit(
    generator: np.random.Generator, name: str, part: str, z: tuple[float, float], diameter: float
) -> dict[str, Any]:
    return {
        "kind": "circuit",
        "name": name,
        "part": part,
        "diameter": f"{diameter:.4f} mm",
        "z": [f"{end:.4f} mm" for end in z],
        "fluid": str(generator.choice(FLUIDS)),
        "inlet_temperature": f"{generator.uniform(15.0, 25.0):.1f} degC",
        "flow": f"{10.0 ** generator.uniform(-0.3, 1.3):.2f} L/min",
    }


def _helix(
    generator: np.random.Generator, z: tuple[float, float], inside: float, outside: float, cooling: str
) -> dict[str, Any]:
    depth = float(generator.uniform(4.0, 16.0))
    width = float(generator.uniform(6.0, 16.0))
    starts = 2 if cooling == "two helices" else 1
    pitch = starts * (width + float(generator.uniform(3.0, 14.0)))
    turns = max(1.0, np.floor((z[1] - z[0] - width - 12.0) / pitch))
    return {
        "channel": {
            "part": "housing",
            "inner_radius": f"{0.5 * (inside + outside - depth):.3f} mm",
            "depth": f"{depth:.3f} mm",
            "width": f"{width:.3f} mm",
            "pitch": f"{pitch:.3f} mm",
            "turns": float(turns),
            "starts": starts,
            "hand": str(generator.choice(["right", "left"])),
            "z_start": f"{z[0] + 5.0 + 0.5 * width:.3f} mm",
        },
        "coolant": {
            "fluid": str(generator.choice(FLUIDS)),
            "inlet_temperature": f"{generator.uniform(15.0, 25.0):.1f} degC",
            "flow": f"{10.0 ** generator.uniform(0.0, 1.5):.2f} L/min",
        },
    }


def solve_machine(content: dict[str, Any], file: Path, *, meshed: bool = True) -> tuple[str, str]:
    """Outcome of a machine: ``solved``, ``refused``, ``unsettled`` or ``failed``, and why or how warm.

    Refused: ruled out by definition, geometry, bearings or a lubricant's limit, by name; unsettled: no steady
    state by elements or network; anything else is a failure.
    """
    file.write_text(tomli_w.dumps(content), encoding="utf-8")
    try:
        spec = load_buildable(file, MESH)
    except BadInputError as error:
        return "refused", str(error)
    except Exception as error:  # noqa: BLE001 (what breaks is what is looked for)
        return "failed", f"check: {type(error).__name__}: {error}"
    try:
        state = solve_machine_network(build_machine_network(spec), OperatingPoint.of(spec))
        result = spindle_fem.solve(spec) if meshed else None
    except (BadInputError, NoEquilibriumError, OutOfValidityError) as error:
        return "refused", str(error)
    except NoSteadyStateError as error:
        return "unsettled", str(error)
    except Exception as error:  # noqa: BLE001
        word = "" if isinstance(error, SpindleFemError) else f"{type(error).__name__}: "
        return "failed", f"solve: {word}{error}"
    network = state.bearing_temperatures()
    if result is None:
        return "solved", f"{max(item.ball for item in network.values()) - 273.15:.0f} °C"
    broken = {check.name: f"{check.value:.4g} {check.unit}" for check in result.checks if not check.passed}
    if broken:
        named = ", ".join(f"{name} {value}" for name, value in broken.items())
        # too hot for its lubricant: what the machine is, not what the solver does
        return "refused" if broken.keys() <= TOO_HOT else "failed", f"checks: {named}"
    apart = max(abs(network[name].outer - item.temperature_outer) for name, item in result.bearings.items())
    warm = max(item.temperature_ball for item in result.bearings.values()) - 273.15
    return "solved", f"{warm:.0f} °C, network {apart:.1f} K apart"


def main() -> int:
    """Draw and solve; 1 if one machine failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--number", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="This one of the seed's machines alone.")
    parser.add_argument("--network", action="store_true", help="Without a mesh: geometry and network only.")
    parser.add_argument("--keep", type=Path, help="Folder for the definitions of those that failed.")
    arguments = parser.parse_args()
    counted: Counter[str] = Counter()
    begun = time.process_time()
    with tempfile.TemporaryDirectory(prefix="spindle-fem-") as folder:
        for number in range(1, arguments.number + 1):
            if arguments.only not in (None, number):
                continue
            generator = np.random.default_rng([arguments.seed, number])
            content = add_kinds(draw_machine(generator), generator)
            start = time.process_time()
            word, text = solve_machine(content, Path(folder) / "machine.toml", meshed=not arguments.network)
            counted[word] += 1
            line = " ".join(text.split())
            spent = time.process_time() - start
            print(f"{number:4d} {content['name']:32s} {word:9s} {spent:5.1f} s  {line[:300]}")
            sys.stdout.flush()
            if word == "failed" and arguments.keep is not None:
                arguments.keep.mkdir(parents=True, exist_ok=True)
                (arguments.keep / f"{arguments.seed}_{number}.toml").write_text(
                    tomli_w.dumps(content), encoding="utf-8"
                )
    told = ", ".join(f"{counted[word]} {word}" for word in ("solved", "refused", "unsettled", "failed"))
    print(f"{told}; {time.process_time() - begun:.0f} s of processor")
    return min(counted["failed"], 1)


if __name__ == "__main__":
    sys.exit(main())
