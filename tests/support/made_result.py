"""A result made up on a structured body, quick and with every field."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from spindle_fem.definition.load import load_machine
from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.results.thermal_result import (
    BearingResult,
    Check,
    CoolantResult,
    EnergyBalance,
    ThermalResult,
)
from spindle_fem.validity import CodedWarning


def make_result(machine: str = "wu_tan_2016", **changes) -> ThermalResult:
    """Tubes in contact under the names of a shipped machine, with made-up temperatures."""
    spec = load_machine(machine)
    mesh = build_joined_tubes(
        (0.03, 0.07, 0.079, 0.095, 0.15),
        0.1,
        ((2, 1, 1, 2), 12, 3),
        parts=PARTS,
        rotating=(True, True, False, False),
    )
    surfaces = {WALL if name == "housing.outer" else name: facets for name, facets in mesh.surfaces.items()}
    owners = {name: name.rsplit(".", 1)[0] for name in surfaces}
    areas = {WALL if name == "housing.outer" else name: area for name, area in mesh.cad_area.items()}
    mesh = dataclasses.replace(mesh, surfaces=surfaces, part_of_surface=owners, cad_area=areas)
    temperature = 300.0 + 100.0 * mesh.points[:, 2] - 50.0 * np.hypot(mesh.points[:, 0], mesh.points[:, 1])
    number = len(surfaces[WALL])
    along = np.linspace(0.1, 3.5, 12)
    bearings = {
        bearing.name: BearingResult(
            heat=100.0,
            terms={"rolling": 80.0, "sliding": 20.0, "seal": 0.0},
            heat_to={"inner": 25.0, "outer": 25.0, "balls": 50.0},
            temperature_inner=310.0,
            temperature_outer=301.0,
            temperature_ball=315.0,
            contact_angle_inner=0.3,
            contact_angle_outer=float("nan"),
            preload=1100.0,
            film_thickness=4.0e-7,
            film_thickness_ratio=5.5,
        )
        for _, bearing in spec.bearings
    }
    coolant = None
    if spec.coolant is not None:
        coolant = CoolantResult(
            asked_flow=3.5e-4,
            **{"flow": 3.3e-4, "inlet_temperature": 288.15, "outlet_temperature": 289.0, "heat": 400.0},
            **{
                "reynolds": 292.0,
                "prandtl": 1200.0,
                "velocity": 2.8,
                "regime": "laminar",
                "source": "a source",
                "in_range": False,
            },
            **{"pressure_drop": 4.2e5, "ports_pressure_drop": 0.7e5},
            **{"pumping_power": 140.0, "hydraulic_diameter": 0.0109, "length": 3.55},
            **{"wetted_area": 0.156, "position": along, "angle": along * 8.8},
            **{"bulk_temperature": 288.15 + 0.2 * along, "wall_temperature": 297.0 + 0.0 * along},
            **{"film_coefficient": 260.0 + along, "film_low": 200.0 + along, "film_high": 400.0 + along},
            **{"mean_film_coefficient": 262.0, "mean_film_low": 202.0, "mean_film_high": 402.0},
        )
    total = 100.0 * len(bearings)
    values = {
        "spec": spec,
        "speed": 314.159,
        "mesh": mesh,
        "order": 2,
        "n_unknowns": len(mesh.points),
        "temperature": temperature,
        "air_temperature": {},
        "film_coefficient": {WALL: np.full(number, 262.0)},
        "fluid_temperature": {WALL: np.full(number, 288.5)},
        "bearings": bearings,
        "coolant": coolant,
        "probes": {"SP01": 299.15},
        "energy": EnergyBalance(total, {f"{name}.balls": 100.0 for name in bearings}, {WALL: total}),
        "heat_flows": {"F1.inner_ring|shaft": -12.5},
        "area_error_relative": {WALL: 1.0e-5},
        "volume_error_relative": dict.fromkeys(PARTS, 2.0e-5),
        "temperature_minimum": float(temperature.min()),
        "temperature_maximum": float(temperature.max()),
        "temperature_maximum_at": mesh.points[temperature.argmax()],
        "checks": (Check("energy balance", 1.0e-12, 1.0e-8, "", True, "heat in equals heat out"),),
        "warnings": (CodedWarning("coolant_film_extrapolated", "Pr is <1200> & allowed 657."),),
        "iterations": {"coupling": 5},
        "timings": {"solve": 1.0},
    }
    return Motionless(**{**values, **changes})


class Motionless(ThermalResult):
    """What does not grow: the mesh is a few tubes, not the machine."""

    growth = None
    shapes: ClassVar[dict] = {}


PARTS = ("shaft", "F1.inner_ring", "F1.outer_ring", "housing")
WALL = "housing.channel_wall"
