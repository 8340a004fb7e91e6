"""Concealed cases of coupled mechanics: the second ball set, and what a case holds."""

import gzip
import json

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.recordings.align import read_recording
from validation.ball_set import FRONT, REAR, BallSet, Warmth
from validation.cycles import draw_drive
from validation.generate_coupled import PLACES, PRELOAD, SIDES, displacement, make_case, stated_uncertainty
from validation.identify import Study
from validation.laws import HeatShape
from validation.recorder import Noise
from validation.reduction import load_reduced
from validation.stepping import Path, nominal_machine


def front(clearance):
    return BallSet(FRONT, SIDES["F"], PLACES["F"], PRELOAD, clearance)


def warm(difference, over_housing=4.0):
    outer = np.full(3, 20.0 + over_housing)
    return Warmth(outer + difference, outer, outer + difference - 1.0, np.full(3, 20.0))


EVEN = Warmth(*(np.full(3, 20.0) for _ in range(4)))


def test_a_cold_set_carries_its_preload_and_thrust():
    loads = front(15e-6).ball_loads(EVEN, 0.0)
    # Two in tandem share what the third bears alone; balls press at some 18°, rings having given way.
    assert 30 * loads * np.sin(np.deg2rad(17.5)) == pytest.approx(
        [PRELOAD / 2, PRELOAD / 2, PRELOAD], rel=0.15
    )
    loaded = front(15e-6).ball_loads(EVEN, 1750.0)
    assert np.all(loaded[:2] > 1.5 * loads[:2])
    assert loaded[2] < 0.7 * loads[2]


def test_ball_stiffness_is_that_of_the_218_in_harris():
    """22.23 mm balls on a pitch of 125.25 mm at 40°, grooves 0.5232: 1.4637e10 N/m^1.5 by its tables."""
    found = type(FRONT)(
        22.23e-3, 16, 0.12525, 0.09, 0.16, 0.03, 0.11, 0.14, np.deg2rad(40.0), 0.5232
    ).stiffness()
    assert found == pytest.approx(1.46e10, rel=0.03)


@pytest.mark.parametrize("clearance", [5e-6, 15e-6, 30e-6])
def test_warm_inner_rings_press_harder_the_tighter_the_seat(clearance):
    seats = front(clearance)
    loads = [seats.ball_loads(warm(d), 0.0)[0] for d in (0.0, 5.0, 10.0)]
    assert loads[0] < loads[1] < loads[2]
    assert front(30e-6).ball_loads(warm(10.0), 0.0)[0] <= loads[2] * (1.0 + 1e-9)


def test_an_even_rise_only_loosens_or_tightens_by_the_housing():
    """Steel all over and a housing whose wall grows as freely keeps the preload but for iron growing less."""
    rear = BallSet(REAR, SIDES["R"], PLACES["R"], PRELOAD, 30e-6)
    cold, hot = (rear.ball_loads(Warmth(*(np.full(2, t) for _ in range(4))), 0.0) for t in (20.0, 30.0))
    assert hot == pytest.approx(cold, rel=0.15)


@pytest.fixture(scope="module")
def reduced(tmp_path_factory):
    return load_reduced(tmp_path_factory.mktemp("cache"), sectors=8, size=60, draws=1)


def test_an_even_rise_moves_the_nose_as_shaft_and_housing_expand(reduced):
    path = Path(np.zeros(1), 30.0 * reduced.uniform[None], np.zeros((1, 6)))
    still, fast = (displacement(reduced, path, np.array([rpm]))[0] for rpm in (0.0, 3000.0))
    assert still == pytest.approx(1e7 * (12.5e-6 * 0.125 - 10.5e-6 * 0.060), rel=1e-3)
    # A shaft of 180 and 140 mm shortens by half a micrometre at 3000 rpm.
    assert still - fast == pytest.approx(0.5, abs=0.15)


def test_a_case_can_be_read_and_says_what_it_conceals(reduced, tmp_path):
    answer = make_case(reduced, tmp_path, 91, 1, identify=False)
    assert [e["effect"] for e in answer["effects"]] == ["thermal_preload"]
    assert 5.0 <= answer["effects"][0]["parameters"]["outer_clearance"]["value"] <= 30.0
    inputs = tmp_path / "inputs" / "case_0001"
    recording = read_recording(inputs)
    assert recording.displacement_names == ("S1",)
    assert np.ptp(np.nan_to_num(1e6 * recording.displacements)) > 5.0
    assert load_machine(inputs / "machine.toml").displacement_sensor[0].name == "S1"
    with gzip.open(inputs / "recording.csv.gz", "rt") as stream:
        assert stream.readline().rstrip().endswith(",S1")
    consistent = make_case(reduced, tmp_path, 91, 10, identify=False)
    assert consistent["effects"] == []
    assert json.loads((tmp_path / "answers" / "case_0010.json").read_text())["family"] == "temperatures alone"


def test_what_a_table_of_heat_leaves_open_takes_up_heat_that_is_off_over_speed(reduced):
    plan, noise = draw_drive(np.random.default_rng(2), cycle="staircase"), Noise(0.05, 0.03, 1500.0)
    off, left = HeatShape("F", 0.08, 2, 4500.0), []
    for loose in ((), stated_uncertainty()):
        study = Study(reduced, plan, None, nominal_machine(), noise, loose=loose)
        left.append(study.fit_through_model(study.simulate([off]), None, np.empty((0, 0)))[0])
    assert left[0] > 1.0
    assert left[1] < 0.3 * left[0]
