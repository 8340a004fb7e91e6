"""Friction of a set over rings and fit: interpolation, its derivatives, and the term made of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.effects.catalogue.thermal_preload import (
    MECHANICS,
    NAME,
    PreloadMechanicsTerm,
    ThermalPreload,
)
from spindle_fem.effects.framework.term import TermContext
from spindle_fem.effects.registry import build, definition_entry
from tests.support.effect_machines import _spindle
from tests.support.set_response import OUTER_RING, SHAFT, THRUST, log_friction, set_response

STEP = 1e-30


def test_between_and_beyond_the_points():
    response = set_response()
    difference, gap, speed = np.array([3.3, 12.0]), np.array([2.2e-6, -7e-6]), np.array([150.0, 300.0])
    thrust = np.array([0.3, 1.6]) * THRUST
    found = response.friction(difference, gap, speed, thrust)
    for bearing in range(3):
        exact = log_friction(difference, gap, speed, thrust, bearing)
        assert found[bearing].real == pytest.approx(exact, abs=2e-4)
    ends = [response.friction([45.0 + x], [0.0], [300.0], [THRUST]).real for x in (0.0, 1.0, 10.0)]
    assert ends[2] - ends[0] == pytest.approx(10.0 * (ends[1] - ends[0]))
    fast, faster = (response.friction([5.0], [0.0], [n], [THRUST]).real for n in (450.0, 900.0))
    assert fast == pytest.approx(faster)
    most, more = (response.friction([5.0], [0.0], [300.0], [n * THRUST]).real for n in (2.0, 3.0))
    assert most == pytest.approx(more)


def test_a_set_that_carries_no_thrust_does_not_see_it():
    response = set_response()
    alone = replace(response, thrust=response.thrust[1:2], log_friction=response.log_friction[:, :, :, 1:2])
    for thrust in (0.0, THRUST):
        found = alone.friction([7.0], [1e-6], [200.0], [thrust])
        assert found == pytest.approx(response.friction([7.0], [1e-6], [200.0], [THRUST]))


@pytest.mark.parametrize("gap", [-40e-6, -3e-6, 60e-6])
def test_complex_steps_carry_the_derivatives(gap):
    response = set_response()
    at = np.array([4.0, 50.0])
    exact = response.friction(at + 1j * STEP, np.full(2, gap), np.full(2, 200.0), 0.0).imag / STEP
    near = [
        response.friction(at + side * 1e-4, np.full(2, gap), np.full(2, 200.0), 0.0).real for side in (1, -1)
    ]
    assert exact == pytest.approx((near[0] - near[1]) / 2e-4, rel=1e-5)
    by_gap = response.friction(at, np.full(2, gap) + 1j * STEP, np.full(2, 200.0), 0.0).imag / STEP
    near = [
        response.friction(at, np.full(2, gap + side), np.full(2, 200.0), 0.0).real for side in (1e-10, -1e-10)
    ]
    assert by_gap == pytest.approx((near[0] - near[1]) / 2e-10, rel=1e-4, abs=1e-3)


def term_of(response):
    rings = [tuple(f"{name}.{side}_ring" for name in response.bearings) for side in ("inner", "outer")]
    return PreloadMechanicsTerm("t", *rings, response)


def context(term, temperatures, state, speed=300.0, thrust=THRUST, **own):
    values = term.values({f"t.{name}": value for name, value in own.items()})
    parameters = {name: np.array([value], dtype=complex) for name, value in values.items()}
    read = np.array(temperatures, dtype=complex)[:, None]
    return TermContext(
        0.0, {"speed": speed, "thrust": thrust}, read, np.array(state, dtype=complex)[:, None], parameters
    )


def test_the_amplitude_is_the_mean_increase_at_ten_kelvin():
    term = term_of(set_response())
    for size in (0.05, term.increase):
        factor = term.friction(context(term, [293.15] * 8, [10.0, 0.0], **{NAME: size})).real[:, 0]
        assert factor.mean() == pytest.approx(1.0 + size)
        assert factor[2] > factor[1] > factor[0]
    assert term.friction(context(term, [293.15] * 8, [10.0, 0.0])).real == pytest.approx(1.0)


def test_an_even_set_shares_its_friction():
    term = term_of(set_response())
    at = ([293.15] * 8, [10.0, 0.0])
    even = term.friction(context(term, *at, **{NAME: 1.0, "unevenness": 0.0})).real[:, 0]
    assert even == pytest.approx(even[0])
    uneven = [
        np.ptp(term.friction(context(term, *at, **{NAME: 1.0, "unevenness": u})).real) for u in (0.5, 1.0)
    ]
    assert 0.0 < uneven[0] < uneven[1]


def test_friction_that_follows_load_weakly_may_still_differ_between_bearings_as_the_loads_do():
    term = term_of(set_response())
    at = ([293.15] * 8, [10.0, 0.0])

    def share_of_the_last(exponent, unevenness):
        own = {NAME: 0.3, "exponent_factor": exponent, "unevenness": unevenness}
        added = term.friction(context(term, *at, **own)).real[:, 0] - 1.0
        return added[-1] / added[0]

    by_load = share_of_the_last(1.0, 1.0)
    # (m + u d) / (m - u d) = ((m + d) / (m - d))² has u = 2 / (1 + (d / m)²)
    assert share_of_the_last(0.5, 1.5) < by_load < share_of_the_last(0.5, 2.0)
    (own,) = (p for p in term.parameters if p.name == "unevenness")
    assert own.high > 2.5


def test_a_slack_set_keeps_some_friction():
    term = term_of(set_response())
    for size in (0.1, 3.0 * term.increase):
        factor = term.friction(context(term, [293.15] * 8, [-20.0, 0.0], **{NAME: size})).real
        assert np.all((factor > 0.0) & (factor < 1.0))


def test_a_bearing_that_thrust_relieves_follows_its_preload_more():
    term = term_of(set_response())
    at = ([293.15] * 8, [10.0, 0.0])
    none, heavy = (
        term.friction(context(term, *at, thrust=thrust, **{NAME: 0.3})).real[[0, 2], 0]
        for thrust in (0.0, 2.0 * THRUST)
    )
    assert none[0] > heavy[0]
    assert none[1] < heavy[1]


def test_outer_rings_close_the_gap_that_the_housing_opens():
    response = set_response()
    term = term_of(response)
    warm = [310.0, 311.0, 312.0, 303.0, 304.0, 305.0, 306.0, 299.0]
    moved = term.advance(context(term, warm, [1.0, 0.0], lag=600.0), 600.0)[:, 0].real
    closing = (304.0 - 293.15) - response.housing["housing"] / OUTER_RING * (299.0 - 293.15)
    kept = np.exp(-1.0)
    spread = 7.0 - SHAFT["shaft"] * (311.0 - 306.0)
    assert moved == pytest.approx([spread - (spread - 1.0) * kept, closing * (1.0 - kept)])
    half = term.advance(context(term, warm, [1.0, 0.0], lag=600.0, housing_share=0.5), 600.0)[1, 0].real
    rise = response.housing["housing"] / OUTER_RING * (299.0 - 293.15)
    assert half == pytest.approx((closing + 0.5 * rise) * (1.0 - kept))
    tight, loose = (
        term.friction(context(term, warm, [5.0, 8.0], **{NAME: 1.0, "outer_clearance": c})).real
        for c in (0.0, 40e-6)
    )
    assert np.all(tight > loose)


def test_mechanics_stand_beside_the_power_law(tmp_path):
    view = _spindle(tmp_path)[2]
    known = replace(view, preload=lambda group: set_response() if group == "front_bearings" else None)
    labels = [item.label for item in ThermalPreload().candidates(known)]
    assert labels == [
        "thermal_preload @ front_bearings",
        f"thermal_preload @ front_bearings ({MECHANICS})",
        "thermal_preload @ rear_bearings",
    ]


def test_a_definition_takes_what_a_diagnosis_wrote(tmp_path):
    view = replace(_spindle(tmp_path)[2], preload=lambda group: set_response())
    candidate = next(item for item in ThermalPreload().candidates(view) if item.form == MECHANICS)
    values = {f"{candidate.terms[0].name}.outer_clearance": 17e-6, candidate.amplitude: 0.3}
    entry = definition_entry(candidate, values)
    assert entry["form"] == MECHANICS
    again = build(entry["effect"], entry["component"], entry["form"], entry["parameters"], view)
    assert not again.free
    assert again.parameters[candidate.amplitude].value == pytest.approx(0.3)
    told = ThermalPreload().report(candidate, values)
    assert (told["outer_clearance"].value, told["outer_clearance"].unit) == (pytest.approx(17.0), "um")
    said = ThermalPreload().statement(candidate, told)
    assert "30 % higher" in said
    assert "mechanics" in said
