"""Friction, film and heat path of cylindrical rollers: hand values, limits, the load that drives friction."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.errors import OutOfValidityError, SpecError
from spindle_fem.physics.bearings.contact_conduction import ball_conductance
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.heat_model import HeatOptions
from spindle_fem.physics.bearings.heat_models.palmgren import palmgren_roller_moment
from spindle_fem.physics.bearings.heat_models.skf import skf_roller_moment
from spindle_fem.physics.bearings.hertz import INNER
from spindle_fem.physics.bearings.line_contact import half_roller_resistance, ring_constriction
from spindle_fem.physics.bearings.mounting import (
    BearingTemperatures,
    ExternalLoad,
    SetTemperatures,
    uniform_temperatures,
)
from spindle_fem.physics.bearings.roller_bearing import LOAD_SUM, RollerGeometry, solve_roller_bearing
from spindle_fem.physics.bearings.roller_set import RollerSet, solve_roller_set

RPM = math.pi / 30.0
GREASE = Lubricant(22e-6, 5e-6)
N1014 = RollerGeometry(9e-3, 8e-3, 27, 91e-3, bore_diameter=0.070, outer_diameter=0.110)
NN3014 = replace(N1014, rows=2)


def state(geometry, load=0.0, rpm=3000.0, celsius=40.0, model="palmgren"):
    rollers = RollerSet(("R",), geometry)
    ((found,),) = solve_roller_set(
        rollers,
        rpm * RPM,
        ExternalLoad(0.0, load),
        [uniform_temperatures(1, celsius + 273.15)],
        lubricant=GREASE,
        heat=HeatOptions(model),
    )
    return found


def test_palmgren_moment_of_a_row_by_hand():
    # M_0 = 1e-7 f_0 (ν n)^(2/3) d_m³ and M_1 = f_1 F d_m, in mm, mm²/s, rpm
    moment = palmgren_roller_moment(N1014, 3000 * RPM, 20e-6, 1000.0)
    assert moment.parts["viscous"] == pytest.approx(1e-10 * (20 * 3000) ** (2 / 3) * 91**3)
    assert moment.parts["load"] == pytest.approx(1e-3 * 2e-4 * 1000 * 91)
    double = palmgren_roller_moment(NN3014, 3000 * RPM, 20e-6, 1000.0)
    assert double.parts["viscous"] == pytest.approx(2.0 * moment.parts["viscous"])
    assert double.parts["load"] == pytest.approx(moment.parts["load"])
    oil_bath = replace(N1014, palmgren_lubrication_factor=3.0)
    assert palmgren_roller_moment(oil_bath, 3000 * RPM, 20e-6, 0.0).total == pytest.approx(
        3.0 * moment.parts["viscous"]
    )


def test_skf_moment_of_a_row_by_hand():
    # N1014 at 3000 rpm, 20 mm²/s, 1 kN: d_m 90 mm; φ_ish and φ_rs with K_Z 5.1, K_rs 6e-8
    shear = 1.0 / (1.0 + 1.84e-9 * (3000 * 90) ** 1.28 * 20**0.64)
    starved = math.exp(-6e-8 * 20 * 3000 * 180 * math.sqrt(5.1 / (2 * 40)))
    rolling = shear * starved * 1.12e-6 * 90**2.41 * 1000**0.31 * (20 * 3000) ** 0.6
    boundary = math.exp(-2.6e-8 * (20 * 3000) ** 1.4 * 90)
    sliding = (boundary * 0.15 + (1.0 - boundary) * 0.02) * 1.5e-3 * 90 * 1000
    moment = skf_roller_moment(N1014, 3000 * RPM, 20e-6, 1000.0)
    assert moment.parts["rolling"] * 1e3 == pytest.approx(rolling, rel=1e-12)
    assert moment.parts["sliding"] * 1e3 == pytest.approx(sliding, rel=1e-12)


def test_both_catalogues_agree_about_a_usual_bearing():
    """Two laws of different makers and decades, at the load and speed of a lathe: within a factor of two."""
    heat = [state(NN3014, 2000.0, 4000.0, model=model).heat.total for model in ("palmgren", "skf")]
    assert 0.5 < heat[0] / heat[1] < 2.0


def test_a_bearing_without_clearance_is_driven_by_its_radial_load():
    many = RollerGeometry(1e-3, 8e-3, 250, 91e-3)
    assert pytest.approx(1.258, abs=1e-3) == LOAD_SUM
    assert solve_roller_bearing(many, 500.0).driving_load == pytest.approx(500.0, rel=1e-3)


def test_a_preloaded_bearing_rubs_without_a_load():
    terms = [
        state(replace(NN3014, radial_clearance=-1e-6 * depth), rpm=1000.0).terms_W["load"]
        for depth in (0, 2, 4)
    ]
    # 108 contacts on either ring, each with the approach of 1 µm on its side
    one = solve_roller_bearing(replace(NN3014, radial_clearance=-4e-6), 0.0).load[:, INNER]
    assert terms[2] == pytest.approx(2e-4 * 54 * one[0] / LOAD_SUM * 0.091 * 1000 * RPM, rel=0.01)
    assert terms[0] < 0.05 * terms[1] < terms[1] < 0.6 * terms[2]


def test_heat_follows_the_load_zone():
    """With more clearance fewer rollers carry one load: their sum, and with it friction, is less."""
    loads = [
        solve_roller_bearing(replace(NN3014, radial_clearance=1e-6 * width), 1000.0).driving_load
        for width in (0, 20, 60)
    ]
    assert 1000.0 > 0.999 * loads[0] > loads[1] > loads[2] > 1000.0 / LOAD_SUM


def test_warm_inner_rings_close_the_clearance():
    rollers = RollerSet(("R",), replace(NN3014, radial_clearance=20e-6))
    cold = 293.15
    around = BearingTemperatures(cold + 20.0, cold + 10.0, cold + 15.0)
    inside, outside = NN3014.raceway_diameters
    grown = 12.5e-6 * (20.0 * inside - 10.0 * outside + 2.0 * 15.0 * 9e-3)
    assert rollers.at(0.0, around, cold).radial_clearance == pytest.approx(20e-6 - grown, abs=1e-12)
    # a ring of 82 mm on a shaft with a bore of 30 mm at 6000 rpm grows by some 0.8 µm
    spun = replace(rollers, shaft_bore_diameter=0.030).at(6000 * RPM, around, cold).radial_clearance
    assert 0.4e-6 < 20e-6 - grown - spun < 1.5e-6
    temperatures = SetTemperatures((around,), cold, cold, cold)
    tight = replace(rollers, geometry=replace(NN3014, radial_clearance=0.0))
    ((found,),) = solve_roller_set(tight, 0.0, ExternalLoad(), [temperatures], lubricant=GREASE)
    assert found.balls.load[:, INNER].min() > 0.0


def test_film_of_a_loaded_roller_by_hand():
    found = state(N1014, 1000.0)
    top = int(np.argmax(found.balls.load[:, INNER]))
    load = found.balls.load[top, INNER]
    modulus, radius = 2.0 / N1014.compliance, 0.5 * 9e-3 * (1.0 - 9 / 91)
    speed = 0.25 * 91e-3 * 3000 * RPM * (1.0 - (9 / 91) ** 2)
    film = (
        3.06
        * radius
        * (float(GREASE.dynamic_viscosity(np.array([313.15]))[0]) * speed / (modulus * radius)) ** 0.69
        * (float(GREASE.pressure_viscosity_coefficient(np.array([313.15]))[0]) * modulus) ** 0.56
        * (load / (modulus * radius * 8e-3)) ** -0.10
    )
    assert found.balls.film_isothermal[top, INNER] == pytest.approx(film, rel=1e-9)
    assert found.thinnest_film == pytest.approx(found.balls.film_central[top, INNER])
    assert 0.8 * film < found.thinnest_film < film
    # the unloaded ones have a film at the outer ring only
    assert np.isnan(found.balls.film_central[:, INNER]).any()


@pytest.mark.parametrize("half_width", [2e-5, 1e-4])
def test_heat_path_of_a_roller_against_collocation(half_width):
    """Isothermal strips on a disc, and one in a row of them on a thick wall: flux by strips of flux."""
    number, radius, spacing = 60, 4.5e-3, 4.8e-3
    ends = half_width * np.cos(np.pi * np.arange(number + 1) / number)[::-1]
    middle, width = 0.5 * (ends[1:] + ends[:-1]), np.diff(ends)
    apart = middle[:, None] - middle

    def resistance(image):
        """Of a strip at 1 K: logarithmic potential of its pieces and of what the image adds, per k L."""
        near = np.where(np.eye(number, dtype=bool), width * np.exp(-1.0) / 2.0, np.abs(apart))
        potential = -(np.log(near) + image) / np.pi
        flux = np.linalg.solve(potential, np.ones(number))
        return 1.0 / flux.sum()

    disc = resistance(np.full((number, number), -math.log(2.0 * radius)))
    assert half_roller_resistance(half_width, 2.0 * radius, 1.0, 1.0) == pytest.approx(disc, rel=5e-3)
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.pi * apart / (2.0 * spacing)
        periodic = np.log(np.where(angle == 0.0, 1.0, np.abs(np.sin(angle) / np.where(angle == 0, 1, angle))))
    wall = resistance(periodic + math.log(np.pi / spacing))
    assert ring_constriction(half_width, spacing, 1.0, 1.0) == pytest.approx(wall, rel=5e-3)


def test_conductance_rises_with_load_and_does_not_end_without_it():
    values = [
        ball_conductance(state(replace(NN3014, radial_clearance=clearance), load), GREASE).inner_contact
        for clearance, load in ((20e-6, 0.0), (20e-6, 1000.0), (0.0, 1000.0), (-4e-6, 0.0))
    ]
    assert 1.0 < values[0] < values[1] < values[2] < values[3] < 12.0
    at_rest = state(replace(NN3014, radial_clearance=20e-6), rpm=0.0)
    assert ball_conductance(at_rest, GREASE).inner == pytest.approx(
        ball_conductance(at_rest, GREASE).outer, rel=0.1
    )
    assert ball_conductance(at_rest).inner == 0.0


def test_bearings_of_a_set_share_the_radial_load_and_refuse_any_other():
    rollers = RollerSet(("A", "B"), NN3014)
    warm = [uniform_temperatures(2, 313.15)]
    ((first, second),) = solve_roller_set(rollers, 100.0, ExternalLoad(0.0, 1000.0), warm)
    assert (first.name, second.name, first.radial_force) == ("A", "B", 500.0)
    assert (first.balls.load[:, INNER] @ np.cos(first.balls.azimuth)) == pytest.approx(500.0, rel=1e-9)
    with pytest.raises(SpecError, match="thrust 10 N"):
        solve_roller_set(rollers, 100.0, ExternalLoad(10.0), warm)
    with pytest.raises(OutOfValidityError, match=r'"full" knows no rollers.*palmgren, skf'):
        solve_roller_set(rollers, 100.0, ExternalLoad(), warm, lubricant=GREASE, heat=HeatOptions("full"))


def test_rollers_that_nothing_loads_are_told():
    found = state(replace(NN3014, radial_clearance=20e-6))
    assert "rollers_unloaded" in {note.code for note in found.warnings}
    hard = state(NN3014, 400e3)
    assert "contact_pressure" in {note.code for note in hard.warnings}
