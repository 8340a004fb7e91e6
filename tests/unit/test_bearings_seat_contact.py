"""Seats that yield together: the law inverts, Lamé's cylinders are a special case, neighbours share."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_set import solve_bearing_set
from spindle_fem.physics.bearings.fits import RingFits, SeatedRings, seated_rings
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.heat_model import HeatOptions
from spindle_fem.physics.bearings.mounting import (
    BearingSet,
    BearingTemperatures,
    MountedBearing,
    SetTemperatures,
)
from spindle_fem.physics.bearings.seat_contact import SeatBodies

BEARING = BearingGeometry(
    14.2875e-3, 30, 165e-3, math.radians(15.0), 0.52, 0.52,
    bore_diameter=0.140, outer_diameter=0.190, width=0.024,
)  # fmt: skip
FITS = RingFits(8e-6, 5e-6, 0.300, 0.060, 0.158, 0.172)
GREASE = Lubricant(21e-6, 4.7e-6, pressure_viscosity=1.8e-8)
EXPANSION = BEARING.thermal_expansion


def lame_bodies(rings: SeatedRings, count: int) -> SeatBodies:
    """The cylinders of one bearing, so many times, none of which feels another."""
    inner, outer, width = rings.inner_ring, rings.outer_ring, rings.width
    at_inner, at_outer = (2.0 * math.pi * r * width for r in (inner.outside, outer.inside))
    eye = np.eye(count)
    softness = (
        inner.bore_by_bore_pressure + rings.shaft.outside_by_outside_pressure,
        outer.outside_by_outside_pressure + rings.housing.bore_by_bore_pressure,
    )
    by_force = np.array(
        [-inner.bore_by_outside_pressure / at_inner, -outer.outside_by_bore_pressure / at_outer]
    )
    by_pressure = np.array([[inner.outside_by_bore_pressure, outer.bore_by_outside_pressure]])
    bore, outside = inner.spin_growth(1.0)
    return SeatBodies(
        np.tile([-0.5 * rings.inner_interference, 0.5 * rings.outer_clearance], count),
        np.diag(np.tile(softness, count)),
        np.kron(eye, by_force[:, None]),
        np.tile([2.0 * math.pi * r * width for r in (inner.inside, outer.outside)], count),
        np.kron(eye, by_pressure),
        np.tile(
            [inner.outside_by_outside_pressure / at_inner, outer.bore_by_bore_pressure / at_outer], (count, 1)
        ),
        np.tile([bore - rings.shaft.spin_growth(1.0)[1], 0.0], count),
        np.full(count, outside),
        np.tile([inner.outside, outer.inside], (count, 1)),
    )


def coupled_bodies() -> SeatBodies:
    """Two bearings on one shaft and in one housing, which yield to the neighbour by 70 % as well."""
    rings = seated_rings(BEARING, FITS)
    bodies = lame_bodies(rings, 2)
    yielding = bodies.yielding.copy()
    shared = (rings.shaft.outside_by_outside_pressure, rings.housing.bore_by_bore_pressure)
    for (first, second), own in zip(((0, 2), (1, 3)), shared, strict=True):
        yielding[first, second] = yielding[second, first] = 0.7 * own
    return replace(bodies, yielding=yielding)


STATES = (
    np.zeros((2, 4)),
    np.array([[9e-6, 6e-6, 0.0, 0.0], [1e-6, -8e-6, 2e-6, 1e-6]]),
)


@pytest.mark.parametrize("thermal", STATES, ids=["assembled", "one loose"])
def test_forces_leave_the_growths_that_they_came_from(thermal) -> None:
    law = coupled_bodies().law(thermal, 300.0, np.array([100.0, 120.0]))
    force = np.array([2000.0, 5000.0])
    found, _ = law.force(law.growth(force))
    np.testing.assert_allclose(found, force, rtol=1e-9)


def test_forces_fall_with_the_growths_as_their_differences_do() -> None:
    law = coupled_bodies().law(STATES[0])
    growth = law.growth(np.array([2000.0, 5000.0]))
    step = 1e-10
    differences = np.stack(
        [(law.force(growth)[0] - law.force(growth + row)[0]) / step for row in step * np.eye(2)]
    )
    fall = law.force(growth)[1]
    np.testing.assert_allclose(differences.T, fall, rtol=1e-4, atol=1e-4 * fall.max())
    assert fall[0, 1] != 0.0
    assert np.linalg.eigvalsh(fall + fall.T).min() > 0.0


def test_a_tight_neighbour_loosens_a_press_fit() -> None:
    """The neighbour's pressure squeezes the same shaft and spreads the same housing."""
    bodies = coupled_bodies()
    alone, _ = bodies.of([0]).law().seats(np.array([3000.0]))
    together, _ = bodies.law().seats(np.array([3000.0, 3000.0]))
    own, shared = bodies.yielding[0, 0], bodies.yielding[0, 2]
    assert together[0] == pytest.approx(alone[0] * own / (own + shared), rel=1e-9)
    assert together[0] < 0.95 * alone[0]


def heated_set(seats: SeatBodies | None) -> tuple[BearingSet, SetTemperatures]:
    names = ("A", "B")
    bearings = tuple(
        MountedBearing(n, BEARING, s, 0.03 * s, FITS) for n, s in zip(names, (1, -1), strict=True)
    )
    around = BearingTemperatures(310.0, 304.0, 308.0, shaft_seat=309.0, housing_seat=302.0)
    cold = 293.15
    rises = {
        key: EXPANSION * (getattr(around, key) - cold)
        for key in ("inner_ring", "outer_ring", "shaft_seat", "housing_seat")
    }
    shifts = np.array([
        0.070 * (rises["inner_ring"] - rises["shaft_seat"]),
        0.095 * (rises["housing_seat"] - rises["outer_ring"]),
        0.079 * rises["inner_ring"],
        0.086 * rises["outer_ring"],
    ])  # fmt: skip
    temperatures = SetTemperatures(
        (around,) * 2, 309.0, 302.0, cold, None if seats is None else np.tile(shifts, (2, 1))
    )
    return BearingSet(bearings, preload=1000.0, seats=seats), temperatures


def test_bodies_that_are_cylinders_are_lame_s() -> None:
    """One law by two ways: loads, angles and heat of a warm, turning set agree."""
    found = []
    for seats in (None, lame_bodies(seated_rings(BEARING, FITS), 2)):
        mounted, temperatures = heated_set(seats)
        states = solve_bearing_set(
            mounted,
            200.0,
            300.0,
            temperatures,
            lubricant=GREASE,
            control="outer",
            heat=HeatOptions("palmgren"),
        )
        found.append([(s.axial_force, s.contact_angle_inner, s.preload, s.heat.total) for s in states])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-7)
    assert found[0][0][2] > 1200.0
