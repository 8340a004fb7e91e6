"""Measured deviation of the bearing model from each published value, as a Markdown table.

Run: ``python -m tests.published.bearing_deviations`` (prints the table of
``docs/published_bearing_values.md``). The tests beside it hold the tolerances.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_set import solve_bearing
from spindle_fem.physics.bearings.catalogue_friction import static_load_rating
from spindle_fem.physics.bearings.heat_model import HeatOptions
from spindle_fem.physics.bearings.heat_models.full import rolling_resistance_houpert
from spindle_fem.physics.bearings.heat_models.palmgren import palmgren_moment, palmgren_roller_moment
from spindle_fem.physics.bearings.heat_models.skf import skf_moment, skf_roller_moment
from spindle_fem.physics.bearings.hertz import jones_axial_constant, mean_load_constant
from spindle_fem.physics.bearings.lubricant_film import film_central_hamrock_dowson, film_groups
from spindle_fem.physics.bearings.preload import axial_state, unloading_thrust
from tests.published.test_bearing_catalogue_rows import ULTAGE, balls
from tests.published.test_catalogue_friction import (
    GROOVES,
    OIL_BATH,
    ROLLERS,
    groove,
    reference_heat,
    rollers,
)
from tests.published.test_measured_friction import (
    FRONT,
    GREASE,
    JETS,
    RUN_DOWNS,
    bath_heat,
    bath_over_minimum_oil,
    inlet,
    inlet_forces,
    jet_heat,
    ring_to_ring,
    rolling_forces,
    run_down_force,
    sump_over_mist,
)

Row = tuple[str, str, float, float]
HARRIS = BearingGeometry(22.225e-3, 16, 125.26e-3, math.radians(40.0), 0.5232, 0.5232, 206.8e9, 0.29)
LE7 = BearingGeometry(7.938e-3, 10, 38.5e-3, math.radians(20.0), 0.56, 0.52, 199.948e9, 0.25, 7750.37)


def turn(rpm: float) -> float:
    """Speed in rad/s of one in rpm."""
    return rpm * math.pi / 30.0


def rows() -> list[Row]:
    """Case, quantity, published or independently recomputed value, value of this model."""
    return [
        *static_rows(), *stiffness_rows(), *speed_rows(), *reference_speed_rows(), *measured_rows(),
        *conductance_rows(), *lubricant_rows(),
    ]  # fmt: skip


def static_rows() -> list[Row]:
    """Constants and static states."""
    rest = axial_state(HARRIS, 17_800.0)
    bare = replace(FRONT, static_load_rating=None)
    unloading = unloading_thrust((FRONT, FRONT), (1, -1), 1137.2) / 1137.2
    return [
        ("218, Harris", "K_n, N/m^1.5", 1.4637e10, mean_load_constant(HARRIS)),
        ("218, Harris", "Jones K, N/mm²", 981.0, jones_axial_constant(HARRIS) / 1e6),
        ("218 at rest, 17.8 kN", "contact angle, °", 41.505, math.degrees(rest.contact_angle)),
        ("218 at rest, 17.8 kN", "axial deflection, µm", 36.16, rest.approach * 1e6),
        ("71928, IBC", "C0, N (Z = 30)", 100_400.0, static_load_rating(bare)),
        ("71928, IBC", "C0, N (Z = 29)", 97_000.0, static_load_rating(replace(bare, ball_count=29))),
        ("71928 pair", "unloading thrust over preload", 3.35, unloading),
    ]  # fmt: skip


def stiffness_rows() -> list[Row]:
    """Catalogue stiffness of preloaded pairs (GMN)."""
    catalogue = (
        ("S 61924 C", 142.5, 15.0, 27, (340, 1030, 2060), (120, 195, 275)),
        ("S 61924 E", 142.5, 25.0, 27, (540, 1620, 3250), (290, 440, 580)),
        ("S 6017 C", 107.5, 15.0, 22, (310, 940, 1880), (101, 165, 233)),
        ("S 6017 E", 107.5, 25.0, 22, (500, 1500, 3000), (245, 370, 495)),
        ("S 6016 C", 102.5, 15.0, 21, (310, 920, 1830), (98, 159, 224)),
    )
    found = []
    for name, pitch, angle, count, preloads, stiffnesses in catalogue:
        bearing = BearingGeometry(13.494e-3, count, pitch * 1e-3, math.radians(angle), 0.52, 0.52)
        for preload, stiffness in zip(preloads, stiffnesses, strict=True):
            ours = 2.0 * axial_state(bearing, preload).stiffness * 1e-6
            found.append((f"GMN {name}, {preload} N", "pair stiffness, N/µm", float(stiffness), ours))
    # Balls by the catalogue's own rules.
    for name in ("7008 C", "7014 C", "7020 C", "7014 E", "7020 E", "71914 C", "71920 C", "71920 E"):
        *_, preload, stiffness = ULTAGE[name]
        ours = 2.0 * axial_state(balls(name), preload).stiffness * 1e-6
        found.append((f"NTN ULTAGE {name}, {preload} N", "pair stiffness, N/µm", stiffness, ours))
    return found


def reference_speed_rows() -> list[Row]:
    """Heat at the reference speed of SKF's tables (ISO 15312), by the friction models of each kind."""
    found = []
    for name, row in GROOVES.items():
        moment = skf_moment(
            groove(row), turn(row[5]), 12e-6, 0.0, 50.0 * row[4], friction_ehl=0.05, replenishment=OIL_BATH
        )
        ours = moment.total * turn(row[5])
        full = bath_heat(row, flooded=True)
        found += [
            (f"{name}, {row[5]} rpm", "SKF without drag, W", reference_heat(row), ours),
            (f"{name}, {row[5]} rpm", "full without drag, W", reference_heat(row), full),
        ]
    for name, row in ROLLERS.items():
        case = (rollers(row), turn(row[5]), 12e-6, 50.0 * row[4])
        moments = {
            "Palmgren f_0 1.5, W": palmgren_roller_moment(*case, lubrication_factor=1.5),
            "SKF without drag, W": skf_roller_moment(*case, replenishment=OIL_BATH),
        }
        for quantity, moment in moments.items():
            ours = moment.total * turn(row[5])
            found.append((f"{name}, {row[5]} rpm", quantity, reference_heat(row), ours))
    return found


