"""Jackets of grooves, axial bores, purge air and cutting fluid, each by hand."""

import math

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from spindle_fem.definition.circuit_tables import Film
from spindle_fem.operation.circuits import (
    CircuitMarch,
    capacity_rate,
    coolant_temperatures,
    duct_flow,
    stream_answer,
    stream_warnings,
    wall_cells,
)
from spindle_fem.physics.coolant.coolants.air import Air
from spindle_fem.physics.coolant.duct_films.straight import nusselt_gnielinski_straight
from spindle_fem.physics.coolant.duct_films.turning import nusselt_gazley
from spindle_fem.physics.coolant.duct_friction import channel_pressure_drop
from spindle_fem.physics.coolant.falling_film import nusselt_schnabel
from spindle_fem.physics.coolant.rectangular_duct import laminar_numbers
from spindle_fem.physics.coolant.regimes import ChannelState, critical_reynolds_schmidt, select_film

BASE = {
    "kind": "circuit", "name": "jacket", "part": "sleeve", "diameter": "100 mm", "z": ["0 mm", "60 mm"],
    "fluid": "water", "inlet_temperature": "20 degC", "flow": "6 L/min", "cells": 4,
}  # fmt: skip
RINGS = BASE | {"duct": "ring_grooves", "width": "6 mm", "depth": "4 mm", "number": 5}
HELIX = BASE | {"duct": "helical_groove", "width": "8 mm", "depth": "5 mm", "turns": 5, "law": "helical"}
BORES = BASE | {"duct": "axial_bores", "bore_diameter": "10 mm", "number": 12, "passes": 6}
PURGE = BASE | {
    "duct": "annulus", "outer_diameter": "101 mm", "fluid": "air", "flow": "100 L/min", "law": "turning",
}  # fmt: skip
WET = {
    "kind": "wetted", "name": "fluid", "surface": ["nose"], "width": "200 mm", "length": "157 mm",
    "fluid": "water", "inlet_temperature": "20 degC", "flow": "5 L/min",
}  # fmt: skip
RPM = math.pi / 30.0


def film_of(table):
    return TypeAdapter(Film).validate_python(table)


def balance(film, wall):
    """Heat that walls give and that the stream carries away, and its outlet, W and K."""
    conductance = dict.fromkeys(film.surface, 3.0)
    walls = dict(zip(film.surface, wall, strict=True))
    bulk, outlet = coolant_temperatures(film, conductance, walls, film.inlet_temperature)
    given = sum(3.0 * (walls[name] - bulk[name]) for name in film.surface)
    return given, capacity_rate(film) * (outlet - film.inlet_temperature), bulk


# Fully developed values of Shah & London (1978), tables of the rectangular duct.
@pytest.mark.parametrize(
    ("aspect", "nusselt", "friction"), [(1.0, 2.976, 56.91), (0.5, 3.391, 62.19), (0.125, 5.597, 82.34)]
)
def test_laminar_numbers_of_rectangles_are_the_published_ones(aspect, nusselt, friction):
    found = laminar_numbers(aspect * 8e-3, 8e-3)
    assert found == (pytest.approx(nusselt, rel=0.003), pytest.approx(friction, rel=0.003))


def test_ring_grooves_by_hand():
    # 6 L/min over ten half rings: 10 cm3/s through 24 mm2.
    film = film_of(RINGS)
    flow, answer = duct_flow(film), stream_answer(film, 0.0)
    assert flow.velocity == pytest.approx(1e-5 / 24e-6, rel=1e-12)
    assert flow.reynolds == pytest.approx(flow.velocity * 4.8e-3 / 1.0034e-6, rel=1e-3)
    assert 1_900.0 < flow.reynolds < 2_100.0
    wetted = 5 * (6.0 + 2 * 4.0) / 60.0
    nusselt = answer.coefficient / wetted * 4.8e-3 / 0.598
    assert 4.0 < nusselt < 12.0
    assert answer.pressure_drop > 1.5 * 0.5 * 998.0 * flow.velocity**2


def test_a_cover_takes_its_width_and_half_of_the_sides():
    covered, bare = film_of(RINGS | {"outer_part": "housing"}), film_of(RINGS)
    assert covered.cell_surfaces[1] == ("jacket.2", "jacket.cover.2")
    floor, cover = covered.walls[:2]
    assert (floor.part, cover.part, cover.where[0].facing) == ("sleeve", "housing", "inward")
    assert cover.where[0].r[0] == pytest.approx(54e-3)
    inside = film_of(RINGS | {"outer_part": "tube", "wall": "inside"}).walls[1].where[0]
    assert (inside.facing, inside.r[0]) == ("outward", pytest.approx(46e-3))
    coefficients = [stream_answer(film, 0.0).coefficient for film in (covered, bare)]
    assert coefficients[0] / coefficients[1] == pytest.approx((6.0 + 4.0) / (6.0 + 2 * 4.0), rel=1e-12)
    given, taken, _ = balance(covered, [310.0, 305.0] * 4)
    assert given == pytest.approx(taken, rel=1e-12)


