"""Hertz contact, static deflection, preload and catalogue stiffness against published values.

Sources: Stachowiak & Batchelor, Engineering Tribology (sphere on sphere);
comments of minzhun/ISO16281's tests, reference program MASTA (deep-groove
bearing); Harris & Kotzalas, Rolling Bearing Analysis (218 bearing); GMN High
precision ball bearings 4000 0813 EN (pair stiffness); IBC TI-I-5050.0/E
(71928.C). Values marked R were recomputed independently with exact elliptic
integrals.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from spindle_fem.physics.bearings.ball_system import build_ball_rows, join_rows, solve_bordered
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.catalogue_friction import static_load_rating
from spindle_fem.physics.bearings.hertz import (
    INNER,
    OUTER,
    bearing_contact_constants,
    contact_constants,
    jones_axial_constant,
    mean_load_constant,
)
from spindle_fem.physics.bearings.preload import (
    axial_state,
    unloading_thrust,
)
from spindle_fem.physics.bearings.race_control import static_evaluation

EXACT = 1e-3  # three to four digits are printed
BEARING_71928 = BearingGeometry(14.2875e-3, 30, 165e-3, math.radians(15.0), 0.52, 0.52)
BEARING_218 = BearingGeometry(22.225e-3, 16, 125.26e-3, math.radians(40.0), 0.5232, 0.5232, 206.8e9, 0.29)


def test_sphere_on_sphere() -> None:
    # curvatures of 10 and 15 mm radius: the reduced radius is 6 mm, not the book's 3 mm
    compliance = 2.0 * (1.0 - 0.3**2) / 210e9
    constants = contact_constants(2.0 * (1 / 10e-3 + 1 / 15e-3), 0.0, compliance)
    load = 5.0
    semi_axis = float(constants.semi_major) * load ** (1 / 3)
    assert 2.0 / compliance == pytest.approx(2.308e11, rel=EXACT)
    assert semi_axis == pytest.approx(5.799e-5, rel=EXACT)
    assert 1.5 * load / (math.pi * semi_axis**2) == pytest.approx(709.9e6, rel=EXACT)
    assert (load / float(constants.load_constant)) ** (2 / 3) == pytest.approx(5.605e-7, rel=EXACT)


def _deep_groove(clearance: float) -> BearingGeometry:
    distance = (0.52 + 0.53 - 1.0) * 11.5e-3
    angle = math.acos(1.0 - clearance / (2.0 * distance))
    return BearingGeometry(11.5e-3, 7, 43.5e-3, angle, 0.52, 0.53, 210e9, 0.3)


def _static(geometry: BearingGeometry, free: int, load: float, axial_centre: bool) -> float:
    """Displacement along one free direction of a deep-groove bearing at rest, m."""
    azimuth = 2.0 * np.pi * np.arange(geometry.ball_count) / geometry.ball_count
    offset = -geometry.curvature_centre_distance * math.sin(geometry.contact_angle) if axial_centre else 0.0
    system = join_rows([build_ball_rows(geometry, azimuth, 1.0, axial_offset=offset)], [free])
    solution = solve_bordered(
        system,
        lambda _, axial, radial: static_evaluation(system, axial, radial),
        np.zeros((system.number, 0)),
        # beyond the clearance, so that balls touch
        np.array([2e-5 + abs(offset) * (free == 0)]),
        np.array([load]),
        scales=(np.ones((system.number, 0)), np.array([load])),
        step_limit=1e-4,
    )
    assert solution.converged
    return float(solution.displacement[0])


@pytest.mark.parametrize(
    ("free", "clearance", "published_um"),
    [(1, 0.0, 15.1101), (0, 0.0, 133.5381), (1, 10e-6, 21.223), (0, 10e-6, 149.1717)],
    ids=["radial", "axial", "radial with clearance", "axial with clearance"],
)
def test_deep_groove_deflection_iso16281(free: int, clearance: float, published_um: float) -> None:
    geometry = _deep_groove(clearance)
    displacement = _static(geometry, free, 1000.0, axial_centre=True)
    assert displacement * 1e6 == pytest.approx(published_um, rel=1e-4)


def test_deep_groove_contact_constant() -> None:
    assert mean_load_constant(_deep_groove(0.0)) == pytest.approx(1.0549e10, rel=1e-4)


def test_218_contact_constants() -> None:
    inner = bearing_contact_constants(BEARING_218, BEARING_218.contact_angle, INNER)
    outer = bearing_contact_constants(BEARING_218, BEARING_218.contact_angle, OUTER)
    assert float(inner.ellipticity) == pytest.approx(8.155, rel=EXACT)
    assert float(outer.ellipticity) == pytest.approx(6.897, rel=EXACT)
    assert float(inner.load_constant) == pytest.approx(4.060e10, rel=EXACT)
    assert float(outer.load_constant) == pytest.approx(4.223e10, rel=EXACT)
    assert mean_load_constant(BEARING_218) == pytest.approx(1.4637e10, rel=EXACT)
    assert jones_axial_constant(BEARING_218) / 1e6 == pytest.approx(981.0, rel=EXACT)


@pytest.mark.parametrize(
    ("modulus", "poisson", "deflection_um"), [(206.8e9, 0.29, 36.16), (207e9, 0.30, 35.99)]
)
def test_218_static(modulus: float, poisson: float, deflection_um: float) -> None:
    bearing = BearingGeometry(22.225e-3, 16, 125.26e-3, math.radians(40.0), 0.5232, 0.5232, modulus, poisson)
    state = axial_state(bearing, 17_800.0)
    assert state.approach * 1e6 == pytest.approx(deflection_um, rel=EXACT)
    if poisson == 0.29:
        assert math.degrees(state.contact_angle) == pytest.approx(41.505, rel=EXACT)
        assert state.ball_load == pytest.approx(1678.8, rel=EXACT)


PAIRS = [
    ("S 61924 C", 13.494, 142.5, 15.0, 27, 80_000, (340, 1030, 2060), (120, 195, 275), (119.0, 193.4, 270.9)),
    ("S 61924 E", 13.494, 142.5, 25.0, 27, 76_000, (540, 1620, 3250), (290, 440, 580), (288.1, 435.2, 575.5)),
    ("S 6017 C", 13.494, 107.5, 15.0, 22, 61_500, (310, 940, 1880), (101, 165, 233), (101.6, 166.2, 233.8)),
    ("S 6017 E", 13.494, 107.5, 25.0, 22, 60_000, (500, 1500, 3000), (245, 370, 495), (245.9, 372.7, 493.8)),
    ("S 6016 C", 13.494, 102.5, 15.0, 21, 58_000, (310, 920, 1830), (98, 159, 224), (98.9, 160.5, 225.5)),
]


@pytest.mark.parametrize("row", PAIRS, ids=[row[0] for row in PAIRS])
def test_pair_stiffness_gmn_catalogue(row: tuple) -> None:
    _, ball, pitch, angle, count, rating, preloads, published, recomputed = row
    bearing = BearingGeometry(ball * 1e-3, count, pitch * 1e-3, math.radians(angle), 0.52, 0.52)
    # the catalogue rounds C0; it fixes the ball count
    assert static_load_rating(bearing) == pytest.approx(rating, rel=0.02)
    for preload, catalogue, exact in zip(preloads, published, recomputed, strict=True):
        stiffness = 2.0 * axial_state(bearing, preload).stiffness * 1e-6
        assert stiffness == pytest.approx(catalogue, rel=0.02)
        assert stiffness == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(
    ("force", "angle", "approach_um", "ball_load", "stiffness"),
    [(568.6, 16.120, 11.629, 68.26, 79.20), (1137.2, 16.701, 17.716, 131.90, 107.60)],
)
def test_71928_under_preload(
    force: float, angle: float, approach_um: float, ball_load: float, stiffness: float
) -> None:
    state = axial_state(BEARING_71928, force)
    assert math.degrees(state.contact_angle) == pytest.approx(angle, abs=1e-3)
    assert state.approach * 1e6 == pytest.approx(approach_um, abs=1e-3)
    assert state.ball_load == pytest.approx(ball_load, rel=1e-4)
    assert state.stiffness * 1e-6 == pytest.approx(stiffness, rel=1e-4)


def test_71928_constants_and_static_rating() -> None:
    assert mean_load_constant(BEARING_71928) == pytest.approx(1.239e10, rel=EXACT)
    assert jones_axial_constant(BEARING_71928) / 1e6 == pytest.approx(829.0, rel=EXACT)
    assert static_load_rating(BEARING_71928) == pytest.approx(100_400, rel=EXACT)
    with_29 = BearingGeometry(14.2875e-3, 29, 165e-3, math.radians(15.0), 0.52, 0.52)
    assert static_load_rating(with_29) == pytest.approx(97_000, rel=EXACT)


def test_unloading_thrust_of_pairs() -> None:
    pair = (BEARING_71928, BEARING_71928)
    # the 71928's angle grows: 3.35 times the preload instead of the constant-angle 2.83
    assert unloading_thrust(pair, (1, -1), 1137.2) / 1137.2 == pytest.approx(3.35, rel=2e-3)
    # tandem pair ground like a back-to-back pair of preload F, constant-angle value
    assert pytest.approx(1.36, rel=2e-3) == (2.0 / (1.0 + 2.0 ** (-2.0 / 3.0))) ** 1.5