def speed_rows() -> list[Row]:
    """Angles, loads and deflections at speed under outer race control."""
    cases = (
        ("218, 6000 rpm", HARRIS, 17_800.0, 6000, (44.722, 38.044, 1581.0, 1738.1, 33.13)),
        ("218, 10 000 rpm", HARRIS, 17_800.0, 10_000, (49.954, 31.341, 1453.2, 1921.3, 14.96)),
        ("LE-7, 50 000 rpm", LE7, 2670.0, 50_000, (26.233, 18.605, 604.05, 768.82, 51.93)),
        ("71928, 568.6 N, 3000 rpm", FRONT, 568.6, 3000, (18.935, 12.710, 58.41, 78.12, 8.513)),
        ("71928, 1137.2 N, 3000 rpm", FRONT, 1137.2, 3000, (18.345, 14.850, 120.44, 139.99, 16.618)),
        ("71928, 1137.2 N, 4500 rpm", FRONT, 1137.2, 4500, (19.989, 12.628, 110.89, 155.27, 13.563)),
    )
    labels = ("inner angle, °", "outer angle, °", "inner load, N", "outer load, N", "axial deflection, µm")
    found = []
    for name, bearing, load, rpm, values in cases:
        state = solve_bearing(bearing, turn(rpm), load, control="outer")
        ours = (
            *np.degrees(state.balls.contact_angle[0]),
            *state.balls.load[0],
            state.axial_displacement * 1e6,
        )
        found += [
            (name, label, value, float(own)) for label, value, own in zip(labels, values, ours, strict=True)
        ]
    return found