def test_cells_of_ring_grooves_are_side_by_side():
    film = film_of(RINGS)
    given, taken, bulk = balance(film, [310.0, 300.0, 300.0, 310.0])
    assert given == pytest.approx(taken, rel=1e-12)
    assert bulk["jacket.1"] == pytest.approx(bulk["jacket.4"], abs=1e-12)
    assert bulk["jacket.2"] == pytest.approx(bulk["jacket.3"], abs=1e-12)
    # Each has a quarter of the flow: 1 - exp(-N) of the way to its wall.
    rate = capacity_rate(film) / 4.0
    expected = 3.0 * rate / 3.0 * -math.expm1(-3.0 / rate) * (310.0 - 293.15)
    assert 3.0 * (310.0 - bulk["jacket.1"]) == pytest.approx(expected, rel=1e-12)


def test_derivatives_of_cells_side_by_side_are_those_of_differences():
    film, cell = film_of(RINGS), wall_cells(film_of(RINGS))
    value = np.array([2.0, 3.0, 4.0, 5.0])
    step = CircuitMarch.of(film, value * (1.0 + 1e-20j), cell)
    ends = [CircuitMarch.of(film, value * (1.0 + sign * 1e-6), cell).warming for sign in (1.0, -1.0)]
    assert np.imag(step.warming) / 1e-20 == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-7)


def test_a_stator_jacket_has_the_film_of_the_channel():
    film = film_of(HELIX)
    flow, answer = duct_flow(film), stream_answer(film, 0.0)
    state = ChannelState(flow.coolant, 1e-4, 293.15)
    channel = select_film("helical", flow.section.helix, state)
    assert answer.coefficient == pytest.approx(float(channel.value) * 5 * 18.0 / 60.0, rel=1e-12)
    assert 1_000.0 < float(channel.value) < 20_000.0
    given, taken, bulk = balance(film, [310.0] * 4)
    assert given == pytest.approx(taken, rel=1e-12)
    assert np.all(np.diff(list(bulk.values())) > 0.0)


@pytest.mark.parametrize("law", ["helical", "straight"])
@pytest.mark.parametrize("litres", [0.6, 6.0, 20.0, 60.0])
def test_a_stator_jacket_has_the_friction_and_the_regimes_of_the_channel(law, litres):
    flow = duct_flow(film_of(HELIX | {"law": law, "flow": f"{litres} L/min"}))
    helix = flow.section.helix
    critical = float(critical_reynolds_schmidt(helix.curvature_ratio))
    channel = channel_pressure_drop(helix, flow.volume_flow, flow.properties, critical)
    assert flow.pressure_drop == pytest.approx(channel.channel, rel=1e-12)
    state = ChannelState(flow.coolant, flow.volume_flow, 293.15)
    assert flow.regime == select_film("helical", helix, state).regime


def test_axial_bores_with_turns_by_hand():
    # Two paths of six 60 mm bores: 50 cm3/s each through 78.5 mm2.
    film = film_of(BORES)
    flow = duct_flow(film)
    assert flow.velocity == pytest.approx(5e-5 / (0.25 * math.pi * 1e-4), rel=1e-12)
    assert flow.slenderness == pytest.approx(36.0)
    head = 0.5 * 998.2 * flow.velocity**2
    straight = duct_flow(film_of(BORES | {"passes": 1, "flow": "36 L/min"}))
    assert straight.velocity == pytest.approx(flow.velocity, rel=1e-12)
    assert flow.pressure_drop == pytest.approx(6.0 * straight.pressure_drop + 12.0 * head, rel=1e-4)
    area = 12 * math.pi * 10e-3 * 60e-3
    drawn = math.pi * 100e-3 * 60e-3
    assert flow.section.wetted_ratio == pytest.approx(area / drawn, rel=1e-12)


def test_purge_air_by_hand():
    # 100 L/min through 0.5 mm around 100 mm: 10.6 m/s along, and half of 52 m/s around at 10 000 rpm.
    film = film_of(PURGE)
    at_rest, turning = stream_answer(film, 0.0), stream_answer(film, 10_000 * RPM)
    assert turning.capacity_rate == pytest.approx(1.204 * 1006.0 * 1e-1 / 60.0, rel=1e-3)
    assert turning.velocity == pytest.approx(1e-1 / 60.0 / (0.25 * math.pi * (0.101**2 - 0.1**2)), rel=1e-9)
    effective = math.hypot(turning.velocity, 0.25 * 10_000 * RPM * 0.1)
    viscosity = float(Air().properties(293.15).kinematic_viscosity)
    nusselt = 0.03 * (effective * 1e-3 / viscosity) ** 0.8
    assert turning.coefficient == pytest.approx(nusselt * 0.0257 / 1e-3, rel=0.01)
    assert turning.coefficient > at_rest.coefficient
    assert not stream_warnings(film, turning)
    (warning,) = stream_warnings(film, stream_answer(film, 1.0e6 * RPM))
    assert "reynolds" in warning.text