def measured_rows() -> list[Row]:
    """Heat with oil jets and rolling force of light contacts, as they were measured."""
    found = []
    for rpm, measured in JETS.items():
        heat, case = jet_heat(rpm), f"oil jets, 35 mm bore, 667 N, {rpm} rpm"
        found += [
            (case, "Palmgren f_0 6.6, W", measured, heat["palmgren"]),
            (case, "full with Parker's share, W", measured, heat["full"]),
        ]
    found += [
        (f"{kind} bearing, 40 mm bore", "friction, oil bath over minimum oil", 2.0, ratio)
        for kind, ratio in bath_over_minimum_oil().items()
    ]
    words = {"palmgren": "Palmgren", "skf": "SKF", "full": "full", "drag": "full with drag"}
    found += [
        (
            "angular-contact bearing (7010 C taken)",
            f"friction, oil sump over oil mist, {words[model]}",
            4 / 3,
            ratio,
        )
        for model, ratio in sump_over_mist().items()
    ]
    for size, load in RUN_DOWNS:
        for rpm in (60, 210):
            case = f"ball of {size:g} mm, {load:g} N, races at {rpm} rpm"
            measured = 1e3 * run_down_force(size, load, rpm)
            ours = 1e3 * rolling_forces(size, load, rpm)["houpert"]
            found.append((case, "Houpert rolling, mN", measured, ours))
    for load in (568.6, 1137.2, 2954.0):
        case, (starved, flooded) = f"71928, outer, {load:g} N, 3000 rpm", inlet_forces(load)
        integrated = 1e3 * inlet(load)[1]
        found += [
            (case, "flooded rolling, mN (inlet integrated)", integrated, 1e3 * flooded),
            (case, "Houpert rolling, mN (inlet integrated)", integrated, 1e3 * starved),
        ]
    return found


def conductance_rows() -> list[Row]:
    """Conduction from ring to ring through the balls by a maker's formula."""
    found = []
    for rpm in (500, 3000, 10_000):
        case, to = f"7014 C, 294 N, grease, {rpm} rpm", ring_to_ring("7014 C", 294.0, rpm)
        found += [
            (case, "ring to ring, balls wetted over 30 %, W/K", to["fag"], to["ours"]),
            (case, "ring to ring, wetted all round, W/K", to["fag"], to["wetted"]),
            (case, "ring to ring by Jungnickel, 30 %, W/K", to["jungnickel with oil"], to["ours"]),
        ]
    return found


def lubricant_rows() -> list[Row]:
    """Viscosity, film and friction of the 71928 at 1137.2 N, 3000 rpm, 40 °C."""
    state = solve_bearing(FRONT, turn(3000), 1137.2, lubricant=GREASE, control="outer")
    balls = state.balls
    gamma = FRONT.diameter_ratio * np.cos(balls.contact_angle[0])
    radius = 0.5 * FRONT.ball_diameter * (1.0 + np.array([-1.0, 1.0]) * gamma)
    kappa = balls.semi_major[0] / balls.semi_minor[0]
    groups = film_groups(0.0208, 12.87, balls.load[0], FRONT.reduced_modulus, radius, 1.8e-8)
    film = film_central_hamrock_dowson(*groups, kappa) * radius * 1e6
    rolling = rolling_resistance_houpert(FRONT.reduced_modulus, radius, kappa, *groups)
    palmgren = palmgren_moment(FRONT, turn(3000), 21e-6, 1137.2).total * turn(3000)
    skf = skf_moment(FRONT, turn(3000), 21e-6, 1137.2).total * turn(3000)
    sliding = solve_bearing(
        FRONT, turn(3000), 1137.2, lubricant=replace(GREASE, path_fill=0.0, pressure_viscosity=None),
        heat=HeatOptions("paper"),
    ).heat_W  # fmt: skip
    case = "71928, 1137.2 N, 3000 rpm"
    return [
        ("NBU 15, 60 °C", "viscosity, mm²/s", 11.342, float(GREASE.kinematic_viscosity(333.15)) * 1e6),
        ("NBU 15", "Roelands S_0", 1.0141, GREASE.roelands_temperature_exponent),
        (case, "inner film, µm", 0.911, float(film[0])),
        (case, "outer film, µm", 0.973, float(film[1])),
        (case, "Palmgren f_0 2, W", 481.9, palmgren),
        (case, "SKF, W", 497.0, skf),
        (case, "Houpert rolling, W", 210.0, 60.0 * 12.87 * float(rolling.sum())),
        (case, "sliding, W (3 to 6; 3.98 with ball positions held at race control)", 4.0, sliding),
    ]


def main() -> None:
    """Print the table."""
    print("| case | quantity | published | spindle_fem | deviation |\n|---|---|---|---|---|")
    for case, quantity, published, ours in rows():
        print(
            f"| {case} | {quantity} | {published:.6g} | {ours:.6g} | {100 * (ours / published - 1):+.2f} % |"
        )


if __name__ == "__main__":
    main()