def test_properties_of_air_are_those_of_tables():
    # VDI Heat Atlas, dry air at 1 bar and 20 degC: 25.87 mW/(m K), 18.2 uPa s.
    air = Air().properties(293.15)
    assert float(air.thermal_conductivity) == pytest.approx(25.87e-3, rel=0.01)
    assert float(air.dynamic_viscosity) == pytest.approx(18.2e-6, rel=0.01)


def test_cutting_fluid_by_hand():
    # 5 L/min of water over 200 mm: Re = 415, film some 3800 W/(m2 K), 348 W/K.
    film = film_of(WET)
    answer = stream_answer(film, 0.0)
    assert answer.reynolds == pytest.approx(5e-3 / 60.0 / 0.2 / 1.0034e-6, rel=1e-3)
    scale = (1.0034e-6**2 / 9.81) ** (1.0 / 3.0)
    turbulent = 0.0136 * answer.reynolds**0.4 * answer.prandtl**0.344
    assert answer.coefficient == pytest.approx(turbulent * 0.598 / scale, rel=2e-3)
    assert answer.capacity_rate == pytest.approx(998.2 * 4184.0 * 5e-3 / 60.0, rel=1e-3)
    given, taken, _ = balance(film, [320.0])
    assert given == pytest.approx(taken, rel=1e-12)


def test_a_thin_film_conducts_by_nusselts_law():
    # Laminar and developed, Nu = 1.3 Re^(-1/3).
    assert float(nusselt_schnabel(10.0, 7.0, 1e-9)) == pytest.approx(1.3 * 10.0 ** (-1.0 / 3.0))


def test_a_pump_that_gives_less_drives_less():
    wide = BORES | {"flow": "24 L/min"}
    free = stream_answer(film_of(wide), 0.0)
    film = film_of(wide | {"pressure_limit": f"{0.25 * free.pressure_drop:.9f} Pa"})
    held = stream_answer(film, 0.0)
    assert held.pressure_drop == pytest.approx(0.25 * free.pressure_drop, rel=1e-6)
    # Turns and turbulent friction take nearly the square of the flow.
    assert 0.45 < held.volume_flow / free.volume_flow < 0.5
    assert held.capacity_rate / free.capacity_rate == pytest.approx(held.volume_flow / free.volume_flow)
    (warning,) = stream_warnings(film, held)
    assert warning.code == "coolant_flow_limited"
    assert "jacket" in warning.text


def test_what_no_pump_drives_and_what_expands_are_told():
    (warning,) = (
        item
        for item in stream_warnings(*_asked(BORES | {"flow": "200 L/min"}))
        if item.code == "coolant_pressure"
    )
    assert "6 bar" in warning.text
    told = [item.text for item in stream_warnings(*_asked(PURGE | {"flow": "1000 L/min"}))]
    assert any("air expands" in text for text in told)


def _asked(table):
    film = film_of(table)
    return film, stream_answer(film, 0.0)


@pytest.mark.parametrize(
    ("table", "fault"),
    [
        (RINGS | {"width": None}, "needs it"),
        (RINGS | {"number": 11}, "do not fit"),
        (BASE | {"width": "5 mm"}, "ring_grooves"),
        (BORES | {"passes": 5}, "evenly"),
        (BASE | {"duct": "annulus"}, "outer_diameter"),
        (HELIX | {"law": "turning"}, None),
    ],
)
def test_faults_say_what_is_allowed(table, fault):
    if fault is None:
        with pytest.raises(Exception, match="annulus"):
            stream_answer(film_of(table), 0.0)
        return
    with pytest.raises(ValidationError) as raised:
        film_of({key: value for key, value in table.items() if value is not None})
    assert fault in str(raised.value)


def test_falling_films_are_those_of_theory_where_there_is_one():
    """Nusselt's film with Lévêque's entry, and developed, Nu = 1.885 on its thickness."""
    for reynolds, prandtl, entry in ((300.0, 7.0, 1.0e-2), (50.0, 100.0, 1.0e-2), (300.0, 7.0, 0.1)):
        # Gradient at the wall g δ/ν with δ³ = 3 ν² Re/g, on the length (ν²/g)^(1/3).
        slope = np.cbrt(3.0 * reynolds) * prandtl * entry
        leveque = 1.5 / math.gamma(4.0 / 3.0) * np.cbrt(slope / 9.0)
        assert nusselt_schnabel(reynolds, prandtl, entry) == pytest.approx(leveque, rel=0.002)
    developed = 0.25 * 7.541 / np.cbrt(3.0 * 5.0)
    assert nusselt_schnabel(5.0, 7.0, 1.0e-9) == pytest.approx(developed, rel=0.007)


def test_a_turning_gap_against_a_still_duct():
    """Gazley's film is 1.6 to 1.7 times that of a smooth duct in which nothing turns."""
    for reynolds in (1.0e4, 3.0e4, 1.0e5):
        still = nusselt_gnielinski_straight(reynolds, 0.7, 1.0e6)
        assert nusselt_gazley(reynolds, 0.7) / still == pytest.approx(1.65, abs=0.06)
